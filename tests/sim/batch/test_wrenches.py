"""Wrenches at joints of the rollouts of a batch are those of the same rollouts alone."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest

import dynx
from dynx import BatchRollouts, ExternalForce, Payload
from dynx.control import PD
from dynx.errors import ArgumentError, UnknownNameError
from dynx.files.arrays import read_arrays, write_arrays
from dynx.sim import simulate, simulate_batch

PUSHES = (
    ExternalForce("tool0", (20.0, 0.0, 5.0, 1.0, 2.0, 3.0), 0.0055, 0.01, "local", (0.0, 0.0, 0.1)),
    ExternalForce("tool0", (0.0, 3.0, 0.0, 0.0, 0.0, 0.0)),
    ExternalForce("wrist_1_link", (3.0, 0.0, 0.0, 0.0, 2.0, 0.0), 0.0, 0.03, "world"),
)


@pytest.mark.long_cases
@pytest.mark.parametrize("base", ["fixed", "floating"])
@pytest.mark.parametrize(
    "options",
    [{}, {"frame": "tool0"}, {"frame": "tool0", "reference": "world"}],
    ids=["own", "tool", "world"],
)
def test_a_batch_is_its_rollouts(base: Literal["fixed", "floating"], options: dict[str, Any]) -> None:
    arm = dynx.load("ur5", base=base)
    rng = np.random.default_rng(0)
    starts = arm.random(rng, 3)
    law = PD(arm, kp=50.0, kd=2.0)
    given: dict[str, Any] = {
        "duration": 0.02,
        "pushes": PUSHES,
        "payload": Payload("tool0", 1.0, (0.0, 0.1, 0.0)),
        "joint_damping": True,
    }
    many = simulate_batch(arm, law, arm.neutral(), q0=starts, record_every=1, **given)
    joints, bases = many.joint_wrenches(**options), many.base_wrench(**options)
    n_joints = len(arm.joints) + 1
    assert joints.shape == (3, 19, n_joints, 6)
    for k, q0 in enumerate(starts):
        alone = simulate(arm, law, arm.neutral(), q0=q0, plant="compiled", **given)
        wanted = alone.joint_wrenches(**options)
        bar = 1e-8 * np.abs(wanted).max()
        np.testing.assert_allclose(joints[k], wanted[1:], rtol=0, atol=bar)
        np.testing.assert_allclose(bases[k], alone.base_wrench(**options)[1:], rtol=0, atol=bar)


def test_rollouts_with_parameters_of_their_own_need_their_robots(tmp_path: Path) -> None:
    arm = dynx.load("ur5")
    law = PD(arm, kp=50.0, kd=2.0)
    family = dynx.parametric(arm, links=["forearm_link"])
    factors = np.array([[1.0], [2.0]]) * family.parameters.defaults
    given: dict[str, Any] = {"q0": arm.neutral(), "duration": 0.01, "record_every": 1}
    many = simulate_batch(arm, law, arm.neutral(), parametric=family, parameters=factors, **given)
    robots = [family.parameters.model_of(row) for row in factors]
    found = many.joint_wrenches(models=robots)
    for k, robot in enumerate(robots):
        options: dict[str, Any] = {"q0": arm.neutral(), "duration": 0.01, "plant": "compiled"}
        alone = simulate(robot, law, arm.neutral(), **options).joint_wrenches()
        np.testing.assert_allclose(found[k], alone[1:], rtol=0, atol=1e-8 * np.abs(alone).max())
    assert np.abs(found[0] - found[1]).max() > 0.1
    many.save(tmp_path / "many.npz")
    again = BatchRollouts.load(tmp_path / "many.npz")
    for each in (many, again):
        with pytest.raises(ArgumentError, match="have parameters of their own"):
            each.joint_wrenches()
    file = read_arrays(tmp_path / "many.npz", "rollouts")
    del file.texts["own_parameters"]
    write_arrays(tmp_path / "old.npz", {**file.texts, **file.arrays})
    old = BatchRollouts.load(tmp_path / "old.npz")
    with pytest.raises(ArgumentError, match="may have parameters"):
        old.base_wrench()
    np.testing.assert_array_equal(old.joint_wrenches(models=robots), found)
    with pytest.raises(ArgumentError, match="wanted 2"):
        many.joint_wrenches(models=robots[:1])
    with pytest.raises(ArgumentError, match="no variant"):
        many.joint_wrenches(models=[dynx.load("ur5", base="floating")] * 2)


def test_what_was_not_recorded_is_refused_or_nan() -> None:
    arm = dynx.load("ur5")
    given: dict[str, Any] = {"q0": np.zeros((3, 6)), "duration": 0.02}
    law = PD(arm, kp=50.0, kd=2.0)
    for every in (0, 5):
        with pytest.raises(ArgumentError, match="record_every=1"):
            simulate_batch(arm, law, np.zeros(6), record_every=every, **given).joint_wrenches()
    many = simulate_batch(arm, law, np.zeros(6), record_every=1, **given)
    broken = many.q_record.copy()
    broken[1, 4:] = np.nan
    lost = replace(many, q_record=broken, diverged=np.array([np.nan, 0.004, np.nan]))
    found = lost.joint_wrenches()
    assert np.isnan(found[1]).all()
    np.testing.assert_array_equal(found[[0, 2]], many.joint_wrenches()[[0, 2]])
    with pytest.raises(UnknownNameError, match="tool0"):
        many.joint_wrenches(frame="tool")
