"""The momentum observer finds external wrenches, in logs, loops and worlds, and says what it cannot see."""

from __future__ import annotations

from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import dynx
from dynx.backends import backend
from dynx.backends.dynamics import EngineDynamics
from dynx.control import (
    PD,
    Controller,
    Measurement,
    MomentumObserver,
    OpenLoop,
    WrenchEstimate,
)
from dynx.errors import ArgumentError, GainError, ShapeError, UnknownNameError
from dynx.model import Model
from dynx.sim import simulate, simulate_batch
from dynx.sim.scenario.documents import decode, encode
from dynx.spatial.scalar import Floats
from dynx.trajectory.base import Setpoint
from dynx.world import Scene, SceneRobot, World
from tests.sim.rigid_bodies import RIGID_BODIES
from tests.world.engines import WORLDS

BAR = 0.01
"""Largest error of a wrench after 5 time constants; exp(-5) of it is the filter's own."""

T = 1e-3
"""Time constant [s]: short, because a link that nothing holds moves under the force, and its Jacobian too."""

DT = 5e-5
START = 2e-3
STEPS = round((START + 5.0 * T) / DT)

Q0 = np.array([0.3, -1.2, 1.5, -0.3, 0.2, 0.0])
"""A configuration of a UR5 in which its hand can move in every direction."""

ROBOTS: list[tuple[str, Literal["fixed", "floating"], str]] = [
    ("ur5", "fixed", "pinocchio"),
    ("ur5", "floating", "drake"),
    ("panda", "fixed", "mujoco"),
    ("a1", "floating", "compiled"),
    ("a1", "fixed", "pybullet"),
    ("talos", "floating", "pinocchio"),
    ("tiago", "fixed", "compiled"),
]


def force_of_20(rng: np.random.Generator) -> Floats:
    """Return a wrench (6,) of 20 N in a random direction."""
    direction = rng.standard_normal(3)
    return np.concatenate([20.0 * direction / np.linalg.norm(direction), np.zeros(3)])


def check_found(estimate: WrenchEstimate, wrench: Floats) -> None:
    """Check what the torques show of a wrench, and that the rest is named."""
    error = np.linalg.norm(estimate.wrench - estimate.observable @ wrench)
    assert error <= BAR * np.linalg.norm(wrench), (estimate, error)
    assert len(estimate.blind) == 6 - estimate.rank


@pytest.mark.parametrize(("name", "base", "plant"), ROBOTS)
def test_a_step_of_20_newtons_is_found_after_5_time_constants(
    name: str, base: Literal["fixed", "floating"], plant: str
) -> None:
    if plant not in dynx.installed_backends():
        pytest.skip(f"needs {plant}")
    robot = dynx.load(name, base=base)
    rng = np.random.default_rng(7)
    # A joint that its dry friction holds does not show a force.
    observer = MomentumObserver(robot, time_constant=T, **RIGID_BODIES)
    # Forces on links of a few grams accelerate them beyond any sensor.
    heavy = [link.name for link in robot.links if link.inertial is not None and link.inertial.mass > 0.05]
    for link in rng.choice(heavy, 3, replace=False).tolist():
        q0, wrench = robot.random(rng), force_of_20(rng)
        # A free robot falls as one body, an arm is held against its weight.
        with backend("pinocchio", robot) as engine:
            hold = np.zeros(robot.nv) if robot.floating else engine.gravity_torque(q0)
        rollout = simulate(
            robot,
            OpenLoop(robot, np.tile(hold, (STEPS, 1)), control_dt=DT),
            duration=STEPS * DT,
            dt=DT,
            q0=q0,
            v0=0.2 * rng.standard_normal(robot.nv),
            plant=plant,
            pushes=dynx.ExternalForce(link, wrench, start=START),
            **RIGID_BODIES,
        )
        found = observer.residuals(rollout.t, rollout.q, rollout.v, rollout.tau)
        before = np.abs(found[round(START / DT)]).max()
        assert before < 0.02 * np.abs(found[-1]).max() + 1e-9, (link, before, np.abs(found[-1]).max())
        estimate = observer.wrench(rollout.q[-1], found[-1], link)
        check_found(estimate, wrench)
        if base == "floating":
            assert estimate.rank == 6


@pytest.mark.parametrize("engine", WORLDS)
def test_a_world_loop_finds_it_too(engine: str) -> None:
    arm = dynx.load("ur5").with_base_pose(dynx.Pose((0.0, 0.3, 0.5), (0.2, 0.1, 0.3)))
    q0 = Q0
    observer, wrench = MomentumObserver(arm, time_constant=T), force_of_20(np.random.default_rng(1))
    state, tau = observer.initial_state(), np.zeros(6)
    hold = PD(arm, kp=100.0, kd=5.0)
    push = dynx.ExternalForce("arm/wrist_1_link", wrench, start=START)
    with World(Scene("cell", robots=(SceneRobot("arm", arm, q=tuple(q0)),)), engine, DT) as world:
        for _ in range(STEPS + 1):
            q, v = world.state.robots["arm"]
            state = observer.update(state, q, v, tau, DT)
            tau, _ = hold.torque(Measurement(world.time, q, v), Setpoint(q0, np.zeros(6), np.zeros(6)), None)
            world.step(torques={"arm": tau}, forces=[push])
    estimate = observer.wrench(q, observer.residual(state), "wrist_1_link")
    assert estimate.rank == 4
    check_found(estimate, wrench)


@given(
    st.floats(1.0, 500.0),
    st.lists(st.floats(1e-4, 0.05), min_size=2, max_size=20),
    st.floats(-50.0, 50.0),
    st.floats(0.1, 10.0),
)
def test_the_response_to_a_constant_force_is_exponential(
    gain: float, steps: list[float], force: float, armature: float
) -> None:
    """A slider under constant forces, sampled at any times, with armature and damping."""
    slider = dynx.load(SLIDER)
    t = np.concatenate([[0.0], np.cumsum(steps)])
    observer = MomentumObserver(slider, gain=gain, joint_armature=armature, backend="reference")
    mass = 2.0 + armature
    a = (3.0 + force) / mass
    v = a * t
    found = observer.residuals(t, 0.5 * a * t[:, None] ** 2, v[:, None], np.full((len(steps), 1), 3.0))
    wanted = force * -np.expm1(-gain * t)
    np.testing.assert_allclose(found[:, 0], wanted, rtol=1e-9, atol=1e-9 * (3.0 + abs(force) + mass / 1e-4))


SLIDER = """<robot name="slider"><link name="rail"/>
<link name="cart"><inertial><mass value="2"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>
</inertial></link>
<joint name="slide" type="prismatic"><parent link="rail"/><child link="cart"/><axis xyz="1 0 0"/>
<limit lower="-9" upper="9" effort="9" velocity="9"/></joint></robot>"""


def test_friction_and_armature_that_are_not_told_are_an_external_torque() -> None:
    arm = dynx.load("panda")
    joints: dict[str, Any] = {
        "joint_damping": 3.0,
        "joint_friction": 2.0,
        "friction_slip": 0.05,
        "joint_armature": 0.3,
    }
    rng = np.random.default_rng(3)
    rollout = simulate(
        arm,
        PD(arm, kp=50.0, kd=2.0),
        arm.random(rng),
        duration=0.05,
        dt=DT,
        q0=arm.random(rng),
        plant="compiled",
        **joints,
    )
    log = rollout.t, rollout.q, rollout.v, rollout.tau
    told = MomentumObserver(arm, time_constant=T, **joints).residuals(*log)
    untold = MomentumObserver(arm, time_constant=T, **RIGID_BODIES).residuals(*log)
    size = np.abs(rollout.tau).max()
    assert np.abs(told).max() < 0.01 * size
    assert np.abs(untold).max() > 0.1 * size
    with pytest.raises(GainError, match="armature"):
        MomentumObserver(arm, gain=10.0, joint_armature=-1.0)


class StopOnContact(Controller[Floats], pure=True):
    """Holds a configuration, until the observer feels a torque; from then on it lets go."""

    def __init__(self, observer: MomentumObserver, threshold: float) -> None:
        self.model, self.observer, self.threshold = observer.model, observer, threshold

    def initial_state(self) -> Floats:
        return np.concatenate([self.observer.initial_state(), np.zeros(self.model.nv + 1)])

    def torque(self, measurement: Measurement, setpoint: Setpoint, state: Floats) -> tuple[Floats, Floats]:
        nv = self.model.nv
        seen, last, stopped = state[: -nv - 1], state[-nv - 1 : -1], state[-1]
        seen = self.observer.update(seen, measurement.q, measurement.v, last, 1e-3)
        felt = np.max(np.abs(self.observer.residual(seen)))
        stopped = np.where(felt > self.threshold, 1.0, stopped)
        gravity = self.observer.dynamics.gravity_torque(measurement.q)
        held = gravity + 200.0 * (setpoint.q - measurement.q) - 20.0 * measurement.v
        tau = np.where(stopped > 0.5, gravity - 20.0 * measurement.v, held)
        return tau, np.concatenate([seen, tau, [stopped]])


def test_a_controller_that_uses_it_runs_alike_in_every_executor() -> None:
    """It lets go of a payload that it does not know."""
    arm = dynx.load("ur5")
    law = StopOnContact(MomentumObserver(arm, time_constant=0.05, joint_damping=True), threshold=4.0)
    options: dict[str, Any] = {"duration": 0.3, "payload": dynx.Payload("tool0", 2.0)}
    by_kernel = simulate(arm, law, Q0, q0=Q0, plant="compiled", **options)
    assert by_kernel.executor == "compiled", by_kernel.executor
    by_engine = simulate(arm, law, Q0, q0=Q0, plant="pinocchio", **options)
    many = simulate_batch(arm, law, Q0, q0=np.tile(Q0, (2, 1)), **options)
    np.testing.assert_allclose(by_engine.q, by_kernel.q, rtol=0, atol=1e-9)
    np.testing.assert_allclose(many.q[1], by_kernel.q[-1], rtol=0, atol=1e-9)
    seen = law.observer.residuals(by_kernel.t, by_kernel.q, by_kernel.v, by_kernel.tau)
    stop = int(np.argmax(np.abs(seen).max(axis=1) > 4.0))
    assert 10 < stop < 40
    for k, let_go in ((stop - 1, False), (stop, True), (299, True)):
        gravity = law.observer.dynamics.gravity_torque(by_kernel.q[k])
        braked = gravity - 20.0 * by_kernel.v[k]
        assert np.allclose(by_kernel.tau[k], braked, rtol=0, atol=1e-9) is let_go
    other = law.on("mujoco").observer.dynamics
    assert isinstance(other, EngineDynamics)
    assert other.backend.name == "mujoco"


@pytest.mark.parametrize("suffix", ["npz", "csv", "mcap"])
def test_a_log_in_a_file(tmp_path: Path, suffix: str) -> None:
    arm = dynx.load("ur5")
    push = dynx.ExternalForce("tool0", (0.0, 20.0, 0.0, 0.0, 0.0, 0.0))
    rollout = simulate(arm, PD(arm, kp=10.0, kd=1.0), Q0, q0=Q0, duration=0.02, dt=2e-4, pushes=push)
    rollout.save(tmp_path / f"log.{suffix}")
    log = dynx.Rollout.load(tmp_path / f"log.{suffix}", arm if suffix == "csv" else None)
    observer = MomentumObserver(arm, time_constant=4e-3)
    found = observer.residuals(log.t, log.q, log.v, log.tau)
    np.testing.assert_allclose(
        found, observer.residuals(rollout.t, rollout.q, rollout.v, rollout.tau), rtol=1e-9, atol=1e-9
    )
    estimate = observer.wrench(log.q, found, "tool0")
    assert estimate.wrench.shape == (101, 6)
    np.testing.assert_allclose(estimate.wrench[-1], np.asarray(push.wrench), rtol=0, atol=BAR * 20.0)


@pytest.mark.parametrize("reference", ["local_world_aligned", "local", "world"])
def test_an_exact_torque_gives_the_wrench_in_every_reference(reference: str) -> None:
    arm = dynx.load("panda")
    rng = np.random.default_rng(2)
    q = arm.random(rng, 5)
    observer = MomentumObserver(arm, gain=10.0)
    wrench = rng.standard_normal((5, 6))
    with backend("reference", arm) as engine:
        J = engine.jacobian(q, "panda_hand", reference=reference, point=(0.1, 0.0, 0.2))
    torque = np.einsum("kij,ki->kj", J, wrench)
    found = observer.wrench(q, torque, "panda_hand", reference=reference, point=(0.1, 0.0, 0.2))
    np.testing.assert_allclose(found.wrench, wrench, rtol=0, atol=1e-9 * found.condition.max())
    assert (found.rank == 6).all()
    assert np.abs(found.unexplained).max() < 1e-9
    with pytest.raises(ArgumentError, match="batch"):
        _ = found.blind


def test_what_the_torques_do_not_show_is_named() -> None:
    arm: Model = dynx.load("ur5")
    observer = MomentumObserver(arm, gain=10.0)
    base = observer.wrench(Q0, np.zeros(6), "base_link")
    assert base.rank == 0
    assert np.isinf(base.condition)
    assert base.blind == tuple(f"+1 {part} {axis}" for part in ("force", "moment") for axis in "xyz")
    # Behind its first joint alone the arm feels the moment about the vertical axis.
    shoulder = observer.wrench(Q0, np.ones(6), "shoulder_link")
    assert shoulder.rank == 1
    np.testing.assert_allclose(shoulder.wrench, [0.0, 0.0, 0.0, 0.0, 0.0, 1.0], rtol=0, atol=1e-12)
    np.testing.assert_allclose(shoulder.unexplained, [0.0, 1.0, 1.0, 1.0, 1.0, 1.0], rtol=0, atol=1e-12)
    assert "+1 moment z" not in shoulder.blind
    straight = observer.wrench(np.zeros(6), np.zeros(6), "tool0")
    assert straight.rank < 6
    assert len(straight.blind) == 6 - straight.rank


def test_forces_on_several_feet() -> None:
    dog = dynx.load("a1", base="floating")
    rng = np.random.default_rng(4)
    q, feet = dog.random(rng), ["FL_foot", "FR_foot", "RL_foot"]
    forces = rng.standard_normal((3, 3))
    with backend("reference", dog) as engine:
        torque = sum(engine.jacobian(q, foot)[:3].T @ f for foot, f in zip(feet, forces, strict=True))
    found = MomentumObserver(dog, gain=10.0).wrench(q, torque, feet, force_only=True)
    assert found.rank == 9
    np.testing.assert_allclose(found.wrench[:, :3], forces, rtol=0, atol=1e-10 * float(found.condition))
    assert not found.wrench[:, 3:].any()
    two = MomentumObserver(dog, gain=10.0).wrench(q, torque, ["trunk", "FL_hip"])
    assert two.rank == 7
    assert " on trunk" in " ".join(two.blind)
    assert "7 of 12" in repr(two)


def test_arguments_that_no_observer_has() -> None:
    arm = dynx.load("ur5")
    both: dict[str, Any] = {"gain": 1.0, "time_constant": 1.0}
    invalid: dict[str, Any] = {"time_constant": 0.0}
    negative: dict[str, Any] = {"gain": -1.0}
    for wrong in ({}, both, invalid, negative):
        with pytest.raises(GainError):
            MomentumObserver(arm, **wrong)
    with pytest.raises(ArgumentError, match="backend"):
        MomentumObserver(arm, gain=1.0, backend=backend("reference", dynx.load("panda")))
    observer = MomentumObserver(arm, gain=1.0)
    t, rows = np.arange(3.0), np.zeros((3, 6))
    with pytest.raises(ShapeError, match=r"tau has shape \(3, 6\); wanted \(2, 6\)"):
        observer.residuals(t, rows, rows, rows)
    with pytest.raises(ArgumentError, match="not after"):
        observer.residuals([0.0, 1.0, 1.0], rows, rows, rows[:2])
    with pytest.raises(UnknownNameError, match="tool0"):
        observer.wrench(rows[0], rows[0], "tool")
    with pytest.raises(ShapeError, match="residual"):
        observer.wrench(rows[0], np.zeros(5), "tool0")
    with pytest.raises(ShapeError, match="batch"):
        observer.wrench(rows, np.zeros((2, 6)), "tool0")
    with pytest.raises(ArgumentError, match="tolerance"):
        observer.wrench(rows[0], rows[0], "tool0", tolerance=2.0)
    with pytest.raises(ArgumentError, match="empty"):
        observer.wrench(rows[0], rows[0], [])


def test_a_document_keeps_the_joint_dynamics_that_an_observer_knows() -> None:
    """Documents of earlier versions did not have them, and observers none by default."""
    arm = dynx.load("panda")
    given: dict[str, Any] = {
        "joint_damping": 3.0,
        "joint_friction": {"panda_joint2": 0.4},
        "friction_slip": 0.1,
    }
    observer = MomentumObserver(arm, gain=10.0, joint_armature=0.2, **given)
    document = encode(observer, arm)
    again = decode(document, arm)
    np.testing.assert_array_equal(again.losses(np.ones(arm.nv)), observer.losses(np.ones(arm.nv)))
    np.testing.assert_array_equal(again.armature, observer.armature)
    former = {name: each for name, each in document["fields"].items() if name in ("model", "gain")}
    told = decode({**document, "fields": former}, arm)
    assert not told.losses.present
    assert not told.armature.any()
    assert MomentumObserver(arm, gain=10.0).losses.present
