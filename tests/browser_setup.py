"""Finds Chromium for the browser tests, and installs Debian's where that is possible.

    python -m tests.browser_setup

COOOLER_CHROMIUM names another executable.
"""

import os
import shutil
import subprocess
import sys

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
ARGUMENTS = (
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
)


def find_chromium() -> str | None:
    """The path of a Chromium, or None; COOOLER_CHROMIUM goes first and must exist when it is set."""
    named = os.environ.get("COOOLER_CHROMIUM")
    if named:
        return shutil.which(named)
    return next((found for name in NAMES if (found := shutil.which(name))), None)


def install() -> bool:
    """Install Debian's Chromium; gives False when this system has no apt-get or we are not root."""
    if not shutil.which("apt-get") or os.geteuid() != 0:
        return False
    quiet = {**os.environ, "DEBIAN_FRONTEND": "noninteractive"}
    for command in (["update"], ["install", "-y", "--no-install-recommends", "chromium"]):
        print("apt-get", *command, flush=True)
        if subprocess.run(
            ["apt-get", *command], env=quiet, stdout=subprocess.DEVNULL, check=False
        ).returncode:
            return False
    return True


def main() -> int:
    """0 when there is a Chromium (now), else 1 and what to do on standard error."""
    if os.environ.get("COOOLER_CHROMIUM"):
        if find_chromium():
            return 0
        print("COOOLER_CHROMIUM names no executable; correct it or unset it.", file=sys.stderr)
        return 1
    if find_chromium() or (install() and find_chromium()):
        return 0
    print(
        f"The browser tests need Chromium; found none of: {', '.join(NAMES)}.\n"
        "Install it (Debian, Ubuntu, as root: apt-get install --no-install-recommends chromium),\n"
        "or set COOOLER_CHROMIUM to the executable of a Chromium or Chrome.",
        file=sys.stderr,
    )
    return 1


if __name__ == "__main__":
    sys.exit(main())
