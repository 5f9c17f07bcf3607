"""Inertials of bodies that can exist, of bodies that cannot, and absent ones."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Literal

import numpy as np
from hypothesis import strategies as st

from dynx.errors import UnknownNameError, nearest, shown
from dynx.model.elements import Inertial, Pose, Vector
from dynx.spatial.so3 import rotation_from_rpy
from dynx.testing.strategies.geometry import Strategy, angles, numbers, origins, vectors

Kind = Literal["solid", "physical", "any"]
KINDS: tuple[Kind, ...] = ("solid", "physical", "any")


def inertials(kind: Kind = "physical") -> Strategy[Inertial | None]:
    """Draw the ``<inertial>`` of a link, or None. Shrinks to None where that may occur, else to a cube of 1
    kg at the link's origin.

    - ``"solid"``: positive mass and extent along every axis, so that any motion has inertia
    - ``"physical"``: also plates, rods, point masses, an explicit zero, and no inertial at all
    - ``"any"``: also tensors that no body can have, with negative principal moments or a broken
      triangle inequality

    A body is drawn as its mass and its radii of gyration along three rotated axes, so that the tensor is
    physical by construction, up to rounding.
    """
    if kind not in KINDS:
        raise UnknownNameError(f"kind is {shown(kind)}{nearest(str(kind), KINDS)}")
    return _inertials(kind)


@lru_cache(maxsize=len(KINDS))
def _inertials(kind: Kind) -> Strategy[Inertial | None]:
    solid = _bodies(st.sampled_from((0.25, 0.125, 0.5)) | st.floats(0.05, 0.5).map(_rounded))
    if kind == "solid":
        return solid
    thin = _bodies(st.sampled_from((0.0, 0.25)))
    choices: list[Strategy[Inertial | None]] = [st.none(), solid, thin, st.just(Inertial())]
    if kind == "any":
        choices.append(_impossible())
    return st.one_of(choices)


def _masses() -> Strategy[float]:
    return st.sampled_from((1.0, 2.0, 0.5)) | st.floats(-1.0, 1.0).map(lambda x: _rounded(10.0**x))


def _bodies(radius: Strategy[float]) -> Strategy[Inertial | None]:
    turn = st.one_of(st.just((0.0, 0.0, 0.0)), st.tuples(angles(), angles(), angles()))
    return st.builds(_body, _masses(), st.tuples(radius, radius, radius), turn, origins(0.5))


def _body(mass: float, radii: Vector, turn: Vector, origin: Pose) -> Inertial:
    """Make a body with radii of gyration along axes that are rotated by `turn` (rpy) in `origin`."""
    squares = np.array(radii) ** 2
    principal = mass * (np.sum(squares) - squares)
    R = rotation_from_rpy(np.array(turn))
    tensor = R @ np.diag(principal) @ R.T if any(turn) else np.diag(principal)
    tensor = 0.5 * (tensor + tensor.T)
    return Inertial(mass, origin, *tensor[np.triu_indices(3)].tolist())


def _impossible() -> Strategy[Inertial | None]:
    def inertial(mass: float, origin: Pose, moments: Vector, products: Vector) -> Inertial:
        (xx, yy, zz), (xy, xz, yz) = moments, products
        return Inertial(mass, origin, xx, xy, xz, yy, yz, zz)

    moments = st.tuples(numbers(0.5), numbers(0.5), numbers(0.5))
    return st.builds(inertial, _masses(), origins(0.5), moments, vectors(0.25))


def _rounded(x: float) -> float:
    """Round to six significant digits."""
    return 0.0 if x == 0.0 else round(x, 5 - math.floor(math.log10(abs(x))))
