"""One control step of a task of one robot, on floats or on symbols."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

from dynx.control.dynamics import Dynamics
from dynx.envs.robot.array_task import ArrayTask
from dynx.envs.robot.state import State
from dynx.spatial.scalar import Array

ForwardDynamics = Callable[..., Any]
"""Acceleration (nv,) of q, v and tau."""


def control_step(
    task: ArrayTask,
    robot: Dynamics,
    forward_dynamics: ForwardDynamics,
    before: State,
    actions: Sequence[Array],
) -> State:
    """Return the state after ``task.control_dt``, before the task settles it.

    `actions` has the one that acts in each step of the integrator.
    """
    q, v, memory = before
    for action in actions:
        tau = task.torque(robot, State(q, v, memory), action)
        q, v = task.advance(partial(_acceleration, forward_dynamics, tau), q, v)
    return State(q, v, memory)


def _acceleration(forward_dynamics: ForwardDynamics, tau: Array, q: Array, v: Array) -> Any:
    return forward_dynamics(q, v, tau)
