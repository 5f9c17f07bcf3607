"""Checks of states that users give, and their transfer to an engine."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from dynx.errors import ArgumentError, ShapeError, UnknownNameError, nearest, shown
from dynx.model import Pose
from dynx.model.configuration import checked_q
from dynx.model.numbers import checked_array, is_real
from dynx.steppers.layout import BodyLayout, Layout, RobotLayout
from dynx.steppers.state import BodyState, RobotState, WorldState
from dynx.steppers.stepper import Stepper

Parts = Mapping[str, tuple[ArrayLike, ArrayLike]]


def checked_state(layout: Layout, state: WorldState | None, robots: Parts, bodies: Parts) -> WorldState:
    """Return the robots and bodies of `state`, then those given by name, all checked.

    Raises ArgumentError and its kinds, naming the robot or body.
    """
    time = 0.0
    if state is not None:
        if not isinstance(state, WorldState):
            raise ArgumentError(f"state is of type {type(state).__name__}; wanted a WorldState")
        if not is_real(state.time) or not np.isfinite(state.time):
            raise ArgumentError(f"time of the state is {shown(state.time)}; wanted seconds")
        time = float(state.time)
        robots, bodies = {**state.robots, **robots}, {**state.bodies, **bodies}
    known_robots = {robot.name: robot for robot in layout.robots}
    known_bodies = {body.name: body for body in layout.bodies}
    for kind, given, known in (("robot", robots, known_robots), ("body", bodies, known_bodies)):
        for name in given:
            if name not in known:
                raise UnknownNameError(f"no {kind} {shown(name)}{nearest(str(name), known)}")
    return WorldState(
        time,
        {name: _robot_state(known_robots[name], pair) for name, pair in robots.items()},
        {name: _body_state(known_bodies[name], pair) for name, pair in bodies.items()},
    )


def apply_state(engine: Stepper, state: WorldState) -> None:
    """Set the robots and the moving bodies of a checked state."""
    for k, robot in enumerate(engine.layout.robots):
        if robot.name in state.robots:
            engine.set_robot_state(k, *state.robots[robot.name])
    for k, body in enumerate(engine.layout.bodies):
        if body.name in state.bodies and not body.fixed:
            engine.set_body_state(k, *state.bodies[body.name])


def _pair(what: str, parts: str, pair: object) -> tuple[ArrayLike, ArrayLike]:
    if not isinstance(pair, tuple) or len(pair) != 2:
        raise ArgumentError(f"the state of {what} is {shown(pair)}; wanted a pair {parts}")
    return pair


def _robot_state(robot: RobotLayout, pair: object) -> RobotState:
    given_q, given_v = _pair(robot.name, f"(q, v) with {robot.model.nq} and {robot.model.nv} numbers", pair)
    q = checked_q(robot.model, given_q, f"q of {robot.name}")
    v = checked_array(f"v of {robot.name}", given_v, robot.model.nv)
    if q.ndim != 1 or v.ndim != 1:
        raise ShapeError(f"q and v of {robot.name} have shapes {q.shape} and {v.shape}; wanted one state")
    return RobotState(q.copy(), v.copy())


def _body_state(body: BodyLayout, pair: object) -> BodyState:
    pose, given_twist = _pair(body.name, "(T_world_body, twist) of shapes (4, 4) and (6,)", pair)
    if isinstance(pose, Pose):
        pose = pose.matrix
    # This checks the matrix; converted to roll, pitch, yaw and back it would be rounded.
    Pose.from_matrix(pose, f"pose of {body.name}")
    T = np.array(pose, dtype=np.float64)
    twist = checked_array(f"twist of {body.name}", given_twist, 6)
    if twist.ndim != 1:
        raise ShapeError(f"twist of {body.name} has shape {twist.shape}; wanted (6,)")
    if body.fixed and (twist.any() or np.abs(T - body.T).max() > 1e-12):
        raise ArgumentError(f"{body.name} is fixed in the world, so that its state cannot be set")
    return BodyState(T, twist.copy())
