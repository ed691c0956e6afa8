"""A page of few videos is named by what it shows: other systems and other videos do not change its key."""

from dataclasses import replace

import pytest

from sitegen.gathered import SiteData
from sitegen.pages import make_pages
from tests.compare_case import board

PAGES = 3


@pytest.fixture(scope="module")
def data() -> SiteData:
    """450 videos: three pages of each of three submissions."""
    return board(450, 3)


def keys(data: SiteData) -> dict[str, str]:
    return {page.path: page.shows for page in make_pages(data) if page.shows}


def changed(before: SiteData, after: SiteData) -> set[str]:
    old, new = keys(before), keys(after)
    return {path for path, key in new.items() if old.get(path) != key}


def lines(paths: set[str]) -> set[str]:
    return {path for path in paths if path.startswith("submissions/")}


def test_all_but_the_first_page_of_a_submission_have_a_key(data: SiteData) -> None:
    wanted = {f"submissions/system-{system}/{page}.html" for system in range(3) for page in (2, PAGES)}
    assert lines(set(keys(data))) == wanted


def test_a_system_less_changes_no_lines_of_the_others(data: SiteData) -> None:
    fewer = replace(data, systems=data.systems[:-1])
    found = changed(data, fewer)
    assert lines(found) == set()
    assert len(found) == len(data.truth), "each video page shows every system"


@pytest.mark.parametrize("what", ["truth", "words", "score", "name", "benchmark"])
def test_what_lines_show_changes_their_key(data: SiteData, what: str) -> None:
    system, video_id = data.systems[0], data.video_ids[430]  # on the third page
    evaluation = system.evaluation
    page = {f"submissions/{system.slug}/{PAGES}.html"}
    if what == "truth":
        rows = tuple(replace(row, label="Another") for row in data.truth[video_id])
        after = replace(data, truth={**data.truth, video_id: rows})
        page = {f"submissions/{one.slug}/{PAGES}.html" for one in data.systems}
    elif what == "benchmark":
        after = replace(data, settings=data.settings.model_copy(update={"name": "Other"}))
        page = lines(set(keys(data)))
    else:
        if what == "score":
            videos = tuple(
                replace(one, besm=0.123) if one.video_id == video_id else one for one in evaluation.videos
            )
            evaluation = replace(evaluation, videos=videos)
        elif what == "words":
            said = tuple(
                replace(one, description="Other words") if one.video_id == video_id else one
                for one in evaluation.submission.predictions
            )
            evaluation = replace(evaluation, submission=replace(evaluation.submission, predictions=said))
        else:
            evaluation = replace(evaluation, submission=replace(evaluation.submission, name="Other"))
            page = {f"submissions/{system.slug}/{number}.html" for number in (2, PAGES)}
        after = replace(data, systems=(replace(system, evaluation=evaluation), *data.systems[1:]))
    assert lines(changed(data, after)) == page
