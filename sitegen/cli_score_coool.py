"""The command `score --coool`: COOOL's three figures for a results file."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from pipeline import console
from sitegen.cli_common import given, here, say_warnings

if TYPE_CHECKING:
    from sitegen.coool_score import CooolScore

CooolOption = Annotated[
    bool, typer.Option("--coool", help="Score a results.csv by the rules of the COOOL challenge instead.")
]
DriverTruthOption = Annotated[
    Path | None,
    typer.Option(
        help="With --coool: CSV (video_id,changed_at_frame; empty: never). "
        "Default: driver_states.csv beside the truth."
    ),
]
ClipsOption = Annotated[
    Path | None,
    typer.Option(help="With --coool: folder of clips, for their lengths. Default: the benchmark folder's."),
]

RESULTS = "results.csv"

_WORDS = {"driver_state": "driver state", "hazards": "hazard tracks", "names": "hazard names"}


def score_coool(
    file: str,
    context: typer.Context,
    truth: Path | None,
    driver_truth: Path | None,
    videos: Path | None,
    video_map: Path | None,
    *,
    as_json: bool,
) -> None:
    """Score a results.csv and print the figures; those without truth are said to have none."""
    from sitegen.coool_results import frame_counts, read_results
    from sitegen.coool_score import coool_score
    from sitegen.driver_states import FILE_NAME, read_driver_states
    from sitegen.readers import read_truth, read_video_map

    truth_path = truth or here().truth
    hazards = read_truth(truth_path)
    beside = truth_path.with_name(FILE_NAME)
    states_path = driver_truth or (beside if beside.is_file() else None)
    known = {hazard.video_id for hazard in hazards}
    states = read_driver_states(states_path, known) if states_path else {}
    path, name = _results(file, context)
    results = read_results(path, hazards, read_video_map(video_map) if video_map else {}, name)
    counts, odd = frame_counts(results, hazards, states, _lengths(videos, known))
    score = coool_score(results, hazards, states, counts)
    warnings = [*results.warnings, *odd]
    say_warnings(warnings)
    if as_json:
        console.print_json({"file": name, "sha256": results.sha256, **_json(score), "warnings": warnings})
    else:
        _print(score)


def _results(file: str, context: typer.Context) -> tuple[Path, str]:
    """The results.csv that a path or URL means, and what messages call it."""
    from pipeline.errors import InputError

    named = given(file, context, (RESULTS,))
    if not named.home.is_dir():
        return named.home, named.name
    path = named.home / RESULTS
    if not path.is_file():
        raise InputError(
            f"{file}: found a folder without {RESULTS}; expected one with it, or the file itself. "
            "These rules score what is said of every frame, which shards of predictions do not hold."
        )
    return path, f"{file.rstrip('/')}/{RESULTS}"


def _lengths(videos: Path | None, known: set[str]) -> dict[str, int]:
    """The frames in the clips that are there; none where there is no folder of clips."""
    from pipeline.errors import ConfigError
    from pipeline.places import Place
    from pipeline.run import find_videos, video_id_of
    from pipeline.video import probe

    try:
        folder = videos or here().videos
    except ConfigError:
        return {}
    if videos is None and not folder.is_dir():
        return {}
    clips = {video_id_of(place): Path(place.where) for place in find_videos(Place(str(folder)))}
    wanted = sorted(known & clips.keys())
    lengths = {}
    with console.progress() as bar:
        for video in bar.track(wanted, description="clips"):
            lengths[video] = probe(clips[video], video).frame_count
    return lengths


def _json(score: "CooolScore") -> dict[str, Any]:
    from dataclasses import asdict

    from sitegen.coool_score import FIGURES

    return {
        "macro_average": score.macro,
        "figures": {name: asdict(score.figures[name]) for name in FIGURES if name in score.figures},
        "no_truth": [name for name in FIGURES if name not in score.figures],
        "videos": [
            {"video_id": video.video_id, **{name: video.mean(name) for name in FIGURES}}
            for video in score.videos
        ],
    }


def _print(score: "CooolScore") -> None:
    from rich.table import Table

    from sitegen.coool_score import FIGURES

    table = Table(box=None, pad_edge=False, header_style="bold")
    for heading in ("figure", "accuracy", "of all frames", "videos", "frames"):
        table.add_column(heading, justify="left" if heading == "figure" else "right")
    for name in FIGURES:
        figure = score.figures.get(name)
        if figure is None:
            table.add_row(_WORDS[name], "no truth for it")
        else:
            cells = (f"{figure.value:.4f}", f"{figure.per_frame:.4f}", str(figure.videos), str(figure.frames))
            table.add_row(_WORDS[name], *cells)
    if score.macro is not None:
        table.add_row("macro average", f"{score.macro:.4f}")
    output = console.stdout()
    output.print(table)
    there = ", ".join(_WORDS[name] for name in FIGURES if name in score.figures)
    output.print(f"the average is of: {there or 'nothing'}", markup=False, soft_wrap=True)
