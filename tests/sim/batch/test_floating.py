"""Batches of rollouts of robots with a floating base, and of random robots of either kind."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import dynx
from dynx import ExternalForce
from dynx.control import PD, PID, Velocity
from dynx.control.base import Controller, Measurement
from dynx.errors import DivergedError
from dynx.model import Model
from dynx.rbd.integration import floating_step
from dynx.sim import Noise, Payload, simulate, simulate_batch
from dynx.spatial import so3
from dynx.spatial.scalar import Floats
from dynx.testing.strategies import models
from dynx.trajectory.base import Setpoint
from tests.examples import PROFILE
from tests.sim.bars import EXACT_ON_DYNX, apart
from tests.sim.batch.batches import assert_same, batch_and_one

few = settings(max_examples=min(PROFILE, max(12, PROFILE // 4)))
"""Every example compiles a kernel of its own."""


@pytest.fixture(scope="module")
def solo() -> Model:
    return dynx.load("solo12", base="floating")


def falling(model: Model, seed: int = 0) -> dict[str, Any]:
    """Somewhere in the air, turning, with legs that move."""
    rng = np.random.default_rng(seed)
    q0, v0 = model.neutral(), rng.uniform(-1.0, 1.0, model.nv)
    q0[:3] = rng.uniform(-1.0, 1.0, 3)
    q0[3:7] = rng.standard_normal(4)
    q0[3:7] /= np.linalg.norm(q0[3:7])
    q0[7:] = np.clip(rng.uniform(-0.3, 0.3, model.nq - 7), model.lower[7:], model.upper[7:])
    v0[3:6] *= 3.0
    return {"q0": q0, "v0": v0}


@pytest.mark.long_cases
@pytest.mark.parametrize("name", ["solo12", "a1", "talos"])
def test_a_rollout_is_that_of_simulate(name: str) -> None:
    model = dynx.load(name, base="floating")
    law = PD(model, kp=3.0, kd=0.1)
    many, one = batch_and_one(
        model, law, model.neutral(), duration=0.05, check_reference=False, **falling(model)
    )
    assert many.q_record.shape == (3, 50, model.nq)
    # The base falls and turns: its error is no difference of numbers.
    assert np.linalg.norm(one.error[-1, 3:6]) > 0.1
    assert many.worst[0] == many.max_error[0].max()


@pytest.mark.long_cases
@pytest.mark.parametrize(
    "law",
    [
        lambda m: PD(m, kp=3.0, kd=0.1),
        lambda m: PID(m, kp=3.0, ki=5.0, kd=0.1, control_dt=2e-3, limit=2.0),
        lambda m: Velocity(m, kd=0.1),
    ],
)
def test_all_options_together(solo: Model, law: Any) -> None:
    batch_and_one(
        solo,
        law(solo),
        solo.neutral(),
        duration=0.05,
        delay=3e-3,
        control_dt=2e-3,
        effort_limits=0.5,
        joint_friction=0.01,
        friction_slip=0.5,
        joint_damping=0.01,
        joint_armature=0.01,
        # Fixed to the root: its centre of mass, which takes the step, is moved.
        payload=Payload("base_link", 0.5, (0.1, 0.05, 0.0)),
        mass_scale=1.1,
        pushes=[ExternalForce("base_link", [5, 1, 2, 0.1, 0.2, 0.3], 0.02, 0.02)],
        **falling(solo),
    )


def test_each_rollout_has_a_base_gains_and_a_payload_of_its_own(solo: Model) -> None:
    starts = [falling(solo, seed) for seed in range(3)]
    masses, gains = np.array([0.0, 0.3, 0.8]), np.array([2.0, 3.0, 4.0])
    many = simulate_batch(
        solo,
        PD(solo, kp=1.0, kd=0.1),
        solo.neutral(),
        duration=0.05,
        q0=[start["q0"] for start in starts],
        v0=[start["v0"] for start in starts],
        gains={"kp": gains},
        parametric=dynx.parametric(solo, point_payload="base_link"),
        parameters=np.column_stack([masses, np.full((3, 3), 0.1)]),
        record_every=1,
        check_reference=False,
    )
    for row in range(3):
        one = simulate(
            solo,
            PD(solo, kp=gains[row], kd=0.1),
            solo.neutral(),
            plant="compiled",
            duration=0.05,
            payload=Payload("base_link", float(masses[row]), (0.1, 0.1, 0.1)),
            check_reference=False,
            **starts[row],
        )
        assert_same(many, row, one)


class Echo(Controller[None]):
    """Its torque is what it sees of the base: position, and the vector of the quaternion."""

    def __init__(self, model: Model) -> None:
        self.model = model

    def torque(self, measurement: Measurement, setpoint: Setpoint, state: None) -> tuple[Floats, None]:
        return np.concatenate([measurement.q[:6], 0.0 * measurement.v[6:]]), None


def test_noise_displaces_the_base_along_its_own_axes() -> None:
    body = dynx.load(str(Path(__file__).parents[3] / "models" / "free_body.urdf"), base="floating")
    deviation = np.array([0.1, 0.2, 0.3, 0.4, 0.5, 0.6])
    noise = Noise(deviation, 0.0, seed=5)
    start = falling(body)
    many = simulate_batch(
        body, Echo(body), body.neutral(), duration=0.02, rollouts=16, noise=noise, record_every=1, **start
    )
    displaced = np.stack([replace(noise, rollout=row).rows(body, 20)[0] for row in range(16)])
    states = np.concatenate([np.tile(start["q0"], (16, 1, 1)), many.q_record[:, :-1]], axis=1)
    for step in range(20):
        seen = body.integrate(states[:, step], displaced[:, step])
        assert apart(many.tau_record[:, step], seen[:, :6]) < EXACT_ON_DYNX


def test_the_centre_of_mass_and_the_spin_take_the_step_along_the_axes_of_the_world() -> None:
    """From no spin to half a turn in a step, by matrices and rates of change of them."""
    rng = np.random.default_rng(2)
    h, center = 1e-3, np.array([0.1, -0.2, 0.3])
    for spin in (0.0, 1e-200, 1e-9, 1e-3, 1.0, 300.0, 3000.0):
        q, v, a = rng.uniform(-1.0, 1.0, 9), rng.uniform(-1.0, 1.0, 8), rng.uniform(-5.0, 5.0, 8)
        q[3:7] /= np.linalg.norm(q[3:7])
        v[3:6] *= spin
        a[3:6] *= min(spin, 1.0)
        q_next, v_next = floating_step(q, v, a, h, center)
        R, R_next = so3.rotation_from_quat(q[3:7]), so3.rotation_from_quat(q_next[3:7])
        W = so3.skew(v[3:6])
        # p' = R v and R' = R W, so that (p + R c)'' is:
        change = R @ (a[:3] + W @ v[:3] + so3.skew(a[3:6]) @ center + W @ W @ center)
        rising = R @ (v[:3] + W @ center) + h * change
        turning = R @ (v[3:6] + h * a[3:6])
        size = 1.0 + spin
        assert np.allclose(q_next[:3] + R_next @ center, q[:3] + R @ center + h * rising, atol=1e-13 * size)
        assert np.allclose(R_next, so3.rotation_from_quat(so3.quat_exp(h * turning)) @ R, atol=1e-13)
        W_next = so3.skew(v_next[3:6])
        assert np.allclose(R_next @ (v_next[:3] + W_next @ center), rising, rtol=0, atol=1e-13 * size**2)
        assert np.allclose(R_next @ v_next[3:6], turning, rtol=0, atol=1e-13 * size)
        assert np.array_equal(v_next[6:], v[6:] + h * a[6:])
        assert np.array_equal(q_next[7:], q[7:] + h * v_next[6:])


@few
@given(models(solvable=True, max_links=4), st.integers(0, 2**32 - 1))
def test_random_robots(model: Model, seed: int) -> None:
    assume(model.nv and model.joint_names)
    rng = np.random.default_rng(seed)
    frame = str(rng.choice(model.frame_names))
    options: dict[str, Any] = {
        "duration": 0.02,
        "delay": float(rng.integers(0, 5)) * 1e-3,
        "control_dt": float(rng.integers(1, 4)) * 1e-3,
        # So that light links have no feedback of more than a step can follow.
        "joint_armature": 1.0,
        "joint_damping": 0.2,
        "joint_friction": 0.1,
        "friction_slip": 0.5,
        "mass_scale": 1.2,
        "pushes": [ExternalForce(frame, rng.uniform(-0.1, 0.1, 6), 0.005, 0.01)],
        "q0": model.random(rng),
        "v0": rng.uniform(-1.0, 1.0, model.nv),
        "check_reference": False,
    }
    law = PD(model, kp=3.0, kd=0.3)
    try:
        batch_and_one(model, law, model.random(rng), **options)
    except DivergedError:
        assume(False)
