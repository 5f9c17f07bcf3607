"""Files of ``dynx world --export``: the scene as MJCF, TOML or JSON, its robots and bodies as URDF."""

from __future__ import annotations

from pathlib import Path

from dynx.errors import ArgumentError, nearest, shown
from dynx.files.writing import write_bytes
from dynx.world.scene import Scene, body_to_urdf, scene_to_mjcf, write_scene

SUFFIXES = (".xml", ".mjcf", ".urdf", ".toml", ".json")


def check_suffix(path: str) -> None:
    """Raise ArgumentError unless the suffix of a file is that of a format to which scenes are exported."""
    suffix = Path(path).suffix.lower()
    if suffix not in SUFFIXES:
        raise ArgumentError(
            f"--export {shown(path, 300)}: wanted a file in .xml or .mjcf (MJCF), .urdf, .toml or .json"
            f"{nearest(suffix, SUFFIXES)}"
        )


def export(scene: Scene, path: str) -> list[str]:
    """Write a scene in the format of the suffix of a file; return the files written.

    In URDF each robot and body has a file of its own, whose name stands before the suffix unless it is the
    only one. Raises the errors of `scene_to_mjcf`, `body_to_urdf`, `Model.to_urdf` and `write_scene`.
    """
    check_suffix(path)
    suffix = Path(path).suffix.lower()
    if suffix in (".toml", ".json"):
        write_scene(scene, path)
        return [path]
    if suffix != ".urdf":
        write_bytes(path, scene_to_mjcf(scene).encode())
        return [path]
    texts = {robot.name: robot.model.to_urdf(geometry=True) for robot in scene.robots}
    texts |= {body.name: body_to_urdf(body) for body in scene.bodies}
    files = [own_path(path, name, len(texts)) for name in texts]
    for file, text in zip(files, texts.values(), strict=True):
        write_bytes(file, text.encode())
    return files


def own_path(path: str, name: str, count: int) -> str:
    """Return the file of one of several: its name stands before the suffix."""
    if count == 1:
        return path
    file = Path(path)
    return str(file.with_name(f"{file.stem}.{name}{file.suffix}"))
