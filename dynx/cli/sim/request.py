"""Scenario of ``dynx sim``, made from the options of the command."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from dynx.backends.registry import backend_class
from dynx.cli.shell.inputs import configuration, load_robot, velocity
from dynx.cli.sim.motion import Motion, MotionInput, plan_motion
from dynx.cli.sim.values import Coefficients
from dynx.control import EngineMotor, FrictionCompensation, ModelBased
from dynx.control.base import Controller
from dynx.control.saturation import checked_limit
from dynx.errors import ArgumentError, UnsupportedFeatureError
from dynx.model import Model
from dynx.sim import Noise, Payload, Push, Rollout, Scenario
from dynx.sim.named_controllers import ControllerRequest, Gains, named_controller
from dynx.sim.plants.registry import require_plant
from dynx.sim.setup import step_bytes
from dynx.simd.machine import require_memory
from dynx.steppers.clock import Clock

GAINS = ("kp", "kd", "ki", "natural_frequency", "damping_ratio", "posture_kp", "posture_kd")
SCENARIO_FIELDS = ("plant", "integrator", "dt", "substeps", "control_dt", "delay", "position_limits")
"""Options that are fields of a `Scenario` under the same name."""

REQUIRED_OPTION = {
    "method": "--integrator adaptive",
    "rtol": "--integrator adaptive",
    "atol": "--integrator adaptive",
    "friction_slip": "--friction",
    "seed": "--noise-q or --noise-v",
    "resume_step": "--resume",
}
"""Options that have an effect only together with another option."""

STEP_BYTES = 2000
"""Approximate memory [bytes] of a step besides its record: setpoints, temporary arrays of the summary."""


@dataclass(frozen=True)
class SimulationRequest:
    """A scenario with checked options, and the other input of its document."""

    scenario: Scenario
    controller: Controller[Any] | None
    motion: Motion
    clock: Clock
    options: dict[str, Any]
    """Options of `dynx.simulate` besides the scenario: the record to resume, and its step."""
    header: dict[str, Any]
    """Entries of the document that the record does not contain."""


def prepare(given: dict[str, Any]) -> SimulationRequest:
    """Make a scenario from the options `given` by parameter name. Raises ArgumentError for invalid ones."""
    model = load_robot(*(given[name] for name in ("robot", "base", "lock", "base_pose", "gravity")))
    require_plant(given["plant"])
    backend_class(given["backend"]).require_engine()
    dynamics = _joint_dynamics(given)
    _refuse_ineffective_options(given, dynamics)
    motion = plan_motion(model, MotionInput.of(given))
    clock = Clock.of(given["dt"], motion.duration, given["control_dt"], given["delay"])
    require_memory(f"{clock.n_steps} steps", clock.n_steps * (STEP_BYTES + step_bytes(model)))
    controller = _controller(model, given, motion, clock, dynamics)
    limits: Coefficients | None = given["effort_limits"]
    q0 = motion.start if given["q0"] is None else configuration(model, given["q0"], "--q0", motion.start)
    fields: dict[str, Any] = {
        **{name: given[name] for name in SCENARIO_FIELDS},
        **dynamics,
        **{name: given[name] for name in ("method", "rtol", "atol") if given[name] is not None},
        "duration": motion.duration,
        "q0": q0,
        "v0": velocity(model, given["v0"], "--v0") if given["v0"] is not None else None,
        # Motors of the engine have their own limits (`_controller`).
        "effort_limits": False if limits is None or isinstance(controller, EngineMotor) else limits,
        "noise": _noise(given),
        "payload": [Payload(*each) for each in given["payload"]],
        "mass_scale": _mass_scale(model, given["mass_scale"]),
        "pushes": [Push(*each) for each in given["pushes"]],
        "check_reference": not given["ignore_limits"],
    }
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
    scenario = Scenario(model, controller, motion.reference, **fields)
    return SimulationRequest(scenario, controller, motion, clock, options, header)


def _controller(
    model: Model, given: dict[str, Any], motion: Motion, clock: Clock, dynamics: dict[str, Any]
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
    if isinstance(controller, EngineMotor):
        raise UnsupportedFeatureError(
            f"{given['controller']} is a motor inside PyBullet; no torque can be added"
        )
    if dynamics["damping"] is False and dynamics["friction"] is False:
        raise ArgumentError(
            "--friction-compensation needs joint dynamics: --damping, --friction or --joint-dynamics"
        )
    slip = dynamics["friction_slip"]
    return FrictionCompensation(
        controller,
        damping=dynamics["damping"],
        friction=dynamics["friction"],
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
    if limits is None or not isinstance(controller, EngineMotor):
        return None
    base = 6 if model.floating else 0
    motor_limits: list[float] = checked_limit(model, _motor_limit(model, limits))[base:].tolist()
    return motor_limits


def _joint_dynamics(given: dict[str, Any]) -> dict[str, Any]:
    """Return damping, friction and armature of the joints; single options override ``--joint-dynamics``."""
    all_of_urdf: bool = given["joint_dynamics"]
    names = ("damping", "friction", "armature")
    dynamics = {name: all_of_urdf if given[name] is None else given[name] for name in names}
    return {
        **dynamics,
        "friction_slip": given["friction_slip"] or 0.0,
    }


def _refuse_ineffective_options(given: dict[str, Any], dynamics: dict[str, Any]) -> None:
    """Raise ArgumentError for an option that has no effect without another that is missing."""
    noisy = given["noise_q"] is not None or given["noise_v"] is not None
    has_use = {
        "--integrator adaptive": given["integrator"] == "adaptive",
        "--friction": dynamics["friction"] is not False,
        "--noise-q or --noise-v": noisy,
        "--resume": given["resume"] is not None,
    }
    for name, other in REQUIRED_OPTION.items():
        if given[name] is not None and not has_use[other]:
            raise ArgumentError(f"--{name.replace('_', '-')} needs {other}")


def _noise(given: dict[str, Any]) -> Noise | None:
    if given["noise_q"] is None and given["noise_v"] is None:
        return None
    return Noise(given["noise_q"] or 0.0, given["noise_v"] or 0.0, given["seed"] or 0)


def _gains_of(controller: Controller[Any] | None) -> dict[str, list[float]]:
    """Return the gains of a controller, given or default."""
    inner = _innermost(controller)
    gains = {name: getattr(inner, name, None) for name in ("kp", "ki", "kd", "stiffness", "damping")}
    return {name: gain.tolist() for name, gain in gains.items() if isinstance(gain, np.ndarray)}


def _innermost(controller: Controller[Any] | None) -> Controller[Any] | None:
    return controller.inner if isinstance(controller, FrictionCompensation) else controller


def _mass_scale(model: Model, given: tuple[tuple[str | None, float], ...]) -> float | dict[str, float]:
    """Return the factor of all links, or of each link where some have their own."""
    whole = [factor for link, factor in given if link is None]
    named = [link for link, _ in given if link is not None]
    if len(whole) > 1 or len(named) > len(set(named)):
        raise ArgumentError("--mass-scale is given twice for the same links")
    of_all = whole[0] if whole else 1.0
    if not named:
        return of_all
    factors = dict.fromkeys((link.name for link in model.links), of_all)
    return {**factors, **{link: factor for link, factor in given if link is not None}}
