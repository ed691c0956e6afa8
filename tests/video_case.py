"""A small site whose systems have hand-written failures, for the tests of a video's page."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

import sitegen.build
from sitegen.build import build_site
from sitegen.failures import Blame, Failure, FailureKind
from sitegen.gathered import SiteData
from tests.site_fixtures import make_benchmark, make_board

NOT_RANKED = "The scene descriptions mention it; the ranked hazards do not."


def failure(kind: FailureKind, video: str, hazard: str | None, rank: int | None, evidence: str) -> Failure:
    return Failure(kind, video, hazard, rank, 0.25, evidence, True)


BLAMES = {
    "good-system": (failure(FailureKind.EXTRA, "v3", None, 1, "It speaks of none."),),
    "evil": (
        failure(FailureKind.NOT_RANKED, "v1", "h1", None, NOT_RANKED),
        failure(FailureKind.WRONG_OBJECT, "v1", None, 1, "It mentions no cat."),
        failure(FailureKind.OTHER_WORDS, "v2", "h1", 1, "Caption 1 names it."),
        failure(FailureKind.NOT_SEEN, "v2", "h2", None, "None mentions it."),
    ),
    "silent": (failure(FailureKind.NOTHING_SAID, "v1", "h1", None, "No caption."),),
}


def make_site(benchmark_folder: Path, out: Path) -> Path:
    """Build it in `out`; what is tested with it are pages, not who finds the failures."""
    benchmark = make_benchmark(benchmark_folder)
    gather = sitegen.build.gather

    def gather_blamed(*given: Any, **named: Any) -> SiteData:
        data = gather(*given, **named)
        blames = [Blame(BLAMES.get(system.slug, BLAMES["evil"]), ()) for system in data.systems]
        systems = [replace(system, blame=blame) for system, blame in zip(data.systems, blames, strict=True)]
        return replace(data, systems=tuple(systems))

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sitegen.build, "gather", gather_blamed)
        build_site(benchmark, out, make_board(benchmark))
    return out
