"""Files of robots, scenes and meshes that are given where a robot in URDF is wanted: what each is."""

from __future__ import annotations

from pathlib import PurePath

_SDF = "SDF, Gazebo's format of models and worlds, which dynx.load reads"
_MJCF = "MJCF, MuJoCo's format, which dynx.load reads, or dynx.world.read_scene if it holds several robots"
_MESH = "a mesh; dynx.world.mesh(name, file) makes a body of one, and the <geometry> of a URDF may name it"
_USD = "USD, which dynx does not read"

_INCLUDED = "a part that a file of MJCF includes; dynx.load reads the file with <mujoco>"

BY_ROOT = {
    "mujocoinclude": _INCLUDED,
    "sdf": _SDF,
    "gazebo": "SDF of a version before 1.3 (dynx reads 1.4 to 1.12, whose root is <sdf>), or settings for "
    "Gazebo that a URDF includes",
    "world": "a part of SDF, whose root is <sdf>",
    "mujoco": _MJCF,
    "COLLADA": _MESH,
}
"""Format of a file by its root element."""

_BY_SUFFIX = {
    ".sdf": _SDF,
    ".world": "a saved world (dynx.World.write), or SDF; dynx.World.read opens the first",
    ".mjcf": _MJCF,
    ".toml": "a scene, or settings; dynx.world.read_scene(file) reads a scene",
    ".json": "a scene, or another document; dynx.world.read_scene(file) reads a scene",
    ".srdf": "SRDF, which has groups of joints and no robot; Model.with_group_states reads its states",
    **dict.fromkeys((".stl", ".obj", ".dae", ".ply", ".gltf", ".glb"), _MESH),
    **dict.fromkeys((".usd", ".usda", ".usdc", ".usdz"), _USD),
}


_ROOTS = {".sdf": "<sdf version=...>", ".world": "<sdf version=...>", ".mjcf": "<mujoco model=...>"}


def wanted_root(path: str) -> str:
    """Return the root element that a description in a file of its suffix has."""
    return _ROOTS.get(PurePath(path).suffix.lower(), "<robot name=...>")


def format_hint(path: str) -> str:
    """Make the clause of an error for a file that is no URDF: what a file of its suffix is; may be empty."""
    kind = _BY_SUFFIX.get(PurePath(path).suffix.lower())
    return "" if kind is None else f" (a file {PurePath(path).suffix} is {kind})"
