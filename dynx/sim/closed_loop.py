"""A robot under a controller in closed loop: measure, compute the torque, clamp it, step the plant, record.

Arguments were checked before (`dynx.sim.setup`); the loop itself detects torques that are not finite and
divergence of the state.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from math import isfinite
from typing import Any

import numpy as np

from dynx.backends import Backend, backend
from dynx.compiled.status import Status
from dynx.control.base import Controller, Measurement
from dynx.control.bullet import BulletMotor
from dynx.errors import ControlError, DivergedError, DynxError, SimulationError, shown
from dynx.model import Model
from dynx.model.numbers import DIVERGENCE_SPEED, refuse_mask
from dynx.sim.controller_checks import (
    ControllerWatch,
    defect_of_outcome,
    defect_of_torque,
    refuse_self_changed,
)
from dynx.sim.noise import Noise
from dynx.sim.overshoot import largest_overshoot, overcompensated_friction
from dynx.sim.plants.disturbances import notes_on_springs
from dynx.sim.plants.integrated import IntegratedPlant
from dynx.sim.plants.plant import Plant, is_own, plant_errors
from dynx.sim.step import is_diverged, measure, torque_sum
from dynx.spatial.scalar import Floats, clamp
from dynx.steppers.clock import Clock
from dynx.steppers.joint_stops import JointStops
from dynx.steppers.random import Purpose
from dynx.trajectory.base import Setpoint

FLOAT64 = np.dtype(np.float64)

MIN_STEPS_TO_COMPILE = 256
"""Smallest number of steps for which tracing pieces saves time."""

MAX_TRACED_SUBSTEPS = 16
"""Largest number of sub-steps in one traced step."""

PROGRESS_STEPS = 200
"""Number of steps between two calls of `progress`."""

PROBE_DISPLACEMENT = 1e-3
"""Displacement of measured coordinates [rad or m] and velocities [rad/s or m/s] at which a controller is
evaluated to see whether it changes itself."""


@dataclass
class StateBuffers:
    """States at n + 1 times, torques and accelerations of the n steps between, and the count of steps."""

    q: Floats
    v: Floats
    a: Floats
    tau: Floats
    steps: int = 0

    @classmethod
    def begin(cls, q: Floats, v: Floats, n: int) -> StateBuffers:
        """Make buffers for n steps from the state (q, v)."""
        nv = len(v)
        record = cls(
            np.empty((n + 1, len(q))),
            np.empty((n + 1, nv)),
            np.empty((n, nv)),
            np.empty((n, nv)),
        )
        record.q[0], record.v[0] = q, v
        return record

    def copy(self) -> StateBuffers:
        """Return a copy of the steps taken."""
        n = self.steps
        return StateBuffers(
            self.q[: n + 1].copy(), self.v[: n + 1].copy(), self.a[:n].copy(), self.tau[:n].copy(), n
        )

    def take(self, other: StateBuffers, n: int) -> None:
        """Replace all steps by the first n of another record."""
        self.q[: n + 1], self.v[: n + 1] = other.q[: n + 1], other.v[: n + 1]
        self.a[:n], self.tau[:n] = other.a[:n], other.tau[:n]
        self.steps = n

    def extended(self, n: int) -> StateBuffers:
        """Return a copy of the steps taken, in buffers for n steps."""
        larger = StateBuffers.begin(self.q[0], self.v[0], n)
        larger.take(self, self.steps)
        return larger

    def __len__(self) -> int:
        """Return the number of steps that the buffers hold."""
        return len(self.tau)


class Sensors:
    """Measurements at the control steps, from the recorded states."""

    def __init__(
        self, model: Model, clock: Clock, noise: Noise | None, controller: Controller[Any] | None = None
    ) -> None:
        """Raises GainError for an invalid standard deviation, ArgumentError for an invalid seed."""
        self._model = model
        self._clock = clock
        self.noise: tuple[Floats, Floats] | None = None
        """The noise of q and of v at each control step (n_controls, nv)."""
        if noise is not None and noise.on_measurements(model.nv):
            self.noise = noise.rows(model, clock.n_controls)
        size = 0 if controller is None else controller.random_size
        self.random = (
            (noise or Noise()).numbers(Purpose.CONTROLLER, (clock.n_controls, size)) if size else None
        )
        """The random numbers of the controller at each control step (n_controls, random_size)."""

    @property
    def plain(self) -> bool:
        """True if measurements have no delay, no noise and no random numbers."""
        return self.noise is None and self.random is None and not self._clock.delay_steps

    def __call__(self, step: int, q: Floats, v: Floats) -> Measurement:
        """Return the measurement at physics step `step`, from the states (n, nq), (n, nv) until then."""
        clock = self._clock
        seen, number = clock.measured_step(step), clock.control_number(step)
        noise = None if self.noise is None else (self.noise[0][number], self.noise[1][number])
        random = None if self.random is None else self.random[number]
        return measure(self._model, step * clock.dt, q[seen], v[seen], noise, random)


def stops_of(plant: Plant, armature: Floats) -> JointStops:
    """Return the stops of a plant with `armature` (nv, nv), by its engine's mass matrix if it has one."""
    mass_matrix: Callable[[Floats], Floats] = _MassMatrix(plant.model)
    if isinstance(plant, IntegratedPlant):
        mass_matrix = plant.dynamics.mass_matrix
    return JointStops(plant.model, lambda q: mass_matrix(q) + armature)


class _MassMatrix:
    """Mass matrix of a robot without joint dynamics, by a kernel that is loaded when it is first needed."""

    def __init__(self, model: Model) -> None:
        self._model = model

    @cached_property
    def _engine(self) -> Backend:
        return backend("compiled", self._model, validate=False)

    def __call__(self, q: Floats) -> Floats:
        return self._engine.mass_matrix(q)


@dataclass
class LoopState:
    """State of a loop between two steps. Its arrays are replaced, never modified."""

    q: Floats
    v: Floats
    tau: Floats
    """Torque (nv,) of the last control step."""
    command: Any = None
    """Motor command of the last control step, for an engine's own motors."""
    controller_state: Any = None


@dataclass(frozen=True)
class ClosedLoop:
    """One controller on one plant; without a controller there is no torque."""

    plant: Plant
    controller: Controller[Any] | None
    setpoints: Setpoint
    """Setpoints of all control steps: arrays with a row for each."""
    clock: Clock
    sensors: Sensors
    limit: Floats | None
    stops: JointStops | None
    progress: Callable[[int], object] | None = None
    """Called now and then with the number of steps taken."""

    @cached_property
    def _constants(self) -> tuple[Any, ...]:
        """Values that `advance` needs as local variables, because a step takes only some microseconds."""
        motors = self.controller if isinstance(self.controller, BulletMotor) else None
        sensors = None if self.sensors.plain else self.sensors
        setpoints = list(map(Setpoint, *self.setpoints))
        nv = self.plant.model.nv
        return self.clock.steps_per_control, self.clock.dt, sensors, motors, setpoints, (nv,)

    def start(self, record: StateBuffers) -> LoopState:
        """Reset the plant to the last state of `record`, and recompute the state of the loop there."""
        begin = record.steps
        q, v = record.q[begin].copy(), record.v[begin].copy()
        self.place(q, v)
        tau, command = self._last_command(record)
        return LoopState(q, v, tau, command, self.recovered_state(record))

    def place(self, q: Floats, v: Floats) -> None:
        """Make q (nq,), v (nv,) the state of the plant. Raises EngineError where its `reset` fails."""
        with plant_errors(type(self.plant), "cannot be reset"):
            self.plant.reset(q, v)

    def recover(self, loop_state: LoopState) -> None:
        """Return the plant to the state of the last complete step. Raises EngineError where that fails."""
        with plant_errors(type(self.plant), "cannot be reset"):
            self.plant.recover(loop_state.q, loop_state.v)

    def advance(
        self, record: StateBuffers, loop_state: LoopState, end: int, given: Floats | None = None
    ) -> None:
        """Step from the last state of `record`, which the plant must be in, to step `end`.

        The torque `given` (nv,) replaces that of the controller, which is then not evaluated. Raises
        DivergedError and ControlError. After an error or Ctrl-C, `record` and `loop_state` are those of the
        last complete step.
        """
        plant, controller = self.plant, self.controller
        per_control, dt, sensors, motors, setpoints, shape = self._constants
        Q, V, A, applied = record.q, record.v, record.a, record.tau
        begin = record.steps
        q, v = loop_state.q, loop_state.v
        tau, command, state = loop_state.tau, loop_state.command, loop_state.controller_state
        limit, stops = self.limit, self.stops
        step, progress, next_call = plant.step, self.progress, begin
        # Number of the next control step; -1 if the torque is held through all of them.
        due = -1 if given is not None else self.clock.next_control_step(begin)
        if given is not None:
            tau, command = given if limit is None else clamp(given, limit), None
            loop_state.tau, loop_state.command = tau, None
        for k in range(begin, end):
            t = k * dt
            if k == due and controller is None:
                # A torque of the caller ends at the control step. Without one it is zero already.
                due, tau = -1, np.zeros(shape)
            elif k == due and controller is not None:
                due += per_control
                measurement = Measurement(t, q, v) if sensors is None else sensors(k, Q, V)
                setpoint = setpoints[k // per_control]
                try:
                    if motors is not None:
                        command = motors.command(measurement, setpoint)
                    else:
                        outcome = controller.torque(measurement, setpoint, state)
                except Exception as error:
                    raise self.engine_failed(k, record, error, in_controller=True) from error
                if motors is None:
                    if not isinstance(outcome, tuple) or len(outcome) != 2:
                        raise self._control_failed(k, record, str(defect_of_outcome(outcome)))
                    tau, state = outcome
                    if type(tau) is not np.ndarray or tau.shape != shape or tau.dtype is not FLOAT64:
                        tau = self._as_torque(k, record, tau)
                    if not isfinite(torque_sum(tau)):
                        raise self.error_of(Status.TORQUE, k, record, tau)
                    if limit is not None:
                        tau = clamp(tau, limit)
            try:
                if command is None:
                    q, v, a, _, _ = step(t, tau)
                else:
                    q, v, a, tau, _ = plant.step_motors(t, command)
                diverged = is_diverged(v)
                if stops is not None and not diverged:
                    stopped = stops(Q[k], q, v)
                    if stopped is not None:
                        q, v = stopped
                        plant.reset(q, v)
            except Exception as error:
                # This includes the engine's own exceptions, because its hooks are called directly
                # (`dynx.backends.dynamics`).
                raise self.engine_failed(k, record, error, in_controller=False) from error
            if diverged:
                raise self.error_of(Status.DIVERGED, k, record, tau)
            applied[k], A[k], Q[k + 1], V[k + 1] = tau, a, q, v
            record.steps = k + 1
            loop_state.q, loop_state.v, loop_state.tau, loop_state.command, loop_state.controller_state = (
                q,
                v,
                tau,
                command,
                state,
            )
            if progress is not None and k >= next_call:
                next_call = k + PROGRESS_STEPS
                progress(k + 1)

    def _as_torque(self, k: int, record: StateBuffers, given: Any) -> Floats:
        """Return the torque of a controller as a float64 array (nv,). Raises ControlError."""
        wanted = (self.plant.model.nv,)
        try:
            if type(given) is not np.ndarray:
                refuse_mask("torque", given)
            array = np.asarray(given)
        except ValueError:
            array = np.empty(0, dtype=object)
        if array.dtype.kind not in "iuf":
            raise self._control_failed(
                k,
                record,
                f"its torque is of type {type(given).__name__}, not numbers {wanted}: {shown(given)}",
            )
        defect = defect_of_torque(array, wanted)
        if defect:
            raise self._control_failed(k, record, defect)
        return np.array(array, dtype=np.float64)

    def not_in_pieces(self, left: int) -> str | None:
        """Return why `left` more steps cannot be compiled in pieces, or are too few; None if they may be."""
        plant = self.plant
        if left < MIN_STEPS_TO_COMPILE:
            return f"fewer than {MIN_STEPS_TO_COMPILE} steps"
        if isinstance(self.controller, BulletMotor):
            return f"{self.controller.name} is a motor inside the engine"
        if not isinstance(plant, IntegratedPlant):
            return f"{type(plant).__name__} has a stepper of its own"
        if plant.uncompiled:
            return f"{plant.uncompiled} not compiled"
        if plant.substeps > MAX_TRACED_SUBSTEPS:
            return f"more than {MAX_TRACED_SUBSTEPS} sub-steps"
        if left < MIN_STEPS_TO_COMPILE * plant.evaluations:
            return f"fewer than {MIN_STEPS_TO_COMPILE * plant.evaluations} steps"
        if not plant.model.nv:
            return "the robot has no coordinates"
        if plant.model.floating and self.sensors.noise is not None:
            return "noise on the pose of a floating base is not compiled"
        return None

    def refuse_self_changing(self, record: StateBuffers) -> None:
        """Raise ArgumentError for a controller that changes itself when its torque is evaluated.

        It is evaluated at the start and at a displaced state, where the tracking error is not zero.
        """
        controller = self.controller
        if controller is None or isinstance(controller, BulletMotor):
            return
        watch = ControllerWatch(controller)
        # An error here will be raised again when the step is taken.
        with suppress(Exception):
            measurement = self.sensors(0, record.q, record.v)
            t, q, v = measurement
            beside = controller.model.integrate(q, np.full_like(v, PROBE_DISPLACEMENT))
            displaced = Measurement(t, beside, v + PROBE_DISPLACEMENT).with_random(measurement.random)
            for each in (measurement, displaced):
                controller.torque(each, self._setpoint(0), controller.initial_state())
        refuse_self_changed(watch.changed)

    def recovered_state(self, record: StateBuffers) -> Any:
        """Return the controller's state after the last step of `record`.

        It depends only on the measurements until then, so it is recomputed instead of recorded.
        """
        if self.controller is None:
            return None
        state = self.controller.initial_state()
        if state is None or isinstance(self.controller, BulletMotor):
            return state
        for number, step in enumerate(range(0, record.steps, self.clock.steps_per_control)):
            measurement = self.sensors(step, record.q, record.v)
            outcome = self.controller.torque(measurement, self._setpoint(number), state)
            defect = defect_of_outcome(outcome)
            if defect:
                raise self._control_failed(step, record, defect)
            _, state = outcome
        return state

    def _setpoint(self, number: int) -> Setpoint:
        return Setpoint(*(array[number] for array in self.setpoints))

    def _last_command(self, record: StateBuffers) -> tuple[Floats, Any]:
        """Return the torque and motor command of the last control step before the last state of `record`."""
        begin = record.steps
        none = np.zeros(self.plant.model.nv)
        if self.clock.is_control_step(begin):
            return none, None
        if isinstance(self.controller, BulletMotor):
            number = self.clock.control_number(begin)
            measurement = self.sensors(number * self.clock.steps_per_control, record.q, record.v)
            return none, self.controller.command(measurement, self._setpoint(number))
        return record.tau[begin - 1].copy(), None

    def error_of(self, status: Status, k: int, record: StateBuffers, tau: Floats) -> SimulationError:
        """Return the error of the status of step `k`, in which the controller commanded `tau`."""
        if status & Status.TORQUE:
            return self._control_failed(k, record, f"its torque is not finite: {shown(tau)}")
        return self._diverged(
            k, record, f"the velocity is not finite, or its norm is above {DIVERGENCE_SPEED:g}"
        )

    def engine_failed(
        self, k: int, record: StateBuffers, error: Exception, *, in_controller: bool
    ) -> SimulationError:
        """Return the error of step `k` in which the controller or the plant raised an exception: a failure
        for a controller or a plant of the user, divergence for a plant of dynx."""
        kind, why = type(self.plant), f"{type(error).__name__}: {error}"
        if in_controller:
            return self._control_failed(k, record, why)
        if is_own(kind):
            return self._diverged(k, record, why)
        return self._ended(SimulationError, k, record, f"plant {kind.__name__} failed", why)

    def _diverged(self, k: int, record: StateBuffers, why: str) -> SimulationError:
        """Return the error of divergence, with the joint whose damping is too large for the control step."""
        overshoot = beyond = None
        # The message of the failure itself matters more than its explanation, for which the mass matrix or
        # the Jacobian of the controller's model may not be available.
        with suppress(DynxError):
            control_dt = self.clock.steps_per_control * self.clock.dt
            armature = self.plant.disturbances.armature.diagonal()
            overshoot = largest_overshoot(self.controller, record.q[0], control_dt, armature=armature)
            beyond = overcompensated_friction(self.controller, self.plant.disturbances.friction)
            h = self.clock.dt / self.plant.substeps
            for note in notes_on_springs(self.plant.disturbances, None, h, record.q[0]):
                why += f"; {note}"
        if overshoot is not None:
            why += f"; {overshoot.hint('dt' if self.clock.steps_per_control == 1 else 'control_dt')}"
        if beyond is not None:
            why += f"; {beyond}"
        error = self._ended(DivergedError, k, record, "the simulation diverged", why)
        if isinstance(error, DivergedError):
            error.overshoot = overshoot
        return error

    def _control_failed(self, k: int, record: StateBuffers, why: str) -> SimulationError:
        name = "" if self.controller is None else self.controller.name
        return self._ended(ControlError, k, record, f"controller {name} failed", why)

    def _ended(
        self, kind: type[SimulationError], k: int, record: StateBuffers, event: str, why: str
    ) -> SimulationError:
        t, state = k * self.clock.dt, (record.q[k].copy(), record.v[k].copy())
        return kind(f"{event} in step {k}, at {t:.6g} s: {why}", time=t, step=k, state=state)
