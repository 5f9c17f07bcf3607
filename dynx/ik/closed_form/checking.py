"""All solutions of targets on a backend, each measured by its forward kinematics."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from dynx.ik.closed_form.chain import checked_given
from dynx.ik.closed_form.solutions import IKSolutions
from dynx.ik.closed_form.solver import stored_closed_form
from dynx.ik.tasks import Kinematics
from dynx.spatial.se3 import pose_error


def all_solutions(
    kinematics: Kinematics,
    target: ArrayLike,
    frame: str,
    q0: ArrayLike | None,
    given: Mapping[str, float] | None,
    position_tolerance: float,
    rotation_tolerance: float,
) -> IKSolutions:
    """Return the solutions of `ClosedForm.solve` that are within the tolerances [m], [rad] by the forward
    kinematics of the backend.

    A backend that compiles (attribute ``compiles``) uses the compiled form, unless joints are given: each
    position of theirs would be compiled anew.
    """
    compiled = bool(getattr(kinematics, "compiles", False)) and not given
    positions = () if given is None else tuple(checked_given(kinematics.model, given).items())
    form = stored_closed_form(kinematics.model, frame, positions, compiled)
    found = form.solve(target, q0)
    q = found.q[found.success]
    if not len(q):
        return found
    targets = np.asarray(target, dtype=np.float64)[..., None, :, :]
    wanted = np.broadcast_to(targets, (*found.success.shape, 4, 4))[found.success]
    position, rotation = pose_error(wanted, kinematics.forward_kinematics(q, frame))
    position_error, rotation_error = found.position_error.copy(), found.rotation_error.copy()
    position_error[found.success] = np.linalg.norm(position, axis=-1)
    rotation_error[found.success] = np.linalg.norm(rotation, axis=-1)
    within = (position_error <= position_tolerance) & (rotation_error <= rotation_tolerance)
    measured = replace(
        found,
        success=found.success & within,
        position_error=position_error,
        rotation_error=rotation_error,
    )
    return measured if found.success.ndim > 1 or within.all() else measured.rows(np.flatnonzero(within))
