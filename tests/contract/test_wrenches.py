"""Wrenches at joints and at the base: closed forms, sub-trees alone, references and external forces."""

from __future__ import annotations

import numpy as np
import pytest

from dynx.backends import Backend
from dynx.errors import ArgumentError, NotFiniteError, ShapeError, UnknownNameError
from dynx.model import Inertial, Joint, Link, Model, Pose
from dynx.rbd.jacobians import REFERENCES
from dynx.spatial.scalar import Floats
from dynx.spatial.so3 import quat_from_rotation
from tests.contract.conftest import Make
from tests.contract.engine_calls import State, random_state
from tests.contract.robots import MODELS, branched, each_model, hinge
from tests.error_bounds import ErrorBounds, samples_at

each_reference = pytest.mark.parametrize("reference", REFERENCES)
WRENCHES = {
    "tool": np.array([3.0, -1.0, 2.0, 0.5, -0.4, 0.3]),
    "trunk": np.array([-2.0, 4.0, 1.0, 0.2, 0.1, 0.6]),
}


def bounds(model: Model, state: State) -> ErrorBounds:
    wrench = sum(np.abs(wrench) for wrench in WRENCHES.values())
    return ErrorBounds(samples_at(model, state.q, state.v, state.a, wrench=wrench, frame="tool"))


def in_three_references(result: Floats) -> Floats:
    """Return a result as the compared quantities with external forces have it."""
    return np.concatenate([result] * 3, axis=-1)


def adjoint(wrench: Floats, T: Floats) -> Floats:
    """Return a wrench of frame B in frame A, for the pose T of B in A."""
    force = T[:3, :3] @ wrench[:3]
    return np.concatenate([force, T[:3, :3] @ wrench[3:] + np.cross(T[:3, 3], force)])


class TestClosedForms:
    """A few robots whose wrenches follow by hand."""

    def test_a_weight_on_an_arm_at_rest(self, make: Make) -> None:
        """2 kg at 0.5 m along x: the joint bears the weight, and the moment 0.5 x 2 g about -y."""
        model = hinge(Inertial(2.0, Pose((0.5, 0.0, 0.0))))
        engine, weight = make(model), 2.0 * 9.81
        close = ErrorBounds(samples_at(model, [0.0]))
        wanted = np.array([0.0, 0.0, weight, 0.0, -0.5 * weight, 0.0])
        close.check("joint_wrenches", engine.joint_wrenches([0.0], [0.0], [0.0]), wanted[None])
        close.check("base_wrench", engine.base_wrench([0.0], [0.0], [0.0]), wanted)
        # At a quarter turn about y the arm points down: the force is along -x of the arm, without moment.
        quarter = engine.joint_wrenches([np.pi / 2], [0.0], [0.0])
        close.check("joint_wrenches", quarter, np.array([[-weight, 0.0, 0.0, 0.0, 0.0, 0.0]]))

    def test_a_mass_that_revolves(self, make: Make) -> None:
        """The joint pulls inwards with m r omega^2, and pushes along the path with m r alpha."""
        model = hinge(Inertial(2.0, Pose((0.5, 0.0, 0.0))), (0.0, 0.0, 1.0)).with_gravity((0.0, 0.0, 0.0))
        found = make(model).joint_wrenches([0.7], [3.0], [4.0])
        wanted = np.array([[-2.0 * 0.5 * 9.0, 2.0 * 0.5 * 4.0, 0.0, 0.0, 0.0, 2.0 * 0.25 * 4.0]])
        ErrorBounds(samples_at(model, [0.7], [3.0], [4.0])).check("joint_wrenches", found, wanted)

    def test_a_fixed_joint_bears_what_is_behind_it_alone(self, make: Make) -> None:
        """A tool on a flange: the joint of the tool carries the tool, that of the arm both."""
        links = [Link("base"), Link("arm", Inertial(3.0)), Link("tool", Inertial(2.0, Pose((0.0, 0.0, 0.1))))]
        joints = [
            Joint("hinge", "continuous", "base", "arm", axis=(0.0, 1.0, 0.0)),
            Joint("flange", "fixed", "arm", "tool", Pose((0.4, 0.0, 0.0))),
        ]
        model = Model.build("arm with a tool", links, joints)
        found = make(model).joint_wrenches([0.0], [0.0], [0.0])
        wanted = np.array(
            [[0.0, 0.0, 5 * 9.81, 0.0, -0.4 * 2 * 9.81, 0.0], [0.0, 0.0, 2 * 9.81, 0.0, 0.0, 0.0]]
        )
        ErrorBounds(samples_at(model, [0.0])).check("joint_wrenches", found, wanted)

    def test_a_robot_without_joints(self, make: Make) -> None:
        model = Model.build("brick", [Link("brick", Inertial(2.0, Pose((0.1, 0.0, 0.0))))], [])
        engine, nothing = make(model), np.zeros((3, 0))
        assert engine.joint_wrenches(nothing, nothing, nothing).shape == (3, 0, 6)
        weight = np.array([0.0, 0.0, 19.62, 0.0, -1.962, 0.0])
        found = engine.base_wrench(nothing[0], nothing[0], nothing[0])
        ErrorBounds(samples_at(model, nothing[0])).check("base_wrench", found, weight)


def subtree(model: Model, joint: Joint) -> Model:
    """Return the links beyond a joint as a robot of its own with a floating base."""
    links, joints = [model.link(joint.child)], list[Joint]()
    for each in model.joints:
        if each.parent in {link.name for link in links}:
            joints.append(each)
            links.append(model.link(each.child))
    return Model.build(joint.child, links, joints, base="floating", gravity=model.gravity)


def alone(engine: Backend, model: Model, joint: Joint, state: State, make: Make) -> Floats:
    """Return the wrench that the sub-tree beyond a joint needs to move as it moves on the robot."""
    part = subtree(model, joint)
    T = engine.forward_kinematics(state.q, joint.child)
    base = 6 if model.floating else 0
    columns = [model.coordinate_index(name) - base for name in part.joint_names]
    q = np.concatenate(
        [T[:3, 3], quat_from_rotation(T[:3, :3]), state.q[state.q.size - model.nv + base :][columns]]
    )
    v = engine.frame_velocity(state.q, state.v, joint.child, reference="local")
    a = engine.frame_acceleration(state.q, state.v, state.a, joint.child, reference="local")
    v, a = (np.concatenate([rate, of[base:][columns]]) for rate, of in ((v, state.v), (a, state.a)))
    forces = {frame: wrench for frame, wrench in WRENCHES.items() if frame in part.frame_names}
    return make(part).inverse_dynamics(q, v, a, external_forces=forces)[:6]


@pytest.mark.parametrize("model", [MODELS["fixed"], MODELS["floating"]], ids=["fixed", "floating"])
def test_each_is_what_the_subtree_alone_needs(make: Make, model: Model) -> None:
    """A floating base needs as `tau[:6]` the wrench that moves it: here it is the child of each joint."""
    engine, state = make(model), random_state(model, 71)
    found = engine.joint_wrenches(state.q, state.v, state.a, external_forces=WRENCHES)
    wanted = np.stack([alone(engine, model, joint, state, make) for joint in model.joints])
    bounds(model, state).check(
        "joint_wrenches_external_forces", in_three_references(found)[None], in_three_references(wanted)[None]
    )


@each_model
def test_the_component_along_the_axis_is_the_torque(make: Make, model: Model) -> None:
    """With mimic joints, by virtual work: the driver's plus the follower's times its multiplier."""
    engine, state = make(model), random_state(model, 72)
    found = engine.joint_wrenches(state.q, state.v, state.a, external_forces=WRENCHES)
    tau = np.zeros(model.nv)
    if model.floating:
        tau[:6] = engine.base_wrench(state.q, state.v, state.a, external_forces=WRENCHES)
    for joint, wrench in zip(model.joints, found, strict=True):
        if joint.moves:
            along = wrench[:3] if joint.type == "prismatic" else wrench[3:]
            own = joint.mimic.joint if joint.mimic else joint.name
            scale = joint.mimic.multiplier if joint.mimic else 1.0
            tau[model.coordinate_index(own)] += scale * along @ np.array(joint.axis)
    wanted = engine.inverse_dynamics(state.q, state.v, state.a, external_forces=WRENCHES)
    bounds(model, state).check("inverse_dynamics_external_forces", np.tile(tau, 3), np.tile(wanted, 3))


@each_model
def test_the_base_bears_its_own_link_and_the_first_joints(make: Make, model: Model) -> None:
    """Newton and Euler for the root link alone: what the world exerts, less what it passes on."""
    engine, state = make(model), random_state(model, 73)
    root = Model.build("root", [model.link(model.root)], [], base="floating", gravity=model.gravity)
    T = engine.forward_kinematics(state.q, model.root)
    q = np.concatenate([T[:3, 3], quat_from_rotation(T[:3, :3])])
    v = engine.frame_velocity(state.q, state.v, model.root, reference="local")
    a = engine.frame_acceleration(state.q, state.v, state.a, model.root, reference="local")
    wanted = make(root).inverse_dynamics(q, v, a)
    carried = engine.joint_wrenches(state.q, state.v, state.a, frame=model.root)
    wanted = wanted + sum(
        wrench for joint, wrench in zip(model.joints, carried, strict=True) if joint.parent == model.root
    )
    found = engine.base_wrench(state.q, state.v, state.a)
    bounds(model, state).check("base_wrench", found, wanted)


@each_model
@each_reference
@pytest.mark.parametrize("frame", [None, "tool", "trunk"])
def test_references_have_the_meaning_that_they_have_for_a_jacobian(
    make: Make, model: Model, reference: str, frame: str | None
) -> None:
    engine, state = make(model), random_state(model, 74)
    local = engine.joint_wrenches(state.q, state.v, state.a)
    found = engine.joint_wrenches(state.q, state.v, state.a, frame=frame, reference=reference)
    wanted = []
    for joint, wrench in zip(model.joints, local, strict=True):
        T = engine.forward_kinematics(state.q, joint.child)
        of = T if frame is None else engine.forward_kinematics(state.q, frame)
        origin = np.eye(4)
        if reference != "world":
            origin[:3, 3] = of[:3, 3]
        if reference == "local":
            origin[:3, :3] = of[:3, :3]
        wanted.append(adjoint(wrench, np.linalg.inv(origin) @ T))
    bounds(model, state).check("joint_wrenches", found, np.stack(wanted))


@each_model
@each_reference
def test_an_external_wrench_relieves_the_joints_that_carry_its_frame(
    make: Make, model: Model, reference: str
) -> None:
    """Its virtual work at any frame is the same: compared in the axes and about the origin of the world."""
    engine, state = make(model), random_state(model, 75, (4,))
    args = state.q, state.v, state.a
    free = engine.joint_wrenches(*args, reference="world")
    pushed = engine.joint_wrenches(
        *args, reference="world", external_forces=WRENCHES, force_reference=reference
    )
    wanted = free.copy()
    for frame, wrench in WRENCHES.items():
        T = engine.forward_kinematics(state.q, frame)
        for k in range(4):
            origin = np.eye(4)
            if reference != "world":
                origin[:3, 3] = T[k, :3, 3]
            if reference == "local":
                origin = T[k]
            link = frame
            while link != model.root:
                (number,) = (n for n, joint in enumerate(model.joints) if joint.child == link)
                wanted[k, number] -= adjoint(wrench, origin)
                link = model.joints[number].parent
    bounds(model, state).check(
        "joint_wrenches_external_forces", in_three_references(pushed), in_three_references(wanted)
    )


def test_a_wrench_for_each_sample(make: Make) -> None:
    model = MODELS["floating"]
    engine, state = make(model), random_state(model, 76, (3,))
    wrenches = np.arange(18.0).reshape(3, 6)
    for method in (engine.joint_wrenches, engine.base_wrench):
        many = method(state.q, state.v, state.a, external_forces={"beta": wrenches}, frame="mid")
        one_by_one = [
            method(*each, external_forces={"beta": wrench}, frame="mid")
            for *each, wrench in zip(state.q, state.v, state.a, wrenches, strict=True)
        ]
        np.testing.assert_allclose(many, np.stack(one_by_one), rtol=1e-12, atol=1e-12)


def test_bad_arguments_are_named(make: Make) -> None:
    model = branched()
    engine, state = make(model), random_state(model, 77)
    args = state.q, state.v, state.a
    for method in (engine.joint_wrenches, engine.base_wrench):
        with pytest.raises(UnknownNameError, match=r"no frame 'tol'.*'tool'"):
            method(*args, frame="tol")
        with pytest.raises(UnknownNameError, match=r"reference is 'locl'.*'local'"):
            method(*args, reference="locl")
        with pytest.raises(UnknownNameError, match="reference is 'locl'"):
            method(*args, external_forces=WRENCHES, force_reference="locl")
        with pytest.raises(UnknownNameError, match="no frame 'hand'"):
            method(*args, external_forces={"hand": np.zeros(6)})
        with pytest.raises(ShapeError, match="external_forces\\['tool'\\]"):
            method(*args, external_forces={"tool": np.zeros(5)})
        with pytest.raises(NotFiniteError, match="external_forces\\['tool'\\]"):
            method(*args, external_forces={"tool": np.full(6, np.nan)})
        with pytest.raises(ArgumentError, match="external_forces is of type list"):
            method(*args, external_forces=[1.0])  # type: ignore[arg-type]
