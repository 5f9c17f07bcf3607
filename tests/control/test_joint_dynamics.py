"""Controllers that know the armature, damping and dry friction of the description."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import dynx
from dynx import control, trajectory
from dynx.backends import installed_backends
from dynx.control.base import Measurement, gains_of
from dynx.errors import DynxError
from dynx.model import Model
from dynx.sim import Scenario, simulate, simulate_batch
from dynx.trajectory import Setpoint
from tests.backends.robots import mixed_robot
from tests.sim.rigid_bodies import RIGID_BODIES
from tests.world.test_joint_dynamics import TURNTABLE

FIXED = mixed_robot("fixed", mimic=False)
MIMIC = mixed_robot("fixed", mimic=True)
SIX_AXIS = dynx.load("six_axis_arm")
ROBOTS = {"mixed": FIXED, "mimic": MIMIC, "six-axis arm": SIX_AXIS}
TIP = "link9"
LAWS: dict[str, Callable[..., Any]] = {
    "computed torque": lambda robot, **given: control.ComputedTorque(robot, kp=400.0, kd=40.0, **given),
    "discrete": lambda robot, **given: control.DiscreteComputedTorque(robot, control_dt=1e-3, **given),
    "gravity": lambda robot, **given: control.GravityCompensatedPD(robot, kp=50.0, kd=5.0, **given),
    "feed-forward": lambda robot, **given: control.FeedForward(robot, kp=50.0, kd=5.0, **given),
    "impedance": lambda robot, **given: control.Impedance(
        robot, robot.frame_names[-1], stiffness=100.0, damping=10.0, joint_damping=1.0, **given
    ),
    "operational space": lambda robot, **given: control.OperationalSpace(
        robot, robot.frame_names[-1], kp=100.0, kd=20.0, **given
    ),
}
"""Controllers that evaluate a model, of a robot and with options."""


def motion_of(robot: Model, duration: float = 0.5) -> Any:
    """Return a motion of all joints that starts and ends at rest."""
    start = 0.5 * np.clip(robot.neutral(), -1.0, 1.0)
    end = start + 2.0 * duration * np.linspace(0.3, -0.2, robot.nv)
    return trajectory.cycloidal(start, end, duration=duration)


@pytest.mark.parametrize("name", sorted(ROBOTS))
def test_computed_torque_tracks_as_on_a_robot_without_joint_dynamics(name: str) -> None:
    """Dry friction is overcome along the setpoint's velocity; what remains is of the order of the step. The
    wrist of the six-axis arm is damped by five times its inertia in a step, which the controller does not
    know."""
    robot = ROBOTS[name]
    motion, law = motion_of(robot), LAWS["computed torque"]
    options: dict[str, Any] = {"plant": "compiled", "check_reference": False}
    rigid = np.abs(simulate(robot, law(robot), motion, **RIGID_BODIES, **options).error).max()
    knows = np.abs(simulate(robot, law(robot, joint_dynamics=True), motion, **options).error).max()
    ignores = np.abs(simulate(robot, law(robot), motion, **options).error).max()
    assert ignores > 6.0 * knows
    if robot is not SIX_AXIS:
        assert knows < 1.01 * rigid


@pytest.mark.parametrize("name", sorted(ROBOTS))
def test_discrete_computed_torque_is_exact(name: str) -> None:
    """It inverts the step of the plant, in which damping and friction act on the velocity at its end."""
    robot = ROBOTS[name]
    options: dict[str, Any] = {"check_reference": False}
    for plant in ("reference", "compiled"):
        law = LAWS["discrete"](robot, joint_dynamics=True, backend=plant)
        found = simulate(robot, law, motion_of(robot, 0.1), plant=plant, **options)
        # Rounding of an acceleration that is divided by the square of the step.
        assert np.abs(found.error).max() < 1e-9


def test_a_robot_with_rotors_is_tracked_as_one_without() -> None:
    """Armature of nine times the inertia."""
    robot = dynx.load(TURNTABLE.format('armature="0.9"')).with_gravity((0.0, 0.0, 0.0))
    motion = trajectory.cycloidal([0.0], [1.0], duration=1.0)
    law = LAWS["computed torque"]
    cases: tuple[Any, ...] = (({}, RIGID_BODIES), ({"joint_dynamics": True}, {}), ({}, {}))
    for plant in installed_backends():
        rigid, knows, ignores = (
            np.abs(simulate(robot, law(robot, **given), motion, plant=plant, **options).error).max()
            for given, options in cases
        )
        assert knows == pytest.approx(rigid, rel=1e-6), plant
        assert ignores > 20.0 * knows, plant


@pytest.mark.parametrize("name", sorted(LAWS))
@pytest.mark.parametrize("robot", [FIXED, MIMIC], ids=["tree", "mimic"])
def test_every_controller_adds_what_backends_compute_with_joint_dynamics(name: str, robot: Model) -> None:
    """Along a setpoint at the measured state, armature, damping and friction are those of inverse dynamics
    with ``joint_dynamics=True``; on every backend."""
    rng = np.random.default_rng(3)
    q, v, a = robot.random(rng), rng.standard_normal(robot.nv), rng.standard_normal(robot.nv)
    measurement, setpoint = Measurement(0.0, q, v), Setpoint(q, v, a)
    if name == "discrete":
        setpoint = Setpoint(q + 1e-3 * (v + 1e-3 * a), v + 1e-3 * a, a)
    for engine in installed_backends():
        told, without = (
            LAWS[name](robot, joint_dynamics=known, backend=engine).torque(measurement, setpoint, None)[0]
            for known in (True, False)
        )
        backend = dynx.backend(engine, robot)
        moves = name in ("computed torque", "feed-forward", "operational space")
        if name == "discrete":
            a_end, v_end = a, v + 1e-3 * a
        else:
            a_end, v_end = (a if moves else 0.0 * a), v
        added = backend.inverse_dynamics(q, v_end, a_end, joint_dynamics=True)
        added = added - backend.inverse_dynamics(q, v_end, a_end)
        scale = 1.0 + np.abs(added).max() + np.abs(without).max()
        if name != "operational space":  # its accelerations also depend on the mass matrix
            np.testing.assert_allclose(told - without, added, rtol=0.0, atol=1e-6 * scale, err_msg=engine)
        assert np.abs(told - without).max() > 1e-2


@pytest.mark.parametrize("name", sorted(LAWS))
def test_compiled_loops_batches_and_files_keep_the_option(name: str) -> None:
    law, motion = LAWS[name](FIXED, joint_dynamics=True), motion_of(FIXED, 0.05)
    options: dict[str, Any] = {"check_reference": False}
    loop = simulate(FIXED, law, motion, plant="reference", **options)
    compiled = simulate(FIXED, law.on("compiled"), motion, plant="compiled", **options)
    scale = 1.0 + np.abs(loop.tau).max()
    np.testing.assert_allclose(compiled.q, loop.q, rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(compiled.tau, loop.tau, rtol=0.0, atol=1e-6 * scale)
    batch = simulate_batch(FIXED, law, motion, rollouts=2, **options)
    np.testing.assert_allclose(batch.q[0], loop.q[-1], rtol=0.0, atol=1e-9)
    scenario = Scenario(FIXED, law, motion)
    again = Scenario.from_json(scenario.to_json())
    found: Any = again.controller
    assert again == scenario
    assert found.joint_dynamics
    np.testing.assert_array_equal(found.joints.armature, law.joints.armature)
    assert "joint_dynamics" not in gains_of(law)
    assert LAWS[name](FIXED) != law


def test_robots_without_joint_dynamics_cost_nothing() -> None:
    robot = dynx.load("ur5")
    for law in LAWS.values():
        assert law(robot, joint_dynamics=True).joints is None


def test_documents_without_the_option_mean_rigid_bodies() -> None:
    law = LAWS["computed torque"](SIX_AXIS)
    document = Scenario(SIX_AXIS, law, SIX_AXIS.neutral()).to_dict()
    told: Any = document
    assert told["controller"]["controller"].pop("joint_dynamics") is False
    assert Scenario.from_dict(document).controller == law


def test_other_values_are_refused() -> None:
    for value in ("yes", 1, None):
        with pytest.raises(DynxError, match="joint_dynamics"):
            LAWS["computed torque"](SIX_AXIS, joint_dynamics=value)
