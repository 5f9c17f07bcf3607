"""A kernel of a batch is found again by the content of its step, and by nothing less."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from dynx.compiled import step
from dynx.control import PD, ComputedTorque, FrictionCompensation, Saturated
from dynx.control.base import Controller, Measurement
from dynx.control.content import content_of
from dynx.sim import simulate, simulate_batch
from dynx.sim.loop_step import traced_controller
from dynx.simd.program import Program
from dynx.simd.trace import trace
from dynx.spatial.scalar import Floats
from dynx.trajectory.base import Setpoint
from tests.sim.bars import tutorial_motion, tutorial_robot

ARM = tutorial_robot()


def law(**gains: Any) -> ComputedTorque:
    return ComputedTorque(ARM, **{"kp": 400.0, "kd": 40.0, **gains})


def content(controller: Controller[Any]) -> Any:
    return content_of(traced_controller(controller, lambda depth, each: {}))


def test_equal_controllers_are_equal_and_others_are_not() -> None:
    assert content(law()) == content(law())
    assert hash(content(law())) == hash(content(law()))
    assert content(law()) == content(law(backend="reference"))
    assert law() != law(backend="reference")
    others: list[Any] = [
        law(kp=401.0),
        law(kd=[40.0] * 5 + [40.0 + 1e-14]),
        PD(ARM, kp=400.0, kd=40.0),
        Saturated(law()),
        Saturated(law(), limit=10.0),
        Saturated(law(kp=1.0), limit=10.0),
        FrictionCompensation(law(), damping=0.1, friction=0.0),
        FrictionCompensation(law(), damping=0.2, friction=0.0),
        ComputedTorque(ARM.with_gravity((0.0, 0.0, 0.0)), kp=400.0, kd=40.0),
    ]
    controllers = [law(), *others]
    assert len({content(each) for each in controllers}) == len(controllers)
    assert all((a == b) == (a is b) for a in controllers for b in controllers)


def test_signs_of_zeros_are_told_apart() -> None:
    assert content_of(0.0) != content_of(-0.0)
    assert content_of(np.zeros(2)) != content_of(-np.zeros(2))
    assert content_of(1) != content_of(True)
    assert content_of(1) != content_of(1.0)


class Scaled(PD):
    """A controller of a user, which reads a global variable."""

    def torque(self, measurement: Measurement, setpoint: Setpoint, state: None) -> tuple[Floats, None]:
        tau, state = super().torque(measurement, setpoint, state)
        return SCALE[0] * tau, state


class Promised(Scaled, pure=True):
    """One that promises to do nothing besides."""


SCALE = [1.0]


def worst(controller: Controller[Any]) -> float:
    found = simulate_batch(ARM, controller, tutorial_motion(), rollouts=4, duration=0.05)
    return float(found.worst.max())


@pytest.mark.parametrize("law", [Scaled, Promised])
def test_a_law_of_one_s_own_is_traced_each_time(law: type[Scaled]) -> None:
    """Its code and what it refers to may change, as while it is written in a notebook."""
    controller = law(ARM, kp=100.0, kd=10.0)
    before = worst(controller)
    SCALE[0] = 3.0
    try:
        assert worst(controller) != before
    finally:
        SCALE[0] = 1.0
    assert worst(controller) == before


def test_a_changed_law_has_another_kernel() -> None:
    controller = law()
    worst(controller)
    controller = replace(controller, kp=np.full(6, 100.0))
    one = simulate(ARM, controller, tutorial_motion(), plant="compiled", duration=0.05)
    assert worst(controller) == pytest.approx(np.abs(one.error).max(), rel=1e-9)


def test_the_next_batch_traces_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    first = worst(law())
    monkeypatch.setattr(step, "trace", None)
    assert worst(law()) == first


def test_other_gains_have_the_same_kernel(monkeypatch: pytest.MonkeyPatch) -> None:
    first = worst(law())
    monkeypatch.setattr(step, "trace", None)
    assert worst(law(kp=100.0)) != first


def test_only_so_many_are_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(step, "_kernels", {})
    monkeypatch.setattr(step, "MAX_CACHED_KERNELS", 2)
    for dt in (1e-3, 2e-3, 5e-3):
        simulate_batch(ARM, law(), tutorial_motion(), rollouts=2, duration=0.01, dt=dt)
    assert len(step._kernels) == 2


def test_impacts_at_position_limits_are_traced_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(step, "_kernels", {})
    traced = []

    def trace_and_count(*arguments: Any, **options: Any) -> Program:
        traced.append(arguments)
        return trace(*arguments, **options)

    monkeypatch.setattr(step, "trace", trace_and_count)
    for _ in range(2):
        start: dict[str, Any] = {"q0": ARM.upper[None], "v0": np.full((2, ARM.nv), 10.0)}
        simulate_batch(ARM, law(), tutorial_motion(), duration=0.01, effort_limits=1.0, **start)
    # One kernel is that of the step.
    assert len(traced) == 2
