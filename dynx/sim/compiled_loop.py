"""A closed loop in compiled steps: one kernel, or pieces between the calls of the plant's engine.

On the plant ``compiled`` the robot is one lane of the kernel that batches use (`dynx.sim.loop_step`), however
few steps are taken at a time. On every other integrated plant the same step is cut at the engine's calls. Its
pieces round as NumPy does, so that the record is that of `dynx.sim.closed_loop` to the last bit, in two
thirds of the time.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from contextlib import suppress
from dataclasses import replace
from time import perf_counter
from typing import Any, Generic, TypeVar

import numpy as np

from dynx.backends.dynamics import EngineDynamics
from dynx.compiled.backend import CompiledBackend
from dynx.compiled.status import Status
from dynx.compiled.step import BoundSteps, CompiledStep, Stop
from dynx.control.base import Controller, chain_of
from dynx.control.bullet import BulletMotor
from dynx.control.content import attributes_of
from dynx.errors import ArgumentError, CompileError, TraceError, UnsupportedFeatureError
from dynx.sim.closed_loop import MIN_STEPS_TO_COMPILE, ClosedLoop, LoopState, StateBuffers
from dynx.sim.loop_step import CONTROLLER, SETPOINT, ArrayDisturbances, LoopStep, cut_step
from dynx.sim.own_controllers import refuse_irreproducible
from dynx.sim.plants.integrated import IntegratedPlant
from dynx.sim.step_completion import LaneStops, Settling
from dynx.simd.call_sequence import Integers, StridedRows
from dynx.simd.cuts import BoundCuts, CutStep, EngineCallFailed
from dynx.spatial.scalar import Floats, clamp

MAX_CHUNK_STEPS = 4096
"""Largest number of steps whose kernel calls are prepared together."""

CHUNK_OF_LANE = 1024
"""Largest number of steps whose calls of one kernel are prepared together."""

FIRST_CHUNK = 16
"""Number of steps that are prepared at first, and again where the caller changes what is next, because
preparing takes longer than a step. It doubles from chunk to chunk."""

PROGRESS_INTERVAL = 0.1
"""Time between two calls of `progress` [s]."""

MAX_NV_OF_KERNEL = 40
"""Largest number of coordinates for which a whole step is compiled into one kernel, which takes seconds for
more."""

TOTALS = ("max_error", "squared_errors", "sound_steps", "steps_at_limit")
"""Inputs that batches accumulate."""

NOT_COMPILED = (CompileError, UnsupportedFeatureError, ArgumentError)
"""Errors of a controller that is not compiled: floats report what they find, in the step where they do."""

ONE_KERNEL, PIECES = "compiled", "compiled pieces"
"""Names of the executors in a record."""


def lane_loop(loop: ClosedLoop) -> LaneLoop | None:
    """Compile a loop as one lane of a batch's kernel; return None where that is impossible."""
    plant = loop.plant
    if not isinstance(plant, IntegratedPlant) or not is_one_lane(plant, loop.controller):
        return None
    # A controller is evaluated on numbers too, where its own defects may warn before they are found.
    with suppress(*NOT_COMPILED), np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        return LaneLoop(loop, _step_of(loop))
    return None


def cut_loop(loop: ClosedLoop) -> CutLoop | str:
    """Compile a loop in pieces; return the reason where that is impossible (`ClosedLoop.not_in_pieces`)."""
    plant = loop.plant
    assert isinstance(plant, IntegratedPlant)
    try:
        return CutLoop(loop, _step_of(loop), plant)
    except NOT_COMPILED as error:
        return str(error)


def is_one_lane(plant: IntegratedPlant, controller: Controller[Any] | None) -> bool:
    """Return whether a loop is one lane of a batch's kernel: a step of semi-implicit Euler on the plant
    ``compiled``, under a controller whose engine is one of dynx."""
    engine = plant.dynamics.backend
    if type(engine) is not CompiledBackend or not plant.is_one_semi_implicit_step:
        return False
    if not 0 < plant.model.nv <= MAX_NV_OF_KERNEL or isinstance(controller, BulletMotor):
        return False
    used: list[Any] = [engine]
    for each in () if controller is None else chain_of(controller):
        used += [x.backend for x in attributes_of(each).values() if isinstance(x, EngineDynamics)]
    return all(type(each).__module__.startswith("dynx.") and not _replaced(each) for each in used)


def _replaced(engine: Any) -> bool:
    """Return whether a quantity of this engine was replaced by another function."""
    return any(callable(value) and hasattr(type(engine), name) for name, value in vars(engine).items())


def _step_of(loop: ClosedLoop) -> LoopStep:
    """Return the step of a loop. Raises TraceError for a controller that must not be traced."""
    plant, sensors, controller = loop.plant, loop.sensors, loop.controller
    if controller is not None:
        _refuse_impure(controller)
    if any(array.dtype != np.float64 for array in loop.setpoints):
        raise TraceError("the reference is not in float64")
    return LoopStep(
        plant.model,
        controller,
        loop.clock.dt,
        (),
        None,
        sensors.noise is not None,
        loop.clock.delay_steps > 0,
        loop.limit,
        loop.stops is not None,
        ArrayDisturbances.of(plant.model, plant.disturbances, {}),
    )


def _refuse_impure(controller: Controller[Any]) -> None:
    """Raise TraceError for a controller that may do anything besides returning its torque.

    Other effects, such as counting its calls, would happen once during tracing and not in the steps.
    """
    for each in chain_of(controller):
        if not each.is_pure:
            raise TraceError(
                f"the class of {each.name} is not declared with pure=True, so its torque may do more than "
                "compute a torque"
            )


C = TypeVar("C")

ArrayRows = dict[str, tuple[Floats, Integers]]
"""Arrays by name, with the row of each step (n,)."""


class CompiledLoop(ABC, Generic[C]):
    """A loop in compiled steps. The arrays of the record are inputs and outputs of the steps."""

    executor: str
    chunk_steps: int

    def __init__(self, loop: ClosedLoop, step: LoopStep) -> None:
        self._loop, self._step = loop, step
        self._chunk = 0
        self._times = loop.clock.control_times(0)[:, None]
        # The setpoints of a reference may be stored column by column.
        self._setpoints = [x if x[:1].flags.c_contiguous else np.ascontiguousarray(x) for x in loop.setpoints]
        self._record: StateBuffers | None = None
        self._first = self._end = 0
        self._given = np.zeros((1, step.model.nv))
        self._prepared: dict[bool, C] = {}

    def run(self, record: StateBuffers, loop_state: LoopState, end: int, given: Floats | None = None) -> None:
        """Step from the last state of `record` to step `end`.

        The torque `given` (nv,) replaces that of the controller, which is then not evaluated. Raises
        DivergedError and ControlError. After an error or Ctrl-C, `record` and `loop_state` are those of the
        last complete step.
        """
        progress = self._loop.progress
        # The first chunk is short where it is timed, so that `progress` is called in time.
        chunk = self.chunk_steps if progress is None else MIN_STEPS_TO_COMPILE
        while record.steps < end:
            first, started = record.steps, perf_counter()
            try:
                self._prepare(record, loop_state, min(end, first + chunk), given)
                self._take(record, min(end, first + chunk, self._end))
            finally:
                self._set_state(loop_state, record)
            if progress is not None:
                progress(record.steps)
                each = (perf_counter() - started) / (record.steps - first)
                chunk = min(max(int(PROGRESS_INTERVAL / each), 1), self.chunk_steps)
        self._loop.plant.reset(loop_state.q, loop_state.v)

    def _set_state(self, loop_state: LoopState, record: StateBuffers) -> None:
        """Set the state of the loop to that after the last step of the record."""
        k = record.steps
        loop_state.q, loop_state.v = record.q[k].copy(), record.v[k].copy()
        if k > self._first:
            loop_state.tau, loop_state.command = record.tau[k - 1].copy(), None
            if self._step.controller_state:
                loop_state.controller_state = self._arrays["state"][k - self._first].copy()

    def _prepare(self, record: StateBuffers, loop_state: LoopState, end: int, given: Floats | None) -> None:
        """Prepare the calls of the next steps, to `end` and beyond, unless they are prepared."""
        k, limit, is_given = record.steps, self._loop.limit, given is not None
        if not (self._record is record and self._first <= k < self._end):
            continued = self._record is record and self._first < self._end == k
            self._chunk = 2 * self._chunk if continued else FIRST_CHUNK
            # No step counts as prepared until all is done: Ctrl-C may come at any time.
            self._first = self._end = k
            self._record, self._prepared = record, {}
            count = min(max(self._chunk, end - k), self.chunk_steps, len(record) - k)
            self._arrays = self._arrays_of(record, np.arange(k, k + count))
            self._end = k + count
        if is_given not in self._prepared:
            self._prepared[is_given] = self._bound_calls(np.arange(self._first, self._end), given=is_given)
        self._calls = self._prepared[is_given]
        if given is not None:
            self._given[:] = given if limit is None else clamp(given, limit)
        if self._step.controller_state:
            # The caller may have gone back to another state.
            self._arrays["state"][k - self._first] = loop_state.controller_state

    @abstractmethod
    def _bound_calls(self, steps: Integers, *, given: bool) -> C:
        """Prepare the calls of `steps`, in which the torque is `given` by the caller or not."""

    @abstractmethod
    def _take(self, record: StateBuffers, end: int) -> None:
        """Take prepared steps to `end`, and count them in the record."""

    def _arrays_of(self, record: StateBuffers, steps: Integers) -> dict[str, Floats]:
        """Return the inputs and outputs of the steps by name: arrays with one row for each step or control
        step, or with one row."""
        loop, step = self._loop, self._step
        arrays = {"q": record.q, "v": record.v, "q_measured": record.q, "v_measured": record.v}
        arrays |= {
            "tau": record.tau,
            "a": record.a,
            "t": self._times,
        }
        arrays |= dict(zip(SETPOINT, self._setpoints, strict=True))
        if loop.sensors.noise is not None:
            arrays["noise_q"], arrays["noise_v"] = loop.sensors.noise
        if loop.sensors.random is not None:
            arrays["random"] = loop.sensors.random
        for name, size in step.controller_state.items():
            arrays[name] = np.empty((len(steps) + 1, size))
        arrays["status"], arrays["commanded"] = np.zeros((1, 1)), np.zeros((1, step.model.nv))
        return arrays

    def _rows(self, steps: Integers, *, given: bool) -> tuple[ArrayRows, ArrayRows]:
        """Return the arrays with the rows that `steps` use, and those that they write where they are
        others."""
        assert self._record is not None
        clock, zeros = self._loop.clock, np.broadcast_to(np.int64(0), steps.shape)
        own = {"q": steps, "v": steps, "a": steps, "state": steps - self._first}
        own["tau"] = np.maximum(steps - 1, 0)
        own |= dict.fromkeys(("q_measured", "v_measured"), clock.measured_step(steps))
        control = clock.control_number(steps)
        own |= dict.fromkeys((*SETPOINT, "t", "noise_q", "noise_v", "random"), control)
        rows = {name: (array, own.get(name, zeros)) for name, array in self._arrays.items()}
        if given:
            rows["tau"] = self._given, zeros
        following = {"q": steps + 1, "v": steps + 1, "state": steps - self._first + 1}
        written = {name: (rows[name][0], row) for name, row in following.items() if name in rows}
        return rows, {**written, "tau": (self._record.tau, steps)}

    def _ended(self, record: StateBuffers, status: Status) -> None:
        """Raise the error of a status, unless it is none."""
        if status & (Status.TORQUE | Status.DIVERGED):
            limited = self._loop.limit is not None or isinstance(self, CutLoop)
            tau = self._arrays["commanded"][0] if limited else record.tau[record.steps]
            raise self._loop.error_of(status, record.steps, record, tau)


class LaneLoop(CompiledLoop[BoundSteps]):
    """A loop as one lane of the kernel of a batch."""

    executor = ONE_KERNEL
    chunk_steps = CHUNK_OF_LANE

    def __init__(self, loop: ClosedLoop, step: LoopStep) -> None:
        """Raises TraceError or UnsupportedFeatureError for a controller that cannot be compiled."""
        super().__init__(loop, step)
        self._compiled = CompiledStep(step.text)
        self._lanes = self._compiled.kernel((True, step.always_pushed)).image.lanes
        self._stops = LaneStops.of(step) if step.stops else None

    def recover_controller_state(self, record: StateBuffers, loop_state: LoopState) -> None:
        """Set the controller's state to that after the last step of `record`.

        The kernel computes it again from the measurements in the record: on floats its last bits would be
        others.
        """
        controller = self._loop.controller
        if controller is None or not self._step.controller_state:
            return
        again = record.extended(max(record.steps, 1))
        again.steps = 0
        replay = replace(loop_state, controller_state=controller.initial_state())
        for k in range(record.steps):
            self._prepare(again, replay, record.steps, None)
            self._take(again, k + 1)
            again.q[k + 1], again.v[k + 1] = record.q[k + 1], record.v[k + 1]
            self._set_state(replay, again)
        loop_state.controller_state = replay.controller_state

    def _arrays_of(self, record: StateBuffers, steps: Integers) -> dict[str, Floats]:
        arrays = super()._arrays_of(record, steps)
        step, nv = self._step, self._step.model.nv
        arrays |= {name: np.zeros((2, 1 if name == "sound_steps" else nv)) for name in TOTALS}
        arrays |= {"steps_held": np.ones((1, 1)), "q_reference": step.model.neutral()[None]}
        arrays |= {name: gain[None] for name, gain in step.gain_values().items()}
        self._settling = Settling(1, step.n_modes)
        arrays |= {name: array[0] for name, array in self._settling.arrays.items()}
        if step.disturbances.pushes:
            arrays["wrenches"] = step.disturbances.wrenches(self._loop.clock.dt, steps)
        return arrays

    def _bound_calls(self, steps: Integers, *, given: bool) -> BoundSteps:
        rows, written = self._rows(steps, given=given)
        wrenches = self._arrays.get("wrenches", np.zeros((len(steps), 0)))
        rows["wrenches"] = wrenches, steps - self._first
        for name in TOTALS:
            rows[name] = self._arrays[name], steps % 2
            written[name] = self._arrays[name], (steps + 1) % 2
        controlled = self._loop.clock.is_control_step(steps) & (not given)
        pushed = self._step.pushed_steps(wrenches)
        kinds, chosen = np.unique(2 * controlled + pushed, return_inverse=True)
        kernels = [self._compiled.kernel((kind >= 2, kind % 2 == 1)) for kind in kinds.tolist()]
        return BoundSteps(kernels, chosen, rows, written, first=self._first)

    def _take(self, record: StateBuffers, end: int) -> None:
        while record.steps < end:
            stop = self._calls.run(record.steps, end)
            if stop is None:
                record.steps = end
                return
            record.steps = stop.step
            status = self._finished(record, stop)
            self._ended(record, status)
            record.steps = stop.step + 1

    def _finished(self, record: StateBuffers, stop: Stop) -> Status:
        """Complete a step in which modes of dry friction are not settled, or joints passed limits."""
        k = stop.step
        self._settling(self._calls, k, self._lanes)
        status = Status(int(self._settling.arrays["status"][0, 0, 0]))
        if status & Status.AT_LIMIT and self._stops is not None:
            before, now = (
                {
                    **{name: self._arrays[name][k + n : k + n + 1] for name in ("q", "v")},
                    **{name: self._arrays[name][[(k + n) % 2]] for name in ("max_error", "squared_errors")},
                }
                for n in (0, 1)
            )
            self._stops(np.zeros(1, dtype=np.intp), before, now, {}, self._arrays["q_reference"][0])
        return status


class CutLoop(CompiledLoop[dict[bool, BoundCuts]]):
    """A loop in pieces between engine calls: one step evaluates the controller, another holds its torque."""

    executor = PIECES
    chunk_steps = MAX_CHUNK_STEPS

    def __init__(self, loop: ClosedLoop, step: LoopStep, plant: IntegratedPlant) -> None:
        """Raises TraceError for a controller that cannot be traced."""
        super().__init__(loop, step)
        if loop.controller is not None:
            # Once suffices for a controller that is declared pure.
            refuse_irreproducible(loop.controller, repetitions=1)
        self._controlled = cut_step(step, plant, controlled=True)
        always = loop.clock.steps_per_control == 1
        self._holding = None if always else cut_step(step, plant, controlled=False)

    def _bound_calls(self, steps: Integers, *, given: bool) -> dict[bool, BoundCuts]:
        assert not given, "torques of the caller are not cut"
        inputs, outputs = (
            {name: StridedRows(array, row) for name, (array, row) in found.items()}
            for found in self._rows(steps, given=given)
        )

        def bound(step: CutStep) -> BoundCuts:
            return BoundCuts(step, inputs, outputs)

        controlled = bound(self._controlled)
        return {True: controlled, False: controlled if self._holding is None else bound(self._holding)}

    def _take(self, record: StateBuffers, end: int) -> None:
        clock = self._loop.clock
        while (k := record.steps) < end:
            controlled = self._holding is None or bool(clock.is_control_step(k))
            last = end
            if self._holding is not None:
                last = k + 1 if controlled else min(end, clock.next_control_step(k))
            bound = self._calls[controlled]
            try:
                stopped = bound.run(k - self._first, last - self._first)
            except EngineCallFailed as failed:
                error = failed.__cause__
                assert isinstance(error, Exception)
                record.steps = self._first + failed.step
                raise self._loop.engine_failed(
                    record.steps, record, error, in_controller=failed.origin == CONTROLLER
                ) from error
            finally:
                record.steps = self._first + bound.taken
            if stopped is not None:
                status = Status(int(stopped[1]))
                self._ended(record, status)
                if status & Status.AT_LIMIT:
                    self._stop(record, record.steps + 1)
                record.steps += 1

    def _stop(self, record: StateBuffers, row: int) -> None:
        """Stop the joints that passed their limits in the step to a row of the record."""
        assert self._loop.stops is not None
        stopped = self._loop.stops(record.q[row - 1], record.q[row], record.v[row])
        if stopped is not None:
            record.q[row], record.v[row] = stopped
