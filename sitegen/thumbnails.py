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
    right, bottom = float(media.width_px), float(media.height_px)
    for snippet in snippets:
        track_box = snippet.track_box
        thumb = thumbs.get(track_box.frame_index)
        if thumb is None:
            continue
        box = track_box.box
        x1, x2 = min(max(box.x1_px, 0.0), right), min(max(box.x2_px, 0.0), right)
        y1, y2 = min(max(box.y1_px, 0.0), bottom), min(max(box.y2_px, 0.0), bottom)
        if x2 - x1 >= 1 and y2 - y1 >= 1:
            view = f"{number(x1)} {number(y1)} {number(x2 - x1)} {number(y2 - y1)}"
            picture = Picture(thumb, media.width_px, media.height_px, view)
            pictures[track_box.track_id, track_box.frame_index] = picture
    for crop in media.crops:
        pictures[crop.track_id, crop.frame_index] = Picture(
            crop.path, crop.picture_width_px, crop.picture_height_px
        )
    return pictures
