"""``package://`` resolves to files inside the given roots only."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from dynx.errors import DescriptionError
from dynx.model.package_search import find_package, resolve_package


@pytest.fixture
def root(tmp_path: Path) -> Path:
    (tmp_path / "root/robot/meshes").mkdir(parents=True)
    (tmp_path / "root/robot/meshes/arm.stl").touch()
    (tmp_path / "root/other").mkdir()
    (tmp_path / "root/other/secret").touch()
    (tmp_path / "secret").touch()
    return tmp_path / "root"


def test_a_package_is_a_folder_in_a_root_or_a_root(root: Path) -> None:
    mesh = root / "robot/meshes/arm.stl"
    for roots in ([root], [str(root / "robot")], [root / "other", root]):
        assert resolve_package("package://robot/meshes/arm.stl", roots) == mesh
    assert find_package("robot", [root]) == root / "robot"


@pytest.mark.parametrize(
    "uri",
    [
        "package://robot/../other/secret",
        "package://robot/meshes/../../../secret",
        "package://robot//etc/hostname",
        "package://../root/robot/meshes/arm.stl",
        "package:///etc/hostname",
        "package://.//secret",
        "package://robot/link",
        "package://outside/secret",
        "package://robot/meshes",
        "package://robot/gone.stl",
        "package://gone/arm.stl",
        "file:///etc/hostname",
        "package://",
        "",
    ],
)
def test_paths_outside_or_missing_raise(root: Path, uri: str) -> None:
    os.symlink(root.parent / "secret", root / "robot/link")
    os.symlink(root.parent, root / "outside")
    with pytest.raises(DescriptionError):
        resolve_package(uri, [root])


def test_without_roots_nothing_is_found() -> None:
    with pytest.raises(DescriptionError, match="give package_dirs="):
        resolve_package("package://robot/arm.stl", [])
