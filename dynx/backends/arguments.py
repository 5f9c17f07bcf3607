"""Checks of the arguments of a backend: fast for valid ones, with a precise error for invalid ones."""

from __future__ import annotations

from collections.abc import Mapping
from math import hypot, isfinite
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dynx.argument_types import is_listed
from dynx.backends.solvability import singular_matrix
from dynx.errors import (
    ArgumentError,
    ClosedError,
    shown,
)
from dynx.model import Model
from dynx.model.configuration import checked_q
from dynx.model.numbers import MAX_MAGNITUDE, UNIT_NORM_TOLERANCE, checked_array, checked_vector
from dynx.rbd.jacobians import Reference, checked_reference
from dynx.spatial.scalar import Floats

_FLOAT64 = np.dtype(np.float64)

MAX_LISTED = 40
"""Size up to which the norm of an array is computed faster from a list of its entries than by NumPy, of whose
products only `vdot` gives no warning where it overflows."""


class Arguments:
    """Checks of the arguments of one model's backend, which raise ClosedError once the backend is closed."""

    def __init__(self, model: Model) -> None:
        self.closed = False
        self._model = model
        self._floating = model.floating
        # No array has the shape (-1,): the quaternions of ball joints are checked one by one.
        self._q_shape = (-1,) if model.ball_joints else (model.nq,)
        self._v_shape = (model.nv,)
        self._listed = model.nq <= MAX_LISTED

    def refuse_closed(self) -> None:
        """Raise ClosedError if the backend was closed."""
        if self.closed:
            raise ClosedError(f"this backend of {self._model.name} was closed; make a new one")

    # The norm of a vector is below a bound only if every entry is, and no entry is NaN. One C loop over a
    # list computes it several times faster than NumPy at this size. If the norm is too large, every entry is
    # checked.

    def q(self, q: Any) -> Floats:
        """Return a configuration (..., nq), finite, with unit quaternions of base and ball joints."""
        if self.closed:
            raise ClosedError(f"this backend of {self._model.name} was closed; make a new one")
        if type(q) is np.ndarray and q.dtype is _FLOAT64 and q.shape == self._q_shape:
            values = q.tolist()
            if hypot(*values) < MAX_MAGNITUDE:
                if not self._floating:
                    return q
                x, y, z, w = values[3:7]
                if abs(x * x + y * y + z * z + w * w - 1.0) <= UNIT_NORM_TOLERANCE:
                    return q
        return checked_q(self._model, q)

    def v(self, v: Any, name: str = "v") -> Floats:
        """Return a velocity, acceleration or torque (..., nv), finite."""
        if (
            type(v) is np.ndarray
            and v.dtype is _FLOAT64
            and v.shape == self._v_shape
            and hypot(*v.tolist()) < MAX_MAGNITUDE
        ):
            return v
        return checked_array(name, v, self._v_shape[0])

    def reference(self, reference: str) -> Reference:
        """Return one of the three references; raise an error that lists them for any other."""
        return checked_reference(reference)

    def frames(self, frames: object) -> list[str]:
        """Return the names in a sequence of frames."""
        if is_listed(frames):
            return list(frames)
        raise ArgumentError(
            f"frame is of type {type(frames).__name__}; wanted a name, a sequence of names, or None for all"
        )

    def wrenches(self, forces: object) -> dict[str, Floats]:
        """Return the wrenches (..., 6) by the name of the frame on which each acts."""
        if not isinstance(forces, Mapping):
            raise ArgumentError(
                f"external_forces is of type {type(forces).__name__}; wanted a mapping from frame names to "
                f"wrenches (..., 6), such as {{'tool0': [0, 0, -10, 0, 0, 0]}}; an ExternalForce is for what "
                "moves: World.step(forces=), and pushes= of a simulation"
            )
        return {
            frame: checked_array(f"external_forces[{shown(frame)}]", wrench, 6)
            for frame, wrench in forces.items()
        }

    def point(self, point: ArrayLike) -> Floats:
        """Return a point (3,) in the axes of a frame [m]."""
        return checked_vector("point", point)

    def finite_acceleration(self, a: Floats) -> Floats:
        """Return the result of forward dynamics; raises SingularMassMatrixError where it is not finite."""
        # A sum that overflows is decided below.
        if a.ndim == 1 and isfinite(sum(a.tolist()) if self._listed else np.vdot(a, a)):
            return a
        if not np.isfinite(a).all():
            rows = np.argwhere(~np.isfinite(a).all(axis=-1))
            where = "at this configuration" if a.ndim == 1 else f"at sample {rows[0].tolist()}"
            more = f" (and {len(rows) - 1} more)" if len(rows) > 1 else ""
            raise singular_matrix(self._model.name, where + more)
        return a
