"""`assert_same_robot`: what it lets pass, and what its message names."""

from __future__ import annotations

import inspect
from typing import Any, get_args

import pytest

import dynx
from dynx.same.attributes import Kind
from dynx.testing import assert_same_robot
from tests.same.planted import other_mass
from tests.same.rewrites import with_other_joint_attributes


def test_a_robot_is_itself() -> None:
    assert assert_same_robot("ur5", dynx.load("ur5")).same


def test_the_message_names_the_element() -> None:
    other = other_mass(dynx.load("ur5"), "forearm_link", 0.1).model
    with pytest.raises(AssertionError, match="forearm_link, inertial"):
        assert_same_robot("ur5", other)


def test_chosen_attributes_must_be_the_same_too() -> None:
    other = with_other_joint_attributes(dynx.load("ur5"))
    assert_same_robot("ur5", other, attributes=("gravity",))
    with pytest.raises(AssertionError, match="damping of shoulder_pan_joint"):
        assert_same_robot("ur5", other, attributes=("damping",))


@pytest.mark.parametrize("attributes", ["damping", b"damping", 3, None])
def test_attributes_are_listed(attributes: Any) -> None:
    with pytest.raises(dynx.errors.DTypeError, match="attributes"):
        assert_same_robot("ur5", "ur5", attributes=attributes)


@pytest.mark.parametrize("kind", ["lower limits", "dampings", "", "inertial"])
def test_unknown_attributes_are_refused(kind: str) -> None:
    with pytest.raises(dynx.errors.UnknownNameError, match="attributes"):
        assert_same_robot("ur5", "ur5", attributes=("damping", kind))


def test_the_nearest_attribute_is_offered() -> None:
    with pytest.raises(dynx.errors.UnknownNameError, match="'lower limit'"):
        assert_same_robot("ur5", "ur5", attributes=("lower limits",))


def test_every_kind_is_known_and_described() -> None:
    assert_same_robot("ur5", "ur5", attributes=get_args(Kind))
    described = inspect.getdoc(assert_same_robot) or ""
    assert [kind for kind in get_args(Kind) if f'"{kind}"' not in described] == []
