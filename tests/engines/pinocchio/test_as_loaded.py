"""Pinocchio as it loads a file, in the coordinates of dynx."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio
import pytest
from hypothesis import given
from hypothesis import strategies as st

import dynx
from dynx.agreement.tolerances import BAR
from dynx.engines.pinocchio.as_loaded import LoadedPinocchio
from dynx.engines.pinocchio.engine_model import MAX_NV
from dynx.errors import EngineError
from dynx.loaded.difference import model_difference
from dynx.model import Joint, Link, Model, Pose
from dynx.model.tree import Base
from dynx.reference.backend import ReferenceBackend
from dynx.spatial.scalar import Floats
from tests.backends.robots import chain, motion
from tests.loaded.files import TILTED, assert_alike, clean_robots, error, file_robots, loaded
from tests.loaded.fork import BASES, BODY, LOSSES, check_loaded_as_written, forked


@given(st.data())
def test_clean_robots_are_loaded_as_dynx_reads_them(data: st.DataObject) -> None:
    model = data.draw(clean_robots())
    with loaded(LoadedPinocchio, model) as robot:
        assert_alike(robot, model, data.draw(st.integers(0, 99)))


@given(st.data())
def test_so_is_every_robot_that_a_file_can_say(data: st.DataObject) -> None:
    model = data.draw(file_robots())
    with loaded(LoadedPinocchio, model) as robot:
        assert_alike(robot, model, data.draw(st.integers(0, 99)), solve=False)


@given(file_robots())
def test_what_it_holds_is_what_the_file_says(model: Model) -> None:
    # A file has no reflected inertia; dynx writes it in an extension.
    joints = tuple(replace(joint, dynamics=replace(joint.dynamics, armature=0.0)) for joint in model.joints)
    model = replace(model, joints=joints)
    with loaded(LoadedPinocchio, model) as robot:
        assert model_difference(model, [robot.describe()]) == ()


@pytest.mark.parametrize("base", BASES)
def test_joints_are_in_the_order_of_dynx(base: Base) -> None:
    model = forked(base, LOSSES)
    with loaded(LoadedPinocchio, model) as robot:
        assert_alike(robot, model)


@pytest.mark.parametrize("base", BASES)
def test_what_it_holds_comes_link_by_link(base: Base) -> None:
    held = check_loaded_as_written(LoadedPinocchio, forked(base, LOSSES))
    assert held.links["tool"].mass == BODY.mass
    assert held.links["z"].merged == ("tool",)
    assert held.links["z"].mass == 2 * BODY.mass
    joint = held.joints["z_joint"]
    assert (joint.effort, joint.damping, joint.friction) == (40.0, 0.5, 0.25)


@pytest.mark.parametrize("name", ["ur5", "talos", "double_pendulum_continuous"])
@pytest.mark.parametrize("base", BASES)
def test_real_robots_are_loaded_as_dynx_reads_them(name: str, base: Base) -> None:
    model = dynx.load(name, base=base, gravity=TILTED)
    model = replace(model, joints=tuple(replace(joint, mimic=None) for joint in model.joints))
    robot = LoadedPinocchio(Path(model.source), model)
    with robot:
        assert_alike(robot, model)
        assert model_difference(model, [robot.describe()]) == ()


def test_a_joint_named_like_that_of_a_free_base_loses_its_child() -> None:
    model = forked("floating", LOSSES)
    links, joints = (
        model.links,
        [replace(joint, name=joint.name.replace("z_joint", "root_joint")) for joint in model.joints],
    )
    named = Model.build("named", links, joints, base="floating", gravity=TILTED)
    q = named.random(0)
    poses = ReferenceBackend(named).forward_kinematics(q)
    with loaded(LoadedPinocchio, named) as robot:
        assert error(robot.link_poses(q), poses) > BAR
    with loaded(LoadedPinocchio, named.with_base("fixed")) as robot:
        assert_alike(robot, named.with_base("fixed"))


def test_a_joint_that_the_model_lacks_is_held_at_zero() -> None:
    model = forked("floating", LOSSES)
    locked = dynx.load(model, lock={"a_joint": 0.0})
    with loaded(LoadedPinocchio, locked, model.to_urdf()) as robot:
        assert_alike(robot, locked)


def test_masses_that_vanish_show_as_nan() -> None:
    links = [Link("a"), Link("b")]
    model = Model.build("empty", links, [Joint("j", "revolute", "a", "b")])
    with loaded(LoadedPinocchio, model) as robot:
        assert np.isnan(robot.forward_dynamics(np.zeros(1), np.zeros(1), np.zeros(1))).all()
        assert robot.mass_matrix(np.zeros(1)).tolist() == [[0.0]]


def test_engine_output_is_captured_and_not_printed(capfd: pytest.CaptureFixture[str]) -> None:
    model = forked("fixed", LOSSES)
    text = model.to_urdf()
    spoiled = text.replace(f'value="{BODY.mass}"', 'value="heavy"', 1)
    assert spoiled != text
    with loaded(LoadedPinocchio, model, spoiled) as robot:
        held = robot.describe()
    assert any("trunk" in line for line in held.remarks)
    assert {row.name for row in model_difference(model, [held])} <= {"trunk"}
    assert capfd.readouterr() == ("", "")


def test_a_link_that_is_not_there_has_no_pose() -> None:
    model = forked("fixed", LOSSES)
    text = model.to_urdf()
    joint = text[text.index('  <joint name="weld"') : text.index('  <joint name="a_joint"')]
    link = text[text.index('  <link name="tool"') : text.index('  <link name="a"')]
    q = np.zeros(2)
    with loaded(LoadedPinocchio, model, text.replace(joint, "").replace(link, "")) as robot:
        poses: Floats = robot.link_poses(q)
        assert np.isnan(poses).any(axis=(1, 2)).tolist() == [link.name == "tool" for link in model.links]
        assert np.isnan(robot.jacobian(q, "tool")).all()
        assert robot.describe().missing_links == ("tool",)


def test_files_that_drake_refuses_raise_its_message() -> None:
    model = forked("fixed", LOSSES)
    for text, words in (
        (model.to_urdf().replace(' effort="9.0"', ""), "does not contain a valid URDF model"),
        (model.to_urdf().replace('"a_joint"', '"b_joint"'), "'a_joint' .not there"),
        (model.to_urdf().replace("continuous", "planar"), "'z_joint' .JointModelPlanar"),
    ):
        assert text != model.to_urdf()
        with pytest.raises(EngineError, match=words), loaded(LoadedPinocchio, model, text):
            pass


def test_what_is_no_file_is_not_handed_over(tmp_path: Path) -> None:
    for path in (tmp_path, tmp_path / "none.urdf"):
        with pytest.raises(EngineError, match="no regular file"):
            LoadedPinocchio(path, forked("fixed", LOSSES))


def test_more_joints_than_memory_allows_are_refused() -> None:
    model = chain(MAX_NV + 1)
    with (
        pytest.raises(EngineError, match=f"has {MAX_NV + 1} degrees of freedom"),
        loaded(LoadedPinocchio, model),
    ):
        pass


@pytest.mark.parametrize("base", BASES)
def test_the_call_that_is_shown_loads_the_robot(base: Base, tmp_path: Path) -> None:
    model = forked(base, LOSSES)
    path = tmp_path / "robot.urdf"
    path.write_text(model.to_urdf())
    names = {"pinocchio": pinocchio, "path": str(path)}
    exec(LoadedPinocchio.load_call(model.floating), names)
    made = names["model"]
    q, v, a = motion(model)
    with LoadedPinocchio(path, model) as robot:
        assert (made.nv, made.nq) == (model.nv, model.nq + 1)
        assert robot.inverse_dynamics(q, v, a).shape == (made.nv,)
    assert LoadedPinocchio.engine_version() == pinocchio.__version__


@pytest.mark.parametrize("form", ["urdf", "mjcf"])
def test_a_link_fixed_to_the_world_keeps_its_inertia(form: str, tmp_path: Path) -> None:
    links = [Link(name, BODY) for name in ("world", "pedestal", "plate", "arm", "tool")]
    if form == "mjcf":
        links[0] = Link("world")
    joints = [
        Joint("mount", "fixed", "world", "pedestal"),
        Joint("lid", "fixed", "pedestal", "plate", Pose((0.1, 0.2, 0.3), (0.4, 0.5, 0.6))),
        Joint("turn", "continuous", "plate", "arm", Pose((0.0, 0.1, 0.2)), (0.0, 0.0, 1.0)),
        Joint("weld", "fixed", "arm", "tool", Pose((0.3, 0.2, 0.1))),
    ]
    model = Model.build("mounted", links, joints)
    path = tmp_path / ("robot.xml" if form == "mjcf" else "robot.urdf")
    path.write_text(model.to_mjcf() if form == "mjcf" else model.to_urdf())
    model = dynx.load(path)
    with LoadedPinocchio(path, model) as robot:
        held = robot.describe()
    assert model_difference(model, [held]) == ()
    assert [held.links[name].mass for name in ("pedestal", "plate")] == [BODY.mass] * 2
    assert held.links["arm"].mass == 2 * BODY.mass
