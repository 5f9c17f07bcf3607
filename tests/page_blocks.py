"""Code blocks of the README and the pages of docs, each run alone: a fresh process in a fresh folder.

    python -m tests.page_blocks [--jobs N] [--small] [PAGE ...]

runs all blocks, those of the pages whose paths in docs begin with PAGE (ik.md, how-to), or the one at a line
(ik.md:57), and says of each that is wrong why. Of the process of a block these hold:

- It finds the packages that ``pip install .`` brings, and those of the extras that the page names
  (``.[viewer,film]``, "the extras `mujoco` and `drake`"), and no others.
- Its folder is empty but for `models`, that of the repository, and for commands the Python blocks above them
  that the page calls "a complete file `NAME`".
- It prints the block of text that follows a Python block at once, or what stands under a command of a console
  block; a line ``...`` stands for any lines. Numbers are compared in the digits shown, to a unit of the last;
  those below 1e-9 are rounding errors, and those in us or ms are times, which differ between machines.
- It ends within 60 s, unless the block, the two lines above it or the page above its sections state a time.

A step of the tutorial is one program, the cells of a notebook. Lines with ``# small: VALUE`` assign
VALUE with `--small`; the numbers such a block prints are then not compared. Blocks that install are left out.
"""

from __future__ import annotations

import argparse
import ast
import builtins
import dis
import os
import re
import signal
import subprocess
import sys
import tempfile
import time
import types
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor, as_completed
from functools import cache
from importlib.metadata import PackageNotFoundError, metadata, packages_distributions, requires
from pathlib import Path
from typing import NamedTuple

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from docs.tutorial.pages import reduced
from dynx._version import DISTRIBUTION

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"
PAGES = {"README.md": (ROOT / "README.md").read_text(encoding="utf-8")} | {
    path.relative_to(DOCS).as_posix(): path.read_text(encoding="utf-8") for path in sorted(DOCS.rglob("*.md"))
}
"""Text of the README, and of each page by its path in `docs`."""

UNTIMED = 60.0
"""Longest time of a block that states none [s]."""

ROUNDING = 1e-9
"""Absolute value below which a number printed is a rounding error, which differs between machines."""

RUN = ("python", "console", "sh")
"""Languages whose blocks are run; the lines of `sh` show no output."""

PARSED = ("toml", "json", "yaml", "xml")
"""Languages whose blocks are parsed."""

FOR_DEVELOPERS = frozenset({"all", "docs", "lint", "test", "benchmark"})
"""Extras that bring more than any page needs."""

_BLOCK = re.compile(r"^```(\w+)\n(.*?)^```$(?:\n\n```text\n(.*?)^```$)?", flags=re.MULTILINE | re.DOTALL)
_EXAMPLE = re.compile(r"^   \.\. code-block:: python\n\n((?:      .*\n|\n(?=      ))+)", flags=re.MULTILINE)
_NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")
_EXTRAS = re.compile(r"\bextras?\s((?:`[\w-]+`(?:,?\sand\s|,\s|))+)|(?:\.|dynx|robotics)\[([\w,-]+)\]")
_MACHINE_TIME = re.compile(r" (?:us|ms)\b")
_FILE = re.compile(r"\ba\s+complete\s+file `([\w.]+)`")
_INSTALLS = re.compile(r"\bpip install\b|^git clone\b", flags=re.MULTILINE)
_TIME = re.compile(r"\d\s*(?:s|min)\b|\bminutes?\b|\bseconds\b|\bhours?\b")
_CELL = "--- end of a block ---"

_SEE_EXTRAS = """
import os, sys
from importlib.machinery import PathFinder

HIDDEN = frozenset(os.environ["HIDDEN_PACKAGES"].split())
ABSENT = frozenset(os.environ["HIDDEN_DISTRIBUTIONS"].split())


class Finder(PathFinder):
    @classmethod
    def find_spec(cls, name, path=None, target=None):
        return None if name.partition(".")[0] in HIDDEN else PathFinder.find_spec(name, path, target)

    @classmethod
    def find_distributions(cls, *args, **options):
        for found in PathFinder.find_distributions(*args, **options):
            if found.metadata["Name"].lower().replace("_", "-") not in ABSENT:
                yield found


sys.meta_path[sys.meta_path.index(PathFinder)] = Finder
"""
"""Start of each process: packages of extras that the page does not name are not found."""

_DYNX = """#!{python}
import signal, subprocess, sys

words = sys.argv[1:]
command = [{python!r}, "-m", "dynx", *words]
if not (words[:1] == ["view"] and "--export" not in words or "--view" in words):
    code = subprocess.run(command).returncode
    sys.exit(0 if code == 1 else code)  # 1: engines, rollouts or files differ
# Served until Ctrl-C: that is given when the address is printed.
serving = subprocess.Popen([*command, "--no-browser", "--port", "0"][: None if words[0] == "view" else -3],
                           stdout=subprocess.PIPE, text=True)
for line in serving.stdout:
    print(line, end="")
    if "http://" in line:
        serving.send_signal(signal.SIGINT)
code = serving.wait()
sys.exit(0 if code in (0, 130, -signal.SIGINT) else code)
"""
"""The command dynx of a block of commands. A crash is seen by its traceback."""


class Block(NamedTuple):
    """A block of a page, or all Python blocks of a step of the tutorial."""

    page: str
    """Key of `PAGES`."""
    line: int
    """Line of the page at which it begins."""
    language: str
    """Word behind its first fence."""
    cells: tuple[tuple[str, str], ...]
    """(code, output shown) of each part: one of a Python block, one for each command of a console block."""
    before: str
    """The two lines of the page above it."""
    files: tuple[tuple[str, str], ...] = ()
    """(name, text) of each file that the page shows before it, for commands."""

    @property
    def text(self) -> str:
        """The code of all its parts."""
        return "\n".join(code for code, _ in self.cells)

    def __str__(self) -> str:
        """Return where it stands."""
        return f"{self.page}:{self.line}"


class Outcome(NamedTuple):
    """Result of a block that was run."""

    block: Block
    seconds: float
    """Wall-clock time of its process [s]."""
    fault: str
    """The reason why it is wrong, or an empty text."""


def fenced(language: str, text: str) -> list[str]:
    """Return the text of the blocks of one language, in order."""
    return [found[2] for found in _BLOCK.finditer(text) if found[1] == language]


def programs(text: str) -> list[tuple[str, str]]:
    """Return (program, output shown) of every Python block; the block of text that follows it at once."""
    return [(found[2], found[3] or "") for found in _BLOCK.finditer(text) if found[1] == "python"]


def commands(text: str) -> list[tuple[str, str]]:
    """Return (command, output shown) of every line ``$ command`` of a console block."""
    parts = (part.partition("\n") for part in re.split(r"^\$ ", text, flags=re.MULTILINE)[1:])
    return [(command, shown) for command, _, shown in parts]


def blocks_of(page: str) -> Iterator[Block]:
    """Yield the blocks of a page that are run, in order."""
    text = PAGES[page]
    if page.startswith("tutorial/") and programs(text):
        yield Block(page, 1, "python", tuple(programs(text)), "")
    for line, code in examples(text):
        yield Block(page, line, "python", ((code, ""),), "")
    files: tuple[tuple[str, str], ...] = ()
    for found in _BLOCK.finditer(text):
        language, code = found[1], found[2]
        named = _FILE.search(text[: found.start()].rstrip("\n").rpartition("\n\n")[2])
        if language == "python" and named:
            files += ((named[1], code),)
        cells = {
            "python": ((code, found[3] or ""),),
            "console": tuple(commands(code)),
            "sh": ((code, found[3] or ""),),
        }.get(language, ())
        if (
            cells
            and not _INSTALLS.search(code)
            and not (language == "python" and page.startswith("tutorial/"))
        ):
            above = text[: found.start()].rstrip("\n")
            line = text[: found.start()].count("\n") + 1
            before = "\n".join(above.splitlines()[-2:])
            yield Block(page, line, language, cells, before, () if language == "python" else files)


def examples(text: str) -> list[tuple[int, str]]:
    """Return (line, code) of each example below an entry of the reference."""
    return [
        (text[: found.start()].count("\n") + 1, re.sub("^ {6}", "", found[1], flags=re.MULTILINE))
        for found in _EXAMPLE.finditer(text)
    ]


def run(block: Block, *, small: bool = False) -> Outcome:
    """Run a block in a process and a folder of its own."""
    with tempfile.TemporaryDirectory(prefix="dynx-block-") as place:
        folder, aside = Path(place) / "here", Path(place) / "aside"
        folder.mkdir()
        aside.mkdir()
        (folder / "models").symlink_to(ROOT / "models")
        for name, text in block.files:
            (folder / name).write_text(text, encoding="utf-8")
        (aside / "sitecustomize.py").write_text(_SEE_EXTRAS, encoding="utf-8")
        (aside / "dynx").write_text(_DYNX.format(python=sys.executable), encoding="utf-8")
        (aside / "pytest").write_text(f'#!/bin/sh\nexec {sys.executable} -m pytest "$@"\n', encoding="utf-8")
        for command in ("dynx", "pytest"):
            (aside / command).chmod(0o755)
        script = aside / "block.py"
        script.write_text(_script(block, small), encoding="utf-8")
        hidden = hidden_distributions(PAGES[block.page])
        environment = {
            **os.environ,
            "PYTHONPATH": str(aside),
            "PATH": f"{aside}:{Path(sys.executable).parent}:{os.environ['PATH']}",
            "HIDDEN_PACKAGES": " ".join(_packages(hidden)),
            "HIDDEN_DISTRIBUTIONS": " ".join(hidden),
            "PYTHONUNBUFFERED": "1",
            "COLUMNS": str(
                max(80, *(len(line) for _, shown in block.cells for line in ("", *shown.splitlines())))
            ),
            "BROWSER": "true",
            "MPLBACKEND": "agg",
        }
        start = time.monotonic()
        ended = subprocess.run(
            [sys.executable if block.language == "python" else "bash", str(script)],
            capture_output=True,
            text=True,
            cwd=folder,
            check=False,
            env=environment,
            stdin=subprocess.DEVNULL,
        )
        seconds = time.monotonic() - start
    return Outcome(block, seconds, _fault(block, ended, seconds, small))


def _script(block: Block, small: bool) -> str:
    """Return the program of a block, which prints a line after each part."""
    if block.language == "python":
        cells = [code for code, _ in block.cells]
        if small:
            cells = [reduced(code) for code in cells]
        return f"\nprint({_CELL!r})\n".join(cells)
    return "set -e\n" + f'\necho "{_CELL}"\n'.join(code for code, _ in block.cells)


def _fault(block: Block, ended: subprocess.CompletedProcess[str], seconds: float, small: bool) -> str:
    """Return why a block that was run is wrong, or an empty text."""
    if ended.returncode or "Traceback (most recent call last)" in ended.stderr:
        lines = ended.stderr.strip().splitlines() or ended.stdout.strip().splitlines() or [""]
        return f"exit code {ended.returncode}: {lines[-1]}"
    printed = ended.stdout.split(_CELL + "\n")
    for (code, shown), text in zip(block.cells, printed, strict=False):
        missing = missing_line(text, shown, digits=not (small and reduced(block.text) != block.text))
        if missing is not None:
            return f"not printed: {missing}   (by {code.strip().splitlines()[-1]})"
    head = PAGES[block.page].partition("\n## ")[0]
    if seconds > UNTIMED and not _TIME.search(block.text + block.before + head):
        return f"takes {seconds:.0f} s and does not say so"
    return ""


def missing_line(printed: str, shown: str, *, digits: bool = True) -> str | None:
    """Return the first line shown that is not printed, in order, or None; `digits` compares numbers, too."""
    lines = iter(printed.splitlines())
    for line in shown.splitlines():
        if _shape(line) not in ("", "...") and not any(
            _shape(each) == _shape(line) and (not digits or _same_numbers(line, each)) for each in lines
        ):
            return line
    return None


def _shape(line: str) -> str:
    """Return a line with its numbers, and the blanks that align them, taken out."""
    return re.sub(r"\s+", " ", _NUMBER.sub("#", line)).strip()


def _same_numbers(shown: str, printed: str) -> bool:
    """Return whether the numbers of two lines are equal in the digits shown, except for times."""
    pairs = zip(_NUMBER.finditer(shown), _NUMBER.findall(printed), strict=True)
    return all(
        _MACHINE_TIME.match(shown, ours.end()) or _same_number(ours[0], theirs) for ours, theirs in pairs
    )


def _same_number(shown: str, printed: str) -> bool:
    ours, theirs = float(shown), float(printed)
    if max(abs(ours), abs(theirs)) < ROUNDING or ours == theirs:
        return True
    mantissa, _, exponent = shown.partition("e")
    if "." not in mantissa and not exponent:
        return False
    unit = 10.0 ** (int(exponent or 0) - len(mantissa.partition(".")[2]))
    return abs(ours - theirs) < 1.001 * unit


@cache
def _distributions(extras: frozenset[str], *others: str) -> tuple[set[str], set[str]]:
    """Return the distributions that dynx with extras, and others, need: those installed, those absent."""
    installed: set[str] = set()
    absent: set[str] = set()
    todo = [(DISTRIBUTION, extra) for extra in ("", *extras)] + [(name, "") for name in others]
    seen = set(todo)
    while todo:
        name, extra = todo.pop()
        try:
            needs = requires(name) or []
        except PackageNotFoundError:
            absent.add(name)
            continue
        installed.add(canonicalize_name(name))
        for need in map(Requirement, needs):
            if need.marker is None or need.marker.evaluate({"extra": extra}):
                new = {(need.name, each) for each in ("", *need.extras)} - seen
                seen |= new
                todo += new
    return installed, absent


def _packages(distributions: set[str]) -> set[str]:
    """Return the packages of some distributions, as Python imports them."""
    return {
        package
        for package, names in packages_distributions().items()
        if any(canonicalize_name(name) in distributions for name in names)
    }


def named_extras(text: str) -> frozenset[str]:
    """Return the extras that the text of a page names."""
    words = {word for found in _EXTRAS.findall(text) for word in re.findall(r"[\w-]+", " ".join(found))}
    return frozenset(words & _all_extras() - FOR_DEVELOPERS)


def absent_packages(text: str) -> set[str]:
    """Return the distributions of the extras that the text of a page names which are not installed."""
    return _distributions(named_extras(text))[1]


@cache
def _all_extras() -> frozenset[str]:
    return frozenset(metadata(DISTRIBUTION).get_all("Provides-Extra") or [])


def hidden_distributions(text: str) -> set[str]:
    """Return the distributions of extras that a page does not name, except for what it installs itself."""
    others = re.findall(r"\bpip install (\w[\w-]*)", text)
    return _distributions(_all_extras())[0] - _distributions(named_extras(text), *others)[0]


def unbound_names(code: str) -> set[str]:
    """Return the names that a program reads and nowhere binds."""
    loaded: set[str] = set()
    stored: set[str] = set()

    def walk(part: types.CodeType) -> None:
        for step in dis.get_instructions(part):
            if step.opname in ("LOAD_NAME", "LOAD_GLOBAL"):
                loaded.add(step.argval)
            elif step.opname in ("STORE_NAME", "STORE_GLOBAL"):
                stored.add(step.argval)
        for constant in part.co_consts:
            if isinstance(constant, types.CodeType):
                walk(constant)

    walk(compile(ast.parse(code), "block", "exec"))
    return loaded - stored - set(dir(builtins)) - {"__name__", "__file__", "__annotations__"}


def _is_named(block: Block, name: str) -> bool:
    """Return whether a word of the command line names a block: the begin of its page's path, or its place."""
    return block.page.startswith(name) or str(block) == name


def main() -> int:
    """Run the blocks of the pages named, and return 1 if one is wrong."""
    parser = argparse.ArgumentParser(description="Run the blocks of pages, each alone.")
    parser.add_argument("pages", nargs="*", metavar="PAGE")
    parser.add_argument("--jobs", type=int, default=1, help="processes at a time")
    parser.add_argument("--only", choices=RUN, default=RUN, nargs="*", metavar="LANGUAGE", help="%(choices)s")
    parser.add_argument("--small", action="store_true", help="take the values of # small: VALUE")
    given = parser.parse_args()
    all_blocks = [block for page in PAGES for block in blocks_of(page)]
    for name in given.pages:
        if not any(_is_named(block, name) for block in all_blocks):
            parser.error(f"no page has a path that begins with {name!r}, and no block is at this line")
    blocks = [
        block
        for block in all_blocks
        if block.language in given.only
        and (not given.pages or any(_is_named(block, name) for name in given.pages))
    ]
    if "DYNX_CACHE_DIR" not in os.environ:
        cache_folder = tempfile.TemporaryDirectory(prefix="dynx-blocks-")
        os.environ["DYNX_CACHE_DIR"] = cache_folder.name
    right = 0
    with ThreadPoolExecutor(given.jobs) as pool:
        try:
            for ended in as_completed([pool.submit(run, block, small=given.small) for block in blocks]):
                outcome = ended.result()
                right += not outcome.fault
                print(f"{outcome.block}: {outcome.seconds:.1f} s {outcome.fault}".rstrip(), flush=True)
        finally:
            pool.shutdown(cancel_futures=True)  # Ctrl-C begins no further block
    print(f"{len(blocks)} blocks, {right} right alone")
    return int(right < len(blocks))


if __name__ == "__main__":
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    sys.exit(main())
