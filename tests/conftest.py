"""Settings that all tests share, and what those in a browser start from."""

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from hypothesis import settings

from tests.browser_setup import ARGUMENTS, find_chromium

if TYPE_CHECKING:
    from playwright.sync_api import Browser, BrowserContext

# Deadlines measure the machine, not the code.
settings.register_profile("coooler", deadline=None, derandomize=True)
settings.load_profile("coooler")


@pytest.fixture(scope="module")
def browser() -> "Iterator[Browser]":
    """A Chromium for the tests of one file."""
    from playwright.sync_api import sync_playwright

    executable = find_chromium()
    assert executable, "No Chromium; run: python -m tests.browser_setup"
    with (
        sync_playwright() as playwright,
        playwright.chromium.launch(executable_path=executable, args=list(ARGUMENTS)) as started,
    ):
        yield started


@pytest.fixture(scope="module")
def served(site: Path) -> Iterator[str]:
    """The address of the file's own `site`, served."""
    from sitegen.serve import serving

    with serving(site) as address:
        yield address


@pytest.fixture
def context(browser: "Browser") -> "Iterator[BrowserContext]":
    """A wide window without any memory of others."""
    with browser.new_context(viewport={"width": 1440, "height": 900}) as made:
        yield made


@pytest.fixture(params=["file", "http"])
def root(request: pytest.FixtureRequest, site: Path, served: str) -> str:
    """Where the file's `site` begins, opened by double-click and from a server."""
    return site.as_uri() if request.param == "file" else served
