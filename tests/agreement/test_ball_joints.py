"""Agreement of the backends that take ball joints."""

from __future__ import annotations

from typing import Any

import pytest

import dynx
from dynx.agreement import agree
from dynx.backends.registry import backend_class, installed_backends
from tests.sim.test_ball_joints import arm, each_base


@each_base
def test_backends_that_take_ball_joints_are_compared(base: Any) -> None:
    """By default; inverse kinematics and the referee are part of the comparison."""
    report = agree(arm(base), samples=4, referee_samples=1)
    assert report.agree, str(report)
    taking = [name for name in installed_backends() if backend_class(name).takes_ball_joints]
    assert list(report.backends) == taking
    assert "inverse_kinematics" in {row.quantity for row in report.quantities}
    left_out = [name for name in installed_backends() if name not in taking]
    if left_out:
        assert any(all(name in note for name in left_out) for note in report.notes)


def test_a_backend_that_is_named_is_not_left_out() -> None:
    pytest.importorskip("pybullet")
    report = dynx.agree(arm(), ["reference", "pybullet"])
    assert report.error is not None
    assert "'shoulder'" in report.error.message
