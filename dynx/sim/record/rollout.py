"""The record of one simulation, its settings, and a summary in a few numbers."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from dynx.argument_types import checks_types
from dynx.backends import Backend, backend
from dynx.control.base import Controller
from dynx.errors import ArgumentError, DynxError, UnsupportedFeatureError
from dynx.model import Model
from dynx.model.limited_positions import joint_ranges, limited_positions
from dynx.model.numbers import whole_number
from dynx.rbd.jacobians import LOCAL
from dynx.rbd.joint_wrenches import about_world
from dynx.rbd.parameters import plant_model
from dynx.registry import door, explains_names
from dynx.sim.controller_checks import controller_numbers
from dynx.sim.plants.disturbances import notes_on_springs
from dynx.sim.plants.scene_plant import ScenePlant
from dynx.sim.scenario.documents import Unknown
from dynx.sim.scenario.scenario import RecordedScenario, Scenario
from dynx.sim.setup import clock_of, disturbances_of, effort_limits_of, refuse_unknown
from dynx.spatial.scalar import Floats
from dynx.steppers.forces import ExternalForce
from dynx.steppers.joint_stops import MOVES_NO_FURTHER
from dynx.trajectory.base import Setpoint
from dynx.trajectory.limit_check import UNITS
from dynx.world.record import (
    Channel,
    Record,
    configuration_channel,
    coordinate_names,
    coordinate_units,
    position_channel,
)
from dynx.world.surroundings import Surroundings

if TYPE_CHECKING:
    from dynx.sim.overshoot import Overshoot
    from dynx.world.sensors.readings import Readings
    from dynx.world.sensors.sensor import Sensor


class Summary(NamedTuple):
    """Errors, speeds, torques and energy of a rollout; errors (nv,) are NaN without a reference."""

    rms_error: Floats
    max_error: Floats
    max_speed: Floats
    max_torque: Floats
    energy_drift: float
    """Largest change of the energy since the start, divided by the largest kinetic energy; that change [J]
    if nothing ever moved."""
    saturated: float
    """Share of the steps in which some motor was at its limit."""
    coordinates: tuple[str, ...] = ()
    """Names of the coordinates of v: joints, after the six of a floating base."""
    units: tuple[str, ...] = ()
    """Unit of each coordinate: rad or m."""
    overshoot: Overshoot | None = None
    """`Rollout.overshoot`."""

    def __str__(self) -> str:
        """Return the largest error and torque with joint and unit; without motors, the energy's drift."""
        sentences = []
        if not self.has_errors:
            sentences.append("no reference")
        elif self.max_error.size:
            sentences.append(f"largest error {self._largest(self.max_error)}")
        if self.max_torque.any():
            sentences.append(f"largest torque {self._largest(self.max_torque, UNITS['effort'])}")
            sentences.append(f"saturated in {100 * self.saturated:.3g} % of the steps")
            if self.overshoot is not None:
                sentences.append(self.overshoot.finding())
        else:
            # Where motors do work, the energy changes by that and does not drift.
            sentences.append(f"energy drift {self.energy_drift:.2g} of the largest kinetic energy")
        return ", ".join(sentences)

    @property
    def has_errors(self) -> bool:
        """False without a reference, where errors are NaN."""
        return not (self.max_error.size and np.isnan(self.max_error).all())

    def __repr__(self) -> str:
        return f"<Summary: {self}>"

    def _repr_html_(self) -> str:
        return self.to_html("summary")

    @checks_types
    def to_html(self, title: str) -> str:
        """Return a table with a row for each coordinate under `title`; without a reference it has no
        errors."""
        columns = {"max speed": self.max_speed, "max torque": self.max_torque}
        if self.has_errors:
            columns = {"max error": self.max_error, "RMS error": self.rms_error, **columns}
        rows = (
            (name, unit, *(f"{x:.3g}" for x in numbers))
            for name, unit, *numbers in zip(self.coordinates, self.units, *columns.values(), strict=True)
        )
        from dynx.files.pages import html_grid  # most are shown on no page

        return html_grid(f"{title}: {self}", ("coordinate", "unit", *columns), rows)

    def _largest(self, values: Floats, units: Mapping[str, str] | None = None) -> str:
        k = int(np.argmax(values))
        if k >= len(self.coordinates):
            return f"{values[k]:.3g}"
        unit = self.units[k]
        return f"{values[k]:.3g} {unit if units is None else units[unit]} of {self.coordinates[k]}"


@explains_names
@dataclass(frozen=True, eq=False)
class Rollout:
    """n steps of a robot in motion: states at n + 1 times, and torques and accelerations between them.

    Row k of `a`, `tau` and `saturated` belongs to the step from ``t[k]`` to ``t[k + 1]``. `a` is the
    acceleration at the start of the step, `tau` the torque that acted on the plant. `saturated` states
    whether each motor was at its limit.
    """

    model: Model
    """The robot of the plant, with payload and scaled masses."""
    t: Floats
    """Times (n + 1,) [s]."""
    q: Floats
    """Configurations (n + 1, nq)."""
    v: Floats
    """Velocities (n + 1, nv)."""
    a: Floats
    """Accelerations (n, nv)."""
    tau: Floats
    """Torques of the motors (n, nv) [N m or N]."""
    saturated: np.ndarray[Any, np.dtype[np.bool_]]
    """True where a motor was at its limit (n, nv)."""
    reference: Setpoint | None
    """The setpoint at each time: (n + 1, nq), (n + 1, nv), (n + 1, nv)."""
    rotors: Floats
    """Armature (nv, nv), zero unless the scenario has some."""
    scenario: Scenario | RecordedScenario | None = RecordedScenario()  # noqa: RUF009  # gives None by default
    """The simulation whose record this is; None for a record made in another way."""
    executor: str = ""
    """Executor of the steps: ``compiled`` (one kernel), ``compiled pieces`` (between the calls of an
    engine), or ``plain`` with the reason; semicolons separate several."""
    departures: tuple[str, ...] = ()
    """Interventions that make the record differ from its scenario, such as torques given by the caller."""
    surroundings: Surroundings | None = None
    """Contacts, bodies and other robots, of a rollout in a scene (`ScenePlant`)."""

    def __len__(self) -> int:
        """Return the number of steps."""
        return len(self.tau)

    @cached_property
    def error(self) -> Floats:
        """Tracking error, `model.difference(q, q*)` (n + 1, nv); NaN without a reference."""
        if self.reference is None:
            return np.full_like(self.v, np.nan)
        return self.model.difference(self.q, self.reference.q)

    @cached_property
    def kinetic_energy(self) -> Floats:
        """Kinetic energy of the links and the armature (n + 1,) [J]."""
        with backend("reference", self.model) as bodies:
            turning = 0.5 * np.einsum("ki,ij,kj->k", self.v, self.rotors, self.v)
            return np.asarray(bodies.kinetic_energy(self.q, self.v) + turning)

    @cached_property
    def energy(self) -> Floats:
        """Sum of kinetic and potential energy (n + 1,) [J], including the energy of the springs, computed by
        dynx for every plant."""
        springs = self.scenario is not None and self.scenario.joint_springs
        with backend("reference", self.model) as bodies:
            return np.asarray(self.kinetic_energy + bodies.potential_energy(self.q, joint_dynamics=springs))

    @cached_property
    def external_forces(self) -> dict[str, Floats]:
        """Wrenches (n, 6) from outside in each step, by the frames on which they act: pushes and contacts.

        Force [N] and moment [N m] are about the origin of the world, in its axes: the reference ``world`` of
        `Backend.joint_wrenches`. The forces of constraints and of joint limits, which a rollout does not
        record, are not among them.
        """
        nothing = np.zeros((len(self), 6))
        pushes = () if self.scenario is None else self.scenario.all_pushes
        total = push_wrenches(self._bodies, pushes, self.t, self.q[:-1])
        plant = None if self.scenario is None else self.scenario.plant
        if self.surroundings is not None and isinstance(plant, ScenePlant):
            contacts = self.surroundings.contacts
            for part in contacts.touching:
                robot, _, link = part.partition("/")
                if robot == plant.robot and link:
                    total[link] = total.get(link, nothing) + contacts.wrenches_on(part)
        return total

    def joint_wrenches(self, *, frame: str | None = None, reference: str = LOCAL) -> Floats:
        """Return the wrenches (n, n_joints, 6) [N, N m] that the parents of all joints exert on their
        children as each step begins.

        They follow from the recorded motion and from `external_forces`. `Backend.joint_wrenches` describes
        the order, the signs and the options. Raises UnsupportedFeatureError where a constraint of the scene
        acts on the robot, whose forces are not recorded.
        """
        self._require_recorded()
        return self._bodies.joint_wrenches(
            self.q[:-1],
            self.v[:-1],
            self.a,
            frame=frame,
            reference=reference,
            external_forces=self.external_forces,
            force_reference="world",
        )

    def base_wrench(self, *, frame: str | None = None, reference: str = LOCAL) -> Floats:
        """Return the wrench (n, 6) [N, N m] that the world exerts on the root link, besides
        `external_forces`, as each step begins; see `joint_wrenches`."""
        self._require_recorded(base=True)
        return self._bodies.base_wrench(
            self.q[:-1],
            self.v[:-1],
            self.a,
            frame=frame,
            reference=reference,
            external_forces=self.external_forces,
            force_reference="world",
        )

    def _require_recorded(self, base: bool = False) -> None:
        plant = None if self.scenario is None else self.scenario.plant
        unrecorded = plant.unrecorded(base) if isinstance(plant, ScenePlant) else ""
        if unrecorded:
            raise UnsupportedFeatureError(unrecorded)

    @cached_property
    def sensors(self) -> Mapping[str, Readings]:
        """Readings of the sensors of the scenario and of its scene, by name.

        dynx computes them from the recorded motion, also after `load`. Raises UnsupportedFeatureError for a
        sensor on another robot of the scene, whose acceleration is not recorded.
        """
        return self._read_own_sensors()

    @door("dynx.sim.record.sensing:read_own_sensors")
    def _read_own_sensors(self) -> Mapping[str, Readings]:
        raise NotImplementedError

    @door("dynx.sim.record.sensing:read_sensors")
    def read_sensors(self, sensors: Sensor | Iterable[Sensor]) -> Mapping[str, Readings]:
        """Return the readings of sensors along the recorded motion, by their names."""
        raise NotImplementedError

    @cached_property
    def _bodies(self) -> Backend:
        return backend("reference", self.model)

    def summary(self) -> Summary:
        """Summarise errors, speeds, torques and the drift of the energy."""
        with np.errstate(invalid="ignore"):
            rms = np.sqrt(np.mean(self.error**2, axis=0))
        peak = float(np.max(self.kinetic_energy))
        drift = float(np.max(np.abs(self.energy - self.energy[0])))
        return Summary(
            rms_error=rms,
            max_error=np.max(np.abs(self.error), axis=0),
            max_speed=np.max(np.abs(self.v), axis=0),
            max_torque=np.max(np.abs(self.tau), axis=0, initial=0.0),
            energy_drift=drift / peak if peak else drift,
            saturated=float(np.mean(self.saturated.any(axis=1))) if len(self) else 0.0,
            coordinates=coordinate_names(self.model),
            units=coordinate_units(self.model),
            overshoot=self.overshoot,
        )

    @cached_property
    def overshoot(self) -> Overshoot | None:
        """Joint whose damping gain is unstable for the control step, so that its torque reverses in each of
        many successive steps. Only limits bound such an oscillation. None without such a joint, or without a
        scenario."""
        scenario, n = self.scenario, len(self.model.coordinate_names)
        if scenario is None or not isinstance(scenario.controller, Controller) or not n:
            return None
        # Imported here, because most records are read without it.
        from dynx.sim.overshoot import sustained_overshoot

        every = clock_of(scenario).steps_per_control
        control_dt, armature = every * scenario.dt, np.diagonal(self.rotors)
        # The mass matrix or the Jacobian of the controller's model may not be available.
        with suppress(DynxError):
            return sustained_overshoot(
                scenario.controller, self.q[0], control_dt, armature, self.tau[::every, -n:]
            )
        return None

    @checks_types
    def record(self, name: str = "") -> Record:
        """Return the motion as a record: the configurations of the robot, and the positions of the bodies of
        its scene."""
        bodies = {} if self.surroundings is None else self.surroundings.bodies
        channels: dict[str, Channel] = {"q": configuration_channel(self.model, self.q)}
        channels |= {f"{body}/pose": position_channel(body, T[:, :3, 3]) for body, T in bodies.items()}
        return Record(name or self.model.name, self.t, channels)

    @cached_property
    def settings(self) -> dict[str, Any]:
        """The main settings of the scenario, as numbers and text; empty without a scenario."""
        return {} if self.scenario is None else settings_of(self.scenario)

    @checks_types
    def first(self, n: int) -> Rollout:
        """Return the record of its first n steps, with the departures that began in them."""
        n = whole_number("n", n, 0)
        if not n <= len(self):
            raise ArgumentError(f"n is {n}; wanted 0 to {len(self)}, the number of steps")
        reference = None if self.reference is None else Setpoint(*(x[: n + 1] for x in self.reference))
        states = {name: getattr(self, name)[: n + 1] for name in ("t", "q", "v")}
        steps = {name: getattr(self, name)[:n] for name in ("a", "tau", "saturated")}
        around = None if self.surroundings is None else self.surroundings.first(n)
        departures = tuple(each for each in self.departures if _first_step(each) < n)
        return replace(
            self, **states, **steps, reference=reference, surroundings=around, departures=departures
        )

    @door("dynx.sim.record.formats:save")
    def save(self, path: str | os.PathLike[str]) -> None:
        """Write the record to a ``.npz``, ``.csv`` or ``.mcap`` file atomically."""
        raise NotImplementedError

    @door("dynx.sim.record.formats:load")
    @classmethod
    def load(cls, path: str | os.PathLike[str], model: Model | None = None) -> Rollout:
        """Read a file of `save`, or the log of a robot from elsewhere as a rollout of `model`."""
        raise NotImplementedError

    @door("dynx.sim.record.csv_file:columns")
    def columns(self) -> dict[str, Floats]:
        """Return the columns (n + 1,) of the table of a rollout by name, for `pandas.DataFrame`."""
        raise NotImplementedError

    @door("dynx.sim.record.plot:plot")
    def plot(self, path: str | os.PathLike[str] | None = None) -> Any:
        """Plot positions, errors and torques; return the `matplotlib.figure.Figure`."""
        raise NotImplementedError

    @door("dynx.viewer.viewer:view")
    def view(self, **options: Any) -> Any:
        """Play the rollout in the browser; return the `dynx.viewer.Viewer`, which takes the options.

        Raises NotInstalledError without the extra ``viewer``.
        """
        raise NotImplementedError

    @property
    def notes(self) -> tuple[str, ...]:
        """Sentences on doubtful input: joints that start beyond their limits, springs too stiff for the step,
        gravity that points up. In a scene they include the notes of its world at the start
        (`dynx.world.World.notes`)."""
        # Imported here, because `simulate` needs it no more than other programs.
        from dynx.model.unlikely_inputs import gravity_notes, position_notes

        model, q, scenario = self.model, self.q[0], self.scenario
        own = [*position_notes(model, q, "q0"), *gravity_notes(model.gravity)]
        if scenario is not None and scenario.joint_limits and not isinstance(scenario.plant, ScenePlant):
            from dynx.world.notes import (
                beyond_limits,
                joints_without_range,
                notes_on_held_joints,
                notes_on_limits,
            )

            at, ranges = limited_positions(model, q), joint_ranges(model)
            own += notes_on_limits(beyond_limits(model.joint_names, at, *ranges), MOVES_NO_FURTHER)
            own += notes_on_held_joints(joints_without_range(model.coordinate_joints, *ranges))
        if scenario is not None and scenario.joint_springs and not isinstance(scenario.plant, ScenePlant):
            steps = whole_number("substeps", scenario.substeps, 1)
            acting = disturbances_of(replace(scenario, pushes=()), model)
            own += notes_on_springs(acting, scenario.integrator, scenario.dt / steps, q)
        return tuple(dict.fromkeys((*own, *(self.surroundings.notes if self.surroundings else ()))))

    def __repr__(self) -> str:
        notes = f", {len(self.notes)} notes" if self.notes else ""
        return f"<Rollout of {self.model.name}: {len(self)} steps to {self.t[-1]:.6g} s{notes}>"

    def _repr_html_(self) -> str:
        return self.summary().to_html(repr(self)[1:-1])


def push_wrenches(
    engine: Backend, pushes: Sequence[ExternalForce], t: Floats, q: Floats
) -> dict[str, Floats]:
    """Return the wrenches (..., n, 6) of pushes in the n steps between times t (n + 1,), by frame, about the
    origin of the world in its axes; q (..., n, nq) are the configurations as the steps begin."""
    total: dict[str, Floats] = {}
    steps = list(zip(t[:-1].tolist(), np.diff(t).tolist(), strict=True))
    for push in pushes:
        T = engine.forward_kinematics(q, push.on)
        about_frame = push.at_center(T, np.zeros(3), 1.0)
        shares = np.array([push.share(at, h) for at, h in steps])
        wrenches = shares[:, None] * about_world(about_frame, T[..., :3, 3])
        total[push.on] = total.get(push.on, 0.0) + wrenches
    return total


def settings_of(scenario: Scenario) -> dict[str, Any]:
    """Return plant, controller, times, limits, friction, noise and pushes of a scenario, fit for JSON."""
    refuse_unknown(*scenario.payloads, *scenario.all_pushes)
    controller, clock, limit = scenario.controller, clock_of(scenario), effort_limits_of(scenario)
    moved = plant_model(scenario.model, scenario.payloads, scenario.mass_scale)
    disturbances = disturbances_of(scenario, moved)
    friction, springs = disturbances.friction, disturbances.springs
    return {
        "plant": str(scenario.plant),
        "integrator": scenario.with_defaults().integrator,
        "controller": "none" if controller is None else controller.name,
        "law": _numbers(controller),
        "dt": clock.dt,
        "control_dt": clock.control_dt,
        "delay": clock.delay_steps * clock.dt,
        "substeps": scenario.substeps,
        "effort_limits": None if limit is None else limit.tolist(),
        "joint_limits": scenario.joint_limits,
        "joints": {
            "damping": friction.damping.tolist(),
            "friction": friction.friction.tolist(),
            "slip": friction.slip,
            "stiffness": np.zeros(moved.nv).tolist() if springs is None else springs.stiffness.tolist(),
        },
        "noise": None if scenario.noise is None else repr(scenario.noise),
        "pushes": [repr(push) for push in disturbances.pushes],
    }


def _numbers(controller: Controller[Any] | Unknown | None) -> dict[str, Any]:
    if isinstance(controller, Unknown):
        return controller.numbers
    return {} if controller is None else controller_numbers(controller)


def _first_step(departure: str) -> int:
    """Return the first step that does not follow from the scenario by a departure.

    Another controller or reference replaces the scenario, so no earlier step follows from it: 0.
    """
    how, named, step = departure.rpartition(" from step ")
    return int(step) if named and step.isdecimal() and not how.startswith("another ") else 0
