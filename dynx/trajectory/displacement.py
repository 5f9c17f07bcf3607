"""Motion of a configuration q0 along a curve of displacements.

    q(t) = q0 (+) x(t),  v = dx/dt,  a = d2x/dt2

where (+) is `model.integrate`, a sum for joints with one coordinate. For a floating base the first six
components of x must be a multiple s(t) of one body twist d, which the caller ensures: the base moves along
the screw exp(s d), and its velocity in its own axes is then exactly ds/dt d (Murray, Li and Sastry, A
Mathematical Introduction to Robotic Manipulation, section 2.3). So must the three components of a ball joint,
whose child then turns about one axis (spherical linear interpolation). Outside the duration the robot is at
rest (`Trajectory`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from dynx.errors import ArgumentError, ShapeError, shown
from dynx.model import Model
from dynx.model.configuration import checked_q
from dynx.model.numbers import checked_array, checked_entries, real_array
from dynx.spatial.scalar import Floats
from dynx.trajectory.base import Setpoint, Trajectory, read_only_setpoint
from dynx.trajectory.curve import Curve


@dataclass(frozen=True, eq=False, repr=False)
class DisplacementTrajectory(Trajectory):
    """`start.q` displaced along a curve that begins at 0; `floating` is the model if its q has quaternions,
    of a floating base or of ball joints, else None."""

    curve: Curve
    floating: Model | None = None

    @property
    def knots(self) -> Floats:
        return self.curve.knots

    def inside(self, t: Floats) -> Setpoint:
        """Return q0 (+) x and the derivatives of x."""
        x, v, a = self.curve(t)
        q = self.start.q + x if self.floating is None else self.floating.integrate(self.start.q, x)
        return Setpoint(q, v, a)


@dataclass(frozen=True, eq=False)
class Ends:
    """Start and end of a motion, and the displacement (nv,) between them: q1 = q0 (+) displacement."""

    q0: Floats
    q1: Floats
    displacement: Floats
    model: Model | None

    @property
    def nv(self) -> int:
        """Length of a velocity."""
        return len(self.displacement)

    @property
    def turning(self) -> Model | None:
        """The model if its q has quaternions, else None."""
        return self.model if self.model is not None and self.model.quaternions else None

    def name(self, k: int) -> str:
        """Return the name of coordinate k of a velocity, for messages."""
        offset = 6 if self.model is not None and self.model.floating else 0
        if self.model is None or k < offset:
            return f"coordinate {k}"
        return f"joint '{self.model.coordinate_names[k - offset]}'"

    def velocity(self, name: str, value: ArrayLike | None) -> Floats:
        """Return a velocity or an acceleration (nv,) at an end, zeros if it is not given.

        The entries of a floating base and of ball joints must be zero: they move along one screw axis from
        rest to rest.
        """
        if value is None:
            return np.zeros(self.nv)
        array = checked_array(name, value, self.nv)
        if array.ndim != 1:
            raise ShapeError(f"{name} has shape {array.shape}; wanted ({self.nv},)")
        if self.model is None:
            return array
        if self.model.floating and array[:6].any():
            raise ArgumentError(f"{name}[:6] is not 0; a floating base can only go from rest to rest")
        for joint in self.model.ball_joints:
            k = self.model.coordinate_index(joint.name)
            if array[k : k + 3].any():
                raise ArgumentError(
                    f"{name}[{k}:{k + 3}] is not 0; the ball joint {shown(joint.name)} can only go from rest "
                    "to rest"
                )
        return array

    def trajectory(
        self, duration: float, curve: Curve, start: tuple[Floats, Floats], end: tuple[Floats, Floats]
    ) -> DisplacementTrajectory:
        """Return the motion along `curve`, which lasts `duration` and leads from 0 to `displacement` (not
        checked). Its setpoints at the times 0 and `duration` have the (v, a) given; those between have the
        derivatives of the curve."""
        q1 = self.q1
        if self.turning is not None:
            # A quaternion and its negative are one orientation: take the one that the motion reaches.
            arrived, q1 = self.turning.integrate(self.q0, self.displacement), q1.copy()
            for first in self.turning.quaternions:
                quat = slice(first, first + 4)
                if np.dot(arrived[quat], q1[quat]) < 0.0:
                    q1[quat] *= -1.0
        return DisplacementTrajectory(
            duration, read_only_setpoint(self.q0, *start), read_only_setpoint(q1, *end), curve, self.turning
        )

    def rest_to_rest(self, duration: float, curve: Curve) -> DisplacementTrajectory:
        """Return the motion along `curve`, as `trajectory` does, with v and a zero at both ends."""
        rest = np.zeros(self.nv), np.zeros(self.nv)
        return self.trajectory(duration, curve, rest, rest)


def checked_ends(q0: ArrayLike, q1: ArrayLike, model: Model | None) -> Ends:
    """Check two configurations (nq,); without a model every coordinate is a joint's.

    Raises ShapeError, DTypeError or NotFiniteError for a configuration, and ArgumentError for a quaternion
    not of unit norm, an entry of 1e60 or more, and a model that is no Model.
    """
    first, last = (configuration(name, q, model) for name, q in (("q0", q0), ("q1", q1)))
    if first.shape != last.shape:
        raise ShapeError(f"q0 has shape {first.shape} and q1 {last.shape}; wanted the same")
    displacement = last - first if model is None else model.difference(first, last)
    return Ends(first, last, checked_entries("the displacement from q0 to q1", displacement), model)


def configuration(name: str, q: ArrayLike, model: Model | None) -> Floats:
    """Check one configuration: (nq,) of the model, or of any length above 0 without a model."""
    if model is not None and not isinstance(model, Model):
        raise ArgumentError(f"model is of type {type(model).__name__}; wanted a Model or None")
    if model is None:
        array = checked_entries(name, real_array(name, q))
        wanted = "(nq,)"
    else:
        array = checked_q(model, q, name)
        wanted = f"({model.nq},)"
    if array.ndim != 1 or not array.size:
        raise ShapeError(f"{name} has shape {array.shape}; wanted {wanted}")
    return array
