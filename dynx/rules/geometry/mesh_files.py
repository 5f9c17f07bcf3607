"""Search for the file of a ``<mesh>``, as ROS and the engines search for it."""

from __future__ import annotations

import os
from functools import lru_cache
from pathlib import Path
from urllib.parse import unquote, urlsplit

from dynx.errors import DescriptionError, nearest, shown
from dynx.model.package_paths import find_package, resolve_package

_SEARCH_PATHS = (("ROS_PACKAGE_PATH", ""), ("AMENT_PREFIX_PATH", "share"))
"""Environment variables that list folders, and where packages lie in each of these."""


class MeshNotFoundError(Exception):
    """The folder of a mesh is known, and the mesh is not in it."""


def find_mesh(filename: str, source: str) -> Path | None:
    """Find the file of a mesh named in the description `source` (a path); None where its folder is unknown.

    ``package://NAME/FILE`` is searched in the folders above the description and in ROS_PACKAGE_PATH and
    AMENT_PREFIX_PATH; a package in none of them may be installed elsewhere, so the result is None. A relative
    path starts from the description's folder. Raises MeshNotFoundError where the folder is known and the
    file is not in it.
    """
    if not os.path.isfile(source):
        return None
    folder = Path(source).resolve().parent
    if filename.startswith("package://"):
        return _in_package(filename, folder)
    if filename.startswith("file://"):
        path = Path(unquote(urlsplit(filename).path))
    elif "://" in filename or "$(" in filename or not filename.strip():
        return None
    else:
        path = folder / filename
    if _is_file(path):
        return path
    raise MeshNotFoundError(f"no file {shown(filename, 200)}{_similar(path)}")


def _in_package(uri: str, folder: Path) -> Path | None:
    name, _, inside = uri.removeprefix("package://").partition("/")
    elsewhere = [(os.environ.get(variable, ""), below) for variable, below in _SEARCH_PATHS]
    package = _package(name, folder, tuple(elsewhere))
    if package is None:
        return None
    try:
        return resolve_package(uri, [package])
    except DescriptionError:
        raise MeshNotFoundError(
            f"no file {shown(inside, 200)} in package {shown(name)}{_similar(package / inside)}"
        ) from None


# A description names its few packages hundreds of times.
@lru_cache(maxsize=256)
def _package(name: str, folder: Path, elsewhere: tuple[tuple[str, str], ...]) -> Path | None:
    roots = [folder, *folder.parents]
    for listed, below in elsewhere:
        roots += [Path(entry, below) for entry in listed.split(os.pathsep) if entry]
    try:
        return find_package(name, roots)
    except DescriptionError:
        return None


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except (OSError, ValueError):  # a name that no file can have
        return False


def _similar(path: Path) -> str:
    """Return a clause with the nearest name in the folder; empty where no name is near."""
    try:
        names = sorted(os.listdir(path.parent))
    except (OSError, ValueError):
        return ""
    hint = nearest(path.name, names)
    return hint if "did you mean" in hint else ""
