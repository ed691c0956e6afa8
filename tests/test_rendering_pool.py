"""Pages by worker processes are the pages of one process; what fails says on which page."""

from dataclasses import replace
from functools import partial

import pytest
from markupsafe import escape

from sitegen import rendering_pool
from sitegen.pages import Page, make_pages
from sitegen.rendering import render
from sitegen.rendering_pool import FEW, rendered
from sitegen.templating import counted, said, shown
from tests.compare_case import board
from tests.site_fixtures import EVIL


def test_many_pages_are_those_of_one_process_in_their_order() -> None:
    pages = list(make_pages(board(FEW + 20, 2)))
    assert sum(bool(page.shows) for page in pages) > FEW
    alone = [(page.path, render(page, "https://e.org/")) for page in pages]
    shared = rendered(pages, "https://e.org/", "en", 2)
    assert [(page.path, made) for page, made in shared] == alone


def test_few_pages_are_rendered_here() -> None:
    pages = list(make_pages(board(4, 1)))
    asked: list[str] = []

    def here(page: Page, address: str) -> bytes:
        asked.append(page.path)
        return page.path.encode() + address.encode()

    assert [made for _, made in rendered(pages, "!", "en", 8, here)] == [f"{p.path}!".encode() for p in pages]
    assert asked == [page.path for page in pages]


@pytest.mark.parametrize("jobs", [1, 2])
def test_an_error_names_its_page(jobs: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rendering_pool, "FEW", 20)
    pages = list(make_pages(board(40, 1)))
    place = next(n for n, page in enumerate(pages) if page.path == "videos/v0030.html")
    pages[place] = replace(pages[place], make=partial(int, "no page"))
    with pytest.raises(ValueError, match="no page") as caught:
        list(rendered(pages, "", "en", jobs))
    assert caught.value.__notes__ == ["This happened in the page videos/v0030.html."]


def test_what_is_shown_is_escaped_once() -> None:
    for text in (EVIL, "a & b", "'", '"', "<", ">", "plain"):
        assert shown(text) == escape(text)
        assert shown(shown(EVIL)) == shown(EVIL)
        assert said("by %(name)s, 5 %%", name=text) == f"by {escape(text)}, 5 %"
    assert counted("%(num)s of <b>%(x)s</b>", "%(num)s", 1, x="<") == "1 of <b>&lt;</b>"
    assert said("95 %%") == "95 %" and shown(-3) == "-3" and shown(True) == "True"
