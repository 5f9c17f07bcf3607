from __future__ import annotations

import pickle

import numpy as np
import pytest

from dynx.backends import Backend, DerivedBackend, native_quantities
from dynx.backends.quantities import QUANTITIES
from dynx.engines.pinocchio.backend import PinocchioBackend
from dynx.errors import ClosedError
from dynx.reference.backend import ReferenceBackend
from dynx.spatial.scalar import Floats
from tests.backends.robots import all_quantities, assert_close, assert_same, chain, mixed_robot, motion

MINIMUM = {"forward_kinematics", "inverse_dynamics"}


def test_a_view_computes_nothing_natively_but_the_two() -> None:
    assert native_quantities(DerivedBackend) == MINIMUM
    assert native_quantities(DerivedBackend(PinocchioBackend(chain(1)))) == MINIMUM
    assert native_quantities(Backend) == frozenset()
    assert native_quantities(ReferenceBackend) > MINIMUM


def test_no_other_hook_of_the_engine_is_called(monkeypatch: pytest.MonkeyPatch) -> None:
    def never(*_: object) -> Floats:
        raise AssertionError("a native hook was used")

    for hook in {quantity.hook for quantity in QUANTITIES.values()} - {
        "_frame_placements",
        "_inverse_dynamics",
    }:
        monkeypatch.setattr(PinocchioBackend, hook, never)
    monkeypatch.setattr(PinocchioBackend, "_frame_placement", never)
    model = mixed_robot("floating", mimic=True)
    results = all_quantities(DerivedBackend(PinocchioBackend(model)), *motion(model))
    assert all(np.isfinite(result).all() for result in results.values())


@pytest.mark.parametrize("kind", [PinocchioBackend, ReferenceBackend])
@pytest.mark.parametrize("base", ["fixed", "floating"])
@pytest.mark.parametrize("size", [(), (2, 3)])
def test_derived_results_equal_native_ones(kind: type[Backend], base: str, size: tuple[int, ...]) -> None:
    model = mixed_robot(base, mimic=True)
    native = kind(model)
    view = DerivedBackend(native)
    assert view.vectorized is native.vectorized
    sample = motion(model, size=size)
    condition = float(np.linalg.cond(native.mass_matrix(sample[0])).max())
    expected = all_quantities(native, *sample)
    for quantity, result in all_quantities(view, *sample).items():
        scale = condition if quantity == "forward_dynamics" else 1.0
        assert_close(result, expected[quantity], scale, quantity)


def test_a_view_has_the_name_and_version_of_its_backend() -> None:
    inner = PinocchioBackend(chain(1))
    view = DerivedBackend(inner)
    assert view.name == "pinocchio/derived"
    assert view.engine_version == inner.engine_version
    assert repr(view) == "<pinocchio/derived backend of chain>"
    assert PinocchioBackend.name == "pinocchio"
    assert DerivedBackend.name == "derived"


def test_closing_a_view_leaves_the_backend_open() -> None:
    inner = PinocchioBackend(chain(2))
    view = DerivedBackend(inner)
    view.close()
    with pytest.raises(ClosedError):
        view.mass_matrix(np.zeros(2))
    assert inner.mass_matrix(np.zeros(2)).shape == (2, 2)


@pytest.mark.parametrize("validate", [True, False])
def test_a_view_of_a_closed_backend_refuses(validate: bool) -> None:
    inner = ReferenceBackend(chain(2))
    view = DerivedBackend(inner, validate=validate)
    inner.close()
    for call in (view.mass_matrix, view.forward_kinematics):
        with pytest.raises(ClosedError, match="the backend that reference/derived of chain uses was closed"):
            call(np.zeros(2))


def test_a_view_pickles_with_its_backend() -> None:
    model = mixed_robot()
    view = DerivedBackend(PinocchioBackend(model, validate=False), validate=False)
    copy = pickle.loads(pickle.dumps(view))
    assert copy.name == "pinocchio/derived"
    assert copy._validate is False
    assert_same(all_quantities(copy, *motion(model)), all_quantities(view, *motion(model)))
