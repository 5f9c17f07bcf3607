"""Every supported platform and Python installs each engine that has wheels there, and at least one.

The table of wheels is what the package index offered when `.ci/resolve` last ran; that script asks the index.
"""

from __future__ import annotations

from itertools import product
from pathlib import Path

import pytest
from packaging.requirements import Requirement

tomllib = pytest.importorskip("tomllib", reason="Python 3.10 has no reader of TOML")

ROOT = Path(__file__).resolve().parents[2]
LINUX, LINUX_ARM = ("linux", "x86_64"), ("linux", "aarch64")
MACOS, MACOS_ARM, WINDOWS = ("darwin", "x86_64"), ("darwin", "arm64"), ("win32", "AMD64")
PYTHONS = ("3.10", "3.11", "3.12", "3.13")
PAIRS = tuple(product((LINUX, LINUX_ARM, MACOS, MACOS_ARM, WINDOWS), PYTHONS))
WHEELS = {
    "pin": {pair for pair in PAIRS if pair[0] != WINDOWS},
    "pybullet": {(LINUX, "3.10"), (LINUX, "3.11")},
    "mujoco": set(PAIRS),
}


def engines(platform: tuple[str, str], python: str) -> set[str]:
    """Return the engines that ``pip install .`` brings."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    environment = {
        "sys_platform": platform[0],
        "platform_machine": platform[1],
        "python_version": python,
        "python_full_version": f"{python}.1",
    }
    found = set()
    for requirement in map(Requirement, project["dependencies"]):
        if requirement.marker is None or requirement.marker.evaluate(environment):
            found.add(requirement.name)
    return found & WHEELS.keys()


@pytest.mark.parametrize(("platform", "python"), PAIRS)
def test_every_engine_asked_for_has_a_wheel_and_there_is_one(platform: tuple[str, str], python: str) -> None:
    chosen = engines(platform, python)
    assert chosen
    for engine in chosen:
        assert (platform, python) in WHEELS[engine], engine
    for engine in ("pin", "pybullet"):
        assert (engine in chosen) == ((platform, python) in WHEELS[engine]), engine
    if platform != WINDOWS:
        assert len(chosen) == 2


def test_linux_with_python_3_11_has_pinocchio_and_pybullet() -> None:
    assert engines(LINUX, "3.11") == {"pin", "pybullet"}


def test_windows_has_mujoco() -> None:
    assert engines(WINDOWS, "3.13") == {"mujoco"}
