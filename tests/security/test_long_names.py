"""Names of files that are longer than a system allows: errors of dynx, wherever a file is named."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import dynx
from dynx.errors import DynxError
from dynx.files.films import write_pictures
from dynx.sim import Rollout
from dynx.world import read_scene

LONG = "x" * 5000
SCENE = """
[[bodies]]
name = "stone"
shapes = [{{kind = "mesh", file = "{name}.stl"}}]
mass = 1.0
"""
ROBOT = """
<robot name="r"><link name="a"><visual><geometry><mesh filename="{name}.stl"/></geometry></visual>
<collision><geometry><mesh filename="package://p/{name}.obj"/></geometry></collision></link></robot>
"""


def meshes(folder: Path) -> Any:
    (folder / "r.urdf").write_text(ROBOT.format(name=LONG), encoding="utf-8")
    return dynx.diagnose(str(folder / "r.urdf"))


def scene(folder: Path) -> Any:
    (folder / "s.toml").write_text(SCENE.format(name=LONG), encoding="utf-8")
    return dynx.World(read_scene(folder / "s.toml"), "mujoco")


DOORS: dict[str, Callable[[Path], Any]] = {
    "load": lambda folder: dynx.load(folder / f"{LONG}.urdf"),
    "load of a name": lambda folder: dynx.load(LONG),
    "package": lambda folder: dynx.load(f"package://{LONG}/{LONG}.urdf"),
    "read_scene": lambda folder: read_scene(folder / f"{LONG}.toml"),
    "scene with a mesh": scene,
    "Rollout.load": lambda folder: Rollout.load(folder / f"{LONG}.npz"),
    "World.read": lambda folder: dynx.World.read(folder / f"{LONG}.json"),
    "film": lambda folder: write_pictures(folder / f"{LONG}.gif", [], 0.1),
    "scene in a scene": lambda folder: read_scene(LONG),
}


@pytest.mark.parametrize("name", DOORS)
def test_names_longer_than_a_system_allows_are_errors_of_dynx(name: str, tmp_path: Path) -> None:
    with pytest.raises(DynxError):
        DOORS[name](tmp_path)


def test_meshes_with_such_names_are_named(tmp_path: Path) -> None:
    assert meshes(tmp_path) is not None
