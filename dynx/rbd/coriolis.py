"""The Coriolis matrix for which dM/dt - 2 C is skew-symmetric.

C v + g is the bias for infinitely many matrices C. The one meant here is

    C = sum over bodies of J' (I dJ/dt + B J),   B = (v x* I + I v x + (I v) x~*) / 2,

in body coordinates (Echeandia and Wensing, Numerical Methods to Compute the Coriolis Matrix and
Christoffel Symbols for Rigid-Body Systems, 2021, eq. 24, carried from world to body coordinates, in
which the inertia I is constant and B is skew-symmetric). On a fixed base it is the matrix of
Christoffel symbols.
"""

from __future__ import annotations

import numpy as np

from dynx.model.mechanism import ROOT, Mechanism
from dynx.rbd.aba import inertia_matrix
from dynx.rbd.jacobians import frame_jacobian, frame_jacobian_derivative
from dynx.rbd.kinematics import Poses
from dynx.spatial.scalar import Array
from dynx.spatial.so3 import skew


def coriolis_matrix(mechanism: Mechanism, poses: Poses, v: Array) -> Array:
    """C (..., nv, nv) in tree coordinates."""
    total = np.zeros((*v.shape[:-1], mechanism.nv, mechanism.nv), dtype=int) + 0 * v[..., None]
    for index, frame in enumerate(mechanism.body_frames):
        if index == 0 and not mechanism.floating:
            continue
        body = index - 1
        inertia = mechanism.root if body == ROOT else mechanism.bodies[body].inertia
        J = frame_jacobian(mechanism, poses, frame, "local")
        dJ = frame_jacobian_derivative(mechanism, poses, v, frame, "local")
        twist = (J @ v[..., None])[..., 0]
        eye = inertia_matrix(inertia)
        total = total + np.swapaxes(J, -1, -2) @ (eye @ dJ + _gyroscopic(eye, twist) @ J)
    return np.asarray(total)


def _gyroscopic(inertia: Array, twist: Array) -> Array:
    """B (..., 6, 6): skew-symmetric, and B v = v x* I v."""
    momentum = (inertia @ twist[..., None])[..., 0]
    V, W = skew(twist[..., :3]), skew(twist[..., 3:])
    on_motion = _blocks(W, V, 0 * W, W)
    on_force = _blocks(W, 0 * W, V, W)
    L, H = skew(momentum[..., :3]), skew(momentum[..., 3:])
    return np.asarray(on_force @ inertia + inertia @ on_motion + _blocks(0 * L, -L, -L, -H)) / 2


def _blocks(a: Array, b: Array, c: Array, d: Array) -> Array:
    rows = [np.concatenate([a, b], axis=-1), np.concatenate([c, d], axis=-1)]
    return np.concatenate(rows, axis=-2)
