"""Parts of pages that commands write: between marks, as tables, with the conditions of a measurement.

A part stands between ``<!-- written: NAME -->`` and ``<!-- end -->``; the other text of a page is kept.
"""

from __future__ import annotations

import os
import platform
import re
import sys
from collections.abc import Iterable, Sequence
from datetime import date
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from dynx._version import DISTRIBUTION
from dynx.bench.machine import processor_description

LIBRARIES = ("numpy", "pin", "pybullet", "mujoco", "drake")


def replaced(page: Path, text: str, name: str, part: str) -> str:
    """Return the text of a page with what stands between the marks of `name` replaced."""
    mark = f"<!-- written: {name} -->\n"
    pattern = re.compile(re.escape(mark) + ".*?(?=<!-- end -->)", re.DOTALL)
    if not pattern.search(text):
        sys.exit(f"{page.name} has no place for {name!r}")
    return pattern.sub(lambda _: mark + part, text)


def table(heads: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table in Markdown."""
    lines = [heads, ["---"] * len(heads), *rows]
    return "".join("| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |\n" for line in lines)


def two_digits(number: float) -> str:
    """Return a number in two significant digits."""
    return f"{float(f'{number:.2g}'):,.10g}"


def processor() -> str:
    """Return the name of the processor as the system gives it, its generation, and the number of cores."""
    name = platform.processor() or platform.machine()
    try:
        info = Path("/proc/cpuinfo").read_text(encoding="utf-8")
    except OSError:
        info = ""
    found = re.search(r"^model name\s*: (.*)$", info, flags=re.MULTILINE)
    return f"{found[1] if found else name}, {processor_description()}, {os.cpu_count()} cores"


def versions(libraries: Sequence[str] = LIBRARIES) -> str:
    """Return the versions of Python, dynx and the libraries that are installed."""
    found = ((name, version_of(name)) for name in libraries)
    present = [f"{name} {number}" for name, number in found if number]
    return ", ".join([f"Python {platform.python_version()}", f"dynx {version(DISTRIBUTION)}", *present])


def version_of(distribution: str) -> str:
    """Return the version of a distribution; empty where it is not installed."""
    try:
        return version(distribution)
    except PackageNotFoundError:
        return ""


def conditions(seconds: float, load_before: float | None, libraries: Sequence[str] = LIBRARIES) -> str:
    """Return a paragraph with the day of a measurement, how long it took, the machine and the versions."""
    busy = "" if load_before is None else f" (load average {load_before:.1f} before)"
    lasted = f"{seconds:.0f} s" if seconds < 120.0 else f"{seconds / 60.0:.0f} minutes"
    return f"*{date.today().isoformat()}, in {lasted}{busy}; {processor()}; {versions(libraries)}.*\n"


def measured_before(day: date, libraries: Sequence[str] = LIBRARIES) -> str:
    """Return the paragraph of `conditions` for results of an earlier run on this machine."""
    return f"*Measured before this table was written, on {day}; {processor()}; {versions(libraries)}.*\n"
