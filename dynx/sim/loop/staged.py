"""The staged executor of a closed loop: steps in compiled stages between engine calls.

It gives the record of `dynx.sim.loop.plain` to the last bit, in two thirds of the time: only the engine calls
are left to Python. If a result is not finite, the state diverges or an engine raises an error, it stops
before that step; the plain executor then repeats the step and reports the error.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import partial
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dynx.control.bullet import BulletMotor
from dynx.errors import CompileError, TraceError
from dynx.sim.loop.controller_checks import (
    defect_of_next_state,
    defect_of_outcome,
    defect_of_torque,
    is_row,
)
from dynx.sim.loop.own_controllers import refuse_irreproducible, traced_torque
from dynx.sim.loop.plain import Loop, LoopState
from dynx.sim.loop.record import Record
from dynx.sim.loop.stages import EngineCall, EngineCallTracer, StagedStep, refuse_impure, traced_controller
from dynx.sim.plants.integrated import IntegratedPlant
from dynx.sim.step import MAX_SQUARED_SPEED, measure, squared_speed, torque_sum
from dynx.simd.call_sequence import CallSequence, StridedRows, prepare_calls
from dynx.simd.kernel import Kernel
from dynx.spatial.scalar import Array, Floats, clamp
from dynx.trajectory.base import Setpoint

MIN_STEPS_TO_COMPILE = 256
"""Smallest number of steps for which tracing saves time."""

MAX_CHUNK_STEPS = 4096
"""Largest number of steps whose kernel calls are prepared together."""

PROGRESS_INTERVAL = 0.1
"""Time between two calls of `progress` [s]."""

MAX_TRACED_SUBSTEPS = 16
"""Largest number of sub-steps in one traced step."""

Steps = NDArray[np.int64]

TakeSteps = Callable[[int, int], bool]
"""Function that takes the steps from the first number to before the second and counts them; it returns
False if a step has to be repeated by the plain executor."""

SETPOINT = ("q_wanted", "v_wanted", "a_wanted")
NOISE = ("noise_q", "noise_v", "random")


def staged_loop(loop: Loop, left: int) -> StagedLoop | str:
    """Compile the loop into stages for `left` more steps; return the reason if it is impossible or slow."""
    plant = loop.plant
    if left < MIN_STEPS_TO_COMPILE:
        return f"fewer than {MIN_STEPS_TO_COMPILE} steps"
    if isinstance(loop.controller, BulletMotor):
        return f"{loop.controller.name} is a motor inside the engine"
    if not isinstance(plant, IntegratedPlant):
        return f"{type(plant).__name__} has a stepper of its own"
    if plant.uncompiled:
        return f"{plant.uncompiled} not compiled"
    if plant.substeps > MAX_TRACED_SUBSTEPS:
        return f"more than {MAX_TRACED_SUBSTEPS} sub-steps"
    if left < MIN_STEPS_TO_COMPILE * plant.evaluations:
        return f"fewer than {MIN_STEPS_TO_COMPILE * plant.evaluations} steps"
    if not plant.model.nv:
        return "the robot has no coordinates"
    if plant.model.floating and loop.sensors.noise is not None:
        return "noise on the pose of a floating base is not compiled"
    try:
        return StagedLoop(loop, plant)
    except CompileError as error:
        return str(error)


class StagedLoop:
    """A loop in compiled stages: one step evaluates the controller, another holds its last torque."""

    def __init__(self, loop: Loop, plant: IntegratedPlant) -> None:
        """Raises CompileError for a controller that cannot be traced."""
        self._loop, self._plant = loop, plant
        nq, nv = plant.model.nq, plant.model.nv
        sizes = dict.fromkeys(("v", "last_tau", "measured_v", *SETPOINT, *NOISE), nv) | {"t": 1}
        sizes |= dict.fromkeys(("q", "measured_q", "q_wanted"), nq)
        sizes["random"] = 0 if loop.sensors.random is None else loop.sensors.random.shape[1]
        if loop.controller is not None:
            refuse_impure(loop.controller)
        if any(array.dtype != np.float64 for array in loop.setpoints):
            raise TraceError("the reference is not in float64")
        self._start = None if loop.controller is None else loop.controller.initial_state()
        if self._start is not None and not is_row(self._start):
            raise TraceError("the controller's state is no array (n,) of float64")
        if loop.controller is not None:
            # Once suffices for a controller that is declared pure.
            refuse_irreproducible(loop.controller, repetitions=1)
        self._state_size = 0 if self._start is None else self._start.size
        if self._state_size:
            sizes["state"] = self._state_size
        self._controlled = self._step(EngineCallTracer(sizes), controlled=True)
        always = loop.clock.steps_per_control == 1
        self._holding_step = None if always else self._step(EngineCallTracer(sizes), controlled=False)
        self.stopped = ""
        """Reason for stopping before the end."""

    def run(self, record: Record, loop_state: LoopState, end: int) -> None:
        """Step from the last state of `record` to `end`, or until the plain executor has to repeat a step."""
        begin = record.steps
        self._plant.reset(record.q[begin], record.v[begin])
        arrays = self._arrays(record, loop_state)
        # The first chunk is short where it is timed, so that `progress` is called in time.
        chunk = MAX_CHUNK_STEPS if self._loop.progress is None else MIN_STEPS_TO_COMPILE
        try:
            while record.steps < end:
                first, started = record.steps, perf_counter()
                if not self._take_chunk(record, arrays, min(end, first + chunk)):
                    break
                if self._loop.progress is not None:
                    self._loop.progress(record.steps)
                    each = (perf_counter() - started) / (record.steps - first)
                    chunk = min(max(int(PROGRESS_INTERVAL / each), 1), MAX_CHUNK_STEPS)
        finally:
            k = record.steps
            if k > begin:
                loop_state.tau = record.tau[k - 1].copy()
                if self._state_size:
                    loop_state.controller_state = arrays["state"][k].copy()
            loop_state.q, loop_state.v = record.q[k].copy(), record.v[k].copy()
            self._plant.reset(loop_state.q, loop_state.v)

    def _step(self, tracer: EngineCallTracer, *, controlled: bool) -> StagedStep:
        """Compile one step of the plant, which evaluates the controller if `controlled` and holds its last
        torque otherwise."""
        loop, given = self._loop, tracer.given
        results: dict[str, Array] = {}
        excess: Any = 0.0
        tau, state = given["last_tau"], given.get("state", self._start)
        if loop.controller is None:
            tau = np.zeros(len(tau), dtype=object)
        elif controlled:
            measurement = measure(
                self._plant.model,
                given["t"][0],
                given["measured_q"],
                given["measured_v"],
                None if loop.sensors.noise is None else (given["noise_q"], given["noise_v"]),
                given["random"],
            )
            setpoint = Setpoint(*(given[name] for name in SETPOINT))
            controller = traced_controller(loop.controller, tracer)
            outcome = traced_torque(controller, measurement, setpoint, state)
            tracer.refuse_inexact_rounding()
            defect = defect_of_outcome(outcome)
            if defect is None:
                tau, state = outcome
                defect = defect_of_torque(tau, given["v"].shape) or defect_of_next_state(self._start, state)
            if defect:
                raise TraceError(defect)
            excess = 0.0 * torque_sum(tau)
            if loop.limit is not None:
                tau = clamp(tau, loop.limit)

        record = partial(tracer.record, guarded=True)
        q, v, a = self._plant.advanced(record, given["q"], given["v"], tau)
        results |= {"tau": tau, "a": a, "next_q": q, "next_v": v}
        if self._state_size and state is not None:
            results["next_state"] = state
        results["defect"] = np.array([squared_speed(v) + excess], dtype=object)
        if loop.stops is not None:
            results["beyond"] = np.array([loop.stops.excess(q)], dtype=object)
        return tracer.compile(results)

    def _stop(self, record: Record, row: int) -> None:
        """Stop the joints that are beyond their limits in a row of the record."""
        assert self._loop.stops is not None
        stopped = self._loop.stops(record.q[row], record.v[row])
        if stopped is not None:
            record.q[row], record.v[row] = stopped

    def _arrays(self, record: Record, loop_state: LoopState) -> dict[str, Floats]:
        """Return the inputs and outputs of the stages by the names of their ports, with one row for each
        step or control step."""
        loop, n = self._loop, len(record)
        q, v, tau = record.q, record.v, record.tau
        arrays = {"q": q, "v": v, "measured_q": q, "measured_v": v, "next_q": q, "next_v": v}
        arrays |= {"last_tau": tau, "tau": tau, "a": record.a}
        arrays["t"] = loop.clock.times()[:, None]
        nothing = [np.broadcast_to(np.zeros(x.shape[1]), (loop.clock.n_controls, x.shape[1])) for x in (q, v)]
        zeros = nothing[1]
        setpoints = (nothing[0], zeros, zeros) if loop.controller is None else loop.setpoints
        # The setpoints of a reference may be stored column by column.
        rows = [array if array[:1].flags.c_contiguous else np.ascontiguousarray(array) for array in setpoints]
        arrays |= dict(zip(SETPOINT, rows, strict=True))
        random = zeros[:, :0] if loop.sensors.random is None else loop.sensors.random
        arrays |= dict(zip(NOISE, (*(loop.sensors.noise or (zeros, zeros)), random), strict=True))
        if self._state_size:
            arrays["state"] = arrays["next_state"] = state = np.empty((n + 1, self._state_size))
            state[record.steps] = loop_state.controller_state
        return arrays

    def _rows(self, names: Iterable[str], steps: Steps) -> dict[str, Steps]:
        """Return the indices of the rows that `steps` use in the arrays of those names."""
        clock = self._loop.clock
        following, measured, control = steps + 1, clock.measured_step(steps), clock.control_number(steps)
        rows = {name: following if name.startswith("next_") else steps for name in names}
        rows |= {"last_tau": np.maximum(steps - 1, 0), "measured_q": measured, "measured_v": measured}
        return rows | dict.fromkeys((*SETPOINT, *NOISE), control)

    def _take_chunk(self, record: Record, arrays: Mapping[str, Floats], end: int) -> bool:
        """Step to `end` and count the steps in the record; return False where a step has to be repeated by
        the plain executor."""
        first, clock = record.steps, self._loop.clock
        steps = np.arange(first, end)
        rows = self._rows(arrays, steps)
        by_step = {name: StridedRows(array, rows[name]) for name, array in arrays.items()}
        last = first + len(steps)
        controlled = self._prepared_steps(self._controlled, by_step, record)
        if self._holding_step is None:
            return controlled(first, last)
        holding = self._prepared_steps(self._holding_step, by_step, record)
        while (k := record.steps) < last:
            if clock.is_control_step(k):
                taken = controlled(k, k + 1)
            else:
                taken = holding(k, min(last, clock.next_control_step(k)))
            if not taken:
                return False
        return True

    def _prepared_steps(
        self, step: StagedStep, by_step: Mapping[str, StridedRows], record: Record
    ) -> TakeSteps:
        """Prepare kernel and engine calls of the next steps; `by_step` has the rows of arrays they use."""
        first = record.steps
        first_rows = np.broadcast_to(np.int64(0), by_step["q"].rows.shape)
        places = {
            name: np.zeros((1, size)) for name, size in (*step.sizes.items(), ("defect", 1), ("beyond", 1))
        }
        numbers = {name: value[None] for name, value in step.numbers.items()}
        constant = {name: StridedRows(place, first_rows) for name, place in {**places, **numbers}.items()}
        every = {**by_step, **constant}

        def prepare(kernel: Kernel) -> CallSequence:
            inputs = [every[port.name] for port in kernel.inputs]
            return prepare_calls(kernel, inputs, [every[port.name] for port in kernel.outputs])

        stages: list[tuple[Callable[[int], None], range, EngineCall, list[Floats], Any, CallSequence]] = []
        for stage in step.stages:
            calls = prepare(stage.kernel)
            arguments = [places[name].reshape(shape) for name, shape in stage.arguments]
            name, shape = stage.result
            found = places[name].reshape(shape)
            # Assigning to a memory view takes a third of the time of assigning to an array.
            memory = found.data if found.ndim == 1 else found
            stages.append((calls.run, calls.addresses, stage.call, arguments, memory, calls))
        last = prepare(step.last)
        finish, finishing = last.run, last.addresses
        defect: Any = places["defect"].reshape(1).data
        beyond: Any = places["beyond"].reshape(1).data
        stop = self._stop if self._loop.stops is not None else None

        def take(begin: int, end: int, _kept: object = last) -> bool:
            k = begin - first
            try:
                for k in range(begin - first, end - first):
                    for run, addresses, call, arguments, result, _ in stages:
                        run(addresses[k])
                        if defect[0] != 0.0:
                            return False
                        result[:] = call(*arguments)
                    finish(finishing[k])
                    if not defect[0] < MAX_SQUARED_SPEED:
                        return False
                    defect[0] = 0.0
                    if stop is not None and beyond[0] > 0.0:
                        stop(record, first + k + 1)
                k = end - first
            except Exception as error:
                # An engine may raise anything; the plain executor repeats the step and reports it.
                self.stopped = f"{type(error).__name__}: {error}"
                return False
            finally:
                record.steps = first + k
            return True

        return take
