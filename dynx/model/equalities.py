"""Equality constraints that a robot description states, as data."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from dynx.model.elements import IDENTITY, Pose
from dynx.spatial.scalar import Floats

Polynomial = tuple[float, float, float, float, float]
LINEAR: Polynomial = (0.0, 1.0, 0.0, 0.0, 0.0)


@dataclass(frozen=True)
class StatedEquality:
    """Equality constraint of a robot, as its description states it. It is data: in dynx a loop that it closes
    stays open, and joints that it couples move independently.

    `type` is that of MuJoCo: ``"connect"``, ``"weld"``, ``"joint"`` or ``"tendon"``. `first` and `second`
    name the two objects, and `object_type` their kind: ``"site"`` (frames of the model), ``"xbody"`` (links,
    and ``"world"`` for the world), ``"joint"`` or ``"tendon"``. If the constraint holds one joint or tendon
    alone, `second` is empty.

    `first_pose` is a pose in the first link, `second_pose` a pose in the second link; for frames, both are
    the identity. A ``connect`` makes the origins of both poses coincide, and a ``weld`` the poses themselves.
    `torque_scale` weighs the rotation of a ``weld`` against its translation.

    A coupling of joints or tendons is ``y - references[0] = p(x - references[1])``, with the polynomial p of
    the five coefficients `polynomial`, the constant one first. y and x are the positions [rad or m] of the
    first and the second joint, or the lengths of the tendons. Without a second object, y is constant.

    MuJoCo ignores a constraint that is not `active`. `solref` and `solimp` are its parameters of softness,
    empty for MuJoCo's defaults. `name` may be empty.
    """

    name: str
    type: str
    object_type: str
    first: str
    second: str = ""
    first_pose: Pose = IDENTITY
    second_pose: Pose = IDENTITY
    torque_scale: float = 1.0
    polynomial: Polynomial = LINEAR
    references: tuple[float, float] = (0.0, 0.0)
    active: bool = True
    solref: tuple[float, ...] = ()
    solimp: tuple[float, ...] = ()
    line: int | None = field(default=None, compare=False)

    @cached_property
    def absolute_polynomial(self) -> Floats:
        """Coefficients (5,) of the polynomial p with ``y = p(x)``, without references."""
        y, x = self.references
        moved = np.polynomial.Polynomial(self.polynomial)(np.polynomial.Polynomial([-x, 1.0]))
        found = np.zeros(5)
        found[: len(moved.coef)] = moved.coef
        found[0] += y
        return found

    @property
    def objects(self) -> tuple[str, ...]:
        """Names of what is coupled."""
        return (self.first, self.second) if self.second else (self.first,)
