"""Reference motion of ``dynx sim``, planned from the options of the command."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any

from dynx import trajectory
from dynx.cli.shell.inputs import Numbers, chosen_frame, configuration, target_pose
from dynx.cli.shell.terminal import counted
from dynx.errors import ArgumentError, LimitError, LimitViolation, shown
from dynx.model import Model
from dynx.sim.named_controllers import CONTROLLERS
from dynx.spatial.scalar import Floats
from dynx.trajectory import Trajectory

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
