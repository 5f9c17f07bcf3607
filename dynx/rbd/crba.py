"""Mass matrix: the composite-rigid-body algorithm (Featherstone 2008, table 6.2)."""

from __future__ import annotations

import numpy as np

from dynx.model.mechanism import Body, Mechanism
from dynx.rbd.loops import Loops, PythonLoops
from dynx.rbd.placement import Placement, SpatialVector
from dynx.spatial.inertia import RigidInertia
from dynx.spatial.scalar import Array, append_axis
from dynx.spatial.so3 import skew


def mass_matrix(mechanism: Mechanism, q: Array, *, loops: Loops | None = None) -> Array:
    """Return the joint-space inertia M (..., nv, nv) in tree coordinates at q (..., nq)."""
    loops = loops or PythonLoops(mechanism)
    placements = loops.each(Placement.of, q)
    inertias = [loops.root(root_inertia), *loops.each(body_inertia)]
    composites = loops.subtrees(_add_composite, inertias, placements)
    M = loops.matrices(1, like=q)
    loops.to_root(M, _momentum, _entry, _base_entries, own=(composites,), below=(placements,))
    loops.base_block(M, _base_block, composites[0])
    return loops.assembled(M)[0]


def root_inertia(mechanism: Mechanism) -> RigidInertia:
    """Return the inertia of the root."""
    return mechanism.root


def body_inertia(body: Body) -> RigidInertia:
    """Return the inertia of a body."""
    return body.inertia


def _add_composite(
    body: Body, composite: RigidInertia, parent: RigidInertia, placement: Placement
) -> RigidInertia:
    return parent + placement.inertia_to_parent(composite)


def _momentum(body: Body, composite: RigidInertia) -> tuple[SpatialVector, tuple[Array]]:
    """Return the momentum of a subtree whose joint moves at unit speed, and its part along the axis."""
    no_motion = 0 * body.axis
    momentum = composite.momentum(*((no_motion, body.axis) if body.revolute else (body.axis, no_motion)))
    return momentum, (_along_axis(body, momentum),)


def _entry(
    body: Body, momentum: SpatialVector, placement: Placement
) -> tuple[SpatialVector, tuple[Array], tuple[Array]]:
    moved = placement.wrench_to_parent(*momentum)
    entry = (_along_axis(body, moved),)
    return moved, entry, entry


def _base_entries(momentum: SpatialVector, placement: Placement) -> tuple[tuple[Array], tuple[list[Array]]]:
    # A force that depends on no joint position has no batch axes yet.
    entries = np.concatenate(np.broadcast_arrays(*placement.wrench_to_parent(*momentum)), axis=-1)
    return (entries,), ([entries[..., k] for k in range(6)],)


def _base_block(mechanism: Mechanism, composite: RigidInertia) -> tuple[list[Array]]:
    coupling = skew(composite.first_moment)
    mass = np.eye(3, dtype=int) * append_axis(append_axis(composite.mass))
    # Blocks that depend on no joint position have no batch axes yet.
    top = np.concatenate(np.broadcast_arrays(mass, np.swapaxes(coupling, -1, -2)), axis=-1)
    bottom = np.concatenate(np.broadcast_arrays(coupling, composite.rotational_inertia), axis=-1)
    return ([*(top[..., k, :] for k in range(3)), *(bottom[..., k, :] for k in range(3))],)


def _along_axis(body: Body, momentum: SpatialVector) -> Array:
    linear, angular = momentum
    return np.asarray(np.sum(body.axis * (angular if body.revolute else linear), axis=-1))
