"""Robots written as SDF are read back by dynx, and loaded by Drake, as the same robots."""

from __future__ import annotations

import math
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given

import dynx
from dynx.errors import DescriptionError
from dynx.model import Inertial, Joint, JointDynamics, Limits, Link, Mimic, Model, Pose
from dynx.model.conversion import robot_differences, shape_differences
from dynx.model.elements import IDENTITY
from dynx.model.geometry import (
    Appearance,
    Box,
    Capsule,
    Collision,
    Cylinder,
    Ellipsoid,
    Geometry,
    HeightField,
    LinkGeometry,
    Plane,
    Sphere,
    Visual,
)
from dynx.model.sdf.extension import NAME
from dynx.model.sdf.writer import SdfWriter
from dynx.model.tree import STANDARD_GRAVITY, Base
from dynx.model.urdf.reader import inertia_fault
from dynx.testing.strategies import models

LOCAL_ROBOTS = ("six_axis_arm", "seven_axis_arm", "scara", "cart_pole", "double_pendulum", "planar_3r")

BODY = Inertial(2.0, Pose((0.1, -0.2, 0.3), (0.3, 0.2, 0.1)), 0.2, 0.01, 0.02, 0.3, 0.03, 0.4)


def chain(*joints: Joint, gravity: tuple[float, float, float] = (0.0, 0.0, -9.81), **options: Any) -> Model:
    names = dict.fromkeys(name for joint in joints for name in (joint.parent, joint.child))
    return Model.build("chain", [Link(name, BODY) for name in names], joints, gravity=gravity, **options)


def require_same(model: Model) -> Model:
    back = dynx.load(model.to_sdf())
    assert [*robot_differences(model, back)] == []
    assert [*shape_differences(model, back)] == []
    return back


def notes(model: Model) -> str:
    return " ".join(SdfWriter(model).notes)


# -- read back by dynx ------------------------------------------------------------------------------------


@given(models(physical=False))
def test_random_robots_are_read_back(model: Model) -> None:
    require_same(model)


POSE = Pose((0.1, 0.2, 0.3), (0.4, -0.5, 0.6))


@pytest.mark.parametrize("base", ["fixed", "floating", "placed"])
@pytest.mark.parametrize("root", ["world", "base", "__model__", "a::b"])
@pytest.mark.parametrize("gravity", [(0.0, 0.0, -9.81), (1.0, 0.0, -1.62)])
def test_bases_and_names_that_sdf_reserves(base: str, root: str, gravity: tuple[float, float, float]) -> None:
    model = chain(
        Joint("world", "revolute", root, "world" if root == "base" else "__x__", origin=POSE),
        Joint("c::d", "fixed", root, "c::d", origin=POSE),
        base="floating" if base == "floating" else "fixed",
        base_pose=POSE if base == "placed" else IDENTITY,
        gravity=gravity,
    )
    require_same(model)
    framed = model.with_frame("tip", root, POSE).with_frame("c_d", "c::d", POSE)
    require_same(framed)
    assert "other names" in notes(framed)
    require_same(replace(model, name="world"))


def test_a_joint_and_a_frame_may_have_the_name_of_a_link() -> None:
    model = chain(Joint("b", "continuous", "a", "b"), Joint("a_joint", "continuous", "b", "a_link"))
    require_same(model.with_frame("a_joint", "a"))
    assert "<dynx:name>b</dynx:name>" in model.to_sdf()


def test_a_root_link_world_is_the_world_of_sdf() -> None:
    joints = [Joint("j", "continuous", "world", "a", origin=POSE), Joint("k", "prismatic", "world", "b")]
    links = [Link("world"), Link("a", BODY), Link("b", BODY)]
    model = Model.build("two", links, joints)
    text = model.to_sdf()
    assert "dynx:base" not in text
    assert text.count("<parent>world</parent>") == 2
    require_same(model)
    # A shape needs a link that it is on.
    ground = replace(model, geometry=Geometry({"world": LinkGeometry((), (Collision(Plane()),))}))
    assert "dynx:base" in ground.to_sdf()
    require_same(ground)


def test_what_only_dynx_states_is_read_back() -> None:
    model = chain(
        Joint("far", "revolute", "a", "b", limits=Limits(-1e20, 1e17, 1e30, 0.0)),
        Joint("near", "prismatic", "b", "c", limits=Limits(-2.0, math.inf, -1.0, -2.0)),
        Joint("geared", "continuous", "c", "d", dynamics=JointDynamics(0.1, 0.2, 0.3)),
        Joint("follower", "continuous", "d", "e", mimic=Mimic("far", -2.0, 0.5)),
        Joint("locked", "revolute", "e", "f"),
    )
    locked = dynx.load(model, lock={"locked": 0.25})
    require_same(locked)
    found = notes(locked)
    for word in ("'far'", "'near'", "'geared'", "'follower'", "'locked'"):
        assert word in found


def test_poses_have_the_numbers_of_the_robot() -> None:
    model = chain(Joint("j", "continuous", "a", "b", POSE), Joint("k", "continuous", "b", "c", POSE))
    for joint in dynx.load(model.to_sdf()).joints:
        assert joint.origin.xyz == POSE.xyz
        assert [*joint.origin.rpy] == pytest.approx(POSE.rpy, rel=1e-15)


def test_shapes_colours_and_names_are_read_back() -> None:
    red = Appearance("red", (1.0, 0.25, 0.1, 0.3))
    visuals = (
        Visual(Box((1.0, 2.0, 3.0)), POSE, red, "same"),
        Visual(Sphere(0.1), material=Appearance("none"), name="same"),
        Visual(Cylinder(0.1, 0.2), name="x::y"),
    )
    collisions = (
        Collision(Capsule(0.1, 0.2), POSE),
        Collision(Ellipsoid((0.1, 0.2, 0.3))),
        Collision(Plane(), POSE),
    )
    shapes = Geometry({"b": LinkGeometry(visuals, collisions)})
    model = chain(Joint("j", "continuous", "a", "b"), geometry=shapes)
    back = require_same(model)
    assert [each.name for each in back.geometry.visuals("b")] == ["same", "same_2", "x_y"]
    assert "'red'" in notes(model)
    assert "'x::y'" in notes(model)
    textured = Visual(Sphere(0.1), material=Appearance("", None, "wood.png"))
    height = Collision(HeightField(((0.0, 1.0), (0.0, 1.0)), (1.0, 1.0)))
    model = replace(model, geometry=Geometry({"b": LinkGeometry((textured,), (height,))}))
    assert "Images" in notes(model)
    assert "Height fields" in notes(model)


def test_what_cannot_be_written_is_refused_by_name() -> None:
    joint = Joint("j", "revolute", "a", "b", limits=Limits(upper=math.nan))
    with pytest.raises(DescriptionError, match="limit of joint 'j' is NaN"):
        chain(joint).to_sdf()
    with pytest.raises(DescriptionError, match="SDF cannot express"):
        replace(chain(Joint("j", "fixed", "a", "b")), name="a\nb").to_sdf()


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('type="fixed"', 'type="continuous"', "wanted it in a fixed joint"),
        ("<parent>world</parent>", "<parent>b</parent>", "loop|wanted it in a fixed joint"),
        ("<parent>a</parent>", "<parent>world</parent>", "holds another link"),
        ("<child>a</child>", "<child>b</child>", "is not the root|loop"),
        ("<multiplier>", "<multiplier>x", "multiplier"),
        ("<drake:rotor_inertia>", "<drake:rotor_inertia>-", "wanted at least 0"),
    ],
)
def test_marks_that_contradict_the_document_are_errors(old: str, new: str, message: str) -> None:
    # In the notes at the beginning, too, where it means nothing.
    text = chain(
        Joint("j", "continuous", "a", "b", dynamics=JointDynamics(armature=0.5)),
        Joint("k", "continuous", "b", "c", mimic=Mimic("j")),
    ).to_sdf()
    assert old in text
    with pytest.raises(DescriptionError, match=message):
        dynx.load(text.replace(old, new))


# -- Drake ------------------------------------------------------------------------------------------------


def require_alike_in_drake(model: Model, path: Path) -> None:
    """Compare mass matrix, bias and poses of the source with those of Drake, which parses what is written."""
    pytest.importorskip("pydrake")
    from benchmarks.surveys.raw_drake_sdf import DrakeRobot
    from benchmarks.surveys.sdf_files import EXACT, compare

    text = replace(model, geometry=Geometry({})).to_sdf()
    path.write_text(text, encoding="utf-8")
    robot = DrakeRobot(path)
    if NAME in text:
        # Drake has the names of the document.
        model = dynx.load(re.sub(f"<{NAME}>.*?</{NAME}>", "", text))
    if robot.rounds_an_axis():
        # Drake takes an axis within 1e-8 of x, y or z for that.
        return
    difference, quantity = compare(model, robot)
    assert difference <= EXACT, quantity


@given(model=models())
def test_drake_parses_random_robots_as_the_same(
    tmp_path_factory: pytest.TempPathFactory, model: Model
) -> None:
    # In a world it refuses an inertia that is flat to rounding, such as that of a thin plate.
    model = model.with_gravity(STANDARD_GRAVITY)
    require_alike_in_drake(model, tmp_path_factory.mktemp("robot") / "robot.sdf")


@given(model=models(solvable=True))
def test_drake_parses_random_robots_in_worlds_as_the_same(
    tmp_path_factory: pytest.TempPathFactory, model: Model
) -> None:
    require_alike_in_drake(model, tmp_path_factory.mktemp("robot") / "robot.sdf")


ROBOTS = (*LOCAL_ROBOTS, "panda", "ur5", "talos", "tiago")


@pytest.mark.parametrize("base", ["fixed", "floating"])
@pytest.mark.parametrize("name", ROBOTS)
def test_drake_parses_robots_as_the_same(tmp_path: Path, name: str, base: Base) -> None:
    model = dynx.load(name)
    if any(inertia_fault(link.inertial) for link in model.links if link.inertial is not None):
        pytest.skip("Drake replaces an inertia that no body can have")
    require_alike_in_drake(model.with_base(base), tmp_path / "robot.sdf")


def test_drake_reads_armature_limits_and_dynamics(tmp_path: Path) -> None:
    pytest.importorskip("pydrake")
    from benchmarks.surveys.raw_drake_sdf import DrakeRobot

    model = chain(
        Joint("j", "revolute", "a", "b", limits=Limits(-1.0, 2.0, 3.0, 4.0)),
        Joint("k", "prismatic", "b", "c", dynamics=JointDynamics(0.25, 0.5, 0.125)),
        Joint("l", "revolute", "c", "d", limits=Limits(upper=1.0)),
    )
    path = tmp_path / "robot.sdf"
    path.write_text(model.to_sdf())
    plant = DrakeRobot(path).plant
    np.testing.assert_array_equal(plant.GetPositionLowerLimits(), model.lower)
    np.testing.assert_array_equal(plant.GetPositionUpperLimits(), model.upper)
    np.testing.assert_array_equal(plant.GetVelocityUpperLimits(), model.velocity_limit)
    np.testing.assert_array_equal(plant.GetEffortUpperLimits(), model.effort_limit)
    assert plant.GetJointByName("k").default_damping_vector() == [0.25]
    # `DrakeRobot` leaves the rotors out, for mass matrices; what was parsed is read by Drake alone.
    from pydrake.multibody.parsing import Parser
    from pydrake.multibody.plant import MultibodyPlant

    alone = MultibodyPlant(0.0)
    Parser(alone).AddModels(path)
    assert alone.GetJointActuatorByName("k").default_rotor_inertia() == 0.125
