"""Summaries of tracking errors are the largest, the last and the mean of what was recorded."""

from __future__ import annotations

import numpy as np
import pytest

import dynx
from dynx import control
from dynx.sim import Rollout, simulate
from dynx.sim.record.tracking_error import base_error, frame_error, joint_error


@pytest.fixture(scope="module")
def rollout() -> Rollout:
    model = dynx.load("ur5")
    start, end = np.zeros(6), np.linspace(0.01, 0.05, 6)
    motion = dynx.trajectory.quintic(start, end, 0.05)
    return simulate(model, control.PD(model, kp=100.0, kd=10.0), motion, dt=1e-3)


def test_the_error_of_joints(rollout: Rollout) -> None:
    found, error = joint_error(rollout), np.abs(rollout.error)
    row, column = np.argwhere(error == error.max())[0]
    assert found["max_error"] == error.max()
    assert found["max_error_joint"] == rollout.model.joint_names[column]
    assert found["max_error_time"] == rollout.t[row]
    assert found["rms_error"] == pytest.approx(np.sqrt(np.mean(error**2)))
    assert found["final_error"] == error[-1].max()


def test_the_error_of_a_frame(rollout: Rollout) -> None:
    frame = rollout.model.frame_names[-1]
    found = frame_error(rollout, frame)
    assert found is not None
    assert rollout.reference is not None
    engine = dynx.backend("pinocchio", rollout.model)
    actual, wanted = (engine.forward_kinematics(q, frame) for q in (rollout.q, rollout.reference.q))
    distance = np.linalg.norm(actual[:, :3, 3] - wanted[:, :3, 3], axis=1)
    assert found["position"]["max"] == pytest.approx(distance.max())
    assert found["position"]["max_time"] == rollout.t[np.argmax(distance)]
    assert found["position"]["final"] == pytest.approx(distance[-1])
    cosine = (np.einsum("nij,nij->n", actual[:, :3, :3], wanted[:, :3, :3]) - 1.0) / 2.0
    assert found["rotation"]["max"] == pytest.approx(np.arccos(cosine.min()), rel=1e-6)


def test_without_a_frame_a_base_or_a_reference_there_is_none(rollout: Rollout) -> None:
    assert frame_error(rollout, None) is None
    assert base_error(rollout) is None
    model = rollout.model
    free = simulate(model, q0=np.full(6, 0.1), dt=1e-3, duration=0.01)
    assert frame_error(free, model.frame_names[-1]) is None
    assert set(joint_error(free).values()) == {None}
