"""The straight path of one sample: taken by every quantity, with the checks and results of the other path."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynx.backends import Backend, backend, installed_backends
from dynx.backends.quantities import QUANTITIES, Quantity
from dynx.backends.quantity_calls import QuantityCalls
from dynx.engines.pinocchio.backend import _FUNCTIONS, PinocchioBackend
from dynx.engines.pinocchio.library import pin
from dynx.errors import (
    ArgumentError,
    ClosedError,
    DTypeError,
    EngineError,
    NotFiniteError,
    ShapeError,
    UnknownNameError,
)
from dynx.model import Model
from dynx.model.numbers import MAX_MAGNITUDE
from dynx.reference.backend import ReferenceBackend
from dynx.spatial.scalar import Floats
from dynx.testing.strategies import models
from tests.backends.robots import all_quantities, assert_close, chain, mixed_robot, motion

ENGINES = tuple(name for name in installed_backends() if name != "compiled")
"""Backends with hooks; `compiled` has kernels instead."""

SIZES = (1, 3, 32, 45)
"""Numbers of joints: Pinocchio returns vectors at one, and long arrays are checked by NumPy."""


def call_of(engine: Backend, quantity: Quantity, *arrays: Any) -> Floats:
    """Evaluate a quantity at the arrays that it takes; a quantity of a frame at the last frame."""
    method: Callable[..., Floats] = getattr(engine, quantity.name)
    frame = {"frame": engine.model.frame_names[-1]} if quantity.of_frame else {}
    return method(*arrays[: len(quantity.arguments)], **frame)


def refuse_general_path(monkeypatch: pytest.MonkeyPatch) -> None:
    """Make every evaluation by the general path fail."""

    def refused(self: QuantityCalls, name: str, *arguments: object) -> Floats:
        raise AssertionError(f"{name} was evaluated by the general path")

    monkeypatch.setattr(QuantityCalls, "_evaluate_samples", refused)


@pytest.mark.parametrize("validate", [True, False])
@pytest.mark.parametrize("mimic", [False, True])
@pytest.mark.parametrize("name", ENGINES)
def test_one_sample_takes_the_straight_path(
    name: str, mimic: bool, validate: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    model = mixed_robot("floating", mimic=mimic)
    engine = backend(name, model, validate=validate)
    sample = motion(model)
    native = [quantity for quantity in QUANTITIES.values() if hasattr(type(engine), quantity.hook)]
    assert len(native) >= 9
    first = [call_of(engine, quantity, *sample) for quantity in native]
    refuse_general_path(monkeypatch)
    for quantity, expected in zip(native, first, strict=True):
        result = call_of(engine, quantity, *sample)
        assert type(result) is np.ndarray
        assert result.shape == expected.shape
        if mimic:
            assert_close(result, expected)
        else:
            np.testing.assert_array_equal(result, expected)


@pytest.mark.parametrize("size", SIZES)
@pytest.mark.parametrize("base", ["fixed", "floating"])
def test_what_is_no_valid_sample_is_refused_on_the_straight_path(size: int, base: Any) -> None:
    model = chain(size).with_base(base)
    engine = PinocchioBackend(model)
    sample = motion(model)
    wrong: tuple[tuple[Callable[[Floats], Any], type[Exception]], ...] = (
        (lambda x: np.append(x[:-1], np.nan), NotFiniteError),
        (lambda x: np.append(x[:-1], np.inf), NotFiniteError),
        (lambda x: np.append(x[:-1], -1e160), ArgumentError),
        (lambda x: np.append(x[:-1], MAX_MAGNITUDE), ArgumentError),
        (lambda x: x[:-1], ShapeError),
        (lambda x: np.zeros((len(x), 0)), ShapeError),
        (lambda x: np.zeros((len(x), len(x) + 1)), ShapeError),
        (lambda x: x.astype(bool), DTypeError),
        (lambda x: None, DTypeError),
    )
    for quantity in QUANTITIES.values():
        call_of(engine, quantity, *sample)
        for position, argument in enumerate(quantity.arguments):
            for spoil, error in wrong:
                arrays = list(sample)
                arrays[position] = spoil(sample[position])
                with pytest.raises(error, match=rf"^{argument}"):
                    call_of(engine, quantity, *arrays)
    if model.floating:
        q = sample[0].copy()
        q[3:7] *= 1.1
        with pytest.raises(ArgumentError, match="quaternion"):
            engine.gravity_torque(q)
    engine.close()
    for quantity in QUANTITIES.values():
        with pytest.raises(ClosedError):
            call_of(engine, quantity, *sample)


@pytest.mark.parametrize("replaced", ["hook", "binding"])
@pytest.mark.parametrize("validate", [True, False])
@pytest.mark.parametrize("size", SIZES)
def test_an_acceleration_of_the_straight_path_is_finite(
    size: int, validate: bool, replaced: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = np.ones(size)

    def solved(*_: object) -> Floats:
        copied: Floats = found.copy()
        return copied

    if replaced == "hook":
        monkeypatch.setattr(PinocchioBackend, "_forward_dynamics", solved)
    else:
        # By the first the hook calls it, and by the second the straight path.
        monkeypatch.setattr(pin, "aba", solved)
        monkeypatch.setitem(_FUNCTIONS, "forward_dynamics", solved)
    model = chain(size)
    engine = PinocchioBackend(model, validate=validate)
    sample = motion(model)
    engine.forward_dynamics(*sample)
    for entry in (np.nan, np.inf, -np.inf):
        found[-1] = entry
        # The mass matrix is regular, so the acceleration is solved for by it.
        a = engine.forward_dynamics(*sample)
        np.testing.assert_allclose(engine.inverse_dynamics(*sample[:2], a), sample[2], rtol=1e-9, atol=1e-9)
    # A sum that overflows is one of finite entries.
    found[:] = 1e308
    np.testing.assert_array_equal(engine.forward_dynamics(*sample), found)


@pytest.mark.parametrize("name", ["pinocchio", "compiled"])
@pytest.mark.parametrize("wrong", [None, 3, ["link1"], "nowhere"])
def test_a_name_that_is_none_of_a_frame_or_a_reference_is_refused(name: str, wrong: Any) -> None:
    engine: Any = backend(name, chain(3))
    q, v, _ = motion(engine.model)
    frame = engine.model.frame_names[-1]
    for _ in range(2):
        engine.jacobian(q, frame)
        engine.frame_velocity(q, v, frame)
        for names in ({"frame": wrong}, {"frame": frame, "reference": wrong}):
            with pytest.raises(UnknownNameError):
                engine.jacobian(q, **names)
            with pytest.raises(UnknownNameError):
                engine.frame_velocity(q, v, **names)


@pytest.mark.parametrize("size", SIZES)
def test_numbers_just_below_the_bound_are_accepted(size: int) -> None:
    engine = PinocchioBackend(chain(size))
    q, v, _ = motion(engine.model)
    engine.bias_torque(q, v)
    v[...] = 0.99 * MAX_MAGNITUDE
    assert engine.bias_torque(q, v).shape == v.shape


@pytest.mark.parametrize("kind", [PinocchioBackend, ReferenceBackend])
@given(data=st.data())
def test_mimic_joints_give_the_numbers_of_a_batch(kind: type[Backend], data: st.DataObject) -> None:
    model: Model = data.draw(models(solvable=True))
    engine = kind(model)
    q, v, x = motion(model)
    in_batch = all_quantities(engine, q[None], v[None], x[None])
    for _ in range(2):
        for quantity, result in all_quantities(engine, q, v, x).items():
            assert_close(result, in_batch[quantity][0])


def test_an_exception_of_the_engine_is_translated_on_the_straight_path(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    engine = PinocchioBackend(chain(3))
    q, v, _ = motion(engine.model)
    engine.bias_torque(q, v)

    def broken(*arguments: object) -> None:
        raise RuntimeError("out of order")

    monkeypatch.setattr("dynx.engines.pinocchio.backend.pin.nonLinearEffects", broken)
    with pytest.raises(EngineError, match="pinocchio failed on chain"):
        engine.bias_torque(q, v)


def test_an_exception_of_a_hook_of_the_user_stays_what_it_is() -> None:
    class Flawed(ReferenceBackend):
        name = "flawed"
        calls = 0

        def _gravity_torque(self, q: Floats) -> Floats:
            self.calls += 1
            if self.calls == 2:
                raise RuntimeError("out of order")
            return np.asarray(super()._gravity_torque(q))

    engine = Flawed(chain(3))
    q, _, _ = motion(engine.model)
    engine.gravity_torque(q)
    with pytest.raises(RuntimeError, match="out of order"):
        engine.gravity_torque(q)
    assert engine.calls == 2


def test_a_hook_of_the_object_itself_replaces_that_of_the_class() -> None:
    engine = ReferenceBackend(chain(3))
    q, _, _ = motion(engine.model)
    vars(engine)["_gravity_torque"] = lambda q: np.full(3, 7.0)
    for _ in range(2):
        assert engine.gravity_torque(q).tolist() == [7.0, 7.0, 7.0]


@pytest.mark.parametrize("name", ENGINES)
def test_the_first_call_has_the_bits_of_later_ones(name: str) -> None:
    """Mimic joints are reduced by the products of the straight path from the first call on."""
    model = mixed_robot("floating", mimic=True)
    arrays = motion(model, 3)
    for quantity in QUANTITIES.values():
        with backend(name, model) as engine:
            first = call_of(engine, quantity, *arrays).copy()
            np.testing.assert_array_equal(call_of(engine, quantity, *arrays), first, err_msg=quantity.name)
