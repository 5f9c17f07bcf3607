"""Motion of a world: its engine, its time, and the last finite state, to which it returns from a failure."""

from __future__ import annotations

from collections.abc import Callable
from typing import NoReturn

import numpy as np

from dynx.errors import ClosedError, DivergedError, EngineError
from dynx.model.numbers import DIVERGENCE_SPEED
from dynx.steppers.forces import NO_FORCES, Forces
from dynx.steppers.layout import Layout
from dynx.steppers.state import PartStates, WorldState, has_diverged
from dynx.steppers.stepper import Stepper
from dynx.world.commands import Act, Commands
from dynx.world.notes.divergence import likely_causes
from dynx.world.state_checks import apply_state

STEPS_BETWEEN_CHECKS = 1000
"""Number of steps of the engine after which the state is checked for divergence, unless it was read."""


class Motion:
    """An engine in steps of `dt` [s], each of `substeps` steps of the engine.

    Where an engine fails, a state is not finite, or a call is interrupted, the world is at the last state
    that was read or checked.
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
        self._good = self._read(engine), 0, 0.0
        self._state: WorldState | None = self._good[0]
        self._begun = self._good[0]
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
            _, steps, start = self._good
            return start + steps * self._dt
        return self._start + self._steps * self._dt

    @property
    def clock(self) -> tuple[float, int]:
        """Time [s] at which the steps were counted from, and their number since."""
        return self._start, self._steps

    @property
    def state(self) -> WorldState:
        """State, read from the engine once after each change; DivergedError where it is not finite."""
        _ = self.engine
        if self._state is None:
            self._note()
        assert self._state is not None
        return self._state

    def advance(self, engine: Stepper, n: int, forces: Forces = NO_FORCES, act: Act | None = None) -> None:
        """Take `n` steps of `dt` in `engine`, the present one, in which `forces` act; or those that `act`
        returns before each step of the engine.

        Raises DivergedError and the errors of the engine.
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
                    self._note()
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
            self._note()
            self._begun = self._good[0]
        except BaseException as error:
            self._fail(error)
            raise

    def reset(self) -> None:
        """Return to the start of the scene in a new engine, at time 0."""
        before = self.engine
        engine = self._build()
        try:
            self._engine = self.ready = engine
            before.close()
            self._commands.forget()
            self._start, self._steps, self._state = 0.0, 0, None
            self._note()
            self._begun = self._good[0]
        except BaseException as error:
            self._fail(error)
            raise

    def close(self) -> None:
        """Release the engine; closing twice is harmless."""
        if self._engine is not None:
            self._engine.close()
            self._engine = self.ready = None

    # -- failures -----------------------------------------------------------------------------

    def _fail(self, error: BaseException) -> None:
        """Return to the last finite state after an error; after an interruption not before the next call, so
        that Ctrl-C ends a program at once."""
        if isinstance(error, DivergedError):
            return
        if isinstance(error, EngineError):
            causes = self._recover_and_explain()
            raise type(error)(f"{error}{causes}") from error.__cause__
        self._interrupted, self.ready = True, None

    def _note(self) -> None:
        """Read the state; keep it if it is finite, otherwise go back to the one kept before."""
        assert self._engine is not None
        state = self._read(self._engine)
        bad = [name for name, robot in state.robots.items() if has_diverged(*robot)]
        bad += [name for name, body in state.bodies.items() if has_diverged(*body)]
        if bad:
            names = " and ".join(bad[:3])
            self._diverge(f"the state of {names} is not finite, or its velocity above {DIVERGENCE_SPEED:g}")
        self._state = state
        self._good = state, self._steps, self._start
        self._unchecked = 0

    def _read(self, engine: Stepper) -> WorldState:
        robots = {robot.name: engine.robot_state(k) for k, robot in enumerate(self._layout.robots)}
        bodies = {body.name: engine.body_state(k) for k, body in enumerate(self._layout.bodies)}
        return WorldState(self.time, PartStates(robots), PartStates(bodies))

    def _diverge(self, reason: str) -> NoReturn:
        """Return to the last state that was finite, and raise DivergedError."""
        failed_at, step = self.time, self._steps
        causes = self._recover_and_explain()
        first = next(iter(self._good[0].robots.values()), None)
        raise DivergedError(
            f"the world of {self._layout.name} diverged in {self._kind} at {failed_at:.6g} s: "
            f"{reason}{causes}; "
            f"the world is at {self.time:.6g} s again",
            time=failed_at,
            step=step,
            state=(None, None) if first is None else (first.q, first.v),
        )

    def _recover_and_explain(self) -> str:
        """Return to the last finite state; return the likely causes of the failure as part of a message."""
        loads = self._commands.last()
        self._recover()
        begun = self._build()
        try:
            apply_state(begun, self._begun)
            causes = likely_causes(begun, self._begun, self.engine, loads, self._dt / self._substeps)
        finally:
            begun.close()
        return f"; likely cause: {'; '.join(causes)}" if causes else ""

    def _recover(self) -> None:
        """Rebuild the engine at the last state that was finite."""
        self._interrupted, self.ready = True, None
        engine = self._build()
        state, steps, start = self._good
        apply_state(engine, state)
        self._commands.forget()
        before, self._engine, self.ready = self._engine, engine, engine
        self._steps, self._start, self._state, self._unchecked = steps, start, state, 0
        self._interrupted = False
        if before is not None:
            before.close()
