"""Wrenches on frames that explain external torques best, and what of them the torques do not show."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dynx.argument_types import checks_types
from dynx.errors import ArgumentError, ShapeError, shown
from dynx.model.numbers import checked_entries, is_real, real_array
from dynx.spatial.scalar import Floats

COMPONENTS = ("force x", "force y", "force z", "moment x", "moment y", "moment z")

MIN_RATIO = 1e-3
"""Default ratio of a singular value to the largest below which its direction counts as not observable: errors
of the torques of 0.1 % would already be as large as the estimate there."""


@dataclass(frozen=True, eq=False)
class WrenchEstimate:
    """Wrenches that explain external torques best, in the least-squares sense; leading axes are batch.

    A wrench w has m components: six for each frame (or three forces). The torques J' w determine `rank`
    directions of w, and no component in the other directions. ``observable @ w`` is the part of a true wrench
    w that the torques determine, and `wrench` estimates this part. Forces and moments have equal weights, as
    numbers in N and N m.
    """

    frames: tuple[str, ...]
    wrench: Floats
    """Force [N], then moment [N m] (..., 6); of several frames (..., n, 6)."""
    rank: Any
    """Number of directions (...,) that the torques determine, at most m."""
    observable: Floats
    """Orthogonal projection (..., m, m) onto the directions that the torques determine."""
    condition: Floats
    """Largest divided by smallest singular value (...,) of the determined directions. Relative errors of the
    torques may grow by this factor in the wrench. Infinite if the torques determine no direction."""
    unexplained: Floats
    """External torque (..., nv) that no wrench on the frames explains. It is large if a force acts on another
    link, or if the model is wrong."""

    @property
    def blind(self) -> tuple[str, ...]:
        """Directions that the torques do not determine, for a single sample, each as a sum of components."""
        if self.observable.ndim != 2:
            raise ArgumentError(
                f"the estimate is of a batch {self.observable.shape[:-2]}; wanted that of one sample"
            )
        m = len(self.observable)
        _, vectors = np.linalg.eigh(self.observable)
        # A basis with many zeros reads best: eliminate among the vectors of the null space.
        return tuple(self._in_words(row) for row in _echelon(vectors[:, : m - int(self.rank)].T))

    def of_one_frame(self) -> WrenchEstimate:
        """Return the estimate for one frame, without the axis of frames."""
        return replace(self, wrench=self.wrench[..., 0, :])

    def _in_words(self, direction: Floats) -> str:
        per_frame = len(direction) // len(self.frames)
        parts = []
        for k in np.flatnonzero(np.abs(direction) > 1e-6).tolist():
            frame = f" on {self.frames[k // per_frame]}" if len(self.frames) > 1 else ""
            parts.append(f"{direction[k]:+.3g} {COMPONENTS[k % per_frame]}{frame}")
        return " ".join(parts)

    def __repr__(self) -> str:
        m = self.observable.shape[-1]
        rank = f"{self.rank}" if np.ndim(self.rank) == 0 else f"{np.min(self.rank)} or more"
        return f"<WrenchEstimate on {', '.join(self.frames)}: {rank} of {m} directions observable>"


@checks_types
def estimate_wrenches(
    jacobians: Sequence[Floats],
    frames: Sequence[str],
    residual: ArrayLike,
    *,
    force_only: bool = False,
    tolerance: float = MIN_RATIO,
) -> WrenchEstimate:
    """Return the wrenches (..., n, 6) on frames with these Jacobians (..., 6, nv) that explain a residual
    (..., nv) best; see `MomentumObserver.wrench`.

    Raises ShapeError, and ArgumentError for a tolerance that is not between 0 and 1.
    """
    if not jacobians:
        raise ArgumentError("frame is an empty list; wanted the names of frames")
    if not is_real(tolerance) or not 0.0 < tolerance < 1.0:
        raise ArgumentError(f"tolerance is {shown(tolerance)}; wanted a number between 0 and 1")
    rows = 3 if force_only else 6
    A = np.swapaxes(np.concatenate([J[..., :rows, :] for J in jacobians], axis=-2), -1, -2)
    r = checked_entries("residual", real_array("residual", residual))
    if r.ndim == 0 or r.shape[-1] != A.shape[-2]:
        raise ShapeError(f"residual has shape {r.shape}; wanted (..., {A.shape[-2]})")
    try:
        shape = np.broadcast_shapes(A.shape[:-2], r.shape[:-1])
    except ValueError:
        raise ShapeError(f"residual has shape {r.shape}; q has the batch {A.shape[:-2]}") from None
    U, sizes, V = np.linalg.svd(A, full_matrices=False)
    largest = sizes.max(axis=-1, initial=0.0, keepdims=True)
    shows = (sizes > tolerance * largest) & (largest > 0.0)
    inverse = np.divide(1.0, sizes, out=np.zeros_like(sizes), where=shows)
    w = np.einsum("...ki,...k,...jk,...j->...i", V, inverse, U, np.broadcast_to(r, (*shape, r.shape[-1])))
    unexplained = r - (A @ w[..., None])[..., 0]
    least = np.min(np.where(shows, sizes, np.inf), axis=-1, initial=np.inf)
    wrench = np.zeros((*shape, len(jacobians), 6))
    wrench[..., :rows] = w.reshape(*shape, len(jacobians), rows)
    return WrenchEstimate(
        tuple(frames),
        wrench,
        shows.sum(axis=-1),
        np.einsum("...ki,...k,...kj->...ij", V, shows.astype(float), V),
        np.where(np.isfinite(least), largest[..., 0] / least, np.inf),
        unexplained,
    )


def _echelon(rows: Floats) -> Floats:
    """Return the reduced row echelon form of orthonormal rows, each scaled to its largest entry."""
    rows, taken = rows.copy(), 0
    for column in range(rows.shape[1]):
        if taken == len(rows):
            break
        pivot = taken + int(np.argmax(np.abs(rows[taken:, column])))
        if abs(rows[pivot, column]) < 1e-9:
            continue
        rows[[taken, pivot]] = rows[[pivot, taken]]
        rows[taken] /= rows[taken, column]
        others = np.arange(len(rows)) != taken
        rows[others] -= np.outer(rows[others, column], rows[taken])
        taken += 1
    return np.asarray(rows / np.abs(rows).max(axis=1, initial=1e-300, keepdims=True))
