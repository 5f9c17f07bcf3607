"""The survey of public SDF files: what it finds out about one file."""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks.surveys import sdf_files
from benchmarks.surveys.sdf_files import EXACT

SAMPLES = Path(__file__).parents[1] / "model" / "sdf" / "samples"

BALL = '<sdf version="1.9"><model name="ball"><link name="a">{}</link></model></sdf>'


def test_one_file_is_read_alike_by_drake(tmp_path: Path) -> None:
    pytest.importorskip("pydrake")
    found = sdf_files.examine(str(SAMPLES / "two_links.sdf"))
    assert (found.word, found.joints) == ("alike", frozenset(("fixed", "revolute")))
    assert found.difference <= EXACT
    path = tmp_path / "ball.sdf"
    path.write_text(BALL.format("<inertial><mass>-1</mass></inertial>"))
    assert sdf_files.examine(str(path)).word == "refused"
    path.write_text(BALL.format("<inertial><inertia><ixx>9</ixx></inertia></inertial>"))
    assert sdf_files.examine(str(path)).word == "different, an inertia of the file is not physical"
