"""What the probes say, in sentences that commands show in English and pages in their own language."""

from sitegen.language import N_, Said, fixed, whole
from sitegen.language import gettext as _
from sitegen.numerals import percent, plural


def said(message: str) -> Said:
    """A message without numbers, marked by `N_`."""
    return Said(lambda: _(message))


def share(value: float) -> Said:
    """A share in [0, 1]."""
    return Said(lambda: percent(value))


def from_share(value: float, message: str) -> Said:
    """From which share on a probe speaks; `message`, marked by `N_`, has it at `{share}`."""
    return Said(lambda: _(message).format(share=percent(value)))


def from_share_of_hazards(value: float, least: int) -> Said:
    """The same, of hazards that are so many at least."""
    return Said(lambda: _("from {share}, at least {n} hazards").format(share=percent(value), n=least))


def over_captions(limit: float) -> Said:
    """Above how many captions a video a probe speaks."""
    return Said(lambda: _("over {n} captions a video").format(n=fixed(limit, 0)))


def captions_a_video(mean: float) -> Said:
    """How many there are on average."""
    return Said(lambda: _("{mean} captions a video").format(mean=fixed(mean, 1)))


def few_videos(videos: int) -> Said:
    """That so few videos have captions."""
    return Said(
        lambda: plural(
            videos, "Captions in {n} video are too few to say.", "Captions in {n} videos are too few to say."
        )
    )


def few_with_hazard(videos: int) -> Said:
    """That so few videos with a hazard have captions."""
    return Said(
        lambda: plural(
            videos,
            "Captions in {n} video with a hazard are too few to say.",
            "Captions in {n} videos with a hazard are too few to say.",
        )
    )


def few_captions(total: int) -> Said:
    """That there are so few captions."""
    return Said(
        lambda: plural(total, "{n} caption in all: too few to say.", "{n} captions in all: too few to say.")
    )


def most_common(count: int, videos: int) -> Said:
    """How many of the videos with captions have the most common one."""
    text = N_("The most common caption is given in {n} of the {total} videos that have captions.")
    return Said(lambda: _(text).format(n=whole(count), total=whole(videos)))


def bags(count: int, total: int) -> Said:
    """How many captions are bags of common words."""
    text = N_("Common words strung together without a sentence: {n} of {total} captions.")
    return Said(lambda: _(text).format(n=whole(count), total=whole(total)))


def exchanged(besm: tuple[float, float], detected: tuple[float, float], videos: int) -> Said:
    """BESM, and how many videos are detected: with the captions of others, and with their own."""
    text = N_(
        "With the captions of other videos BESM is {other_besm} instead of {own_besm}, and {other} instead "
        "of {own} of the {videos} videos with a hazard are detected."
    )
    return Said(
        lambda: _(text).format(
            other_besm=fixed(besm[0], 4),
            own_besm=fixed(besm[1], 4),
            other=fixed(detected[0], 1),
            own=fixed(detected[1], 0),
            videos=whole(videos),
        )
    )


def captions_on_average(videos: int, mean: float, most: int) -> Said:
    """How many captions the videos have that have any."""
    text = N_("Over {videos} with captions: {mean} captions on average, {most} at most.")
    return Said(
        lambda: _(text).format(
            videos=plural(videos, "{n} video", "{n} videos"), mean=fixed(mean, 1), most=whole(most)
        )
    )


def same_captions(name: str, same: int, either: int) -> Said:
    """In how many of the videos that either captions another submission has the same captions."""
    text = N_("The same captions as “{name}” in {n} of {videos}.")
    return Said(
        lambda: _(text).format(name=name, n=whole(same), videos=plural(either, "{n} video", "{n} videos"))
    )


def no_long_truth(words: int) -> Said:
    """That the truth has no description of so many words."""
    return Said(lambda: _("No hazard is described in {n} words or more.").format(n=words))


def exact_words(count: int, total: int) -> Said:
    """How many hazards are described in the words of the truth."""
    text = N_("Described in exactly the words of the truth: {n} of {hazards}.")
    return Said(lambda: _(text).format(n=whole(count), hazards=plural(total, "{n} hazard", "{n} hazards")))
