"""The hooks of a `RobotTask`, called with a check of what they return: numbers, or symbols in a kernel.

Each error names the task and the hook: ShapeError, DTypeError, or NotFiniteError for a number.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from dynx.backends.dynamics import Dynamics
from dynx.envs.task import Move, RobotTask, State, Task
from dynx.errors import ArgumentError, DTypeError, DynxError, NotFiniteError, ShapeError, shown
from dynx.model.numbers import DIVERGENCE_SPEED, positive_number, refuse_mask, whole_number
from dynx.spatial.scalar import Array


def require_settings(task: Task) -> None:
    """Raise ArgumentError for a control step or a size of a task that is not valid."""
    name = type(task).__name__
    positive_number(f"control_dt of {name}", getattr(task, "control_dt", None))
    if isinstance(task, RobotTask):
        whole_number(f"substeps of {name}", task.substeps, 1)
        whole_number(f"random_size of {name}", task.random_size, 0)


def start(task: RobotTask, random: Array, options: Mapping[str, Any]) -> State:
    """Return the state at the start of an episode; its errors name the task's ``random_size``."""
    drawn = f"random_size is {task.random_size}"
    try:
        state = task.start(random, **options)
    except (IndexError, ValueError) as error:
        if isinstance(error, DynxError):
            raise
        name = type(task).__name__
        raise ArgumentError(f"start of {name} failed: {type(error).__name__}: {error}; {drawn}") from error
    return _checked_state(task, "start", state, f"; {drawn}")


def control_step(
    task: RobotTask, robot: Dynamics, move: Move, before: State, actions: Sequence[Array]
) -> State:
    """Return the state after ``task.control_dt``, before the task settles it.

    `actions` has the one that acts in each step of the integrator.
    """
    q, v, memory = before
    for action in actions:
        tau = checked(task, "torque", task.torque(robot, State(q, v, memory), action), (task.model.nv,))
        if is_float(tau) and is_float(v) and v @ v < DIVERGENCE_SPEED**2:
            refuse_not_finite(task, "torque", tau)
        q, v = move(q, v, tau)
    return State(q, v, memory)


def settle(task: RobotTask, moved: State) -> State:
    """Return the state with which the task goes on after a control step."""
    return _checked_state(task, "settle", task.settle(moved))


def number(task: RobotTask, hook: str, value: Any) -> Any:
    """Return the one number that a hook returned, the reward or whether the episode is over."""
    found = checked(task, hook, value, ()).item()
    if isinstance(found, float):
        refuse_not_finite(task, hook, found)
    return found


def observation(task: RobotTask, robot: Dynamics, state: State) -> Array:
    """Return the observation, of the observation space's shape."""
    found = checked(task, "observation", task.observation(robot, state), task.observation_space.shape or ())
    if is_float(found):
        refuse_not_finite(task, "observation", found)
    return found


def checked(task: RobotTask, hook: str, value: Any, shape: tuple[int, ...], note: str = "") -> Array:
    """Return what a hook returned as an array of this shape: of float64, or of symbols."""
    subject = f"{hook} of {type(task).__name__}"
    try:
        if not isinstance(value, np.ndarray) or isinstance(value, np.ma.MaskedArray):
            refuse_mask(subject, value)
        array = value if isinstance(value, np.ndarray) else np.asarray(value)
    except ValueError as error:
        if isinstance(error, DynxError):
            raise
        raise ShapeError(f"{subject} is {shown(value)}; wanted shape {shape}{note}") from None
    kind = array.dtype.kind
    if kind not in "biufO" or (kind == "O" and any(map(_is_no_number, array.ravel().tolist()))):
        raise DTypeError(f"{subject} is {shown(value)}; wanted numbers of shape {shape}{note}")
    if array.shape != shape:
        raise ShapeError(f"{subject} has shape {array.shape}; wanted {shape}{note}")
    return array if kind == "O" else np.asarray(array, dtype=np.float64)


def is_float(values: Array) -> bool:
    """Check whether an array has floats, not symbols."""
    return bool(values.dtype == np.float64)


def refuse_not_finite(task: RobotTask, hook: str, values: Any) -> None:
    """Raise NotFiniteError for values of a hook that are not finite."""
    if not np.isfinite(values).all():
        raise NotFiniteError(f"{hook} of {type(task).__name__} is not finite: {shown(values)}")


def _is_no_number(entry: Any) -> bool:
    return entry is None or isinstance(entry, str | bytes | complex | Sequence | Mapping)


def _checked_state(task: RobotTask, hook: str, state: Any, note: str = "") -> State:
    name, model = type(task).__name__, task.model
    if not isinstance(state, State):
        raise DTypeError(f"{hook} of {name} returned {shown(state)}; wanted dynx.envs.State(q, v){note}")
    q = checked(task, f"q of {hook}", state.q, (model.nq,), note)
    v = checked(task, f"v of {hook}", state.v, (model.nv,), note)
    return State(q, v, checked(task, f"memory of {hook}", state.memory, (np.size(state.memory),), note))
