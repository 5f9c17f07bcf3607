"""Inertials that a program gives to a robot, and those made of the columns of the regressor."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import dynx
from dynx.agreement.tolerances import BAR
from dynx.errors import ArgumentError, DescriptionError, DTypeError, ShapeError, UnknownNameError
from dynx.model import Inertial, Joint, Link, Model, Pose
from dynx.rbd.regressor import link_inertia
from dynx.sim import plant_model
from dynx.spatial.inertia import parameters_from_inertia
from dynx.testing.strategies import models

ARM = dynx.load("planar_2r")
TIP = ARM.links[-1].name
untyped: Any = Inertial


@given(models())
def test_the_parameters_of_the_links_make_the_robot_again(model: Model) -> None:
    parameters = dynx.inertial_parameters(model)
    rows = zip(model.links, parameters.reshape(-1, 10), strict=True)
    again = model.with_inertials({link.name: Inertial.from_parameters(row) for link, row in rows})
    scale = np.abs(parameters).max(initial=1.0)
    np.testing.assert_allclose(dynx.inertial_parameters(again), parameters, rtol=BAR, atol=BAR * scale)
    assert [link.name for link in again.links] == [link.name for link in model.links]
    assert (again.joints, again.base, again.geometry) == (model.joints, model.base, model.geometry)


@given(st.lists(st.floats(-5.0, 5.0), min_size=9, max_size=9), st.floats(0.1, 5.0), st.booleans())
def test_any_ten_numbers_with_a_mass_are_kept(others: list[float], mass: float, negative: bool) -> None:
    ten = np.array([-mass if negative else mass, *others])
    changed = ARM.with_inertials({TIP: Inertial.from_parameters(ten)})
    np.testing.assert_allclose(
        parameters_from_inertia(link_inertia(changed, TIP)),
        ten,
        rtol=BAR,
        atol=BAR * abs(ten).max() ** 2 / mass,
    )


def test_an_identified_robot_has_the_torques_of_the_log() -> None:
    """A fit of the difference from the model keeps what the log does not determine, such as a mass."""
    rng = np.random.default_rng(0)
    q, v, a = rng.normal(size=(3, 40, 2))
    known = dynx.inertial_parameters(ARM)
    with dynx.backend("reference", plant_model(ARM, mass_scale=1.3)) as true:
        tau = true.inverse_dynamics(q, v, a)
    with dynx.backend("reference", ARM) as engine:
        Y = engine.inertial_regressor(q, v, a).reshape(-1, len(known))
    fit = known + np.linalg.lstsq(Y, tau.ravel() - Y @ known, rcond=None)[0]
    rows = zip(ARM.links, fit.reshape(-1, 10), strict=True)
    found = ARM.with_inertials({link.name: Inertial.from_parameters(row) for link, row in rows})
    with dynx.backend("reference", found) as engine:
        bound = BAR * np.linalg.norm(Y) * np.linalg.norm(fit)
        np.testing.assert_allclose(engine.inverse_dynamics(q, v, a), tau, rtol=0.0, atol=bound)


def test_other_parts_and_notes_stay_and_faults_are_noted() -> None:
    bare = Model.build("bare", [Link("a"), Link("b")], [Joint("j", "revolute", "a", "b")])
    assert "link 'b' has no <inertial>" in str(bare.notes[0])
    filled = bare.with_inertials({"b": Inertial(1.0, Pose((0.1, 0.0, 0.0)), 0.1, 0.0, 0.0, 0.1, 0.0, 0.1, 7)})
    assert filled.notes == ()
    assert (filled.link("a"), filled.total_mass) == (Link("a"), 1.0)
    assert filled.inertial("b").line is None
    assert bare.with_inertials({}) == bare
    notes = [str(each) for each in filled.with_inertials({"b": Inertial(-1.0, ixx=1.0)}).notes]
    assert notes[0] == "the mass of link 'b' is -1 kg, which no body has"
    assert notes[1].startswith("the inertia of link 'b' is not physical: the principal moment 1 exceeds")


@pytest.mark.parametrize(
    ("inertials", "error", "message"),
    [
        ({"lnk1": Inertial()}, UnknownNameError, "no link 'lnk1'"),
        ({TIP: None}, DTypeError, r"wanted Mapping\[str, Inertial\]"),
        ([Inertial()], DTypeError, r"wanted Mapping\[str, Inertial\]"),
        ({TIP: untyped("1")}, DTypeError, f"the mass of link '{TIP}' is '1'; wanted a number"),
        (
            {TIP: Inertial(float("nan"))},
            DescriptionError,
            "argument inertials.*is nan; wanted a number below",
        ),
    ],
)
def test_mistakes_are_named(inertials: Any, error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        ARM.with_inertials(inertials)


@pytest.mark.parametrize(
    ("parameters", "error", "message"),
    [
        (np.zeros(9), ShapeError, r"shape \(9,\)"),
        (np.zeros((2, 10)), ShapeError, r"shape \(2, 10\); wanted \(10,\)"),
        ([0.0, 1.0, *[0.0] * 8], ArgumentError, "mass 0 and first moments"),
    ],
)
def test_parameters_of_no_link_are_refused(parameters: Any, error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        Inertial.from_parameters(parameters)
