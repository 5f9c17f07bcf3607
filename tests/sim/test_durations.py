"""Every trajectory can be simulated: its duration is rounded up to the time grid, and its end is held."""

from __future__ import annotations

from functools import cache
from math import ceil

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from dynx.control import PD, DiscreteComputedTorque
from dynx.model import Model
from dynx.sim import BatchRollouts, Rollout, Scenario, Simulation, simulate, simulate_batch
from dynx.steppers.clock import Clock
from dynx.trajectory import cycloidal, s_curve
from tests.backends.robots import chain
from tests.sim.bars import tutorial_motion, tutorial_robot
from tests.trajectory.motions import Motion, motions

ARM = tutorial_robot()
FASTEST = s_curve(np.zeros(6), np.full(6, 0.02), acceleration=4.0, jerk=200.0, model=ARM)


@cache
def robot_of(nq: int) -> Model:
    """Return a chain of prismatic joints, which move without limits."""
    return chain(nq, "prismatic")


@settings(max_examples=40)
@given(motion=motions(), steps=st.floats(0.3, 40.0))
def test_every_motion_is_simulated_to_its_end_and_held_there(motion: Motion, steps: float) -> None:
    reference = motion.trajectory
    dt = reference.duration / steps
    ratio = reference.duration / dt
    assume(abs(ratio - round(ratio)) > 1e-6)
    # Nothing moves a robot on a floating base, which would diverge in steps of a second.
    gain = 0.1 if motion.model is None else 0.0
    model = (motion.model or robot_of(reference.nq)).with_gravity(np.zeros(3))
    scenario = Scenario(
        model,
        PD(model, kp=gain, kd=gain),
        reference,
        plant="compiled",
        v0=np.zeros(model.nv),
        dt=dt,
        check_reference=False,
    )
    one = simulate(scenario)
    assert len(one) == ceil(ratio)
    assert one.reference is not None
    assert np.array_equal(one.reference.q[-1], reference.end.q)
    assert not one.reference.v[-1].any()
    many = simulate_batch(scenario, rollouts=2, record_every=1)
    assert many.q_record.shape[1] == len(one)
    np.testing.assert_allclose(many.q[1], one.q[-1], rtol=1e-9, atol=1e-9)


@given(steps=st.integers(1, 10**7), dt=st.sampled_from([1e-4, 1 / 240, 1e-3, 0.002, 0.01, 1 / 3]))
def test_a_multiple_of_the_step_is_not_rounded_up(steps: int, dt: float) -> None:
    for duration in (steps * dt, np.nextafter(steps * dt, 0.0), np.nextafter(steps * dt, np.inf)):
        assert Clock.of(dt, float(duration), None, 0.0).n_steps == steps
    assert Clock.of(dt, (steps + 0.1) * dt, None, 0.0).n_steps == steps + 1


@pytest.mark.parametrize("duration", [None, FASTEST.duration, FASTEST.duration + 0.01])
def test_a_given_duration_is_rounded_up_too(duration: float | None) -> None:
    # The setpoints of this controller are a step ahead of its measurements, beyond the end of the motion.
    rollout = simulate(ARM, DiscreteComputedTorque(ARM, control_dt=1e-3), FASTEST, duration=duration)
    seconds = FASTEST.duration if duration is None else duration
    assert seconds <= rollout.t[-1] < seconds + 1e-3
    assert np.abs(rollout.error).max() < 1e-10


def test_the_record_has_the_duration_that_was_simulated() -> None:
    controller = PD(ARM, kp=100.0, kd=10.0)
    by_reference = Scenario(ARM, controller, FASTEST)
    whole = simulate(by_reference)
    assert whole.scenario == by_reference
    assert by_reference.with_defaults().duration == whole.t[-1]
    assert by_reference == Scenario(ARM, controller, FASTEST, duration=float(whole.t[-1]))
    assert by_reference != Scenario(ARM, controller, FASTEST, duration=float(whole.t[-1]) + 1e-3)
    assert Scenario(ARM, duration=0.3).with_defaults().duration == 0.3
    assert Scenario(ARM, duration=-1.0).with_defaults().duration == -1.0


def test_a_motion_between_two_steps_is_resumed() -> None:
    controller = PD(ARM, kp=100.0, kd=10.0)
    whole = simulate(ARM, controller, FASTEST)
    again = simulate(ARM, controller, FASTEST, resume=whole.first(7))
    np.testing.assert_array_equal(again.q, whole.q)
    longer = simulate(ARM, controller, FASTEST, duration=FASTEST.duration + 0.0203, resume=whole)
    assert len(longer) == ceil((FASTEST.duration + 0.0203) / 1e-3)
    np.testing.assert_array_equal(longer.q[: len(whole) + 1], whole.q)
    with Simulation(Scenario(ARM, controller, FASTEST)) as simulation:
        assert simulation.n_steps == len(whole)
        np.testing.assert_array_equal(simulation.run().q, whole.q)


def test_a_batch_of_the_fastest_motion_has_its_errors() -> None:
    controller = PD(ARM, kp=100.0, kd=10.0)
    one: Rollout = simulate(ARM, controller, FASTEST, plant="compiled")
    many: BatchRollouts = simulate_batch(ARM, controller, FASTEST, rollouts=2, record_every=1)
    assert np.abs(many.q_record[0] - one.q[1:]).max() < 1e-12
    assert np.abs(many.max_error[0] - np.abs(one.error[1:]).max(axis=0)).max() < 1e-12


def test_a_step_longer_than_the_motion() -> None:
    assert len(simulate(ARM, PD(ARM, kp=1.0, kd=1.0), tutorial_motion(), dt=3.0)) == 1
    short = cycloidal(np.zeros(6), np.full(6, 1e-3), duration=5e-3)
    assert len(simulate(ARM, PD(ARM, kp=1.0, kd=1.0), short, dt=2e-3)) == 3
