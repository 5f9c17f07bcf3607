"""Position limits as stops: the impact of several joints, and steps in which there is none."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynx.backends import backend
from dynx.control import PD
from dynx.errors import DivergedError
from dynx.model import Model
from dynx.model.loading import load
from dynx.sim import Rollout, Scenario, Simulation, simulate
from dynx.spatial.scalar import Floats
from dynx.steppers.joint_stops import JointStops, held_at_limits
from tests.sim.bars import tutorial_robot
from tests.sim.test_compiled_loop import both
from tests.sim.test_resume import the_same

ARM = tutorial_robot()
NUMBERS = st.floats(-4.0, 4.0)
MASS = backend("reference", ARM)


def stopped(q: Floats, v: Floats) -> tuple[Floats, Floats] | None:
    """Return the state of the arm after its stops."""
    return JointStops(ARM, MASS.mass_matrix)(q, v)


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
    found = stopped(held + 0.01 * at * span, v)
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
    assert stops(inside, np.ones(6)) is None
    assert stops(ARM.upper, np.ones(6)) is None
    # A joint beyond its limit that moves back is set to the limit without an impulse.
    beyond = ARM.upper + 0.1
    found = stops(beyond, -np.ones(6))
    assert found is not None
    np.testing.assert_array_equal(found[0], ARM.upper)


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


@given(st.lists(st.tuples(NUMBERS, NUMBERS), min_size=1, max_size=5))
def test_joints_beyond_limits_are_struck_only_outwards(states: list[tuple[float, float]]) -> None:
    joints, speeds = np.array(states).T
    held, impacts = held_at_limits(joints, speeds, np.full(len(joints), -1.0), np.full(len(joints), 2.0))
    for q, v, at, impact in zip(joints, speeds, held, impacts, strict=True):
        assert at == min(max(q, -1.0), 2.0)
        assert impact == (1.0 if q > 2.0 and v > 0.0 else -1.0 if q < -1.0 and v < 0.0 else 0.0)
