"""Paths in files of scenes: of robots and meshes, which must lie with the scene or in a known folder."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path

from dynx.errors import DescriptionError, nearest, shown
from dynx.files.reading import irregularity
from dynx.model.library import example_roots, own_roots
from dynx.model.package_search import StrPath, data_folders, enclosing_folder, resolve_package


class ScenePaths:
    """Paths from one scene's file. A file may come from anyone, so it leads to nothing outside of the folder
    that it lies in (of its repository or package, if it lies in one), of the library of robots, of
    the Python packages of `data_folders`, and of the folders that the user names."""

    def __init__(self, folder: StrPath | None, package_dirs: Iterable[StrPath] = ()) -> None:
        """`folder` is that of the scene's file; None for text."""
        self._folder = None if folder is None else Path(os.path.realpath(folder))
        self.package_dirs = tuple(os.path.realpath(each) for each in package_dirs)

    def find(self, name: str, what: str) -> str:
        """Return the full path of a file that a scene names; DescriptionError for one outside or missing."""
        if name.startswith("package://"):
            return str(resolve_package(name, [*self.package_dirs, *data_folders()]))
        if "://" in name:
            raise DescriptionError(f"{what} is {shown(name, 200)}; wanted a path or package://NAME/FILE")
        if self._folder is None and not os.path.isabs(name):
            raise DescriptionError(f"{what} is {shown(name, 200)}, relative to the folder of no file")
        try:
            found = Path(os.path.realpath(os.path.join(self._folder or "/", os.path.expanduser(name))))
        except ValueError:
            raise DescriptionError(f"{what} is {shown(name, 200)}, which is no path") from None
        if not any(found.is_relative_to(root) for root in self.roots()):
            raise DescriptionError(
                f"{what} is {shown(name, 200)}, outside the folder of the scene (see package_dirs)"
            )
        other = irregularity(found)
        if other:
            raise DescriptionError(f"{what} is {shown(name, 200)}, which {other}")
        if not os.path.isfile(found):
            siblings = sorted(os.listdir(found.parent)) if os.path.isdir(found.parent) else []
            hint = nearest(found.name, siblings)
            raise DescriptionError(f"{what} is {shown(name, 200)}, which is no file{hint}")
        return str(found)

    def folders(self, names: Iterable[str]) -> list[str]:
        """Return those of the folders named that lie in one of `roots`, as full paths."""
        full = (os.path.realpath(os.path.join(self._folder or "/", name)) for name in names)
        return [each for each in full if any(Path(each).is_relative_to(root) for root in self.roots())]

    def write(self, path: str) -> str:
        """Return a path as the scene's file names it: relative where it lies with it, else full."""
        real = Path(os.path.realpath(path))
        for folder in data_folders():
            if real.is_relative_to(folder):
                return f"package://{folder.name}/{real.relative_to(folder).as_posix()}"
        if self._folder is not None and real.is_relative_to(enclosing_folder(self._folder)):
            return Path(os.path.relpath(real, self._folder)).as_posix()
        return str(real)

    def roots(self) -> list[Path]:
        """Return the folders in which the files of a scene may lie."""
        own = [] if self._folder is None else [enclosing_folder(self._folder)]
        return [*own, *map(Path, self.package_dirs), *_library_folders(), *data_folders()]


def _library_folders() -> list[Path]:
    return [Path(os.path.realpath(root)) for root in (*example_roots(), *own_roots())]
