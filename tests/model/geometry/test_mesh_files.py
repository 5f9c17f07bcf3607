"""Search for mesh files, and the error for a missing one."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from dynx.errors import DescriptionError
from dynx.model import package_search
from dynx.model.geometry.mesh_files import MeshNotFoundError, find_mesh, reason_unknown
from dynx.model.package_search import resolve_package
from dynx.rules.geometry import mesh_box


@pytest.fixture
def robot(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a description in a ROS package, with one mesh."""
    monkeypatch.delenv("ROS_PACKAGE_PATH", raising=False)
    monkeypatch.delenv("AMENT_PREFIX_PATH", raising=False)
    mesh = tmp_path / "arm_description/meshes/Base.stl"
    mesh.parent.mkdir(parents=True)
    mesh.write_bytes(b"")
    robot = tmp_path / "arm_description/urdf/arm.urdf"
    robot.parent.mkdir()
    robot.write_text("<robot/>")
    return robot


def test_a_mesh_is_found_in_its_package_beside_the_description_and_by_its_path(robot: Path) -> None:
    mesh = robot.parents[1] / "meshes/Base.stl"
    for name in (
        "package://arm_description/meshes/Base.stl",
        "../meshes/Base.stl",
        f"file://{mesh}",
        str(mesh),
    ):
        found = find_mesh(name, str(robot))
        assert found is not None
        assert found.samefile(mesh)


@pytest.mark.parametrize(
    "name", ["package://arm_description/meshes/base.stl", "../meshes/base.stl", "../nowhere/base.stl"]
)
def test_a_mesh_that_is_not_there_is_missed_and_the_nearest_name_told(robot: Path, name: str) -> None:
    if (robot.parents[1] / "meshes/base.stl").exists():
        pytest.skip("this file system does not tell capitals apart")
    with pytest.raises(MeshNotFoundError) as raised:
        find_mesh(name, str(robot))
    assert ("did you mean 'Base.stl'" in str(raised.value)) == ("nowhere" not in name)


@pytest.mark.parametrize(
    ("wanted", "hint"),
    [
        ("trunk.stl", ""),  # what is alike is the ending
        ("thigh.obj", "; did you mean 'thigh.stl'?"),
        ("thihg.stl", "; did you mean 'thigh.stl'?"),
        ("Thigh.STL", "; did you mean 'thigh.stl'?"),
    ],
)
def test_the_nearest_name_is_near_without_its_ending(tmp_path: Path, wanted: str, hint: str) -> None:
    description = tmp_path / "robot.urdf"
    description.write_text("<robot/>")
    (tmp_path / "thigh.stl").touch()
    (tmp_path / "calf.stl").touch()
    with pytest.raises(MeshNotFoundError) as missing:
        find_mesh(wanted, str(description))
    assert str(missing.value) == f"no file '{wanted}'{hint}"


def test_an_address_of_a_package_without_a_file_is_called_so(tmp_path: Path) -> None:
    description = tmp_path / "robot.urdf"
    description.write_text("<robot/>")
    for name in ("package://base.stl", "package://base.stl/"):
        assert reason_unknown(name, str(description)) == f"'{name}' names a package and no file in it"


def test_the_host_of_an_address_is_named(tmp_path: Path) -> None:
    description = tmp_path / "robot.urdf"
    description.write_text("<robot/>")
    assert reason_unknown("file://biped/meshes/a.stl", str(description)) == (
        "'biped' is the host in 'file://biped/meshes/a.stl'; an address of a path begins file:///"
    )


@pytest.mark.parametrize("name", ["package://hand/meshes/a.stl", "http://x/a.stl", "$(find a)/b.stl", ""])
def test_what_may_be_elsewhere_is_neither_found_nor_missed(robot: Path, name: str) -> None:
    assert find_mesh(name, str(robot)) is None


def test_text_without_a_file_has_no_folder() -> None:
    assert find_mesh("meshes/base.stl", "<string>") is None


@pytest.mark.parametrize(("variable", "below"), [("ROS_PACKAGE_PATH", ""), ("AMENT_PREFIX_PATH", "share")])
def test_packages_of_the_environment(
    robot: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, variable: str, below: str
) -> None:
    prefix = tmp_path / "install"
    mesh = prefix / below / "hand/a.stl"
    mesh.parent.mkdir(parents=True)
    mesh.write_bytes(b"")
    monkeypatch.setenv(variable, str(prefix))
    found = find_mesh("package://hand/a.stl", str(robot))
    assert found is not None
    assert found.samefile(mesh)
    with pytest.raises(MeshNotFoundError, match=r"no file 'b\.stl' in package 'hand'"):
        find_mesh("package://hand/b.stl", str(robot))


@pytest.mark.parametrize(
    "name",
    [
        "package://arm_description/../other.stl",
        "package://arm_description/meshes/link.stl",
        "package://etc/passwd",
        "package://other_description/a.stl",
        "../../other.stl",
        "../../missing.stl",
        "file:///etc/passwd",
        "file:///nowhere/base.stl",
        "/etc/passwd",
        "file://[",
        "a\0b.stl",
        "x" * 5000,
    ],
)
def test_nothing_outside_the_description_and_its_packages_is_looked_at(robot: Path, name: str) -> None:
    (robot.parents[2] / "other.stl").write_bytes(b"")
    (robot.parents[1] / "meshes/link.stl").symlink_to(robot.parents[2] / "other.stl")
    other = robot.parents[2] / "other_description"
    other.mkdir()
    (other / "a.stl").write_bytes(b"")
    assert find_mesh(name, str(robot)) is None


@pytest.mark.parametrize(
    "name", [".", "./", "meshes/..", "package://shared/", "package://shared/.", "package://shared/a/.."]
)
def test_names_beside_the_folders_of_the_description_are_not_suggested(tmp_path: Path, name: str) -> None:
    for folder in ("shared", "share", "share.stl", "sharedd"):
        (tmp_path / folder).mkdir()
    robot = tmp_path / "shared/robot.urdf"
    robot.write_text("<robot/>")
    (tmp_path / "shared/package.xml").write_text("<package/>")
    with pytest.raises(MeshNotFoundError) as caught:
        find_mesh(name, str(robot))
    assert "did you mean" not in str(caught.value)


@pytest.mark.parametrize(
    "name", ["package://data/other/a.stl", "package://data/other/b.stl", "package://data/a"]
)
def test_a_folder_above_is_no_package_by_its_name_alone(tmp_path: Path, name: str) -> None:
    robot = tmp_path / "data/downloads/robot.urdf"
    robot.parent.mkdir(parents=True)
    robot.write_text("<robot/>")
    (tmp_path / "data/other").mkdir()
    (tmp_path / "data/other/a.stl").write_bytes(b"")
    assert find_mesh(name, str(robot)) is None
    # With the parts of a package it is one.
    (tmp_path / "data/meshes").mkdir()
    package_search.package_of.cache_clear()
    assert find_mesh("package://data/other/a.stl", str(robot)) == tmp_path / "data/other/a.stl"


def test_packages_beside_the_description_are_found_by_their_marker(robot: Path) -> None:
    mesh = robot.parents[2] / "hand_description/a.stl"
    mesh.parent.mkdir()
    mesh.write_bytes(b"")
    name = "package://hand_description/a.stl"
    assert find_mesh(name, str(robot)) is None
    (mesh.parent / "package.xml").write_text("<package/>")
    package_search.package_of.cache_clear()
    found = find_mesh(name, str(robot))
    assert found is not None
    assert found.samefile(mesh)


@pytest.mark.parametrize("marker", ["package.xml", ".git"])
def test_paths_may_climb_within_the_package_or_repository(tmp_path: Path, marker: str) -> None:
    robot = tmp_path / "repository/arm/v2/robot.urdf"
    robot.parent.mkdir(parents=True)
    robot.write_text("<robot/>")
    mesh = tmp_path / "repository/meshes/a.stl"
    mesh.parent.mkdir()
    mesh.write_bytes(b"")
    assert find_mesh("../../meshes/a.stl", str(robot)) is None
    (tmp_path / "repository" / marker).mkdir()
    package_search.enclosing_folder.cache_clear()
    assert find_mesh("../../meshes/a.stl", str(robot)) == mesh
    with pytest.raises(MeshNotFoundError):
        find_mesh("../../meshes/b.stl", str(robot))


def test_paths_may_climb_within_a_python_package(tmp_path: Path) -> None:
    """Robots in MJCF come in Python packages, with folders of data below the modules."""
    robot = tmp_path / "site-packages/envs/robots/assets/hand/robot.xml"
    robot.parent.mkdir(parents=True)
    robot.write_text("<mujoco/>")
    mesh = robot.parents[1] / "stls/a.stl"
    mesh.parent.mkdir()
    mesh.write_bytes(b"")
    assert find_mesh("../stls/a.stl", str(robot)) is None
    for package in (robot.parents[2], robot.parents[3]):
        (package / "__init__.py").touch()
    package_search.enclosing_folder.cache_clear()
    assert find_mesh("../stls/a.stl", str(robot)) == mesh
    with pytest.raises(MeshNotFoundError):
        find_mesh("../../../b.stl", str(robot))
    assert find_mesh("../../../../b.stl", str(robot)) is None


@pytest.mark.parametrize("name", ["circle/a.stl", "pipe.stl", "a/b/../../c.stl"])
def test_names_of_no_file_are_missed(robot: Path, name: str) -> None:
    (robot.parent / "circle").symlink_to(robot.parent / "circle")
    os.mkfifo(robot.parent / "pipe.stl")
    with pytest.raises(MeshNotFoundError):
        find_mesh(name, str(robot))


def test_a_fifo_is_not_opened(robot: Path) -> None:
    os.mkfifo(robot.parent / "pipe.stl")
    assert mesh_box(robot.parent / "pipe.stl") is None
    with pytest.raises(MeshNotFoundError, match=r"^'pipe\.stl' is a FIFO; wanted a regular file$"):
        find_mesh("pipe.stl", str(robot))
    os.mkfifo(robot.parents[1] / "meshes/pipe.stl")
    uri = "package://arm_description/meshes/pipe.stl"
    with pytest.raises(MeshNotFoundError, match=r"^'meshes/pipe\.stl' in package '.*' is a FIFO"):
        find_mesh(uri, str(robot))
    with pytest.raises(DescriptionError, match=r"pipe\.stl' is a FIFO"):
        resolve_package(uri, [robot.parents[2]])


@pytest.mark.skipif(os.sep == "\\", reason="a backslash separates folders")
@pytest.mark.parametrize("name", ["..\\meshes\\Base.stl", "package://arm_description/meshes\\Base.stl"])
def test_backslashes_of_windows_are_named(robot: Path, name: str) -> None:
    with pytest.raises(MeshNotFoundError, match="with / in place of each backslash it is there"):
        find_mesh(name, str(robot))


def test_a_package_of_another_name_is_suggested(robot: Path) -> None:
    (robot.parents[1] / ".git").mkdir()
    name = "package://arm/meshes/Base.stl"
    assert find_mesh(name, str(robot)) is None
    assert f"if it is '{robot.parents[1]}', a package.xml there" in reason_unknown(name, str(robot))
    (robot.parents[1] / "package.xml").write_text("<package><name>arm</name></package>")
    package_search.package_of.cache_clear()
    package_search._packages.cache_clear()
    assert find_mesh(name, str(robot)) == robot.parents[1] / "meshes/Base.stl"
    assert "states another name" in reason_unknown("package://leg/meshes/Base.stl", str(robot))
