"""Joint order, what a coordinate means, locked and mimic joints, the floating base."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given
from scipy.spatial.transform import Rotation

from dynx.agreement import agree
from dynx.agreement.identities import time_derivative
from dynx.errors import UnknownNameError
from dynx.model import Joint, Link, Model, Pose
from dynx.model.loading import load
from dynx.spatial.scalar import Floats
from dynx.testing.strategies import Sample, samples
from tests.contract.conftest import Make
from tests.contract.engine_calls import ENGINE_CALLS, EngineCall, State, each_call, random_state
from tests.contract.robots import JOINT_ORDER, LINK_ORDER, LINKS, branched, followed_elbow, mimicking
from tests.error_bounds import ErrorBounds, samples_at
from tests.examples import generic_sample, one_robot

BELOW = {
    "z_shoulder": {"zeta", "plate", "mid", "tool"},
    "m_wheel": {"mid", "tool"},
    "a_slide": {"alpha", "beta"},
    "b_elbow": {"beta"},
}
each_base = pytest.mark.parametrize("base", ["fixed", "floating"])


def is_projected(engine_call: EngineCall) -> bool:
    """Check whether the result of a robot with a mimic joint is a projection of that without the coupling."""
    return not engine_call.options.get("joint_dynamics") and engine_call.method != "forward_dynamics"


def test_order_is_depth_first_in_the_order_of_the_document() -> None:
    model = branched()
    assert model.joint_names == JOINT_ORDER
    assert model.frame_names == LINK_ORDER
    assert [model.coordinate_index(name) for name in JOINT_ORDER] == [0, 1, 2, 3]
    assert model.with_base("floating").coordinate_index("m_wheel") == 7


@each_base
def test_a_coordinate_moves_what_is_below_its_joint_along_its_axis(make: Make, base: str) -> None:
    """Only frames below the joint move, and the child moves by the coordinate about or along the axis."""
    model = branched() if base == "fixed" else branched().with_base("floating")
    engine = make(model)
    for seed in range(3):
        q = random_state(model, seed).q
        close = ErrorBounds(samples_at(model, q))
        for name in JOINT_ORDER:
            joint, step = model.joint(name), 0.7
            moved = q.copy()
            moved[model.nq - model.nv + model.coordinate_index(name)] += step
            for frame in model.frame_names:
                before, after = (engine.forward_kinematics(x, frame) for x in (q, moved))
                if frame not in BELOW[name]:
                    close.check("forward_kinematics", after, before)
                elif frame == joint.child:
                    motion = np.eye(4)
                    if joint.type == "prismatic":
                        motion[:3, 3] = step * np.array(joint.axis)
                    else:
                        motion[:3, :3] = Rotation.from_rotvec(step * np.array(joint.axis)).as_matrix()
                    close.check("forward_kinematics", after, before @ motion)
                else:
                    assert not np.array_equal(after, before)


@each_base
def test_at_zero_frames_are_where_the_description_puts_them(make: Make, base: str) -> None:
    model = branched() if base == "fixed" else branched().with_base("floating")
    engine = make(model)
    wanted = {model.root: np.eye(4)}
    for joint in model.joints:
        origin = np.eye(4)
        origin[:3, :3] = Rotation.from_euler("xyz", joint.origin.rpy).as_matrix()
        origin[:3, 3] = joint.origin.xyz
        wanted[joint.child] = wanted[joint.parent] @ origin
    q = model.neutral()
    close = ErrorBounds(samples_at(model, q))
    for frame, pose in wanted.items():
        close.check("forward_kinematics", engine.forward_kinematics(q, frame), pose)


def test_a_continuous_joint_is_one_unbounded_angle(make: Make) -> None:
    model = branched()
    engine, wheel = make(model), model.coordinate_index("m_wheel")
    assert (model.lower[wheel], model.upper[wheel]) == (-np.inf, np.inf)
    state = random_state(model, 21, (3,))
    turned = state.q.copy()
    turned[:, wheel] += 2 * np.pi
    for engine_call in ENGINE_CALLS:
        result = engine_call.evaluate(engine, State(turned, state.v, state.a, state.tau))
        engine_call.check(engine, state, result, engine_call.evaluate(engine, state))


@each_base
def test_velocity_is_the_rate_of_the_pose(make: Make, base: str) -> None:
    """Along `integrate`, which holds the conventions of q and v together."""
    model = branched() if base == "fixed" else branched().with_base("floating")
    engine = make(model)

    @one_robot
    @given(samples(model))
    @example(generic_sample(model))
    def holds(state: Sample) -> None:
        q, v, _ = state
        close = ErrorBounds(samples_at(model, q, v))
        frequency = close.magnitudes.frequency

        def poses(t: Floats) -> Floats:
            return engine.forward_kinematics(model.integrate(q, v * t[..., None]))

        rates = time_derivative(poses, frequency)[0]
        for frame, rate in zip(model.frame_names, rates, strict=True):
            twist, T = engine.frame_velocity(q, v, frame), engine.forward_kinematics(q, frame)
            wanted = np.zeros((4, 4))
            wanted[:3, :3] = np.cross(twist[3:], T[:3, :3].T).T
            wanted[:3, 3] = twist[:3]
            close.check_rate("forward_kinematics", rate, wanted)

    holds()


class TestFloatingBase:
    """q[:3] position, q[3:7] quaternion xyzw; v[:3] linear, v[3:6] angular, in the base frame."""

    model = branched().with_base("floating")

    def test_pose_of_the_base(self, make: Make) -> None:
        engine = make(self.model)
        for seed in range(5):
            q = random_state(self.model, seed).q
            wanted = np.eye(4)
            wanted[:3, :3] = Rotation.from_quat(q[3:7]).as_matrix()
            wanted[:3, 3] = q[:3]
            close = ErrorBounds(samples_at(self.model, q))
            close.check("forward_kinematics", engine.forward_kinematics(q, "trunk"), wanted)

    def test_velocity_of_the_base_is_in_the_base_frame(self, make: Make) -> None:
        engine = make(self.model)
        for seed in range(5):
            q, v = (getattr(random_state(self.model, seed), name) for name in "qv")
            close = ErrorBounds(samples_at(self.model, q, v))
            close.check("frame_velocity", engine.frame_velocity(q, v, "trunk", reference="local"), v[:6])
            wanted = np.eye(6, self.model.nv)
            close.check("jacobian", engine.jacobian(q, "trunk", reference="local"), wanted)

    def test_neutral_is_at_the_worlds_frame(self, make: Make) -> None:
        q = self.model.neutral()
        close = ErrorBounds(samples_at(self.model, q))
        close.check("forward_kinematics", make(self.model).forward_kinematics(q, "trunk"), np.eye(4))

    @each_call
    def test_both_quaternions_of_an_attitude_are_one(self, make: Make, engine_call: EngineCall) -> None:
        engine, state = make(self.model), random_state(self.model, 22, (3,))
        other = state.q.copy()
        other[:, 3:7] *= -1.0
        result = engine_call.evaluate(engine, State(other, state.v, state.a, state.tau))
        engine_call.check(engine, state, result, engine_call.evaluate(engine, state))

    def test_a_base_that_is_held_is_a_fixed_base(self, make: Make) -> None:
        """Without motion of the base, joint torques are those of a fixed base."""
        fixed = branched()
        state = random_state(fixed, 23, (4,))
        q = np.concatenate([np.tile([0.0, 0, 0, 0, 0, 0, 1], (4, 1)), state.q], axis=1)
        v, a = (np.concatenate([np.zeros((4, 6)), x], axis=1) for x in (state.v, state.a))
        tau = make(self.model).inverse_dynamics(q, v, a)[:, 6:]
        close = ErrorBounds(samples_at(fixed, state.q, state.v, state.a))
        close.check("inverse_dynamics", make(fixed).inverse_dynamics(state.q, state.v, state.a), tau)


class TestLockedJoints:
    """A locked joint leaves q; the robot moves as the whole one does with that joint held."""

    whole = branched()
    value = 0.25
    locked = load(whole, lock={"a_slide": value})
    kept = (0, 1, 3)

    def test_it_leaves_the_coordinates(self) -> None:
        assert self.locked.joint_names == ("z_shoulder", "m_wheel", "b_elbow")
        assert self.locked.frame_names == self.whole.frame_names
        with pytest.raises(UnknownNameError, match="locked"):
            self.locked.coordinate_index("a_slide")

    def test_all_else_is_as_it_was(self, make: Make) -> None:
        whole, locked = make(self.whole), make(self.locked)
        state = random_state(self.locked, 24, (4,))
        q = np.insert(state.q, 2, self.value, axis=1)
        v, a = (np.insert(x, 2, 0.0, axis=1) for x in (state.v, state.a))
        close = ErrorBounds(samples_at(self.locked, state.q, state.v, state.a))
        for frame in self.whole.frame_names:
            pose = whole.forward_kinematics(q, frame)
            close.check("forward_kinematics", locked.forward_kinematics(state.q, frame), pose)
            J = whole.jacobian(q, frame)[..., list(self.kept)]
            close.check("jacobian", locked.jacobian(state.q, frame), J)
        tau = whole.inverse_dynamics(q, v, a)[:, list(self.kept)]
        close.check("inverse_dynamics", locked.inverse_dynamics(state.q, state.v, state.a), tau)
        M = whole.mass_matrix(q)[:, self.kept][:, :, self.kept]
        close.check("mass_matrix", locked.mass_matrix(state.q), M)

    def test_a_locked_hinge_stays_where_its_angle_put_it(self, make: Make) -> None:
        locked = load(self.whole, lock={"z_shoulder": 0.7, "b_elbow": -0.4})
        state = random_state(locked, 29)
        close = ErrorBounds(samples_at(locked, state.q))
        q = np.array([0.7, state.q[0], state.q[1], -0.4])
        whole, held = make(self.whole), make(locked)
        for frame in self.whole.frame_names:
            pose = whole.forward_kinematics(q, frame)
            close.check("forward_kinematics", held.forward_kinematics(state.q, frame), pose)


class TestMimicJoints:
    """A mimic joint leaves q, and the robot obeys the reduced dynamics S' (...) S."""

    free = branched()
    S = np.array([[1.0, 0, 0], [0, 1, 0], [0, 0, 1], [0, 2.0, 0]])
    offset = np.array([0.0, 0.0, 0.0, 0.3])

    def test_it_leaves_the_coordinates(self) -> None:
        model = mimicking()
        assert model.joint_names == ("z_shoulder", "m_wheel", "a_slide")
        with pytest.raises(UnknownNameError, match="m_wheel"):
            model.coordinate_index("b_elbow")

    @pytest.mark.parametrize("engine_call", [q for q in ENGINE_CALLS if is_projected(q)], ids=str)
    def test_reduced_answers(self, make: Make, engine_call: EngineCall) -> None:
        model = mimicking()
        state = random_state(model, 25, (4,))
        free = State(
            state.q @ self.S.T + self.offset, state.v @ self.S.T, state.a @ self.S.T, state.tau @ self.S.T
        )
        # Quantities of a frame are those of the frame that the mimic joint moves.
        assert model.frame_names[-1] == self.free.frame_names[-1] == "beta"
        result = engine_call.evaluate(make(self.free), free)
        wide, narrow = engine_call.tail(self.free), engine_call.tail(model)
        if wide[-1:] != narrow[-1:]:
            result = result @ self.S
        if wide[:-1] != narrow[:-1]:
            result = self.S.T @ result
        engine_call.check(make(model), state, engine_call.evaluate(make(model), state), result)

    def test_forward_dynamics_gives_what_inverse_dynamics_took(self, make: Make) -> None:
        model = mimicking()
        engine, state = make(model), random_state(model, 26, (4,))
        a = engine.forward_dynamics(state.q, state.v, state.tau)
        close = ErrorBounds(samples_at(model, state.q, state.v, tau=state.tau))
        close.check_solves(a, engine.inverse_dynamics(state.q, state.v, a), state.tau)

    def test_a_joint_that_follows_with_ratio_zero_stands_still(self, make: Make) -> None:
        model = Model.build("still", LINKS, followed_elbow(0.0, 0.3))
        held = load(branched().with_gravity(model.gravity), lock={"b_elbow": 0.3})
        state = random_state(model, 27, (3,))
        close = ErrorBounds(samples_at(model, state.q, state.v, state.a))
        tau = make(held).inverse_dynamics(state.q, state.v, state.a)
        close.check("inverse_dynamics", make(model).inverse_dynamics(state.q, state.v, state.a), tau)


def test_frames_can_be_added(make: Make) -> None:
    """A named frame on a link, with an origin of its own."""
    placement = Pose((0.1, -0.2, 0.3), (0.4, 0.5, -0.6))
    model = branched().with_base("floating").with_frame("grip", "tool", placement)
    engine, q = make(model), random_state(model, 28).q
    offset = np.eye(4)
    offset[:3, :3] = Rotation.from_euler("xyz", placement.rpy).as_matrix()
    offset[:3, 3] = placement.xyz
    wanted = engine.forward_kinematics(q, "tool") @ offset
    close = ErrorBounds(samples_at(model, q))
    close.check("forward_kinematics", engine.forward_kinematics(q, "grip"), wanted)


@pytest.mark.parametrize("off", [1e-15, 1e-9, -4e-7, 9e-7])
def test_a_quaternion_almost_of_unit_length_means_the_attitude(make: Make, off: float) -> None:
    model = branched().with_base("floating")
    engine, state = make(model), random_state(model, 7, (3,))
    close = ErrorBounds(samples_at(model, state.q, state.v))
    stretched = state.q.copy()
    stretched[:, 3:7] *= 1.0 + off
    given = stretched.copy()
    poses = engine.forward_kinematics(given, "tool"), engine.forward_kinematics(state.q, "tool")
    close.check("forward_kinematics", *poses)
    close.check("mass_matrix", engine.mass_matrix(given), engine.mass_matrix(state.q))
    close.check("bias_torque", engine.bias_torque(given, state.v), engine.bias_torque(state.q, state.v))
    one_by_one = np.stack([engine.gravity_torque(q) for q in given])
    close.check("gravity_torque", one_by_one, engine.gravity_torque(state.q))
    np.testing.assert_array_equal(given, stretched)


MOUNT = Pose((0.4, -1.2, 0.7), (1.1, -0.6, 2.3))
ROBOT = mimicking().with_base_pose(MOUNT)
MOUNTED = Model.build(
    "mounted",
    [Link("ground"), *ROBOT.links],
    [Joint("mount", "fixed", "ground", ROBOT.root, MOUNT), *ROBOT.joints],
    gravity=ROBOT.gravity,
)


@each_call
def test_every_quantity_is_that_of_the_mounted_robot(make: Make, engine_call: EngineCall) -> None:
    assert ROBOT.frame_names[-1] == MOUNTED.frame_names[-1]
    state = random_state(ROBOT, 61, (3,))
    result = engine_call.evaluate(make(ROBOT), state)
    if engine_call.method == "base_wrench":
        wanted = engine_call.evaluate(make(MOUNTED), state, "joint_wrenches")[..., 0, :]
    else:
        wanted = engine_call.of_shared_parts(engine_call.evaluate(make(MOUNTED), state), MOUNTED, ROBOT)
    engine_call.check(make(ROBOT), state, result, wanted)


def test_every_frame_is_where_the_mount_puts_it(make: Make) -> None:
    """Against the same robot at the world frame, also for frames on the base itself."""
    plain, engine = make(mimicking()), make(ROBOT)
    q = ROBOT.random(62)
    T = engine.forward_kinematics(q)
    ErrorBounds(samples_at(ROBOT, q)).check(
        "forward_kinematics", T, MOUNT.matrix @ plain.forward_kinematics(q)
    )
    np.testing.assert_allclose(engine.forward_kinematics(q, ROBOT.root), MOUNT.matrix, rtol=0, atol=1e-14)


def test_inverse_kinematics_reaches_a_target_in_the_world(make: Make) -> None:
    engine = make(ROBOT)
    T = engine.forward_kinematics(ROBOT.random(63), "beta")
    found = engine.inverse_kinematics(T, "beta", rng=0)
    assert found.success
    np.testing.assert_allclose(engine.forward_kinematics(found.q, "beta"), T, rtol=0, atol=1e-5)


def test_the_referee_and_the_laws_of_mechanics_agree() -> None:
    report = agree(ROBOT, ["reference"], samples=2, referee_samples=1)
    assert report.agree, report
