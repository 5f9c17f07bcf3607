"""Arguments that the compiled backend refuses, wherever in a batch they are."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import dynx
from dynx.compiled.backend import CompiledBackend
from dynx.compiled.call import MAX_COPIED_SAMPLES
from dynx.errors import ArgumentError, NotFiniteError, ShapeError, SingularMassMatrixError
from dynx.model import Inertial, Joint, Link, Model, Pose
from dynx.model.numbers import MAX_MAGNITUDE
from tests.backends.robots import chain
from tests.compiled.robots import ROBOTS, made, state
from tests.error_bounds import ErrorBounds, samples_at


@pytest.fixture(scope="module", params=ROBOTS)
def engine(request: pytest.FixtureRequest) -> CompiledBackend:
    return made(ROBOTS[request.param])


@pytest.mark.parametrize("n", [None, 1, 9, MAX_COPIED_SAMPLES + 9])
@pytest.mark.parametrize("which", [0, 1, 2])
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, MAX_MAGNITUDE, -2 * MAX_MAGNITUDE, 1e300])
def test_an_invalid_number_anywhere_is_named(
    engine: CompiledBackend, n: int | None, which: int, value: float
) -> None:
    given = state(engine.model, () if n is None else (n,))
    given[which].reshape(-1)[-1] = value
    error = ArgumentError if np.isfinite(value) else NotFiniteError
    with pytest.raises(error, match=f"{'qva'[which]}\\["):
        engine.inverse_dynamics(*given)


def test_large_numbers_that_are_allowed() -> None:
    """The sum of squares exceeds the bound on one number, but not the square of that bound."""
    model = chain(2)
    engine = made(model)
    v = np.full((3, 2), 0.9 * MAX_MAGNITUDE)
    for rows in (v, v[0], np.tile(v, (MAX_COPIED_SAMPLES, 1))):
        tau = engine.inverse_dynamics(0 * rows, 0 * rows, rows)
        assert np.isfinite(tau).all()


@pytest.mark.parametrize("robot", ["floating", "floating mimic"])
def test_quaternions_are_scaled_or_refused(robot: str) -> None:
    engine = made(ROBOTS[robot])
    for size in ((), (3,), (MAX_COPIED_SAMPLES + 3,)):
        q, v, a = state(engine.model, size)
        wanted = engine.inverse_dynamics(q, v, a)
        off = q.copy()
        off[..., 3:7] *= 1.0 + 1e-8
        rows = [x.reshape(-1, x.shape[-1]) for x in (q, v, a)]
        close = ErrorBounds(samples_at(engine.model, rows[0], rows[1], rows[2]))
        close.check(
            "inverse_dynamics",
            engine.inverse_dynamics(off, v, a).reshape(-1, engine.model.nv),
            wanted.reshape(-1, engine.model.nv),
        )
        off[..., 3:7] *= 1.1
        with pytest.raises(ArgumentError, match="quaternion"):
            engine.inverse_dynamics(off, v, a)


def test_without_validation_nothing_is_refused() -> None:
    model = chain(2)
    engine = made(model, validate=False)
    for size in ((), (3,), (MAX_COPIED_SAMPLES + 3,)):
        q, v, a = state(model, size)
        v[..., 0] = np.nan
        assert np.isnan(engine.inverse_dynamics(q, v, a)[..., 0]).all()
    # Shapes are checked all the same: nothing outside the arrays is read.
    with pytest.raises(ShapeError):
        engine.inverse_dynamics(np.zeros((9, 3)), np.zeros((9, 2)), np.zeros((9, 2)))


def test_a_configuration_without_an_acceleration() -> None:
    """Two prismatic joints that become parallel: singular at one angle of the hinge between them."""
    body = Inertial(1.0, Pose(), 0.1, 0.0, 0.0, 0.1, 0.0, 0.1)
    joints = [
        Joint("first", "prismatic", "ground", "a", axis=(1.0, 0.0, 0.0)),
        Joint("hinge", "continuous", "a", "b", axis=(0.0, 0.0, 1.0)),
        Joint("second", "prismatic", "b", "c", axis=(1.0, 0.0, 0.0)),
    ]
    links = [
        Link("ground"),
        Link("a"),
        Link("b", replace(body, mass=0.0)),
        Link("c", replace(body, mass=1.0)),
    ]
    model = Model.build("slides", links, joints)
    engine, tau = made(model), np.zeros(3)
    for q in (np.zeros(3), np.zeros((4, 3)), np.zeros((MAX_COPIED_SAMPLES + 4, 3))):
        with pytest.raises(SingularMassMatrixError, match=r"at this configuration|at sample"):
            engine.forward_dynamics(q, tau, tau)
    assert np.isfinite(engine.forward_dynamics(np.array([0.0, 1.0, 0.0]), tau, tau)).all()


def test_the_invalid_sample_is_named() -> None:
    model = dynx.load("ur5", base="floating")
    q = np.tile(model.neutral(), (40, 1))
    q[37, 3:7] = 2.0
    with pytest.raises(ArgumentError, match=r"q\[37, 3:7\] is a quaternion .* of length 4"):
        made(model).gravity_torque(q)
    arm = dynx.load("ur5")
    heavy = dynx.parametric(arm, links=["wrist_3_link"])
    parameters = np.tile(heavy.parameters.defaults, (10, 1))
    parameters[4] = 0.0
    with pytest.raises(SingularMassMatrixError, match=r"at sample \[4\]"):
        heavy.forward_dynamics(np.zeros((10, 6)), np.zeros(6), np.zeros(6), parameters)


@pytest.mark.parametrize("n", [5, MAX_COPIED_SAMPLES + 5])
def test_unchecked_nan_spoils_its_own_sample_only(n: int) -> None:
    model = dynx.load("ur5")
    q = np.zeros((n, 6))
    q[3, 2] = np.nan
    with dynx.backend("compiled", model, validate=False) as engine:
        a = engine.forward_dynamics(q, np.zeros(6), np.zeros(6))
    assert np.isnan(a[3]).all()
    assert np.isfinite(np.delete(a, 3, axis=0)).all()


def test_anything_but_a_model_is_refused() -> None:
    name: Any = "panda"
    for make in (dynx.Derivatives, dynx.parametric):
        with pytest.raises(ArgumentError, match=r"wanted a Model, such as dynx.load\('panda'\)"):
            make(name)
    with pytest.raises(ArgumentError, match="wanted a list of names"):
        dynx.parametric(dynx.load("ur5"), links="wrist_3_link")
