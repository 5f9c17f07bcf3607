"""A simulation that is stepped in the caller's own loop, its snapshots, and the rollouts that it continues;
`dynx.simulate` runs one to its end."""

from __future__ import annotations

import hashlib
import math
import time
from collections.abc import Callable
from dataclasses import KW_ONLY, dataclass, fields, is_dataclass, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from dynx.argument_types import checks_types
from dynx.backends.registry import backend_class
from dynx.control.base import Controller
from dynx.errors import ArgumentError, ClosedError, SimulationError, shown
from dynx.model import Model
from dynx.model.numbers import checked_array, is_real
from dynx.registry import explains_names
from dynx.sim.closed_loop import ClosedLoop, LoopState, Sensors, StateBuffers, stops_of
from dynx.sim.controller_checks import ControllerWatch, refuse_self_changed
from dynx.sim.plants.disturbances import refuse_small_slip
from dynx.sim.plants.plant import plant_errors
from dynx.sim.plants.registry import make_plant
from dynx.sim.plants.scene_plant import ScenePlant
from dynx.sim.record.rollout import Rollout
from dynx.sim.scenario.documents import in_words
from dynx.sim.scenario.options import FORMER_NAMES, takes
from dynx.sim.scenario.scenario import RecordedScenario, Scenario, ScenarioArguments, innermost
from dynx.sim.setup import Setup, require_duration, setpoints_of, step_bytes
from dynx.sim.step import at_limit
from dynx.simd.machine import require_memory
from dynx.spatial.scalar import Floats
from dynx.steppers.clock import multiple, refuse_too_many_steps, step_count
from dynx.steppers.state import same_numbers
from dynx.trajectory.base import Trajectory
from dynx.world.snapshot import Snapshot

if TYPE_CHECKING:
    from dynx.sim.compiled_loop import CutLoop, LaneLoop


class SimulationState(NamedTuple):
    """The state of a robot at time `t` [s]: configuration `q` (nq,) and velocity `v` (nv,)."""

    t: float
    q: Floats
    v: Floats

    def __eq__(self, other: object) -> bool:
        return same_numbers(self, other)

    def __ne__(self, other: object) -> bool:
        return not same_numbers(self, other)


@dataclass(frozen=True, eq=False)
class SimulationRecord:
    """What a simulation adds to its `Snapshot`: the record until then, and the state of its controller."""

    scenario: Scenario
    states: StateBuffers
    command: Any
    """Motor command of the last control step, for an engine's own motors."""
    controller_state: Any
    executor: tuple[str, ...]
    departures: tuple[str, ...]
    plant_memory: Any = None
    """All that the plant needs besides the state, such as the world around the robot."""


Progress = Callable[[int, int], object]
"""Called with the number of steps taken and the total number."""

MIN_BUFFER_STEPS = 1024
"""Number of steps that fit into the first buffers of a simulation without a duration."""


@explains_names
class Simulation:
    """One scenario, simulated step by step by the caller.

        with dynx.Simulation(scenario) as simulation:
            while simulation.time < 2.0:
                simulation.step()
                print(simulation.state.q)

    The results equal those of `dynx.simulate` on the same scenario, bit for bit, however many steps are taken
    at a time. All states are recorded (`rollout`). The engine of the plant stays open until `close`, which
    the end of a ``with`` block calls.
    """

    scenario = RecordedScenario()
    """The scenario that is simulated, as it was when the simulation began."""

    def __init__(self, scenario: Scenario, *, progress: Progress | None = None) -> None:
        """Raises the errors of `dynx.simulate` for a scenario that cannot be simulated.

        `run` calls `progress` regularly.
        """
        if progress is not None and not callable(progress):
            raise ArgumentError(f"progress is {shown(progress)}; wanted a function of two numbers of steps")
        if not isinstance(scenario, Scenario):
            raise ArgumentError(f"scenario is of type {type(scenario).__name__}; wanted a dynx.Scenario")
        setup = self._setup = Setup.of(scenario)
        self.scenario = scenario
        self._present = self.scenario
        bounded = scenario.duration is not None or isinstance(scenario.reference, Trajectory)
        self.n_steps = setup.clock.n_steps if bounded else None
        """Steps to the end of the scenario; None for one without a duration."""
        clock = setup.clock if bounded else replace(setup.clock, n_steps=MIN_BUFFER_STEPS)
        self._record = StateBuffers.begin(*setup.start, clock.n_steps)
        self._progress = progress
        setpoints = setpoints_of(setup.setpoint_of, clock, setup.controller)
        sensors = Sensors(scenario.model, clock, scenario.noise, setup.controller)
        if scenario.sensors != () or (
            isinstance(scenario.plant, ScenePlant) and scenario.plant.scene.sensors
        ):
            # Imported here, because most simulations have none.
            from dynx.sim.record.sensing import check_sensors

            check_sensors(scenario, setup.model)
        self._plant = make_plant(
            scenario.plant,
            setup.model,
            setup.disturbances,
            clock.dt,
            integrator=setup.integrator,
            substeps=scenario.substeps,
            options={"method": scenario.method, "rtol": scenario.rtol, "atol": scenario.atol},
            joint_limits=scenario.joint_limits,
        )
        self._dt = clock.dt
        self._watch = ControllerWatch.of(setup.controller)
        self._self_change: str | None = None
        self._loop_state: LoopState | None = None
        self._plant_needs_reset = self._closed = False
        self._lane: LaneLoop | None = None
        self._lane_known = False
        self._executor: tuple[str, ...] = ()
        self._departures: tuple[str, ...] = ()
        try:
            self._plant.refuse(setup.controller)
            step = clock.dt / scenario.substeps
            refuse_small_slip(setup.disturbances, setup.integrator, step, setup.start[0])
            stops = None
            if scenario.joint_limits and not isinstance(scenario.plant, ScenePlant):
                stops = stops_of(self._plant, setup.disturbances.armature)
            self._loop = ClosedLoop(
                self._plant, setup.controller, setpoints, clock, sensors, setup.limit, stops
            )
        except BaseException:
            self._plant.close()
            raise

    # -- stepping -----------------------------------------------------------------------------

    def step(self, n: int = 1, tau: ArrayLike | None = None) -> SimulationState:
        """Take `n` steps of `dt`, and return the state after them.

        `tau` (nv,) [N m or N] replaces the torque of the controller, which is not evaluated in these steps.
        Effort limits apply to `tau`, and it is held until the next control step. Raises DivergedError and
        ControlError, with the record so far in ``error.rollout``.
        """
        n = step_count(n, "run(until) takes the time")
        given = None
        if tau is not None:
            given = checked_array("tau", tau, self._setup.model.nv).copy()
            if given.ndim != 1:
                raise ArgumentError(f"tau has shape {given.shape}; wanted ({self._setup.model.nv},)")
            self._note_departure("torques of the caller")
        end = self._record.steps + n
        loop_state = self._advance(end, given)
        return SimulationState(end * self._dt, loop_state.q.copy(), loop_state.v.copy())

    @checks_types
    def run(self, until: float | None = None, *, real_time: bool = False) -> Rollout:
        """Step to the time `until` [s], by default the end of the scenario, and return the record.

        `until` must be a multiple of `dt` and not before `time`, or ArgumentError is raised. Raises
        DivergedError and ControlError as `step` does.

        With `real_time` each step waits until as much time has passed on the clock of the machine. Otherwise
        steps are compiled if possible; `Rollout.executor` tells whether they were.
        """
        end = self.n_steps
        if until is not None:
            if not is_real(until) or not math.isfinite(until):
                raise ArgumentError(f"until is {shown(until)}; wanted a time in seconds")
            refuse_too_many_steps("until", until, self._dt)
            if round(until / self._dt) < self._record.steps:
                raise ArgumentError(
                    f"until is {until:.12g} s, but {self.time:.12g} s have been simulated; use `restore` or "
                    "`reset` to go back"
                )
            end = multiple("until", until, self._dt) if until else 0
        if end is None:
            raise ArgumentError("the scenario has no duration: wanted `until`")
        if real_time:
            self._run_in_real_time(end)
        else:
            self._run(end)
        return self.rollout

    def _note_changes_of_caller(self) -> None:
        """Note a controller that the caller changed since the last step, which the next step applies."""
        change = None if self._watch is None or self._self_change else self._watch.change
        if change is not None:
            name, attribute = change
            self._note_departure(f"{name} changed by the caller (attribute {attribute})")
            self._watch = ControllerWatch.of(self._setup.controller)
            self._present = self._setup.scenario.for_record()
            self._lane_known = False

    def _note_change_by_itself(self) -> None:
        """Note the attribute of a controller that changed during a step."""
        if self._watch is not None and self._self_change is None:
            self._self_change = self._watch.changed

    def _run(self, end: int) -> None:
        if end > len(self._record):
            self._extend(end)
        progress = self._progress
        if progress is not None:
            self._loop = replace(self._loop, progress=lambda taken: progress(taken, end))
            self._lane_known = False
        if end <= self._record.steps:
            return
        self._advance(end, None, compiled=True)
        if progress is not None:
            progress(self._record.steps, end)

    def _run_in_real_time(self, end: int) -> None:
        started, first, dt = time.perf_counter(), self._record.steps, self._loop.clock.dt
        while self._record.steps < end:
            self.step()
            ahead = started + (self._record.steps - first) * dt - time.perf_counter()
            if ahead > 0.0:
                time.sleep(ahead)

    def _advance(self, end: int, given: Floats | None, *, compiled: bool = False) -> LoopState:
        self._refuse_closed()
        self._note_changes_of_caller()
        record = self._record
        if end > len(record):
            self._extend(end)
            record = self._record
        loop_state = self._loop_state
        try:
            if loop_state is None:
                loop_state = self._loop_state = self._loop_state_of_record()
            elif self._plant_needs_reset:
                self._loop.recover(loop_state)
            self._plant_needs_reset = False
            lane = self._one_lane()
            if lane is not None:
                self._note(lane.executor)
                lane.run(record, loop_state, end, given)
            elif end == record.steps + 1 and not compiled:
                self._note("plain: stepped by the caller")
                self._loop.advance(record, loop_state, end, given)
            else:
                # The loop detects a diverging state, and its error tells more than NumPy's warnings, which
                # are therefore silenced. Not for a single step, where silencing would add too much time.
                with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
                    if compiled:
                        self._advance_in_pieces(record, loop_state, end)
                    else:
                        self._note("plain: stepped by the caller")
                    if record.steps < end:
                        self._loop.advance(record, loop_state, end, given)
        except BaseException as error:
            # The plant may be in the middle of a step, so it is reset before the next one.
            self._plant_needs_reset = True
            self._note_change_by_itself()
            if isinstance(error, SimulationError):
                error.rollout = self.rollout
            raise
        self._note_change_by_itself()
        return loop_state

    def _loop_state_of_record(self) -> LoopState:
        """Reset the plant to the last state of the record, and return the state of the loop there."""
        loop_state = self._loop.start(self._record)
        lane = self._one_lane()
        if lane is not None:
            lane.recover_controller_state(self._record, loop_state)
        return loop_state

    def _one_lane(self) -> LaneLoop | None:
        """Return the loop as one lane of a batch's kernel, if its steps are computed so."""
        if not self._lane_known:
            lane = None
            if self.scenario.plant == "compiled":
                from dynx.sim.compiled_loop import lane_loop

                lane = lane_loop(self._loop)
            self._lane, self._lane_known = lane, True
        return self._lane

    def _advance_in_pieces(self, record: StateBuffers, loop_state: LoopState, end: int) -> None:
        """Take all steps to `end` in pieces between engine calls if possible, and note how they are taken."""
        pieces: CutLoop | str | None = self._loop.not_in_pieces(end - record.steps)
        if pieces is None:
            from dynx.sim.compiled_loop import cut_loop

            pieces = cut_loop(self._loop)
        if isinstance(pieces, str):
            self._note(f"plain: {pieces}")
            return
        self._note(pieces.executor)
        pieces.run(record, loop_state, end)

    def _refuse_closed(self) -> None:
        if self._closed:
            raise ClosedError("the simulation is closed")

    def _note(self, executor: str) -> None:
        if executor not in self._executor:
            self._executor = (*self._executor, executor)

    def _note_departure(self, how: str) -> None:
        if not any(each.startswith(how) for each in self._departures):
            self._departures += (f"{how} from step {self._record.steps}",)

    def _extend(self, end: int) -> None:
        """Extend the buffers to hold the steps until `end`, at least to twice their size."""
        require_memory(f"{end} steps", end * step_bytes(self.scenario.model, self._setup.controller))
        clock = replace(self._loop.clock, n_steps=max(end, 2 * len(self._record)))
        setpoints = setpoints_of(self._setup.setpoint_of, clock, self._setup.controller)
        sensors = Sensors(self.scenario.model, clock, self.scenario.noise, self._setup.controller)
        loop = replace(self._loop, clock=clock, setpoints=setpoints, sensors=sensors)
        record = self._record.extended(clock.n_steps)
        # Together at the end: the reference is the user's code, and Ctrl-C may come at any time.
        self._record, self._loop, self._lane_known = record, loop, False

    # -- state and record ---------------------------------------------------------------------

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return self._record.steps * self._dt

    @property
    def state(self) -> SimulationState:
        """Time, configuration (nq,) and velocity (nv,) after the last step."""
        k = self._record.steps
        return SimulationState(k * self._dt, self._record.q[k].copy(), self._record.v[k].copy())

    @property
    def rollout(self) -> Rollout:
        """The record so far; a controller that changed itself, or that the caller changed between steps, is
        one of its `departures`."""
        changed = self._self_change
        departures = self._departures if changed is None else (*self._departures, changed)
        record, setup, n = self._record.copy(), self._setup, self._record.steps
        times = self._loop.clock.times()[: n + 1]
        limit, tau = setup.limit, record.tau
        saturated = np.zeros(tau.shape, dtype=bool) if limit is None else at_limit(tau, limit) > 0.0
        return Rollout(
            setup.model,
            times,
            record.q,
            record.v,
            record.a,
            tau,
            saturated,
            None if setup.setpoint_of is None else setup.setpoint_of(times),
            setup.disturbances.armature,
            self.scenario,
            "; ".join(self._executor),
            departures,
            self._plant.surroundings(n),
        )

    def reset(self) -> SimulationState:
        """Return to the start and discard the record; a controller that the caller changed stays so.

        Raises ArgumentError for a controller that changed itself.
        """
        self._note_changes_of_caller()
        refuse_self_changed(self._self_change)
        self._record.steps, self.scenario = 0, self._present
        self._loop_state, self._executor, self._departures = None, (), ()
        return self.state

    def save(self) -> Snapshot:
        """Return a snapshot of the simulation and its record, from which `restore` continues bit for bit.

        Raises ArgumentError for a controller that changed itself.
        """
        self._refuse_closed()
        self._note_changes_of_caller()
        refuse_self_changed(self._self_change)
        self._loop_state = self._loop_state or self._loop_state_of_record()
        state, plant = self._loop_state, self.scenario.plant
        record = SimulationRecord(
            self._present,
            self._record.copy(),
            state.command,
            state.controller_state,
            self._executor,
            self._departures,
            self._plant.save(),
        )
        return Snapshot(
            plant.engine if isinstance(plant, ScenePlant) else plant,
            "",
            _identity(self.scenario),
            self.time,
            0.0,
            self._record.steps,
            {"q": state.q, "v": state.v, "tau": state.tau},
            b"",
            record,
        )

    def restore(self, snapshot: Snapshot) -> SimulationState:
        """Continue from a snapshot of this simulation or of another of the same robot and `dt`.

        If this simulation has another controller than the snapshot, the controller starts from its initial
        state at the next control step. Raises ArgumentError for a snapshot of another robot or `dt`, and for
        a controller that changes itself.
        """
        self._refuse_closed()
        if not isinstance(snapshot, Snapshot):
            raise ArgumentError(f"snapshot is of type {type(snapshot).__name__}; wanted what `save` returned")
        self._note_changes_of_caller()
        record, ours = snapshot.record, self._present
        if not isinstance(record, SimulationRecord):
            raise ArgumentError("the snapshot is of a world; wanted one of Simulation.save")
        refuse_self_changed(self._self_change)
        theirs = record.scenario
        if snapshot.identity != _identity(ours):
            raise ArgumentError(
                f"the snapshot is of {shown(theirs.model)} with dt = {theirs.dt:g} s; this simulation is of "
                f"{shown(ours.model)} with dt = {ours.dt:g} s"
            )
        n = snapshot.steps
        if n > len(self._record):
            self._extend(n)
        self._loop.refuse_self_changing(self._record)
        changed = [] if theirs is ours else changed_parts(theirs, ours)
        self._record.take(record.states, n)
        self._executor, self._departures = record.executor, record.departures
        loop_state = LoopState(
            **snapshot.arrays, command=record.command, controller_state=record.controller_state
        )
        self._loop.place(loop_state.q, loop_state.v)
        if record.plant_memory is not None:
            self._plant.restore(record.plant_memory)
        if "controller" in changed:
            controller = self._setup.controller
            loop_state.controller_state = None if controller is None else controller.initial_state()
            loop_state.command = None
        if changed:
            self._note_departure(f"another {' and '.join(changed)}")
        self._loop_state, self._plant_needs_reset = loop_state, False
        return self.state

    def take_over(self, rollout: Rollout, step: int | None = None) -> None:
        """Continue from `step` of a rollout of an equal scenario, by default its last.

        The durations may differ. Raises ArgumentError for a rollout of another scenario, with the name of the
        field that differs, and for a rollout with `departures`.
        """
        require_rollout(rollout)
        refuse_scene(self.scenario)
        step = len(rollout) if step is None else step
        most = len(rollout) if self.n_steps is None else min(len(rollout), self.n_steps)
        if not isinstance(step, int) or not 0 <= step <= most:
            wanted = "any number" if self.n_steps is None else self.n_steps
            raise ArgumentError(
                f"step is {shown(step)}; wanted a whole number of steps: the rollout to resume has "
                f"{len(rollout)} steps and this one {wanted}"
            )
        theirs = StateBuffers(rollout.q, rollout.v, rollout.a, rollout.tau)
        if step:
            self._loop.refuse_self_changing(self._record)
        self._note_changes_of_caller()
        refuse_other_scenario(rollout, self._present)
        if step > len(self._record):
            self._extend(step)
        self._record.take(theirs, step)
        self.scenario = self._present
        self._loop_state, self._executor, self._departures = None, (), ()

    # -- end ----------------------------------------------------------------------------------

    def close(self) -> None:
        """Release the engine; a closed simulation cannot be stepped. Raises EngineError where that fails."""
        if not self._closed:
            self._closed = True
            with plant_errors(type(self._plant), "cannot be closed"):
                self._plant.close()

    def __enter__(self) -> Simulation:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __repr__(self) -> str:
        model, plant = self.scenario.model.name, self.scenario.plant
        return f"<Simulation of {model} on {plant}, at {self.time:.6g} s>"


def _identity(scenario: Scenario) -> str:
    """Return the hash of the coordinates, the base and the step of a scenario."""
    model = scenario.model
    return hashlib.sha256(repr((model.joint_names, model.base, scenario.dt)).encode()).hexdigest()


def require_rollout(rollout: object) -> None:
    """Raise ArgumentError for anything but a `Rollout`, such as the name of its file."""
    if not isinstance(rollout, Rollout):
        raise ArgumentError(
            f"the rollout to resume is of type {type(rollout).__name__}; wanted a dynx.Rollout, which "
            "dynx.Rollout.load reads from a file"
        )


def refuse_scene(scenario: Scenario) -> None:
    """Raise ArgumentError for a scenario in a scene, which a record does not determine."""
    if isinstance(scenario.plant, ScenePlant):
        raise ArgumentError(
            "a rollout in a scene cannot be resumed, because its record does not have the engine's contact "
            "forces: Simulation.save and restore continue exactly"
        )


def refuse_other_scenario(rollout: Rollout, scenario: Scenario) -> None:
    """Raise ArgumentError if the scenario of `rollout` differs from `scenario` in more than the duration and
    the sensors, on which no step depends."""
    then = rollout.scenario
    if then is None:
        raise ArgumentError("the rollout to resume has no scenario, so it cannot be compared")
    if rollout.departures:
        raise ArgumentError(
            f"the rollout to resume does not follow from its scenario alone: {'; '.join(rollout.departures)}"
        )
    if then.model != scenario.model:
        name, old, new = model_difference(then.model, scenario.model)
        raise ArgumentError(
            f"the rollout to resume is not of this model {shown(scenario.model.name)}: it had {name} {old}; "
            f"now it is {new}"
        )
    for each in then.differences(scenario):
        if each.field not in ("duration", "sensors"):
            name, old, new = innermost(each)
            raise ArgumentError(
                f"the rollout to resume had {name} {in_words(old)}; now it is {in_words(new)}"
            )


def changed_parts(theirs: Scenario, ours: Scenario) -> list[str]:
    """Return the names of the fields in which two scenarios differ and on which steps depend, with the fields
    inside them; a controller is one field."""
    names = (each.field for each in theirs.differences(ours) if each.field != "sensors")
    return list(dict.fromkeys("controller" if name.startswith("controller.") else name for name in names))


def model_difference(ours: Model, theirs: Model) -> tuple[str, str, str]:
    """Return the first attribute in which two models differ, as its name and its two values."""
    for name in ("name", "base", "base_pose", "gravity", "links", "joints", "extra_frames"):
        pair = getattr(ours, name), getattr(theirs, name)
        if pair[0] != pair[1]:
            return _innermost(name, *pair)
    return "model", shown(ours), shown(theirs)


def _innermost(name: str, ours: Any, theirs: Any) -> tuple[str, str, str]:
    """Find the innermost attribute in which two values differ."""
    if is_dataclass(ours) and type(ours) is type(theirs):
        for each in fields(ours):
            pair = getattr(ours, each.name), getattr(theirs, each.name)
            if each.compare and pair[0] != pair[1]:
                return _innermost(f"{each.name} of {name}", *pair)
    if name in ("links", "joints", "extra_frames"):
        known = [[each.name for each in side] for side in (ours, theirs)]
        if known[0] != known[1]:
            mine, its = (shown(", ".join(names)) for names in known)
            return name, mine, its
        word = {"links": "link", "joints": "joint", "extra_frames": "frame"}[name]
        one, other = next(pair for pair in zip(ours, theirs, strict=True) if pair[0] != pair[1])
        return _innermost(f"{word} {shown(one.name)}", one, other)
    return name, str(ours), str(theirs)


class RolloutInterrupted(KeyboardInterrupt):
    """Interruption of a simulation by Ctrl-C; `rollout` is the record until then."""

    def __init__(self, rollout: Rollout, wanted: int) -> None:
        super().__init__(f"interrupted after {len(rollout)} of {wanted} steps")
        self.rollout = rollout


@dataclass(frozen=True, eq=False, repr=False)
class SimulateArguments(ScenarioArguments):
    """Arguments of `simulate`."""

    _: KW_ONLY
    controller_backend: str | None = None
    resume: Rollout | None = None
    step: int | None = None
    progress: Progress | None = None

    def scenario_on_backend(self) -> Scenario:
        """Return the scenario, whose controller computes on `controller_backend` if that is given."""
        if self.controller_backend is None or not isinstance(self.controller, Controller):
            return self.scenario()
        if isinstance(self.controller_backend, str):
            backend_class(self.controller_backend)
        return replace(self, controller=self.controller.on(self.controller_backend)).scenario()


@takes(SimulateArguments, FORMER_NAMES, external_forces="pushes", forces="pushes")
def simulate(given: SimulateArguments) -> Rollout:
    """Simulate `model` under `controller` along `reference`, and return the record.

    `model` may also be a robot's name or file for `dynx.load`, or a `Scenario`, whose fields are the other
    arguments. Together with a scenario you can give only `resume`, `step` and `progress`.

    **Motion.** `reference` is a trajectory, one configuration (nq,) to hold, or None. Without a controller
    the robot has no motors. The initial state is `q0`, `v0`. By default it is the state of the scene, the
    start of the reference, or the neutral configuration.

    **Plant.** ``plant="pybullet"`` is PyBullet's own stepper. With ``integrator="engine"``, ``"mujoco"`` and
    ``"drake"`` are the steppers of MuJoCo and Drake. Any other name is a backend whose forward dynamics dynx
    integrates: ``semi_implicit`` (the default: v, then q, as Bullet does), ``rk4``, or ``adaptive`` (SciPy's
    `method`). ``plant="pybullet", integrator="rk4"`` is PyBullet's forward dynamics under RK4. A `ScenePlant`
    is the robot in a scene, with contacts; the rollout then has `surroundings`. To study the effect of an
    error in one engine, give the controller another one by `controller_backend`.

    **Time** [s]. In each time step `dt` of the record the plant takes `substeps` steps. The controller runs
    every `control_dt`, and its torque stays constant in between. It measures the state of the time `delay`
    earlier, at first the initial state. At the end of the reference its last configuration stays the
    setpoint.

    **Joints.** `joint_damping`, `joint_friction` (dry) and `joint_armature` are True for the values of the
    description (the default, as in a world), False for zero, one number, or one number for each joint. In
    ``{"elbow_joint": 0.5}`` the value of all other joints is zero. Dry friction holds a joint at rest up to
    its magnitude, and opposes the motion of a moving joint, for any time step (`dynx.rbd.joint_friction`).
    With `friction_slip` above 0 loaded joints creep (`JointFriction`). `effort_limits` is True for the limits
    of the model; `Rollout.saturated` states in which steps they act. `joint_limits` stops joints at the
    limits of the description (`dynx.steppers.joint_stops`), in a scene by the law of the engine.

    **Model error.** The controller knows neither the `payload` nor `mass_scale`. `noise` is added to its
    measurements. Sensors (`Rollout.sensors`) are computed after the simulation; controllers do not use them.

    **Resuming.** dynx keeps the first `step` steps (by default all) of the record `resume`, and computes the
    rest. The result equals that of one run, to the last bit. The scenario of the record must equal this one
    in every field except `duration`. The controller must have no state except the one that it returns.

    **Long runs.** `progress` is called regularly with the number of steps taken and the total number. Ctrl-C
    raises RolloutInterrupted, whose ``.rollout`` is the record until then, from which you can resume. While
    dynx still sets up the simulation there is no record, and Ctrl-C raises Python's KeyboardInterrupt.

    Raises ArgumentError for a scenario that cannot be simulated, or that differs from that of `resume`;
    LimitError for an effort limit of 0, or (if `check_reference`) a reference outside the limits of position
    and velocity; DivergedError and ControlError in a step, whose ``.rollout`` is the record until then.
    """
    if isinstance(given.model, Scenario) and given.controller_backend is not None:
        raise ArgumentError(
            "controller_backend is given in addition to a scenario, whose controller has a backend: change "
            "it by dataclasses.replace"
        )
    scenario = given.scenario_on_backend()
    require_duration(scenario)
    if given.step is not None and given.resume is None:
        raise ArgumentError(
            f"step is {shown(given.step)}, and resume is None; wanted the rollout to go on from that step"
        )
    with Simulation(scenario, progress=given.progress) as simulation:
        if given.resume is not None:
            simulation.take_over(given.resume, given.step)
        try:
            return simulation.run()
        except KeyboardInterrupt:
            raise RolloutInterrupted(simulation.rollout, simulation.n_steps or 0) from None
