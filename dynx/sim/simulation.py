"""A simulation that is stepped in the caller's own loop; `dynx.simulate` runs one to its end."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from types import TracebackType
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from dynx.backends import backend
from dynx.errors import ArgumentError, ClosedError, SimulationError, shown
from dynx.model.configuration import checked_array
from dynx.sim.clock import multiple
from dynx.sim.loop.controller_checks import Unchanged
from dynx.sim.loop.plain import Held, Loop
from dynx.sim.loop.record import Record
from dynx.sim.loop.references import setpoints_of
from dynx.sim.loop.sensors import Sensors
from dynx.sim.loop.staged import staged_loop
from dynx.sim.loop.stops import Stops
from dynx.sim.plants.plant import plant_errors
from dynx.sim.plants.registry import make_plant
from dynx.sim.record.rollout import Rollout
from dynx.sim.resuming import changed_parts, refuse_no_rollout, refuse_other_scenario
from dynx.sim.scenario.scenario import Scenario
from dynx.sim.setup import Setup
from dynx.spatial.scalar import Floats
from dynx.trajectory.base import Trajectory

Progress = Callable[[int, int], object]
"""Called with the number of steps taken and that of all."""

MIN_BUFFER_STEPS = 1024
"""Steps that fit into the first buffers of a simulation without a duration."""


class State(NamedTuple):
    """The state of a robot at time `t` [s]: configuration `q` (nq,) and velocity `v` (nv,)."""

    t: float
    q: Floats
    v: Floats


@dataclass(frozen=True, eq=False)
class Snapshot:
    """A simulation at one moment, with its record until then; `Simulation.restore` returns to it."""

    scenario: Scenario
    record: Record
    held: Held
    executor: tuple[str, ...]
    departures: tuple[str, ...]

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return self.record.steps * self.scenario.dt


class Simulation:
    """One scenario, in steps of the caller's own.

        with dynx.Simulation(scenario) as simulation:
            while simulation.time < 2.0:
                simulation.step()
                print(simulation.state.q)

    Equal steps give equal bits: those of `dynx.simulate` on the same scenario, whoever steps and how many
    steps at a time. All states are recorded (`rollout`). The engine of the plant stays open until `close`,
    which the end of a ``with`` block calls.
    """

    def __init__(self, scenario: Scenario, *, progress: Progress | None = None) -> None:
        """Raises as `dynx.simulate` does for a scenario that cannot be simulated.

        `progress` is called now and then in `run`.
        """
        if not isinstance(scenario, Scenario):
            raise ArgumentError(f"scenario is of type {type(scenario).__name__}; wanted a dynx.Scenario")
        self.scenario = scenario
        """The scenario that is simulated."""
        setup = self._setup = Setup.of(scenario)
        bounded = scenario.duration is not None or isinstance(scenario.reference, Trajectory)
        self.n_steps = setup.clock.n_steps if bounded else None
        """Steps to the end of the scenario; None for one without a duration."""
        clock = setup.clock if bounded else replace(setup.clock, n_steps=MIN_BUFFER_STEPS)
        self._record = Record.begin(*setup.start, clock.n_steps)
        self._progress = progress
        setpoints = setpoints_of(setup.setpoint_of, clock, setup.controller)
        sensors = Sensors(scenario.model, clock, scenario.noise)
        self._plant = make_plant(
            scenario.plant,
            setup.model,
            setup.disturbances,
            clock.dt,
            integrator=setup.integrator,
            substeps=scenario.substeps,
            options={"method": scenario.method, "rtol": scenario.rtol, "atol": scenario.atol},
        )
        self._dt = clock.dt
        self._watch = None if setup.controller is None else Unchanged(setup.controller)
        self._held: Held | None = None
        self._misplaced = self._closed = False
        self._executor: tuple[str, ...] = ()
        self._departures: tuple[str, ...] = ()
        try:
            self._plant.refuse(setup.controller)
            bodies = backend("reference", setup.model, validate=False) if scenario.position_limits else None
            armature = setup.disturbances.armature
            stops = None
            if bodies is not None:
                stops = Stops(setup.model, lambda q: bodies.mass_matrix(q) + armature)
            self._loop = Loop(self._plant, setup.controller, setpoints, clock, sensors, setup.limit, stops)
        except BaseException:
            self._plant.close()
            raise

    # -- stepping -----------------------------------------------------------------------------

    def step(self, n: int = 1, tau: ArrayLike | None = None) -> State:
        """Take `n` steps of `dt`, and return the state after them.

        `tau` (nv,) [N m or N] replaces the torque of the controller, which is not evaluated in these steps;
        effort limits hold for it, and it is held until the next control step. Raises DivergedError and
        ControlError, with the record so far in ``error.rollout``.
        """
        if n != 1 and (not isinstance(n, int | np.integer) or n < 1):
            raise ArgumentError(f"n is {shown(n)}; wanted a number of steps, 1 or more")
        given = None
        if tau is not None:
            given = checked_array("tau", tau, self._setup.model.nv).copy()
            if given.ndim != 1:
                raise ArgumentError(f"tau has shape {given.shape}; wanted ({self._setup.model.nv},)")
            self._depart("torques of the caller")
        self._note("plain: stepped by the caller")
        end = self._record.steps + int(n)
        held = self._advance(end, given)
        return State(end * self._dt, held.q.copy(), held.v.copy())

    def run(self, until: float | None = None, *, real_time: bool = False) -> Rollout:
        """Step to the time `until` [s], by default the end of the scenario, and return the record.

        `until` is a multiple of `dt` and not before `time`; ArgumentError for another one. Raises
        DivergedError and ControlError as `step` does.

        With `real_time` each step waits until as much time has passed on the clock of the machine.
        Otherwise steps are compiled where that is possible; `Rollout.executor` says whether it was.
        """
        end = self.n_steps
        if until is not None:
            if not isinstance(until, int | float) or not math.isfinite(until):
                raise ArgumentError(f"until is {shown(until)}; wanted a time in seconds")
            if round(until / self._dt) < self._record.steps:
                raise ArgumentError(
                    f"until is {until:.12g} s, but {self.time:.12g} s are simulated already; `restore` and "
                    "`reset` go back"
                )
            end = multiple("until", until, self._dt) if until else 0
        if end is None:
            raise ArgumentError("the scenario has no duration: wanted `until`")
        if real_time:
            self._run_in_real_time(end)
        else:
            self._run(end)
        return self.rollout

    def _refuse_changed_controller(self) -> None:
        """Raise ArgumentError for a controller that changed itself since this simulation was made."""
        if self._watch is not None:
            self._watch.refuse_changed()

    def _run(self, end: int) -> None:
        if end > len(self._record):
            self._extend(end)
        if self._progress is not None:
            self._loop = replace(self._loop, progress=partial(_call, self._progress, end))
        left = end - self._record.steps
        if left <= 0:
            return
        self._advance(end, None, compiled=True)
        if self._progress is not None:
            self._progress(self._record.steps, end)

    def _run_in_real_time(self, end: int) -> None:
        started, first, dt = time.perf_counter(), self._record.steps, self._loop.clock.dt
        while self._record.steps < end:
            self.step()
            ahead = started + (self._record.steps - first) * dt - time.perf_counter()
            if ahead > 0.0:
                time.sleep(ahead)

    def _advance(self, end: int, given: Floats | None, *, compiled: bool = False) -> Held:
        self._refuse_closed()
        record = self._record
        if end > len(record):
            self._extend(end)
            record = self._record
        held = self._held
        try:
            if held is None:
                held = self._held = self._loop.start(record)
            elif self._misplaced:
                self._loop.place(held.q, held.v)
            self._misplaced = False
            if end == record.steps + 1 and not compiled:
                self._loop.advance(record, held, end, given)
                return held
            # A state that runs away is found by the loop, whose error says more than NumPy's warnings. For
            # a single step, silencing them would take longer than all else beside the step itself.
            with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
                if compiled:
                    self._advance_staged(record, held, end)
                if record.steps < end:
                    self._loop.advance(record, held, end, given)
        except BaseException as error:
            # The plant may be in the middle of a step: it is placed anew before the next one.
            self._misplaced = True
            if isinstance(error, SimulationError):
                error.rollout = self.rollout
            raise
        return held

    def _advance_staged(self, record: Record, held: Held, end: int) -> None:
        """Take as many steps to `end` as the staged executor can, and note which executor computed them."""
        made = staged_loop(self._loop, end - record.steps)
        if isinstance(made, str):
            self._note(f"plain: {made}")
            return
        self._note("staged")
        made.run(record, held, end)
        if record.steps < end:
            self._note(f"plain from step {record.steps}: {made.stopped}")

    def _refuse_closed(self) -> None:
        if self._closed:
            raise ClosedError("the simulation is closed")

    def _note(self, executor: str) -> None:
        if executor not in self._executor:
            self._executor = (*self._executor, executor)

    def _depart(self, how: str) -> None:
        if not any(each.startswith(how) for each in self._departures):
            self._departures = (*self._departures, f"{how} from step {self._record.steps}")

    def _extend(self, end: int) -> None:
        """Make room for the steps until `end`, and twice as many as there was."""
        clock = replace(self._loop.clock, n_steps=max(end, 2 * len(self._record)))
        self._record = self._record.extended(clock.n_steps)
        setpoints = setpoints_of(self._setup.setpoint_of, clock, self._setup.controller)
        sensors = Sensors(self.scenario.model, clock, self.scenario.noise)
        self._loop = replace(self._loop, clock=clock, setpoints=setpoints, sensors=sensors)

    # -- state and record ---------------------------------------------------------------------

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return self._record.steps * self._dt

    @property
    def state(self) -> State:
        """Time, configuration (nq,) and velocity (nv,) after the last step."""
        k = self._record.steps
        return State(k * self._dt, self._record.q[k].copy(), self._record.v[k].copy())

    @property
    def rollout(self) -> Rollout:
        """The record so far; a controller that changed itself is one of its `departures`."""
        changed = self._watch.changed if self._watch is not None else None
        departures = self._departures if changed is None else (*self._departures, changed)
        record, setup, n = self._record.copy(), self._setup, self._record.steps
        times = self._loop.clock.times()[: n + 1]
        limit, tau = setup.limit, record.tau
        at_limit = np.zeros(tau.shape, dtype=bool) if limit is None else np.abs(tau) >= limit
        return Rollout(
            setup.model,
            times,
            record.q,
            record.v,
            record.a,
            tau,
            at_limit,
            None if setup.setpoint_of is None else setup.setpoint_of(times),
            setup.disturbances.armature,
            self.scenario,
            "; ".join(self._executor),
            departures,
        )

    def reset(self) -> State:
        """Return to the start of the scenario, and forget the record.

        Raises ArgumentError for a controller that changed itself.
        """
        self._refuse_changed_controller()
        self._record.steps = 0
        self._held, self._executor, self._departures = None, (), ()
        return self.state

    def save(self) -> Snapshot:
        """Return the simulation as it is now, with its record; `restore` continues from it bit for bit.

        Raises ArgumentError for a controller that changed itself.
        """
        self._refuse_closed()
        self._refuse_changed_controller()
        held = self._held = self._held or self._loop.start(self._record)
        return Snapshot(self.scenario, self._record.copy(), replace(held), self._executor, self._departures)

    def restore(self, snapshot: Snapshot) -> State:
        """Continue from a snapshot of this simulation or of another of the same robot and `dt`.

        In another scenario, such as one with another controller, that controller begins with its initial
        state at its next control step. Raises ArgumentError for a snapshot of another robot or `dt`, and
        for a controller that changes itself.
        """
        self._refuse_closed()
        if not isinstance(snapshot, Snapshot):
            raise ArgumentError(f"snapshot is of type {type(snapshot).__name__}; wanted what `save` returned")
        self._refuse_changed_controller()
        theirs, ours = snapshot.scenario, self.scenario
        robots = [(each.model.joint_names, each.model.base) for each in (theirs, ours)]
        if robots[0] != robots[1] or theirs.dt != ours.dt:
            raise ArgumentError(
                f"the snapshot is of {shown(theirs.model)} with dt = {theirs.dt:g} s; this simulation is of "
                f"{shown(ours.model)} with dt = {ours.dt:g} s"
            )
        n = snapshot.record.steps
        if n > len(self._record):
            self._extend(n)
        self._loop.refuse_self_changing(self._record)
        changed = [] if theirs is ours else changed_parts(theirs, ours)
        self._record.take(snapshot.record, n)
        self._executor, self._departures = snapshot.executor, snapshot.departures
        held = replace(snapshot.held)
        self._loop.place(held.q, held.v)
        if "controller" in changed:
            controller = self._setup.controller
            held.controller_state = None if controller is None else controller.initial_state()
            held.command = None
        if changed:
            self._depart(f"another {' and '.join(changed)}")
        self._held, self._misplaced = held, False
        return self.state

    def take_over(self, rollout: Rollout, step: int | None = None) -> None:
        """Continue from `step` of a rollout of an equal scenario, by default its last.

        The durations may differ. Raises ArgumentError that names the field for a rollout of another
        scenario, and for one that is not of its scenario alone.
        """
        refuse_no_rollout(rollout)
        step = len(rollout) if step is None else step
        most = len(rollout) if self.n_steps is None else min(len(rollout), self.n_steps)
        if not isinstance(step, int) or not 0 <= step <= most:
            wanted = "any number" if self.n_steps is None else self.n_steps
            raise ArgumentError(
                f"step is {shown(step)}; the rollout to resume has {len(rollout)} and this one {wanted}"
            )
        theirs = Record(rollout.q, rollout.v, rollout.a, rollout.tau)
        if step:
            self._loop.refuse_self_changing(self._record)
        refuse_other_scenario(rollout, self.scenario)
        if step > len(self._record):
            self._extend(step)
        self._record.take(theirs, step)
        self._held, self._executor, self._departures = None, (), ()

    # -- end ----------------------------------------------------------------------------------

    def close(self) -> None:
        """Release the engine; a closed simulation cannot be stepped. Raises EngineError where that fails."""
        if not self._closed:
            self._closed = True
            with plant_errors(type(self._plant), "cannot be closed"):
                self._plant.close()

    def __enter__(self) -> Simulation:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def __repr__(self) -> str:
        model, plant = self.scenario.model.name, self.scenario.plant
        return f"<Simulation of {model} on {plant}, at {self.time:.6g} s>"


def _call(progress: Progress, wanted: int, taken: int) -> None:
    progress(taken, wanted)
