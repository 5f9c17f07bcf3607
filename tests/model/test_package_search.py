"""Packages of a description, by folder and by the name that their manifests state."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from dynx.errors import DescriptionError
from dynx.model import package_search
from dynx.model.package_search import find_package, package_of, resolve_package


def _package(folder: Path, name: str) -> Path:
    folder.mkdir(parents=True)
    (folder / "package.xml").write_text(f"<package><!-- <name>old</name> --><name>{name}</name></package>")
    return folder


@pytest.fixture
def repository(tmp_path: Path) -> Path:
    root = tmp_path / "robots-main"
    (root / ".git").mkdir(parents=True)
    (root / "src/arm/urdf").mkdir(parents=True)
    return root


def test_a_package_is_found_anywhere_in_the_repository_by_the_name_of_its_manifest(repository: Path) -> None:
    urdf = repository / "src/arm/urdf"
    tool = _package(repository / "hardware/tools/gripper-v2", "gripper")
    itself = _package(repository / "src/arm/config", "arm_config")
    assert package_of("gripper", urdf, ()) == tool
    assert package_of("arm_config", urdf, ()) == itself
    assert package_of("old", urdf, ()) is None
    assert package_of("gripper", repository.parent, ()) is None


def test_the_root_of_a_repository_is_a_package_by_its_manifest(repository: Path) -> None:
    (repository / "package.xml").write_text("<package><name> robots </name></package>")
    assert package_of("robots", repository / "src/arm/urdf", ()) == repository


def test_of_two_packages_of_a_name_the_nearer_one_counts(repository: Path) -> None:
    far = _package(repository / "archive/gripper-v1", "gripper")
    near = _package(repository / "src/tools/gripper-v2", "gripper")
    assert package_of("gripper", repository / "src/arm/urdf", ()) == near
    assert package_of("gripper", repository / "archive", ()) == far


def test_a_model_of_gazebo_is_found_in_the_repository_by_the_name_of_its_folder(repository: Path) -> None:
    worlds = repository / "src/arm/worlds"
    for name in ("fuel_models/table", "models/table", "models/chair"):
        (repository / "src/arm" / name).mkdir(parents=True)
    assert package_of("table", worlds, ()) is None
    package_search.package_of.cache_clear()
    package_search._models.cache_clear()
    for name in ("fuel_models/table", "models/table"):
        (repository / "src/arm" / name / "model.config").touch()
    assert package_of("table", worlds, ()) == repository / "src/arm/models/table"
    assert package_of("chair", worlds, ()) is None


def test_hidden_folders_links_and_folders_outside_are_not_searched(repository: Path) -> None:
    outside = _package(repository.parent / "elsewhere/gripper-v1", "gripper")
    _package(repository / ".cache/gripper-v1", "gripper")
    (repository / "linked").symlink_to(outside.parent)
    assert package_of("gripper", repository / "src/arm/urdf", ()) is None


def test_the_environment_comes_last(repository: Path) -> None:
    installed = _package(repository.parent / "share/gripper", "gripper")
    folder = repository / "src/arm/urdf"
    assert package_of("gripper", folder, (installed.parent,)) == installed
    package_search.package_of.cache_clear()
    package_search._packages.cache_clear()
    own = _package(repository / "tools/gripper-v2", "gripper")
    assert package_of("gripper", folder, (installed.parent,)) == own


def test_the_search_of_a_large_repository_ends(repository: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(package_search, "MAX_FOLDERS", 3)
    _package(repository / "a/b/c/gripper-v1", "gripper")
    assert package_of("gripper", repository / "src/arm/urdf", ()) is None


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
