"""Motion of a world: its engine, its time, and the state kept last, to which it returns after a failure."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import NoReturn

import numpy as np
from numpy.typing import ArrayLike

from dynx.errors import (
    ArgumentError,
    ClosedError,
    DivergedError,
    EngineError,
    ShapeError,
    UnknownNameError,
    nearest,
    shown,
)
from dynx.model import Pose
from dynx.model.configuration import checked_q
from dynx.model.elements import rigid_matrix
from dynx.model.numbers import DIVERGENCE_SPEED, checked_array, is_real
from dynx.steppers.forces import NO_FORCES, Forces
from dynx.steppers.layout import BodyLayout, Layout, RobotLayout
from dynx.steppers.state import BodyState, PartStates, RobotState, WorldState, has_diverged
from dynx.steppers.stepper import Stepper
from dynx.world.commands import Act, Commands
from dynx.world.notes import likely_causes

Parts = Mapping[str, tuple[ArrayLike, ArrayLike | None]]


def checked_state(layout: Layout, state: WorldState | None, robots: Parts, bodies: Parts) -> WorldState:
    """Return the robots and bodies of `state`, then those given by name, all checked.

    Raises ArgumentError and its subclasses, naming the robot or body.
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
                raise UnknownNameError(f"no {kind} {shown(name)}{nearest(name, known)}")
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


def _pair(what: str, parts: str, pair: object) -> tuple[ArrayLike, ArrayLike | None]:
    if not isinstance(pair, tuple) or len(pair) != 2:
        raise ArgumentError(f"the state of {what} is {shown(pair)}; wanted a tuple {parts}")
    return pair


def _velocity(given: ArrayLike | None, length: int) -> ArrayLike:
    """Return a velocity as it was given, zero for None."""
    return np.zeros(length) if given is None else given


def _robot_state(robot: RobotLayout, pair: object) -> RobotState:
    given_q, given_v = _pair(robot.name, f"(q, v) with {robot.model.nq} and {robot.model.nv} numbers", pair)
    q = checked_q(robot.model, given_q, f"q of {robot.name}")
    v = checked_array(f"v of {robot.name}", _velocity(given_v, robot.model.nv), robot.model.nv)
    if q.ndim != 1 or v.ndim != 1:
        raise ShapeError(f"q and v of {robot.name} have shapes {q.shape} and {v.shape}; wanted one state")
    return RobotState(q.copy(), v.copy())


def _body_state(body: BodyLayout, pair: object) -> BodyState:
    pose, given_twist = _pair(body.name, "(T_world_body, twist) of shapes (4, 4) and (6,)", pair)
    # Converted to roll, pitch, yaw and back the matrix would be rounded.
    T = rigid_matrix(pose.matrix if isinstance(pose, Pose) else pose, f"pose of {body.name}").copy()
    twist = checked_array(f"twist of {body.name}", _velocity(given_twist, 6), 6)
    if twist.ndim != 1:
        raise ShapeError(f"twist of {body.name} has shape {twist.shape}; wanted (6,)")
    if body.fixed and (twist.any() or np.abs(T - body.T).max() > 1e-12):
        raise ArgumentError(f"{body.name} is fixed in the world, so that its state cannot be set")
    return BodyState(T, twist.copy())


STEPS_BETWEEN_CHECKS = 1000
"""Number of steps of the engine after which the state is checked for divergence, unless it was read."""


class Motion:
    """An engine in steps of `dt` [s], each of `substeps` steps of the engine.

    Setting or reading the state keeps it if it is finite; so does a check at least every
    `STEPS_BETWEEN_CHECKS` steps of the engine. Where an engine fails, a state is not finite, or a call is
    interrupted, the world returns to the state kept last.
    """

    def __init__(
        self, layout: Layout, commands: Commands, build: Callable[[], Stepper], dt: float, substeps: int
    ) -> None:
        """`build` opens the scene in a new engine, at its start."""
        self._layout = layout
        self._commands = commands
        self._build = build
        self._dt = dt
        self._substeps = substeps
        self._most = max(1, STEPS_BETWEEN_CHECKS // substeps)
        self._steps, self._start, self._unchecked = 0, 0.0, 0
        self._interrupted = False
        engine = build()
        self._engine: Stepper | None = engine
        self.ready: Stepper | None = engine
        """The engine, or None where `engine` must be called: after an interruption, and after `close`."""
        self._kind = engine.name
        self._kept = self._read(engine), 0, 0.0
        self._state: WorldState | None = self._kept[0]
        self._state_at_start = self._kept[0]
        """State in which the motion began: that of the scene, or the last one that was set."""

    @property
    def engine(self) -> Stepper:
        """Engine at the present state; ClosedError after `close`."""
        if self._interrupted:
            self._recover()
        if self._engine is None:
            raise ClosedError(f"the world of {self._layout.name} is closed")
        return self._engine

    @property
    def time(self) -> float:
        """Time [s]."""
        if self._interrupted:
            _, steps, start = self._kept
            return start + steps * self._dt
        return self._start + self._steps * self._dt

    @property
    def clock(self) -> tuple[float, int]:
        """The time [s] from which steps of `dt` are counted, and their number since then."""
        return self._start, self._steps

    @property
    def state(self) -> WorldState:
        """State, read from the engine once after each change; DivergedError where it is not finite."""
        _ = self.engine
        if self._state is None:
            self._read_and_keep()
        assert self._state is not None
        return self._state

    def advance(self, engine: Stepper, n: int, forces: Forces = NO_FORCES, act: Act | None = None) -> None:
        """Take `n` steps of `dt` in which `forces` act, or those that `act` returns before each step of the
        engine.

        `engine` is `ready`, or `engine` where that is None: the caller has looked it up for its commands.
        Raises DivergedError, and the errors of the engine with the likely causes appended.
        """
        try:
            while n:
                part = n if n < self._most else self._most
                count = part * self._substeps
                if act is None:
                    engine.step(count, forces)
                else:
                    self._step_one_by_one(engine, count, act)
                self._steps += part
                self._state = None
                self._unchecked += count
                n -= part
                if self._unchecked >= STEPS_BETWEEN_CHECKS:
                    self._read_and_keep()
        except BaseException as error:
            self._fail(error)
            raise

    def _step_one_by_one(self, engine: Stepper, count: int, act: Act) -> None:
        # Where motors diverge, the error says so, not warnings of NumPy.
        with np.errstate(over="ignore", invalid="ignore"):
            for taken in range(count):
                forces = act(engine)
                if forces is None:
                    self._diverge(f"a load is not finite after {taken} of {count} steps of the engine")
                engine.step(1, forces)

    def change(self, change: Callable[[Stepper], object], clock: tuple[float, int] | None = None) -> None:
        """Set the state of the engine by a function, and `clock` where it is given."""
        engine = self.engine
        try:
            self._commands.forget()
            change(engine)
            if clock is not None:
                self._start, self._steps = clock
            self._state = None
            self._read_and_keep()
            self._state_at_start = self._kept[0]
        except BaseException as error:
            self._fail(error)
            raise

    def rebuild(self, restore: Callable[[Stepper], object] | None = None) -> None:
        """Go on at the present time in a new engine, and at the present state, or at one that `restore` sets.

        Where that raises an error, the world stays as it is.
        """
        before, state = self.engine, self.state
        engine = self._build()
        try:
            if restore is None:
                apply_state(engine, state)
            else:
                restore(engine)
        except BaseException:
            engine.close()
            raise
        self._engine = self.ready = engine
        before.close()
        self._commands.forget()
        self._state = None
        self._read_and_keep()
        self._state_at_start = self._kept[0]

    def notes_on_begin(self, notes: Callable[[Stepper, WorldState], Sequence[str]]) -> Sequence[str]:
        """Return what `notes` finds at the state in which the motion began."""
        if self._state is self._state_at_start:
            return notes(self.engine, self._state_at_start)
        begun = self._build()
        try:
            apply_state(begun, self._state_at_start)
            return notes(begun, self._state_at_start)
        finally:
            begun.close()

    def reset(self) -> None:
        """Return to the start of the scene in a new engine, at time 0."""
        before = self.engine
        engine = self._build()
        try:
            self._engine = self.ready = engine
            before.close()
            self._commands.forget()
            self._start, self._steps, self._state = 0.0, 0, None
            self._read_and_keep()
            self._state_at_start = self._kept[0]
        except BaseException as error:
            self._fail(error)
            raise

    def close(self) -> None:
        """Release the engine; closing twice is harmless."""
        if self._engine is not None:
            self._engine.close()
            self._engine = self.ready = None
        self._interrupted = False

    # -- failures -----------------------------------------------------------------------------

    def _fail(self, error: BaseException) -> None:
        """Return to the state kept last after an error; after an interruption not before the next call, so
        that Ctrl-C ends a program at once."""
        if isinstance(error, DivergedError):
            return
        if isinstance(error, EngineError):
            causes = self._recover_and_explain()
            raise type(error)(f"{error}{causes}") from error.__cause__
        self._interrupted, self.ready = True, None

    def _read_and_keep(self) -> None:
        """Read the state and keep it if it is finite; otherwise return to the one kept before, and raise
        DivergedError."""
        assert self._engine is not None
        state = self._read(self._engine)
        bad = [name for name, robot in state.robots.items() if has_diverged(*robot)]
        bad += [name for name, body in state.bodies.items() if has_diverged(*body)]
        if bad:
            names = " and ".join(bad[:3])
            self._diverge(f"the state of {names} is not finite, or its velocity above {DIVERGENCE_SPEED:g}")
        self._state = state
        self._kept = state, self._steps, self._start
        self._unchecked = 0

    def _read(self, engine: Stepper) -> WorldState:
        robots = {robot.name: engine.robot_state(k) for k, robot in enumerate(self._layout.robots)}
        bodies = {body.name: engine.body_state(k) for k, body in enumerate(self._layout.bodies)}
        torques = {
            robot.name: self._commands.driving(k, engine) for k, robot in enumerate(self._layout.robots)
        }
        return WorldState(self.time, PartStates(robots), PartStates(bodies), PartStates(torques))

    def _diverge(self, reason: str) -> NoReturn:
        """Return to the state kept last, and raise DivergedError."""
        failed_at, step = self.time, self._steps
        causes = self._recover_and_explain()
        first = next(iter(self._kept[0].robots.values()), None)
        raise DivergedError(
            f"the world of {self._layout.name} diverged in {self._kind} at {failed_at:.6g} s: "
            f"{reason}{causes}; "
            f"the world is at {self.time:.6g} s again",
            time=failed_at,
            step=step,
            state=(None, None) if first is None else (first.q, first.v),
        )

    def _recover_and_explain(self) -> str:
        """Return to the state kept last; return the likely causes of the failure as part of a message."""
        loads = self._commands.last()
        self._recover()
        begun = self._build()
        try:
            apply_state(begun, self._state_at_start)
            h = self._dt / self._substeps
            causes = likely_causes(begun, self._state_at_start, self.engine, loads, h)
            causes = [*self._commands.notes_on_springs()] or causes
        finally:
            begun.close()
        return f"; likely cause: {'; '.join(causes)}" if causes else ""

    def _recover(self) -> None:
        """Rebuild the engine at the state kept last."""
        self._interrupted, self.ready = True, None
        engine = self._build()
        state, steps, start = self._kept
        apply_state(engine, state)
        self._commands.forget()
        before, self._engine, self.ready = self._engine, engine, engine
        self._steps, self._start, self._state, self._unchecked = steps, start, state, 0
        self._interrupted = False
        if before is not None:
            before.close()
