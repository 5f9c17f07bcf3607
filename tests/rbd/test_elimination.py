"""Factors of the mass matrix: zeros between branches, and fill-in of mimic joints."""

from __future__ import annotations

import numpy as np
import pytest

import dynx
from dynx.model import Model
from dynx.model.tree import Base
from dynx.rbd.eliminated_rows import eliminate_rows, eliminate_tips, substitute_back
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


@pytest.mark.parametrize("mimic", [False, True])
@pytest.mark.parametrize("base", ["fixed", "floating"])
def test_rows_of_constraints_give_the_delassus_matrix(base: Base, mimic: bool) -> None:
    """J M^-1 J' by rows that are eliminated from the tips, of which some entries are zero by structure."""
    model = two_arms(base, mimic=mimic)
    M = dynx.backend("reference", model).mass_matrix(model.random(0))
    nv = model.nv
    J = np.random.default_rng(1).normal(size=(4, nv))
    J[0, -1] = J[1, -2] = 0.0
    L, D = factorize_mass_matrix(model.mechanism, M)
    rows = [{nv - 1 - k: entry for k, entry in enumerate(row) if entry} for row in J]
    found = eliminate_rows(L, D, rows)
    inverse = np.linalg.inv(M)
    np.testing.assert_allclose(found.delassus_matrix().astype(float), J @ inverse @ J.T, rtol=1e-11)
    # M^-1 (b + J' x) in one substitution, as a step does.
    b, x = np.arange(1.0, nv + 1.0), np.arange(4.0)
    u = [each / pivot for each, pivot in zip(eliminate_tips(L, b), D, strict=True)]
    for row, impulse in zip(found.Z, x, strict=True):
        for k, entry in row.items():
            u[k] = u[k] + entry * impulse
    np.testing.assert_allclose(substitute_back(L, u).astype(float), inverse @ (b + J.T @ x), rtol=1e-11)


def test_a_row_has_entries_only_at_its_joints_and_their_ancestors() -> None:
    model = two_arms("floating", mimic=False)
    M = dynx.backend("reference", model).mass_matrix(model.random(0))
    L, D = factorize_mass_matrix(model.mechanism, M)
    last = model.nv - 1
    tip = last - (6 + model.joint_names.index("tip"))
    second = last - (6 + model.joint_names.index("second"))
    (row,) = eliminate_rows(L, D, [{tip: np.asarray(1.0)}]).Y
    assert set(row) == {tip, second, *range(last - 5, last + 1)}
