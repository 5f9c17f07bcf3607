"""Scenario and reference motion of ``dynx sim``, made from the options of the command."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from dynx import trajectory
from dynx.backends.joint_friction import JointFriction
from dynx.backends.registry import backend_class
from dynx.cli.shell.inputs import Numbers, chosen_frame, configuration, load_robot, target_pose, velocity
from dynx.cli.shell.kinds import Coefficients, command_flag, is_command_option
from dynx.cli.shell.options import spelled
from dynx.cli.shell.output import counted
from dynx.control import BulletMotor, FrictionCompensation, ModelBased
from dynx.control.base import Controller
from dynx.control.saturation import checked_limit
from dynx.errors import ArgumentError, LimitError, LimitViolation, UnsupportedFeatureError, shown
from dynx.model import Model
from dynx.sim import Noise, Rollout, Scenario
from dynx.sim.named_controllers import CONTROLLERS, ControllerRequest, Gains, named_controller
from dynx.sim.plants.registry import require_plant
from dynx.sim.scenario import options as declared
from dynx.sim.scenario.options import OPTIONS, Kind, Option, SimulationOptions
from dynx.sim.setup import in_effect, step_bytes
from dynx.simd.machine import require_memory
from dynx.spatial.scalar import Floats
from dynx.steppers.clock import Clock
from dynx.trajectory import Trajectory

GAINS = ("kp", "kd", "ki", "natural_frequency", "damping_ratio", "posture_kp", "posture_kd")

STEP_BYTES = 2000
"""Approximate memory [bytes] of a step besides its record: setpoints, temporary arrays of the summary."""


@dataclass(frozen=True)
class SimulationRequest:
    """A scenario with checked options, and the other input of its document."""

    scenario: Scenario
    controller: Controller[Any] | None
    motion: ReferenceMotion
    clock: Clock
    options: dict[str, Any]
    """Options of `dynx.simulate` besides the scenario: the record to resume, and its step."""
    header: dict[str, Any]
    """Entries of the document that the record does not contain."""


def prepare(given: dict[str, Any]) -> SimulationRequest:
    """Make a scenario from the options `given` by parameter name. Raises ArgumentError for invalid ones."""
    model = load_robot(*(given[name] for name in ("robot", "base", "lock", "base_pose", "gravity")))
    settings = _settings(model, given)
    # Prepared with defaults: not every field is known yet.
    chosen = SimulationOptions(**settings)
    if isinstance(chosen.plant, str):
        require_plant(chosen.plant)
    backend_class(given["backend"]).require_engine()
    _refuse_ineffective_options(model, given, settings)
    motion = plan_motion(model, MotionInput.of(given))
    clock = Clock.of(chosen.dt, motion.duration, chosen.control_dt, chosen.delay)
    require_memory(f"{clock.n_steps} steps", clock.n_steps * (STEP_BYTES + step_bytes(model)))
    controller = _controller(model, given, motion, clock, chosen)
    if isinstance(controller, BulletMotor):
        # Motors of the engine have their own limits (`_controller`).
        settings.pop("effort_limits", None)
    settings["duration"] = motion.duration
    settings["q0"] = configuration(model, given["q0"], "--q0", motion.start)
    settings["check_reference"] = not given["ignore_limits"]
    options = {
        "resume": None if given["resume"] is None else Rollout.load(given["resume"]),
        "step": given["resume_step"],
    }
    header = {
        "law": given["controller"],
        "backend": given["backend"] if isinstance(_innermost(controller), ModelBased) else None,
        "frame": motion.frame,
        "frame_given": given["frame"] is not None,
        "motion": motion.description,
        "gains": _gains_of(controller),
        "motor_limits": _limits_of_motors(model, given["effort_limits"], controller),
    }
    scenario = Scenario(model, controller, motion.reference, **settings)
    return SimulationRequest(scenario, controller, motion, clock, options, header)


def _controller(
    model: Model, given: dict[str, Any], motion: ReferenceMotion, clock: Clock, chosen: SimulationOptions
) -> Controller[Any] | None:
    gains = Gains(**{name: given[name] for name in GAINS})
    if given["controller"] == "none":
        if gains.given():
            raise ArgumentError("--controller none takes no gains")
        for name in ("friction_compensation", "controller_joint_dynamics"):
            if given[name]:
                raise ArgumentError(f"--controller none takes no --{spelled(name)}")
        return None
    if given["friction_compensation"] and given["controller_joint_dynamics"]:
        raise ArgumentError(
            "--friction-compensation and --controller-joint-dynamics would both compensate damping and "
            "friction; wanted one of them"
        )
    controller = named_controller(
        given["controller"],
        ControllerRequest(
            model,
            motion.start,
            clock.control_dt,
            gains,
            motion.frame,
            _motor_limit(model, given["effort_limits"]),
            given["backend"],
            given["controller_joint_dynamics"],
        ),
    )
    if not given["friction_compensation"]:
        return controller
    if isinstance(controller, BulletMotor):
        raise UnsupportedFeatureError(
            f"{given['controller']} is a motor inside PyBullet; no torque can be added"
        )
    if not JointFriction.of_options(model, chosen.joint_damping, chosen.joint_friction).present:
        raise ArgumentError(
            "--friction-compensation needs damping or friction of a joint: in the description, by "
            "--joint-damping or by --joint-friction"
        )
    slip = chosen.friction_slip
    return FrictionCompensation(
        controller,
        damping=chosen.joint_damping,
        friction=chosen.joint_friction,
        slip=slip,
        # A joint that sticks has no measured speed.
        speed="measured" if slip else "setpoint",
    )


def _motor_limit(model: Model, limits: Coefficients | None) -> Any:
    """Return the effort limit of motors [N m or N]; None leaves it to the controller."""
    return model.effort_limit[6 if model.floating else 0 :] if limits is True else limits


def _limits_of_motors(
    model: Model, limits: Coefficients | None, controller: Controller[Any] | None
) -> list[float] | None:
    """Return the effort limits of PyBullet's motors; None for other controllers and engine defaults."""
    if limits is None or not isinstance(controller, BulletMotor):
        return None
    base = 6 if model.floating else 0
    motor_limits: list[float] = checked_limit(model, _motor_limit(model, limits))[base:].tolist()
    return motor_limits


def _settings(model: Model, given: dict[str, Any]) -> dict[str, Any]:
    """Return the options of the scenario that were given, in the form of its fields.

    Damping, friction and armature override ``--no-joint-dynamics``.
    """
    settings: dict[str, Any] = {}
    if given["no_joint_dynamics"]:
        names = ("joint_damping", "joint_friction", "joint_armature", "joint_springs")
        settings |= dict.fromkeys(names, False)
    for name, each in OPTIONS.items():
        value = given.get(name)
        if is_command_option(each) and value not in (None, ()):
            settings[name] = _VALUES.get(each.kind, _unchanged)(model, each, value)
    if given["noise_q"] is not None or given["noise_v"] is not None:
        settings["noise"] = Noise(given["noise_q"] or 0.0, given["noise_v"] or 0.0, given["seed"] or 0)
    return settings


def _refuse_ineffective_options(model: Model, given: dict[str, Any], settings: dict[str, Any]) -> None:
    """Raise ArgumentError for an option that has no effect without another that is missing."""
    needed = {
        command_flag(each): f"{command_flag(OPTIONS[other])} {wanted}".rstrip()
        for name, each in OPTIONS.items()
        for other, wanted in [each.needs]
        if name in settings
        and other
        and not in_effect(model, other, settings.get(other, OPTIONS[other].default), wanted)
    }
    if given["seed"] is not None and "noise" not in settings:
        needed["--seed"] = "--noise-q or --noise-v"
    if given["resume_step"] is not None and given["resume"] is None:
        needed["--resume-step"] = "--resume"
    for flag, other in needed.items():
        raise ArgumentError(f"{flag} needs {other}")


def _unchanged(model: Model, option: Option, value: Any) -> Any:
    return value


def _coordinates(model: Model, option: Option, value: Any) -> Any:
    read = configuration if option.kind is declared.CONFIGURATION else velocity
    return read(model, value, command_flag(option))


def _parts(model: Model, option: Option, value: Any) -> Any:
    assert isinstance(option.kind, declared.Parts)
    return [option.kind.part_class(*each) for each in value]


def _gains_of(controller: Controller[Any] | None) -> dict[str, list[float]]:
    """Return the gains of a controller, given or default."""
    inner = _innermost(controller)
    gains = {name: getattr(inner, name, None) for name in ("kp", "ki", "kd", "stiffness", "damping")}
    return {name: gain.tolist() for name, gain in gains.items() if isinstance(gain, np.ndarray)}


def _innermost(controller: Controller[Any] | None) -> Controller[Any] | None:
    return controller.inner if isinstance(controller, FrictionCompensation) else controller


def _factors(model: Model, option: Option, given: Any) -> float | dict[str, float]:
    """Return the factor of all links, or of each link where some have their own."""
    whole = [factor for link, factor in given if link is None]
    named = {link: factor for link, factor in given if link is not None}
    if len(whole) > 1 or len(whole) + len(named) < len(given):
        raise ArgumentError(f"{command_flag(option)} is given twice for the same links")
    of_all: float = whole[0] if whole else 1.0
    return {**dict.fromkeys((link.name for link in model.links), of_all), **named} if named else of_all


_VALUES: dict[Kind, Callable[[Model, Option, Any], Any]] = {
    declared.CONFIGURATION: _coordinates,
    declared.VELOCITY: _coordinates,
    declared.PAYLOADS: _parts,
    declared.PUSHES: _parts,
    declared.FACTORS: _factors,
}
"""Conversions of what the command line reads to what a scenario takes, by the kind of option."""


DURATION = 2.0
"""Default duration of a motion without limits [s]."""

TIMED_PROFILES = {"cycloidal": trajectory.cycloidal, "cubic": trajectory.cubic, "quintic": trajectory.quintic}
"""Profiles with a given duration."""

LIMITED_PROFILES = {"trapezoidal": ("acceleration",), "s-curve": ("acceleration", "jerk")}
"""Profiles as fast as limits allow, and the limits that they require besides that of velocity."""

Limit = float | list[float]


@dataclass(frozen=True)
class MotionInput:
    """Options of a motion, by their parameter names."""

    to: Numbers
    to_pose: Numbers
    frame: str | None
    start: Numbers
    profile: str | None
    duration: float | None
    settle: float
    velocity: Limit | None
    acceleration: Limit | None
    jerk: Limit | None
    controller: str

    @classmethod
    def of(cls, given: dict[str, Any]) -> MotionInput:
        """Select the options of a motion from all options of the command."""
        return cls(**{field.name: given[field.name] for field in fields(cls)})

    @property
    def chosen_profile(self) -> str:
        """The profile given, or the one that the other options imply."""
        if self.profile is not None:
            return self.profile
        return "cycloidal" if self.has_target else "hold"

    @property
    def seconds(self) -> float:
        """The duration given, or the default [s]."""
        return DURATION if self.duration is None else self.duration

    @property
    def has_target(self) -> bool:
        """True if a target is given."""
        return self.to is not None or self.to_pose is not None

    @property
    def needs_frame(self) -> bool:
        """True if the target or the controller refers to a frame."""
        controller = CONTROLLERS.get(self.controller)
        return self.to_pose is not None or (controller is not None and controller.controls == "frame")


@dataclass(frozen=True)
class ReferenceMotion:
    """Reference or None, configuration at its start, duration of the simulation [s], and frame or None."""

    reference: Trajectory | Floats | None
    start: Floats
    duration: float
    frame: str | None
    description: dict[str, Any]
    """Entry ``motion`` of the JSON document."""


def plan_motion(model: Model, options: MotionInput) -> ReferenceMotion:
    """Plan the motion that the options describe. Raises ArgumentError where they contradict each other."""
    _refuse_contradictions(options)
    frame = chosen_frame(model, options.frame) if options.needs_frame else None
    start = configuration(model, options.start, "--from", model.clip(model.neutral()))
    profile = options.chosen_profile
    description: dict[str, Any] = {
        "profile": profile,
        "line": None if options.to_pose is None else target_pose(options.to_pose, "--to-pose").tolist(),
        "from": start.tolist(),
        "settle": options.settle,
    }
    if profile == "hold":
        held = start if options.to is None else configuration(model, options.to, "--to", start)
        reference = None if options.controller == "none" and options.to is None else held
        description |= {"to": None if reference is None else held.tolist(), "duration": options.seconds}
        return ReferenceMotion(reference, start, options.seconds + options.settle, frame, description)
    if options.to is None:
        motion = _line_motion(model, options, frame, start)
    else:
        motion = _joint_motion(model, options, profile, start)
    description |= {"to": motion.end.q.tolist(), "duration": motion.duration}
    return ReferenceMotion(motion, start, motion.duration + options.settle, frame, description)


def _joint_motion(model: Model, options: MotionInput, profile: str, start: Floats) -> Trajectory:
    goal = configuration(model, options.to, "--to", start)
    if profile in TIMED_PROFILES:
        return TIMED_PROFILES[profile](start, goal, options.seconds, model=model)
    plan = trajectory.s_curve if profile == "s-curve" else trajectory.trapezoidal
    limits = {name: getattr(options, name) for name in ("velocity", "duration", *LIMITED_PROFILES[profile])}
    return plan(start, goal, model=model, **limits)


def _line_motion(model: Model, options: MotionInput, frame: str | None, start: Floats) -> Trajectory:
    time_law = TIMED_PROFILES[options.chosen_profile]([0.0], [1.0], options.seconds)
    return trajectory.line(model, str(frame), start, target_pose(options.to_pose, "--to-pose"), law=time_law)


def _refuse_contradictions(options: MotionInput) -> None:
    profile = options.chosen_profile
    if options.to is not None and options.to_pose is not None:
        raise ArgumentError("--to and --to-pose are both given; wanted one of them")
    if not options.has_target and profile != "hold":
        raise ArgumentError(f"--profile {profile} needs --to or --to-pose")
    if options.to_pose is not None and profile not in TIMED_PROFILES:
        raise ArgumentError(f"--to-pose takes --profile {', '.join(TIMED_PROFILES)}; not {profile}")
    if options.frame is not None and not options.needs_frame:
        raise ArgumentError("--frame needs --to-pose or --controller operational-space or impedance")
    needed = LIMITED_PROFILES.get(profile, ())
    for name in needed:
        if getattr(options, name) is None:
            raise ArgumentError(f"--profile {profile} needs --{name}")
    allowed = ("velocity", *needed) if needed else ()
    for name in ("velocity", "acceleration", "jerk"):
        if name not in allowed and getattr(options, name) is not None:
            takers = [each for each, required in LIMITED_PROFILES.items() if name in ("velocity", *required)]
            raise ArgumentError(f"--{name} needs --profile {' or '.join(takers)}, not {profile}")
    if options.settle < 0.0:
        raise ArgumentError(f"--settle is {options.settle:g} s; wanted 0 or more")


def limit_message(error: LimitError, robot: str, *, ignorable: bool) -> str:
    """Name each violated limit, and the options that help; `ignorable` where --ignore-limits is one."""
    if not error.violations:  # not a limit of joints
        return str(error)
    listed = "; ".join(map(_violation, error.violations))
    speeds = [each for each in error.violations if each.quantity == "velocity"]
    hints = ["a longer --duration lowers velocities"] * any(each.limit != 0.0 for each in speeds)
    still = [each.joint for each in speeds if each.limit == 0.0]
    if still:
        hints.append(
            f'<limit velocity="0"> of {shown(still[0])} means that it must not move: write its largest speed'
        )
    hints += ["--ignore-limits simulates it nevertheless"] * ignorable
    hint = f" ({'; '.join(hints)})" if hints else ""
    return f"the motion violates {counted(len(error.violations), 'limit')} of {robot}: {listed}{hint}"


def _violation(broken: LimitViolation) -> str:
    return (
        f"{broken.quantity} of {shown(broken.joint)} is {broken.value:.6g} {broken.unit} at "
        f"{broken.time:.6g} s, limit {broken.limit:.6g} {broken.unit}"
    )
