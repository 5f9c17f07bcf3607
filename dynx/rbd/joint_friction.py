"""Joint friction as a set-valued law, solved for the velocity at the end of a step; for any scalar.

In a step of length h from velocity v to w = v + h a a robot obeys M a = r - D w - f: D w is the torque of
damping, f that of dry friction, and r all other torque. Where a joint moves, f = F sign(w); where w = 0 it
sticks, and f is what keeps it there, at most F in magnitude. These are the conditions for the minimum of

    (w - u)' A (w - u) / 2 + h sum F |w|,    A = M + h D,  u = v + h A^-1 (r - D v),

which is convex for a positive definite A: there is exactly one w, it depends continuously on all numbers, and
dry friction takes energy at any step length (Moreau, Unilateral contact and dry friction, 1988; Stewart and
Trinkle, 1996). The solution is exact; engines that iterate or regularise it let loaded joints creep.

Each joint has a *mode*: 0 if it sticks, otherwise the sign of w. Given the modes, the equations are linear.
The modes are found by a primal-dual active-set method (Hintermueller, Ito and Kunisch, 2003): start with the
signs of v, solve, correct every mode that contradicts its solution, and repeat until none does. Mostly that
takes one solution, or two in a step where a joint stops or starts. The method may cycle; changing one mode at
a time (Murty, 1974) cannot.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from dynx.model import Model
from dynx.rbd.crba import mass_matrix
from dynx.rbd.elimination import filled_entries
from dynx.spatial.scalar import Array, Floats, sign

TOLERANCE = 1e-10
"""Fraction of F by which the torque on a joint that sticks may exceed F, so that rounding does not decide."""

CAUTION = 0.2
"""Fraction of the estimated torque to stop a joint that is believed. An overestimate makes joints change
direction that should stop, and costs more solutions than an underestimate."""

CORRECTIONS = 1
"""Number of corrections of the modes in one call of a kernel; few steps need more."""

MAX_CORRECTED_OPERATIONS = 1500
"""Number of products in one solution above which a kernel has one solution only, because a second one takes
longer to compile than it saves."""


class FrictionStep(NamedTuple):
    """A solution of the law for given modes."""

    a: Array
    """Acceleration (nv,)."""
    moves: Array
    """1 for coordinates that move (nv,), 0 for those that stick: their velocity after the step is 0."""
    torque: Array
    """Torque (n,) of dry friction, which is subtracted from the other torque."""
    modes: Array
    """Corrected modes (n,)."""
    changes: Any
    """Sum of the corrections; 0 if the solution is that of the law."""


@dataclass(frozen=True)
class FrictionLaw:
    """Joints with dry friction, and the order of elimination of the robot's mass matrix."""

    joints: tuple[int, ...]
    """Numbers of the n coordinates with dry friction."""
    below: tuple[tuple[int, ...], ...]
    """For each pivot, from the tips to the root, the later ones that it is coupled to."""
    inertia: tuple[float, ...]
    """Estimated torque (n,) [kg m^2 or kg] that changes the velocity of a joint by 1 per second."""

    @classmethod
    def of(cls, model: Model, friction: Array) -> FrictionLaw:
        """Make the law of a robot whose coordinates with dry friction are those where `friction` (nv,) is
        not 0."""
        joints = tuple(np.flatnonzero(friction).tolist())
        below, inertia = _structure(model)
        return cls(joints, below, tuple(inertia[joint] for joint in joints))

    @property
    def operations(self) -> int:
        """Number of products in one solution."""
        return sum(len(rows) * (len(rows) + 5) // 2 + 8 for rows in self.below)

    def solve(
        self,
        A: Array,
        r: Array,
        v: Array,
        friction: Sequence[Any] | Array,
        h: Any,
        modes: Sequence[Any] | Array,
        one_by_one: Any,
        inertia: Sequence[Any] | Array | None = None,
    ) -> FrictionStep:
        """Solve A a = r - f for given modes (n,), and correct the modes.

        `r` (nv,) includes the damping at the velocity `v` (nv,); `friction` (n,) is F of the joints. With
        `one_by_one` 1 instead of 0 only the last of the modes to be corrected changes, by at most 1.
        """
        n = len(self.below)
        moves: list[Any] = [1.0] * n
        given: list[Any] = [0.0] * n
        rest = list(r)
        for joint, mode, most in zip(self.joints, modes, friction, strict=True):
            moves[joint] = abs(mode)
            given[joint] = (moves[joint] - 1.0) * (v[joint] / h)
            rest[joint] = rest[joint] - mode * most
        a, left = self.accelerations(A, rest, moves, given)
        torque, corrected, changes = [], [], 0.0
        scales = self.inertia if inertia is None else inertia
        rows = zip(self.joints, modes, friction, scales, strict=True)
        for joint, mode, most, scale in reversed(list(rows)):
            sliding = mode * most
            torque.append(sliding + (1.0 - moves[joint]) * left[joint])
            # The torque of friction that would have stopped the joint, if it moves on its own.
            wanted = torque[-1] + moves[joint] * ((v[joint] + h * a[joint]) * (scale / h))
            change = _sign(wanted - _clamp(wanted, most * (1.0 + TOLERANCE))) - mode
            allowed = 1.0 - one_by_one * _at_most_one(changes)
            corrected.append(mode + allowed * _clamp(change, 2.0 - one_by_one))
            changes = changes + abs(change)
        arrays = [np.array(each, dtype=object) for each in (a, moves, torque[::-1], corrected[::-1])]
        return FrictionStep(arrays[0], arrays[1], arrays[2], arrays[3], changes)

    def step(
        self,
        A: Array,
        r: Array,
        v: Array,
        friction: Sequence[Any] | Array,
        h: Any,
        shift: Array,
        one_by_one: Any,
        inertia: Sequence[Any] | Array | None = None,
    ) -> tuple[FrictionStep, FrictionStep, Array]:
        """Solve the law with `CORRECTIONS` corrections of the modes, or none for a large robot.

        The first modes are the signs of the velocities plus `shift` (n,). Returns the first and the last
        solution, and the shift with which the step is repeated where the last one has `changes`.
        """
        start = sign(v[list(self.joints)])
        found = first = self.solve(A, r, v, friction, h, start + shift, one_by_one, inertia)
        for _ in range(CORRECTIONS if self.operations <= MAX_CORRECTED_OPERATIONS else 0):
            found = self.solve(A, r, v, friction, h, found.modes, one_by_one, inertia)
        return first, found, found.modes - start

    def accelerations(
        self, A: Array, rest: list[Any], moves: list[Any], given: list[Any]
    ) -> tuple[list[Any], list[Any]]:
        """Solve A a = rest for the coordinates that move; the others have the accelerations `given`.

        Returns a, and for those that do not move rest - A a. It is A = L D L' from the tips to the root, with
        1 / D replaced by 0 for coordinates that do not move.
        """
        n, last = len(rest), len(rest) - 1
        rest = rest[::-1]
        moves, given = moves[::-1], given[::-1]
        W = {(i, k): A[last - i, last - k] for k, rows in enumerate(self.below) for i in rows}
        D = [A[last - k, last - k] for k in range(n)]
        inverse: list[Any] = []
        for k, rows in enumerate(self.below):
            inverse.append(moves[k] / D[k])
            known = rest[k] * inverse[k] + given[k]
            for i in rows:
                rest[i] = rest[i] - W[i, k] * known
                factor = W[i, k] * inverse[k]
                for j in rows:
                    if j < i:
                        W[i, j] = W[i, j] - factor * W[j, k]
                D[i] = D[i] - factor * W[i, k]
        a: list[Any] = [0.0] * n
        for k in reversed(range(n)):
            for i in self.below[k]:
                rest[k] = rest[k] - W[i, k] * a[i]
            a[k] = rest[k] * inverse[k] + given[k]
            rest[k] = rest[k] - D[k] * a[k]
        return a[::-1], rest[::-1]


def damped_equation(
    M: Array, r: Array, v: Array, h: Any, damping: Array, armature: Array
) -> tuple[Array, Array]:
    """Return A (nv, nv) and r (nv,) of the law, from the mass matrix and the torque without damping."""
    return M + np.diag(armature + h * damping), r - damping * v


@lru_cache(maxsize=64)
def _structure(model: Model) -> tuple[tuple[tuple[int, ...], ...], tuple[float, ...]]:
    """Return the order of elimination, and estimated inertias (nv,) of the coordinates."""
    n, filled = filled_entries(model.mechanism)
    below = tuple(tuple(i for i, k in filled if k == pivot) for pivot in range(n))
    return below, tuple((CAUTION * _inertias(model)).tolist())


def _inertias(model: Model) -> Floats:
    """Return 1 / (M^-1)_ii (nv,) in the neutral configuration; 0 where that is not a positive number."""
    coupling, q = model.mechanism.coupling, model.neutral()
    M = mass_matrix(model.mechanism, model.mechanism.tree_q(q))
    if coupling is not None:
        S = coupling.matrix()
        M = S.T @ M @ S
    try:
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            found = 1.0 / np.diagonal(np.linalg.inv(M))
    except np.linalg.LinAlgError:
        found = np.zeros(len(M))
    return np.where(np.isfinite(found) & (found > 0.0), found, 0.0)


def _sign(x: Any) -> Any:
    return np.sign(x) if isinstance(x, int | float) else x.sign()


def _clamp(x: Any, bound: Any) -> Any:
    return min(max(x, -bound), bound) if isinstance(x, int | float) else x.clamp(bound)


def _at_most_one(x: Any) -> Any:
    return min(x, 1.0) if isinstance(x, int | float) else x.minimum(1.0)
