"""The recipe "add a quantity" of docs/architecture.md, carried out on a quantity that dynx lacks.

It takes three files: the algorithm in `dynx.rbd`, the entry of the table, and the method of `Backend`. The
fourth, a native hook in an engine, is optional. Nothing else has to know of the new quantity.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import ArrayLike

from dynx.agreement import Referee, agree
from dynx.backends import Backend, DerivedBackend, backend, native_quantities
from dynx.backends.quantities import QUANTITIES, Quantity
from dynx.model import Mechanism, Model
from dynx.rbd import centroidal
from dynx.rbd.kinematics import Poses
from dynx.reference.backend import ReferenceBackend
from dynx.spatial.scalar import Array, Floats
from dynx.spatial.so3 import cross
from tests.backends.robots import assert_close, mixed_robot, motion
from tests.contract.engine_calls import engine_calls

NAME = "momentum_about_origin"


# File 1, the algorithm in `dynx.rbd`.
def momentum_about_origin(mechanism: Mechanism, poses: Poses, v: Array) -> Array:
    """Linear, then angular momentum about the centre of mass plus that of its motion (..., 6)."""
    centroidal_momentum = centroidal.centroidal_momentum(mechanism, poses, v)
    linear, angular = centroidal_momentum[..., :3], centroidal_momentum[..., 3:]
    center = centroidal.center_of_mass(mechanism, poses)
    return np.concatenate([linear, angular + cross(center, linear)], axis=-1)


# File 2, the entry of the table.
ENTRY = Quantity(
    NAME,
    ("q", "v"),
    (6,),
    "kg m/s, kg m^2/s",
    momentum_about_origin,
    "momentum",
    "Featherstone 2008, section 2.8",
    {"Drake": "CalcSpatialMomentumInWorldAboutPoint"},
)


# File 3, the method of `Backend`.
def method(self: Backend, q: ArrayLike, v: ArrayLike) -> Floats:
    """Momentum about the world's origin (..., 6) [kg m/s, kg m^2/s]."""
    return self._evaluate(NAME, (q, v))


# File 4, if an engine computes the quantity itself.
class NativeBackend(ReferenceBackend):
    """An engine with a native version, which is wrong in the ninth digit."""

    name = "native"

    def _momentum_about_origin(self, q: Floats, v: Floats) -> Floats:
        return np.asarray(self._derive(NAME, q, v) * (1.0 + 1e-9))


@pytest.fixture
def added(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """The quantity in the table; its kernels are kept out of the user's cache."""
    monkeypatch.setenv("DYNX_CACHE_DIR", str(tmp_path))
    monkeypatch.setitem(QUANTITIES, NAME, ENTRY)
    monkeypatch.setattr(Backend, NAME, method, raising=False)


@pytest.fixture(params=[False, True], ids=["tree", "mimic"])
def model(request: pytest.FixtureRequest) -> Model:
    return mixed_robot("floating", mimic=request.param)


@pytest.mark.usefixtures("added")
def test_every_backend_evaluates_it(model: Model) -> None:
    q, v, _ = motion(model, size=(2, 3))
    expected = getattr(backend("reference", model), NAME)(q, v)
    assert expected.shape == (2, 3, 6)
    exact = Referee(model).momentum_about_origin(q[0, 0], v[0, 0]).astype(float)
    engines = [backend(name, model) for name in ("reference", "pinocchio", "compiled")]
    for engine in (*engines, DerivedBackend(engines[1])):
        assert_close(getattr(engine, NAME)(q, v), expected)
        assert_close(getattr(engine, NAME)(q[0, 0], v[0, 0]), exact)
    assert NAME in native_quantities(backend("compiled", model))


@pytest.mark.usefixtures("added")
def test_it_is_compared_and_a_wrong_native_version_is_found(model: Model) -> None:
    rows = agree(model, ["reference", "pinocchio"], samples=3).quantities
    pairs = {row.pair for row in rows if row.quantity == NAME}
    assert pairs == {"reference~pinocchio", "reference~referee", "pinocchio~referee"}
    assert all(row.agree for row in rows)
    wrong = [row for row in agree(model, [NativeBackend(model)], samples=3).quantities if not row.agree]
    assert {(row.quantity, row.pair) for row in wrong} == {(NAME, "native~referee"), (NAME, "native~derived")}


@pytest.mark.usefixtures("added")
def test_the_tests_of_the_contract_call_it(model: Model) -> None:
    (call,) = (call for call in engine_calls() if call.method == NAME)
    assert call.arguments == ("q", "v")
    assert call.tail(model) == (6,)


def test_it_is_gone_afterwards() -> None:
    assert NAME not in QUANTITIES
    assert not hasattr(Backend, NAME)
