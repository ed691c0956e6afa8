"""A picture for every snippet: its crop where the site has one, else a part of its keyframe."""

from collections.abc import Iterable

from pipeline.records import Snippet
from sitegen.figure2 import Picture, Place
from sitegen.gathered import VideoMedia
from sitegen.numerals import number


def snippet_pictures(media: VideoMedia, snippets: Iterable[Snippet]) -> dict[Place, Picture]:
    """Track id and frame -> picture, for the snippets that lie on a keyframe of the site.

    The keyframes' small pictures are on the page anyway, so a part of one loads nothing more.
    """
    thumbs = {frame.index: frame.thumb for frame in media.frames}
    pictures: dict[Place, Picture] = {}
    for snippet in snippets:
        place = snippet.track_box.track_id, snippet.track_box.frame_index
        box = snippet.track_box.box
        x1, x2 = (min(max(x, 0.0), float(media.width_px)) for x in (box.x1_px, box.x2_px))
        y1, y2 = (min(max(y, 0.0), float(media.height_px)) for y in (box.y1_px, box.y2_px))
        if place[1] in thumbs and x2 - x1 >= 1 and y2 - y1 >= 1:
            view = " ".join(map(number, (x1, y1, x2 - x1, y2 - y1)))
            pictures[place] = Picture(thumbs[place[1]], media.width_px, media.height_px, view)
    for crop in media.crops:
        pictures[crop.track_id, crop.frame_index] = Picture(
            crop.path, crop.picture_width_px, crop.picture_height_px
        )
    return pictures
