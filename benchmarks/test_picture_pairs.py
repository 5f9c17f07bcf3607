"""Pairs of pictures whose sides only the key tells, and the votes on them."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from PIL import Image

from benchmarks.picture_pairs import SMALL, Look, count_votes, main, pairs_in, votes_in, write_pairs

PEERS = ("mujoco", "viser")
NAMES = ("arm", "stack_of_boxes")
COLOURS = {"dynx": (200, 0, 0), "mujoco": (0, 200, 0), "viser": (0, 0, 200)}


@pytest.fixture
def key(tmp_path: Path) -> Path:
    """Draw pairs of one colour for each library, and return the key."""
    drawn = tmp_path / "drawn"
    drawn.mkdir()
    for name in NAMES:
        for library, colour in COLOURS.items():
            Image.new("RGB", SMALL, colour).save(drawn / Look().file(name, library))
    pairs = pairs_in(drawn, NAMES, PEERS, [Look()])
    assert len(pairs) == 4
    write_pairs(tmp_path / "pairs", tmp_path / "key.json", drawn, pairs, seed=3)
    return tmp_path / "key.json"


def test_the_key_names_the_sides_of_each_pair(key: Path) -> None:
    table = json.loads(key.read_text())
    for name, pair in table.items():
        if "peer" not in pair:
            continue
        with Image.open(key.parent / "pairs" / f"{name}.png") as file:
            picture = file.copy()
        places = {"A": picture.width // 4, "B": 3 * picture.width // 4}
        for side, across in places.items():
            assert picture.getpixel((across, picture.height // 2)) == COLOURS[pair[side]]
    assert "dynx" not in (key.parent / "pairs" / "QUESTIONS.md").read_text()
    with Image.open(key.parent / "pairs" / "sheet.png") as sheet:
        assert sheet.size[1] == SMALL[1]


def test_votes_are_counted_by_library_and_by_picture(key: Path, capsys: pytest.CaptureFixture[str]) -> None:
    table = json.loads(key.read_text())
    pairs = {name: each for name, each in table.items() if "peer" in each}
    # A reader who prefers viser to dynx, and dynx to MuJoCo.
    lines = []
    for name, pair in pairs.items():
        liked = "viser" if pair["peer"] == "viser" else "dynx"
        side = next(each for each in "AB" if pair[each] == liked)
        lines.append(f"{name} {side} because it is {liked}")
    reader = key.parent / "reader.txt"
    reader.write_text("\n".join(["answers", *lines, "single_01 a box"]))
    assert not count_votes(table, [reader])
    printed = capsys.readouterr().out
    assert "library mujoco: 100 % of 2 votes\n" in printed
    assert "library viser: 0 % of 2 votes, less than 60 %" in printed
    assert "picture arm: 50 % of 2 votes\n" in printed
    assert "because it is viser" in printed
    reader.write_text("\n".join(lines[1:]))
    with pytest.raises(SystemExit, match="wanted one vote for each pair"):
        count_votes(table, [reader])


def test_lines_that_are_no_votes_are_passed_over() -> None:
    text = "001 A clear\n- 002: B because\n003.png B\n004 C\nsingle_05 a robot\nthe 006 A"
    assert [(each.pair, each.side) for each in votes_in(text)] == [("001", "A"), ("002", "B"), ("003", "B")]


def test_the_command_needs_a_folder_or_votes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.argv", ["picture_pairs", "--key", "key.json"])
    with pytest.raises(SystemExit):
        main()
