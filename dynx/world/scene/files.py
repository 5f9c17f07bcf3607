"""Files of scenes: TOML, or JSON with the same keys."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterable
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from dynx.argument_types import checks_types
from dynx.errors import (
    ArgumentError,
    DescriptionError,
    NotInstalledError,
    RobotNotFoundError,
    importing,
    nearest,
    shown,
)
from dynx.files.documents import parse_json
from dynx.files.reading import checked_path, printable, read_file
from dynx.files.writing import write_bytes
from dynx.model.library import SCENES, own_roots, robots, scene_names
from dynx.model.other_formats import format_hint
from dynx.model.package_search import StrPath
from dynx.world.scene.documents import scene_document, scene_from_document
from dynx.world.scene.paths import ScenePaths
from dynx.world.scene.scene import Scene

SUFFIXES = (".toml", ".json")
"""Suffixes of files of scenes that are read and written."""

MJCF_SUFFIXES = (".xml", ".mjcf")
"""Suffixes of files in MJCF, of which scenes are read."""

MAX_TOML = 8 * 2**20
"""Largest size of a scene in TOML, of which Python reads about a million characters a second."""

MAX_KEY_PARTS = 16
"""Largest number of parts of a dotted key; Python's time grows with its square."""

_PART = r"""(?:(?<![\w-])[\w-]+|"[^"\n]*"|'[^'\n]*')"""
_LONG_KEY = re.compile(rf"{_PART}(?:[ \t]*\.[ \t]*{_PART}){{{MAX_KEY_PARTS}}}")


@checks_types
def read_scene(
    source: str | os.PathLike[str],
    *,
    package_dirs: Iterable[StrPath] = (),
    keyframe: str | None = None,
) -> Scene:
    """Read a scene from a ``.toml`` or ``.json`` file, one of the scenes of dynx by its name, or MJCF.

    The reference page "Files of scenes, exports, shapes and meshes" describes the keys. dynx reads the robots
    and meshes that a file names only from its folder (its repository or package, if it lies in one), from the
    libraries of robots, and from `package_dirs`. A robot in a ``.xacro`` file is expanded, which evaluates
    expressions of that file as Python code: read only scenes with such files that you trust. Other files may
    come from anyone.

    A file in MJCF (``.xml``, ``.mjcf``) starts at its `qpos0`, or at the `keyframe` of that name. If it does
    not exist, dynx searches the package ``pybullet_data``, as for ``mjcf/striker.xml``. The page
    "Robots in MJCF" lists how dynx reads its elements, and `notes` of the scene name elements that dynx does
    not read.

    Raises RobotNotFoundError if there is no such file, ArgumentError and its subclasses for a file that is no
    scene, with the place in it, and the errors of `dynx.load` for its robots. UnknownNameError for a keyframe
    that the file does not have.
    """
    path = Path(checked_path(source))
    suffix = path.suffix.lower()
    if suffix in MJCF_SUFFIXES:
        if isinstance(source, str) and not path.exists():
            # Imported here, because most files are there.
            from dynx.model.missing_robot import in_data_package

            path = in_data_package(source) or path
        return _read_mjcf(path, package_dirs, keyframe)
    if keyframe is not None:
        raise ArgumentError(
            f"keyframe is {shown(keyframe)}, and {shown(str(path))} is no file in MJCF, which has keyframes"
        )
    if suffix not in SUFFIXES:
        path = _named(str(path))
    name = printable(str(path))
    text = _text(read_file(str(path)), name)
    try:
        document = _parsed(text, path.suffix.lower())
    except ValueError as error:
        raise ArgumentError(f"{name} cannot be read: {error}") from None
    try:
        return scene_from_document(document, ScenePaths(path.parent, package_dirs))
    except (ArgumentError, DescriptionError, RobotNotFoundError) as error:
        kind = DescriptionError if isinstance(error, DescriptionError) else type(error)
        raise kind(f"{name}: {error}") from error


def _read_mjcf(path: Path, package_dirs: Iterable[StrPath], keyframe: str | None) -> Scene:
    # Imported here, because most scenes are no files in MJCF.
    from dynx.world.scene.mjcf_reading import scene_from_mjcf

    name = printable(str(path))
    scene = scene_from_mjcf(read_file(str(path)), name, package_dirs, keyframe)
    if scene is None:
        raise ArgumentError(
            f"{name} is no scene: its first element is not <mujoco>; dynx.load(file) reads a robot in URDF"
        )
    return scene


@checks_types
def write_scene(scene: Scene, path: str | os.PathLike[str]) -> None:
    """Write a scene to a ``.toml`` or ``.json`` file, atomically; `read_scene` returns an equal one.

    Robots are written as URDF text with the full paths of their meshes; those that lie neither with the file
    nor with a library need `package_dirs` when it is read. Raises ArgumentError for another suffix
    or a file that cannot be written, NotInstalledError for ``.toml`` without tomli-w (extra ``world``).
    """
    file = checked_path(path)
    suffix = Path(file).suffix.lower()
    if suffix not in SUFFIXES:
        raise ArgumentError(f"a scene is written as .toml or .json, not as {shown(Path(file).name)}")
    document = scene_document(scene, ScenePaths(os.path.dirname(file) or "."))
    if suffix == ".json":
        write_bytes(file, json.dumps(document, indent=1, allow_nan=False).encode())
        return
    with importing("a scene in TOML needs tomli-w: pip install 'dynx[world]'"):
        import tomli_w
    write_bytes(file, tomli_w.dumps(document, multiline_strings=True).encode())


_ROBOT_FILES = (".urdf", ".xacro", ".sdf")


def _named(name: str) -> Path:
    for root in own_roots():
        path = root / SCENES / f"{name}.toml"
        if name in scene_names() and path.is_file():
            return path
    known = scene_names()
    is_file = name.lower().endswith(_ROBOT_FILES)
    hint = ""
    if is_file or name in _robot_names():
        bodies = [{"name": "ground", "shape": {"plane": True}}]
        robot = {"name": "robot", "robot": os.path.basename(name) if is_file else name}
        text = json.dumps({"schema": "dynx.scene/1", "bodies": bodies, "robots": [robot]})
        hint = f"; a .json file{' beside it' if is_file else ''} with this robot on the ground is {text}"
    raise RobotNotFoundError(
        f"no scene {shown(name)} (a file of a scene ends in .toml, .json or, in MJCF, .xml)"
        f"{format_hint(name)}{hint}"
        f"{nearest(name, known)}"
    )


def _robot_names() -> set[str]:
    return {entry.name for entry in robots()}


def _text(data: bytes, name: str) -> str:
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise ArgumentError(f"{name} is not text in UTF-8: {error}") from None


def _parsed(text: str, suffix: str) -> Any:
    if suffix == ".json":
        return parse_json(text)
    if len(text) > MAX_TOML:
        raise ValueError(
            f"it is larger than {MAX_TOML // 2**20} MiB, the most that is read of TOML; use JSON"
        )
    long = _LONG_KEY.search(text)
    if long is not None:
        line = text.count("\n", 0, long.start()) + 1
        raise ValueError(f"a key in line {line} has more than {MAX_KEY_PARTS} parts: {shown(long[0])}")
    # Part of Python from 3.11 on; before that, tomli is the same module.
    for name in ("tomllib", "tomli"):
        if find_spec(name) is not None:
            try:
                return import_module(name).loads(text)
            except RecursionError:
                raise ValueError("its lists and tables are nested too deeply") from None
    raise NotInstalledError("a scene in TOML needs tomli: pip install 'dynx[world]'")
