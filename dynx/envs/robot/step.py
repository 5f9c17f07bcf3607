"""One control step of a task of one robot, on floats or on symbols."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from dynx.control.dynamics import Dynamics
from dynx.envs.robot.array_task import ArrayTask
from dynx.envs.robot.state import State
from dynx.spatial.scalar import Array

ForwardDynamics = Callable[..., Any]
"""Acceleration (nv,) of q, v and tau."""


def control_step(
    task: ArrayTask, robot: Dynamics, forward_dynamics: ForwardDynamics, before: State, action: Array
) -> State:
    """Return the state after an action has acted for ``task.control_dt``, before the task settles it."""
    q, v, memory = before
    for _ in range(task.substeps):
        tau = task.torque(robot, State(q, v, memory), action)
        q, v = task.advance(lambda q, v, tau=tau: forward_dynamics(q, v, tau), q, v)  # type: ignore[misc]
    return State(q, v, memory)
