"""Suffixes of the files of a world."""

from __future__ import annotations

from pathlib import Path

import pytest

from dynx.errors import ArgumentError
from dynx.world.snapshot import check_world_suffix


@pytest.mark.parametrize(
    ("name", "clue"),
    [
        ("a.txt", "which World.read reads$"),
        ("a.TOML", "dynx.world.write_scene writes a scene to .toml and .json"),
        ("a.npz", "Rollout.save writes"),
        ("a.gif", "export writes pages and pictures"),
    ],
)
def test_a_suffix_of_another_kind_of_file_is_refused(name: str, clue: str, tmp_path: Path) -> None:
    with pytest.raises(ArgumentError, match=rf"{name}: a world with its state is written to \.world.*{clue}"):
        check_world_suffix(tmp_path / name)
    check_world_suffix(tmp_path / "a.World")
