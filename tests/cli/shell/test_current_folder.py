"""No command executes a file of the folder in which it is called."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from importlib.metadata import packages_distributions
from pathlib import Path

import pytest

from dynx.cli.shell.main import COMMANDS

PARENTS = {"env": ("list", "distance")}
"""Commands that are groups, with their commands."""

CALLS = {
    "agree": "agree double_pendulum --backends reference,mujoco --samples 1 --jobs 1",
    "doctor": "doctor double_pendulum",
    "convert": "convert double_pendulum --out pendulum.xml",
    "same": "same double_pendulum double_pendulum",
    "sim": "sim double_pendulum --to joint1=0 --duration 0.01 --save run.npz",
    "world": "world stack --duration 0.002",
    "compare": "compare run.npz run.npz",
    "view": "view double_pendulum --export robot.html",
    "env list": "env list",
    "env distance": "env distance Pendulum --seed 0 --steps 2",
    "train": "train CartPole-v1 --steps 64 --envs 2 --processes --set n_steps=16 --set batch_size=32 "
    "--episodes 1 --out trained --tensorboard --plot curve.png",
    "play": "play trained/final.zip --episodes 1",
    "contacts": "contacts --case resting_force --dt 0.004 --jobs 1",
    "bench": "bench double_pendulum --backends reference,mujoco --quantity mass-matrix --batch 1 --threads 1 "
    "--quick",
    "explain": "explain DX101",
    "info": "info double_pendulum",
    "robots": "robots",
    "backends": "backends",
    "fk": "fk double_pendulum --frame link2 --q 0,0",
    "jacobian": "jacobian double_pendulum --frame link2 --q 0,0",
    "id": "id double_pendulum --q 0,0",
    "fd": "fd double_pendulum --q 0,0 --tau 0,0",
    "mass": "mass double_pendulum --q 0,0",
    "ik": "ik double_pendulum --to-pose 0,0,0.4 --free rotation",
}
"""A short call of each command. Those that read a file come after the one that writes it."""

TRAINED = ["train", "play"]
"""Commands that need the extra `train`."""

HARMLESS = (0, 1)
"""Exit codes of a call that did its work."""


def plant(folder: Path, canary: Path) -> None:
    """Put a file with the name of every module of Python and of every installed package into a folder."""
    code = f"open({str(canary)!r}, 'a').write(__file__ + chr(10))\n"
    names = {*sys.stdlib_module_names, *packages_distributions(), "sitecustomize", "usercustomize"}
    for name in names:
        (folder / f"{re.split('[./]', name)[0]}.py").write_text(code)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder full of files that Python would import instead of its own modules."""
    place = tmp_path_factory.mktemp("called")
    plant(place, place / "executed.txt")
    return place


PROGRAM = """
import json, os, runpy, sys
found = {}
for name, words in json.loads(sys.argv.pop()).items():
    sys.argv[1:] = words.split()
    try:
        runpy.run_module("dynx", run_name="__main__")
    except SystemExit as end:
        code = end.code
    executed = open("executed.txt").read() if os.path.exists("executed.txt") else ""
    found[name] = code, executed
print(json.dumps(found), file=sys.stderr)
"""
"""Calls commands in turn and writes the exit code of each, with the files that were executed by then."""


def call(names: list[str], folder: Path) -> dict[str, tuple[int, str]]:
    """Call commands in a folder in one process; return what `PROGRAM` writes."""
    environment = {key: value for key, value in os.environ.items() if not key.startswith("PYTHON")}
    calls = json.dumps({name: CALLS[name] for name in names})
    command = [sys.executable, "-P", "-c", PROGRAM, calls]
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    found: dict[str, tuple[int, str]] = json.loads(done.stderr.splitlines()[-1])
    return found


def test_every_command_is_called() -> None:
    named = {name for each in COMMANDS for name in (each, *(f"{each} {k}" for k in PARENTS.get(each, ())))}
    assert set(CALLS) == named - set(PARENTS)


@pytest.mark.parametrize(
    "names", [[name for name in CALLS if name not in TRAINED], TRAINED], ids=["", "trained"]
)
def test_files_of_the_current_folder_are_not_executed(names: list[str], folder: Path) -> None:
    if names == TRAINED:
        pytest.importorskip("stable_baselines3", reason="needs the extra train")
    found = call(names, folder)
    assert list(found) == names
    for name, (code, executed) in found.items():
        assert (name, executed) == (name, "")
        assert (name, code in HARMLESS) == (name, True)


def test_a_file_that_shadows_a_module_is_executed_where_python_is_asked_to(folder: Path) -> None:
    """The files that are planted would be executed: the test above can fail."""
    done = subprocess.run([sys.executable, "-c", "import fractions"], cwd=folder, check=False)
    executed = folder / "executed.txt"
    assert done.returncode == 0
    assert executed.read_text().splitlines() == [str(folder / "fractions.py")]
    executed.unlink()
