"""docs/architecture.md describes the code as it is."""

from __future__ import annotations

import re
import subprocess
from itertools import pairwise
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
PROJECT = (ROOT / "pyproject.toml").read_text(encoding="utf-8")


TOP_LEVEL = {"benchmarks", "docs", "dynx", "models", "tests"} | {
    "CHANGELOG.md",
    "CITATION.cff",
    "LICENSE",
    "README.md",
    "action.yml",
    "pyproject.toml",
}


def rooms() -> set[str]:
    """Return the names of the folders and modules directly in dynx, without those that every package has."""
    entries = (path for path in (ROOT / "dynx").iterdir() if not path.name.startswith("_"))
    return {path.stem for path in entries if path.is_dir() or path.suffix == ".py"}


def layers(text: str) -> list[list[str]]:
    """Return the rooms of each layer of the import contract, from the top."""
    block = re.search(r'type = "layers"\nlayers = \[\n(.*?)^\]', text, flags=re.MULTILINE | re.DOTALL)
    assert block
    return [re.findall(r"dynx\.(\w+)", line) for line in block.group(1).splitlines()]


def test_nothing_else_lies_at_top_level() -> None:
    """The output of an example was once committed by mistake."""
    listed = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=False)
    if listed.returncode != 0:
        pytest.skip("not a clone")
    tracked = {path.partition("/")[0] for path in listed.stdout.splitlines()}
    assert {name for name in tracked if not name.startswith(".")} == TOP_LEVEL


def test_every_room_has_a_line() -> None:
    table = PAGE.partition("## The rooms")[2].partition("\n## ")[0]
    assert set(re.findall(r"^\| `(\w+)` \|", table, flags=re.MULTILINE)) == rooms()


def test_the_picture_has_the_rooms_in_the_order_of_the_import_contract() -> None:
    picture = PAGE.partition("```text")[2].partition("```")[0].splitlines()
    drawn = {room: number for number, line in enumerate(picture) for room in re.findall(r"\w+", line[:28])}
    heights = [[drawn[room] for room in layer] for layer in layers(PROJECT)]
    for above, below in pairwise(heights):
        assert max(above) <= min(below)
    assert {room for layer in layers(PROJECT) for room in layer} == rooms()


def test_recipes_name_tests_that_exist() -> None:
    named = re.findall(r"`(tests/architecture/test_recipe_\w+\.py)`", PAGE)
    assert len(named) == 7
    assert all((ROOT / path).exists() for path in named)
