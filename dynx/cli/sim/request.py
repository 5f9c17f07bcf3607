"""From the words of ``dynx sim`` to the arguments of `dynx.simulate`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from dynx.backends.registry import backend_class
from dynx.cli.shell.inputs import configuration, velocity
from dynx.cli.sim.motion import Motion, MotionInput, planned
from dynx.cli.sim.values import Coefficients, PayloadInput, PushInput
from dynx.control import EngineMotor, FrictionCompensation, ModelBased
from dynx.control.base import Controller
from dynx.control.friction import SLIP
from dynx.control.saturation import checked_limit
from dynx.errors import ArgumentError, UnsupportedFeatureError
from dynx.model import Model
from dynx.model.loading import load
from dynx.model.model import Base
from dynx.sim import Noise, Payload, Push, Rollout
from dynx.sim.clock import Clock
from dynx.sim.named_controllers import ControllerRequest, Gains, named_controller
from dynx.simd.machine import MAX_MEMORY_SHARE, memory_size

GAINS = ("kp", "kd", "ki", "natural_frequency", "damping_ratio", "posture_kp", "posture_kd")
PASSED_ON = ("plant", "integrator", "dt", "substeps", "control_dt", "delay", "position_limits")
"""Options that `dynx.simulate` has under the same name and with the same meaning."""

ONLY_WITH = {
    "method": "--integrator adaptive",
    "rtol": "--integrator adaptive",
    "atol": "--integrator adaptive",
    "friction_slip": "--friction",
    "seed": "--noise-q or --noise-v",
    "resume_step": "--resume",
}
"""Options that mean nothing without another; left to their default where they are not given."""

STEP_BYTES = 2000
"""Memory of a step besides its numbers, about: setpoints, and what the summary takes in passing."""


@dataclass(frozen=True)
class Prepared:
    """One simulation, ready to be run: everything that can be refused beforehand was looked at."""

    model: Model
    law: Controller[Any] | None
    motion: Motion
    clock: Clock
    arguments: dict[str, Any]
    """What `dynx.simulate` gets besides the robot, the law and the reference."""
    asked: dict[str, Any]
    """What was asked for that the record does not say, for the document."""


def prepare(given: dict[str, Any]) -> Prepared:
    """The simulation that the options `given` mean, by the names that click has for them."""
    base: Base = given["base"]
    model = load(given["robot"], base=base, lock=dict(given["lock"]), gravity=given["gravity"])
    for engine in (given["plant"], given["backend"]):
        backend_class(engine).require_engine()
    losses = _losses(given)
    _refuse_idle(given, losses)
    motion = planned(model, MotionInput.of(given))
    clock = Clock.of(given["dt"], motion.duration, given["control_dt"], given["delay"])
    _require_memory(model, clock)
    law = _law(model, given, motion, clock, losses)
    limits: Coefficients | None = given["effort_limits"]
    q0 = motion.begin if given["q0"] is None else configuration(model, given["q0"], "--q0", motion.begin)
    arguments: dict[str, Any] = {
        **{name: given[name] for name in PASSED_ON},
        **losses,
        **{name: given[name] for name in ("method", "rtol", "atol") if given[name] is not None},
        "duration": motion.duration,
        "q0": q0,
        "v0": velocity(model, given["v0"], "--v0") if given["v0"] is not None else None,
        # The engine's own motors are told their limits instead (`_law`).
        "effort_limits": False if limits is None or isinstance(law, EngineMotor) else limits,
        "noise": _noise(given),
        "payload": [_payload(each) for each in given["payload"]],
        "mass_scale": _mass_scale(model, given["mass_scale"]),
        "pushes": [_push(each) for each in given["pushes"]],
        "check_reference": not given["ignore_limits"],
        "resume": None if given["resume"] is None else Rollout.load(given["resume"]),
        "step": given["resume_step"],
    }
    asked = {
        "law": given["controller"],
        "backend": given["backend"] if _computes(law) else None,
        "frame": motion.frame,
        "frame_given": given["frame"] is not None,
        "motion": motion.said,
        "gains": _gains_of(law),
        "motor_limits": _limits_of_motors(model, given["effort_limits"], law),
    }
    return Prepared(model, law, motion, clock, arguments, asked)


def _law(
    model: Model, given: dict[str, Any], motion: Motion, clock: Clock, losses: dict[str, Any]
) -> Controller[Any] | None:
    gains = Gains(**{name: given[name] for name in GAINS})
    if given["controller"] == "none":
        if gains.given() or given["friction_compensation"]:
            raise ArgumentError("--controller none takes no gains and no --friction-compensation")
        return None
    law = named_controller(
        given["controller"],
        ControllerRequest(
            model,
            motion.begin,
            clock.control_dt,
            gains,
            motion.frame,
            _motor_limit(model, given["effort_limits"]),
            given["backend"],
        ),
    )
    if not given["friction_compensation"]:
        return law
    if isinstance(law, EngineMotor):
        raise UnsupportedFeatureError(
            f"{given['controller']} is a motor inside PyBullet; no torque can be added"
        )
    if losses["damping"] is False and losses["friction"] is False:
        raise ArgumentError(
            "--friction-compensation needs joint losses: --damping, --friction or --joint-dynamics"
        )
    return FrictionCompensation(
        law, damping=losses["damping"], friction=losses["friction"], slip=losses["friction_slip"]
    )


def _motor_limit(model: Model, limits: Coefficients | None) -> Any:
    """The most that motors give: what is asked for, None where that is left to the law."""
    return model.effort_limit[6 if model.floating else 0 :] if limits is True else limits


def _limits_of_motors(
    model: Model, limits: Coefficients | None, law: Controller[Any] | None
) -> list[float] | None:
    """What the engine's own motors are held to; None for another law, or where that is left to the engine."""
    if limits is None or not isinstance(law, EngineMotor):
        return None
    base = 6 if model.floating else 0
    held: list[float] = checked_limit(model, _motor_limit(model, limits))[base:].tolist()
    return held


def _losses(given: dict[str, Any]) -> dict[str, Any]:
    """Damping, friction and armature of the joints; one of its own outdoes ``--joint-dynamics``."""
    all_of_urdf: bool = given["joint_dynamics"]
    names = ("damping", "friction", "armature")
    losses = {name: all_of_urdf if given[name] is None else given[name] for name in names}
    return {**losses, "friction_slip": SLIP if given["friction_slip"] is None else given["friction_slip"]}


def _refuse_idle(given: dict[str, Any], losses: dict[str, Any]) -> None:
    """Raise ArgumentError for an option that nothing would come of: none is passed over in silence."""
    noisy = given["noise_q"] is not None or given["noise_v"] is not None
    has_use = {
        "--integrator adaptive": given["integrator"] == "adaptive",
        "--friction": losses["friction"] is not False,
        "--noise-q or --noise-v": noisy,
        "--resume": given["resume"] is not None,
    }
    for name, other in ONLY_WITH.items():
        if given[name] is not None and not has_use[other]:
            raise ArgumentError(f"--{name.replace('_', '-')} needs {other}")


def _noise(given: dict[str, Any]) -> Noise | None:
    if given["noise_q"] is None and given["noise_v"] is None:
        return None
    return Noise(given["noise_q"] or 0.0, given["noise_v"] or 0.0, given["seed"] or 0)


def _gains_of(law: Controller[Any] | None) -> dict[str, list[float]]:
    """The gains that a law has, whether given or by default."""
    inner = _innermost(law)
    kept = {name: getattr(inner, name, None) for name in ("kp", "ki", "kd", "stiffness", "damping")}
    return {name: gain.tolist() for name, gain in kept.items() if isinstance(gain, np.ndarray)}


def _innermost(law: Controller[Any] | None) -> Controller[Any] | None:
    return law.inner if isinstance(law, FrictionCompensation) else law


def _computes(law: Controller[Any] | None) -> bool:
    """Whether the law asks an engine."""
    return isinstance(_innermost(law), ModelBased)


def _payload(given: PayloadInput) -> Payload:
    return Payload(given.frame, given.mass, tuple(given.center))


def _push(given: PushInput) -> Push:
    duration = np.inf if given.duration is None else given.duration
    return Push(given.frame, given.wrench, given.start, duration)


def _mass_scale(model: Model, given: tuple[tuple[str | None, float], ...]) -> float | dict[str, float]:
    """One factor for all links, then those of single links instead."""
    whole = [factor for link, factor in given if link is None]
    named = [link for link, _ in given if link is not None]
    if len(whole) > 1 or len(named) > len(set(named)):
        raise ArgumentError("--mass-scale is given twice for the same links")
    of_all = whole[0] if whole else 1.0
    if not named:
        return of_all
    factors = dict.fromkeys((link.name for link in model.links), of_all)
    return {**factors, **{link: factor for link, factor in given if link is not None}}


def _require_memory(model: Model, clock: Clock) -> None:
    """Raise ArgumentError for a record that would not fit beside what else the machine does."""
    needed = clock.n_steps * (STEP_BYTES + 8 * (3 * model.nq + 7 * model.nv))
    if needed > MAX_MEMORY_SHARE * memory_size():
        raise ArgumentError(
            f"{clock.n_steps} steps need about {needed / 1e9:.3g} GB; "
            f"this machine has {memory_size() / 1e9:.3g} GB"
        )
