"""Simplification of a mechanism before it is traced: fewer constants, and so fewer operations."""

from __future__ import annotations

from dataclasses import replace
from typing import TypeVar

import numpy as np

from dynx.model import Mechanism
from dynx.model.mechanism import Body, BodyFrame
from dynx.rbd.base_parameters import align_frames


def simplify_mechanism(mechanism: Mechanism) -> Mechanism:
    """Reduce the number of constants of a mechanism: align frames with the joint axes, and remove rounding
    residues from rotations.

    A right angle in a file gives cos(pi/2) = 6e-17 instead of 0. Entries below half the spacing of doubles at
    1 are smaller than the rounding errors of neighbouring entries of order 1. Setting them to zero changes a
    rotation by no more than its rounding errors, and saves a multiplication wherever they are used.

    Inverse dynamics also uses base parameters (`dynx.rbd.base_parameters`). Forward dynamics does not: it
    would be a tenth faster but, on some robots, a hundred times less accurate.
    """
    return _zero_rounding_residue(align_frames(_zero_rounding_residue(mechanism)))


def _zero_rounding_residue(mechanism: Mechanism) -> Mechanism:
    return replace(
        mechanism,
        bodies=_without_residue(mechanism.bodies),
        frames=_without_residue(mechanism.frames),
    )


T = TypeVar("T", Body, BodyFrame)


def _without_residue(parts: tuple[T, ...]) -> tuple[T, ...]:
    """Return bodies or frames, those anew whose rotation has residues: others stay as they are, for the sake
    of robots with thousands of them."""
    if not parts:
        return parts
    rotations = np.array([part.R for part in parts])
    rounded = np.where(np.abs(rotations) < 0.5 * np.finfo(np.float64).eps, 0.0, rotations)
    # In the bits, since -0 becomes 0, too.
    changed = (rounded.view(np.int64) != rotations.view(np.int64)).any(axis=(1, 2))
    return tuple(
        replace(part, R=R) if is_changed else part
        for part, R, is_changed in zip(parts, rounded, changed.tolist(), strict=True)
    )
