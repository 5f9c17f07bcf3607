"""Warnings of MuJoCo in a process that uses dynx: Python warnings, and no file in the working directory."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

pytest.importorskip("mujoco")

PROGRAM = """
from dynx.engines.mujoco.library import mujoco

model = mujoco.MjModel.from_xml_string(
    "<mujoco><worldbody><body><freejoint/><geom size='.1'/></body></worldbody></mujoco>"
)
for coordinate in (0, 0, 1):
    data = mujoco.MjData(model)
    data.qvel[coordinate] = float("nan")
    mujoco.mj_step(model, data)
print("stepped")
"""
"""A program that provokes one kind of warning three times, with different numbers in its text."""

HANDLES = """
import mujoco
mujoco.set_mju_user_warning(lambda message: print("handled"))
"""


def _run(folder: Path, program: str, *options: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, *options, "-c", program]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, check=True)


@pytest.mark.parametrize("options", [(), ("-W", "error")])
def test_each_kind_of_warning_is_shown_once_and_no_file_is_written(
    tmp_path: Path, options: tuple[str, ...]
) -> None:
    done = _run(tmp_path, PROGRAM, *options)
    assert done.stdout == "stepped\n"
    assert done.stderr.count("RuntimeWarning: mujoco: Nan, Inf or huge value in QVEL") == 1
    assert list(tmp_path.iterdir()) == []


def test_the_handler_of_a_program_that_set_one_is_kept(tmp_path: Path) -> None:
    done = _run(tmp_path, HANDLES + PROGRAM)
    assert done.stdout.splitlines() == ["handled"] * 3 + ["stepped"]
    assert done.stderr == ""
