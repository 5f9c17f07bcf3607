"""The condition of mass matrices that a world computes when it opens."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import dynx
from dynx.backends.singular_direction import condition_bound, mass_matrix_of_floats, singular_direction
from dynx.model import Inertial, Joint, Link, Model, Pose
from dynx.model.tree import Base
from dynx.rbd.crba import mass_matrix
from dynx.spatial.scalar import Floats
from dynx.testing.strategies import configurations, models


def of_algorithm(model: Model, q: Floats) -> Floats:
    mechanism = model.mechanism
    return np.asarray(mass_matrix(mechanism, mechanism.tree_q(q)), dtype=float)


@settings(max_examples=60)
@given(st.data())
def test_the_mass_matrix_is_that_of_the_composite_rigid_body_algorithm(data: st.DataObject) -> None:
    model = data.draw(models())
    q = data.draw(configurations(model))
    mechanism = model.mechanism
    M, found = of_algorithm(model, q), mass_matrix_of_floats(mechanism, mechanism.tree_q(q))
    assert (np.abs(M - found) <= 1e-12 * float(np.abs(M).max(initial=0.0))).all()


@settings(max_examples=60)
@given(st.integers(1, 12), st.integers(0, 2**32 - 1), st.floats(-6.0, 0.0))
def test_the_condition_is_bounded_from_above(n: int, seed: int, spread: float) -> None:
    rng = np.random.default_rng(seed)
    B = rng.normal(size=(n, n)) * 10.0 ** rng.uniform(spread, 0.0, n)
    A = B @ B.T
    d = 1.0 / np.sqrt(A.diagonal())
    A = d[:, None] * A * d
    sizes = np.linalg.eigvalsh(A)
    if sizes[0] > 1e-10:
        condition = float(sizes[-1] / sizes[0])
        assert condition * (1.0 - 1e-5) <= condition_bound(A) <= 1.00001 * n**2 * condition


@pytest.mark.parametrize("base", ["fixed", "floating"])
def test_a_robot_with_a_massless_joint_is_found(base: Base) -> None:
    model = dynx.load("romeo", base=base)
    found = singular_direction(model, model.neutral())
    assert found is not None
    condition, direction = found.condition, found.direction
    M = of_algorithm(model, model.neutral())
    assert condition > 1e13
    # Along this direction the coordinates, scaled to equal inertias, move almost no mass.
    d = 1.0 / np.sqrt(np.maximum(M.diagonal(), np.finfo(float).tiny))
    assert abs(direction @ (d[:, None] * M * d) @ direction) < 1e-12


def test_a_usual_robot_is_not() -> None:
    for name in ("panda", "solo12", "talos"):
        model = dynx.load(name, base="floating")
        assert singular_direction(model, model.neutral()) is None
    assert singular_direction(dynx.load("free_body"), np.zeros(0)) is None


def pointed() -> Model:
    """Return three hinges that move one point of mass in a plane: some motion of theirs has no inertia."""
    names = ("base", "first", "second", "third")
    links = [Link(name) for name in names[:-1]]
    links.append(Link("third", Inertial(1.0, Pose((1.0, 0.0, 0.0)))))
    joints = [
        Joint(f"to_{child}", "continuous", parent, child, Pose((float(k > 0), 0.0, 0.0)), (0.0, 0.0, 1.0))
        for k, (parent, child) in enumerate(pairwise(names))
    ]
    return Model.build("pointed", links, joints)


@pytest.mark.parametrize("share", [1e-10, 1e-11, 1e-12])
def test_the_condition_of_two_hinges_of_one_axis_is_the_closed_form(share: float) -> None:
    def wheel(name: str, moment: float) -> Link:
        return Link(name, Inertial(1.0, ixx=1.0, iyy=1.0, izz=moment))

    joints = [
        Joint(f"to_{child}", "continuous", parent, child, Pose(), (0.0, 0.0, 1.0))
        for parent, child in (("base", "light"), ("light", "heavy"))
    ]
    model = Model.build("coaxial", [Link("base"), wheel("light", share), wheel("heavy", 1.0)], joints)
    found = singular_direction(model, np.zeros(2))
    # M is [[1 + share, 1], [1, 1]], and scaled [[1, c], [c, 1]] with c^2 = 1 / (1 + share).
    c = 1.0 / np.sqrt(1.0 + share)
    condition = (1.0 + c) ** 2 * (1.0 + share) / share
    assert found is not None
    assert found.condition == pytest.approx(condition, rel=8.0 * np.finfo(float).eps * condition)
    assert not found.to_rounding
    assert abs(found.direction) == pytest.approx(np.sqrt([0.5, 0.5]))
    assert found.direction[0] * found.direction[1] < 0.0


def test_results_that_are_kept_are_of_the_configuration_and_the_robot() -> None:
    model = dynx.load("planar_2r")
    massless = replace(
        model, links=tuple(replace(each, inertial=None) if k else each for k, each in enumerate(model.links))
    )
    q = np.array([0.3, 0.6])
    for _ in range(2):
        assert singular_direction(model, q) is None
        assert singular_direction(massless, q) is not None
        assert singular_direction(massless, q, np.array([0.1, 0.2])) is None
        assert singular_direction(massless, q, np.array([0.1, 0.0])) is not None
    redundant = pointed()
    first, again = (singular_direction(redundant, np.array([0.3, 0.6, 0.2])) for _ in range(2))
    assert first is not None
    assert again is not None
    assert np.array_equal(first.direction, again.direction)
    with pytest.raises(ValueError, match="read-only"):
        first.direction[0] = 1.0
    elsewhere = singular_direction(redundant, np.array([0.3, 0.1, 0.9]))
    assert elsewhere is not None
    assert not np.array_equal(first.direction, elsewhere.direction)
