"""Condition of the mass matrix: whether it is singular, at one configuration or at all, and by which joints.

The condition number is that of the matrix with its diagonal scaled to 1. The matrix is singular to rounding
where an eigenvalue of that is within `rounding_of_eigenvalues`, whatever its sign: the inertias of a file are
used as they are, so M may be indefinite. Engines then return NaN, zero or garbage; every backend and every
world of dynx raises the same error, `singular_matrix`.

A joint makes M singular at every configuration if nothing that it moves has inertia, and several do if they
can move together so that nothing with inertia moves, such as a floating base without mass and the joint on
it.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from dynx.backends.joint_dynamics import JointDynamicsTerms
from dynx.errors import SingularMassMatrixError, shown
from dynx.model import Model
from dynx.model.mechanism import Mechanism
from dynx.rbd.crba import mass_matrix
from dynx.rbd.kinematics import ancestry, body_poses
from dynx.spatial.scalar import Floats
from dynx.spatial.so3 import cross

MIN_SINGULAR_CONDITION = 1e10
"""Condition number of a mass matrix, with its diagonal scaled to 1, from which it is conspicuous."""

MAX_KNOWN = 16
"""Number of configurations whose result is kept: a world asks twice as it opens, and environments open worlds
with the same robot at the same configuration again and again."""


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


def _is_null(values: Floats) -> Any:
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
        each = ["base" if k < base else model.joint_names[k - base] for k in sorted(numbers)]
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
    null = vectors[:, _is_null(values)]
    mixed = np.flatnonzero(np.max(np.abs(null), axis=1, initial=0.0) > 1e-3)
    return set(np.flatnonzero(massless).tolist()), set(mixed.tolist())


# The mass matrix at one configuration.


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
    return SingularDirection(condition, bool(_is_null(values)[smallest]), direction)


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
