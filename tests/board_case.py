"""The leaderboard of generated systems in a folder, with its data, without building a site."""

from dataclasses import replace
from pathlib import Path

from sitegen import charts
from sitegen.board_files import board_files
from sitegen.contexts import Shell
from sitegen.gathered import SiteData
from sitegen.ledger import Entry
from sitegen.page_board import leaderboard_page
from sitegen.probes import Probe
from sitegen.rendering import environment, find_templates
from tests.compare_case import board

SHELL = Shell("Generated", "Systems on videos.", "", "leaderboard", "Generated", "0")
FIGURES = "data/leaderboard.js"


def entry(date: str, slug: str, besm: float | None, event: str = "add") -> Entry:
    """A line of a ledger."""
    return Entry.model_validate(
        {"event": event, "slug": slug, "name": slug.title(), "date": date, "besm": besm}
        | {"predictions_sha256": "0" * 64}
    )


def site_data(n_videos: int = 130, n_systems: int = 5) -> SiteData:
    """Generated systems with a ledger of two days; in one of them a probe speaks."""
    data = board(n_videos, n_systems)
    probe = Probe(
        "stuffing", "Caption list", 7.0, "7 captions a video", 3.0, "3", True, "It says <b>a lot</b>."
    )
    last = replace(data.systems[-1], probes=(probe,))
    cards = {system.slug: system.evaluation.card.besm for system in data.systems}
    ledger = [
        entry(f"2026-01-0{2 + place % 2}", slug, besm) for place, (slug, besm) in enumerate(cards.items())
    ]
    ledger.sort(key=lambda one: one.date)
    return replace(data, systems=(*data.systems[:-1], last), ledger=tuple(ledger))


def page_text(data: SiteData) -> str:
    """index.html of these data."""
    shell = replace(SHELL, hidden=data.hidden)
    page = leaderboard_page(data, shell, FIGURES, (), "")
    return environment().get_template("leaderboard.html").render(page=page, shell=shell)


def write_page(data: SiteData, folder: Path) -> Path:
    """index.html with its assets, data and charts (of a tiny stand-in for plotly)."""
    files = dict(board_files(data))
    files["index.html"] = page_text(data).encode()
    files[FIGURES] = charts.data_file({})
    for path in (find_templates() / "assets").iterdir():
        files[f"assets/{path.name}"] = path.read_bytes()
    files["assets/plotly.min.js"] = b"window.Plotly = { react() {} };\n"
    for name, content in files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)
    return folder
