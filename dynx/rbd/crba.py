"""Mass matrix: the composite-rigid-body algorithm (Featherstone 2008, table 6.2)."""

from __future__ import annotations

import numpy as np

from dynx.model.mechanism import ROOT, Mechanism
from dynx.rbd.kinematics import joint_value
from dynx.rbd.placement import Placement
from dynx.spatial.scalar import Array
from dynx.spatial.so3 import skew


def mass_matrix(mechanism: Mechanism, q: Array) -> Array:
    """Return the joint-space inertia M (..., nv, nv) in tree coordinates at q (..., nq)."""
    bodies = mechanism.bodies
    placements = [Placement.of(body, joint_value(mechanism, q, k)) for k, body in enumerate(bodies)]
    composite = {ROOT: mechanism.root, **{k: body.inertia for k, body in enumerate(bodies)}}
    for index in reversed(range(len(bodies))):
        parent = bodies[index].parent
        composite[parent] = composite[parent] + placements[index].inertia_to_parent(composite[index])

    base = 6 if mechanism.floating else 0
    zero = 0 * np.sum(q, axis=-1)
    M = [[zero] * mechanism.nv for _ in range(mechanism.nv)]
    for index, body in enumerate(bodies):
        no_motion = 0 * body.axis
        twist = (no_motion, body.axis) if body.revolute else (body.axis, no_motion)
        force, moment = composite[index].momentum(*twist)
        row = index
        while row != ROOT:
            owner = bodies[row]
            along = np.sum(owner.axis * (moment if owner.revolute else force), axis=-1)
            M[base + row][base + index] = M[base + index][base + row] = along + zero
            force, moment = placements[row].wrench_to_parent(force, moment)
            row = owner.parent
        if mechanism.floating:
            for k in range(3):
                M[k][base + index] = M[base + index][k] = force[..., k] + zero
                M[3 + k][base + index] = M[base + index][3 + k] = moment[..., k] + zero
    if mechanism.floating:
        root = composite[ROOT]
        coupling = skew(root.first_moment)
        for i in range(3):
            for j in range(3):
                M[i][j] = (root.mass if i == j else 0) + zero
                M[3 + i][j] = M[j][3 + i] = coupling[..., i, j] + zero
                M[3 + i][3 + j] = root.rotational_inertia[..., i, j] + zero
    if not M:
        return np.zeros((*q.shape[:-1], 0, 0))
    return np.stack([np.stack(row, axis=-1) for row in M], axis=-2)
