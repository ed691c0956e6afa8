"""The demo's video pages: making and writing them against writing the same bytes, and against bare jinja2."""

import tempfile
from collections.abc import Iterable
from pathlib import Path

from bench.timing import Measure, interleaved
from pipeline.benchmark import Benchmark
from pipeline.memory import collected_rarely
from sitegen.board import evaluate_board
from sitegen.build import build_site
from sitegen.gather import gather, read_boxes, read_truth_by_video
from sitegen.gathered import SiteData
from sitegen.language import ENGLISH, speaking
from sitegen.media import media_from_json
from sitegen.output import open_output
from sitegen.pages import Page, make_pages
from sitegen.rendering import environment, render
from sitegen.rendering_pool import rendered


def demo_data(benchmark: Benchmark, folder: Path) -> SiteData:
    """What the site is made of, its pictures made in `folder`."""
    board = evaluate_board(benchmark)
    build_site(benchmark, folder, board)
    entries = open_output(folder).before.media
    media = {video_id: media_from_json(entry["media"]) for video_id, entry in entries.items()}
    truth = read_truth_by_video(benchmark)
    return gather(benchmark, truth, read_boxes(benchmark, truth), media, board)


@collected_rarely()
def write(out: Path, pages: Iterable[tuple[Page, bytes]]) -> None:
    """Pages into a new folder, as a build does it: staged, stamped, each synced, moved into place."""
    output = open_output(out)
    for page, made in pages:
        output.put_page(page.path, "", made)
    output.finish(output.stamp(), {}, "", {})


def measure(benchmark: Benchmark) -> list[Measure]:
    """Each round writes into a folder of its own; the submissions are those of the benchmark."""
    with tempfile.TemporaryDirectory() as name, speaking(ENGLISH):
        root, turn = Path(name), iter(range(1_000))
        data = demo_data(benchmark, root / "site")
        pages = [page for page in make_pages(data) if page.template == "video.html"]
        made = [(page, render(page, "")) for page in pages]
        contexts = [page.make() for page in pages]

        def ours() -> None:
            write(root / str(next(turn)), rendered(pages, "", ENGLISH.tag, 1))

        def written() -> None:
            write(root / str(next(turn)), made)

        def bare() -> None:
            for page, context in zip(pages, contexts, strict=True):
                template = environment().get_template(page.template)
                template.render(page=context, shell=context.shell, canonical=page.path).encode()

        times = interleaved(
            {
                "ours": ours,
                "written": written,
                "rendered": lambda: [render(page, "") for page in pages],
                "bare": bare,
                "gathered": lambda: list(make_pages(data)),
            }
        )
    what = f"{len(pages)} video pages of {len(data.systems)} systems"
    size = f"{sum(len(page) for _, page in made) / len(made) / 1e3:.0f} kB a page"
    gathered = f"what every page shows, hashed for the next build, takes another {times['gathered']:.3g} s"
    return [
        Measure(
            f"{what}, made and written",
            times["ours"],
            "the same bytes written",
            times["written"],
            "at most 4.5",
            size,
        ),
        Measure(
            f"{what}, made",
            times["rendered"],
            "bare jinja2 of the same contexts",
            times["bare"],
            "",
            gathered,
        ),
    ]
