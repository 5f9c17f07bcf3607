"""Factors of the mass matrix: zeros between branches, and fill-in of mimic joints."""

from __future__ import annotations

import numpy as np
import pytest

import dynx
from dynx.model import Model
from dynx.model.tree import Base
from dynx.rbd.elimination import (
    factorize_mass_matrix,
    filled_entries,
    solve_mass_matrix,
    solve_with_factors,
)
from tests.rules.documents import joint, link


def two_arms(base: Base, *, mimic: bool) -> Model:
    """Return two arms of two joints; with `mimic` the tip of the second drives that of the first."""
    place = "<origin xyz='0.1 0.2 0.3' rpy='1 2 3'/>"
    follows = "<mimic joint='tip' multiplier='0.5'/>" if mimic else ""
    parts = [link(name, center=(0.1, 0.0, 0.2)) for name in ("root", "a", "b", "c", "d")]
    parts += [joint("first", "root", "a", place), joint("follower", "a", "b", place, follows)]
    parts += [joint("second", "root", "c", place), joint("tip", "c", "d", place)]
    return dynx.load(f"<robot name='two_arms'>{''.join(parts)}</robot>", base=base)


@pytest.mark.parametrize("mimic", [False, True])
@pytest.mark.parametrize("base", ["fixed", "floating"])
def test_solving_by_factors(base: Base, mimic: bool) -> None:
    model = two_arms(base, mimic=mimic)
    M = dynx.backend("reference", model).mass_matrix(model.random(0))
    b = np.arange(1.0, model.nv + 1.0)
    found = solve_with_factors(*factorize_mass_matrix(model.mechanism, M), b)
    np.testing.assert_allclose(np.array(found, dtype=float), np.linalg.solve(M, b), rtol=1e-12)
    columns = np.stack([b, b[::-1]], axis=1)
    for scalars in (M, M.astype(object)):
        found = solve_mass_matrix(model.mechanism, scalars, columns)
        np.testing.assert_allclose(found.astype(float), np.linalg.solve(M, columns), rtol=1e-12)


@pytest.mark.parametrize("mimic", [False, True])
def test_zeros_between_branches_stay_unless_a_mimic_joint_fills_them(mimic: bool) -> None:
    model = two_arms("fixed", mimic=mimic)
    first, second = model.joint_names.index("first"), model.joint_names.index("second")
    nv, filled = filled_entries(model.mechanism)
    assert ((nv - 1 - first, nv - 1 - second) in filled) == mimic
