"""The closed loop in compiled stages: the record is that of `dynx.sim.loop.plain`, in two thirds of the time.

What is left to Python is to ask the engines. Where anything looks wrong, an answer that is not finite or
a robot that runs away, this loop stops before the step, and the plain one, which says what it is, repeats
it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dynx.control.base import Measurement
from dynx.control.engine_motors import EngineMotor
from dynx.errors import TraceError
from dynx.sim.loop.controller_checks import is_row
from dynx.sim.loop.plain import RUNAWAY, Loop
from dynx.sim.loop.stages import Ask, Glue, Questions, refuse_impure, traced_controller
from dynx.sim.plants.integrated import IntegratedPlant
from dynx.sim.record.record import Record
from dynx.simd.call_sequence import CallSequence, StridedRows, prepare_calls
from dynx.simd.kernel import Kernel
from dynx.spatial.scalar import Array, Floats, clamp
from dynx.trajectory.base import Setpoint

WORTH = 256
"""Steps from which on tracing pays."""

AT_ONCE = 4096
"""Most steps whose calls are made ready together."""

TELLING = 0.1
"""Time between two tellings of how far the loop is [s]."""

MOST_SUBSTEPS = 16
"""Sub-steps that are traced one after another."""

Steps = NDArray[np.int64]

Take = Callable[[int, int], bool]
"""Takes the steps from one to before another and counts them; False if something was wrong in one."""

SETPOINT = ("q_wanted", "v_wanted", "a_wanted")
NOISE = ("noise_q", "noise_v")


def glued(loop: Loop, record: Record) -> GluedLoop | None:
    """The loop in stages, if it can be had and there are so many steps left that it pays."""
    plant, left = loop.plant, len(record) - record.steps
    if left < WORTH or isinstance(loop.controller, EngineMotor):
        return None
    if not isinstance(plant, IntegratedPlant) or not plant.is_array_code or plant.substeps > MOST_SUBSTEPS:
        return None
    if left < WORTH * plant.evaluations:
        return None
    if loop.stops is not None or not plant.model.nv:
        return None
    if plant.model.floating and loop.sensors.noise is not None:
        return None
    try:
        return GluedLoop(loop, plant)
    except Exception:
        # What is wrong with a law, or not known of it, the plain loop finds out and says.
        return None


class GluedLoop:
    """A step in stages, once with the law asked and once with its torque held from before."""

    def __init__(self, loop: Loop, plant: IntegratedPlant) -> None:
        """Raises TraceError, and whatever a law raises, for a law that cannot be traced."""
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
            raise TraceError("what the law remembers is no array (n,) of float64")
        self._state_size = 0 if self._start is None else self._start.size
        if self._state_size:
            sizes["state"] = self._state_size
        self._asked = self._step(Questions(sizes), asked=True)
        self._held = self._step(Questions(sizes), asked=False) if loop.clock.steps_per_control > 1 else None

    def run(self, record: Record) -> None:
        """From the state in row `record.steps` until the end, or until something is wrong."""
        begin, n = record.steps, len(record)
        self._plant.reset(record.q[begin], record.v[begin])
        arrays = self._arrays(record)
        at_once = min(WORTH, AT_ONCE)
        while record.steps < n:
            first, began = record.steps, perf_counter()
            if not self._chunk(record, arrays, at_once):
                return
            if self._loop.told is not None:
                self._loop.told(record.steps)
            each = (perf_counter() - began) / (record.steps - first)
            at_once = min(max(int(TELLING / each), 1), AT_ONCE)

    def _step(self, questions: Questions, *, asked: bool) -> Glue:
        """One step of the plant, and of the law if it is `asked`."""
        loop, given = self._loop, questions.given
        results: dict[str, Array] = {}
        unsound: Any = 0.0
        tau, state = given["held"], given.get("state", self._start)
        if loop.controller is None:
            tau = np.zeros(len(tau), dtype=object)
        elif asked:
            q, v = given["seen_q"], given["seen_v"]
            if loop.sensors.noise is not None:
                q, v = q + given["noise_q"], v + given["noise_v"]
            measurement = Measurement(given["t"][0], q, v)
            law = traced_controller(loop.controller, questions)
            tau, state = law.torque(measurement, Setpoint(*(given[name] for name in SETPOINT)), state)
            questions.refuse_rounded_otherwise()
            if tau.shape != given["v"].shape:
                raise TraceError(f"the torque has shape {tau.shape}")
            # The sum that the plain loop looks at: a torque beyond all numbers is none, though it is cut.
            unsound = 0.0 * sum(tau.tolist(), 0.0)
            if loop.limit is not None:
                tau = clamp(tau, loop.limit)

        forward = self._plant.dynamics.bound_to_thread("forward_dynamics")

        def accelerate(q: Array, v: Array, tau: Array) -> Array:
            return questions.ask(forward, v.shape, q, v, tau, guarded=True)

        q, v, a = self._plant.advanced(accelerate, given["q"], given["v"], tau)
        results |= {"tau": tau, "a": a, "next_q": q, "next_v": v}
        if self._state_size and state is not None:
            results["next_state"] = state
        results["defect"] = np.array([v @ v + unsound], dtype=object)
        return questions.glue(results)

    def _arrays(self, record: Record) -> dict[str, Floats]:
        """What stages read and write, by the names of their ports; a row for a step or a control step."""
        loop, n = self._loop, len(record)
        q, v, tau = record.q, record.v, record.tau
        arrays = {"q": q, "v": v, "seen_q": q, "seen_v": v, "next_q": q, "next_v": v}
        arrays |= {"held": tau, "tau": tau, "a": record.a}
        arrays["t"] = loop.clock.times()[:, None]
        nothing = [np.broadcast_to(np.zeros(x.shape[1]), (loop.clock.n_controls, x.shape[1])) for x in (q, v)]
        silence = nothing[1]
        setpoints = (nothing[0], silence, silence) if loop.controller is None else loop.setpoints
        # A reference may hand out its columns side by side.
        rows = [array if array[:1].flags.c_contiguous else np.ascontiguousarray(array) for array in setpoints]
        arrays |= dict(zip(SETPOINT, rows, strict=True))
        arrays |= dict(zip(NOISE, loop.sensors.noise or (silence, silence), strict=True))
        if self._state_size:
            arrays["state"] = arrays["next_state"] = state = np.empty((n + 1, self._state_size))
            state[record.steps] = loop.remembered(record)
        return arrays

    def _row(self, name: str, steps: Steps) -> Steps:
        """The row of an array that belongs to each of `steps`."""
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

    def _chunk(self, record: Record, arrays: Mapping[str, Floats], at_once: int) -> bool:
        """Some steps, counted in the record as they are taken; False if something is wrong."""
        first, per = record.steps, self._loop.clock.steps_per_control
        steps = np.arange(first, min(len(record), first + at_once))
        walked = {name: StridedRows(array, self._row(name, steps)) for name, array in arrays.items()}
        last = first + len(steps)
        asked = _ready(self._asked, walked, record)
        if self._held is None:
            return asked(first, last)
        held = _ready(self._held, walked, record)
        while (k := record.steps) < last:
            due = k % per == 0
            if not (asked if due else held)(k, k + 1 if due else min(last, k - k % per + per)):
                return False
        return True


def _ready(glue: Glue, walked: Mapping[str, StridedRows], record: Record) -> Take:
    """The next steps of the record, those of `walked`, as calls."""
    first = record.steps
    still = np.zeros(len(walked["q"].rows), dtype=np.int64)
    places = {name: np.zeros((1, size)) for name, size in (*glue.sizes.items(), ("defect", 1))}
    numbers = {name: value[None] for name, value in glue.numbers.items()}
    every = {**walked, **{name: StridedRows(place, still) for name, place in {**places, **numbers}.items()}}

    def walked_by(kernel: Kernel) -> CallSequence:
        inputs, outputs = ([every[port.name] for port in side] for side in (kernel.inputs, kernel.outputs))
        return prepare_calls(kernel, inputs, outputs)

    stages: list[tuple[Callable[[int], None], range, Ask, list[Floats], Any, CallSequence]] = []
    for cut in glue.cuts:
        calls = walked_by(cut.kernel)
        arguments = [places[name].reshape(shape) for name, shape in cut.arguments]
        name, shape = cut.answer
        found = places[name].reshape(shape)
        # A view of memory takes a row of numbers in a third of the time that an array does.
        room = found.data if found.ndim == 1 else found
        stages.append((calls.run, calls.addresses, cut.ask, arguments, room, calls))
    last = walked_by(glue.last)
    finish, finishing = last.run, last.addresses
    defect: Any = places["defect"].reshape(1).data

    def take(begin: int, end: int, _kept: object = last) -> bool:
        k = begin - first
        try:
            for k in range(begin - first, end - first):
                for run, addresses, ask, arguments, answer, _ in stages:
                    run(addresses[k])
                    if defect[0] != 0.0:
                        return False
                    answer[:] = ask(*arguments)
                finish(finishing[k])
                if not defect[0] < RUNAWAY**2:
                    return False
                defect[0] = 0.0
            k = end - first
        except Exception:
            # Whatever it is, the plain loop meets it again, and says where.
            return False
        finally:
            record.steps = first + k
        return True

    return take
