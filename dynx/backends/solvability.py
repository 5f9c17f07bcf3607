"""Detection of robots whose mass matrix is singular at every configuration, and of the joints that cause it.

A joint makes it singular if nothing that it moves has inertia. Engines then return NaN, zero or garbage;
every backend of dynx raises the same error.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from dynx.backends.joint_dynamics import JointDynamicsTerms
from dynx.errors import SingularMassMatrixError, shown
from dynx.model import Model
from dynx.rbd.crba import mass_matrix
from dynx.spatial.scalar import Floats


class Solvability:
    """The coordinates of a model without a unique acceleration, computed when first needed."""

    def __init__(self, model: Model) -> None:
        self._model = model
        self._singular: dict[bool, tuple[str, ...]] = {}

    def refuse_singular(self, joint_dynamics: bool) -> None:
        """Raise SingularMassMatrixError, naming the joints, if M is singular at every q."""
        if joint_dynamics not in self._singular:
            self._singular[joint_dynamics] = singular_coordinates(self._model, joint_dynamics)
        names = self._singular[joint_dynamics]
        if names:
            listed = ", ".join(shown(name) for name in names[:6])
            listed += f" and {len(names) - 6} more" if len(names) > 6 else ""
            raise SingularMassMatrixError(
                f"{self._model.name} has no unique acceleration: nothing that {listed} moves has "
                "inertia (lock the joint, or give its links an <inertial>)"
            )


@lru_cache(maxsize=64)
def singular_coordinates(model: Model, joint_dynamics: bool = False) -> tuple[str, ...]:
    """Return the names of the coordinates in the null space of M at every configuration: joints, or ``base``.

    Determined at three random configurations, where M scaled to a unit diagonal has an eigenvalue below nv
    times the rounding error of its entries. The result is cached, because it takes as long as some hundred
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
    always = set.intersection(*(set(_null_coordinates(each)) for each in M))
    base = 6 if model.floating else 0
    names = ["base" if k < base else model.joint_names[k - base] for k in sorted(always)]
    return tuple(dict.fromkeys(names))


def _null_coordinates(M: Floats) -> list[int]:
    diagonal = np.diagonal(M)
    if not len(diagonal):
        return []
    smallest = 1e-20 * max(float(np.max(np.abs(diagonal))), np.finfo(float).tiny)
    massless = np.flatnonzero(diagonal <= smallest)
    scale = 1.0 / np.sqrt(np.where(diagonal > smallest, diagonal, 1.0))
    scaled = M * scale[:, None] * scale[None, :]
    if not np.isfinite(scaled).all():
        return []  # overflow: undecided
    values, vectors = np.linalg.eigh(scaled)
    null = vectors[:, np.abs(values) < len(M) * 4 * np.finfo(float).eps]
    mixed = np.flatnonzero(np.max(np.abs(null), axis=1, initial=0.0) > 1e-3)
    return sorted({*massless.tolist(), *mixed.tolist()})
