"""What ``dynx sim --json`` writes: one simulation as a document of numbers and text."""

from __future__ import annotations

from typing import Any

import numpy as np

from dynx._version import __version__
from dynx.cli.sim_request import Prepared
from dynx.errors import DivergedError, SimulationError
from dynx.model import Model
from dynx.sim import Rollout
from dynx.spatial.scalar import Floats

SCHEMA = 1

Entry = dict[str, Any]

DONE, DIVERGED, CONTROL_FAILED, INTERRUPTED = "done", "diverged", "control failed", "interrupted"
"""How a simulation ended."""


def document(
    prepared: Prepared, rollout: Rollout, seconds: float, ended: SimulationError | KeyboardInterrupt | None
) -> Entry:
    """The simulation that was asked for, and what came of it; `ended` is what ended it early.

    Numbers that are none (errors without a reference, limits that are not there) are null.
    """
    model, summary = prepared.model, _summary(rollout)
    return {
        "schema": SCHEMA,
        "dynx": __version__,
        "robot": model.name,
        "source": model.source,
        "base": model.base,
        "gravity": list(model.gravity),
        "nq": model.nq,
        "nv": model.nv,
        **prepared.asked,
        "settings": rollout.settings,
        "payload": [
            {"frame": each.frame, "mass": each.mass, "center": list(each.center)}
            for each in prepared.arguments["payload"]
        ],
        "mass_scale": prepared.arguments["mass_scale"],
        "total_mass": rollout.model.total_mass,
        "passive": _is_passive(prepared),
        "status": _status(ended),
        "error": _error(ended),
        "dt": prepared.clock.dt,
        "steps": len(rollout),
        "steps_asked": prepared.clock.n_steps,
        "simulated": float(rollout.t[-1]),
        "seconds": seconds,
        **summary,
        "joints": _joints(model, rollout),
        "final": {"t": float(rollout.t[-1]), "q": rollout.q[-1].tolist(), "v": rollout.v[-1].tolist()},
    }


def _summary(rollout: Rollout) -> Entry:
    """The numbers of the whole robot, over all joints and times."""
    error = np.abs(rollout.error)
    with np.errstate(all="ignore"):
        of_all = rollout.summary()
        row, column = np.unravel_index(int(np.argmax(error)), error.shape) if error.size else (0, 0)
        known = rollout.reference is not None and error.size > 0
        return {
            "max_error": float(error[row, column]) if known else None,
            "max_error_joint": _names(rollout.model)[column] if known else None,
            "max_error_time": float(rollout.t[row]) if known else None,
            "rms_error": float(np.sqrt(np.mean(error**2))) if known else None,
            "final_error": float(error[-1].max()) if known else None,
            "energy_drift": of_all.energy_drift,
            "max_kinetic_energy": float(np.max(rollout.kinetic_energy)),
            "saturated": of_all.saturated,
        }


def _joints(model: Model, rollout: Rollout) -> list[Entry]:
    """One entry for each coordinate of v, those of a floating base first."""
    with np.errstate(all="ignore"):
        summary = rollout.summary()
    limit: Floats = model.effort_limit
    entries = []
    for k, (name, unit) in enumerate(zip(_names(model), _units(model), strict=True)):
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
    """What each coordinate of v is called; those of a floating base are along its own axes."""
    base = ["base x", "base y", "base z", "base rx", "base ry", "base rz"] if model.floating else []
    return [*base, *model.joint_names]


def _units(model: Model) -> list[str]:
    """``rad`` or ``m`` for each coordinate of v."""
    kinds = {joint.name: joint.type for joint in model.joints}
    base = ["m"] * 3 + ["rad"] * 3 if model.floating else []
    return [*base, *("m" if kinds[name] == "prismatic" else "rad" for name in model.joint_names)]


def _is_passive(prepared: Prepared) -> bool:
    """Whether nothing does work on the robot, so that its energy should stay what it is."""
    given = prepared.arguments
    loads = any(given[name] is not False for name in ("damping", "friction")) or given["pushes"]
    return prepared.law is None and not loads and not given["position_limits"]


def _status(ended: SimulationError | KeyboardInterrupt | None) -> str:
    if ended is None:
        return DONE
    if isinstance(ended, KeyboardInterrupt):
        return INTERRUPTED
    return DIVERGED if isinstance(ended, DivergedError) else CONTROL_FAILED


def _error(ended: SimulationError | KeyboardInterrupt | None) -> Entry | None:
    """Why it ended early, where and when; None also for one that was interrupted."""
    if not isinstance(ended, SimulationError):
        return None
    q, v = ended.state
    return {
        "type": type(ended).__name__,
        "message": str(ended),
        "time": ended.time,
        "step": ended.step,
        "q": np.asarray(q).tolist(),
        "v": np.asarray(v).tolist(),
    }
