"""The staged executor of a closed loop: steps in compiled stages between engine calls.

It gives the record of `dynx.sim.loop.plain` to the last bit, in two thirds of the time: engine calls are all
that is left to Python. At a result that is not finite, a state that runs away or an error of an engine it
stops before the step, which the plain executor repeats and reports.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from time import perf_counter
from traceback import extract_tb
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dynx.control.base import Measurement
from dynx.control.engine_motors import EngineMotor
from dynx.errors import CompileError, TraceError
from dynx.sim.loop.controller_checks import is_row
from dynx.sim.loop.plain import DIVERGENCE_SPEED, Held, Loop
from dynx.sim.loop.record import Record
from dynx.sim.loop.stages import EngineCall, EngineCallTracer, StagedStep, refuse_impure, traced_controller
from dynx.sim.plants.integrated import IntegratedPlant
from dynx.simd.call_sequence import CallSequence, StridedRows, prepare_calls
from dynx.simd.kernel import Kernel
from dynx.spatial.scalar import Array, Floats, clamp
from dynx.trajectory.base import Setpoint

MIN_STEPS_TO_COMPILE = 256
"""Number of steps from which on tracing saves time."""

MAX_CHUNK_STEPS = 4096
"""Largest number of steps whose kernel calls are prepared together."""

PROGRESS_INTERVAL = 0.1
"""Time between two calls of `progress` [s]."""

MAX_TRACED_SUBSTEPS = 16
"""Largest number of sub-steps that are traced one after another."""

Steps = NDArray[np.int64]

Take = Callable[[int, int], bool]
"""Takes the steps from one to before another and counts them; False if something was wrong in one."""

SETPOINT = ("q_wanted", "v_wanted", "a_wanted")
NOISE = ("noise_q", "noise_v")


def staged_loop(loop: Loop, left: int) -> StagedLoop | str:
    """Return the loop in compiled stages for `left` more steps, or the reason why it has to be run
    plainly."""
    plant = loop.plant
    if left < MIN_STEPS_TO_COMPILE:
        return f"fewer than {MIN_STEPS_TO_COMPILE} steps"
    if isinstance(loop.controller, EngineMotor):
        return f"{loop.controller.name} is a motor inside the engine"
    if not isinstance(plant, IntegratedPlant):
        return f"{type(plant).__name__} has a stepper of its own"
    if plant.uncompiled:
        return f"{plant.uncompiled} not compiled"
    if plant.substeps > MAX_TRACED_SUBSTEPS:
        return f"more than {MAX_TRACED_SUBSTEPS} sub-steps"
    if left < MIN_STEPS_TO_COMPILE * plant.evaluations:
        return f"fewer than {MIN_STEPS_TO_COMPILE * plant.evaluations} steps"
    if loop.stops is not None:
        return "position limits are not compiled"
    if not plant.model.nv:
        return "the robot has no coordinates"
    if plant.model.floating and loop.sensors.noise is not None:
        return "noise on the pose of a floating base is not compiled"
    try:
        return StagedLoop(loop, plant)
    except CompileError as error:
        return str(error)


class StagedLoop:
    """A step in stages, once with the controller evaluated and once with its torque held from before."""

    def __init__(self, loop: Loop, plant: IntegratedPlant) -> None:
        """Raises CompileError for a controller that cannot be traced."""
        self._loop, self._plant = loop, plant
        nq, nv = plant.model.nq, plant.model.nv
        sizes = dict.fromkeys(("v", "held", "seen_v", *SETPOINT, *NOISE), nv) | {"t": 1}
        sizes |= dict.fromkeys(("q", "seen_q", "q_wanted"), nq)
        if loop.controller is not None:
            refuse_impure(loop.controller)
        if any(array.dtype != np.float64 for array in loop.setpoints):
            raise TraceError("the reference is not in float64")
        self._start = None if loop.controller is None else loop.controller.initial_state()
        if self._start is not None and not is_row(self._start):
            raise TraceError("the controller's state is no array (n,) of float64")
        self._state_size = 0 if self._start is None else self._start.size
        if self._state_size:
            sizes["state"] = self._state_size
        self._controlled = self._step(EngineCallTracer(sizes), controlled=True)
        always = loop.clock.steps_per_control == 1
        self._held = None if always else self._step(EngineCallTracer(sizes), controlled=False)
        self.stopped = ""
        """Reason for stopping before the end."""

    def run(self, record: Record, held: Held, end: int) -> None:
        """Step from the last state of `record` to step `end`, or until a step has to be repeated plainly."""
        begin = record.steps
        self._plant.reset(record.q[begin], record.v[begin])
        arrays = self._arrays(record, held)
        chunk = min(MIN_STEPS_TO_COMPILE, MAX_CHUNK_STEPS)
        try:
            while record.steps < end:
                first, started = record.steps, perf_counter()
                if not self._chunk(record, arrays, min(end, first + chunk)):
                    break
                if self._loop.progress is not None:
                    self._loop.progress(record.steps)
                each = (perf_counter() - started) / (record.steps - first)
                chunk = min(max(int(PROGRESS_INTERVAL / each), 1), MAX_CHUNK_STEPS)
        finally:
            k = record.steps
            if k > begin:
                held.tau = record.tau[k - 1].copy()
                if self._state_size:
                    held.controller_state = arrays["state"][k].copy()
            held.q, held.v = record.q[k].copy(), record.v[k].copy()
            self._plant.reset(held.q, held.v)

    def _step(self, tracer: EngineCallTracer, *, controlled: bool) -> StagedStep:
        """Return one step of the plant, with the torque of the controller if it is `controlled`, else that
        held."""
        loop, given = self._loop, tracer.given
        results: dict[str, Array] = {}
        unsound: Any = 0.0
        tau, state = given["held"], given.get("state", self._start)
        if loop.controller is None:
            tau = np.zeros(len(tau), dtype=object)
        elif controlled:
            q, v = given["seen_q"], given["seen_v"]
            if loop.sensors.noise is not None:
                q, v = q + given["noise_q"], v + given["noise_v"]
            measurement = Measurement(given["t"][0], q, v)
            setpoint = Setpoint(*(given[name] for name in SETPOINT))
            controller = traced_controller(loop.controller, tracer)
            try:
                tau, state = controller.torque(measurement, setpoint, state)
            except Exception as error:
                # On symbols in the place of numbers a controller of somebody else's may raise anything.
                raise TraceError(_untraceable(loop.controller.name, error)) from error
            tracer.refuse_inexact_rounding()
            if tau.shape != given["v"].shape:
                raise TraceError(f"the torque has shape {tau.shape}")
            # The sum that the plain loop looks at: a torque beyond all numbers is none, though it is cut.
            unsound = 0.0 * sum(tau.tolist(), 0.0)
            if loop.limit is not None:
                tau = clamp(tau, loop.limit)

        forward = self._plant.dynamics.bound_to_thread("forward_dynamics")

        def accelerate(q: Array, v: Array, tau: Array) -> Array:
            return tracer.record(forward, v.shape, q, v, tau, guarded=True)

        q, v, a = self._plant.advanced(accelerate, given["q"], given["v"], tau)
        results |= {"tau": tau, "a": a, "next_q": q, "next_v": v}
        if self._state_size and state is not None:
            results["next_state"] = state
        results["defect"] = np.array([v @ v + unsound], dtype=object)
        return tracer.compile(results)

    def _arrays(self, record: Record, held: Held) -> dict[str, Floats]:
        """Return the inputs and outputs of the stages by the names of their ports, a row for each (control)
        step."""
        loop, n = self._loop, len(record)
        q, v, tau = record.q, record.v, record.tau
        arrays = {"q": q, "v": v, "seen_q": q, "seen_v": v, "next_q": q, "next_v": v}
        arrays |= {"held": tau, "tau": tau, "a": record.a}
        arrays["t"] = loop.clock.times()[:, None]
        nothing = [np.broadcast_to(np.zeros(x.shape[1]), (loop.clock.n_controls, x.shape[1])) for x in (q, v)]
        silence = nothing[1]
        setpoints = (nothing[0], silence, silence) if loop.controller is None else loop.setpoints
        # The setpoints of a reference may lie column by column.
        rows = [array if array[:1].flags.c_contiguous else np.ascontiguousarray(array) for array in setpoints]
        arrays |= dict(zip(SETPOINT, rows, strict=True))
        arrays |= dict(zip(NOISE, loop.sensors.noise or (silence, silence), strict=True))
        if self._state_size:
            arrays["state"] = arrays["next_state"] = state = np.empty((n + 1, self._state_size))
            state[record.steps] = held.controller_state
        return arrays

    def _row(self, name: str, steps: Steps) -> Steps:
        """Return the row of an array that belongs to each of `steps`."""
        clock = self._loop.clock
        if name.startswith("next_"):
            return steps + 1
        if name == "held":
            return np.maximum(steps - 1, 0)
        if name in ("seen_q", "seen_v"):
            return np.maximum(steps - clock.delay_steps, 0)
        if name in SETPOINT or name in NOISE:
            return steps // clock.steps_per_control
        return steps

    def _chunk(self, record: Record, arrays: Mapping[str, Floats], end: int) -> bool:
        """Step to `end`, counting in the record; False where a step has to be repeated plainly."""
        first, per = record.steps, self._loop.clock.steps_per_control
        steps = np.arange(first, end)
        by_step = {name: StridedRows(array, self._row(name, steps)) for name, array in arrays.items()}
        last = first + len(steps)
        controlled = self._ready(self._controlled, by_step, record)
        if self._held is None:
            return controlled(first, last)
        held = self._ready(self._held, by_step, record)
        while (k := record.steps) < last:
            due = k % per == 0
            if not (controlled if due else held)(k, k + 1 if due else min(last, k - k % per + per)):
                return False
        return True

    def _ready(self, step: StagedStep, by_step: Mapping[str, StridedRows], record: Record) -> Take:
        """Return the next steps of the record as kernel and engine calls, over arrays with a row
        `by_step`."""
        first = record.steps
        still = np.zeros(len(by_step["q"].rows), dtype=np.int64)
        places = {name: np.zeros((1, size)) for name, size in (*step.sizes.items(), ("defect", 1))}
        numbers = {name: value[None] for name, value in step.numbers.items()}
        constant = {name: StridedRows(place, still) for name, place in {**places, **numbers}.items()}
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
            # A view of memory takes a row of numbers in a third of the time that an array does.
            room = found.data if found.ndim == 1 else found
            stages.append((calls.run, calls.addresses, stage.call, arguments, room, calls))
        last = prepare(step.last)
        finish, finishing = last.run, last.addresses
        defect: Any = places["defect"].reshape(1).data

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
                    if not defect[0] < DIVERGENCE_SPEED**2:
                        return False
                    defect[0] = 0.0
                k = end - first
            except Exception as error:
                # An engine may raise anything; the plain executor repeats the step and reports it.
                self.stopped = f"{type(error).__name__}: {error}"
                return False
            finally:
                record.steps = first + k
            return True

        return take


def _untraceable(name: str, error: Exception) -> str:
    """Return the message for an error of a controller on symbols, with the line of its `torque` where it was
    raised."""
    torques = [frame for frame in extract_tb(error.__traceback__) if frame.name == "torque"]
    place = f" ({Path(torques[-1].filename).name}, line {torques[-1].lineno})" if torques else ""
    return f"{name}.torque() cannot be traced: {error or type(error).__name__}{place}"
