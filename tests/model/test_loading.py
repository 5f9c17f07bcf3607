"""Arguments of `load` (text, bytes, paths, names, models) and their precedence."""

from __future__ import annotations

import codecs
import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

import dynx
from dynx.errors import (
    ArgumentError,
    DescriptionError,
    DTypeError,
    ModelError,
    NotFiniteError,
    RobotNotFoundError,
    UnknownNameError,
)
from dynx.model import Link, Note
from dynx.model.library import find
from dynx.model.loading import build_described, load
from dynx.model.tree import Description
from tests.conftest import needs_examples
from tests.model.descriptions import joint, robot

TEXT = joint()


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_text_bytes_and_files_give_equal_models(here: Path) -> None:
    path = here / "x.urdf"
    path.write_text(TEXT)
    ways: list[str | bytes | bytearray | os.PathLike[str]] = [
        TEXT,
        "\n \ufeff" + TEXT,
        path,
        str(path),
        "x.urdf",
    ]
    ways += ["./x.urdf", TEXT.encode(), bytearray(TEXT.encode()), codecs.BOM_UTF8 + TEXT.encode()]
    assert len({load(way) for way in ways}) == 1
    assert load(TEXT).source == "<string>"
    assert load("x.urdf").source == "x.urdf"


def test_errors_name_the_file_and_the_line(here: Path) -> None:
    Path("x.urdf").write_text(robot("<link/>"))
    with pytest.raises(DescriptionError, match=r"^x\.urdf:2: a <link> has no name"):
        load("x.urdf")


@needs_examples
def test_a_name_takes_precedence_over_a_file_and_a_path_over_a_name(here: Path) -> None:
    Path("ur5").write_text(TEXT)
    assert load("ur5").name == "ur5"
    assert load("ur5").nq == 6
    assert load("./ur5").nq == load(Path("ur5")).nq == 1


@needs_examples
def test_a_suffix_is_never_looked_up_as_a_name(here: Path) -> None:
    with pytest.raises(RobotNotFoundError, match=r"no such file: 'ur5\.urdf'; the library has 'ur5'"):
        load("ur5.urdf")
    Path("ur5.urdf").write_text(TEXT)
    assert load("ur5.urdf").nq == 1


def test_a_bare_name_outside_the_library_may_be_a_file(here: Path) -> None:
    Path("mine").write_text(TEXT)
    assert load("mine").nq == 1


def test_a_robot_without_a_name_is_named_after_its_file(here: Path) -> None:
    Path("arm.v2.urdf").write_text(robot('<link name="a"/>', ""))
    assert load("arm.v2.urdf").name == "arm"


def test_the_home_folder_is_expanded(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOME", str(here))
    (here / "x.urdf").write_text(TEXT)
    assert load("~/x.urdf").nq == 1


@pytest.mark.parametrize(
    "x", ["", " ", "no_such_robot", "a\0b", "x" * 10_000, "\x1b[31m", "robot\n", "nul\0.urdf"]
)
def test_unknown_names_and_files_raise(here: Path, x: str) -> None:
    with pytest.raises(RobotNotFoundError) as caught:
        load(x)
    assert str(caught.value).isprintable()
    assert len(str(caught.value)) < 1000


@pytest.mark.parametrize("x", [".", "/", "folder/"])
def test_a_directory_is_refused(here: Path, x: str) -> None:
    Path("folder").mkdir()
    with pytest.raises((DescriptionError, RobotNotFoundError)):
        load(x)
    with pytest.raises(DescriptionError, match="is a directory"):
        load(Path("folder"))


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="this system has no FIFOs")
def test_a_fifo_is_refused_under_every_suffix(here: Path) -> None:
    for name in ("pipe.urdf", "pipe.xacro", "pipe"):
        os.mkfifo(name)
        with pytest.raises(DescriptionError, match="is a FIFO"):
            load(name)


def test_a_broken_link_is_not_found(here: Path) -> None:
    os.symlink("gone.urdf", "x.urdf")
    with pytest.raises(RobotNotFoundError, match="no such file"):
        load("x.urdf")


@pytest.mark.parametrize("x", [None, 3, ["ur5"], object()])
def test_arguments_of_other_types_raise(x: Any) -> None:
    with pytest.raises(ArgumentError, match="wanted a path, text, a name or a Model"):
        load(x)


@pytest.mark.parametrize("data", [b"", b"ur5", b"\0\0", b"\xff\xfe"])
def test_bytes_are_always_text(data: bytes) -> None:
    with pytest.raises(ModelError):
        load(data)


def test_base_gravity_and_locks_are_applied() -> None:
    model = load(TEXT, base="floating", gravity=(1, 2, 3), lock={"j": 0.5})
    assert (model.base, model.gravity, model.nq, model.nv) == ("floating", (1.0, 2.0, 3.0), 7, 6)
    plain = load(TEXT)
    assert (plain.base, plain.gravity, plain.nq) == ("fixed", (0.0, 0.0, -9.81), 1)


def test_wrong_arguments_are_named() -> None:
    free: Any = "free"
    shut: Any = "shut"
    with pytest.raises(ArgumentError, match="wanted 'fixed' or 'floating'"):
        load(TEXT, base=free)
    with pytest.raises(NotFiniteError, match="gravity"):
        load(TEXT, gravity=(0, 0, float("nan")))
    with pytest.raises(ArgumentError, match="gravity has shape"):
        load(TEXT, gravity=9.81)
    with pytest.raises(UnknownNameError, match="cannot lock 'k': no such joint"):
        load(TEXT, lock={"k": 0.0})
    with pytest.raises(DTypeError, match="cannot lock 'j' at 'shut'"):
        load(TEXT, lock={"j": shut})
    with pytest.raises(NotFiniteError, match="cannot lock 'j' at inf"):
        load(TEXT, lock={"j": float("inf")})


def test_loading_a_model_keeps_options_that_are_not_given() -> None:
    model = load("ur5", base="floating", gravity=(0, 0, -1)).with_frame("tip", "tool0")
    assert load(model) == model
    assert load(model, base="fixed") == model.with_base("fixed")
    assert load(model, gravity=(0, 0, 1)) == model.with_gravity((0, 0, 1))
    locked = load(model, lock={"elbow_joint": 0.3})
    assert locked.nq == model.nq - 1
    assert (locked.base, locked.gravity, locked.extra_frames) == (
        model.base,
        model.gravity,
        model.extra_frames,
    )
    direct = load("ur5", base="floating", gravity=(0, 0, -1), lock={"elbow_joint": 0.3})
    assert locked == direct.with_frame("tip", "tool0")


def test_a_path_of_the_library_and_its_name_give_equal_models() -> None:
    assert load(find("z1")) == load("z1")


def test_a_package_path_is_found_in_the_folders_given_and_in_those_of_the_environment(
    here: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for variable in ("ROS_PACKAGE_PATH", "AMENT_PREFIX_PATH"):
        monkeypatch.delenv(variable, raising=False)
    for root in ("own", "ros", "ament/share"):
        folder = here / root / f"{Path(root).parts[0]}_arm" / "urdf"
        folder.mkdir(parents=True)
        (folder / "arm.urdf").write_text(TEXT)
    assert load("package://own_arm/urdf/arm.urdf", package_dirs=[here / "own"]) == load(TEXT)
    with pytest.raises(RobotNotFoundError, match="package 'ros_arm' was not found; looked in"):
        load("package://ros_arm/urdf/arm.urdf")
    monkeypatch.setenv("ROS_PACKAGE_PATH", os.pathsep.join([str(here / "none"), str(here / "ros")]))
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(here / "ament"))
    assert load("package://ros_arm/urdf/arm.urdf") == load("package://ament_arm/urdf/arm.urdf")


def test_a_package_path_leads_to_no_file_outside_of_its_package(here: Path) -> None:
    (here / "arm").mkdir()
    (here / "secret.urdf").write_text(TEXT)
    (here / "arm" / "link.urdf").symlink_to(here / "secret.urdf")
    for inside in ("../secret.urdf", "link.urdf"):
        with pytest.raises(RobotNotFoundError, match="leaves the package 'arm'"):
            load(f"package://arm/{inside}", package_dirs=[here])
    with pytest.raises(RobotNotFoundError, match=r"no file 'arm.urdf' in .*arm"):
        load("package://arm/arm.urdf", package_dirs=[here])


def test_the_robots_of_pybullet_data_are_found_without_a_folder() -> None:
    data = pytest.importorskip("pybullet_data")
    path = "a1/a1.urdf"
    found = load(f"package://pybullet_data/{path}", base="floating")
    assert found == load(Path(data.getDataPath()) / path, base="floating")
    assert found.geometry.collisions(found.root)


def test_a_misspelt_option_gets_the_nearest_name() -> None:
    wrong: dict[str, Any] = {"bse": "floating"}
    with pytest.raises(UnknownNameError, match=r"load has no option 'bse'; did you mean 'base'\?"):
        dynx.load("pendulum", **wrong)


def test_parts_that_form_no_tree_are_blamed_on_an_element_only_if_one_was_left_out() -> None:
    parts = Description("pair", [Link("a"), Link("b")], [], [], [])
    with pytest.raises(DescriptionError, match="root") as caught:
        build_described(parts, "pair.xml")
    plain = caught.value.message
    left_out = Note("<group> was ignored", 7)
    with pytest.raises(DescriptionError) as caught:
        build_described(replace(parts, unread=left_out), "pair.xml")
    assert caught.value.message == f"<group> was ignored (read without it: {plain})"
    assert caught.value.line == 7
