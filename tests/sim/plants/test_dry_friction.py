"""Dry friction against closed forms and its law: joints stick, break loose, slide and stop at any step."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from benchmarks.surveys import friction_scan
from benchmarks.surveys.friction_scan import Case
from dynx.backends import backend, installed_backends
from dynx.control import PD, BulletPositionMotor, OpenLoop
from dynx.errors import ArgumentError, UnsupportedFeatureError
from dynx.model import Joint, Link, Model
from dynx.model.elements import Inertial
from dynx.model.library import robots
from dynx.model.loading import load
from dynx.rbd.joint_friction import TOLERANCE, FrictionLaw
from dynx.sim import Rollout, Scenario, Simulation, simulate
from dynx.spatial.scalar import Floats
from dynx.steppers.implicit_joints import BLOCK_CORRECTIONS, ImplicitJoints
from dynx.testing.strategies import models
from tests.backends.robots import mixed_robot
from tests.oracles.closed_form import MODELS
from tests.sim.rigid_bodies import RIGID_BODIES

MASS, F = 2.0, 3.0
STEPS = [1e-4, 1e-3, 1e-2]
SCHEMES = ["semi_implicit", "rk4", "adaptive"]
PLANTS = [name for name in ("pinocchio", "compiled", "reference", "pybullet") if name in installed_backends()]


def slider() -> Model:
    """Return a block of `MASS` on a horizontal rail."""
    block = Inertial(MASS, ixx=0.1, iyy=0.1, izz=0.1)
    joint = Joint("rail", "prismatic", "base", "block", axis=(1.0, 0.0, 0.0))
    return Model.build("slider", [Link("base"), Link("block", block)], [joint])


def pulled(force: float, plant: str = "compiled", **options: Any) -> Rollout:
    """Pull the block with a constant force."""
    robot = slider()
    law = OpenLoop(robot, np.full((1, 1), force), control_dt=options["duration"])
    control_dt = {"control_dt": options["duration"]}
    return simulate(robot, law, plant=plant, joint_friction=F, **{**control_dt, **options})


@pytest.mark.long_cases
@pytest.mark.parametrize("start", [0.0, 4.0])
@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("plant", [name for name in PLANTS if name != "pybullet"])
def test_a_block_slides_under_friction_and_damping_as_the_closed_form(
    plant: str, scheme: str, start: float
) -> None:
    force, damping, dt = 2.0 * F, 2.5, 1e-3
    found = pulled(force, plant, v0=[start], joint_damping=damping, integrator=scheme, dt=dt, duration=1.0)
    # m v' = (force - F) - d v
    end, rate = (force - F) / damping, damping / MASS
    decay = np.exp(-rate * found.t)
    v = end + (start - end) * decay
    q = end * found.t + (start - end) * (1.0 - decay) / rate
    tolerance = {"semi_implicit": dt * rate * abs(start - end), "rk4": 1e-11, "adaptive": 1e-6}[scheme]
    assert float(np.max(np.abs(found.v[:, 0] - v))) < tolerance
    assert float(np.max(np.abs(found.q[:, 0] - q))) < tolerance


@pytest.mark.parametrize("dt", STEPS)
@pytest.mark.parametrize("plant", PLANTS)
def test_a_load_below_the_friction_moves_nothing(plant: str, dt: float) -> None:
    for load_ in (0.0, 0.5 * F, -0.999999 * F, F):
        held = pulled(load_, plant, q0=[0.7], dt=dt, duration=20 * dt)
        assert np.all(held.v == 0.0)
        assert np.all(held.q == 0.7)


@pytest.mark.parametrize("dt", STEPS)
@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_load_above_accelerates_by_the_difference(scheme: str, dt: float, sign: float) -> None:
    slides = pulled(sign * (F + 0.5), integrator=scheme, dt=dt, duration=50 * dt)
    a = sign * 0.5 / MASS
    np.testing.assert_allclose(slides.v[:, 0], a * slides.t, rtol=1e-9, atol=1e-15)
    np.testing.assert_allclose(slides.q[:, 0], 0.5 * a * slides.t**2, atol=abs(a) * 50 * dt**2)


@pytest.mark.parametrize("dt", STEPS)
@pytest.mark.parametrize("plant", PLANTS)
def test_a_sliding_block_stops_in_time_and_stays(plant: str, dt: float) -> None:
    speed = 30.37 * dt * F / MASS
    rollout = pulled(0.0, plant, v0=[speed], dt=dt, duration=60 * dt)
    time, distance = speed * MASS / F, 0.5 * speed**2 * MASS / F
    moving = rollout.t <= time - dt
    np.testing.assert_allclose(rollout.v[moving, 0], (speed - F / MASS * rollout.t)[moving], atol=1e-12)
    stopped = rollout.t >= time + dt
    assert np.all(rollout.v[stopped] == 0.0)
    assert np.all(rollout.q[stopped] == rollout.q[-1])
    assert abs(rollout.q[-1, 0] - distance) <= speed * dt
    assert np.all(rollout.v >= 0.0)


@pytest.mark.parametrize("dt", [5e-3, 1e-2])
@pytest.mark.parametrize("scheme", SCHEMES)
def test_a_swinging_pendulum_stops_where_friction_holds_it(scheme: str, dt: float) -> None:
    robot = load(MODELS / "pendulum.urdf")
    options = RIGID_BODIES | {"joint_friction": 2.0}
    rollout = simulate(robot, q0=[1.0], integrator=scheme, dt=dt, duration=4.0, **options)
    with backend("reference", robot) as engine:
        weight = engine.gravity_torque(rollout.q)[:, 0]
    # The velocity may also be 0 after one step, where the pendulum turns.
    still = np.all((rollout.v[1:-1] == 0.0) & (rollout.v[2:] == 0.0), axis=1)
    assert np.all(np.abs(weight[1:-1][still]) <= 2.0 * (1.0 + 1e-9))
    assert still[-10:].all()
    assert np.all(rollout.q[int(np.argmax(still)) + 1 :] == rollout.q[-1])
    # The energy that is lost is the work of friction along the path.
    work = 2.0 * np.abs(np.diff(rollout.q[:, 0])).sum()
    assert abs(rollout.energy[0] - rollout.energy[-1] - work) <= 2.0 * dt


@given(models(max_links=6, locks=False, solvable=True), st.data())
def test_a_step_obeys_the_law(robot: Model, data: st.DataObject) -> None:
    """Every joint moves against its friction or is held by it, and the equation of motion holds."""
    nv, base = robot.nv, 6 if robot.floating else 0
    if nv == base:
        return
    rng = np.random.default_rng(data.draw(st.integers(0, 2**32 - 1)))
    with backend("reference", robot) as engine:
        M = engine.mass_matrix(robot.random(rng))
    if not np.linalg.eigvalsh(M)[0] > 1e-9 * np.linalg.eigvalsh(M)[-1]:
        return
    v = 10.0 ** rng.uniform(-4.0, 0.0) * rng.normal(size=nv)
    v *= rng.random(nv) < data.draw(st.sampled_from([0.0, 0.5, 1.0]))
    r = rng.normal(size=nv) * 10.0 ** rng.uniform(-2.0, 2.0)
    friction = np.concatenate([np.zeros(base), 10.0 ** rng.uniform(-3.0, 2.0, nv - base)])
    h = 10.0 ** rng.uniform(-4.0, -2.0)
    assert_law(ImplicitJoints(FrictionLaw.of(robot, friction), friction, h), M, r, v, friction, h)


def assert_law(solver: ImplicitJoints, M: Floats, r: Floats, v: Floats, friction: Floats, h: float) -> None:
    a, moves = solver.step(M, np.zeros(len(v)), r, v)
    after = moves * (v + h * a)
    force = r - M @ a
    size = np.abs(r) + np.abs(M) @ np.abs(a)
    slack = 1e-9 * size + TOLERANCE * friction
    assert np.all(np.abs(force) <= friction + slack)
    sliding = after != 0.0
    assert np.all(np.abs(force - friction * np.sign(after))[sliding] <= slack[sliding])
    # It takes energy: the power of friction at the end of the step is not negative.
    assert force @ after >= -1e-9 * size @ np.abs(after)


@pytest.mark.parametrize("base", ["fixed", "floating"])
def test_solutions_without_a_kernel_are_the_same(base: str, monkeypatch: pytest.MonkeyPatch) -> None:
    robot = mixed_robot(base)
    rng = np.random.default_rng(0)
    friction = np.concatenate([np.zeros(robot.nv - 7), rng.uniform(0.1, 3.0, 7)])
    law = FrictionLaw.of(robot, friction)
    compiled = ImplicitJoints(law, friction, 1e-3)
    monkeypatch.setattr("dynx.steppers.implicit_joints.MAX_COMPILED_OPERATIONS", 0)
    dense = ImplicitJoints(law, friction, 1e-3)
    with backend("reference", robot) as engine:
        for _ in range(50):
            M, r = engine.mass_matrix(robot.random(rng)), rng.normal(size=robot.nv)
            v = rng.normal(size=robot.nv) * (rng.random(robot.nv) < 0.5)
            bias = rng.normal(size=robot.nv)
            found, other = compiled.step(M, bias, r, v), dense.step(M, bias, r, v)
            np.testing.assert_array_equal(found[1], other[1])
            np.testing.assert_allclose(found[0], other[0], rtol=1e-9, atol=1e-6)
            np.testing.assert_allclose(compiled.torque, dense.torque, rtol=1e-7, atol=1e-9)
            np.testing.assert_allclose(compiled.net_torque, dense.net_torque, rtol=1e-7, atol=1e-9)


def test_modes_that_cycle_are_corrected_one_at_a_time(monkeypatch: pytest.MonkeyPatch) -> None:
    robot, rng = load(MODELS / "seven_axis_arm.urdf"), np.random.default_rng(1)
    n = robot.nv
    law = FrictionLaw.of(robot, np.ones(n))
    # With overestimated inertias corrections of all modes at once often cycle.
    bold = replace(law, inertia=tuple(50.0 * x for x in law.inertia))
    with backend("reference", robot) as engine:
        M = engine.mass_matrix(robot.neutral())
    cycled = 0
    for _ in range(60):
        friction, r, v = 10.0 ** rng.uniform(-2.0, 1.0, n), 10.0 * rng.normal(size=n), rng.normal(size=n)
        solver = ImplicitJoints(bold, friction, 1e-2)
        assert_law(solver, M, r, v, friction, 1e-2)
        bias = np.zeros(n)
        right = ImplicitJoints(law, friction, 1e-2).step(M, bias, r, v)
        np.testing.assert_array_equal(solver.step(M, bias, r, v), right)
        with monkeypatch.context() as patch:
            patch.setattr("dynx.steppers.implicit_joints.MAX_SOLUTIONS", BLOCK_CORRECTIONS)
            cycled += not np.array_equal(solver.step(M, bias, r, v), right)
    assert cycled


RUBBING = {
    "allegro_left_hand": 1e-3,
    "hextilt": 1e-3,
    "six_axis_arm": 1e-2,
    "tiago_no_hand": 1e-2,
    "xarm7": 1e-3,
}
"""Robots, each with the step [s] of its case."""


@pytest.mark.long_cases
@pytest.mark.parametrize("name", sorted({each.name for each in robots()} & RUBBING.keys()))
def test_nothing_oscillates_from_step_to_step(name: str) -> None:
    """A sample of the cases of `benchmarks.surveys.friction_scan`, which searches all robots."""
    for friction in ("file", "drawn"):
        finding = friction_scan.run(Case(name, RUBBING[name], friction, batch=False))
        assert finding.rattling == []
        assert finding.note == ""
        assert 0.0 < finding.stuck < 1.0


def test_friction_that_oscillates_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    """Friction smoothed far below the bound of its slip speed does, and friction that sticks does not."""
    robot, h = slider(), 1e-2
    monkeypatch.setattr("dynx.sim.simulation.refuse_small_slip", lambda *_: None)
    for slip, found in ((0.0, []), (h * F / MASS, []), (0.1 * h * F / MASS, ["rail"])):
        rollout = simulate(robot, joint_friction=F, friction_slip=slip, v0=[0.3], dt=h, duration=1.0)
        record = rollout.q[None], rollout.v[None]
        assert friction_scan.rattling_joints(robot, *record, np.zeros(1)) == found


def test_coupled_coordinates_and_mimic_joints_stick() -> None:
    for base in ("fixed", "floating"):
        robot = mixed_robot(base, mimic=True)
        rng = np.random.default_rng(2)
        start: dict[str, Any] = {"q0": robot.random(rng), "v0": rng.uniform(-1.0, 1.0, robot.nv)}
        held = simulate(
            robot, joint_friction=1e4, joint_damping=True, joint_armature=True, duration=0.05, **start
        )
        joints = slice(6 if robot.floating else 0, None)
        assert np.all(held.v[2:, joints] == 0.0)
        many = robot.with_gravity(np.zeros(3))
        free = simulate(
            many, joint_friction=True, joint_damping=True, joint_armature=True, duration=0.05, **start
        )
        assert np.any(free.v[-1] != 0.0)


@pytest.mark.parametrize("scheme", ["semi_implicit", "rk4", "engine"])
def test_a_run_is_resumed_bit_for_bit(scheme: str) -> None:
    if scheme == "engine":
        pytest.importorskip("pybullet")
    robot = load(MODELS / "six_axis_arm.urdf")
    plant = "pybullet" if scheme == "engine" else "pinocchio"
    law = PD(robot, kp=5.0, kd=0.02)
    options: dict[str, Any] = {"plant": plant, "integrator": scheme, "joint_friction": True, "duration": 0.3}
    scenario = Scenario(robot, law, np.full(6, 0.3), q0=np.full(6, 0.1), **options)
    whole = simulate(scenario)
    assert np.any(whole.v == 0.0)
    again = simulate(scenario, resume=whole.first(137))
    np.testing.assert_array_equal(again.q, whole.q)
    with Simulation(scenario) as simulation:
        for _ in range(300):
            simulation.step()
        np.testing.assert_array_equal(simulation.rollout.v, whole.v)


def test_a_slip_speed_below_its_bound_is_refused_with_numbers() -> None:
    robot = slider()
    options: dict[str, Any] = {"joint_friction": F, "dt": 1e-3, "duration": 0.01, "v0": [0.01]}
    # dt f / (M s) = 2 at this speed.
    bound = 1e-3 * F / (2.0 * MASS)
    with pytest.raises(ArgumentError, match=r"friction_slip is .* 2\.\d* at rail, and 2 is the largest"):
        simulate(robot, friction_slip=0.99 * bound, **options)
    smooth = simulate(robot, friction_slip=1.01 * bound, **options)
    assert np.all(np.abs(np.diff(np.abs(smooth.v[:, 0]))) < 0.01)
    simulate(robot, friction_slip=0.99 * bound, integrator="rk4", **options)
    simulate(robot, friction_slip=0.99 * bound, substeps=2, **options)


@pytest.mark.skipif("pybullet" not in installed_backends(), reason="PyBullet is not installed")
def test_a_motor_of_the_engine_has_no_joints_that_stick() -> None:
    robot = load(MODELS / "six_axis_arm.urdf")
    options: dict[str, Any] = {"plant": "pybullet", "joint_friction": 0.1, "duration": 0.01}
    with pytest.raises(UnsupportedFeatureError, match="friction_slip above 0"):
        simulate(robot, BulletPositionMotor(robot), robot.neutral(), **options)
    simulate(robot, BulletPositionMotor(robot), robot.neutral(), friction_slip=50.0, **options)
