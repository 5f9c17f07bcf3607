"""Some rollouts of a batch, from beginning to end: a piece of work that any process can do."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from dynx.sim.fused import STATE
from dynx.simd.kernel import Kernel
from dynx.spatial.scalar import Floats
from dynx.trajectory.base import Setpoint

CHECK = 100
"""Steps after which rollouts are looked at: which of them still are where a robot can be."""

BEYOND = 1e8
"""A coordinate or speed [rad, m, per second] beyond which a rollout has diverged."""


class PartDone(NamedTuple):
    """The outcome of `count` rollouts."""

    q: Floats  # (count, nv), at the end
    v: Floats  # (count, nv), at the end
    max_error: Floats  # (count, nv)
    rms_error: Floats  # (count, nv)
    diverged: Floats  # (count,), the step by which it was noticed, or -1
    q_record: Floats  # (count, kept, nv)
    v_record: Floats  # (count, kept, nv)
    tau_record: Floats  # (count, kept, nv)


@dataclass(frozen=True)
class Part:
    """What a part needs: everything as arrays and machine code, so that it can be sent elsewhere."""

    controlled: Kernel
    held: Kernel | None
    """The step with the torque of before, where the law is not asked at every step."""
    steps_per_control: int
    n_steps: int
    dt: float
    start: dict[str, Floats]
    """`STATE` at the beginning, arrays (count, size)."""
    fixed: dict[str, Floats]
    """Inputs that stay the same: parameters and gains (count, size)."""
    setpoints: Setpoint
    """Of each control step, (n_controls, nv) each."""
    goals: Floats
    """Where the robot should be after each step, (n_steps, nv)."""
    noise: tuple[tuple[int, int], Floats, Floats] | None
    """The seed, the number of this part, and the standard deviations of q and v."""
    record_every: int

    def __call__(self) -> PartDone:
        """Do it."""
        return _Run(self).done()

    @cached_property
    def count(self) -> int:
        """Rollouts."""
        return len(self.start["q"])


class _Run:
    """Buffers of a part that is under way: the state is read from one set and written to the other."""

    def __init__(self, part: Part) -> None:
        self._part = part
        # A kernel wants a vector full of samples; what is too much repeats the last one.
        self._rows = max(part.count, part.controlled.image.lanes)
        nv = part.start["q"].shape[1]
        self._tau = np.zeros((self._rows, nv))
        self._now = {name: self._padded(array) for name, array in part.start.items()}
        self._next = {name: np.empty_like(array) for name, array in self._now.items()}
        self._fixed = {name: self._padded(array) for name, array in part.fixed.items()}
        self._wanted = {name: np.zeros((1, nv)) for name in ("q_wanted", "v_wanted", "a_wanted", "goal")}
        self._time = np.zeros((1, 1))
        if part.noise is not None:
            self._random = np.random.default_rng(part.noise[0])
            self._noise = {name: np.zeros((self._rows, nv)) for name in ("noise_q", "noise_v")}
        else:
            self._noise = {}
        self._calls = {
            (kernel is part.controlled, turn): self._bound(kernel, turn)
            for kernel in (part.controlled, part.held)
            if kernel is not None
            for turn in (0, 1)
        }
        self._diverged = np.full(self._rows, -1.0)
        self._records: tuple[list[Floats], list[Floats], list[Floats]] = ([], [], [])

    def done(self) -> PartDone:
        """All steps."""
        part, n = self._part, self._part.count
        for step in range(part.n_steps):
            number, rest = divmod(step, part.steps_per_control)
            if rest == 0:
                self._set_control(number)
            self._wanted["goal"][0] = part.goals[step]
            self._calls[rest == 0, step % 2]()
            self._now, self._next = self._next, self._now
            if part.record_every and (step + 1) % part.record_every == 0:
                arrays = (self._now["q"], self._now["v"], self._tau)
                for kept, array in zip(self._records, arrays, strict=True):
                    kept.append(array[:n].copy())
            if (step + 1) % CHECK == 0:
                self._look(step + 1)
        self._look(part.n_steps)
        q, v, worst, squares = (self._now[name][:n].copy() for name in STATE[:4])
        record = [np.stack(kept, axis=1) if kept else np.zeros((n, 0, q.shape[1])) for kept in self._records]
        return PartDone(q, v, worst, np.sqrt(squares / part.n_steps), self._diverged[:n].copy(), *record)

    def _set_control(self, number: int) -> None:
        part = self._part
        for name, rows in zip(("q_wanted", "v_wanted", "a_wanted"), part.setpoints, strict=True):
            self._wanted[name][0] = rows[number]
        self._time[0, 0] = number * part.steps_per_control * part.dt
        if part.noise is not None:
            for (name, array), deviation in zip(self._noise.items(), part.noise[1:], strict=True):
                self._random.standard_normal(out=array)
                self._noise[name] *= deviation

    def _bound(self, kernel: Kernel, turn: int) -> Callable[[], None]:
        source, target = (self._now, self._next) if turn == 0 else (self._next, self._now)
        known = {
            **self._fixed,
            **self._noise,
            **{name: np.broadcast_to(row, (self._rows, row.shape[1])) for name, row in self._wanted.items()},
            "t": np.broadcast_to(self._time, (self._rows, 1)),
            "tau": self._tau,
            **source,
        }
        answers = {"tau": self._tau, **target}
        return kernel.bound(
            [known[port.name] for port in kernel.inputs], [answers[port.name] for port in kernel.outputs]
        )

    def _look(self, step: int) -> None:
        state = np.maximum(np.abs(self._now["q"]).max(axis=1), np.abs(self._now["v"]).max(axis=1))
        new = (self._diverged < 0) & ~(state < BEYOND)
        self._diverged[new] = step

    def _padded(self, array: Floats) -> Floats:
        rows = np.minimum(np.arange(self._rows), len(array) - 1)
        return np.ascontiguousarray(array[rows], dtype=np.float64)
