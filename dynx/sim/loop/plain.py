"""The closed loop: measure, command, cut to the limits, step, record.

All checks that can be made before are made before (`dynx.sim.simulation`); what is left inside is what
only the loop can see: a torque that is none, and a state that runs away.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from math import hypot, isfinite
from typing import Any

import numpy as np

from dynx.control.base import Controller, Measurement
from dynx.control.engine_motors import EngineMotor
from dynx.errors import ArgumentError, ControlError, DivergedError, shown
from dynx.sim.loop.clock import Clock
from dynx.sim.loop.controller_checks import Unchanged
from dynx.sim.loop.sensors import Sensors
from dynx.sim.loop.stops import Stops
from dynx.sim.plants.plant import Plant
from dynx.sim.record.record import Record
from dynx.spatial.scalar import Floats, clamp
from dynx.trajectory.base import Setpoint

FLOAT64 = np.dtype(np.float64)

TELLING = 200
"""Steps between two tellings."""

RUNAWAY = 1e8
"""Speed [rad/s or m/s] beyond which nothing can be learnt from a simulation."""


@dataclass(frozen=True)
class Loop:
    """One controller on one plant; a controller of None gives no torque."""

    plant: Plant
    controller: Controller[Any] | None
    setpoints: Setpoint
    """What the controller is given at each control step: arrays with a row for each."""
    clock: Clock
    sensors: Sensors
    limit: Floats | None
    stops: Stops | None
    told: Callable[[int], object] | None = None
    """Told now and then how many steps were taken."""

    def run(self, record: Record) -> None:
        """From the state in row `record.steps` to the end.

        Raises DivergedError and ControlError, with the steps before in `record`, which is whole too
        where Ctrl-C cuts in.
        """
        plant, controller = self.plant, self.controller
        per_control, dt, limit = self.clock.steps_per_control, self.clock.dt, self.limit
        Q, V, A, applied = record.q, record.v, record.a, record.tau
        begin = record.steps
        if begin == self.clock.n_steps:
            return
        if begin:
            self._refuse_changing(record)
        state = self.remembered(record)
        plant.reset(Q[begin].copy(), V[begin].copy())
        q, v = Q[begin].copy(), V[begin].copy()
        tau, command = self._held(record)
        sensors = None if self.sensors.plain else self.sensors
        motors = controller if isinstance(controller, EngineMotor) else None
        setpoints = list(map(Setpoint, *self.setpoints))
        stops, shape = self.stops, (plant.model.nv,)
        step, told, tell = plant.step, self.told, begin
        # The next step at which the controller is asked; never, if there is none.
        due = -1 if controller is None else -(-begin // per_control) * per_control
        for k in range(begin, self.clock.n_steps):
            t = k * dt
            if k == due and controller is not None:
                due += per_control
                measurement = Measurement(t, q, v) if sensors is None else sensors(k, Q, V)
                setpoint = setpoints[k // per_control]
                try:
                    if motors is not None:
                        command = motors.command(measurement, setpoint)
                    else:
                        tau, state = controller.torque(measurement, setpoint, state)
                except Exception as error:
                    raise self._control_failed(k, record, f"{type(error).__name__}: {error}") from error
                if motors is None:
                    if type(tau) is not np.ndarray or tau.shape != shape or tau.dtype is not FLOAT64:
                        tau = self._as_torque(k, record, tau)
                    if not isfinite(sum(tau.tolist())):
                        raise self._control_failed(k, record, f"its torque is not finite: {shown(tau)}")
                    if limit is not None:
                        tau = clamp(tau, limit)
            try:
                if command is None:
                    q, v, a, _, _ = step(t, tau)
                else:
                    q, v, a, tau, _ = plant.step_motors(t, command)
                if stops is not None:
                    stopped = stops(q, v)
                    if stopped is not None:
                        q, v = stopped
                        plant.reset(q, v)
            except Exception as error:
                # Also what an engine raises: its hooks are called bare (`dynx.control.dynamics`).
                raise self._diverged(k, record, f"{type(error).__name__}: {error}") from error
            if not hypot(*v.tolist()) < RUNAWAY:
                raise self._diverged(k, record, "the velocity is no number or beyond all bounds")
            applied[k], A[k], Q[k + 1], V[k + 1] = tau, a, q, v
            record.steps = k + 1
            if told is not None and k >= tell:
                tell = k + TELLING
                told(k + 1)

    def _as_torque(self, k: int, record: Record, given: Any) -> Floats:
        """What a law gave as a float64 array (nv,), or ControlError."""
        wanted = (self.plant.model.nv,)
        try:
            array = np.asarray(given)
        except ValueError:
            array = np.empty(0, dtype=object)
        if array.dtype.kind not in "iuf":
            raise self._control_failed(
                k,
                record,
                f"its torque is of type {type(given).__name__}, not numbers {wanted}: {shown(given)}",
            )
        if array.shape != wanted:
            raise self._control_failed(k, record, f"its torque has shape {array.shape}; wanted {wanted}")
        return np.array(array, dtype=np.float64)

    def _refuse_changing(self, record: Record) -> None:
        """Refuse to go on with a law that has hidden what it remembers in itself."""
        controller = self.controller
        if controller is None or isinstance(controller, EngineMotor):
            return
        watch = Unchanged(controller)
        # What goes wrong here goes wrong in its step too.
        with suppress(Exception):
            measurement = self.sensors(0, record.q, record.v)
            controller.torque(measurement, self._setpoint(0), controller.initial_state())
        if watch.changed:
            raise ArgumentError(
                f"{watch.changed}, so a rollout under it cannot be resumed: let it return its state"
            )

    def remembered(self, record: Record) -> Any:
        """The controller's state at the step where the loop begins.

        It is a function of what was measured until then, so it is not recorded but found again.
        """
        if self.controller is None:
            return None
        state = self.controller.initial_state()
        if state is None or isinstance(self.controller, EngineMotor):
            return state
        for number in range(-(-record.steps // self.clock.steps_per_control)):
            step = number * self.clock.steps_per_control
            measurement = self.sensors(step, record.q, record.v)
            _, state = self.controller.torque(measurement, self._setpoint(number), state)
        return state

    def _setpoint(self, number: int) -> Setpoint:
        return Setpoint(*(array[number] for array in self.setpoints))

    def _held(self, record: Record) -> tuple[Floats, Any]:
        """Torque and command that the last control step before the beginning left."""
        begin = record.steps
        nothing = np.zeros(self.plant.model.nv)
        if begin % self.clock.steps_per_control == 0:
            return nothing, None
        if isinstance(self.controller, EngineMotor):
            number = begin // self.clock.steps_per_control
            measurement = self.sensors(number * self.clock.steps_per_control, record.q, record.v)
            return nothing, self.controller.command(measurement, self._setpoint(number))
        return record.tau[begin - 1].copy(), None

    def _diverged(self, k: int, record: Record, why: str) -> DivergedError:
        t, state = k * self.clock.dt, (record.q[k].copy(), record.v[k].copy())
        return DivergedError(
            f"the simulation diverged in step {k}, at {t:.6g} s: {why}", time=t, step=k, state=state
        )

    def _control_failed(self, k: int, record: Record, why: str) -> ControlError:
        t, state = k * self.clock.dt, (record.q[k].copy(), record.v[k].copy())
        name = "" if self.controller is None else self.controller.name
        return ControlError(
            f"controller {name} failed in step {k}, at {t:.6g} s: {why}", time=t, step=k, state=state
        )
