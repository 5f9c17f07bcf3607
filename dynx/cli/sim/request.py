"""Scenario of ``dynx sim``, made from the options of the command."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from dynx.backends.registry import backend_class
from dynx.cli.shell.inputs import configuration, load_robot, velocity
from dynx.cli.shell.kinds import Coefficients, command_flag, is_command_option
from dynx.cli.sim.motion import MotionInput, ReferenceMotion, plan_motion
from dynx.control import BulletMotor, FrictionCompensation, ModelBased
from dynx.control.base import Controller
from dynx.control.saturation import checked_limit
from dynx.errors import ArgumentError, UnsupportedFeatureError
from dynx.model import Model
from dynx.sim import Noise, Rollout, Scenario
from dynx.sim.named_controllers import ControllerRequest, Gains, named_controller
from dynx.sim.plants.registry import require_plant
from dynx.sim.scenario import options as declared
from dynx.sim.scenario.options import OPTIONS, Kind, Option, SimulationOptions
from dynx.sim.setup import step_bytes
from dynx.simd.machine import require_memory
from dynx.steppers.clock import Clock

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
    _refuse_ineffective_options(given, settings)
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
        if gains.given() or given["friction_compensation"]:
            raise ArgumentError("--controller none takes no gains and no --friction-compensation")
        return None
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
        ),
    )
    if not given["friction_compensation"]:
        return controller
    if isinstance(controller, BulletMotor):
        raise UnsupportedFeatureError(
            f"{given['controller']} is a motor inside PyBullet; no torque can be added"
        )
    if chosen.damping is False and chosen.friction is False:
        raise ArgumentError(
            "--friction-compensation needs joint dynamics: --damping, --friction or --joint-dynamics"
        )
    slip = chosen.friction_slip
    return FrictionCompensation(
        controller,
        damping=chosen.damping,
        friction=chosen.friction,
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

    Damping, friction and armature override ``--joint-dynamics``.
    """
    settings: dict[str, Any] = {}
    if given["joint_dynamics"]:
        settings |= dict.fromkeys(("damping", "friction", "armature"), True)
    for name, each in OPTIONS.items():
        value = given.get(name)
        if is_command_option(each) and value not in (None, ()):
            settings[name] = _VALUES.get(each.kind, _unchanged)(model, each, value)
    if given["noise_q"] is not None or given["noise_v"] is not None:
        settings["noise"] = Noise(given["noise_q"] or 0.0, given["noise_v"] or 0.0, given["seed"] or 0)
    return settings


def _refuse_ineffective_options(given: dict[str, Any], settings: dict[str, Any]) -> None:
    """Raise ArgumentError for an option that has no effect without another that is missing."""
    needed = {
        command_flag(each): f"{command_flag(OPTIONS[other])} {wanted}".rstrip()
        for name, each in OPTIONS.items()
        for other, wanted in [each.needs]
        if name in settings and other and not _in_effect(settings.get(other, False), wanted)
    }
    if given["seed"] is not None and "noise" not in settings:
        needed["--seed"] = "--noise-q or --noise-v"
    if given["resume_step"] is not None and given["resume"] is None:
        needed["--resume-step"] = "--resume"
    for flag, other in needed.items():
        raise ArgumentError(f"{flag} needs {other}")


def _in_effect(value: Any, wanted: str) -> bool:
    return bool(value == wanted) if wanted else value is not False


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
