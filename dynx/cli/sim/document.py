"""JSON document of one simulation: its keys and types, from which its schema is generated, and its values.

Lengths are in m, angles in rad, torques in N m or N; errors are null without a reference.
"""

from __future__ import annotations

from typing import Any, Literal, TypedDict

import numpy as np

from dynx._version import __version__
from dynx.cli.sim.request import SimulationRequest
from dynx.errors import DivergedError, SimulationError
from dynx.model import Model
from dynx.model.documents import pose_numbers
from dynx.sim import Noise, Rollout, RolloutInterrupted
from dynx.sim.record.tracking_error import base_error, frame_error, joint_error
from dynx.spatial.scalar import Floats
from dynx.steppers.forces import ExternalForce


class BodyErrorPart(TypedDict):
    """Norm of a position or rotation error: its maximum, the time of that, and its final value."""

    max: float
    max_time: float
    final: float


class BodyError(TypedDict):
    """Error of a floating base or of a frame."""

    position: BodyErrorPart
    rotation: BodyErrorPart


class JointEntry(TypedDict):
    """Coordinate of v, those of a floating base first; `saturated` is the fraction of steps at the limit."""

    name: str
    unit: Literal["rad", "m"]
    max_error: float | None
    rms_error: float | None
    final_error: float | None
    max_speed: float
    max_torque: float
    effort_limit: float | None
    saturated: float


class SimulationEnd(TypedDict):
    """Reason why a simulation ended early, and the state there."""

    type: str
    message: str
    time: float
    step: int
    q: list[float]
    v: list[float]


class PayloadEntry(TypedDict):
    """A mass [kg] rigidly connected to a frame, with its center in that frame."""

    frame: str
    mass: float
    center: list[float]


class FinalState(TypedDict):
    """Last state of the record."""

    t: float
    q: list[float]
    v: list[float]


class SimDocument(TypedDict):
    """One simulation with its options and results; `settings` are the main settings of its scenario."""

    schema: int
    dynx: str
    robot: str
    source: str | None
    base: str
    base_pose: list[float]
    gravity: list[float]
    nq: int
    nv: int
    law: str
    backend: str | None
    frame: str | None
    frame_given: bool
    motion: dict[str, Any]
    gains: dict[str, Any]
    motor_limits: list[float] | None
    settings: dict[str, Any]
    payload: list[PayloadEntry]
    mass_scale: float | dict[str, float]
    total_mass: float
    passive: bool
    status: Literal["done", "diverged", "control failed", "interrupted"]
    error: SimulationEnd | None
    overshoot: dict[str, Any] | None
    dt: float
    steps: int
    steps_asked: int
    simulated: float
    seconds: float
    max_error: float | None
    max_error_joint: str | None
    max_error_time: float | None
    rms_error: float | None
    final_error: float | None
    energy_change: float
    energy_drift: float
    max_kinetic_energy: float
    saturated: float
    base_error: BodyError | None
    frame_error: BodyError | None
    joints: list[JointEntry]
    final: FinalState
    files: list[str]


SCHEMA = 1

Entry = dict[str, Any]
EarlyEnd = SimulationError | RolloutInterrupted | None
"""Error or interrupt that ended a simulation before its last step; None where it is complete."""

DONE, DIVERGED, CONTROL_FAILED, INTERRUPTED = "done", "diverged", "control failed", "interrupted"
"""Values of ``status``."""


def document(request: SimulationRequest, rollout: Rollout, seconds: float, ended: EarlyEnd) -> Entry:
    """Describe a simulation and its results.

    Absent numbers (errors without a reference, unlimited efforts) are null.
    """
    scenario, model, summary = request.scenario, request.scenario.model, _summary(rollout)
    return {
        "schema": SCHEMA,
        "dynx": __version__,
        "robot": model.name,
        "source": model.source,
        "base": model.base,
        "base_pose": pose_numbers(model.base_pose),
        "gravity": list(model.gravity),
        "nq": model.nq,
        "nv": model.nv,
        **request.header,
        "settings": _settings(request, rollout),
        "payload": [
            {"frame": each.frame, "mass": each.mass, "center": np.asarray(each.center).tolist()}
            for each in scenario.payloads
        ],
        "mass_scale": scenario.mass_scale,
        "total_mass": rollout.model.total_mass,
        "passive": _is_passive(request, rollout),
        "status": _status(ended),
        "error": _error(ended),
        "overshoot": _overshoot(ended),
        "dt": request.clock.dt,
        "steps": len(rollout),
        "steps_asked": request.clock.n_steps,
        "simulated": float(rollout.t[-1]),
        "seconds": seconds,
        **summary,
        "base_error": base_error(rollout),
        "frame_error": frame_error(rollout, request.motion.frame),
        "joints": _joints(model, rollout),
        "final": {"t": float(rollout.t[-1]), "q": rollout.q[-1].tolist(), "v": rollout.v[-1].tolist()},
    }


def _summary(rollout: Rollout) -> Entry:
    """Return the numbers of the whole robot, over all joints and times."""
    with np.errstate(all="ignore"):
        summary = rollout.summary()
        return {
            **joint_error(rollout),
            "energy_change": float(np.max(np.abs(rollout.energy - rollout.energy[0]))),
            "energy_drift": summary.energy_drift,
            "max_kinetic_energy": float(np.max(rollout.kinetic_energy)),
            "saturated": summary.saturated,
        }


def _joints(model: Model, rollout: Rollout) -> list[Entry]:
    """Return the entries of all coordinates of v; those of a floating base come first."""
    with np.errstate(all="ignore"):
        summary = rollout.summary()
    in_effect = rollout.settings.get("effort_limits")
    limit: Floats = model.effort_limit if in_effect is None else np.array(in_effect)
    entries = []
    for k, (name, unit) in enumerate(zip(_names(model), summary.units, strict=True)):
        known = rollout.reference is not None
        entries.append(
            {
                "name": name,
                "unit": unit,
                "max_error": float(summary.max_error[k]) if known else None,
                "rms_error": float(summary.rms_error[k]) if known else None,
                "final_error": float(rollout.error[-1, k]) if known else None,
                "max_speed": float(summary.max_speed[k]),
                "max_torque": float(summary.max_torque[k]),
                "effort_limit": float(limit[k]) if np.isfinite(limit[k]) else None,
                "saturated": float(np.mean(rollout.saturated[:, k])) if len(rollout) else 0.0,
            }
        )
    return entries


def _names(model: Model) -> list[str]:
    """Return the names of the coordinates of v; those of a floating base are in its own axes."""
    base = ["base x", "base y", "base z", "base rx", "base ry", "base rz"] if model.floating else []
    return [*base, *model.joint_names]


def _settings(request: SimulationRequest, rollout: Rollout) -> Entry:
    """Return the settings of the record, with noise and pushes as objects, and with the armature."""
    scenario, kept = request.scenario, rollout.settings
    return {
        **kept,
        "joints": {**kept["joints"], "armature": np.diag(rollout.rotors).tolist()},
        "noise": None if scenario.noise is None else _noise(scenario.noise),
        "pushes": [_push(each) for each in scenario.all_pushes],
    }


def _noise(noise: Noise) -> Entry:
    return {"q": np.asarray(noise.q).tolist(), "v": np.asarray(noise.v).tolist(), "seed": noise.seed}


def _push(push: ExternalForce) -> Entry:
    """Return the entry of one push; `duration` None lasts until the end."""
    return {
        "frame": push.on,
        "wrench": np.asarray(push.wrench).tolist(),
        "start": push.start,
        "duration": push.duration if np.isfinite(push.duration) else None,
        "reference": push.reference,
    }


def _is_passive(request: SimulationRequest, rollout: Rollout) -> bool:
    """Check whether nothing does work on the robot, so that its energy is conserved."""
    joints = rollout.settings["joints"]
    disturbed = any(joints["damping"]) or any(joints["friction"]) or request.scenario.pushes
    return request.controller is None and not disturbed and not request.scenario.position_limits


def _status(ended: EarlyEnd) -> str:
    if ended is None:
        return DONE
    if isinstance(ended, RolloutInterrupted):
        return INTERRUPTED
    return DIVERGED if isinstance(ended, DivergedError) else CONTROL_FAILED


def _overshoot(ended: EarlyEnd) -> Entry | None:
    """Return the joint whose damping is unstable for the time step, if that may have caused divergence."""
    if not isinstance(ended, DivergedError) or ended.overshoot is None:
        return None
    return {"joint": ended.overshoot.joint, "ratio": ended.overshoot.ratio}


def _error(ended: EarlyEnd) -> Entry | None:
    """Return the reason why the simulation ended early, with time and state."""
    if ended is None:
        return None
    if isinstance(ended, RolloutInterrupted):
        kept = ended.rollout
        name, time, step, (q, v) = "Interrupted", float(kept.t[-1]), len(kept), (kept.q[-1], kept.v[-1])
    else:
        name, time, step, (q, v) = type(ended).__name__, ended.time, ended.step, ended.state
    vectors = {"q": np.asarray(q).tolist(), "v": np.asarray(v).tolist()}
    return {"type": name, "message": str(ended), "time": time, "step": step, **vectors}
