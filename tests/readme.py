"""The commands' help as it stands in the README: `python -m tests.readme` writes it there."""

from pathlib import Path

from pipeline.files import write_text

README = Path(__file__).parent.parent / "README.md"
START, END = "<!-- help:start -->\n", "<!-- help:end -->"


def with_help(readme: str) -> str:
    """The README's text with the part between the marks replaced by the real help."""
    from typer.testing import CliRunner

    from sitegen.cli import app

    shown = CliRunner().invoke(app, ["--help"], terminal_width=100, prog_name="coooler")
    head, rest = readme.split(START)
    lines = [line.rstrip() for line in shown.output.strip().splitlines()]
    block = "\n".join(["```text", *lines, "```"])
    return head + START + block + "\n" + END + rest.split(END, 1)[1]


if __name__ == "__main__":
    write_text(README, with_help(README.read_text(encoding="utf-8")))
