"""Resolution of ``package://`` paths within given folders, and the folders in which packages are known."""

from __future__ import annotations

import os
from collections.abc import Iterable
from importlib.util import find_spec
from pathlib import Path

from dynx.errors import DescriptionError, shown
from dynx.files.reading import irregularity

StrPath = str | os.PathLike[str]

DATA_PACKAGES = ("pybullet_data",)
"""Python packages of robots and meshes, found without being imported."""

_SEARCH_PATHS = (("ROS_PACKAGE_PATH", ""), ("AMENT_PREFIX_PATH", "share"))
"""Environment variables that list folders, and where packages lie in each of these."""


def data_folders() -> list[Path]:
    """Return the folders of `DATA_PACKAGES` that are installed."""
    specs = (find_spec(name) for name in DATA_PACKAGES)
    return [Path(os.path.realpath(spec.origin)).parent for spec in specs if spec is not None and spec.origin]


def environment_folders() -> tuple[Path, ...]:
    """Return the folders that hold packages by ROS_PACKAGE_PATH and AMENT_PREFIX_PATH."""
    listed = ((os.environ.get(variable, "").split(os.pathsep), below) for variable, below in _SEARCH_PATHS)
    return tuple(Path(entry, below) for entries, below in listed for entry in entries if entry)


def find_package(name: str, roots: Iterable[StrPath]) -> Path:
    """Return the folder of a ROS package: a root of that name, or a folder of that name in a root.

    Raises DescriptionError if no root has it.
    """
    tried = [Path(root).resolve() for root in roots]
    if name and name == os.path.basename(name) and name not in (".", ".."):
        for root in tried:
            for folder in ([root] if root.name == name else []) + [root / name]:
                if folder.is_dir() and folder.resolve().is_relative_to(root):
                    return folder.resolve()
    where = ", ".join(str(root) for root in tried) or "no folder (give package_dirs=)"
    raise DescriptionError(f"package {shown(name)} was not found; looked in {where}")


def resolve_package(uri: str, roots: Iterable[StrPath]) -> Path:
    """Return the file of ``package://name/rest``.

    Raises DescriptionError for another scheme, an unknown package, a missing file, or a path that leaves its
    package by ``..`` or by a symbolic link.
    """
    scheme, _, rest = uri.partition("://")
    if scheme != "package" or not rest:
        raise DescriptionError(f"{shown(uri)} is not a package path; wanted package://NAME/FILE")
    name, _, inside = rest.partition("/")
    package = find_package(name, roots)
    found = (package / inside).resolve()
    if not found.is_relative_to(package):
        raise DescriptionError(f"{shown(uri)} leaves the package {shown(name)}, which is not allowed")
    if not found.is_file():
        other = irregularity(found)
        if other:
            raise DescriptionError(f"{shown(uri)} {other}")
        raise DescriptionError(f"{shown(uri)} does not exist: no file {shown(inside)} in {package}")
    return found
