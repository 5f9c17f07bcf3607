"""Kernel of a closed form: from poses to the angles of all branches, with one branch in each lane.

It also decides what needs no second look: a candidate that reaches the pose to rounding, within the limits,
away from singularities. `dynx.ik.closed_forms.solver` reviews the poses of all others.
"""

from __future__ import annotations

import sys
import threading
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

import dynx.ik.coordinates
import dynx.model.numbers
import dynx.model.targets
import dynx.rbd
import dynx.spatial
from dynx.ik.closed_forms.candidates import (
    ARBITRARY,
    AT_LIMIT,
    N_BRANCHES,
    POSITION,
    ROTATION,
    ROUNDING,
    SEPARATION,
    SIGNS,
    VIOLATION,
    Candidates,
)
from dynx.model.numbers import MAX_MAGNITUDE
from dynx.model.targets import ROUNDING_TOLERANCE
from dynx.simd.cache import source_version
from dynx.simd.trace import trace
from dynx.simd.variants import BoundVariants, VariantKernel, Variants, load_variants
from dynx.spatial.scalar import Array, Floats, where_less

ERRORS = ("position_error", "rotation_error")

_MASKS = ("found", "review", "invalid")

_FURTHER_STEPS = 2
"""Newton steps for poses of which a candidate is not a solution to rounding."""

Bytes = NDArray[np.uint8]


@dataclass(frozen=True)
class Judgement:
    """Function from a pose and a branch to a candidate, and what is known of it at once."""

    candidates: Candidates
    length: float
    """Length of the chain [m]."""
    nearness: float
    """Error above which a candidate is not near a solution."""
    separation: float
    """Separation of two branches below which they may be one solution."""
    start: Floats
    """Coordinates (n,) of rows that hold no solution."""

    def __call__(self, target: Array, limited: Array, signs: Array) -> dict[str, Array]:
        """Return the coordinates `q` (n,), the `errors` (2,) [m, rad], and as 1 or 0 whether the candidate is
        `found` to be a solution, whether the pose needs a `review`, and whether the target is `invalid`: not
        a pose (4, 4) to rounding.

        The limits count if `limited` (1,) is 1.
        """
        pose = np.concatenate([target[:3, :3], target[:3, 3:] * (1.0 / self.length)], axis=1)
        result = self.candidates(pose, signs)
        measures = result["measures"]
        position, rotation, violation = (measures[k] for k in (POSITION, ROTATION, VIOLATION))
        error = _scalar(where_less(position, rotation, rotation, position))
        separation, violation = measures[SEPARATION], limited[0] * violation
        reached = _less(error, ROUNDING)
        # A negative separation means that there is no such solution.
        real = 1.0 - _less(separation, 0.0)
        near = real * _less(error, self.nearness)
        clear = reached * (1.0 - _less(0.5, measures[ARBITRARY])) * (1.0 - _less(separation, self.separation))
        within = 1.0 - _less(0.0, violation)
        at_limit = _less(violation, AT_LIMIT)
        found = near * clear * within
        # What is outside the limits by more than rounding needs no review, unless it is to be polished.
        review = near * (1.0 - found) * (1.0 - reached * (1.0 - at_limit))
        invalid = 1.0 - _is_rigid(target)
        q = [
            where_less(0.5, found, x, fill) for x, fill in zip(result["q"], self.start.tolist(), strict=True)
        ]
        return {
            "q": np.array([_scalar(x) for x in q], dtype=object),
            "errors": np.array([position * self.length, rotation], dtype=object),
            "found": np.asarray(found),
            "review": np.asarray(review),
            "invalid": np.asarray(invalid),
        }

    @property
    def content(self) -> tuple[object, ...]:
        """Numbers and cases that determine the function."""
        return (
            *self.candidates.content,
            self.length,
            self.nearness,
            self.separation,
            self.start.tolist(),
        )


@dataclass(frozen=True, eq=False)
class BranchResults:
    """Candidates of n poses. Bit k of a byte belongs to branch k."""

    q: Floats
    """Coordinates (n, 8, joints)."""
    errors: Floats
    """Errors (n, 8, 2) of the position [m] and the rotation [rad]."""
    found: Bytes
    """Bits of solutions (n,)."""
    review: Bytes
    """Not 0 for poses whose candidates need a review (n,)."""
    invalid: Bytes
    """Not 0 for targets that are not poses to rounding (n,)."""


class BranchKernel:
    """The kernel, compiled or loaded from the cache when it is first needed. Safe to use from threads."""

    def __init__(self, judgement: Judgement) -> None:
        self._judgement, self._count = judgement, len(judgement.start)
        self._kernel: VariantKernel | None = None
        self._making = threading.Lock()

    def __call__(self, targets: Floats, limited: bool, threads: int) -> BranchResults:
        """Evaluate poses (n, 4, 4) with contiguous entries."""
        n, count = len(targets), self._count
        found = BranchResults(
            np.empty((n, N_BRANCHES, count)),
            np.empty((n, N_BRANCHES, len(ERRORS))),
            *(np.empty(n, dtype=np.uint8) for _ in _MASKS),
        )
        rows = found.q.reshape(-1, count), found.errors.reshape(-1, len(ERRORS))
        options = np.broadcast_to(float(limited), (n, 1))
        masks = (found.found, found.review, found.invalid)
        self.kernel([targets.reshape(n, 16), options], rows, masks, threads=threads)
        return found

    def bind(self, block: Floats) -> BoundVariants:
        """Return memory for one pose, whose results, coordinates and errors, are written to `block`
        (8, n + 2)."""
        bound = self.kernel.bind([block[:, : self._count], block[:, self._count :]])
        bound.inputs[1][0] = 1.0
        return bound

    @property
    def kernel(self) -> VariantKernel:
        """The kernel."""
        if self._kernel is None:
            with self._making:
                if self._kernel is None:
                    recipe = f"{_algorithms()} {self._judgement.content!r}".encode()
                    self._kernel = load_variants(recipe, N_BRANCHES, len(_MASKS), self._variants)
        return self._kernel

    def _variants(self) -> Variants:
        candidates = self._judgement.candidates
        polished = replace(candidates, steps=candidates.steps + _FURTHER_STEPS)
        first, second = (
            trace(each, {"target": (4, 4), "limited": (1,), "signs": (3,)})
            for each in (self._judgement, replace(self._judgement, candidates=polished))
        )
        return Variants(first, second, tuple(map(tuple, SIGNS.tolist())), _MASKS, "review")


def _is_rigid(T: Array) -> Array:
    """Return 1 if a matrix (4, 4) is a rigid transform to rounding, otherwise 0, also for NaN."""
    a, b, c = T[0, :3], T[1, :3], T[2, :3]
    normal = [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    deviations = [a @ a - 1.0, b @ b - 1.0, a @ b, *(x - y for x, y in zip(normal, c, strict=True))]
    rigid = _less(abs(T[3, 3] - 1.0), 1e-300)
    for x in T[3, :3]:
        rigid = rigid * _less(abs(x), 1e-300)
    for x in deviations:
        rigid = rigid * _less(abs(x), ROUNDING_TOLERANCE)
    for x in T[:3, 3]:
        rigid = rigid * _less(abs(x), 0.5 * MAX_MAGNITUDE)
    return rigid


def _less(a: Array | float, b: Array | float) -> Array:
    """Return 1 where a < b, otherwise 0."""
    return _scalar(where_less(a, b, 1.0, 0.0))


def _scalar(x: Array) -> Array:
    """Return the entry of an array without axes, as a symbol that NumPy does not wrap again."""
    entry: Array = np.asarray(x)[()]
    return entry


@cache
def _algorithms() -> str:
    """Return the hash of the source of the packages that the kernel is traced from."""
    own = sys.modules[__name__.rpartition(".")[0]]
    return source_version(
        own, dynx.ik.coordinates, dynx.model.targets, dynx.model.numbers, dynx.rbd, dynx.spatial
    )
