"""Without joint friction nothing of it is computed, in single runs and in batches."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from dynx.backends import installed_backends
from dynx.control import PD
from dynx.errors import DivergedError
from dynx.sim import simulate, simulate_batch
from tests.backends.robots import chain

ROBOT = chain(3)
"""A robot whose description has no friction."""

PLANTS = [name for name in ("pinocchio", "compiled", "pybullet") if name in installed_backends()]
WITHOUT: list[dict[str, Any]] = [
    {},
    {"joint_friction": 0.0, "joint_damping": 0.0},
    {"joint_friction": np.zeros(3)},
]


@pytest.fixture(autouse=True)
def no_law_of_friction(monkeypatch: pytest.MonkeyPatch, tmp_path: Any) -> None:
    def refuse(*_: Any) -> None:
        raise AssertionError("friction is computed")

    monkeypatch.setattr("dynx.rbd.joint_friction.FrictionLaw.of", refuse)
    monkeypatch.setenv("DYNX_CACHE_DIR", str(tmp_path))


@pytest.mark.parametrize("plant", PLANTS)
def test_steps_without_friction_solve_for_none(plant: str) -> None:
    start: dict[str, Any] = {"q0": np.full(3, 0.2), "plant": plant, "duration": 0.3}
    records = [simulate(ROBOT, PD(ROBOT, kp=5.0, kd=0.1), ROBOT.neutral(), **start, **no) for no in WITHOUT]
    for record in records[1:]:
        assert record.executor == records[0].executor
        np.testing.assert_array_equal(record.v, records[0].v)
    with pytest.raises((AssertionError, DivergedError), match="friction is computed"):
        simulate(ROBOT, PD(ROBOT, kp=5.0, kd=0.1), ROBOT.neutral(), joint_friction=0.1, **start)


def test_batches_without_friction_solve_for_none() -> None:
    def final(**options: Any) -> Any:
        law = PD(ROBOT, kp=5.0, kd=0.1)
        return simulate_batch(
            ROBOT, law, ROBOT.neutral(), q0=np.full(3, 0.2), rollouts=2, duration=0.01, **options
        ).v

    for no in WITHOUT[1:]:
        np.testing.assert_array_equal(final(**no), final())
    with pytest.raises(AssertionError, match="friction is computed"):
        final(joint_friction=0.1)
