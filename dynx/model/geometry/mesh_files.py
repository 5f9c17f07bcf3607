"""Search for the file of a ``<mesh>``, as ROS and the engines search for it."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable
from contextlib import suppress
from difflib import get_close_matches
from pathlib import Path
from urllib.parse import unquote, urlsplit

from dynx.errors import DescriptionError, nearest, shown
from dynx.files.reading import irregularity
from dynx.model.package_search import (
    MANIFESTS,
    StrPath,
    enclosing_folder,
    environment_folders,
    package_of,
    resolve_package,
)

_BULLET_SCHEMES = re.compile("^(file|package|model)://")

_BULLET_FORMATS = (".stl", ".obj", ".dae")
"""Ends of the names of meshes that PyBullet reads; it refuses a description with others."""

_PACKAGE = re.compile("^(package:///+|model://)")


class MeshNotFoundError(Exception):
    """The folder of a mesh is known, and the mesh is not in it."""


def find_mesh(filename: str, source: str, package_dirs: Iterable[StrPath] = ()) -> Path | None:
    """Find the file of a mesh named in the description `source` (a path); None where its folder is unknown.

    ``package://NAME/FILE`` is searched around the description (`package_search`) and in ROS_PACKAGE_PATH and
    AMENT_PREFIX_PATH; a package in none of them may be installed elsewhere, so the result is None. A relative
    path starts from the description's folder. Raises MeshNotFoundError where the folder is known and the
    file is not in it.

    A description may come from anyone, so nothing is searched or listed outside the folder of its files (see
    `enclosing_folder`) and the packages: a path that leads elsewhere, also by a symbolic link, gives None.
    Folders in `package_dirs`, which the user names, are searched first: for packages, and for other paths
    that lead into them.
    ``package:///NAME/FILE``, with a slash too many, is read as ``package://NAME/FILE``, and so is
    ``model://NAME/FILE``, in which Gazebo names a folder with a ``model.config``.
    """
    filename = _PACKAGE.sub("package://", filename)
    for folder in package_dirs:
        found = _in_user_folder(filename, Path(folder), source)
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


def find_above(filename: str, source: str) -> Path | None:
    """Find the file of a mesh as PyBullet alone does: below the folder of the description `source`, or below
    a folder above it, whatever the path begins with; None without one within the `enclosing_folder`.

    So ``/meshes/a.stl``, ``meshes/a.stl`` beside the folder ``urdf``, and ``package://`` with the name of a
    folder above lead to files that other engines miss.
    """
    inside = _BULLET_SCHEMES.sub("", filename).lstrip("/")
    # `realpath` drops a slash at the end, with which the path names no file.
    if not inside.strip() or inside.endswith("/") or not os.path.isfile(source):
        return None
    with suppress(OSError, ValueError, RuntimeError):
        folder = Path(os.path.realpath(source)).parent
        root = enclosing_folder(folder)
        for above in (folder, *folder.parents):
            if not above.is_relative_to(root):
                break
            real = Path(os.path.realpath(above / inside))
            if real.is_relative_to(root) and real.is_file():
                return real
    return None


def find_by_bullet(filename: str, source: str) -> Path | None:
    """Find the file of a mesh by `find_above`; None for a format that PyBullet does not read."""
    return find_above(filename, source) if filename.lower().endswith(_BULLET_FORMATS) else None


def found_by_bullet(filename: str, source: str) -> str:
    """Return a clause that says where PyBullet alone finds a mesh that `find_mesh` does not; else nothing."""
    found = find_by_bullet(filename, source)
    if found is None:
        return ""
    where = os.path.relpath(found, Path(os.path.realpath(source)).parent)
    return f"; PyBullet alone finds {shown(Path(where).as_posix(), 200)}"


def reason_unknown(filename: str, source: str) -> str:
    """Return the reason why `find_mesh` does not know the folder of a mesh."""
    if not os.path.isfile(source):
        return "the description was not read from a file"
    kind = "model" if filename.startswith("model://") else "package"
    filename = _PACKAGE.sub("package://", filename)
    if filename.startswith("package://"):
        name, _, inside = filename.removeprefix("package://").partition("/")
        if not inside:
            return f"{shown(filename, 200)} names a {kind} and no file in it"
        try:
            found = package_of(name, Path(os.path.realpath(source)).parent, environment_folders())
        except (OSError, ValueError, RuntimeError):
            found = None
        if found is not None:
            return f"{shown(filename, 200)} is outside its {kind}"
        return f"{kind} {shown(name)} was not found{_possible_package(filename, source)}"
    if "$(" in filename:
        return "only xacro and launch files expand $(...)"
    if "://" in filename and not filename.startswith("file://"):
        return f"dynx reads no {shown(filename.partition('://')[0] + '://')}"
    host = urlsplit(filename).netloc if filename.startswith("file://") else ""
    if host and host != "localhost":
        return f"{shown(host)} is the host in {shown(filename, 200)}; an address of a path begins file:///"
    return (
        f"{shown(filename, 200)} is outside the folder of the description; a .git or package.xml in a folder "
        "around both includes it, and so does package_dirs=[FOLDER] in Python"
    )


def _possible_package(uri: str, source: str) -> str:
    """Return a clause with the folder that has the file of a mesh and may be its package under another name;
    else nothing."""
    inside = uri.removeprefix("package://").partition("/")[2]
    found = find_above(inside, source)
    if found is None or not found.as_posix().endswith(f"/{inside}"):
        return ""
    folder = found.as_posix().removesuffix(f"/{inside}")
    if os.path.exists(os.path.join(folder, MANIFESTS[0])):
        return f"; {shown(folder, 300)} has the file, and its package.xml states another name"
    return f"; if it is {shown(folder, 300)}, a package.xml there can state its name"


def _in_user_folder(filename: str, root: Path, source: str) -> Path | None:
    """Return the file of a mesh in a folder that the user named, or None; a relative path starts from the
    folder of the description."""
    try:
        if filename.startswith("package://"):
            return resolve_package(filename, [root])
        full = filename.removeprefix("file://")
        if not os.path.isabs(full):
            if "://" in filename or not os.path.isfile(source):
                return None
            full = os.path.join(os.path.dirname(os.path.realpath(source)), full)
        found = Path(os.path.realpath(full))
        inside = found.is_relative_to(os.path.realpath(root)) and found.is_file()
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
    slashed = Path(os.path.realpath(str(path).replace("\\", "/")))
    if slashed != real and slashed.is_relative_to(root) and slashed.is_file():
        raise MeshNotFoundError(f"no file {described}; with / in place of each backslash it is there")
    # A path such as "." leads to the root itself, and what lies beside that is not listed.
    hint = _similar(real) if real != root else ""
    raise MeshNotFoundError(f"no file {described}{hint}")


def _in_package(uri: str, folder: Path) -> Path | None:
    name, _, inside = uri.removeprefix("package://").partition("/")
    package = package_of(name, folder, environment_folders())
    if package is None:
        return None
    return _existing(package / inside, package, f"{shown(inside, 200)} in package {shown(name)}")


def _similar(path: Path) -> str:
    """Return a clause with the nearest name in the folder; empty where no name is near."""
    try:
        names = sorted(os.listdir(path.parent))
    except (OSError, ValueError):
        return ""
    # Names that are near without their endings, which are alike in many files.
    stems = {name: os.path.splitext(name)[0] for name in names}
    near = get_close_matches(path.stem.lower(), {stem.lower() for stem in stems.values()}, n=3, cutoff=0.55)
    hint = nearest(path.name, [name for name, stem in stems.items() if stem.lower() in near])
    return hint if "did you mean" in hint else ""
