"""Random robots are valid, of every sort, within what was asked for, and shrink to simple ones."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynx.agreement.magnitudes import EPS
from dynx.errors import ArgumentError, DTypeError, DynxError, UnknownNameError
from dynx.model import Inertial, Model, Pose
from dynx.rbd.crba import mass_matrix
from dynx.testing.strategies import configurations, inertials, models
from tests.testing.occurrence import assert_occurs, simplest


@given(models())
def test_valid(model: Model) -> None:
    assert 1 <= len(model.links) <= 7
    assert len(model.joints) == len(model.links) - 1
    assert len(model.joint_names) == model.nv - (6 if model.floating else 0)
    assert len(set(model.frame_names)) == len(model.frame_names)
    assert (model.lower <= model.upper).all()
    for joint in model.joints:
        assert np.isfinite(joint.origin.matrix).all()
        if joint.mimic is not None:
            assert joint.mimic.joint in model.joint_names
    assert model.mechanism.nv >= model.nv


@given(st.data())
def test_solvable_models_have_a_positive_definite_mass_matrix(data: st.DataObject) -> None:
    model = data.draw(models(solvable=True))
    q = data.draw(configurations(model))
    coupling = model.mechanism.coupling
    M = np.asarray(mass_matrix(model.mechanism, q if coupling is None else coupling.expand_q(q)))
    S = np.eye(len(M)) if coupling is None else coupling.matrix()
    np.linalg.cholesky(S.T @ M @ S)


@given(
    models(base="floating", joint_types=["prismatic"], mimics=False, locks=False, min_links=3, max_links=4)
)
def test_what_was_asked_for(model: Model) -> None:
    assert model.floating
    assert {joint.type for joint in model.joints} == {"prismatic"}
    assert len(model.links) in (3, 4)
    assert all(joint.mimic is None for joint in model.joints)


@given(models(from_urdf=True))
def test_what_a_file_can_say(model: Model) -> None:
    assert model.gravity == (0.0, 0.0, -9.81)
    assert model.extra_frames == ()
    assert all(joint.locked_at is None for joint in model.joints)


def _has_joint(kind: str, model: Model) -> bool:
    return any(joint.type == kind for joint in model.joints)


SORTS: dict[str, Callable[[Model], bool]] = {
    **{kind: partial(_has_joint, kind) for kind in ("revolute", "continuous", "prismatic", "fixed")},
    "floating": lambda model: model.floating,
    "branching": lambda model: len({joint.parent for joint in model.joints}) < len(model.joints),
    "mimic": lambda model: any(joint.mimic is not None for joint in model.joints),
    "locked": lambda model: any(joint.locked_at is not None for joint in model.joints),
    "added frame": lambda model: bool(model.extra_frames),
    "no inertial": lambda model: any(link.inertial is None for link in model.links),
    "massless": lambda model: model.total_mass == 0.0 and len(model.joint_names) > 0,
    "no gravity": lambda model: model.gravity == (0.0, 0.0, 0.0),
    "gravity in another direction": lambda model: abs(model.gravity[0]) > 0.1,
    "limits of some width": lambda model: any(
        -np.inf < j.limits.lower < j.limits.upper < np.inf for j in model.joints
    ),
    "oblique axis": lambda model: any(0.1 < abs(joint.axis[1]) < 0.9 for joint in model.joints),
    "limits without width": lambda model: any(j.limits.lower == j.limits.upper for j in model.joints),
    "limit on one side": lambda model: any(
        np.isfinite(j.limits.lower) and j.limits.upper == np.inf for j in model.joints
    ),
    "friction": lambda model: any(joint.dynamics.friction > 0.0 for joint in model.joints),
    "armature": lambda model: any(joint.dynamics.armature > 0.0 for joint in model.joints),
    "another order": lambda model: (
        [j.name[-1] for j in model.joints] != sorted(j.name[-1] for j in model.joints)
    ),
    "root named world": lambda model: model.root == "world",
}


@pytest.mark.parametrize("sort", SORTS)
def test_every_sort_occurs(sort: str) -> None:
    assert_occurs(models(), SORTS[sort])


class TestShrinking:
    """To the fewest links, in a chain, about z, on a fixed base, with round numbers."""

    def test_least_of_all(self) -> None:
        model = simplest(models(), lambda model: True)
        assert len(model.links) == 1
        assert model.base == "fixed"
        assert model.links[0].inertial is None
        solid = simplest(models(solvable=True), lambda model: True)
        assert solid.links[0].inertial == Inertial(1.0, ixx=0.125, iyy=0.125, izz=0.125)

    def test_joints(self) -> None:
        model = simplest(models(), lambda model: len(model.joint_names) == 3)
        assert len(model.links) == 4
        assert [joint.parent for joint in model.joints] == ["link0", "link1", "link2"]
        for joint in model.joints:
            assert (joint.type, joint.axis, joint.origin) == ("revolute", (0.0, 0.0, 1.0), Pose())
            assert joint.mimic is None
            assert joint.dynamics.damping == 0.0
        assert model.gravity == (0.0, 0.0, -9.81)
        assert not model.extra_frames

    def test_one_cause_remains(self) -> None:
        """Only what the failure needs is left complicated."""
        model = simplest(models(), lambda model: any(joint.type == "prismatic" for joint in model.joints))
        assert len(model.joints) == 1
        assert model.joints[0].axis == (0.0, 0.0, 1.0)
        assert model.base == "fixed"


@pytest.mark.parametrize(
    ("arguments", "error", "says"),
    [
        ({"min_links": 0}, ArgumentError, "min_links is 0; wanted 1 to 64"),
        ({"max_links": 1000}, ArgumentError, "max_links is 1000"),
        ({"max_links": 2.5}, DTypeError, "max_links"),
        ({"min_links": True}, DTypeError, "min_links"),
        ({"min_links": 9}, ArgumentError, "more than max_links"),
        ({"base": "flying"}, UnknownNameError, "base is 'flying'"),
        ({"joint_types": []}, ArgumentError, "joint_types"),
        ({"joint_types": "revolute"}, ArgumentError, "joint_types"),
        ({"joint_types": ["revolut"]}, UnknownNameError, "did you mean 'revolute'"),
        ({"mimics": 1}, DTypeError, "mimics"),
        ({"solvable": True, "physical": False}, ArgumentError, "solvable"),
    ],
)
def test_arguments_that_cannot_be(arguments: dict[str, Any], error: type[DynxError], says: str) -> None:
    with pytest.raises(error, match=says):
        models(**arguments)


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
