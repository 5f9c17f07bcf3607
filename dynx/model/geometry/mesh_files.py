"""Search for the file of a ``<mesh>``, as ROS and the engines search for it."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable
from functools import lru_cache
from pathlib import Path
from urllib.parse import unquote, urlsplit

from dynx.errors import DescriptionError, nearest, shown
from dynx.files.reading import irregularity
from dynx.model.package_paths import StrPath, environment_folders, find_package, resolve_package

_PACKAGE_FILES = ("package.xml", "manifest.xml")
"""Files that mark the root folder of a ROS package."""

_PACKAGE_PARTS = ("meshes", "mesh", "urdf")
"""Folders of a package that describes a robot."""

_PARTS = frozenset({"description", "model", "models", "robot", "robots", "urdf", "urdfs", "xacro"})
"""Names of folders that by convention lie beside the folder of the meshes."""

_THREE_SLASHES = re.compile("^package:///+")


class MeshNotFoundError(Exception):
    """The folder of a mesh is known, and the mesh is not in it."""


def find_mesh(filename: str, source: str, package_dirs: Iterable[StrPath] = ()) -> Path | None:
    """Find the file of a mesh named in the description `source` (a path); None where its folder is unknown.

    ``package://NAME/FILE`` is searched in the folders above the description and in ROS_PACKAGE_PATH and
    AMENT_PREFIX_PATH; a package in none of them may be installed elsewhere, so the result is None. A relative
    path starts from the description's folder. Raises MeshNotFoundError where the folder is known and the
    file is not in it.

    A description may come from anyone, so nothing is searched or listed outside the folder of its files (see
    `enclosing_folder`) and the packages: a path that leads elsewhere, also by a symbolic link, gives None.
    Folders in `package_dirs`, which the user names, are searched first: for packages, and for full paths.
    ``package:///NAME/FILE``, with a slash too many, is read as ``package://NAME/FILE``.
    """
    filename = _THREE_SLASHES.sub("package://", filename)
    for folder in package_dirs:
        found = _in_user_folder(filename, Path(folder))
        if found is not None:
            return found
    if not os.path.isfile(source):
        return None
    try:
        folder = Path(os.path.realpath(source)).parent
        if filename.startswith("package://"):
            return _in_package(filename, folder)
        if filename.startswith("file://"):
            path = Path(unquote(urlsplit(filename).path))
        elif "://" in filename or "$(" in filename or not filename.strip():
            return None
        else:
            path = folder / filename
        return _existing(path, enclosing_folder(folder), shown(filename, 200))
    except (OSError, ValueError, RuntimeError):  # The name is invalid, or symbolic links form a cycle.
        return None


def reason_unknown(filename: str, source: str) -> str:
    """Return the reason why `find_mesh` does not know the folder of a mesh."""
    if not os.path.isfile(source):
        return "the description was not read from a file"
    filename = _THREE_SLASHES.sub("package://", filename)
    if filename.startswith("package://"):
        name = filename.removeprefix("package://").partition("/")[0]
        try:
            found = _package(name, Path(os.path.realpath(source)).parent, environment_folders())
        except (OSError, ValueError, RuntimeError):
            found = None
        outside = f"{shown(filename, 200)} is outside its package"
        return f"package {shown(name)} was not found" if found is None else outside
    if "$(" in filename:
        return "only xacro and launch files expand $(...)"
    if "://" in filename and not filename.startswith("file://"):
        return f"dynx reads no {shown(filename.partition('://')[0] + '://')}"
    return f"{shown(filename, 200)} is outside the folder of the description"


def _in_user_folder(filename: str, root: Path) -> Path | None:
    """Return the file of a mesh in a folder that the user named, or None."""
    try:
        if filename.startswith("package://"):
            return resolve_package(filename, [root])
        full = filename.removeprefix("file://")
        found = Path(os.path.realpath(full)) if os.path.isabs(full) else None
        inside = found is not None and found.is_relative_to(os.path.realpath(root)) and found.is_file()
        return found if inside else None
    except (DescriptionError, OSError, ValueError, RuntimeError):
        return None


def _existing(path: Path, root: Path, described: str) -> Path | None:
    """Return the file of `path`; None where that is not below `root`; MeshNotFoundError without one."""
    real = Path(os.path.realpath(path))
    if not real.is_relative_to(root):
        return None
    if real.is_file():
        return real
    other = irregularity(real)
    if other:
        raise MeshNotFoundError(f"{described} {other}")
    # A path such as "." leads to the root itself, and what lies beside that is not listed.
    hint = _similar(real) if real != root else ""
    raise MeshNotFoundError(f"no file {described}{hint}")


# Cached, because a robot has dozens of meshes.
@lru_cache(maxsize=256)
def enclosing_folder(folder: Path) -> Path:
    """Return the folder of all files that come with a description: the repository, else the package.

    Without either it is the description's own folder, or the one above where the name of the folder shows
    that it holds descriptions only.
    """
    above = [each for each in (folder, *folder.parents) if _is_private(each)]
    for markers in ((".git",), _PACKAGE_FILES):
        for each in above:
            if any((each / marker).exists() for marker in markers):
                return each
    beside = folder.name.lower() in _PARTS or "urdf" in folder.name.lower()
    return folder.parent if beside and folder.parent in above else folder


def _is_private(folder: Path) -> bool:
    """Check whether a folder can belong to one description: not the root, a home folder, or one above it."""
    home = Path(os.path.realpath(os.path.expanduser("~")))
    return folder != folder.parent and not home.is_relative_to(folder)


def _in_package(uri: str, folder: Path) -> Path | None:
    name, _, inside = uri.removeprefix("package://").partition("/")
    package = _package(name, folder, environment_folders())
    if package is None:
        return None
    return _existing(package / inside, package, f"{shown(inside, 200)} in package {shown(name)}")


# Cached, because a description names its few packages hundreds of times.
@lru_cache(maxsize=256)
def _package(name: str, folder: Path, elsewhere: tuple[Path, ...]) -> Path | None:
    """Find a package: a folder of the description, one above it or beside one of these if it is marked as a
    package or, above, has the usual parts of one, or in a folder of the environment.

    The name alone is no evidence, because the description chooses it.
    """
    enclosing = enclosing_folder(folder)
    for root in (folder, *folder.parents):
        found = _find(name, [root]) if _is_private(root) else None
        if found is None:
            continue
        marked = any((found / marker).is_file() for marker in _PACKAGE_FILES)
        above = folder.is_relative_to(found) and any((found / part).is_dir() for part in _PACKAGE_PARTS)
        if marked or above or found.is_relative_to(enclosing):
            return found
    return _find(name, elsewhere)


def _find(name: str, roots: Iterable[Path]) -> Path | None:
    try:
        return find_package(name, roots)
    except DescriptionError:
        return None


def _similar(path: Path) -> str:
    """Return a clause with the nearest name in the folder; empty where no name is near."""
    try:
        names = sorted(os.listdir(path.parent))
    except (OSError, ValueError):
        return ""
    hint = nearest(path.name, names)
    return hint if "did you mean" in hint else ""
