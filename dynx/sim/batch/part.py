"""Part of a batch: some of its rollouts from start to end, which any thread or process can simulate."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from dynx.compiled.step import BoundSteps, Status, Stop
from dynx.sim.step_completion import LaneStops, Settling
from dynx.simd.call_sequence import Integers
from dynx.simd.kernel import Kernel
from dynx.spatial.scalar import Floats
from dynx.steppers.clock import Clock
from dynx.steppers.random import BLOCK_STEPS, Purpose, Streams
from dynx.trajectory.base import Setpoint


class PartOutcome(NamedTuple):
    """The outcome of `count` rollouts."""

    q: Floats  # (count, nq), at the end
    v: Floats  # (count, nv), at the end
    max_error: Floats  # (count, nv)
    rms_error: Floats  # (count, nv)
    diverged: Floats  # (count,), the number of the step that led to it, or -1
    q_record: Floats  # (count, kept, nq)
    v_record: Floats  # (count, kept, nv)
    tau_record: Floats  # (count, kept, nv)
    saturated: Floats  # (count, nv), the share of steps at the effort limit


BLOCK = 256
"""Number of steps whose calls are prepared together where no noise is drawn."""


class PartNoise(NamedTuple):
    """Noise of the measurements of a part, and random numbers of its controllers."""

    seed: int
    first: int
    """Number of the part's first rollout in the batch."""
    deviations: tuple[Floats, Floats] | None
    """Standard deviations (nv,) of q and v."""
    random_size: int


StepKernels = dict[tuple[bool, bool], Kernel]
"""Kernels by two conditions: the controller is evaluated, a push acts."""


@dataclass(frozen=True)
class Part:
    """Inputs of a part as arrays and machine code, so that it can be sent to another process."""

    kernels: StepKernels
    clock: Clock
    start: dict[str, Floats]
    """Initial state as arrays (count, size): q and v, maximum error and sum of squared errors of each
    coordinate (``max_error``, ``squared_errors``), the number of steps before divergence (``sound_steps``),
    the controller state (``state``), and the number of steps at the effort limit (``steps_at_limit``)."""
    fixed: dict[str, Floats]
    """Constant inputs: parameters and gains (count, size), or (size,) where all rollouts share them."""
    setpoints: Setpoint
    """Setpoints of control steps: position (n_controls, nq), velocity and acceleration (n_controls, nv)."""
    references: Floats
    """Reference configuration after each step (n_steps, nq)."""
    wrenches: Floats
    """Wrenches of the pushes in each step (n_steps, 6 per push)."""
    pushed: list[bool]
    """Whether the kernel of each step has pushes."""
    noise: PartNoise | None
    record_every: int
    stops: LaneStops | None

    def __call__(self) -> PartOutcome:
        """Simulate the rollouts of the part."""
        return _Run(self).run()

    @cached_property
    def count(self) -> int:
        """Number of rollouts."""
        return len(self.start["q"])


class _Run:
    """Buffers of a part while it runs: the state is read from one set and written to the next.

    There are enough sets for the delay, so that delayed measurements need no copies. All sets start with the
    initial state, which is what the controller measures until the delay has passed.
    """

    def __init__(self, part: Part) -> None:
        self._part = part
        self._kernels = list(part.kernels.values())
        self._variants = {variant: number for number, variant in enumerate(part.kernels)}
        # A kernel needs at least a full vector of samples, so the last rollout is repeated.
        self._rows = rows = max(part.count, *(kernel.image.lanes for kernel in self._kernels))
        self._delay = min(part.clock.delay_steps, part.clock.n_steps)
        sets = {name: self._delay + 2 if name in ("q", "v") else 2 for name in part.start}
        self._state = {
            name: np.repeat(self._padded(array)[None], sets[name], axis=0)
            for name, array in part.start.items()
        }
        sizes = {port.name: port.size for kernel in self._kernels for port in kernel.inputs + kernel.outputs}
        self._tau = np.zeros((1, rows, sizes["v"]))
        self._settling = Settling(rows, sizes.get("modes", 0))
        clock, setpoints = part.clock, part.setpoints
        controls = np.arange(clock.n_controls)
        held = np.minimum(clock.steps_per_control, clock.n_steps - controls * clock.steps_per_control)
        common = dict(zip(("q_wanted", "v_wanted", "a_wanted"), setpoints, strict=True))
        common |= {"t": clock.control_times(0)[:, None], "steps_held": held[:, None]}
        common |= {"q_reference": part.references, "wrenches": part.wrenches}
        self._common = {name: np.ascontiguousarray(array, np.float64) for name, array in common.items()}
        self._fixed = {
            name: array[None] if array.ndim == 1 else self._padded(array)[None]
            for name, array in part.fixed.items()
        }
        self._fixed |= {**self._settling.arrays, "tau": self._tau}
        # Nobody reads these outputs, so that all rollouts write the same row.
        self._fixed |= {name: np.zeros((1, sizes[name])) for name in ("a", "commanded") if name in sizes}
        self._drawn: dict[Purpose, Floats] = {}
        if part.noise is not None:
            self._stream = Streams(part.noise.seed)
            blocks, size = (rows, BLOCK_STEPS), part.noise.random_size
            if part.noise.deviations is not None:
                self._drawn[Purpose.MEASUREMENT] = np.zeros((*blocks, 2, sizes["v"]))
            if size:
                self._drawn[Purpose.CONTROLLER] = np.zeros((*blocks, size))
        self._stops = None if part.stops is None else part.stops.of_rows(rows)
        self._records: tuple[list[Floats], list[Floats], list[Floats]] = ([], [], [])

    def run(self) -> PartOutcome:
        """Take all steps."""
        part, clock, n = self._part, self._part.clock, self._part.count
        every = part.record_every or clock.n_steps
        block = BLOCK if part.noise is None else BLOCK_STEPS * clock.steps_per_control
        for first in range(0, clock.n_steps, block):
            if part.noise is not None:
                self._draw(clock.control_number(first), part.noise)
            bound = self._bound(np.arange(first, min(first + block, clock.n_steps)))
            step = first
            while step < bound.end:
                end = min(bound.end, (step // every + 1) * every)
                stop = bound.run(step, end)
                if stop is not None:
                    self._finish(bound, stop)
                    end = stop.step + 1
                step = end
                if part.record_every and step % every == 0:
                    now = (self._now("q", step), self._now("v", step), self._tau[0])
                    for kept, array in zip(self._records, now, strict=True):
                        kept.append(array[:n].copy())
        last = {name: self._now(name, clock.n_steps)[:n] for name in self._state}
        q, v, tau = (
            np.stack(kept, axis=1) if kept else np.zeros((n, 0, array.shape[1]))
            for kept, array in zip(self._records, (last["q"], last["v"], self._tau[0]), strict=True)
        )
        return PartOutcome(
            q=last["q"].copy(),
            v=last["v"].copy(),
            max_error=last["max_error"].copy(),
            rms_error=np.sqrt(last["squared_errors"] / clock.n_steps),
            # In a rollout that diverged in step k the number of steps before divergence is -1 - k.
            diverged=np.maximum(-1.0 - last["sound_steps"][:, 0], -1.0),
            q_record=q,
            v_record=v,
            tau_record=tau,
            saturated=last["steps_at_limit"] / clock.n_steps
            if "steps_at_limit" in last
            else np.zeros((n, self._tau.shape[2])),
        )

    def _now(self, name: str, step: int) -> Floats:
        """Return a part of the state before a step, of all rollouts."""
        array = self._state[name]
        return np.asarray(array[step % len(array)])

    def _bound(self, steps: Integers) -> BoundSteps:
        """Return the calls for the next steps."""
        part, clock = self._part, self._part.clock
        control, zeros = clock.control_number(steps), np.broadcast_to(np.int64(0), steps.shape)
        rows = {name: (array, zeros) for name, array in self._fixed.items()}
        rows |= {name: (array, steps % len(array)) for name, array in self._state.items()}
        written = {name: (array, (steps + 1) % len(array)) for name, array in self._state.items()}
        for name in ("q", "v"):
            array = self._state[name]
            rows[f"{name}_measured"] = array, (steps - self._delay) % len(array)
        of_steps = ("q_reference", "wrenches")
        rows |= {
            name: (array, steps if name in of_steps else control) for name, array in self._common.items()
        }
        for purpose, drawn in self._drawn.items():
            by_step = drawn.swapaxes(0, 1)
            if purpose is Purpose.CONTROLLER:
                rows["random"] = by_step, control % BLOCK_STEPS
            else:
                rows["noise_q"], rows["noise_v"] = (
                    (by_step[:, :, half], control % BLOCK_STEPS) for half in range(2)
                )
        chosen = [
            self._variants[bool(clock.is_control_step(step)), part.pushed[step]] for step in steps.tolist()
        ]
        return BoundSteps(
            self._kernels,
            np.array(chosen),
            rows,
            written,
            first=int(steps[0]),
            lanes=self._rows,
            # A rollout that diverged does not stop the others.
            bound=Status.TORQUE | Status.DIVERGED,
        )

    def _finish(self, bound: BoundSteps, stop: Stop) -> None:
        """Complete a step in which modes of dry friction are not settled, or joints are beyond limits."""
        step = stop.step
        self._settling(bound, step, self._kernels[0].image.lanes)
        if self._stops is not None:
            before, now = ({name: self._now(name, k) for name in self._state} for k in (step, step + 1))
            fixed = {
                name: np.broadcast_to(array, (1, self._rows, array.shape[-1]))[0]
                for name, array in self._fixed.items()
            }
            self._stops(before, now, fixed, self._part.references[step])

    def _draw(self, number: int, noise: PartNoise) -> None:
        """Draw noise and random numbers for a block of control steps."""
        left = self._part.clock.n_controls - number
        for purpose, drawn in self._drawn.items():
            for row in range(self._part.count):
                self._stream.normal(purpose, noise.first + row, number // BLOCK_STEPS, drawn[row, :left])
        if noise.deviations is not None:
            drawn = self._drawn[Purpose.MEASUREMENT]
            np.multiply(drawn, np.array(noise.deviations), out=drawn)

    def _padded(self, array: Floats) -> Floats:
        rows = np.minimum(np.arange(self._rows), len(array) - 1)
        return np.ascontiguousarray(array[rows], dtype=np.float64)
