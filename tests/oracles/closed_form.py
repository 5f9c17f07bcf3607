"""Interface of a closed form: the equations of motion of one of `models/`, derived by hand.

Nothing here comes from dynx: the formulas are written out from textbooks, per robot, with their own
numbers, those in the head of the robot's file. Leading axes are batch.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from pathlib import Path
from typing import Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[Any]
Vector = tuple[float, float, float]

MODELS = Path(__file__).parents[2] / "models"
G = 9.81


class ClosedForm(ABC):
    """The equations of motion M a + C v + g = tau of a robot, and the motion of its tip."""

    robot: ClassVar[str]
    """Stem of the file in `models/`."""
    tip: ClassVar[str]
    """The frame that `placement` and the Jacobians are about, in world axes."""
    base: ClassVar[Literal["fixed", "floating"]] = "fixed"
    gravity: ClassVar[Vector] = (0.0, 0.0, -G)

    @abstractmethod
    def placement(self, q: Floats) -> Floats:
        """Pose of the tip (..., 4, 4)."""

    @abstractmethod
    def jacobian(self, q: Floats) -> Floats:
        """Geometric Jacobian of the tip (..., 6, nv), linear rows first."""

    @abstractmethod
    def jacobian_derivative(self, q: Floats, v: Floats) -> Floats:
        """Its time derivative (..., 6, nv)."""

    @abstractmethod
    def mass_matrix(self, q: Floats) -> Floats:
        """M (..., nv, nv)."""

    @abstractmethod
    def velocity_torque(self, q: Floats, v: Floats) -> Floats:
        """C v (..., nv): Coriolis and centrifugal torque."""

    @abstractmethod
    def gravity_torque(self, q: Floats) -> Floats:
        """g (..., nv)."""

    @abstractmethod
    def potential_energy(self, q: Floats) -> Floats:
        """U (...,), zero with the mass at the world's origin."""

    def coriolis_matrix(self, q: Floats, v: Floats) -> Floats | None:
        """The C of Christoffel symbols (..., nv, nv); None where the coordinates have no such matrix."""
        return None

    def kinetic_energy(self, q: Floats, v: Floats) -> Floats:
        """T (...,)."""
        return np.asarray(0.5 * np.einsum("...i,...ij,...j->...", v, self.mass_matrix(q), v))

    def inverse_dynamics(self, q: Floats, v: Floats, a: Floats) -> Floats:
        """tau (..., nv)."""
        inertial = np.einsum("...ij,...j->...i", self.mass_matrix(q), a)
        return np.asarray(inertial + self.velocity_torque(q, v) + self.gravity_torque(q))


class FixedBaseForm(ClosedForm):
    """A robot on a fixed base, for which C is the matrix of Christoffel symbols."""

    @abstractmethod
    def coriolis_matrix(self, q: Floats, v: Floats) -> Floats:
        """C (..., nv, nv)."""

    def velocity_torque(self, q: Floats, v: Floats) -> Floats:
        """C v (..., nv)."""
        return np.asarray(np.einsum("...ij,...j->...i", self.coriolis_matrix(q, v), v))


def matrix(rows: list[list[Any]]) -> Floats:
    """Return a matrix (..., m, n) of entries that are numbers or batches of numbers."""
    shape = np.broadcast_shapes(*(np.shape(entry) for row in rows for entry in row))
    return np.stack(
        [np.stack([np.broadcast_to(entry, shape) for entry in row], axis=-1) for row in rows], axis=-2
    )


def vector(entries: list[Any]) -> Floats:
    """Return a vector (..., n) of entries that are numbers or batches of numbers."""
    return np.asarray(matrix([entries])[..., 0, :])
