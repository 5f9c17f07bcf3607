"""The clock of a simulation: physics steps, control steps, and the delay of measurements."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from dynx.errors import ArgumentError, shown
from dynx.model.numbers import is_real, is_whole, positive_seconds
from dynx.spatial.scalar import Floats

TIME_ROUNDING = 1e-9
"""Tolerance within which the ratio of two times counts as a whole number."""

MAX_STEPS = 10**12
"""Largest number of steps in a time; the record of more would not fit into the memory of any machine."""


@dataclass(frozen=True)
class Clock:
    """Time steps of `dt` [s]. Step k is at time k dt, so that rounding errors do not add up."""

    dt: float
    n_steps: int
    steps_per_control: int
    delay_steps: int

    @classmethod
    def of(cls, dt: float, duration: float, control_dt: float | None, delay: float) -> Clock:
        """Make a clock; the duration is rounded up to a multiple of `dt`.

        Raises ArgumentError for invalid times, and a `control_dt` or `delay` that is no multiple of `dt`.
        """
        dt = positive_seconds("dt", dt)
        duration = positive_seconds("duration", duration)
        control = dt if control_dt is None else positive_seconds("control_dt", control_dt)
        if not is_real(delay) or not 0.0 <= delay < np.inf:
            raise ArgumentError(f"delay is {shown(delay)}; wanted seconds, 0 or more")
        for name, seconds in (("duration", duration), ("control_dt", control), ("delay", delay)):
            refuse_too_many_steps(name, seconds, dt)
        return cls(
            dt,
            steps_to(duration, dt),
            multiple("control_dt", control, dt),
            multiple("delay", delay, dt) if delay else 0,
        )

    @property
    def n_controls(self) -> int:
        """Number of control steps."""
        return -(-self.n_steps // self.steps_per_control)

    @property
    def duration(self) -> float:
        """Simulated time [s]."""
        return self.n_steps * self.dt

    @property
    def control_dt(self) -> float:
        """Time between two control steps [s]."""
        return self.steps_per_control * self.dt

    def is_control_step(self, step: Any) -> Any:
        """Check whether the controller is evaluated at the start of `step`, or of each of several (n,)."""
        return step % self.steps_per_control == 0

    def control_number(self, step: Any) -> Any:
        """Return the number of the control step that `step`, or each of several (n,), belongs to."""
        return step // self.steps_per_control

    def next_control_step(self, step: int) -> int:
        """Return the first step from `step` on at which the controller is evaluated."""
        return -(-step // self.steps_per_control) * self.steps_per_control

    def measured_step(self, step: Any) -> Any:
        """Return the step whose state a controller measures at `step`, or at each of several (n,): an earlier
        one with a delay, and the initial state while the delay has not passed."""
        seen = step - self.delay_steps
        return seen * (seen > 0)

    def times(self) -> Floats:
        """Return the times (n_steps + 1,) [s] of all steps, including the end."""
        return np.arange(self.n_steps + 1, dtype=np.float64) * self.dt

    def control_times(self, lead: int) -> Floats:
        """Return the times (n_controls,) [s] of the setpoints, which are `lead` control steps ahead."""
        steps = (np.arange(self.n_controls) + lead) * self.steps_per_control
        return steps.astype(np.float64) * self.dt


def refuse_too_many_steps(name: str, seconds: float, dt: float) -> None:
    """Raise ArgumentError for a time of more than `MAX_STEPS` steps of `dt`."""
    if seconds > MAX_STEPS * dt:
        raise ArgumentError(
            f"{name} is {seconds:.12g} s, more than {MAX_STEPS:g} steps of dt = {dt:.12g} s: check both"
        )


def step_count(n: object, by_time: str) -> int:
    """Return a number of steps, from 1 to `MAX_STEPS`. Raises ArgumentError for anything else, which states
    `by_time`, the call that takes seconds, for a number that is not whole."""
    if not is_whole(n) or not 1 <= n <= MAX_STEPS:
        clause = f"; {by_time} [s]" if is_real(n) and not is_whole(n) else ""
        raise ArgumentError(f"n is {shown(n)}; wanted a number of steps, from 1 to {MAX_STEPS:g}{clause}")
    return int(n)


def steps_to(seconds: float, dt: float) -> int:
    """Return the number of steps of `dt` after which a time has passed, 1 or more."""
    steps = max(1, round(seconds / dt))
    return steps if _is_near(seconds / dt, steps) else max(1, math.ceil(seconds / dt))


def multiple(name: str, seconds: float, dt: float) -> int:
    """Return the number of steps of `dt` in a time. Raises ArgumentError, which names the nearest multiple,
    if the time is not a multiple of `dt`."""
    steps = round(seconds / dt)
    if steps < 1 or not _is_near(seconds / dt, steps):
        nearest = max(1, steps) * dt
        raise ArgumentError(
            f"{name} is {seconds:.12g} s, which is not a multiple of dt = {dt:.12g} s; "
            f"the nearest one is {nearest:.12g} s"
        )
    return steps


def _is_near(ratio: float, steps: int) -> bool:
    return abs(ratio - steps) <= TIME_ROUNDING * steps
