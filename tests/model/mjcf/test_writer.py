"""Robots written as MJCF are read back by dynx, and compiled by MuJoCo, as the same robots."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given

import dynx
from dynx.errors import DescriptionError, UnsupportedFeatureError
from dynx.model import Inertial, Joint, JointDynamics, Limits, Link, Mimic, Model, Pose
from dynx.model.geometry import (
    Appearance,
    Box,
    Capsule,
    Collision,
    Cylinder,
    Ellipsoid,
    Geometry,
    LinkGeometry,
    Mesh,
    Plane,
    Sphere,
    Visual,
)
from dynx.model.mjcf.writer import MAX_LINKS_IN_A_ROW, RobotWriter
from dynx.spatial.scalar import Floats
from dynx.testing.strategies import models
from tests.model.mjcf.models import compute

ROUNDING = 1e-13
"""Largest difference of an entry by rounding, relative to the largest one, of which each has a few."""


def require_close(got: Floats, want: Floats, tolerance: float = ROUNDING) -> None:
    got, want = np.asarray(got), np.asarray(want)
    assert got.shape == want.shape
    assert np.abs(got - want).max(initial=0.0) <= tolerance * max(np.abs(want).max(initial=0.0), 1.0)


def tensor_in_link(inertial: Inertial) -> Floats:
    R = inertial.origin.matrix[:3, :3]
    return np.asarray(R @ inertial.tensor @ R.T)


def require_same(back: Model, model: Model) -> None:
    """Compare two models part by part: names and limits exactly, poses and inertias to rounding."""
    assert (back.name, back.base, back.gravity) == (model.name, model.base, model.gravity)
    assert back.joint_names == model.joint_names
    assert back.root == model.root
    require_close(back.base_pose.matrix, model.base_pose.matrix)
    for mine, theirs in zip(back.links, model.links, strict=True):
        if mine.inertial is None or theirs.inertial is None:
            # A link between two joints of one body is read with zeros.
            assert (mine.inertial or Inertial()) == (theirs.inertial or Inertial())
        else:
            assert mine.inertial.mass == theirs.inertial.mass
            require_close(mine.inertial.origin.matrix[:3, 3], theirs.inertial.origin.matrix[:3, 3])
            want = tensor_in_link(theirs.inertial)
            assert np.abs(tensor_in_link(mine.inertial) - want).max() <= 1e-14 * np.abs(want).max()
    for a, b in zip(back.joints, model.joints, strict=True):
        assert (a.name, a.parent, a.child, a.locked_at) == (b.name, b.parent, b.child, b.locked_at)
        require_close(a.origin.matrix, b.origin.matrix)
        if b.moves:
            unlimited = b.type == "revolute" and math.isinf(b.limits.lower) and math.isinf(b.limits.upper)
            assert a.type == ("continuous" if unlimited else b.type)
            require_close(np.array(a.axis), np.array(b.axis))
            assert (a.dynamics, a.mimic) == (b.dynamics, b.mimic)
            assert (a.limits.velocity, a.limits.effort) == (b.limits.velocity, b.limits.effort)
            ends = sorted((b.limits.lower, b.limits.upper))
            for got, want_end in zip((a.limits.lower, a.limits.upper), ends, strict=True):
                # MuJoCo refuses equal limits, so that the upper one is moved by 1e-12 of it.
                assert got == want_end or abs(got - want_end) <= 2e-12 * max(1.0, abs(want_end))
    # Frames of MJCF are in the order of their links.
    frames = {frame.name: frame for frame in back.extra_frames}
    assert frames.keys() == {frame.name for frame in model.extra_frames}
    for other in model.extra_frames:
        frame = frames[other.name]
        assert (frame.name, frame.link) == (other.name, other.link)
        require_close(frame.placement.matrix, other.placement.matrix)


@given(models(physical=False))
def test_a_random_robot_is_read_back_the_same(model: Model) -> None:
    back = dynx.load(model.to_mjcf())
    require_same(back, model)
    require_same(dynx.load(back.to_mjcf()), model)
    require_same(dynx.load(back.to_urdf()), model)


@given(models(mimics=False, locks=False, solvable=True))
def test_mujoco_computes_the_same_of_a_random_robot(model: Model) -> None:
    mujoco = pytest.importorskip("mujoco")
    assume(model.root != "world")
    compiled = mujoco.MjModel.from_xml_string(model.to_mjcf())
    assert compiled.nv == model.nv
    engine = dynx.backend("reference", model)
    want = compute(mujoco, compiled, 0, free=model.floating)
    near = 1e-5 if _simplified(model, compiled) else 1e-11
    require_close(engine.mass_matrix(want.q), want.mass_matrix, near)
    require_close(engine.inverse_dynamics(want.q, want.v, want.a), want.torques, near)
    poses = dict(zip(model.frame_names, engine.forward_kinematics(want.q), strict=True))
    for name, T in (want.bodies | want.sites).items():
        require_close(poses[name], T)
    armature = compiled.dof_armature[6 if model.floating else 0 :]
    assert list(armature) == [joint.dynamics.armature for joint in model.coordinate_joints]


def _simplified(model: Model, compiled: Any) -> bool:
    """Check whether MuJoCo dropped the offset or rotation of an inertia, as it does with those below 1e-6."""
    for link in model.links:
        frame, inertial = compiled.body_sameframe[compiled.body(link.name).id], model.inertial(link.name)
        off_diagonal = (inertial.ixy, inertial.ixz, inertial.iyz)
        if frame and (
            any((*inertial.origin.rpy, *off_diagonal)) or (frame == 1 and any(inertial.origin.xyz))
        ):
            return True
    return False


def pair(joint: Joint, **settings: object) -> Model:
    links = [
        Link("a", Inertial(1.0, ixx=1.0, iyy=1.0, izz=1.0)),
        Link("b", Inertial(2.0, ixx=1.0, iyy=1.0, izz=1.0)),
    ]
    return Model.build("r", links, [joint], **settings)  # type: ignore[arg-type]


HINGE = Joint("j", "revolute", "a", "b", limits=Limits(-1.0, 2.0, 3.0, 40.0))


def test_limits_and_coefficients_reach_mujoco_and_its_motors() -> None:
    mujoco = pytest.importorskip("mujoco")
    joint = replace(HINGE, dynamics=JointDynamics(0.5, 0.25, 0.125))
    compiled = mujoco.MjModel.from_xml_string(pair(joint).to_mjcf())
    assert compiled.joint("j").range.tolist() == [-1.0, 2.0]
    assert compiled.jnt_actfrcrange.tolist() == [[-40.0, 40.0]]
    assert (compiled.joint("j").damping[0], compiled.dof_frictionloss[0]) == (0.5, 0.25)
    assert compiled.dof_armature[0] == 0.125
    assert compiled.actuator_ctrlrange.tolist() == [[-40.0, 40.0]]
    assert [compiled.actuator(k).name for k in range(compiled.nu)] == ["j"]


@pytest.mark.parametrize("effort", [0.0, -1.0, 1e12, math.inf])
@pytest.mark.parametrize("velocity", [0.0, 1e12, math.inf])
def test_limits_that_mjcf_cannot_say_are_kept_and_noted(effort: float, velocity: float) -> None:
    model = pair(replace(HINGE, limits=Limits(-1.0, 2.0, velocity, effort)))
    require_same(dynx.load(model.to_mjcf()), model)
    notes = " ".join(RobotWriter(model).notes)
    assert ("limit of speed" in notes) == (velocity < math.inf)
    assert ("effort limit" in notes) == (effort < math.inf)


def test_a_mimic_joint_is_an_equality_that_mujoco_holds() -> None:
    mujoco = pytest.importorskip("mujoco")
    links = [Link(name, Inertial(1.0, ixx=1.0, iyy=1.0, izz=1.0)) for name in "abc"]
    joints = [HINGE, Joint("k", "continuous", "a", "c", mimic=Mimic("j", -2.0, 0.5))]
    model = Model.build("r", links, joints)
    require_same(dynx.load(model.to_mjcf()), model)
    compiled = mujoco.MjModel.from_xml_string(model.to_mjcf())
    assert compiled.eq_data[0, :5].tolist() == [0.5, -2.0, 0.0, 0.0, 0.0]
    foreign = model.to_mjcf().replace("dynx:mimic:", "")
    assert dynx.load(foreign).nv == 2


@pytest.mark.parametrize("base", ["fixed", "floating"])
def test_gravity_base_and_frames(base: str) -> None:
    model = pair(HINGE, base=base, gravity=(0.5, 0.0, -1.62)).with_frame("tip", "b", Pose((0.0, 0.1, 0.2)))
    require_same(dynx.load(model.to_mjcf()), model)


RANGE = Limits(-1.0, 2.0)


def test_links_without_mass_between_joints_are_joints_of_one_body() -> None:
    mujoco = pytest.importorskip("mujoco")
    joints = [
        Joint(
            "x", "revolute", "base", "first", Pose((0.1, 0.2, 0.3), (0.4, 0.5, 0.6)), limits=Limits(-1.0, 2.0)
        ),
        Joint("y", "prismatic", "first", "second", Pose((0.0, 0.3, 0.1)), axis=(0.0, 0.6, 0.8)),
        Joint("z", "continuous", "second", "hand", Pose((0.2, 0.0, 0.0)), axis=(0.0, 0.0, 1.0)),
        Joint("turned", "continuous", "hand", "wrist", Pose((0.0, 0.0, 0.1), (0.1, 0.0, 0.0))),
        Joint("tool", "continuous", "wrist", "tip", Pose((0.0, 0.0, 0.1))),
    ]
    body = Inertial(1.0, Pose((0.1, 0.0, 0.0)), 0.1, 0.0, 0.0, 0.1, 0.0, 0.1)
    light = ("first", "second", "wrist")
    links = [Link(name, None if name in light else body) for name in ("base", *light, "hand", "tip")]
    model = Model.build("r", links, joints)
    for base in ("fixed", "floating"):
        robot = model.with_base(base)
        require_same(dynx.load(robot.to_mjcf()), robot)
        compiled = mujoco.MjModel.from_xml_string(robot.to_mjcf())
        assert compiled.nbody == 4
        want = compute(mujoco, compiled, 0, free=robot.floating)
        engine = dynx.backend("reference", robot)
        require_close(engine.mass_matrix(want.q), want.mass_matrix, 1e-11)
        require_close(engine.inverse_dynamics(want.q, want.v, want.a), want.torques, 1e-11)


def test_a_body_has_at_most_six_joints() -> None:
    mujoco = pytest.importorskip("mujoco")
    count = 9
    joints = [Joint(f"j{n}", "prismatic", f"a{n}", f"a{n + 1}", Pose((0.1, 0.0, 0.0))) for n in range(count)]
    body = Inertial(1.0, Pose(), 1.0, 0.0, 0.0, 1.0, 0.0, 1.0)
    links = [Link(f"a{n}", body if n in (0, 6, count) else None) for n in range(count + 1)]
    model = Model.build("r", links, joints)
    require_same(dynx.load(model.to_mjcf()), model)
    assert mujoco.MjModel.from_xml_string(model.to_mjcf()).njnt == count


def test_a_fixed_root_called_world_is_the_world() -> None:
    model = Model.build("r", [Link("world", Inertial()), Link("b")], [replace(HINGE, parent="world")])
    assert "world_link" not in model.to_mjcf()
    placed = model.with_base_pose(Pose((1.0, 0.0, 0.0), (0.0, 0.0, 1.0)))
    for each in (model, placed, model.with_base("floating")):
        require_same(dynx.load(each.to_mjcf()), each)
    other = Model.build("r", [Link("a"), Link("world")], [replace(HINGE, child="world")])
    with pytest.raises(UnsupportedFeatureError, match="world"):
        other.to_mjcf()


def test_shapes_and_colours_are_read_back() -> None:
    red = Appearance("red", (1.0, 0.0, 0.0, 1.0))
    other_red = Appearance("red", (0.9, 0.0, 0.0, 1.0))
    visuals = (
        Visual(Box((1.0, 2.0, 3.0)), Pose((0.1, 0.2, 0.3), (0.4, 0.5, 0.6)), red, "box"),
        Visual(Sphere(0.5), material=other_red),
        Visual(Cylinder(0.5, 1.0)),
    )
    collisions = (
        Collision(Capsule(0.25, 0.5), name="felt"),
        Collision(Plane()),
        Collision(Ellipsoid((0.1, 0.2, 0.3))),
    )
    model = Model.build("r", [Link("a")], [], geometry=Geometry({"a": LinkGeometry(visuals, collisions)}))
    back = dynx.load(model.to_mjcf()).geometry
    assert back.collisions("a") == collisions
    assert [each.shape for each in back.visuals("a")] == [each.shape for each in visuals]
    assert [each.material and each.material.rgba for each in back.visuals("a")] == [
        each.material and each.material.rgba for each in visuals
    ]
    require_close(back.visuals("a")[0].origin.matrix, visuals[0].origin.matrix)


def test_what_is_left_out_is_noted(tmp_path: Path) -> None:
    missing = Mesh("gone.stl", fault=DescriptionError("no file gone.stl"))
    shapes = LinkGeometry(
        (
            Visual(missing),
            Visual(Mesh(str(tmp_path / "a.dae"))),
            Visual(Sphere(1.0), material=Appearance("bare")),
            Visual(Sphere(1.0), name="same"),
            Visual(Sphere(1.0), name="same"),
        ),
        collision_fault=DescriptionError("a shape is wrong"),
    )
    model = Model.build("r", [Link("a")], [], geometry=Geometry({"a": shapes}))
    notes = RobotWriter(model).notes
    for word in ("gone.stl", "a.dae", "'bare'", "'same'", "a shape is wrong"):
        assert sum(word in each for each in notes) == 1, word


def test_inertias_that_mujoco_refuses_are_noted_and_read_back() -> None:
    mujoco = pytest.importorskip("mujoco")
    for inertial in (None, Inertial(1.0, ixx=1.0, iyy=1.0, izz=5.0)):
        model = Model.build("r", [Link("a"), Link("b", inertial)], [HINGE])
        assert any("does not compile" in each for each in RobotWriter(model).notes)
        require_same(dynx.load(model.to_mjcf()), model)
        with pytest.raises(ValueError, match=r"mass|inertia"):
            mujoco.MjModel.from_xml_string(model.to_mjcf())


@pytest.mark.parametrize("bad", ["", "a\nb", "\x00", "\ud800"])
def test_a_name_that_mjcf_cannot_express_raises(bad: str) -> None:
    with pytest.raises(DescriptionError, match="a name that MJCF cannot express"):
        Model.build("r", [Link(bad)], []).to_mjcf()
    with pytest.raises(DescriptionError, match="a name that MJCF cannot express"):
        pair(replace(HINGE, name=bad)).to_mjcf()


def test_too_many_links_in_a_row_are_refused() -> None:
    def chain(count: int) -> Model:
        links = [Link(f"l{k}") for k in range(count)]
        joints = [Joint(f"j{k}", "fixed", f"l{k}", f"l{k + 1}") for k in range(count - 1)]
        return Model.build("r", links, joints)

    longest = chain(MAX_LINKS_IN_A_ROW + 1)
    assert dynx.load(longest.to_mjcf()).frame_names == longest.frame_names
    with pytest.raises(UnsupportedFeatureError, match="in a row"):
        chain(MAX_LINKS_IN_A_ROW + 2).to_mjcf()


@pytest.mark.parametrize(
    ("element", "message"),
    [
        ('<numeric name="dynx:speed:j" data="1"/>', "no statement of dynx"),
        ('<numeric name="dynx:velocity:j" data="fast"/>', "fast"),
        ('<text name="dynx:fixed:b" data=""/>', "data"),
    ],
)
def test_faulty_statements_are_refused_with_their_line(element: str, message: str) -> None:
    text = pair(HINGE).to_mjcf()
    head, _, end = text.rpartition("<custom>")
    text = f"{head}<custom>\n{element}{end}"
    line = text[: text.index(element)].count("\n") + 1
    with pytest.raises(DescriptionError, match=message) as raised:
        dynx.load(text)
    assert raised.value.line == line
