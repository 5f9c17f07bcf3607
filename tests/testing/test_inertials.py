"""Physical inertials are those of bodies, solid ones have inertia about every axis."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given

from dynx.agreement.magnitudes import EPS
from dynx.errors import UnknownNameError
from dynx.model import Inertial
from dynx.testing.strategies import inertials
from tests.testing.occurrence import assert_occurs, simplest

ROUNDING = 32 * EPS
"""Rounding of a tensor that was rotated (two products of 3 x 3 matrices) with its moments recomputed."""


def moments_of(inertial: Inertial) -> np.ndarray:
    """Principal moments, over their sum."""
    moments = np.linalg.eigvalsh(inertial.tensor)
    total = float(np.sum(moments))
    return np.asarray(moments / total if total else moments)


@given(inertials("physical"))
def test_physical(inertial: Inertial | None) -> None:
    if inertial is None:
        return
    assert inertial.mass >= 0.0
    least, middle, most = moments_of(inertial)
    assert least >= -ROUNDING
    assert least + middle - most >= -ROUNDING
    if inertial.mass == 0.0:
        assert not inertial.tensor.any()


@given(inertials("solid"))
def test_solid(inertial: Inertial | None) -> None:
    assert inertial is not None
    assert inertial.mass > 0.0
    least, middle, most = moments_of(inertial)
    assert least > 0.0
    assert least + middle - most > ROUNDING


def test_what_occurs() -> None:
    def broken(inertial: Inertial | None) -> bool:
        return inertial is not None and moments_of(inertial)[0] < -0.1

    assert_occurs(inertials("any"), broken)
    assert_occurs(inertials("physical"), lambda i: i is None)
    assert_occurs(inertials("physical"), lambda i: i is not None and i.mass > 0.0 and not i.tensor.any())
    assert_occurs(inertials("physical"), lambda i: i == Inertial())
    assert_occurs(inertials("physical"), lambda i: i is not None and i.ixy != 0.0)


def test_shrink_targets() -> None:
    """A cube of one kilogram, or none."""
    wanted = Inertial(1.0, ixx=0.125, iyy=0.125, izz=0.125)
    assert simplest(inertials("solid"), lambda inertial: True) == wanted
    assert simplest(inertials("physical"), lambda inertial: True) is None
    assert simplest(inertials("any"), lambda inertial: True) is None


def test_unknown_kind() -> None:
    misspelt: Any = "solids"
    with pytest.raises(UnknownNameError, match="did you mean 'solid'"):
        inertials(misspelt)
