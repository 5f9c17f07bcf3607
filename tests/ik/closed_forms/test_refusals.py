"""Arms without a closed form, and invalid arguments: errors that say what is missing."""

from __future__ import annotations

import pickle
import re
from typing import Any

import numpy as np
import pytest

from dynx.backends import backend
from dynx.errors import ArgumentError, DynxError, NoClosedFormError, ShapeError, UnknownNameError
from dynx.ik import closed_form
from dynx.ik.closed_forms import redundant_joints
from dynx.model import Joint, Limits, Link, Mimic, Model, Pose
from dynx.model.loading import load
from tests.ik.closed_forms.arms import random_arm
from tests.oracles.closed_form import MODELS

UR5 = load("ur5")
PANDA = load("panda")
TIAGO = load("tiago")
CART_POLE = load(MODELS / "cart_pole.urdf")


def general_arm() -> Model:
    """Return six axes that neither meet nor are parallel."""
    return random_arm("parallel: general", np.random.default_rng(0), deviation=0.3)


def coupled_arm() -> Model:
    """Return an arm of which joint 2 follows joint 1."""
    links = [Link("base"), Link("a"), Link("b")]
    limits = Limits(-1.0, 1.0)
    joints = [
        Joint("first", "revolute", "base", "a", limits=limits),
        Joint("second", "revolute", "a", "b", Pose((0.1, 0.0, 0.0)), limits=limits, mimic=Mimic("first")),
    ]
    return Model.build("coupled", links, joints)


@pytest.mark.parametrize(
    ("model", "frame", "given", "error", "says"),
    [
        (
            PANDA,
            "panda_hand",
            {},
            NoClosedFormError,
            "7 joints .*given={'panda_joint.': ...} .*panda_joint7",
        ),
        (
            PANDA,
            "panda_hand",
            {"panda_joint1": 0.2},
            NoClosedFormError,
            "miss a common point by .* m.*parallel",
        ),
        (CART_POLE, "tip", {}, NoClosedFormError, "prismatic, revolute; .*; without all_solutions a search"),
        (TIAGO, "arm_7_link", {}, NoClosedFormError, "8 joints .*given={'.*': ..., '.*': ...}.* more"),
        (general_arm(), "tool", {}, NoClosedFormError, "off parallel by .* deg.*; without all_solutions"),
        (load("ur5", base="floating"), "tool0", {}, NoClosedFormError, "floating base"),
        (coupled_arm(), "b", {}, NoClosedFormError, "'second' follows 'first'"),
        (UR5, "forearm_link", {}, NoClosedFormError, "3 joints move 'forearm_link'"),
        (UR5, "tool", {}, UnknownNameError, "tool0"),
        (PANDA, "panda_hand", {"panda_joint": 0.2}, UnknownNameError, "panda_joint"),
        (PANDA, "panda_hand", {"panda_joint8": 0.2}, UnknownNameError, "fixed"),
        (PANDA, "panda_hand", {"panda_joint7": np.nan}, ArgumentError, "finite number"),
        (PANDA, "panda_hand", {"panda_joint7": "0"}, ArgumentError, "finite number"),
        (PANDA, "panda_hand", {3: 0.1}, UnknownNameError, "3"),
        (PANDA, "panda_hand", [0.1], ArgumentError, "wanted positions by joint"),
    ],
)
def test_an_arm_without_a_closed_form_is_refused(
    model: Model, frame: str, given: Any, error: type[DynxError], says: str
) -> None:
    with pytest.raises(error) as caught:
        closed_form(model, frame, given)
    assert re.search(says, str(caught.value))


def test_joints_that_leave_a_closed_form_are_named() -> None:
    names = redundant_joints(PANDA, "panda_hand")
    assert "panda_joint7" in names
    for name in names:
        assert closed_form(PANDA, "panda_hand", {name: -0.3}).given == {name: -0.3}


@pytest.mark.parametrize(
    ("target", "options", "error", "says"),
    [
        (np.zeros(3), {}, ShapeError, "needs poses"),
        (np.eye(3), {}, ArgumentError, "free"),
        (np.eye(4), {"free": "rotation"}, ArgumentError, "without free"),
        (np.eye(4), {"point": [0.0, 0.0, 0.1]}, ArgumentError, "without free, point"),
        (np.eye(4), {"method": "engine"}, ArgumentError, "method"),
        (np.eye(4), {"position_tolerance": -1.0}, ArgumentError, "position_tolerance"),
        (np.eye(4), {"q0": np.zeros((2, 6))}, ShapeError, "q0 has leading axes"),
        (np.eye(4), {"given": {"nobody": 1.0}}, UnknownNameError, "nobody"),
        (
            np.eye(4),
            {"given": {"elbow_joint": 9.0}},
            ArgumentError,
            "'elbow_joint' is 9 rad, outside its limits",
        ),
        (2.0 * np.eye(4), {}, ArgumentError, "rigid"),
    ],
)
def test_invalid_arguments(target: Any, options: dict[str, Any], error: type[DynxError], says: str) -> None:
    with backend("reference", UR5) as engine, pytest.raises(error, match=says):
        engine.inverse_kinematics(target, "tool0", all_solutions=True, **options)


def test_given_without_all_solutions_is_refused() -> None:
    with backend("reference", PANDA) as engine, pytest.raises(ArgumentError, match="all_solutions=True"):
        engine.inverse_kinematics(np.eye(4), "panda_hand", given={"panda_joint7": 0.1})


def test_what_an_error_advises_can_be_followed() -> None:
    with pytest.raises(NoClosedFormError) as caught:
        closed_form(PANDA, "panda_hand")
    assert len(caught.value.remedies) == 4
    for joints in caught.value.remedies:
        assert closed_form(PANDA, "panda_hand", dict.fromkeys(joints, 0.1)).given.keys() == set(joints)
    again = pickle.loads(pickle.dumps(caught.value))
    assert (str(again), again.remedies) == (str(caught.value), caught.value.remedies)
