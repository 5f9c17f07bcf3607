"""Controllers of a user's own on symbols: their arrays, their errors, and what they must not depend on."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from types import CodeType, FrameType, FunctionType
from typing import Any

import numpy as np

from dynx.backends.dynamics import MATRICES, Dynamics, Evaluation
from dynx.control.base import Controller, Measurement, chain_of, rebind
from dynx.control.content import attributes_of, is_foreign, is_foreign_module
from dynx.errors import TraceError
from dynx.sim.controller_checks import ControllerWatch, defect_of_outcome
from dynx.simd.expr import Symbol
from dynx.simd.user_code.arrays import symbol_array, traced_array
from dynx.simd.user_code.numbers import as_traced
from dynx.simd.user_code.reproducibility import LocatedGraph, first_difference
from dynx.spatial.scalar import Array
from dynx.trajectory.base import Setpoint

REPETITIONS = 4
"""Number of traces that are compared with the first one."""


def is_own(controller: Controller[Any]) -> bool:
    """Check whether a class outside dynx computes the torque, or a part of it."""
    return any(is_foreign(type(each)) for each in chain_of(controller))


def traced_torque(
    controller: Controller[Any], measurement: Measurement, setpoint: Setpoint, state: Any
) -> Any:
    """Return what `torque` returns for arrays of symbols, with plain symbols in arrays of floats' shape.

    Raises TraceError, with the line of the user's code, for a controller that cannot be traced.
    """
    own = is_own(controller)
    if own:
        t: Any = as_traced(measurement.t)
        random, q, v, *wanted = map(_user_array, (measurement.random, *measurement[1:], *setpoint))
        measurement, setpoint = Measurement(t, q, v).with_random(random), Setpoint(*wanted)
        state = traced_array(state) if isinstance(state, np.ndarray) else state
    try:
        outcome = controller.torque(measurement, setpoint, state)
    except Exception as error:
        # A user's controller may raise anything when it gets symbols instead of numbers.
        raise TraceError(_failure(controller, error)) from error
    if not own or defect_of_outcome(outcome):
        return outcome
    tau, after = outcome
    return symbol_array(tau), after if after is None else symbol_array(after)


def _user_array(values: Any) -> Any:
    return traced_array(values)


def refuse_irreproducible(controller: Controller[Any], repetitions: int = REPETITIONS) -> None:
    """Raise TraceError for a controller of the user whose torque depends on more than arguments and
    attributes, such as random numbers or the time.

    It is traced several times, and the traces are compared. The dynamics of its model are not traced.
    """
    if not is_own(controller):
        return
    one, other = controller.initial_state(), controller.initial_state()
    if isinstance(one, np.ndarray) and not np.array_equal(one, other, equal_nan=True):
        raise TraceError(f"{controller.name}.initial_state() returns another state in each call")
    watch, variables = ControllerWatch(controller), _variables(controller)
    first = _Trace(controller)
    for _ in range(repetitions):
        again = _Trace(controller)
        found = first_difference(first.graph, first.results, again.graph, again.results)
        if found is not None:
            raise TraceError(_difference(controller, *found))
    if watch.changed:
        raise TraceError(f"{watch.changed}: let torque return what changes as its state")
    after = _variables(controller)
    changed = next((name for name, value in variables.items() if after.get(name) is not value), None)
    if changed is not None:
        file, line = _definition(controller)
        raise TraceError(
            f"{controller.name}.torque() changes {changed}, a variable of its module or class "
            f"({Path(file).name}, line {line})"
        )


def _variables(controller: Controller[Any]) -> dict[str, Any]:
    """Return the attributes of the user's classes, and the variables of modules that their methods name."""
    found: dict[str, Any] = {}
    chain = list(chain_of(controller))
    waiting = [value for each in chain for value in attributes_of(each).values()]
    for kind in {kind for each in chain for kind in type(each).__mro__ if is_foreign(kind)}:
        found |= {f"{kind.__qualname__}.{name}": value for name, value in vars(kind).items()}
        waiting += vars(kind).values()
    seen: set[CodeType] = set()
    while waiting:
        function = waiting.pop()
        if not isinstance(function, FunctionType) or function.__code__ in seen:
            continue
        seen.add(function.__code__)
        for name in _names(function.__code__) & function.__globals__.keys():
            found[name] = value = function.__globals__[name]
            if is_foreign_module(getattr(value, "__module__", "dynx")):
                waiting.append(value)
    return found


def _names(code: CodeType) -> set[str]:
    """Return the names that a code and the functions in it refer to."""
    inner = (each for each in code.co_consts if isinstance(each, CodeType))
    return {*code.co_names}.union(*map(_names, inner))


class _Trace:
    """One trace of a torque, with symbols for the results of the dynamics."""

    def __init__(self, controller: Controller[Any]) -> None:
        self.graph = LocatedGraph()
        self._slots = 0
        self._values: list[Any] = []
        model = controller.model
        q, v = (self.symbols(size) for size in (model.nq, model.nv))
        setpoint = Setpoint(*(self.symbols(size) for size in (model.nq, model.nv, model.nv)))
        start = controller.initial_state()
        state = self.symbols(*start.shape) if isinstance(start, np.ndarray) else start
        copy = rebind(controller, lambda dynamics: _SymbolicResults(dynamics.model, self), lambda _: {})
        t: Any = self.symbols()[()]
        measurement = Measurement(t, q, v).with_random(self.symbols(controller.random_size))
        outcome = traced_torque(copy, measurement, setpoint, state)
        self._values += outcome if isinstance(outcome, tuple) else (outcome,)
        self.results = list(self._indices())

    def symbols(self, *shape: int) -> Array:
        """Return an array of new inputs."""
        entries = np.empty(shape, dtype=object)
        for place in np.ndindex(*shape):
            entries[place] = Symbol(self.graph, self.graph.input(self._slots))
            self._slots += 1
        return entries

    def note(self, values: Any) -> None:
        """Count the arguments of an evaluation of the dynamics among the results."""
        self._values.append(values)

    def _indices(self) -> Iterator[int]:
        for value in self._values:
            for entry in np.asarray(value, dtype=object).ravel().tolist():
                if isinstance(entry, Symbol):
                    yield entry.index
                elif isinstance(entry, int | float | np.number):
                    yield self.graph.constant(float(entry))


class _SymbolicResults(Dynamics):
    """Dynamics whose results are symbols of their own."""

    def __init__(self, model: Any, trace: _Trace) -> None:
        self._trace = trace
        super().__init__(model)

    def evaluation(self, quantity: str) -> Evaluation:
        """Return the function that notes its arguments and returns new symbols."""
        nv = self.model.nv
        shape = {
            **dict.fromkeys(MATRICES, (nv, nv)),
            "forward_kinematics": (4, 4),
            "jacobian": (6, nv),
            "jacobian_derivative": (6, nv),
            "frame_acceleration": (6,),
        }.get(quantity, (nv,))

        def evaluate(*arguments: Any, **options: Any) -> Array:
            for argument in (*arguments, *options.values()):
                if isinstance(argument, str):
                    continue
                self._trace.note(argument)
            return traced_array(self._trace.symbols(*shape))

        return evaluate


def _difference(controller: Controller[Any], place: str, values: tuple[float, float] | None) -> str:
    # A number that meets no symbol is noted here, not in the user's code.
    file, _, line = place.rpartition(":")
    if not place or file == __file__:
        file, line = _definition(controller)
    how = "" if values is None else f", {values[0]:.12g} in one call and {values[1]:.12g} in the next"
    return (
        f"{controller.name}.torque() depends on more than its arguments and attributes{how}: random numbers, "
        "the time or a variable of the module, which tracing would freeze to one value; a controller with an "
        "attribute random_size gets as many seeded random numbers in each control step, measurement.random; "
        "noise of the measurements is noise=dynx.Noise(...), numbers that differ between rollouts are "
        "gains={...} "
        f"({Path(file).name}, line {line})"
    )


def _definition(controller: Controller[Any]) -> tuple[str, str]:
    """Return file and line of the first method `torque` of the user."""
    own = next(each for each in chain_of(controller) if is_foreign(type(each)))
    code = getattr(type(own).torque, "__code__", None)
    return (own.name, "0") if code is None else (code.co_filename, str(code.co_firstlineno))


def _failure(controller: Controller[Any], error: Exception) -> str:
    """Return the message for an error of a controller on symbols, with the line of the user's code."""
    text = str(error) or type(error).__name__
    if not isinstance(error, TraceError):
        text = f"{type(error).__name__}: {text}"
    frames = list(_frames(error))
    modules = [frame.f_globals.get("__name__", "") for frame, _ in frames]
    if any(name.startswith(("dynx.backends.", "dynx.engines.")) for name in modules):
        text += "; a backend takes numbers only, control.model_dynamics(model, backend) traced arrays too"
    lines = [
        (frame.f_code.co_filename, line)
        for (frame, line), name in zip(frames, modules, strict=True)
        if is_foreign_module(name)
    ] or [(frame.f_code.co_filename, line) for frame, line in frames if frame.f_code.co_name == "torque"]
    place = ""
    if lines:
        file, line = lines[-1]
        text = text.removeprefix(f"{file}:{line} ")
        place = f" ({Path(file).name}, line {line})"
    return f"{controller.name}.torque() cannot be traced: {text}{place}"


def _frames(error: Exception) -> Iterator[tuple[FrameType, int]]:
    """Yield the frames that an exception passed, from the outermost, with their lines."""
    trace = error.__traceback__
    while trace is not None:
        yield trace.tb_frame, trace.tb_lineno
        trace = trace.tb_next
