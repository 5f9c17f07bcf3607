"""Tasks of one robot move with the joint dynamics of its description, on every engine and in kernels."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import gymnasium
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import dynx
from dynx.backends import installed_backends
from dynx.backends.dynamics import Dynamics
from dynx.control import OpenLoop
from dynx.envs.environment import TaskEnvironment
from dynx.envs.library import spaces
from dynx.envs.task import RobotTask, State
from dynx.envs.task_step import TaskStep
from dynx.envs.tasks.pendulum import Pendulum
from dynx.envs.tasks.push import Push
from dynx.envs.tasks.reach import Reach
from dynx.envs.vector import RobotVectorEnvironment
from dynx.errors import ArgumentError, UnknownNameError
from dynx.model import Model
from dynx.model.tree import Base
from dynx.sim import simulate
from dynx.spatial.scalar import Array
from dynx.testing.strategies import models
from tests.backends.robots import mixed_robot
from tests.sim.rigid_bodies import RIGID_BODIES
from tests.world.test_joint_dynamics import PENDULUM, TURNTABLE

SUBSTEPS, STEP = 2, 1e-3


@dataclass(frozen=True)
class Pushed(RobotTask):
    """A robot under the torque that is the action, from a configuration and a velocity of its own."""

    robot: Model
    q: tuple[float, ...]
    v: tuple[float, ...]

    control_dt = SUBSTEPS * STEP
    substeps = SUBSTEPS

    @property
    def model(self) -> Model:
        return self.robot

    @cached_property
    def observation_space(self) -> spaces.Box:
        return spaces.Box(-np.inf, np.inf, (self.robot.nq + self.robot.nv,), np.float64)

    @cached_property
    def action_space(self) -> spaces.Box:
        return spaces.Box(-1e3, 1e3, (self.robot.nv,), np.float64)

    def start(self, random: Array) -> State:
        return State(np.array(self.q), np.array(self.v))

    def torque(self, robot: Dynamics, state: State, action: Array) -> Array:
        return action

    def observation(self, robot: Dynamics, state: State) -> Array:
        return np.concatenate([state.q, state.v])

    def reward(self, robot: Dynamics, before: State, action: Array, after: State) -> Any:
        return -np.sum(after.v * after.v)


class PushedByRungeKutta(Pushed):
    integrator = "rk4"


def one_joint(text: str, dynamics: str, q: float = 0.0, v: float = 0.0, kind: Any = Pushed) -> Pushed:
    """Return the task of a robot of one joint with these joint dynamics."""
    task: Pushed = kind(dynx.load(text.format(dynamics)), (q,), (v,))
    return task


def moved(task: RobotTask, engine: str, steps: int, action: Any, **options: Any) -> Any:
    """Return the observation after steps with one action."""
    with TaskEnvironment(task, engine, **options) as env:
        observation, _ = env.reset(seed=0)
        for _ in range(steps):
            observation, *_ = env.step(np.array(action, dtype=float))
        return observation


def moved_in_kernel(task: RobotTask, steps: int, action: Any, **options: Any) -> Any:
    """Return the observations of three environments after steps with one action."""
    envs = RobotVectorEnvironment(task, 3, **options)
    observation, _ = envs.reset(seed=0)
    for _ in range(steps):
        observation, *_ = envs.step(np.tile(np.array(action, dtype=float), (3, 1)))
    return observation


@pytest.mark.parametrize("kind", [Pushed, PushedByRungeKutta])
def test_armature_adds_to_the_inertia(kind: Any) -> None:
    """A torque of 1 N m accelerates 0.1 kg m^2 and 0.9 kg m^2 of armature to 0.1 rad/s in 0.1 s."""
    task = one_joint(TURNTABLE, 'armature="0.9"', kind=kind)
    for options, speed in (({}, 0.1), ({"joint_armature": False}, 1.0)):
        for engine in installed_backends():
            found = moved(task, engine, 50, [1.0], **options)[1]
            assert found == pytest.approx(speed, rel=1e-9), engine
        np.testing.assert_allclose(moved_in_kernel(task, 50, [1.0], **options)[:, 1], speed, rtol=1e-9)


@pytest.mark.parametrize("kind", [Pushed, PushedByRungeKutta])
def test_dry_friction_holds_a_pendulum(kind: Any) -> None:
    """Gravity pulls with 8.25 N m at 1 rad, and 9 N m hold it; without them it falls."""
    task = one_joint(PENDULUM, 'friction="9"', 1.0, kind=kind)
    for engine in installed_backends():
        np.testing.assert_array_equal(moved(task, engine, 20, [0.0]), [1.0, 0.0], engine)
        assert moved(task, engine, 150, [0.0], joint_friction=False)[0] < 0.9, engine
    np.testing.assert_array_equal(moved_in_kernel(task, 20, [0.0]), [[1.0, 0.0]] * 3)


def test_damping_slows_a_joint_down() -> None:
    """I v' = -d v; Euler's implicit step divides the speed by 1 + h d / I."""
    task = one_joint(TURNTABLE, 'damping="0.2"', v=1.0)
    exact = (1.0 + STEP * 0.2 / 0.1) ** -100
    for engine in installed_backends():
        assert moved(task, engine, 50, [0.0])[1] == pytest.approx(exact, rel=1e-12), engine
        assert moved(task, engine, 50, [0.0], joint_damping=False)[1] == pytest.approx(1.0, rel=1e-12)
    np.testing.assert_allclose(moved_in_kernel(task, 50, [0.0])[:, 1], exact, rtol=1e-12)


@settings(max_examples=25)
@given(models(min_links=2, max_links=4, solvable=True), st.integers(0, 2**31))
def test_an_environment_moves_as_a_simulation_does(robot: Model, seed: int) -> None:
    """To rounding, with and without the joint dynamics of the description."""
    rng = np.random.default_rng(seed)
    q, v, tau = robot.random(rng), 0.1 * rng.standard_normal(robot.nv), rng.standard_normal(robot.nv)
    if robot.floating:
        tau[:6] = 0.0
    task = Pushed(robot, tuple(q.tolist()), tuple(v.tolist()))
    for options in ({}, RIGID_BODIES):
        law = OpenLoop(robot, np.tile(tau, (SUBSTEPS, 1)), control_dt=STEP)
        told = simulate(robot, law, q0=q, v0=v, duration=SUBSTEPS * STEP, plant="reference", **options)
        found = moved(task, "reference", 1, tau, **options)
        expected = np.concatenate([told.q[-1], told.v[-1]])
        np.testing.assert_allclose(
            found, expected, rtol=1e-9, atol=1e-9 * (1.0 + np.abs(expected).max(initial=0.0))
        )


@pytest.mark.parametrize("base", ["fixed", "floating"])
def test_engines_and_kernels_agree(base: Base) -> None:
    """Kernels bit for bit in single and in vector environments; robots that draw other parameters keep the
    joint dynamics that they do not draw."""
    robot = mixed_robot(base, mimic=True)
    task = Pushed(robot, tuple(robot.random(1).tolist()), tuple(np.linspace(-0.5, 0.5, robot.nv).tolist()))
    tau = np.linspace(1.0, -1.0, robot.nv)
    drawn: dict[str, Any] = {"mass_scale": (1.2, 1.2), "joint_damping": {robot.joint_names[0]: (0.7, 0.7)}}
    single = {}
    cases: dict[str, Any] = {"drawn": {"randomize": drawn}}
    if base == "fixed":
        cases["described"] = {}
    for name, options in cases.items():
        single[name] = moved(task, "compiled", 3, tau, **options)
        for row in moved_in_kernel(task, 3, tau, **options):
            np.testing.assert_array_equal(row, single[name])
        for engine in installed_backends():
            np.testing.assert_allclose(
                moved(task, engine, 3, tau, **options), single[name], rtol=1e-8, atol=1e-8, err_msg=engine
            )
    rigid = moved(task, "reference", 3, tau, **RIGID_BODIES)
    for each in single.values():
        assert np.abs(each - rigid).max() > 1e-5


def limited(robot: Model, q: Array, width: float) -> Model:
    """Return a robot whose joints have limits at a distance from the configuration q."""
    base = 7 if robot.floating else 0
    own = dict(zip(robot.joint_names, q[base:].tolist(), strict=True))
    joints = (
        replace(each, limits=replace(each.limits, lower=own[each.name] - width, upper=own[each.name] + width))
        if each.name in own and each.type != "continuous"
        else each
        for each in robot.joints
    )
    return replace(robot, joints=tuple(joints))


@pytest.mark.long_cases
@pytest.mark.parametrize("base", ["fixed", "floating"])
@pytest.mark.parametrize("width", [2e-3, -0.1], ids=["within", "beyond"])
def test_joints_stop_at_their_limits(base: Base, width: float) -> None:
    """Kernels bit for bit in single and in vector environments, engines as `simulate` to rounding."""
    robot = mixed_robot(base, mimic=True)
    q, v = robot.random(1), np.linspace(-3.0, 3.0, robot.nv)
    if width > 0.0:
        robot = limited(robot, q, width)
    else:
        # Half of the limits are passed already, and the joints move outwards or inwards.
        robot = limited(robot, q + 0.2 * np.sign(np.arange(robot.nq) % 3 - 1.0), 0.1)
    task = Pushed(robot, tuple(q.tolist()), tuple(v.tolist()))
    tau = np.zeros(robot.nv)
    rollout = simulate(robot, q0=q, v0=v, duration=3 * task.control_dt, dt=STEP, plant="reference")
    told = np.concatenate([rollout.q[-1], rollout.v[-1]])
    cases: dict[str, Any] = {"drawn": {"randomize": {"mass_scale": (1.0, 1.0)}}}
    if base == "fixed":
        cases["described"] = {}
    for options in cases.values():
        found = moved(task, "compiled", 3, tau, **options)
        for row in moved_in_kernel(task, 3, tau, **options):
            np.testing.assert_array_equal(row, found)
        for engine in ("compiled", *installed_backends()):
            found = moved(task, engine, 3, tau, **options)
            np.testing.assert_allclose(found, told, rtol=1e-8, atol=1e-8, err_msg=engine)
    free = moved(task, "reference", 3, tau, joint_limits=False)
    assert np.abs(free - told).max() > 1e-3


def test_a_stop_that_would_pull_gets_no_impulse() -> None:
    """In kernels as on floats: two joints pass their limits, and the impulse of one pushes the other back."""
    robot = limited(dynx.load("planar_2r"), np.zeros(2), 1e-3)
    for v in ([3.0, 6.0], [-1.0, 10.0], [1.0, -3.0]):
        task = Pushed(robot, tuple((9e-4 * np.sign(v)).tolist()), tuple(v))
        told = moved(task, "reference", 1, [0.0, 0.0])
        found = moved(task, "compiled", 1, [0.0, 0.0])
        np.testing.assert_allclose(found, told, rtol=1e-10, atol=1e-12)
        np.testing.assert_array_equal(moved_in_kernel(task, 1, [0.0, 0.0]), [found] * 3)


def test_a_stop_hides_no_divergence_of_a_task() -> None:
    robot = limited(dynx.load("planar_2r"), np.zeros(2), 1e-3)
    task = Pushed(robot, (0.0, 0.0), (1e9, 0.0))
    for engine in ("reference", "compiled"):
        with TaskEnvironment(task, engine) as env:
            env.reset(seed=0)
            *_, truncated, info = env.step(np.zeros(2))
            assert truncated
            assert "not finite or beyond" in info["diverged"]


def test_the_kernel_with_stops_is_compiled_when_a_joint_stops(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[object] = []
    monkeypatch.setattr(TaskStep, "kernel_with_stops", property(asked.append))
    moved_in_kernel(Reach(), 3, np.zeros(6))
    moved(Reach(), "compiled", 3, np.zeros(6))
    assert not asked


def test_robots_without_joint_dynamics_move_as_if_they_were_switched_off() -> None:
    for task, action in ((Pendulum(), [0.3]), (Reach(), np.linspace(-1.0, 1.0, 6))):
        np.testing.assert_array_equal(
            moved_in_kernel(task, 10, action), moved_in_kernel(task, 10, action, **RIGID_BODIES)
        )
        np.testing.assert_array_equal(
            moved(task, "pinocchio", 10, action), moved(task, "pinocchio", 10, action, **RIGID_BODIES)
        )


def test_options_are_those_of_environments_by_id() -> None:
    env = gymnasium.make("dynx/Reach-v0", robot="six_axis_arm", joint_friction=False)
    with env:
        assert env.unwrapped.episodes._robot.joints.friction.any() == np.False_  # type: ignore[attr-defined]
    with pytest.raises(UnknownNameError, match="did you mean 'joint_damping'"):
        gymnasium.make("dynx/Reach-v0", joint_dampin=False)
    with pytest.raises(ArgumentError, match=r"joint_armature is '0\.1'; wanted True or False"):
        TaskEnvironment(Pendulum(), joint_armature=0.1)  # type: ignore[arg-type]
    with pytest.raises(ArgumentError, match=r"joint_friction is '1'; wanted True"):
        RobotVectorEnvironment(Pendulum(), 2, joint_friction=1)  # type: ignore[arg-type]


def test_worlds_take_the_same_options() -> None:
    with TaskEnvironment(Push(), joint_damping=False, joint_limits=False) as env:
        episodes: Any = env.episodes
        assert not episodes.world.options["joint_damping"]
        assert not episodes.world.options["joint_limits"]
        assert episodes.world.options["joint_friction"]
