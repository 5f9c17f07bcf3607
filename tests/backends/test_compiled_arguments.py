"""What the compiled backend refuses, wherever in a batch it is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dynx.backends.compiled import CompiledBackend
from dynx.backends.compiled_call import FEW
from dynx.errors import ArgumentError, NotFiniteError, ShapeError, SingularMassMatrixError
from dynx.model import Inertial, Joint, Link, Model, Pose
from dynx.model.configuration import TOO_LARGE
from tests.backends.compiled_robots import ROBOTS, made, state
from tests.backends.robots import chain
from tests.closeness import Closeness, samples_at


@pytest.fixture(scope="module", params=ROBOTS)
def engine(request: pytest.FixtureRequest) -> CompiledBackend:
    return made(ROBOTS[request.param])


@pytest.mark.parametrize("n", [None, 1, 9, FEW + 9])
@pytest.mark.parametrize("which", [0, 1, 2])
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, TOO_LARGE, -2 * TOO_LARGE, 1e300])
def test_a_bad_number_anywhere(engine: CompiledBackend, n: int | None, which: int, value: float) -> None:
    given = state(engine.model, () if n is None else (n,))
    given[which].reshape(-1)[-1] = value
    error = ArgumentError if np.isfinite(value) else NotFiniteError
    with pytest.raises(error, match=f"{'qva'[which]}\\["):
        engine.inverse_dynamics(*given)


def test_large_numbers_that_are_allowed() -> None:
    """The sum of their squares passes the bound on one number, but not that on its square."""
    model = chain(2)
    engine = made(model)
    v = np.full((3, 2), 0.9 * TOO_LARGE)
    for rows in (v, v[0], np.tile(v, (FEW, 1))):
        tau = engine.inverse_dynamics(0 * rows, 0 * rows, rows)
        assert np.isfinite(tau).all()


@pytest.mark.parametrize("robot", ["floating", "floating mimic"])
def test_quaternions_are_scaled_or_refused(robot: str) -> None:
    engine = made(ROBOTS[robot])
    for size in ((), (3,), (FEW + 3,)):
        q, v, a = state(engine.model, size)
        wanted = engine.inverse_dynamics(q, v, a)
        off = q.copy()
        off[..., 3:7] *= 1.0 + 1e-8
        rows = [x.reshape(-1, x.shape[-1]) for x in (q, v, a)]
        close = Closeness(samples_at(engine.model, rows[0], rows[1], rows[2]))
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
    for size in ((), (3,), (FEW + 3,)):
        q, v, a = state(model, size)
        v[..., 0] = np.nan
        assert np.isnan(engine.inverse_dynamics(q, v, a)[..., 0]).all()
    # Shapes are looked at all the same: nothing outside the arrays is read.
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
    engine, ask = made(model), np.zeros(3)
    for q in (np.zeros(3), np.zeros((4, 3)), np.zeros((FEW + 4, 3))):
        with pytest.raises(SingularMassMatrixError, match="at this configuration"):
            engine.forward_dynamics(q, ask, ask)
    assert np.isfinite(engine.forward_dynamics(np.array([0.0, 1.0, 0.0]), ask, ask)).all()
