"""Problems of inverse kinematics: the targets of a batch are laid out once, and not one by one."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import dynx
from dynx.ik.step import TargetKind

ARM = dynx.load("ur5")


@pytest.mark.parametrize("backend", ["compiled", "reference"])
@pytest.mark.parametrize("frame", ["base_link", "forearm_link"])
def test_targets_of_a_batch_are_laid_out_once(
    backend: str, frame: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls: list[tuple[int, ...]] = []
    rows = TargetKind.rows

    def counted(kind: TargetKind, targets: Any, batch: tuple[int, ...]) -> Any:
        calls.append(batch)
        return rows(kind, targets, batch)

    monkeypatch.setattr(TargetKind, "rows", counted)
    with dynx.backend(backend, ARM) as engine:
        q = ARM.random(np.random.default_rng(0), 20)
        targets = engine.forward_kinematics(q, frame)
        found = engine.inverse_kinematics(targets, frame)
        assert found.success.all()
        assert calls.count((20,)) <= 2
        assert len(calls) <= 3
        together = engine.inverse_kinematics({frame: targets, "tool0": engine.forward_kinematics(q, "tool0")})
        assert together.success.all()
        assert len(calls) <= 6


@pytest.mark.parametrize("backend", ["compiled", "reference"])
def test_a_batch_has_the_results_that_its_samples_have_alone(backend: str) -> None:
    with dynx.backend(backend, ARM) as engine:
        targets = engine.forward_kinematics(ARM.random(np.random.default_rng(1), 4), "base_link")
        targets[2, 0, 3] += 1.0
        found = engine.inverse_kinematics(targets, "base_link")
        assert found.success.tolist() == [True, True, False, True]
        for k, target in enumerate(targets):
            alone = engine.inverse_kinematics(target, "base_link")
            np.testing.assert_array_equal(found.q[k], alone.q)
            assert found.position_error[k] == alone.position_error == float(k == 2)


@pytest.mark.long_cases
@pytest.mark.parametrize(
    ("robot", "frame"),
    [
        ("kinova", "j2s6s200_link_finger_tip_1"),
        ("kinova", "j2s6s200_end_effector"),
        ("so101", "moving_jaw_so101_v1_link"),
        ("talos_arm", "gripper_left_fingertip_3_link"),
        ("panda", "panda_leftfinger"),
        ("centauro", "arm1_8"),
    ],
)
@pytest.mark.parametrize("seed", [0, 1])
def test_every_pose_that_the_robot_has_is_reached_from_few_starts(robot: str, frame: str, seed: int) -> None:
    model = dynx.load(robot)
    with dynx.backend("compiled", model) as engine:
        targets = engine.forward_kinematics(model.random(np.random.default_rng(seed), 300), frame)
        found = engine.inverse_kinematics(targets, frame)
    assert found.success.all()
    assert np.median(found.restarts) <= 2
