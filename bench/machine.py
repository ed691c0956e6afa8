"""What a report was measured on: the machine, and the versions of what does the work."""

import os
import platform
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

PACKAGES = {
    "numpy": "numpy",
    "onnxruntime": "onnxruntime",
    "pyarrow": "pyarrow",
    "av": "av",
    "opencv": "opencv-python-headless",
}


def machine() -> str:
    """Processor, cores and memory, as one line."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    parts = [f"{platform.system()} {platform.machine()}", f"{cores} cores", _processor(), _memory()]
    return ", ".join(part for part in parts if part)


def versions() -> str:
    """Python and the packages whose speed is ours, as one line."""
    return ", ".join(
        [f"Python {platform.python_version()}", *(f"{name} {_version(PACKAGES[name])}" for name in PACKAGES)]
    )


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return "not installed"


def _processor() -> str:
    """The processor's name; empty where the system does not say."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor()
    named = (line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    return next(named, "")


def _memory() -> str:
    """The memory; empty where the system does not say."""
    try:
        return f"{os.sysconf('SC_PAGE_SIZE') * os.sysconf('SC_PHYS_PAGES') / 2**30:.0f} GB of memory"
    except (AttributeError, OSError, ValueError):
        return ""
