"""Part of a batch: some of its rollouts from start to end, which any thread or process can simulate."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from dynx.sim.batch.settling import Settling
from dynx.sim.batch.stopping import BatchStops
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


def pushing(wrenches: Floats) -> list[bool]:
    """Check whether a push acts in each step, from `Part.wrenches`."""
    return [bool(found) for found in np.count_nonzero(wrenches, axis=1)]


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
    """Constant inputs: parameters and gains (count, size)."""
    setpoints: Setpoint
    """Setpoints of control steps: position (n_controls, nq), velocity and acceleration (n_controls, nv)."""
    references: Floats
    """Reference configuration after each step (n_steps, nq)."""
    wrenches: Floats
    """Wrenches of the pushes in each step (n_steps, 6 per push)."""
    noise: PartNoise | None
    record_every: int
    stops: BatchStops | None

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
        # A kernel needs at least a full vector of samples, so the last rollout is repeated.
        self._rows = max(part.count, *(kernel.image.lanes for kernel in part.kernels.values()))
        nv = int(part.start["v"].shape[1])
        self._tau = np.zeros((self._rows, nv))
        start = {name: self._padded(array) for name, array in part.start.items()}
        # The rest of the state needs two sets, which alternate in step with the others if their number is
        # even.
        self._delay = min(part.clock.delay_steps, part.clock.n_steps)
        sets = 2 * ((self._delay + 3) // 2)
        pair = (start, {name: array.copy() for name, array in start.items()})
        self._sets = [
            {**pair[k % 2], **({} if k < 2 else {name: start[name].copy() for name in ("q", "v")})}
            for k in range(sets)
        ]
        self._fixed = {name: self._padded(array) for name, array in part.fixed.items()}
        widths: dict[str, int] = {**dict.fromkeys(("v_wanted", "a_wanted"), nv), "t": 1, "steps_held": 1}
        widths |= dict.fromkeys(("q_wanted", "q_reference"), int(part.references.shape[1]))
        widths["wrenches"] = int(part.wrenches.shape[1])
        always = all(pushed for _, pushed in part.kernels)
        self._pushing = [True] * part.clock.n_steps if always else pushing(part.wrenches)
        self._noise: dict[str, Floats] = {}
        self._drawn: dict[Purpose, Floats] = {}
        if part.noise is not None:
            self._stream = Streams(part.noise.seed)
            blocks, size = (self._rows, BLOCK_STEPS), part.noise.random_size
            if part.noise.deviations is not None:
                self._drawn[Purpose.MEASUREMENT] = np.zeros((*blocks, 2, nv))
                self._noise |= {name: np.zeros((self._rows, nv)) for name in ("noise_q", "noise_v")}
            if size:
                self._drawn[Purpose.CONTROLLER] = np.zeros((*blocks, size))
                self._noise["random"] = np.zeros((self._rows, size))
        ports = [port for kernel in part.kernels.values() for port in kernel.inputs]
        self._dry = max((port.size for port in ports if port.name == "modes"), default=0)
        self._settling = Settling(self._rows, self._dry)
        self._common = {name: np.zeros((1, width)) for name, width in widths.items()}
        self._calls, self._groups = (
            {
                (*which, turn): getattr(kernel, name)(*self._arrays(kernel, turn))
                for which, kernel in part.kernels.items()
                for turn in range(sets)
            }
            for name in ("bind", "bind_groups")
        )
        self._stops = None if part.stops is None else part.stops.of_rows(self._rows)
        self._records: tuple[list[Floats], list[Floats], list[Floats]] = ([], [], [])

    def run(self) -> PartOutcome:
        """Take all steps."""
        part, clock, n = self._part, self._part.clock, self._part.count
        sets, common = len(self._sets), self._common
        dry, settling, unsettled = self._dry, self._settling, self._settling.outputs["unsettled"]
        for step in range(clock.n_steps):
            controlled = clock.is_control_step(step)
            if controlled:
                self._set_control(clock.control_number(step))
            common["q_reference"][0] = part.references[step]
            pushed = self._pushing[step]
            if pushed:
                common["wrenches"][0] = part.wrenches[step]
            key = controlled, pushed, step % sets
            self._calls[key]()
            if dry and unsettled.any():
                settling(self._groups[key], part.kernels[key[:2]].image.lanes)
            now = self._sets[(step + 1) % sets]
            if self._stops is not None:
                self._stops(self._sets[step % sets], now, self._fixed, part.references[step])
            if part.record_every and (step + 1) % part.record_every == 0:
                for kept, array in zip(self._records, (now["q"], now["v"], self._tau), strict=True):
                    kept.append(array[:n].copy())
        last = self._sets[clock.n_steps % sets]
        q, v, tau = (
            np.stack(kept, axis=1) if kept else np.zeros((n, 0, array.shape[1]))
            for kept, array in zip(self._records, (last["q"], last["v"], self._tau), strict=True)
        )
        return PartOutcome(
            q=last["q"][:n].copy(),
            v=last["v"][:n].copy(),
            max_error=last["max_error"][:n].copy(),
            rms_error=np.sqrt(last["squared_errors"][:n] / clock.n_steps),
            # In a rollout that diverged in step k the number of steps before divergence is -1 - k.
            diverged=np.maximum(-1.0 - last["sound_steps"][:n, 0], -1.0),
            q_record=q,
            v_record=v,
            tau_record=tau,
            saturated=last["steps_at_limit"][:n] / clock.n_steps
            if "steps_at_limit" in last
            else np.zeros((n, self._tau.shape[1])),
        )

    def _set_control(self, number: int) -> None:
        part, clock = self._part, self._part.clock
        for name, rows in zip(("q_wanted", "v_wanted", "a_wanted"), part.setpoints, strict=True):
            self._common[name][0] = rows[number]
        first = number * clock.steps_per_control
        self._common["t"][0, 0] = first * clock.dt
        self._common["steps_held"][0, 0] = min(clock.steps_per_control, clock.n_steps - first)
        if part.noise is not None:
            self._draw(number, part.noise)

    def _draw(self, number: int, noise: PartNoise) -> None:
        """Set noise and random numbers of a control step; they are drawn for a block of steps at once."""
        step = number % BLOCK_STEPS
        if step == 0:
            left = self._part.clock.n_controls - number
            for purpose, drawn in self._drawn.items():
                for row in range(self._part.count):
                    self._stream.normal(purpose, noise.first + row, number // BLOCK_STEPS, drawn[row, :left])
        if noise.deviations is not None:
            drawn = self._drawn[Purpose.MEASUREMENT]
            for half, (name, deviation) in enumerate(
                zip(("noise_q", "noise_v"), noise.deviations, strict=True)
            ):
                np.multiply(drawn[:, step, half], deviation, out=self._noise[name])
        if noise.random_size:
            self._noise["random"][:] = self._drawn[Purpose.CONTROLLER][:, step]

    def _arrays(self, kernel: Kernel, turn: int) -> tuple[list[Floats], list[Floats]]:
        """Return inputs and outputs of a kernel, from the set of buffers number `turn` to the next."""
        sets = len(self._sets)
        source, target = self._sets[turn], self._sets[(turn + 1) % sets]
        # As `Clock.measured_step`: sets that are not written yet have the initial state.
        measured = self._sets[(turn - self._delay) % sets]
        known = {
            **self._fixed,
            **self._noise,
            **{name: np.broadcast_to(row, (self._rows, row.size)) for name, row in self._common.items()},
            **self._settling.inputs,
            "tau": self._tau,
            "q_measured": measured["q"],
            "v_measured": measured["v"],
            **source,
        }
        written = {"tau": self._tau, **self._settling.outputs, **target}
        return [known[port.name] for port in kernel.inputs], [written[port.name] for port in kernel.outputs]

    def _padded(self, array: Floats) -> Floats:
        rows = np.minimum(np.arange(self._rows), len(array) - 1)
        return np.ascontiguousarray(array[rows], dtype=np.float64)
