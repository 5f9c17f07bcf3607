"""Checked parts of a scenario that every executor needs: clock, plant's model, reference, limits, start."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass
from typing import Any

import numpy as np

from dynx.backends.joint_friction import JointFriction
from dynx.control.base import Controller
from dynx.control.bullet import BulletMotor
from dynx.control.content import is_foreign
from dynx.control.saturation import checked_limit
from dynx.errors import ArgumentError, LimitError, LimitViolation
from dynx.model import Model
from dynx.model.configuration import checked_q
from dynx.model.limited_positions import joint_ranges, limited_positions
from dynx.model.numbers import checked_array, whole_number
from dynx.rbd.parameters import plant_model
from dynx.sim.controller_checks import check_controller
from dynx.sim.plants.disturbances import Disturbances
from dynx.sim.plants.registry import default_integrator
from dynx.sim.plants.scene_plant import ScenePlant
from dynx.sim.scenario.documents import Unknown
from dynx.sim.scenario.options import OPTIONS
from dynx.sim.scenario.scenario import Scenario
from dynx.simd.machine import require_memory
from dynx.spatial.scalar import Floats
from dynx.steppers.clock import MAX_STEPS, Clock
from dynx.trajectory.base import Setpoint, Trajectory
from dynx.trajectory.limit_check import check

UNCHECKED = "check_reference=False simulates it nevertheless"
"""Advice in the errors of limits."""

SetpointOf = Callable[[Floats], Setpoint]
"""From times (n,) to setpoints (n, nq), (n, nv), (n, nv)."""


@dataclass(frozen=True)
class Setup:
    """A scenario that passed all checks that need no engine."""

    scenario: Scenario
    controller: Controller[Any] | None
    clock: Clock
    """Clock over the scenario's duration, or over one control step for a scenario without one."""
    model: Model
    """The robot of the plant, with payload and scaled masses."""
    setpoint_of: SetpointOf | None
    disturbances: Disturbances
    limit: Floats | None
    """Effort limits (nv,) [N m or N]."""
    start: tuple[Floats, Floats]
    """q (nq,) and v (nv,) at time 0."""

    @classmethod
    def of(cls, scenario: Scenario, given_elsewhere: Collection[str] = ()) -> Setup:
        """Check a scenario. Raises ArgumentError, LimitError or GainError if it cannot be simulated.

        `given_elsewhere`: names of options whose values the caller has beside the scenario.
        """
        controller = known_controller(scenario)
        refuse_ineffective(scenario, given_elsewhere)
        clock = clock_of(scenario)
        if controller is not None:
            check_controller(scenario.model, controller, clock)
        require_memory(f"{clock.n_steps} steps", clock.n_steps * step_bytes(scenario.model, controller))
        moved = plant_model(scenario.model, scenario.payloads, scenario.mass_scale)
        if isinstance(scenario.plant, ScenePlant) and moved.gravity != scenario.plant.scene.gravity:
            moved = moved.with_gravity(scenario.plant.scene.gravity)
        setpoint_of = checked_reference(
            scenario.model, scenario.reference, within_limits=scenario.check_reference
        )
        disturbances = disturbances_of(scenario, moved)
        limit = effort_limits_of(scenario)
        start = _start(moved, setpoint_of, scenario)
        return cls(scenario, controller, clock, moved, setpoint_of, disturbances, limit, start)

    @property
    def integrator(self) -> str:
        """Name of the integrator; the default of the plant if the scenario has none."""
        return self.scenario.integrator or default_integrator(self.scenario.plant)


def step_bytes(model: Model, controller: Controller[Any] | None = None) -> int:
    """Return the memory [bytes] of one step of a record, of its setpoint and random numbers."""
    random = 0 if controller is None else controller.random_size
    return 8 * (3 * model.nq + 7 * model.nv + random)


def known_controller(scenario: Scenario) -> Controller[Any] | None:
    """Return the controller of a scenario.

    Raises ArgumentError for a part of the scenario that was read from a file and cannot be rebuilt.
    """
    refuse_unknown(scenario.reference, scenario.noise, *scenario.payloads, *scenario.all_pushes)
    controller = scenario.controller
    refuse_unknown(controller)
    assert not isinstance(controller, Unknown)
    return controller


def refuse_ineffective(scenario: Scenario, given_elsewhere: Collection[str]) -> None:
    """Raise ArgumentError for an option that has no effect without another one.

    Not when a scenario is made: files of earlier versions with such options are still read.
    """
    for name, each in OPTIONS.items():
        other, wanted = each.needs
        if not other or other in given_elsewhere or getattr(scenario, name) == each.default:
            continue
        if not in_effect(scenario.model, other, getattr(scenario, other), wanted):
            needed = f"{other}={wanted!r}" if wanted else other
            raise ArgumentError(f"{name} is given, and has no effect without {needed}")


def in_effect(model: Model, option: str, value: object, wanted: str) -> bool:
    """Check whether an option has the value that another one needs; any that acts where `wanted` is empty."""
    if option == "joint_friction" and value is True:
        return JointFriction(model, damping=False).present
    return bool(value == wanted) if wanted else value is not False


def refuse_unknown(*parts: object) -> None:
    """Raise ArgumentError for a part of a scenario that was read from a file and cannot be rebuilt."""
    for part in parts:
        if isinstance(part, Unknown):
            raise ArgumentError(
                f"{part.name} was read from a file, and cannot be rebuilt: {part.why}. Otherwise replace "
                "it with dataclasses.replace"
            )


def clock_of(scenario: Scenario) -> Clock:
    """Return the clock of a scenario. Raises ArgumentError for a `control_dt` or `delay` that is no multiple
    of `dt`."""
    duration = scenario.duration
    if duration is None and isinstance(scenario.reference, Trajectory):
        duration = scenario.reference.duration
    if duration is None:
        duration = scenario.dt if scenario.control_dt is None else scenario.control_dt
    return Clock.of(scenario.dt, duration, scenario.control_dt, scenario.delay)


def require_duration(scenario: Scenario) -> None:
    """Raise ArgumentError where neither the scenario nor its reference has a duration."""
    known_controller(scenario)
    if scenario.duration is None and not isinstance(scenario.reference, Trajectory):
        raise ArgumentError(
            "duration is None, and the reference is no trajectory, which would state one; give duration= [s]"
        )


def disturbances_of(scenario: Scenario, moved: Model) -> Disturbances:
    """Return the friction, springs, armature and pushes of a scenario on `moved`, the model of its plant."""
    return Disturbances(
        moved,
        scenario.joint_damping,
        scenario.joint_friction,
        scenario.friction_slip,
        scenario.joint_armature,
        scenario.all_pushes,
        scenario.dt / whole_number("substeps", scenario.substeps, 1, MAX_STEPS),
        joint_springs=scenario.joint_springs,
    )


def effort_limits_of(scenario: Scenario) -> Floats | None:
    """Return the effort limits (nv,) of a scenario; ArgumentError for limits its motors cannot have."""
    if scenario.effort_limits is False:
        return None
    if isinstance(scenario.controller, BulletMotor):
        raise ArgumentError(f"effort_limits do not reach {scenario.controller.name}: give it `force`")
    own = scenario.effort_limits is True
    return checked_limit(scenario.model, None if own else scenario.effort_limits, "effort_limits")


def _start(model: Model, setpoint_of: SetpointOf | None, scenario: Scenario) -> tuple[Floats, Floats]:
    q0, v0, plant = scenario.q0, scenario.v0, scenario.plant
    q, v = model.neutral(), np.zeros(model.nv)
    if isinstance(plant, ScenePlant):
        q, v = np.array(plant.scene_robot.q), np.array(plant.scene_robot.v)
    elif setpoint_of is not None:
        first = setpoint_of(np.zeros(1))
        q, v = first.q[0], first.v[0]
    if q0 is not None:
        q, v = checked_q(model, q0, "q0"), np.zeros(model.nv)
    if v0 is not None:
        v = checked_array("v0", v0, model.nv)
    if q.ndim != 1 or v.ndim != 1:
        raise ArgumentError(f"q0 has shape {q.shape} and v0 {v.shape}; wanted one state")
    return q, v


def checked_reference(model: Model, reference: Any, *, within_limits: bool) -> SetpointOf | None:
    """Return `reference` as a function of time; None stays None.

    Raises ArgumentError for the reference of another robot, and LimitError (if `within_limits`) where it
    violates position or velocity limits of the model.
    """
    if reference is None:
        return None
    if not isinstance(reference, Trajectory):
        return _held(model, reference, within_limits)
    if (reference.nq, reference.nv) != (model.nq, model.nv):
        # A motion made without the model takes each quaternion for four independent coordinates.
        lacks_model = model.quaternions and reference.nq == reference.nv == model.nq
        raise ArgumentError(
            f"the reference has nq {reference.nq} and nv {reference.nv}; "
            f"{model.name} has nq {model.nq} and nv {model.nv}"
            + ("; give the trajectory model=..., so that it knows the quaternions" if lacks_model else "")
        )
    if within_limits:
        try:
            check(model, reference, effort=False)
        except LimitError as error:
            raise LimitError(f"{error}\n  ({UNCHECKED})", error.violations) from None
    return reference


def setpoints_of(
    setpoint_of: SetpointOf | None, clock: Clock, controller: Controller[Any] | None
) -> Setpoint:
    """Return the setpoint of every control step, `lead` control steps ahead: (n_controls, ...).

    Raises ArgumentError if there is no reference and the controller needs one.
    """
    n = clock.n_controls
    if controller is None:
        nothing = np.zeros((n, 0))
        return Setpoint(nothing, nothing, nothing)
    if setpoint_of is not None:
        return setpoint_of(clock.control_times(controller.lead))
    if controller.needs_setpoint:
        own = is_foreign(type(controller))
        cure = "; a class that follows none says needs_setpoint = False" if own else ""
        raise ArgumentError(
            f"{controller.name} needs a reference: a trajectory, or a configuration to hold{cure}"
        )
    model = controller.model
    rest = np.broadcast_to(np.zeros(model.nv), (n, model.nv))
    return Setpoint(np.broadcast_to(model.neutral(), (n, model.nq)), rest, rest)


def _held(model: Model, q: Any, within_limits: bool) -> SetpointOf:
    """Return the reference that stays at the configuration `q`."""
    held = checked_q(model, q, "reference")
    if held.ndim != 1:
        raise ArgumentError(f"reference has shape {held.shape}; wanted a trajectory or ({model.nq},)")
    if within_limits:
        positions, ranges = limited_positions(model, held), joint_ranges(model)
        rows = zip(model.coordinate_joints, positions, *ranges, strict=True)
        found = [
            LimitViolation(joint.name, "position", 0.0, float(x), float(low if x < low else high), joint.unit)
            for joint, x, low, high in rows
            if not low <= x <= high
        ]
        if found:
            raise LimitError(f"the reference of {model.name} breaks limits: {found[0]} ({UNCHECKED})", found)

    def at(times: Floats) -> Setpoint:
        rest = np.zeros((len(times), model.nv))
        return Setpoint(np.array(np.broadcast_to(held, (len(times), model.nq))), rest, rest)

    return at
