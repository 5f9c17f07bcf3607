"""Controllers of a user's own on symbols: their arrays, their errors, and what they must not depend on."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from pathlib import Path
from types import FrameType
from typing import Any

import numpy as np

from dynx.control.base import Controller, Measurement, chain_of, rebind
from dynx.control.content import attributes_of, is_foreign, is_foreign_module
from dynx.errors import TraceError
from dynx.sim.controller_checks import ControllerWatch, defect_of_outcome
from dynx.sim.reproducibility import (
    REPETITIONS,
    RepeatedTraces,
    UserTrace,
    shown_values,
    variables_of,
)
from dynx.simd.user_code.arrays import symbol_array, traced_array
from dynx.simd.user_code.numbers import as_traced
from dynx.trajectory.base import Setpoint


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
    watch = ControllerWatch(controller)
    difference, changed = RepeatedTraces.of(
        partial(_trace, controller), partial(_variables, controller), repetitions
    )
    if difference is not None:
        raise TraceError(_difference(controller, *difference))
    if watch.changed:
        raise TraceError(f"{watch.changed}: let torque return what changes as its state")
    if changed is not None:
        file, line = _definition(controller)
        raise TraceError(
            f"{controller.name}.torque() changes {changed}, a variable of its module or class "
            f"({Path(file).name}, line {line})"
        )


def _variables(controller: Controller[Any]) -> dict[str, Any]:
    """Return the attributes of the user's classes, and the variables of modules that their methods name."""
    chain = list(chain_of(controller))
    kinds = dict.fromkeys(kind for each in chain for kind in type(each).__mro__ if is_foreign(kind))
    return variables_of(kinds, (value for each in chain for value in attributes_of(each).values()))


def _trace(controller: Controller[Any]) -> UserTrace:
    """Trace the torque once, with symbols for the results of the dynamics."""
    trace, model = UserTrace(), controller.model
    q, v = (trace.symbols(size) for size in (model.nq, model.nv))
    setpoint = Setpoint(*(trace.symbols(size) for size in (model.nq, model.nv, model.nv)))
    start = controller.initial_state()
    state = trace.symbols(*start.shape) if isinstance(start, np.ndarray) else start
    copy = rebind(controller, lambda dynamics: trace.dynamics(dynamics.model), lambda _: {})
    t: Any = trace.symbols()[()]
    measurement = Measurement(t, q, v).with_random(trace.symbols(controller.random_size))
    outcome = traced_torque(copy, measurement, setpoint, state)
    for value in outcome if isinstance(outcome, tuple) else (outcome,):
        trace.note(value)
    return trace


def _difference(controller: Controller[Any], place: str, values: tuple[float, float] | None) -> str:
    file, _, line = place.rpartition(":")
    if not place:
        file, line = _definition(controller)
    return (
        f"{controller.name}.torque() depends on more than its arguments and attributes"
        f"{shown_values(values)}: random numbers, "
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
