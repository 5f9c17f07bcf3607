"""Each law gives the torque that its formula says, whoever asked before and whichever engine answers."""

from __future__ import annotations

import pickle
from typing import Any

import mpmath
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynx.backends import backend, installed_backends
from dynx.control import (
    PD,
    PID,
    ComputedTorque,
    Controller,
    DiscreteComputedTorque,
    FeedForward,
    FrictionCompensation,
    GravityCompensatedPD,
    Impedance,
    Measurement,
    OpenLoop,
    OperationalSpace,
    Saturated,
    Velocity,
)
from dynx.control.computed_torque import commanded_acceleration, one_step_acceleration
from dynx.control.joint_space import pd_torque
from dynx.errors import ArgumentError, ShapeError
from dynx.model.loading import load
from dynx.trajectory.base import Setpoint

ARM = load("ur5")
ENGINE = backend("pinocchio", ARM)
BACKWARD = 1e-11
"""Acceleration that comes back from inverse and forward dynamics, relative: some hundred roundings, times
the condition number of this arm's mass matrix (about 1e3)."""
SEEDS = st.integers(0, 2**32 - 1)


def situation(seed: int) -> tuple[Measurement, Setpoint]:
    """Return a random state and a random setpoint."""
    rng = np.random.default_rng(seed)
    q, wanted = ARM.random(rng, 2)
    v, v_wanted, a_wanted = rng.uniform(-2.0, 2.0, (3, ARM.nv))
    return Measurement(float(rng.uniform(0, 1)), q, v), Setpoint(wanted, v_wanted, a_wanted)


def torque(law: Controller[Any], measurement: Measurement, setpoint: Setpoint) -> Any:
    return law.torque(measurement, setpoint, law.initial_state())[0]


GAINS = np.array([400.0, 300.0, 200.0, 100.0, 50.0, 25.0])
LAWS: dict[str, Controller[Any]] = {
    "pd": PD(ARM, kp=GAINS, kd=10.0),
    "pid": PID(ARM, kp=GAINS, ki=5.0, kd=10.0, control_dt=1e-3),
    "velocity": Velocity(ARM, kd=10.0),
    "gravity": GravityCompensatedPD(ARM, kp=GAINS, kd=10.0),
    "feed-forward": FeedForward(ARM, kp=GAINS, kd=10.0),
    "computed": ComputedTorque(ARM, kp=GAINS, kd=10.0),
    "discrete": DiscreteComputedTorque(ARM, control_dt=1e-3),
    "operational": OperationalSpace(ARM, "tool0", kp=100.0, kd=20.0, posture_kp=9.0, posture_kd=6.0),
    "impedance": Impedance(ARM, "tool0", stiffness=500.0, damping=30.0, joint_damping=1.0),
    "friction": FrictionCompensation(PD(ARM, kp=GAINS, kd=1.0), damping=1.0, friction=0.3),
    "saturated": Saturated(PD(ARM, kp=GAINS, kd=1.0), limit=[5.0, 4.0, 3.0, 2.0, 1.0, np.inf]),
}


@given(SEEDS)
def test_formulas(seed: int) -> None:
    measurement, setpoint = situation(seed)
    e, de = setpoint.q - measurement.q, setpoint.v - measurement.v
    pd = GAINS * e + 10.0 * de
    np.testing.assert_array_equal(torque(LAWS["pd"], measurement, setpoint), pd)
    np.testing.assert_array_equal(torque(LAWS["velocity"], measurement, setpoint), 10.0 * de)
    weight = ENGINE.gravity_torque(measurement.q)
    np.testing.assert_array_equal(torque(LAWS["gravity"], measurement, setpoint), weight + pd)
    ahead = ENGINE.inverse_dynamics(*setpoint)
    np.testing.assert_array_equal(torque(LAWS["feed-forward"], measurement, setpoint), ahead + pd)


@given(SEEDS)
def test_computed_torque_gives_the_acceleration_it_commands(seed: int) -> None:
    measurement, setpoint = situation(seed)
    wanted = setpoint.a + 10.0 * (setpoint.v - measurement.v) + GAINS * (setpoint.q - measurement.q)
    tau = torque(LAWS["computed"], measurement, setpoint)
    a = ENGINE.forward_dynamics(measurement.q, measurement.v, tau)
    np.testing.assert_allclose(a, wanted, rtol=0.0, atol=BACKWARD * np.abs(wanted).max())


@given(SEEDS)
def test_the_discrete_law_lands_on_its_setpoint(seed: int) -> None:
    measurement, setpoint = situation(seed)
    a = one_step_acceleration(measurement.q, measurement.v, setpoint.q, np.full(6, 1e-3))
    landed = measurement.q + 1e-3 * (measurement.v + 1e-3 * a)
    np.testing.assert_allclose(landed, setpoint.q, rtol=0.0, atol=1e-14)
    tau = torque(LAWS["discrete"], measurement, setpoint)
    np.testing.assert_array_equal(tau, ENGINE.inverse_dynamics(measurement.q, measurement.v, a))
    assert LAWS["discrete"].lead == 1


@pytest.mark.parametrize("name", LAWS)
@given(SEEDS)
def test_the_same_question_has_the_same_answer(name: str, seed: int) -> None:
    law = LAWS[name]
    one, other = situation(seed), situation(seed + 1)
    first = torque(law, *one)
    assert first.shape == (6,)
    assert first.dtype == np.float64
    kept = first.copy()
    torque(law, *other)
    np.testing.assert_array_equal(torque(law, *one), kept)
    np.testing.assert_array_equal(first, kept)


@pytest.mark.parametrize("name", LAWS)
def test_laws_pickle(name: str) -> None:
    measurement, setpoint = situation(7)
    again = pickle.loads(pickle.dumps(LAWS[name]))
    np.testing.assert_array_equal(
        torque(again, measurement, setpoint), torque(LAWS[name], measurement, setpoint)
    )
    assert again.name == LAWS[name].name


@pytest.mark.parametrize("engine", installed_backends())
def test_any_engine_may_answer(engine: str) -> None:
    measurement, setpoint = situation(3)
    for law in LAWS.values():
        other = law.on(engine)
        assert other.lead == law.lead
        expected = torque(law, measurement, setpoint)
        # Bars of agreement between engines are elsewhere; this is another order of magnitude altogether.
        np.testing.assert_allclose(torque(other, measurement, setpoint), expected, rtol=1e-9, atol=1e-9)


def test_a_backend_of_another_robot_is_refused() -> None:
    with pytest.raises(ArgumentError, match="the backend is for"):
        ComputedTorque(load("panda"), kp=1.0, kd=1.0, backend=ENGINE)


def test_a_table_of_torques() -> None:
    table = np.arange(18.0).reshape(3, 6)
    law = OpenLoop(ARM, table, control_dt=2e-3)
    _, setpoint = situation(0)
    rows = [torque(law, Measurement(k * 2e-3, np.zeros(6), np.zeros(6)), setpoint) for k in range(4)]
    np.testing.assert_array_equal(rows, [*table, np.zeros(6)])
    with pytest.raises(ShapeError):
        OpenLoop(ARM, np.zeros(6), control_dt=1e-3)
    with pytest.raises(ArgumentError, match="control_dt"):
        OpenLoop(ARM, table, control_dt=0.0)


def test_array_code_of_the_laws_takes_any_scalar() -> None:
    """The very same text on numbers of 50 digits, as it will be on traced symbols."""
    rng = np.random.default_rng(0)
    arrays = rng.uniform(-1.0, 1.0, (7, 6))
    with mpmath.workdps(50):
        exact = np.array([[mpmath.mpf(x) for x in row] for row in arrays.tolist()])
        for function, count in ((commanded_acceleration, 7), (pd_torque, 6), (one_step_acceleration, 4)):
            rounded = function(*arrays[:count])
            wanted = np.array(function(*exact[:count]), dtype=float)
            scale = np.abs(wanted).max() + (1.0 / arrays[3] ** 2).max() * (count == 4)
            np.testing.assert_allclose(rounded, wanted, rtol=0.0, atol=8 * np.finfo(float).eps * scale)
