"""Targets of inverse kinematics: a pose, the position of a point, or a rotation."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import repeat

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dynx.errors import ArgumentError, ShapeError, nearest, shown
from dynx.model.elements import matrix_of_pair
from dynx.model.numbers import MAX_MAGNITUDE, checked_entries, real_array
from dynx.spatial.scalar import Floats

ORTHONORMALITY_TOLERANCE = 1e-6
"""Largest accepted entry of R'R - 1, and of the last row minus (0, 0, 0, 1), in a pose."""

ROUNDING_TOLERANCE = 1e-12
"""Deviation from orthonormality above which the nearest rotation is used, as for a pose in float32."""


LIKENESS_TOLERANCE = 1e-2
"""Largest entry of R'R - 1 in three positions that are refused because they may be a rotation."""

_LAST_ROW = [0.0, 0.0, 0.0, 1.0]

FREE = ("rotation", "position")
"""Parts of a target that may be free."""


@dataclass(frozen=True, eq=False)
class Targets:
    """Poses, positions or rotations in world axes, with the leading axes `batch`; what is free is None."""

    positions: Floats | None  # (*batch, 3) [m]
    rotations: Floats | None  # (*batch, 3, 3)

    @property
    def batch(self) -> tuple[int, ...]:
        """Shape of the leading axes."""
        if self.positions is not None:
            return self.positions.shape[:-1]
        assert self.rotations is not None
        return self.rotations.shape[:-2]

    def __getitem__(self, of: int | slice | NDArray[np.intp]) -> Targets:
        """Return some of the targets, by their index on the first leading axis."""
        return Targets(
            None if self.positions is None else self.positions[of],
            None if self.rotations is None else self.rotations[of],
        )

    def flattened(self, batch: tuple[int, ...], *kept: int) -> Targets:
        """Return the targets broadcast to the leading axes (*batch, *kept), those of `batch` as one axis."""
        parts: list[Floats | None] = []
        for array, shape in ((self.positions, (3,)), (self.rotations, (3, 3))):
            if array is not None:
                array = np.broadcast_to(array, (*batch, *kept, *shape))
                array = array.reshape(math.prod(batch), *kept, *shape)
            parts.append(array)
        return Targets(*parts)

    def rows(self, batch: tuple[int, ...]) -> Iterator[tuple[Floats | None, Floats | None]]:
        """Yield position and rotation of each target, broadcast to the leading axes `batch`."""
        flat, none = self.flattened(batch), repeat(None, math.prod(batch))
        positions: Iterable[Floats | None] = none if flat.positions is None else flat.positions
        rotations: Iterable[Floats | None] = none if flat.rotations is None else flat.rotations
        return zip(positions, rotations, strict=True)


def checked_targets(target: ArrayLike, free: str | None = None) -> Targets:
    """Read poses T_world_target (..., 4, 4), also as a pair of positions (..., 3) and unit quaternions
    (x, y, z, w) (..., 4), or as a list of such pairs; positions (..., 3) [m], whose rotation is free; or
    rotations (..., 3, 3) if the position is `free`.

    A rotation that is orthonormal only to 1e-6 is replaced by the nearest rotation (Higham, Matrix nearness
    problems, section 3). Raises ShapeError, DTypeError, NotFiniteError, or ArgumentError for a matrix that is
    not a rigid transform, and for three positions that may be a rotation unless the rotation is `free`.
    """
    target = matrix_of_pair(target, "target")
    if free is not None:
        if not isinstance(free, str) or free not in FREE:
            raise ArgumentError(f"free is {shown(free)}{nearest(free, FREE)}")
        return _checked_parts(checked_entries("target", real_array("target", target)), free)
    if (
        type(target) is np.ndarray
        and target.dtype == np.float64
        and target.shape == (4, 4)
        and is_rigid(target.tolist())
    ):
        return Targets(target[:3, 3], target[:3, :3])
    array = checked_entries("target", real_array("target", target))
    if array.ndim >= 1 and array.shape[-1] == 3:
        _refuse_likeness(array)
        return Targets(array, None)
    if array.ndim < 2 or array.shape[-2:] != (4, 4):
        raise ShapeError(
            f"target has shape {array.shape}; wanted a pose (..., 4, 4), a pair of a position (..., 3) and a "
            "quaternion (x, y, z, w) (..., 4), a position (..., 3), or with free='position' a rotation "
            "(..., 3, 3)"
        )
    return Targets(array[..., :3, 3], _checked_rotations(array))


def _checked_parts(array: Floats, free: str) -> Targets:
    """Read targets of which one part is free."""
    is_pose = array.ndim >= 2 and array.shape[-2:] == (4, 4)
    if free == "rotation":
        if not is_pose and (not array.ndim or array.shape[-1] != 3):
            raise ShapeError(
                f"target has shape {array.shape}; wanted a position (..., 3), or a pose (..., 4, 4)"
            )
        return Targets(array[..., :3, 3] if is_pose else array, None)
    if not is_pose and (array.ndim < 2 or array.shape[-2:] != (3, 3)):
        raise ShapeError(
            f"target has shape {array.shape}; wanted a rotation (..., 3, 3), or a pose (..., 4, 4)"
        )
    return Targets(None, _checked_rotations(array))


def _refuse_likeness(positions: Floats) -> None:
    """Raise ArgumentError for positions (..., 3, 3) that are all orthonormal, as the rows of a rotation."""
    if positions.ndim < 2 or positions.shape[-2] != 3 or not positions.size:
        return
    deviation = np.abs(np.swapaxes(positions, -1, -2) @ positions - np.eye(3)).max()
    if deviation <= LIKENESS_TOLERANCE:
        raise ArgumentError(
            f"target of shape {positions.shape} may be a rotation or three positions: free='position' reads "
            "it as a rotation, free='rotation' as positions; a pose is (..., 4, 4)"
        )


def is_rigid(T: list[list[float]]) -> bool:
    """Return whether one pose is a rigid transform to rounding; on floats, ten times as fast as arrays."""
    (a, b, c, x), (d, e, f, y), (g, h, i, z), bottom = T
    return (
        bottom == _LAST_ROW
        and abs(a * a + b * b + c * c - 1.0) <= ROUNDING_TOLERANCE
        and abs(d * d + e * e + f * f - 1.0) <= ROUNDING_TOLERANCE
        and abs(a * d + b * e + c * f) <= ROUNDING_TOLERANCE
        and abs(b * f - c * e - g) <= ROUNDING_TOLERANCE
        and abs(c * d - a * f - h) <= ROUNDING_TOLERANCE
        and abs(a * e - b * d - i) <= ROUNDING_TOLERANCE
        and math.hypot(x, y, z) < MAX_MAGNITUDE
    )


def _checked_rotations(T: Floats) -> Floats:
    """Return the rotations of poses (..., 4, 4) or of matrices (..., 3, 3)."""
    R = T[..., :3, :3]
    deviation, determinant = _orthonormality(R)
    if T.shape[-1] == 4:
        bottom = np.abs(T[..., 3, :] - (0.0, 0.0, 0.0, 1.0)).max(axis=-1)
        _refuse(bottom > ORTHONORMALITY_TOLERANCE, "its last row is not (0, 0, 0, 1)")
    _refuse(deviation > ORTHONORMALITY_TOLERANCE, "its rotation is not orthonormal to 1e-6")
    _refuse(determinant < 0.0, "its rotation has determinant -1 (a reflection)")
    if (deviation > ROUNDING_TOLERANCE).any():
        U, _, V_T = np.linalg.svd(R)
        R = U @ V_T
    return np.asarray(R)


def _orthonormality(R: Floats) -> tuple[Floats, Floats]:
    """Return the largest entry of R'R - 1 and the determinant of each matrix (..., 3, 3).

    On arrays of one entry each, that takes an eighth of the time of matrix products for a batch.
    """
    entries = np.ascontiguousarray(np.moveaxis(R.reshape(*R.shape[:-2], 9), -1, 0))
    x, y, z = (entries[k::3] for k in range(3))
    deviation = np.zeros(R.shape[:-2])
    for a, b, length in ((x, x, 1.0), (y, y, 1.0), (z, z, 1.0), (x, y, 0.0), (x, z, 0.0), (y, z, 0.0)):
        product = a[0] * b[0] + a[1] * b[1] + a[2] * b[2] - length
        np.maximum(deviation, np.abs(product), out=deviation)
    determinant = (
        x[0] * (y[1] * z[2] - y[2] * z[1])
        + x[1] * (y[2] * z[0] - y[0] * z[2])
        + x[2] * (y[0] * z[1] - y[1] * z[0])
    )
    return deviation, np.asarray(determinant)


def _refuse(wrong: np.ndarray[tuple[int, ...], np.dtype[np.bool_]], why: str) -> None:
    if np.any(wrong):
        where = tuple(int(i) for i in np.argwhere(wrong)[0])
        which = f"[{', '.join(map(str, where))}]" if where else ""
        raise ArgumentError(f"target{which} is not a rigid transform: {why}")
