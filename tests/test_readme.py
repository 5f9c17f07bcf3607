"""The README says what is true: its Python runs, its commands print what it shows."""

from __future__ import annotations

import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def blocks(language: str) -> list[str]:
    """The fenced blocks of one language, in order."""
    return re.findall(rf"^```{language}\n(.*?)^```$", README, flags=re.MULTILINE | re.DOTALL)


def section(heading: str) -> str:
    found = re.search(rf"^## {heading}\n(.*?)(?=^## |\Z)", README, flags=re.MULTILINE | re.DOTALL)
    assert found, f"README.md has no section {heading!r}"
    return found.group(1)


def commands() -> list[tuple[str, str]]:
    """(command, output shown) of every ``$ dynx ...`` in the console blocks."""
    found = []
    for block in blocks("console"):
        for part in re.split(r"^\$ ", block, flags=re.MULTILINE)[1:]:
            command, _, shown = part.partition("\n")
            found.append((command, shown))
    return found


def shape(line: str) -> str:
    """A line with its numbers, and the blanks that align them, taken out."""
    return re.sub(r"\s+", " ", re.sub(r"[-+]?\d+(\.\d+)?(e[-+]?\d+)?", "#", line)).strip()


def test_python_blocks_run_in_order(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    namespace: dict[str, object] = {"__name__": "readme"}
    found = blocks("python")
    assert found
    for block in found:
        exec(compile(block, "README.md", "exec"), namespace)


@pytest.mark.parametrize(
    ("command", "shown"), commands(), ids=lambda text: text.splitlines()[0] if text else ""
)
def test_console_blocks_print_what_is_shown(command: str, shown: str) -> None:
    words = shlex.split(command, comments=True)
    assert words[0] == "dynx", f"a console block of README.md starts with {words[0]!r}"
    result = subprocess.run(
        [sys.executable, "-m", "dynx", *words[1:]], capture_output=True, text=True, cwd=ROOT, check=False
    )
    assert result.returncode == 0, result.stderr
    printed = {shape(line) for line in result.stdout.splitlines()}
    for line in shown.splitlines():
        if shape(line) not in ("", "..."):
            assert shape(line) in printed, f"not printed any more: {line}\n{result.stdout}"


@pytest.mark.parametrize("heading", ["Quick start", "Run the tests"])
def test_set_up_is_one_line(heading: str) -> None:
    found = re.findall(r"^```sh\n(.*?)^```$", section(heading), flags=re.MULTILINE | re.DOTALL)
    assert len(found) == 1
    assert len(found[0].splitlines()) == 1
