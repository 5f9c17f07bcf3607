"""Whether the mass matrix is singular at every configuration, and by which joints.

The condition number is that of the matrix with its diagonal scaled to 1. The matrix is singular to rounding
where an eigenvalue of that is within `rounding_of_eigenvalues`, whatever its sign: the inertias of a file are
used as they are, so M may be indefinite. Engines then return NaN, zero or garbage; every backend and every
world of dynx raises the same error, `singular_matrix`.

A joint makes M singular at every configuration if nothing that it moves has inertia, and several do if they
can move together so that nothing with inertia moves, such as a floating base without mass and the joint on
it.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from dynx.backends.joint_dynamics import JointDynamicsTerms
from dynx.errors import SingularMassMatrixError, shown
from dynx.model import Model
from dynx.rbd.crba import mass_matrix
from dynx.spatial.scalar import Floats


def singular_matrix(of: str = "", where: str = "", cause: str = "") -> SingularMassMatrixError:
    """Return the error for a mass matrix that is singular to rounding, with the robot, where, and a cause."""
    named = f" of {of}" if of else ""
    place = f" {where}" if where else ""
    why = f" ({cause})" if cause else ""
    return SingularMassMatrixError(
        f"the mass matrix{named} is singular{place}: no unique acceleration exists{why}"
    )


class Solvability:
    """The coordinates of a model without a unique acceleration, computed when first needed."""

    def __init__(self, model: Model) -> None:
        self._model = model
        self._singular: dict[bool, SingularCoordinates] = {}

    def refuse_singular(self, joint_dynamics: bool) -> None:
        """Raise SingularMassMatrixError, naming the joints, if M is singular at every q."""
        if joint_dynamics not in self._singular:
            self._singular[joint_dynamics] = singular_coordinates(self._model, joint_dynamics)
        found = self._singular[joint_dynamics]
        if found:
            raise SingularMassMatrixError(
                f"{self._model.name} has no unique acceleration: {found.reason} (lock the joint, or give "
                "its links an <inertial>)"
            )


class SingularCoordinates(NamedTuple):
    """Names of the coordinates in the null space of M at every configuration: joints, or ``base``."""

    alone: tuple[str, ...] = ()
    """Coordinates that move nothing with inertia."""
    together: tuple[str, ...] = ()
    """Coordinates that move something with inertia, and can move together so that nothing of it moves."""

    def __bool__(self) -> bool:
        return bool(self.alone or self.together)

    @property
    def reason(self) -> str:
        """Why M is singular, without a full stop."""
        clauses = [f"nothing that {_listed(self.alone)} moves has inertia"] if self.alone else []
        if self.together:
            clauses.append(f"{_listed(self.together)} can move together so that nothing with inertia moves")
        return ", and ".join(clauses)


def magnitudes_of_rows(M: Floats) -> Floats:
    """Return d (..., nv) by whose products d_i d_j the entries of a mass matrix are divided to scale it.

    The diagonal is then 1 or -1. Where it is zero, which an impossible inertia can cause beside entries that
    are not, the largest entry of the row is 1; for a row of zeros d is 1.
    """
    size = np.sqrt(np.abs(np.diagonal(M, axis1=-2, axis2=-1)))
    if size.all():
        return np.asarray(size)
    coupled = np.max(np.abs(M) / np.where(size > 0.0, size, np.inf)[..., None, :], axis=-1)
    # Rows whose entries are all in columns with a diagonal of zero.
    largest = np.where(coupled > 0.0, coupled, np.sqrt(np.max(np.abs(M), axis=-1)))
    return np.where(size > 0.0, size, np.where(largest > 0.0, largest, 1.0))


def rounding_of_eigenvalues(values: Floats) -> Floats:
    """Return the rounding error (...,) of eigenvalues (..., n) of a mass matrix with a diagonal of ones.

    An eigenvalue of that magnitude is indistinguishable from zero. Without negative eigenvalues their sum is
    n, and so none is larger.
    """
    largest = np.max(np.abs(values), axis=-1, initial=0.0)
    return np.asarray(np.finfo(np.float64).eps * np.maximum(values.shape[-1], largest))


def is_null(values: Floats) -> Any:
    """Return which eigenvalues (n,) are zero to rounding, with room for that of the matrix itself."""
    return np.abs(values) < 4.0 * rounding_of_eigenvalues(values)


@lru_cache(maxsize=64)
def singular_coordinates(model: Model, joint_dynamics: bool = False) -> SingularCoordinates:
    """Return the coordinates that make M singular at every configuration.

    Determined at three random configurations, where M scaled to a unit diagonal has an eigenvalue below four
    times `rounding_of_eigenvalues`. The result is cached, because it takes as long as some hundred
    steps of a simulation.
    """
    q = model.random(np.random.default_rng(0), 3)
    coupling = model.mechanism.coupling
    M = np.asarray(mass_matrix(model.mechanism, model.mechanism.tree_q(q)))
    if coupling is not None:
        S = coupling.matrix()
        M = S.T @ M @ S
    if joint_dynamics:
        M = M + JointDynamicsTerms(model).armature
    found = [_null_coordinates(each) for each in M]
    massless = set.intersection(*(alone for alone, _ in found))
    mixed = set.intersection(*(alone | together for alone, together in found)) - massless
    base = 6 if model.floating else 0

    def names(numbers: set[int]) -> tuple[str, ...]:
        each = ["base" if k < base else model.coordinate_names[k - base] for k in sorted(numbers)]
        return tuple(dict.fromkeys(each))

    alone = names(massless)
    return SingularCoordinates(alone, tuple(name for name in names(mixed) if name not in alone))


def _listed(names: tuple[str, ...]) -> str:
    return ", ".join(map(shown, names[:6])) + (f" and {len(names) - 6} more" if len(names) > 6 else "")


def _null_coordinates(M: Floats) -> tuple[set[int], set[int]]:
    """Return the numbers of the coordinates with a row of zeros, and those of other null vectors."""
    if not len(M):
        return set(), set()
    largest = max(float(np.max(np.abs(M))), np.finfo(float).tiny)
    # Without negative eigenvalues an entry is at most the geometric mean of two entries of the diagonal.
    massless = (np.abs(np.diagonal(M)) <= 1e-20 * largest) & (np.max(np.abs(M), axis=1) <= 1e-10 * largest)
    scale = np.where(massless, 1.0, 1.0 / magnitudes_of_rows(M))
    scaled = M * scale[:, None] * scale[None, :]
    if not np.isfinite(scaled).all():
        return set(), set()  # overflow: undecided
    values, vectors = np.linalg.eigh(scaled)
    null = vectors[:, is_null(values)]
    mixed = np.flatnonzero(np.max(np.abs(null), axis=1, initial=0.0) > 1e-3)
    return set(np.flatnonzero(massless).tolist()), set(mixed.tolist())
