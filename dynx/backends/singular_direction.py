"""Condition of the mass matrix at one configuration, and the direction in which it is singular.

The condition number is that of the matrix with its diagonal scaled to 1. A world examines its robots as it
opens and as it fails.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from dynx.backends.solvability import is_null, magnitudes_of_rows, singular_matrix
from dynx.errors import shown
from dynx.model import Model
from dynx.model.mechanism import Mechanism
from dynx.rbd.kinematics import ancestry, body_poses
from dynx.spatial.scalar import Floats
from dynx.spatial.so3 import cross

MIN_SINGULAR_CONDITION = 1e10
"""Condition number of a mass matrix, with its diagonal scaled to 1, from which it is conspicuous."""

MAX_KNOWN = 16
"""Number of configurations whose result is kept: a world asks twice as it opens, and environments open worlds
with the same robot at the same configuration again and again."""


@dataclass(frozen=True, eq=False)
class _Key:
    """Mechanism as a key, equal only to the same object: comparing its arrays would take longer."""

    mechanism: Mechanism

    def __hash__(self) -> int:
        return id(self.mechanism)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Key) and other.mechanism is self.mechanism


class SingularDirection(NamedTuple):
    """Direction in which a mass matrix of unit diagonal has its smallest eigenvalue."""

    condition: float
    """Largest eigenvalue divided by the smallest, in magnitude."""
    to_rounding: bool
    """True if the smallest is indistinguishable from zero."""
    direction: Floats
    """Unit vector (nv,) of the coordinates of all joints, mimic joints included."""


def singular_direction(model: Model, q: Floats, armature: Floats | None = None) -> SingularDirection | None:
    """Return the direction in which the mass matrix is almost singular at q (nq,); None where its condition
    number is below `MIN_SINGULAR_CONDITION`. It includes the `armature` (n,) of all joints, if one is given.

    Eigenvalues are computed only where a bound on the condition is large, because on a busy machine the
    threads of LAPACK wait for one another for tens of milliseconds.
    """
    mechanism = model.mechanism
    if not mechanism.nv:
        return None
    rotors = b"" if armature is None or not armature.any() else _floats(armature).tobytes()
    return _singular_direction(_Key(mechanism), _floats(mechanism.tree_q(q)).tobytes(), rotors)


@lru_cache(MAX_KNOWN)
def _singular_direction(key: _Key, q: bytes, armature: bytes) -> SingularDirection | None:
    M = mass_matrix_of_floats(key.mechanism, np.frombuffer(q))
    if armature:
        rotors = np.frombuffer(armature)
        joints = np.arange(len(M) - len(rotors), len(M))
        M = M.copy()
        M[joints, joints] += rotors
    size = magnitudes_of_rows(M)
    scaled = M / (size[:, None] * size)
    if condition_bound(scaled) < MIN_SINGULAR_CONDITION:
        return None
    values, directions = np.linalg.eigh(scaled)
    sizes = np.abs(values)
    smallest = int(np.argmin(sizes))
    condition = float(np.max(sizes) / sizes[smallest]) if sizes[smallest] else np.inf
    if condition <= MIN_SINGULAR_CONDITION:
        return None
    direction = directions[:, smallest].copy()
    direction.flags.writeable = False
    return SingularDirection(condition, bool(is_null(values)[smallest]), direction)


def refuse_singular_start(model: Model, q: Floats, armature: Floats, remedy: str) -> None:
    """Raise SingularMassMatrixError, naming the joints and a remedy, if M with the `armature` (n,) of all
    joints is singular to rounding at the start q (nq,)."""
    found = singular_direction(model, q, armature) if model.mechanism.bodies else None
    if found is not None and found.to_rounding:
        joints = " and ".join(map(shown, main_joints(model, found.direction))) or "its base"
        raise singular_matrix(
            model.name,
            "at its configuration at the start",
            f"its links have almost no inertia about {joints}: {remedy}, start at another configuration, "
            "lock one of the joints, or give the links an inertia",
        )


def main_joints(model: Model, direction: Floats) -> list[str]:
    """Return the names of the at most two joints that move the most along a `singular_direction`; none where
    the base does."""
    moving = [joint.name for joint in model.joints if joint.moves]
    share = np.abs(direction[len(direction) - len(moving) :])
    return [moving[k] for k in np.argsort(-share)[:2] if share[k] > 0.1]


def condition_bound(A: Floats) -> float:
    """Return an upper bound on the condition number of a symmetric matrix (n, n) with a diagonal of ones,
    infinite where it is not positive definite.

    The largest eigenvalue is at most n, and the smallest at least 1 / |L^-1|^2 in Frobenius' norm, where
    A = L L'. The bound is at most n^2 times too large.
    """
    try:
        L = np.linalg.cholesky(A)
    except np.linalg.LinAlgError:
        return np.inf
    inverse = np.eye(len(L))
    for k, row in enumerate(L):
        inverse[k] -= np.einsum("j,jk->k", row[:k], inverse[:k])
        inverse[k] /= row[k]
    return float(len(L) * np.einsum("ij,ij->", inverse, inverse))


def mass_matrix_of_floats(mechanism: Mechanism, q: Floats) -> Floats:
    """Return the joint-space inertia M (nv, nv) in tree coordinates at one configuration q (nq,).

    It is the sum of Jp' F + Jr' N over the bodies, with force F and moment N at unit accelerations of each
    coordinate, for all bodies and coordinates at once. A world computes it when it opens, and
    `dynx.rbd.crba`, which takes any scalar, takes four times as long for floats.
    """
    base = 6 if mechanism.floating else 0
    if mechanism.floating:
        # M does not depend on the position, from which the levers of the bodies would lose digits.
        q = np.concatenate([np.zeros(3), q[3:]])
    poses, bodies = body_poses(mechanism, q), mechanism.bodies
    R, p = np.stack([*map(_floats, poses.R)]), np.stack([*map(_floats, poses.p)])
    inertias = [mechanism.root, *(body.inertia for body in bodies)]
    mass = np.array([float(each.mass) for each in inertias])
    moment = np.einsum("bij,bj->bi", R, np.stack([_floats(each.first_moment) for each in inertias]))
    tensor = R @ np.stack([_floats(each.rotational_inertia) for each in inertias]) @ R.transpose(0, 2, 1)

    # Velocities of the origin of each body and angular velocities, for a unit velocity of each coordinate.
    linear, angular = np.zeros((2, mechanism.nv, len(inertias), 3))
    if base:
        linear[:3] = angular[3:6] = R[0].T[:, None]
        linear[3:6] = cross(angular[3:6], p - p[0])
    axes = np.einsum("bij,bj->bi", R[1:], np.stack([np.zeros(3), *(_floats(b.axis) for b in bodies)])[1:])
    moves = np.zeros((len(bodies), len(inertias)), dtype=bool)
    for number in range(len(bodies)):
        moves[ancestry(mechanism, number), number + 1] = True
    revolute = np.array([body.revolute for body in bodies], dtype=bool)[:, None]
    turning = np.where((moves & revolute)[..., None], axes[:, None], 0.0)
    angular[base:] = turning
    levers = p - p[1:, None]
    linear[base:] = np.where((moves & ~revolute)[..., None], axes[:, None], cross(turning, levers))

    force = mass[:, None] * linear + cross(angular, moment)
    torque = np.einsum("bij,kbj->kbi", tensor, angular) + cross(moment, linear)
    return np.asarray(np.einsum("kbi,lbi->kl", linear, force) + np.einsum("kbi,lbi->kl", angular, torque))


def _floats(x: object) -> Floats:
    return np.asarray(x, dtype=np.float64)
