"""Check of a motion against a robot's limits of position, velocity and effort."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import AbstractContextManager, nullcontext
from typing import Literal

import numpy as np

from dynx.argument_types import checks_types
from dynx.backends import Backend
from dynx.backends import backend as make_backend
from dynx.errors import ArgumentError, LimitError, LimitViolation, ShapeError, shown
from dynx.model import Model
from dynx.model.limited_positions import joint_ranges, limited_positions
from dynx.registry import DEFAULT_ENGINE
from dynx.spatial.scalar import Floats
from dynx.trajectory.base import Trajectory

SAMPLES = 500
"""Number of evenly spaced times that are checked, besides both sides of every knot."""

REFINEMENT_SAMPLES = 16
"""Number of further times on either side of the time of each largest excess."""

RELATIVE_TOLERANCE = 1e-12
"""A limit is violated if exceeded by more than this fraction of it, or of the largest value of the joint.

A motion planned up to a limit meets it only to rounding.
"""

UNITS = {
    "position": {"rad": "rad", "m": "m"},
    "velocity": {"rad": "rad/s", "m": "m/s"},
    "effort": {"rad": "N m", "m": "N"},
}
"""Unit of each quantity by the unit of the joint's position."""

Excess = tuple[Literal["position", "velocity", "effort"], Floats, Floats, Floats]
"""A quantity, its values (n, nv), the nearest limit of each, and the amount by which they exceed it."""


@checks_types
def check(
    model: Model,
    trajectory: Trajectory,
    *,
    effort: bool = True,
    joint_dynamics: bool = False,
    backend: str | Backend = DEFAULT_ENGINE,
) -> None:
    """Raise LimitError if the motion violates a limit of the model; its `violations` lists all of them.

    See `violations` for the arguments and for what is checked.
    """
    found = violations(model, trajectory, effort=effort, joint_dynamics=joint_dynamics, backend=backend)
    if found:
        limits = "1 limit" if len(found) == 1 else f"{len(found)} limits"
        listed = "".join(f"\n  {violation}" for violation in found)
        raise LimitError(f"the motion breaks {limits} of {model.name}:{listed}", found)


@checks_types
def violations(
    model: Model,
    trajectory: Trajectory,
    *,
    effort: bool = True,
    joint_dynamics: bool = False,
    backend: str | Backend = DEFAULT_ENGINE,
) -> list[LimitViolation]:
    """List every limit of position, velocity and effort that the motion violates, for each joint at the time
    of its largest excess.

    Effort is computed by inverse dynamics along the motion (including the joint dynamics of the description
    with `joint_dynamics`) by `backend`, a name or a backend of the model. With a floating base inverse
    dynamics assumes a wrench on the base that no actuator exerts, so the effort is that of a robot held by
    its base. ``effort=False`` skips the check of effort. The motion is checked at 500 times, on both sides of
    each knot of the trajectory, and at more times around the largest excesses.

    Raises ShapeError if the trajectory does not fit the model.
    """
    if not isinstance(trajectory, Trajectory):
        raise ArgumentError(f"trajectory is of type {type(trajectory).__name__}; wanted a Trajectory")
    if (trajectory.nq, trajectory.nv) != (model.nq, model.nv):
        raise ShapeError(
            f"the trajectory has nq {trajectory.nq}, nv {trajectory.nv}; "
            f"{model.name} has nq {model.nq}, nv {model.nv}"
        )
    if isinstance(backend, Backend) and backend.model != model:
        raise ArgumentError(f"backend is one of {shown(backend.model.name)}, not of this model")
    effort = effort and bool(np.isfinite(model.effort_limit).any())
    with open_backend(backend, model) if effort else nullcontext() as engine:
        times = _coarse_times(trajectory)
        coarse = list(_excesses(model, trajectory, times, engine, joint_dynamics))
        refined = _refined_times(times, coarse)
        fine = list(_excesses(model, trajectory, refined, engine, joint_dynamics))
    times = np.concatenate([times, refined])
    # The joint, by its number, of each column.
    of_rates = [k for k, joint in enumerate(model.coordinate_joints) for _ in range(joint.n_rates)]
    of_rates = [*[-1] * (model.nv - len(of_rates)), *of_rates]
    owners = {"position": range(len(model.coordinate_joints)), "velocity": of_rates, "effort": of_rates}
    found = []
    for (quantity, *near), (_, *far) in zip(coarse, fine, strict=True):
        value, limit, excess = (np.concatenate(pair) for pair in zip(near, far, strict=True))
        worst, size = np.argmax(excess, axis=0), np.abs(value).max(axis=0)
        for k, row in enumerate(worst.tolist()):
            if excess[row, k] > RELATIVE_TOLERANCE * max(abs(limit[row, k]), size[k]):
                place = owners[quantity][k]
                joint = model.coordinate_joints[place]
                number = float(times[row]), float(value[row, k]), float(limit[row, k])
                unit = UNITS[quantity][joint.unit]
                found.append((place, LimitViolation(joint.name, quantity, *number, unit)))
    return [violation for _, violation in sorted(found, key=lambda entry: entry[0])]


def _excesses(
    model: Model, trajectory: Trajectory, times: Floats, engine: Backend | None, joint_dynamics: bool
) -> Iterator[Excess]:
    q, v, a = trajectory(times)
    positions = limited_positions(model, q)
    yield "position", positions, *_nearest_limit(positions, *joint_ranges(model))
    yield "velocity", v, *_nearest_limit(v, -model.velocity_limit, model.velocity_limit)
    if engine is not None:
        tau = engine.inverse_dynamics(q, v, a, joint_dynamics=joint_dynamics)
        yield "effort", tau, *_nearest_limit(tau, -model.effort_limit, model.effort_limit)


def _nearest_limit(x: Floats, lower: Floats, upper: Floats) -> tuple[Floats, Floats]:
    """Return the limit that x exceeds, or is nearest to, and the amount by which x exceeds it."""
    over, under = x - upper, lower - x
    return np.where(over >= under, upper, lower), np.maximum(over, under)


def _coarse_times(trajectory: Trajectory) -> Floats:
    T = trajectory.duration
    knots = trajectory.knots
    times = np.concatenate([np.linspace(0.0, T, SAMPLES), knots, np.nextafter(knots, -np.inf)])
    return np.unique(np.clip(times, 0.0, T))


def _refined_times(times: Floats, coarse: list[Excess]) -> Floats:
    """Return times on both sides of the worst time of each joint and quantity."""
    worst = np.unique(np.concatenate([np.argmax(excess, axis=0) for *_, excess in coarse]))
    before, after = times[np.maximum(worst - 1, 0)], times[np.minimum(worst + 1, len(times) - 1)]
    parts = np.linspace(0.0, 1.0, 2 * REFINEMENT_SAMPLES + 1)[1:-1]
    return np.unique(before[:, None] + parts * (after - before)[:, None])


def open_backend(backend: str | Backend, model: Model) -> AbstractContextManager[Backend]:
    """Return a backend of the model as a context that leaves the caller's own backend open."""
    return nullcontext(backend) if isinstance(backend, Backend) else make_backend(backend, model)
