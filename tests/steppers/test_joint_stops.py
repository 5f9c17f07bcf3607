"""Position limits as stops: the impact of several joints, and steps in which there is none."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from dynx.backends import backend, installed_backends
from dynx.control import PD
from dynx.errors import DivergedError
from dynx.model import Limits, Model
from dynx.model.limited_positions import rotation_angle
from dynx.model.loading import load
from dynx.sim import Rollout, Scenario, Simulation, simulate, simulate_batch
from dynx.spatial.scalar import Floats
from dynx.steppers.joint_stops import JointStops, held_at_limits
from dynx.steppers.layout import stop_positions
from dynx.testing.strategies import models
from dynx.world import Scene, SceneRobot, World
from tests.sim.bars import tutorial_robot
from tests.sim.test_ball_joints import arm
from tests.sim.test_compiled_loop import both
from tests.sim.test_resume import the_same
from tests.world.engines import WORLDS

ARM = tutorial_robot()
NUMBERS = st.floats(-4.0, 4.0)
MASS = backend("reference", ARM)
LARGEST_ANGLE = 0.8
SHOULDER = arm(limits=Limits(upper=LARGEST_ANGLE))
SHOULDER_MASS = backend("reference", SHOULDER)


def stopped(before: Floats, q: Floats, v: Floats) -> tuple[Floats, Floats] | None:
    """Return the state of the arm after its stops, in a step from `before`."""
    return JointStops(ARM, MASS.mass_matrix)(before, q, v)


@given(
    st.lists(st.sampled_from([-1, 0, 1]), min_size=6, max_size=6),
    st.lists(st.floats(-5.0, 5.0), min_size=6, max_size=6),
    st.integers(0, 99),
)
def test_an_impact_obeys_the_laws_of_inelastic_stops(
    sides: list[int], speeds: list[float], seed: int
) -> None:
    """Velocity at a stop and its impulse are complementary: both inward, and one of them zero."""
    v = np.array(speeds)
    q = ARM.random(seed)
    span, at = ARM.upper - ARM.lower, np.array(sides)
    held = np.where(at > 0, ARM.upper, np.where(at < 0, ARM.lower, q))
    found = stopped(held, held + 0.01 * at * span, v)
    if not at.any():
        assert found is None
        return
    assert found is not None
    np.testing.assert_array_equal(found[0], held)
    after = found[1]
    impulse = MASS.mass_matrix(held) @ (after - v)
    scale = 1e-9 * (1.0 + np.abs(v).max()) * np.abs(MASS.mass_matrix(held)).max()
    struck = (at != 0) & (at * v > 0.0)
    assert np.abs(impulse[~struck]).max(initial=0.0) <= scale
    assert (at[struck] * impulse[struck] <= scale).all()
    assert np.abs(impulse * after)[struck].max(initial=0.0) <= scale * (1.0 + np.abs(after).max())
    energy = (w @ MASS.mass_matrix(held) @ w for w in (v, after))
    assert next(energy) >= next(energy) - scale


def test_steps_without_a_joint_at_its_limit_need_no_mass_matrix() -> None:
    def refused(q: Floats) -> Floats:
        raise AssertionError("the mass matrix was computed")

    stops = JointStops(ARM, refused)
    inside = 0.5 * (ARM.lower + ARM.upper)
    assert stops(inside, inside, np.ones(6)) is None
    assert stops(inside, ARM.upper, np.ones(6)) is None
    # A joint that passes its limit and moves back already is set to the limit without an impulse.
    beyond = ARM.upper + 0.1
    found = stops(inside, beyond, -np.ones(6))
    assert found is not None
    np.testing.assert_array_equal(found[0], ARM.upper)
    # A joint that begins beyond its limit is left alone at rest and on its way back.
    assert stops(beyond, beyond, np.ones(6)) is None
    assert stops(beyond, beyond - 0.01, -np.ones(6)) is None


@given(st.data())
def test_stops_move_no_joint_further_out_and_take_energy(data: st.DataObject) -> None:
    """Also of joints that begin beyond their limits, of mimic joints and on floating bases."""
    model = data.draw(models(min_links=2, max_links=5, solvable=True))
    rng = np.random.default_rng(data.draw(st.integers(0, 99)))
    base = slice(7 if model.floating else 0, None)
    before, v = model.random(rng), 3.0 * rng.standard_normal(model.nv)
    before[base] += rng.choice([0.0, 0.0, 0.5, -0.5], size=len(before[base]))
    q = model.integrate(before, 0.1 * v)
    with backend("reference", model) as engine:
        found = JointStops(model, engine.mass_matrix)(before, q, v)
        lower, upper = stop_positions(model)
        low, high = np.minimum(lower, before[base]), np.maximum(upper, before[base])
        passed = (q[base] < low) | (q[base] > high)
        assert (found is None) == (not passed.any())
        if found is None:
            return
        held, after = found
        assert ((held[base] >= low) & (held[base] <= high)).all()
        np.testing.assert_array_equal(held[base][~passed], q[base][~passed])
        np.testing.assert_array_equal(held[: base.start], q[: base.start])
        M = engine.mass_matrix(held)
        energy = [0.5 * w @ M @ w for w in (v, after)]
        assert energy[1] <= energy[0] * (1.0 + 1e-12)
        outward = np.sign(q[base] - held[base]) * after[6 if model.floating else 0 :]
        assert (outward <= 0.0).all()


@given(st.floats(0.01, 1.5), st.floats(0.01, 1.5), st.integers(0, 999))
def test_a_ball_joint_stops_at_its_largest_angle_or_where_it_began(
    begin: float, end: float, seed: int
) -> None:
    """The impulse is about the axis of the rotation alone, and leaves no outward velocity about it."""
    model, rng = SHOULDER, np.random.default_rng(seed)
    at, in_v = model.position_index("shoulder"), model.coordinate_index("shoulder")
    axis = rng.standard_normal(3)
    axis /= np.linalg.norm(axis)
    before, v = model.random(rng), rng.standard_normal(model.nv)
    q = before.copy()
    for state, angle in ((before, begin), (q, end)):
        quat = np.array([*(np.sin(0.5 * angle) * axis), np.cos(0.5 * angle)])
        state[at : at + 4] = rng.choice([-1.0, 1.0]) * quat
    most = max(LARGEST_ANGLE, begin)
    assume(abs(end - most) > 1e-9)
    found = JointStops(model, SHOULDER_MASS.mass_matrix)(before, q, v)
    assert (found is None) == (end < most)
    if found is None:
        return
    held, after = found
    stopped = held[at : at + 4]
    assert rotation_angle(stopped) == pytest.approx(most, rel=1e-14)
    np.testing.assert_allclose(np.sign(stopped[3]) * stopped[:3], np.sin(0.5 * most) * axis, atol=1e-14)
    np.testing.assert_array_equal(np.delete(held, range(at, at + 4)), np.delete(q, range(at, at + 4)))
    outward = float(axis @ v[in_v : in_v + 3])
    if outward <= 0.0:
        np.testing.assert_array_equal(after, v)
        return
    M = SHOULDER_MASS.mass_matrix(held)
    impulse = M @ (after - v)
    scale = 1e-12 * np.abs(M).max() * np.abs(v).max()
    assert abs(axis @ after[in_v : in_v + 3]) <= 1e-12 * np.abs(v).max()
    along = float(axis @ impulse[in_v : in_v + 3])
    assert along < 0.0
    impulse[in_v : in_v + 3] -= along * axis
    assert np.abs(impulse).max() <= scale


def test_a_pendulum_loses_its_energy_at_its_stop_and_a_chain_shares_the_impulse() -> None:
    """The inelastic impact of one joint leaves M^-1 e p / (e' M^-1 e) of the momentum to the others."""
    rod = load("pendulum")
    pendulum = replace(
        rod, joints=tuple(replace(each, limits=replace(each.limits, lower=0.5)) for each in rod.joints)
    )
    free: dict[str, Any] = {"joint_damping": False, "joint_friction": False, "joint_armature": False}
    rollout = simulate(pendulum, q0=[1.0], duration=1.0, joint_limits=True, **free)
    hit = int(np.argmax(rollout.q[:, 0] == 0.5))
    assert not rollout.v[hit:].any()
    assert (rollout.q[hit:] == 0.5).all()
    # What gravity did until then is lost, up to the error of the integrator.
    lost = rollout.energy[0] - rollout.energy[-1]
    assert rollout.kinetic_energy[hit - 1] == pytest.approx(lost, rel=0.02)
    chain = load("planar_2r")
    with backend("reference", chain) as engine:
        q, v = np.array([0.4, 0.0]), np.array([1.0, 2.0])
        limited = replace(
            chain,
            joints=tuple(
                replace(each, limits=replace(each.limits, upper=0.9)) if k == 1 else each
                for k, each in enumerate(chain.joints)
            ),
        )
        found = JointStops(limited, engine.mass_matrix)(q, np.array([0.4, 1.0]), v)
        assert found is not None
        (first, second), M = found[1], engine.mass_matrix(found[0])
        # The momentum of the first coordinate is conserved: the impulse acts on the second joint alone.
        assert second == 0.0
        assert M[0, 0] * first == pytest.approx(M[0] @ v, rel=1e-13)
        lost = 0.5 * (v @ M @ v - found[1] @ M @ found[1])
        effective = 1.0 / np.linalg.inv(M)[1, 1]
        assert lost == pytest.approx(0.5 * effective * v[1] ** 2, rel=1e-13)


@pytest.mark.parametrize("plant", ["compiled", "pinocchio", "pybullet", "mujoco", "drake"])
def test_a_start_beyond_the_limits_is_left_alone(plant: str) -> None:
    """At rest without load nothing moves; under gravity a joint moves no further out, and back in."""
    if plant not in installed_backends():
        pytest.skip(f"{plant} is not installed")
    engine = "engine" if plant in ("mujoco", "drake") else None
    options: dict[str, Any] = {"plant": plant, "integrator": engine, "joint_limits": True, "duration": 0.3}
    beyond = ARM.upper + 0.1
    still = simulate(ARM.with_gravity((0.0, 0.0, 0.0)), q0=beyond, **options)
    np.testing.assert_allclose(still.q, np.broadcast_to(beyond, still.q.shape), rtol=0.0, atol=1e-15)
    loaded = simulate(ARM, q0=beyond, **options)
    assert (loaded.q <= beyond).all()
    assert (np.abs(loaded.q[-1] - beyond) > 0.01).any()
    held = (loaded.q[1:] == beyond).any(axis=0)
    assert held.any()
    assert (loaded.energy <= loaded.energy[0] + 1e-2 * np.abs(loaded.energy[0])).all()


@pytest.mark.parametrize(
    "options",
    [
        {},
        {"integrator": "rk4", "duration": 0.3},
        {"control_dt": 3e-3, "delay": 2e-3},
        {"plant": "compiled"},
    ],
)
def test_stops_in_compiled_stages_are_those_of_the_plain_loop(options: dict[str, Any]) -> None:
    """Two joints are driven against their limits and stay there."""
    q0 = 0.5 * (ARM.lower + ARM.upper)
    beyond = q0.copy()
    beyond[2], beyond[4] = ARM.upper[2] + 0.5, ARM.lower[4] - 0.5
    start = ARM.clip(beyond) + np.where(beyond > q0, -0.02, np.where(beyond < q0, 0.02, 0.0))
    options = {"duration": 0.1, **options}
    law = PD(ARM, kp=100, kd=10)
    both(ARM, law, beyond, q0=start, joint_limits=True, check_reference=False, **options)
    rollout = simulate(ARM, law, beyond, q0=start, joint_limits=True, check_reference=False, **options)
    assert (rollout.q[-1] == ARM.clip(beyond))[[2, 4]].all()
    assert np.all((rollout.q <= ARM.upper) & (rollout.q >= ARM.lower))


@pytest.mark.parametrize("robot", ["panda", "solo12"])
def test_mimic_joints_and_floating_bases_stop_alike_in_both_loops(robot: str) -> None:
    model: Model = load(robot, base="floating" if robot == "solo12" else "fixed")
    v0 = np.zeros(model.nv)
    v0[-3:] = 40.0

    def run(plant: str) -> Rollout:
        return simulate(model, v0=v0, duration=0.3, joint_limits=True, plant=plant)

    pieces = run("pinocchio")
    assert pieces.executor == "compiled pieces"
    joints = slice(7 if model.floating else 0, None)
    reached = (pieces.q == model.upper) | (pieces.q == model.lower)
    assert reached[:, joints].any()
    resumed = simulate(model, v0=v0, duration=0.3, joint_limits=True, resume=pieces, step=40)
    the_same(pieces, resumed)


@pytest.mark.parametrize("plant", ["compiled", "reference"])
def test_a_stop_hides_no_divergence(plant: str) -> None:
    """A velocity beyond all meaning ends the simulation, also where a stop would have taken it away."""
    scenario = Scenario(ARM, plant=plant, q0=ARM.clip(ARM.upper), joint_limits=True)
    with Simulation(scenario) as simulation:
        simulation.step()
        with pytest.raises(DivergedError) as caught:
            simulation.step(tau=np.array([1e15, 0.0, 0.0, 0.0, 0.0, 0.0]))
    assert caught.value.step == 1


@given(st.lists(st.tuples(NUMBERS, NUMBERS, NUMBERS), min_size=1, max_size=5))
def test_joints_beyond_their_bounds_are_struck_only_outwards(states: list[tuple[float, ...]]) -> None:
    starts, joints, speeds = np.array(states).T
    limits = np.full(len(joints), -1.0), np.full(len(joints), 2.0)
    held, impacts = held_at_limits(starts, joints, speeds, *limits)
    for start, q, v, at, impact in zip(starts, joints, speeds, held, impacts, strict=True):
        low, high = min(start, -1.0), max(start, 2.0)
        assert at == min(max(q, low), high)
        assert impact == (1.0 if q > high and v > 0.0 else -1.0 if q < low and v < 0.0 else 0.0)


LIMITS_LEFT_OUT = """<robot name="r"><link name="a"/>
<link name="b"><inertial><origin xyz="0.1 0 -0.5"/><mass value="2"/>
<inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="j" type="revolute"><parent link="a"/><child link="b"/><axis xyz="0 1 0"/>
<limit effort="100" velocity="10"/></joint></robot>"""
"""A joint without a range: URDF reads limits that are left out as 0 and 0."""


@pytest.mark.parametrize("engine", ["dynx", *WORLDS])
def test_a_world_holds_a_joint_without_a_range_and_says_so(engine: str) -> None:
    scene = Scene("s", robots=(SceneRobot("arm", load(LIMITS_LEFT_OUT)),))
    moved = {}
    for limits in (True, False):
        with World(scene, engine, joint_limits=limits) as world:
            said = "limits without a range hold 'arm/j'; joint_limits=False switches them off"
            assert world.notes == ((said,) if limits else ())
            world.step(300)
            moved[limits] = abs(world.state.robots["arm"].q[0])
    assert moved[True] < 0.01 < 0.1 < moved[False]


def test_a_simulation_holds_a_joint_without_a_range_and_says_so() -> None:
    model = load(LIMITS_LEFT_OUT)
    held, free = (simulate(model, duration=0.3, joint_limits=limits) for limits in (True, False))
    assert not held.q.any()
    assert abs(free.q[-1, 0]) > 0.1
    assert held.notes == ("limits without a range hold 'j'; joint_limits=False switches them off",)
    assert free.notes == ()
    law = PD(model, kp=1.0, kd=0.1)
    assert not simulate_batch(model, law, [0.0], q0=[[0.0], [0.0]], duration=0.3).q.any()
