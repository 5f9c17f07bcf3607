"""Traced arrays in the coordinates of the model and in those of the tree, which mimic joints connect."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from dynx.model import Mechanism
from dynx.spatial.scalar import Array


def tree_coordinates(mechanism: Mechanism, q: Array, *rates: Array) -> tuple[Array, ...]:
    """Convert q and velocities (or accelerations) from the coordinates of the model to those of the tree."""
    coupling = mechanism.coupling
    if coupling is None:
        return (q, *rates)
    S = coupling.matrix()
    return (coupling.expand_q(q), *(rate @ S.T for rate in rates))


def reduce_columns(mechanism: Mechanism, A: Array) -> Array:
    """Return A S: a torque (nv,) or the columns of a matrix, in the coordinates of the model."""
    coupling = mechanism.coupling
    return A if coupling is None else np.asarray(A @ coupling.matrix())


def reduce_rows(mechanism: Mechanism, A: Array) -> Array:
    """Return S' A: the rows of a matrix, in the coordinates of the model."""
    coupling = mechanism.coupling
    return A if coupling is None else np.asarray(coupling.matrix().T @ A)


def argument_shapes(mechanism: Mechanism, arguments: Iterable[str]) -> dict[str, tuple[int, ...]]:
    """Return the shapes of arguments such as q, v and tau in the coordinates of the model."""
    nq, nv, coupling = mechanism.nq, mechanism.nv, mechanism.coupling
    if coupling is not None:
        followers = len(mechanism.bodies) - coupling.n_joints
        nq, nv = nq - followers, nv - followers
    return {argument: (nq if argument == "q" else nv,) for argument in arguments}
