"""Tasks of a user's own in kernels: what their hooks must not depend on."""

from __future__ import annotations

from abc import ABC
from collections.abc import Callable, Mapping
from functools import cached_property, partial
from pathlib import Path
from typing import Any

from dynx.backends.dynamics import Dynamics
from dynx.control.content import is_foreign
from dynx.envs import hooks
from dynx.envs.library import spaces
from dynx.envs.task import RobotTask, State
from dynx.errors import ArgumentError
from dynx.model.elements import JointCoefficients
from dynx.sim.reproducibility import RepeatedTraces, UserTrace, shown_values, variables_of
from dynx.simd.user_code.arrays import TracedArray, traced_array
from dynx.spatial.scalar import Array


def refuse_irreproducible(
    task: RobotTask,
    sizes: tuple[int, ...],
    joints: JointCoefficients | None,
    options: Mapping[str, Any] | None = None,
) -> None:
    """Raise ArgumentError for a task of the user with a hook whose result depends on more than arguments and
    fields of the task, such as random numbers or the time, or that changes a variable.

    Each hook is traced several times, and the traces are compared. The dynamics of the robot are not traced.
    `sizes` are those of q, v and memory of a state; `joints` are the joint dynamics that hooks may read. With
    `options` of `reset` only `start` is traced.
    """
    if not _own_classes(task):
        return
    for hook, evaluate in _hooks(task, sizes, joints, options).items():
        traces = RepeatedTraces.of(partial(_trace, evaluate), partial(_variables, task))
        if traces.difference is not None:
            place, values = traces.difference
            reason = (
                f"depends on more than its arguments and the fields of the task{shown_values(values)}: "
                "random numbers, the time or a variable, which a kernel would freeze to one value"
            )
        elif traces.changed is not None:
            place, reason = "", f"changes {traces.changed}, which a kernel would do once"
        else:
            continue
        name = task.hook_names.get(hook, hook)
        raise ArgumentError(
            f"{name} of {type(task).__name__} {reason}; random numbers are the argument of start, as many as "
            "random_size says, and what changes during an episode is State.memory"
            f" ({_shown_place(place or _definition(task, name))})"
        )


def _hooks(
    task: RobotTask,
    sizes: tuple[int, ...],
    joints: JointCoefficients | None,
    options: Mapping[str, Any] | None,
) -> dict[str, Callable[[UserTrace], Any]]:
    """Return the functions that evaluate a hook in a trace, by name."""

    def start(trace: UserTrace) -> Any:
        return hooks.start(task, _symbols(trace, task.random_size), options or {})

    if options:
        return {"start": start}

    def robot(trace: UserTrace) -> Dynamics:
        dynamics = trace.dynamics(task.model)
        dynamics.joints = joints
        return dynamics

    def state(trace: UserTrace) -> State:
        return State(*(_symbols(trace, size) for size in sizes))

    def action(trace: UserTrace) -> Any:
        space = task.action_space
        shape = (1,) if isinstance(space, spaces.Discrete) else space.shape or ()
        given = _symbols(trace, *shape)
        return given[0] if isinstance(space, spaces.Discrete) else given

    def advance(trace: UserTrace) -> Any:
        def accelerate(q: Array, v: Array) -> Array:
            trace.note(q)
            trace.note(v)
            return _symbols(trace, task.model.nv)

        return task.advance(accelerate, *state(trace)[:2])

    def reward(trace: UserTrace) -> Any:
        return task.reward(robot(trace), state(trace), action(trace), state(trace))

    return {
        "start": start,
        "torque": lambda trace: task.torque(robot(trace), state(trace), action(trace)),
        "advance": advance,
        "settle": lambda trace: task.settle(state(trace)),
        "reward": reward,
        "terminated": lambda trace: task.terminated(robot(trace), state(trace)),
        "observation": lambda trace: task.observation(robot(trace), state(trace)),
    }


def _symbols(trace: UserTrace, *shape: int) -> TracedArray:
    return traced_array(trace.symbols(*shape))


def _trace(evaluate: Callable[[UserTrace], Any]) -> UserTrace:
    trace = UserTrace()
    outcome = evaluate(trace)
    for value in outcome if isinstance(outcome, tuple) else (outcome,):
        trace.note(value)
    return trace


def _variables(task: RobotTask) -> dict[str, Any]:
    """Return the attributes of a task and its classes, and variables of modules that its methods name."""
    described = task.described
    kind = type(described)
    own = {
        f"{kind.__name__}.{name}": value
        for name, value in getattr(described, "__dict__", {}).items()
        if not isinstance(getattr(kind, name, None), cached_property)
    }
    return variables_of(_own_classes(task)) | own


def _own_classes(task: RobotTask) -> list[type]:
    """Return the classes of a task that are the user's; one made by a call of `type` has the module abc."""
    kinds = type(task.described).__mro__
    return [each for each in kinds if is_foreign(each) or (each.__module__ == "abc" and each is not ABC)]


def _definition(task: RobotTask, hook: str) -> str:
    """Return file and line of a hook, or the name of a class whose hook is no function of Python."""
    code = getattr(getattr(type(task.described), hook), "__code__", None)
    return type(task).__name__ if code is None else f"{code.co_filename}:{code.co_firstlineno}"


def _shown_place(place: str) -> str:
    file, _, line = place.rpartition(":")
    return f"{Path(file).name}, line {line}" if file else place
