"""Laws about a frame, many rollouts at once."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import dynx
from dynx import trajectory
from dynx.control import Impedance, OperationalSpace, Saturated
from dynx.control.base import Controller
from dynx.model import Model
from dynx.sim import simulate, simulate_batch
from tests.sim.bars import apart
from tests.sim.batch.batches import assert_same, batch_and_one

LAWS: dict[str, Any] = {
    "operational": lambda m, f: OperationalSpace(m, f, kp=400, kd=40, posture_kp=50.0),
    "impedance": lambda m, f: Impedance(
        m, f, stiffness=[500, 500, 500, 50, 50, 50], damping=[50, 50, 50, 5, 5, 5], joint_damping=0.5
    ),
    "saturated": lambda m, f: Saturated(OperationalSpace(m, f, kp=400, kd=40), limit=40.0),
}
ROBOTS = {
    "ur5": ("tool0", [0.3, -1.2, 1.0, 0.2, 0.4, 0.1]),
    "panda": ("panda_hand", [0.1, -0.4, 0.2, -1.8, 0.1, 1.6]),
}


def posture(model: Model, joints: list[float]) -> np.ndarray[Any, np.dtype[np.float64]]:
    q = model.neutral()
    q[: len(joints)] = joints
    return model.clip(q)


@pytest.mark.parametrize("name", ROBOTS)
@pytest.mark.parametrize("law", LAWS)
def test_a_rollout_is_that_of_simulate(name: str, law: str) -> None:
    model = dynx.load(name)
    frame, joints = ROBOTS[name]
    q = posture(model, joints)
    motion = trajectory.cycloidal(q, model.clip(q + 0.1), duration=0.5)
    start = model.clip(q + 0.05)
    batch_and_one(model, LAWS[law](model, frame), motion, q0=start, delay=1e-3, duration=0.05)


def test_gains_of_each_rollout() -> None:
    model = dynx.load("ur5")
    frame, joints = ROBOTS["ur5"]
    q = posture(model, joints)
    rng = np.random.default_rng(1)
    options: dict[str, Any] = {"q0": q + 0.05, "duration": 0.05}

    def one_by_one(law: Controller[Any], gains: dict[str, Any], make: Any) -> None:
        many = simulate_batch(model, law, q, gains=gains, record_every=1, **options)
        assert apart(many.q[0], many.q[1]) > 1e-6
        for row in range(2):
            own = make(**{name: values[row] for name, values in gains.items()})
            assert_same(many, row, simulate(model, own, q, plant="compiled", **options))

    one_by_one(
        OperationalSpace(model, frame, kp=1.0, kd=1.0),
        {
            "kp": rng.uniform(100, 400, (2, 6)),
            "kd": rng.uniform(20, 40, 2),
            "posture_kp": rng.uniform(0, 50, (2, 6)),
        },
        lambda **own: OperationalSpace(model, frame, **own),
    )
    one_by_one(
        Impedance(model, frame, stiffness=1.0, damping=1.0),
        {"stiffness": rng.uniform(50, 500, (2, 6)), "damping": rng.uniform(5, 50, (2, 6))},
        lambda **own: Impedance(model, frame, **own),
    )


def test_turned_by_half_a_turn() -> None:
    """Where the largest component of the error's quaternion is another one, and its sign changes."""
    model = dynx.load("ur5")
    frame, joints = ROBOTS["ur5"]
    q = posture(model, joints)
    law = Impedance(model, frame, stiffness=[0, 0, 0, 5, 5, 5], damping=1.0)
    for joint, angle in [(5, 3.1), (5, -3.1), (5, 3.2), (4, 3.0), (0, 3.0), (3, 1.0), (0, 2.0), (5, 0.0)]:
        away = q.copy()
        away[joint] += angle
        batch_and_one(model, law, q, q0=away, duration=0.005, check_reference=False)


@pytest.mark.parametrize("law", ["operational", "impedance"])
def test_a_frame_that_never_rotates(law: str) -> None:
    """Its rotation is constant in the trace."""
    model = dynx.load("cart_pole")
    q = model.neutral()
    batch_and_one(model, LAWS[law](model, "cart"), q, q0=q + 0.1, duration=0.005, check_reference=False)


@pytest.mark.parametrize("law", ["operational", "impedance"])
def test_a_fixed_body_has_no_coordinates_to_move(law: str) -> None:
    model = dynx.load("free_body")
    many = simulate_batch(model, LAWS[law](model, "mark"), np.zeros(0), rollouts=2, duration=0.005)
    assert many.done.all()
    assert many.q.shape == (2, 0)
