"""Motors lag as their equation says, and encoders show whole multiples, in every executor alike."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynx.control import PID, ComputedTorque, Controller, Encoders, Measurement, MotorLag, OpenLoop
from dynx.errors import ArgumentError, DTypeError, GainError, UnsupportedFeatureError
from dynx.model import Model
from dynx.model.loading import load
from dynx.sim import Scenario, Simulation, simulate, simulate_batch
from dynx.spatial.scalar import Floats
from dynx.trajectory.base import Setpoint

ARM = load("ur10")
DT = 1e-3
GOAL = np.array([0.3, -0.4, 0.3, 0.2, 0.1, 0.1])
INNER: list[Controller[Any]] = [
    ComputedTorque(ARM, kp=100.0, kd=20.0),
    PID(ARM, kp=300.0, ki=30.0, kd=5.0, control_dt=DT),
]


class Steps(Controller[None], pure=True):
    """A torque of 1 for all joints."""

    def __init__(self, model: Model) -> None:
        self.model = model

    def torque(self, measurement: Measurement, setpoint: Setpoint, state: None) -> tuple[Any, None]:
        return np.zeros_like(measurement.v) + 1.0, None


def torques(law: Controller[Any], count: int) -> Floats:
    """Return the torques of the first control steps at rest."""
    state, found = law.initial_state(), []
    rest = Setpoint(*np.zeros((3, 6)))
    for k in range(count):
        tau, state = law.torque(Measurement(k * DT, np.zeros(6), np.zeros(6)), rest, state)
        found.append(tau)
    return np.array(found)


@given(st.floats(1e-4, 0.1), st.integers(0, 5))
def test_the_response_to_a_step_is_exponential_after_the_delay(time_constant: float, steps: int) -> None:
    law = MotorLag(Steps(ARM), control_dt=DT, time_constant=time_constant, delay=steps * DT)
    found = torques(law, 30)
    assert not found[:steps].any()
    ends = DT * np.arange(31 - steps)
    # The mean of 1 - exp(-t / T) over each step.
    integral = ends + time_constant * np.expm1(-ends / time_constant)
    np.testing.assert_allclose(found[steps:, 2], np.diff(integral) / DT, rtol=1e-9, atol=1e-12)


def test_without_lag_and_delay_nothing_changes() -> None:
    for inner in INNER:
        law = MotorLag(inner, control_dt=DT)
        options: dict[str, Any] = {"q0": np.zeros(6), "plant": "compiled", "duration": 0.05}
        np.testing.assert_array_equal(
            simulate(ARM, law, GOAL, **options).q, simulate(ARM, inner, GOAL, **options).q
        )
    waiting = MotorLag(Steps(ARM), control_dt=DT, delay=2 * DT, initial=np.arange(6.0))
    np.testing.assert_array_equal(torques(waiting, 3), [np.arange(6.0), np.arange(6.0), np.ones(6)])


@given(st.integers(0, 1000), st.sampled_from([2.0 * math.pi / 2**16, 1e-3, 0.1]))
def test_encoders_show_the_nearest_multiple_and_its_rate(seed: int, resolution: float) -> None:
    rng = np.random.default_rng(seed)
    seen: list[Measurement] = []

    class Watching(Steps):
        def torque(self, measurement: Measurement, setpoint: Setpoint, state: None) -> tuple[Any, None]:
            seen.append(measurement)
            return np.zeros(6), None

    law = Encoders(Watching(ARM), resolution=resolution, control_dt=DT)
    state, rest = law.initial_state(), Setpoint(*np.zeros((3, 6)))
    q = rng.uniform(-7.0, 7.0, 6) + rng.uniform(-0.01, 0.01, (3, 6))
    for k in range(3):
        _, state = law.torque(Measurement(k * DT, q[k], np.ones(6)), rest, state)
    shown = np.array([each.q for each in seen])
    expected = np.rint(q / resolution) * resolution
    # At a half the nearest multiple is decided by rounding.
    clear = np.abs(np.abs(q / resolution - np.rint(q / resolution)) - 0.5) > 1e-6
    np.testing.assert_allclose(shown[clear], expected[clear], rtol=0.0, atol=1e-9 * resolution)
    np.testing.assert_array_equal(seen[0].v, 0.0)
    np.testing.assert_allclose(seen[2].v, (shown[2] - shown[1]) / DT, rtol=1e-9, atol=1e-9)


def between(inner: Controller[Any]) -> list[Controller[Any]]:
    """Return the wrappers around a controller."""
    encoders = Encoders(inner, resolution=2.0 * math.pi / 2**16, control_dt=DT)
    lag = [2e-3, 0.0, 2e-3, 5e-3, 5e-3, 5e-3]
    return [encoders, MotorLag(encoders, control_dt=DT, time_constant=lag, delay=2e-3)]


@pytest.mark.parametrize("law", [law for inner in INNER for law in between(inner)], ids=lambda law: law.name)
def test_steps_batches_files_and_resumed_rollouts_are_alike(law: Controller[Any]) -> None:
    options: dict[str, Any] = {"q0": np.zeros(6), "duration": 0.1}
    whole = simulate(ARM, law, GOAL, plant="compiled", **options)
    assert whole.scenario is not None
    assert Scenario.from_json(whole.scenario.to_json()) == whole.scenario
    resumed = simulate(ARM, law, GOAL, plant="compiled", resume=whole.first(40), **options)
    np.testing.assert_array_equal(resumed.q, whole.q)
    with Simulation(whole.scenario) as simulation:
        for _ in range(100):
            simulation.step()
        np.testing.assert_array_equal(simulation.rollout.q, whole.q)
    many = simulate_batch(ARM, law, GOAL, q0=np.zeros((2, 6)), duration=0.1)
    np.testing.assert_allclose(many.q[1], whole.q[-1], rtol=0.0, atol=1e-9)


def test_a_controller_of_ones_own_and_a_floating_base() -> None:
    dog = load("solo12", base="floating")
    law = MotorLag(
        Encoders(PID(dog, kp=3.0, ki=0.1, kd=0.05, control_dt=DT), resolution=1e-4, control_dt=DT),
        control_dt=DT,
        time_constant=1e-3,
    )
    one = simulate(dog, law, dog.neutral(), plant="compiled", duration=0.05)
    many = simulate_batch(dog, law, dog.neutral(), rollouts=2, duration=0.05)
    np.testing.assert_allclose(many.q[1], one.q[-1], rtol=0.0, atol=1e-9)
    own = between(Steps(ARM))[1]
    alone = simulate(ARM, own, GOAL, q0=np.zeros(6), plant="compiled", duration=0.05)
    several = simulate_batch(ARM, own, GOAL, q0=np.zeros((2, 6)), duration=0.05)
    np.testing.assert_allclose(several.q[0], alone.q[-1], rtol=0.0, atol=1e-9)


def test_arguments_that_no_motor_or_encoder_has() -> None:
    inner = INNER[0]
    with pytest.raises(GainError, match="time_constant is negative"):
        MotorLag(inner, control_dt=DT, time_constant=-1.0)
    with pytest.raises(
        ArgumentError, match=r"delay is 0\.0015 s; wanted a multiple of control_dt = 0\.001 s"
    ):
        MotorLag(inner, control_dt=DT, delay=1.5e-3)
    with pytest.raises(ArgumentError, match=r"wanted 0 to 10 s \(10000 control steps\)"):
        MotorLag(inner, control_dt=DT, delay=-1e-3)
    with pytest.raises(ArgumentError, match="wanted 6 finite torques"):
        MotorLag(inner, control_dt=DT, initial=[1.0])
    with pytest.raises(DTypeError, match="initial has dtype complex128; wanted real numbers"):
        MotorLag(inner, control_dt=DT, initial=[1j] * 6)
    with pytest.raises(GainError, match=r"resolution is negative \(-1\); wanted 0 or more"):
        Encoders(inner, resolution=-1.0, control_dt=DT)
    with pytest.raises(ArgumentError, match="resolution is 0; wanted"):
        Encoders(inner, resolution=0.0, control_dt=DT)
    with pytest.raises(ArgumentError, match=r"control_dt is 0\.002 s, but PID .*has steps of 0\.001 s"):
        Encoders(INNER[1], resolution=1e-3, control_dt=2e-3)
    with pytest.raises(ArgumentError, match="the inner controller is of type Model"):
        MotorLag(ARM, control_dt=DT)  # type: ignore[arg-type]  # the mistake that is tested
    with pytest.raises(ArgumentError):
        simulate(ARM, MotorLag(inner, control_dt=2e-3), GOAL, duration=0.01)

    class Odd(Steps):
        def initial_state(self) -> Any:
            return {"a": 1}

    with pytest.raises(UnsupportedFeatureError, match="Odd has a state of type dict; MotorLag takes"):
        MotorLag(Odd(ARM), control_dt=DT)
    table = OpenLoop(ARM, np.ones((3, 6)), control_dt=DT)
    assert MotorLag(table, control_dt=DT).control_dt == DT
