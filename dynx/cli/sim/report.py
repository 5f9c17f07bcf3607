"""JSON document of one simulation, and the text and table made from it alone.

Lengths are in m, angles in rad, torques in N m or N; errors are null without a reference.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Literal, TypedDict

import numpy as np
from rich.console import Console

from dynx._version import __version__
from dynx.cli.shell.exits import one_line
from dynx.cli.shell.inputs import default_frame_note
from dynx.cli.shell.output import Entry, counted, number
from dynx.cli.shell.tables import Table
from dynx.cli.sim.request import SimulationRequest
from dynx.errors import DivergedError, SimulationError
from dynx.model import Model
from dynx.model.documents import pose_numbers
from dynx.model.limited_positions import joint_ranges, limited_positions
from dynx.sim import Noise, Rollout, RolloutInterrupted
from dynx.sim.overshoot import Overshoot
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
    notes: list[str]


SCHEMA = 1

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
        "overshoot": _overshoot(rollout, ended),
        "dt": request.clock.dt,
        "steps": len(rollout),
        "steps_asked": request.clock.n_steps,
        "simulated": float(rollout.t[-1]),
        "seconds": seconds,
        **summary,
        "base_error": base_error(rollout),
        "frame_error": frame_error(rollout, request.motion.frame),
        "joints": _joints(model, rollout),
        "notes": list(rollout.notes),
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


def _joints(model: Model, rollout: Rollout) -> list[dict[str, Any]]:
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
    return [*base, *model.coordinate_names]


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
    return request.controller is None and not disturbed and not _reaches_limits(rollout)


def _reaches_limits(rollout: Rollout) -> bool:
    """Check whether a joint with stops was at one of its limits, where an impact takes energy."""
    q, (lower, upper) = limited_positions(rollout.model, rollout.q), joint_ranges(rollout.model)
    return bool(rollout.settings["joint_limits"] and ((q <= lower) | (q >= upper)).any())


def _status(ended: EarlyEnd) -> str:
    if ended is None:
        return DONE
    if isinstance(ended, RolloutInterrupted):
        return INTERRUPTED
    return DIVERGED if isinstance(ended, DivergedError) else CONTROL_FAILED


def _overshoot(rollout: Rollout, ended: EarlyEnd) -> Entry | None:
    """Return the joint whose damping is unstable for the time step, if that may have caused divergence, or if
    its torque reverses in every control step."""
    found: Overshoot | None = ended.overshoot if isinstance(ended, DivergedError) else rollout.overshoot
    if found is None:
        return None
    return {
        "joint": found.joint,
        "ratio": found.ratio,
        "finding": None
        if isinstance(ended, DivergedError)
        else found.finding(),  # the error of a divergence says it
    }


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


KINETIC_ENERGY_AT_REST = 1e-20
"""Kinetic energy [J] below which the robot counts as at rest: at most 1e-10 m/s for each kilogram."""

PLAIN_RANGE = (1e-3, 1e5)
"""Range of the largest number of a column that is written without exponents."""

_STEPPERS = {
    "engine": "its own stepper",
    "semi_implicit": "semi-implicit Euler",
    "rk4": "Runge-Kutta 4",
    "adaptive": "adaptive steps",
}
"""Integrators by their name in the document."""


def show(out: Console, report: Entry) -> None:
    """Print what was simulated, a table with a line for each joint, and a summary."""
    _show_header(out, report)
    out.print(_joint_table(report))
    out.print(_largest_error(report))
    for body, error in (("base", report["base_error"]), (report["frame"], report["frame_error"])):
        if error is not None:
            out.print(_body_error(one_line(body), error))
    out.print(_energy(report))
    if report["law"] != "none":
        out.print(_saturation(report))
    if report["overshoot"] is not None and report["overshoot"]["finding"]:
        out.print(one_line(report["overshoot"]["finding"]))
    for note in report["notes"]:
        out.print(f"note: {one_line(note)}", style="yellow")
    out.print(f"simulated {number(report['simulated'])} s in {report['seconds']:.2f} s")


def _show_header(out: Console, report: Entry) -> None:
    settings = report["settings"]
    controller = "no motors" if report["law"] == "none" else report["law"]
    if report["frame"] is not None and report["motion"]["line"] is None:
        controller += f" of {one_line(report['frame'])}"
    engine = "" if report["backend"] is None else f" computed by {report['backend']}"
    stepper = _STEPPERS.get(settings["integrator"], settings["integrator"])
    out.print(
        f"{one_line(report['robot'])}, {report['base']} base: {controller}{engine}, on {settings['plant']} "
        f"with {stepper}",
        style="bold",
    )
    out.print(
        f"{_motion(report)}; {counted(report['steps'], 'step')} of {number(report['dt'])} s, "
        f"gravity {' '.join(number(g) for g in report['gravity'])} m/s^2"
    )
    if any(report["base_pose"]):
        *xyz, roll, pitch, yaw = map(number, report["base_pose"])
        out.print(f"base at xyz {' '.join(xyz)} m, rpy {roll} {pitch} {yaw} rad")
    if report["frame"] is not None and not report["frame_given"]:
        out.print(default_frame_note(report["frame"]))
    gains = [f"{name} {value_range(gain)}" for name, gain in report["gains"].items() if gain]
    if gains:
        out.print(", ".join(gains))
    deviating = deviations(report)
    if deviating:
        out.print(deviating)


def _motion(report: Entry) -> str:
    motion = report["motion"]
    if motion["profile"] == "hold":
        return "no reference" if motion["to"] is None else "constant reference"
    where = "" if motion["line"] is None else f", {one_line(report['frame'])} along a straight line"
    return f"{motion['profile']} motion of {number(motion['duration'])} s{where}"


def _joint_table(report: Entry) -> Table:
    """Return the table with a line for each coordinate of v; errors are those of its position."""
    joints: list[Entry] = report["joints"]
    right = ("max\nerror", "RMS\nerror", "max\nspeed", "max\ntorque", "torque\nlimit", "of\nlimit")
    table = Table("joint", "unit", *right, right=right, keys=1)
    base = 6 if report["base"] == "floating" else 0
    speeds = column_text([joint["max_speed"] for joint in joints])
    torques = column_text([joint["max_torque"] for joint in joints])
    for k, (joint, speed, torque) in enumerate(zip(joints, speeds, torques, strict=True)):
        limit = joint["effort_limit"]
        table.add_row(
            one_line(joint["name"]) + " (base axes)" * (k < base),
            joint["unit"],
            error_text(joint["max_error"]),
            error_text(joint["rms_error"]),
            speed,
            torque,
            "-" if limit is None else f"{limit:.4g}",
            "-" if not limit else percent_text(joint["max_torque"] / limit),
        )
    return table


def _largest_error(report: Entry) -> str:
    if report["motion"]["to"] is None:
        return "no tracking error: there is no reference"
    if report["max_error"] is None:
        return "no tracking error of joints: the robot has none"
    units = {joint["name"]: joint["unit"] for joint in report["joints"]}
    joint = report["max_error_joint"]
    return (
        f"largest error {error_text(report['max_error'])} {units[joint]} of {one_line(joint)} at "
        f"{number(report['max_error_time'])} s, {error_text(report['final_error'])} at the end"
    )


def _body_error(body: str, error: Entry) -> str:
    """Make two lines with the position and rotation errors of the base or a frame."""
    parts = [
        f"{error_text(error[name]['max'])} {unit} at {number(error[name]['max_time'])} s, "
        f"{error_text(error[name]['final'])} at the end"
        for name, unit in (("position", "m"), ("rotation", "rad"))
    ]
    return f"error of {body}: position {parts[0]}\n{' ' * len(f'error of {body}')}  rotation {parts[1]}"


def _energy(report: Entry) -> str:
    """Make the line about energy: a relative drift where no work was done on the robot, else its change."""
    kinetic = report["max_kinetic_energy"]
    if kinetic < KINETIC_ENERGY_AT_REST:
        return "the robot stayed at rest"
    largest = f"largest kinetic energy {kinetic:.3g} J"
    if report["passive"]:
        return f"energy drift {report['energy_drift']:.2g} times the {largest}"
    return f"energy changed by up to {report['energy_change']:.3g} J; {largest}"


def _saturation(report: Entry) -> str:
    if report["motor_limits"] is not None:
        return "PyBullet saturated its motors at the limits; how often is unknown"
    if report["settings"]["effort_limits"] is None:
        return "torques were not limited (--effort-limits urdf limits them)"
    return f"torques were saturated in {100.0 * report['saturated']:.3g} % of the steps"


def error_text(error: float | None) -> str:
    """Write an error with two digits, or ``-`` for None."""
    if error is None:
        return "-"
    return "0" if error == 0.0 else f"{error:.1e}"


def column_text(values: Sequence[float]) -> list[str]:
    """Write the numbers of a column with the number of decimals that gives the largest one four digits."""
    largest = max(values, default=0.0)
    if largest == 0.0:
        return ["0"] * len(values)
    if not PLAIN_RANGE[0] <= largest < PLAIN_RANGE[1]:
        return [f"{value:.1e}" for value in values]
    decimals = max(0, 3 - math.floor(math.log10(largest)))
    return [f"{value:.{decimals}f}" for value in values]


def percent_text(ratio: float) -> str:
    """Write a ratio as a percentage with two digits, between ``<0.01 %`` and ``>9999 %``."""
    percent = 100.0 * ratio
    if percent == 0.0:
        return "0 %"
    if percent < 0.01:
        return "<0.01 %"
    if percent < 9.95:
        return f"{percent:.2f} %" if percent < 0.995 else f"{percent:.1f} %"
    return f"{percent:.0f} %" if percent < 9999.5 else ">9999 %"


_MAX_LISTED = 3
"""Largest number of links, payloads or pushes that are named; if there are more, they are counted."""


def deviations(report: Entry) -> str:
    """Make ``plant: payload 2 kg on tool0, ...; controller: noise ..., delay ...``; empty if nominal."""
    sides = {"plant": _plant_deviations(report), "controller": _controller_deviations(report)}
    return "; ".join(f"{side}: {', '.join(parts)}" for side, parts in sides.items() if parts)


def value_range(values: float | list[float]) -> str:
    """Write one number where all are equal, else the smallest and the largest."""
    numbers = values if isinstance(values, list) else [values]
    smallest, largest = f"{min(numbers):.3g}", f"{max(numbers):.3g}"
    return smallest if smallest == largest else f"{smallest} to {largest}"


KINDS_OF_JOINT_DYNAMICS = ("damping", "friction", "armature", "stiffness")
"""Coefficients of joints in the settings of a record."""


def _plant_deviations(report: Entry) -> list[str]:
    settings = report["settings"]
    payloads = [
        f"payload {number(each['mass'])} kg on {one_line(each['frame'])}" for each in report["payload"]
    ]
    parts = _listed(payloads, "payloads") + _mass_parts(report["mass_scale"])
    # A floating base has no joint dynamics.
    base = 6 if report["base"] == "floating" else 0
    joints = {name: settings["joints"][name][base:] for name in KINDS_OF_JOINT_DYNAMICS}
    parts += [f"{name} {value_range(each)}" for name, each in joints.items() if any(each)]
    parts += _listed([_push_text(each) for each in settings["pushes"]], "pushes")
    if not settings["joint_limits"]:
        parts.append("no stops at the position limits")
    if settings["substeps"] > 1:
        parts.append(f"{settings['substeps']} substeps")
    return parts


def _controller_deviations(report: Entry) -> list[str]:
    settings = report["settings"]
    parts = []
    noise = settings["noise"]
    if noise is not None:
        noises = [f"{value_range(noise[name])} in {name}" for name in ("q", "v") if _any(noise[name])]
        parts.append(f"noise {' and '.join(noises) or '0'}")
    if settings["delay"]:
        parts.append(f"delay {number(settings['delay'])} s")
    if settings["control_dt"] != settings["dt"]:
        parts.append(f"period {number(settings['control_dt'])} s")
    return parts


def _mass_parts(scale: float | dict[str, float]) -> list[str]:
    if not isinstance(scale, dict):
        return [] if scale == 1.0 else [f"masses times {number(scale)}"]
    named = [f"mass of {one_line(link)} times {number(x)}" for link, x in scale.items() if x != 1.0]
    return named if len(named) <= _MAX_LISTED else [f"masses times {value_range(list(scale.values()))}"]


def _push_text(push: Entry) -> str:
    # JSON has no infinity: None is a push until the end.
    duration = "" if push["duration"] is None else f" for {number(push['duration'])} s"
    return f"push on {one_line(push['frame'])} from {number(push['start'])} s{duration}"


def _listed(parts: list[str], plural: str) -> list[str]:
    return parts if len(parts) <= _MAX_LISTED else [f"{len(parts)} {plural}"]


def _any(values: float | list[float]) -> bool:
    return any(values) if isinstance(values, list) else values != 0.0
