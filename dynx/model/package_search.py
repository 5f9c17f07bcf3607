"""Search for the packages of a description: in its repository, around it, and in the environment."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Iterator
from contextlib import suppress
from functools import lru_cache
from importlib.util import find_spec
from pathlib import Path

from dynx.errors import DescriptionError, shown
from dynx.files.reading import irregularity

# Resolution of ``package://`` paths within given folders, and the folders in which packages are known.


StrPath = str | os.PathLike[str]

DATA_PACKAGES = ("pybullet_data",)
"""Python packages of robots and meshes, found without being imported."""

_SEARCH_PATHS = (
    ("ROS_PACKAGE_PATH", ""),
    ("AMENT_PREFIX_PATH", "share"),
    ("GZ_SIM_RESOURCE_PATH", ""),
    ("SDF_PATH", ""),
    ("GAZEBO_MODEL_PATH", ""),
)
"""Environment variables that list folders, and where packages lie in each of these."""


def data_folders() -> list[Path]:
    """Return the folders of `DATA_PACKAGES` that are installed."""
    specs = (find_spec(name) for name in DATA_PACKAGES)
    return [Path(os.path.realpath(spec.origin)).parent for spec in specs if spec is not None and spec.origin]


def environment_folders() -> tuple[Path, ...]:
    """Return the folders that hold packages, or models, by ROS_PACKAGE_PATH, AMENT_PREFIX_PATH,
    GZ_SIM_RESOURCE_PATH, SDF_PATH and GAZEBO_MODEL_PATH."""
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
                if os.path.isdir(folder) and folder.resolve().is_relative_to(root):
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
    if not os.path.isfile(found):
        other = irregularity(found)
        if other:
            raise DescriptionError(f"{shown(uri)} {other}")
        raise DescriptionError(f"{shown(uri)} does not exist: no file {shown(inside)} in {package}")
    return found


MODEL_MANIFEST = "model.config"
"""File that marks the folder of a model of Gazebo, and names its SDF."""

MANIFESTS = ("package.xml", "manifest.xml", MODEL_MANIFEST)
"""Files that mark the root folder of a package; the first states the name of a ROS package."""

MAX_FOLDERS = 5000
"""Largest number of folders of a repository that are searched for a package."""

_MAX_MANIFEST = 2**16
"""Largest part of a manifest that is read for its name [bytes]."""

_PACKAGE_PARTS = ("meshes", "mesh", "urdf")
"""Folders of a package that describes a robot."""

_DESCRIPTION_FOLDERS = frozenset(
    {"description", "model", "models", "robot", "robots", "urdf", "urdfs", "xacro"}
)
"""Names of folders that by convention lie beside the folder of the meshes."""

_COMMENT = re.compile(rb"<!--.*?-->", re.DOTALL)
_NAME = re.compile(rb"<name>\s*([^<\s]+)\s*</name>")


# Cached, because a robot has dozens of meshes.
@lru_cache(maxsize=256)
def enclosing_folder(folder: Path) -> Path:
    """Return the folder of all files that come with a description: the repository, else the package of ROS,
    else the outermost Python package around it.

    Without any it is the description's own folder, or the one above where the name of the folder shows
    that it holds descriptions only.
    """
    above = [each for each in (folder, *folder.parents) if _is_private(each)]
    for markers in ((".git",), MANIFESTS):
        for each in above:
            if any((each / marker).exists() for marker in markers):
                return each
    python = [each for each in above if (each / "__init__.py").exists()]
    if python:
        return python[-1]
    beside = folder.name.lower() in _DESCRIPTION_FOLDERS or "urdf" in folder.name.lower()
    return folder.parent if beside and folder.parent in above else folder


# Cached, because a description names its few packages hundreds of times.
@lru_cache(maxsize=256)
def package_of(name: str, folder: Path, elsewhere: tuple[Path, ...]) -> Path | None:
    """Find a package for the descriptions in `folder`; None if nothing around them is the package.

    It is a folder of that name: one of the description, or one above it or beside one of these if it is
    marked as a package or, above, has the usual parts of one. Else it is the nearest package of the
    repository whose manifest states the name, as ROS names packages, or the nearest folder of that name that
    holds a model of Gazebo, such as ``models/NAME`` beside ``worlds``. Else it is a folder of the
    environment, `elsewhere`. The name alone is no evidence outside the repository, because the description
    chooses it.
    """
    enclosing = enclosing_folder(folder)
    for root in (folder, *folder.parents):
        found = _find(name, [root]) if _is_private(root) else None
        if found is None:
            continue
        marked = any(os.path.isfile(found / marker) for marker in MANIFESTS)
        above = folder.is_relative_to(found) and any(os.path.isdir(found / part) for part in _PACKAGE_PARTS)
        if marked or above or found.is_relative_to(enclosing):
            return found
    return _by_manifest(name, folder, enclosing) or _find(name, elsewhere)


def _by_manifest(name: str, folder: Path, enclosing: Path) -> Path | None:
    """Return the package or model below `enclosing` of that name that has the most folders in common with
    `folder`."""
    if not any((enclosing / marker).exists() for marker in (".git", *MANIFESTS)):
        return None  # A folder of downloads, say, which is as large as it may be.
    found = [package for package, stated in _packages(enclosing) if stated == name]
    found = found or [model for model in _models(enclosing) if model.name == name]

    def nearness(package: Path) -> tuple[int, bool, int, str]:
        common = len(os.path.commonpath([package, folder]))
        # Repositories keep models of their own and downloaded ones in folders beside each other.
        return -common, package.parent.name != "models", len(package.parts), str(package)

    return min(found, key=nearness, default=None)


@lru_cache(maxsize=16)
def _packages(root: Path) -> tuple[tuple[Path, str], ...]:
    """Return the packages below a folder, each with the name that its manifest states."""
    return tuple((folder, name) for folder in _folders(root) if (name := _stated_name(folder)))


@lru_cache(maxsize=16)
def _models(root: Path) -> tuple[Path, ...]:
    """Return the folders below a folder that hold a model of Gazebo."""
    return tuple(folder for folder in _folders(root) if os.path.isfile(folder / MODEL_MANIFEST))


def _folders(root: Path) -> Iterator[Path]:
    """Yield a folder and those below it, the outer ones first, without hidden ones and symbolic links."""
    level = [root]
    count = 0
    while level:
        below: list[Path] = []
        for folder in level:
            yield folder
            count += 1
            if count >= MAX_FOLDERS:
                return
            with suppress(OSError):
                entries = sorted(os.scandir(folder), key=lambda entry: entry.name)
                below += [
                    Path(entry.path)
                    for entry in entries
                    if not entry.name.startswith(".") and entry.is_dir(follow_symlinks=False)
                ]
        level = below


def _stated_name(folder: Path) -> str:
    """Return the name that the manifest of a package states; empty if the folder has none."""
    manifest = folder / MANIFESTS[0]
    try:
        if manifest.is_symlink() or not manifest.is_file():
            return ""
        with open(manifest, "rb") as file:
            stated = _NAME.search(_COMMENT.sub(b"", file.read(_MAX_MANIFEST)))
    except OSError:
        return ""
    return stated[1].decode("utf-8", "replace") if stated else ""


def _is_private(folder: Path) -> bool:
    """Check whether a folder can belong to one description: not the root, a home folder, or one above it."""
    home = Path(os.path.realpath(os.path.expanduser("~")))
    return folder != folder.parent and not home.is_relative_to(folder)


def _find(name: str, roots: Iterable[Path]) -> Path | None:
    try:
        return find_package(name, roots)
    except DescriptionError:
        return None
