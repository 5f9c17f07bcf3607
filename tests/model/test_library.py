"""All files of example-robot-data, and dynx's own, are reachable by names that do not change."""

from __future__ import annotations

import importlib.util
import re
from collections import Counter
from importlib import metadata
from pathlib import Path

import pytest

from dynx.errors import DescriptionError, RobotNotFoundError
from dynx.model import library
from dynx.model.library import DYNX_MODELS, EXAMPLE_ROBOT_DATA, LibraryRobot, find, robots
from dynx.model.loading import load
from tests.conftest import needs_examples

EXAMPLES = [entry for entry in robots() if entry.source == EXAMPLE_ROBOT_DATA]
OWN = [entry for entry in robots() if entry.source == DYNX_MODELS]

# The file that each loader of example-robot-data loads.
LOADERS = {
    "a1": "a1_description/urdf/a1.urdf",
    "anymal": "anymal_b_simple_description/robots/anymal.urdf",
    "anymal_c": "anymal_c_simple_description/urdf/anymal.urdf",
    "hector": "hector_description/robots/quadrotor_base.urdf",
    "iris": "iris_description/robots/iris_simple.urdf",
    "panda": "panda_description/urdf/panda.urdf",
    "solo12": "solo_description/robots/solo12.urdf",
    "solo8": "solo_description/robots/solo.urdf",
    "talos": "talos_data/robots/talos_reduced.urdf",
    "talos_arm": "talos_data/robots/talos_left_arm.urdf",
    "ur3": "ur_description/urdf/ur3_robot.urdf",
    "ur5": "ur_description/urdf/ur5_robot.urdf",
    "ur5_limited": "ur_description/urdf/ur5_joint_limited_robot.urdf",
    "xarm7": "xarm_description/urdf/xarm7.urdf",
    "z1": "z1_description/urdf/z1.urdf",
}


@needs_examples
def test_every_installed_file_has_exactly_one_name() -> None:
    installed = metadata.distribution(EXAMPLE_ROBOT_DATA)
    files = {Path(str(installed.locate_file(f))) for f in installed.files or [] if f.name.endswith(".urdf")}
    assert {entry.path.resolve() for entry in EXAMPLES} == {path.resolve() for path in files}
    assert len(EXAMPLES) == len(files)


def test_every_model_of_dynx_has_exactly_one_name() -> None:
    folder = Path(__file__).resolve().parents[2] / "models"
    assert {entry.path for entry in OWN} == set(folder.glob("*.urdf"))
    assert len(OWN) == len({entry.path for entry in OWN})


def test_names_are_unique() -> None:
    count = Counter(name for entry in robots() for name in (entry.name, *entry.aliases))
    assert [name for name, n in count.items() if n > 1] == []


def test_names_can_be_typed_and_are_never_taken_for_paths() -> None:
    for entry in robots():
        for name in (entry.name, *entry.aliases):
            assert name.replace("_", "").replace("-", "").replace(".", "").isalnum()
            assert not name.endswith((".urdf", ".xacro", ".xml"))
            assert find(name) == entry.path


@pytest.mark.parametrize("name", LOADERS)
def test_short_names_are_those_of_the_loaders(name: str) -> None:
    assert find(name).as_posix().endswith("/" + LOADERS[name])


def test_files_with_the_same_stem_are_distinguished_by_their_folder() -> None:
    assert find("ur_description_ur3").name == "ur3.urdf"
    assert find("iris_description_iris").name == "iris.urdf"
    assert find("dynx_double_pendulum") != find("double_pendulum")


def test_names_do_not_depend_on_the_order_of_the_file_system(monkeypatch: pytest.MonkeyPatch) -> None:
    before = robots()
    in_order = library._urdf_files
    monkeypatch.setattr(library, "_urdf_files", lambda root: in_order(root)[::-1])
    robots.cache_clear()
    try:
        assert robots() == before
    finally:
        robots.cache_clear()


@pytest.mark.parametrize("entry", robots(), ids=lambda entry: entry.name)
def test_every_robot_loads_but_the_empty_shell(entry: library.LibraryRobot) -> None:
    if entry.name == "ur_description_ur3":
        with pytest.raises(DescriptionError, match="the robot has no link"):
            load(entry.name)
        return
    for base, extra in (("fixed", 0), ("floating", 7)):
        model = load(entry.name, base="floating" if base == "floating" else "fixed")
        assert model.nq == len(model.joint_names) + extra
        assert model.total_mass >= 0.0
        assert model.source == str(entry.path)


@needs_examples
def test_an_unknown_name_offers_the_nearest() -> None:
    with pytest.raises(RobotNotFoundError, match=r"no robot 'ur_5'.*did you mean 'ur5'"):
        find("ur_5")


def test_the_error_of_an_empty_library(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(library, "example_roots", list)
    monkeypatch.setattr(library, "own_roots", list)
    robots.cache_clear()
    try:
        assert robots() == ()
        with pytest.raises(RobotNotFoundError, match="is example-robot-data installed"):
            find("ur5")
    finally:
        robots.cache_clear()


def test_the_data_is_found_under_a_prefix_too(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    robot = tmp_path / "share/example-robot-data/robots/z_description/urdf/zed.urdf"
    robot.parent.mkdir(parents=True)
    robot.write_text('<robot name="zed"><link name="base"/></robot>')

    def absent(_: str) -> metadata.Distribution:
        raise metadata.PackageNotFoundError

    monkeypatch.setattr("dynx.model.library.metadata.distribution", absent)
    monkeypatch.setattr("dynx.model.library.sys.path", [])
    monkeypatch.setenv("CMAKE_PREFIX_PATH", str(tmp_path))
    monkeypatch.delenv("AMENT_PREFIX_PATH", raising=False)
    robots.cache_clear()
    try:
        assert find("zed") == robot
    finally:
        robots.cache_clear()


def test_robots_of_example_robot_data_come_first_each_group_by_name() -> None:
    assert list(robots()) == sorted(EXAMPLES, key=lambda entry: entry.name) + sorted(
        OWN, key=lambda entry: entry.name
    )


SPEC = importlib.util.find_spec("pybullet_data")
ROOT = Path(SPEC.origin).parent if SPEC is not None and SPEC.origin else None

# File, kind of error, line, and the defect, as an editor shows it.
DEFECTS = {
    "bicycle/bike.urdf": (DescriptionError, 103, "'0.07, 0, -0.69'"),
    "biped/biped2d_pybullet.urdf": (DescriptionError, 115, "'-1.57.'"),
    "husky/husky.urdf": (DescriptionError, 97, "$(optenv HUSKY_IMU_XYZ"),
    "quadruped/microtaur/microtaur.urdf": (DescriptionError, 300, "'-3.14159 1.57079 0 0'"),
    "torus_deform.urdf": (DescriptionError, None, "the robot has no link"),
}

needs_pybullet_data = pytest.mark.skipif(ROOT is None, reason="pybullet_data is not installed")


@needs_pybullet_data
@pytest.mark.parametrize("file", DEFECTS)
def test_a_file_with_a_defect_is_refused_for_it(file: str) -> None:
    assert ROOT is not None
    kind, line, message = DEFECTS[file]
    with pytest.raises(kind) as caught:
        load(ROOT / file)
    assert message in str(caught.value)
    assert caught.value.line == line


@needs_pybullet_data
def test_every_other_file_loads_and_is_read_back_equal() -> None:
    assert ROOT is not None
    files = sorted(path for path in ROOT.rglob("*.urdf"))
    assert len(files) > 1000
    for path in files:
        if path.relative_to(ROOT).as_posix() not in DEFECTS:
            model = load(path)
            if not model.ball_joints:
                assert load(model.to_urdf()) == model, path
            else:
                assert path.stem in ("humanoid", "spherical_joint_limit")


DATA = importlib.util.find_spec("pybullet_data")


@pytest.fixture
def data() -> Path:
    """Return the folder of pybullet_data."""
    if DATA is None or DATA.origin is None:
        pytest.skip("needs pybullet_data")
    return Path(DATA.origin).resolve().parent


@pytest.mark.parametrize(
    ("name", "file"),
    [
        ("r2d2", "r2d2.urdf"),
        ("plane", "plane.urdf"),
        ("plane.urdf", "plane.urdf"),
        ("samurai.urdf", "samurai.urdf"),
        ("kuka_iiwa/model.urdf", "kuka_iiwa/model.urdf"),
        ("kuka_iiwa/model", "kuka_iiwa/model.urdf"),
        ("quadruped/minitaur.urdf", "quadruped/minitaur.urdf"),
        ("kuka_iiwa/kuka_with_gripper2.sdf", "kuka_iiwa/kuka_with_gripper2.sdf"),
        ("mjcf/ant.xml", "mjcf/ant.xml"),
    ],
)
def test_files_of_pybullet_data_are_found_as_pybullet_finds_them(name: str, file: str, data: Path) -> None:
    found = load(name)
    assert Path(found.source) == data / file
    assert found == load(f"package://pybullet_data/{file}")


def test_a_file_of_the_user_and_a_robot_of_the_library_come_first(
    data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "plane.urdf").write_text('<robot name="mine"><link name="base"/></robot>')
    assert load("plane.urdf").name == "mine"
    assert load("pendulum5.urdf").source == str(data / "pendulum5.urdf")
    assert Path(load("cart_pole").source).is_relative_to(library.own_roots()[0])


@pytest.mark.parametrize(
    "name",
    ["./r2d2.urdf", "../pybullet_data/r2d2.urdf", "/r2d2.urdf", "kuka_iiwa/../r2d2.urdf", "", "r2\0d2.urdf"],
)
def test_other_paths_are_none_of_pybullet_data(
    name: str, data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(RobotNotFoundError):
        load(name)


@pytest.mark.parametrize(
    ("name", "hint"),
    [
        ("minitaur", "did you mean 'quadruped/minitaur.urdf'"),
        ("minitaur.urdf", "did you mean 'quadruped/minitaur.urdf'"),
        ("kuka_iiwa", "'kuka_iiwa/model.urdf'"),
        ("plain.urdf", "did you mean 'plane'"),
        ("kuka_iiwa/modle.sdf", "did you mean 'kuka_iiwa/model.sdf'"),
        ("ant.xml", "did you mean 'mjcf/ant.xml'"),
        ("cartpol", "did you mean 'cart_pole'"),
    ],
)
def test_a_name_near_a_file_of_pybullet_data_names_it(
    name: str, hint: str, data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(RobotNotFoundError) as error:
        load(name)
    assert hint in str(error.value)


@pytest.mark.parametrize("name", ["plane.urdf", "kuka_iiwa/model", "kuka_iiwa/model.urdf", "../r2d2"])
def test_a_name_of_the_library_is_no_path(name: str, data: Path) -> None:
    """A file of a policy may name a robot that `find` knows, and no file beside it."""
    with pytest.raises(RobotNotFoundError):
        find(name)


@pytest.mark.parametrize("robot", robots(), ids=lambda robot: robot.name)
def test_the_name_of_a_file_of_the_library_names_the_robot(robot: LibraryRobot) -> None:
    with pytest.raises(RobotNotFoundError, match=rf"; the library has .*'{re.escape(robot.name)}'"):
        load(f"nowhere/{robot.path.name}")


def test_a_name_far_from_all_names_the_command_that_lists_them() -> None:
    with pytest.raises(RobotNotFoundError, match=f"`dynx robots` lists the {len(robots())} that are there$"):
        load("qzqzq")
