"""Simplification of a mechanism before it is traced: fewer constants, and so fewer operations."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from dynx.model import Mechanism
from dynx.rbd.base_parameters import align_frames
from dynx.spatial.scalar import Floats


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
        bodies=tuple(replace(body, R=_rounded_to_zero(body.R)) for body in mechanism.bodies),
        frames=tuple(replace(frame, R=_rounded_to_zero(frame.R)) for frame in mechanism.frames),
    )


def _rounded_to_zero(R: Floats) -> Floats:
    return np.where(np.abs(R) < 0.5 * np.finfo(np.float64).eps, 0.0, R)
