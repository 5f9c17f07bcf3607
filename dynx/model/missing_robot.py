"""A robot that the library does not have under its name: in a package of data, or what may be meant."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path, PurePath

from dynx.errors import nearest, shown
from dynx.model.package_search import data_folders

_DESCRIPTIONS = (".urdf", ".sdf", ".world", ".xml", ".mjcf")
"""Suffixes of descriptions that need no program to be read, unlike xacro."""


def in_data_package(name: str) -> Path | None:
    """Return the file of a Python package of data (``pybullet_data``) that is called `name` there, as
    ``kuka_iiwa/model.urdf``, ``kuka_iiwa/model.sdf`` or ``mjcf/ant.xml``; None if no package has it. A URDF
    file may be named without its suffix, as ``r2d2``.

    A path never leaves the package; one that begins with a dot is a file of the user's own.
    """
    if not name or os.path.isabs(name) or {".", ".."}.intersection(name.split("/")):
        return None
    file = name if name.endswith(_DESCRIPTIONS) else f"{name}.urdf"
    for folder in data_folders():
        with suppress(OSError, ValueError):
            found = (folder / file).resolve()
            if found.is_file() and found.is_relative_to(folder):
                return found
    return None


def hint_for_file(path: str, library: Mapping[str, Path]) -> str:
    """Return a clause with the robots of the `library`, files by name, or the files of packages of data that
    `path`, which is no file, may mean; empty without one."""
    file = PurePath(path)
    known = [name for name, each in library.items() if file.stem == name or file.name == each.name]
    return f"; the library has {' and '.join(map(shown, known))}" if known else _hint_of_data_package(path)


def hint_for_name(name: str, library: Mapping[str, Path]) -> str:
    """Return a clause with the robots that `name` may mean, else with where they are listed."""
    if not library:
        return "; the library is empty: is example-robot-data installed?"
    made = [each for each in _OF_MAKER.get(re.split(r"[\W_]", name.lower())[0], ()) if each in library]
    if made:
        return f"; did you mean {' or '.join(map(shown, made))}?"
    near = nearest(name, library)
    of_data = _hint_of_data_package(name) if re.fullmatch(r"[\w-]+", name) else ""
    if of_data and (".urdf" in of_data or "?" not in near):
        return of_data
    if "?" in near:
        return near
    return f"; `dynx robots` lists the {len(set(library.values()))} that are there"


_OF_MAKER = {
    "anybotics": ("anymal", "anymal_c"),
    "emika": ("panda",),
    "fr3": ("panda",),
    "franka": ("panda",),
    "gen3": ("kinova",),
    "jaco": ("kinova",),
    "pal": ("talos", "tiago"),
    "rethink": ("baxter",),
    "ufactory": ("xarm7",),
    "universal": ("ur5", "ur10"),
}
"""Robots of the library by the first word of what they are called besides, or by their maker."""


def _hint_of_data_package(name: str) -> str:
    """Return a clause with the files of packages of data that have the suffix of `name`, else .urdf, and
    whose file or folder is called so, else with the nearest names; empty without one."""
    suffix = PurePath(name).suffix
    if suffix not in _DESCRIPTIONS:
        suffix = ".urdf"
    word = name.removesuffix(suffix)
    files = [
        path.relative_to(folder).as_posix()
        for folder in data_folders()
        for depth in ("*", "*/*", "*/*/*")
        for path in sorted(folder.glob(f"{depth}{suffix}"))
    ]
    same = [each for each in files if word in (Path(each).stem, Path(each).parent.name)]
    if same:
        return f"; did you mean {' or '.join(map(shown, same[:3]))}?"
    near = nearest(word, [each.removesuffix(".urdf") for each in files])
    return near if "?" in near else ""
