"""All solutions of targets on a backend, each measured by its forward kinematics."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

from dynx.backends.base import Backend
from dynx.errors import ArgumentError, shown
from dynx.ik.closed_forms.chain import checked_given
from dynx.ik.closed_forms.solutions import IKSolutions
from dynx.ik.closed_forms.solver import stored_closed_form
from dynx.model import Model
from dynx.spatial.se3 import pose_error


def all_solutions(
    backend: Backend,
    target: ArrayLike,
    frame: str,
    q0: ArrayLike | None,
    given: Mapping[str, float] | None,
    position_tolerance: float,
    rotation_tolerance: float,
) -> IKSolutions:
    """Return the solutions of `ClosedForm.solve` that are within the tolerances [m], [rad] by the forward
    kinematics of the backend.

    A backend that compiles (attribute ``compiles``) uses the compiled form, whose kernel measures the
    solutions, unless joints are given: each position of theirs would be compiled anew.
    """
    compiled = backend.compiles and not given
    positions = () if given is None else _within_limits(backend.model, given)
    form = stored_closed_form(backend.model, frame, positions, compiled)
    found = form.solve(target, q0, threads=backend.threads)
    if compiled and min(position_tolerance, rotation_tolerance) >= form.accuracy:
        return found
    errors, rows = np.stack([found.position_error, found.rotation_error], axis=-1), found.success
    if not compiled:
        wanted = np.broadcast_to(np.asarray(target, dtype=np.float64)[..., None, :, :], (*rows.shape, 4, 4))
        parts = pose_error(wanted[rows], backend.forward_kinematics(found.q[rows], frame))
        errors[rows] = np.stack([np.linalg.norm(part, axis=-1) for part in parts], axis=-1)
    within = (errors <= (position_tolerance, rotation_tolerance)).all(axis=-1)
    return found.measured(errors, rows & within)


def _within_limits(model: Model, given: Mapping[str, float]) -> tuple[tuple[str, float], ...]:
    """Return the positions by joint; raise ArgumentError for one outside the limits: no solution has it."""
    checked = tuple(checked_given(model, given).items())
    for name, value in checked:
        at = model.coordinate_index(name)
        low, high = float(model.lower[at]), float(model.upper[at])
        if not low <= value <= high:
            unit = "m" if model.joint(name).type == "prismatic" else "rad"
            raise ArgumentError(
                f"the given position of joint {shown(name)} is {value:.6g} {unit}, outside its limits: "
                f"{low:.6g} to {high:.6g} {unit}"
            )
    return checked
