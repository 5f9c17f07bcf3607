"""Valid arguments, which stay unchanged, and results, which belong to the caller."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from dynx.model import Link, Model
from dynx.spatial.scalar import Floats
from tests.contract import robots
from tests.contract.conftest import Make
from tests.contract.engine_calls import ENGINE_CALLS, EngineCall, State, each_call, random_state

FLOATING = robots.MODELS["floating"]


def every_other(x: Floats) -> Floats:
    """Return the same numbers, each two apart in memory."""
    wide = np.full((*x.shape[:-1], 2 * x.shape[-1]), np.nan)
    wide[..., ::2] = x
    return wide[..., ::2]


def backward(x: Floats) -> Floats:
    """Return the same numbers, backward in memory."""
    return np.ascontiguousarray(x[..., ::-1])[..., ::-1]


def read_only(x: Floats) -> Floats:
    """Return the same numbers, not to be written to."""
    x = x.copy()
    x.flags.writeable = False
    return x


def big_endian(x: Floats) -> Floats:
    """Return the same numbers in the other order of bytes."""
    return x.astype(">f8")


SPELLINGS: tuple[Callable[[Floats], Any], ...] = (
    every_other,
    backward,
    read_only,
    big_endian,
    np.asfortranarray,
    np.ndarray.tolist,
)


@pytest.mark.long_cases
@pytest.mark.parametrize("spelling", SPELLINGS, ids=lambda spelling: spelling.__name__)
@each_call
def test_any_array_of_the_same_numbers(
    make: Make, engine_call: EngineCall, spelling: Callable[[Floats], Any]
) -> None:
    engine = make(FLOATING)
    for size in ((), (3,)):
        state = random_state(FLOATING, 11, size)
        result = engine_call.evaluate(engine, state.map(spelling))
        engine_call.check(engine, state, result, engine_call.evaluate(engine, state))


@pytest.mark.long_cases
@pytest.mark.parametrize("dtype", ["float32", "float16", "int64", "int8", "uint8"])
@each_call
def test_other_real_numbers_are_converted_exactly(make: Make, engine_call: EngineCall, dtype: str) -> None:
    engine = make(FLOATING)
    narrow = random_state(FLOATING, 12).map(lambda x: np.rint(np.abs(x)).astype(dtype))
    narrow.q[3:7] = np.array([0, 0, 1, 0], dtype=dtype)
    result = engine_call.evaluate(engine, narrow)
    np.testing.assert_array_equal(result, engine_call.evaluate(engine, narrow.map(np.float64)))
    assert np.asarray(result).dtype == np.float64


@each_call
def test_arguments_stay_as_they_were(make: Make, engine_call: EngineCall) -> None:
    engine = make(FLOATING)
    for size in ((), (2,)):
        state = random_state(FLOATING, 13, size)
        before = state.map(np.copy)
        engine_call.evaluate(engine, state)
        for name in ("q", "v", "a", "tau"):
            np.testing.assert_array_equal(getattr(state, name), getattr(before, name))


@each_call
def test_results_belong_to_the_caller(make: Make, engine_call: EngineCall) -> None:
    engine = make(FLOATING)
    for size in ((), (2,)):
        state = random_state(FLOATING, 14, size)
        first = np.asarray(engine_call.evaluate(engine, state))
        kept = first.copy()
        others = [np.asarray(engine_call.evaluate(engine, state)) for _ in range(2)]
        for argument in (state.q, state.v, state.a, state.tau):
            assert not np.shares_memory(first, argument)
        assert not any(np.shares_memory(first, other) for other in others)
        if size or first.ndim:
            assert first.flags.writeable
            first[...] = np.nan
        np.testing.assert_array_equal(engine_call.evaluate(engine, state), kept)
        engine_call.evaluate(engine, random_state(FLOATING, 15, size))
        np.testing.assert_array_equal(others[0], kept)


@each_call
def test_without_validation_the_results_are_the_same(make: Make, engine_call: EngineCall) -> None:
    checked, trusting = make(FLOATING), make(FLOATING, validate=False)
    for size in ((), (2,)):
        state: State = random_state(FLOATING, 16, size)
        np.testing.assert_array_equal(
            engine_call.evaluate(trusting, state), engine_call.evaluate(checked, state)
        )


MODELS = {**robots.MODELS, "without_joints": Model.build("block", [Link("block", robots.body(1.0))], [])}
SIZES = ((), (1,), (3,), (2, 3), (0,), (2, 0))

each_model = pytest.mark.parametrize("model", MODELS.values(), ids=MODELS.keys())


@pytest.mark.long_cases
@each_model
@each_call
def test_shape_and_type_for_every_size_of_batch(make: Make, model: Model, engine_call: EngineCall) -> None:
    engine = make(model)
    for size in SIZES:
        result = engine_call.evaluate(engine, random_state(model, 1, size))
        assert type(result) is np.ndarray or size == (), f"{type(result)} for {size}"
        assert np.shape(result) == (*size, *engine_call.tail(model))
        assert np.asarray(result).dtype == np.float64
        assert np.isfinite(result).all()


@pytest.mark.long_cases
@each_model
@each_call
def test_a_batch_is_its_samples(make: Make, model: Model, engine_call: EngineCall) -> None:
    engine = make(model)
    state = random_state(model, 2, (3,))
    together = engine_call.evaluate(engine, state)
    one_by_one = [
        engine_call.evaluate(engine, State(*row))
        for row in zip(state.q, state.v, state.a, state.tau, strict=True)
    ]
    engine_call.check(engine, state, together, np.stack(one_by_one))


@pytest.mark.parametrize("base", ["fixed", "floating"])
@each_call
def test_leading_axes_broadcast(make: Make, base: str, engine_call: EngineCall) -> None:
    model = MODELS[base]
    engine = make(model)
    whole = random_state(model, 3, (2, 3))
    apart = State(whole.q[:, :1], whole.v[0], whole.a[0, 0], whole.tau[0, 0])
    result = engine_call.evaluate(engine, apart)
    shapes = {"q": (2, 1), "v": (3,), "a": (), "tau": ()}
    batch = np.broadcast_shapes(*(shapes[argument] for argument in engine_call.arguments))
    assert result.shape == (*batch, *engine_call.tail(model))
    spread = apart.map(lambda x: np.broadcast_to(x, (2, 3, x.shape[-1])).reshape(6, -1))
    results = np.broadcast_to(result, (2, 3, *engine_call.tail(model)))
    engine_call.check(
        engine, spread, results.reshape(6, *engine_call.tail(model)), engine_call.evaluate(engine, spread)
    )


@each_model
def test_poses_of_several_frames(make: Make, model: Model) -> None:
    engine = make(model)
    names = [model.frame_names[-1], model.frame_names[0]]
    for size in SIZES:
        q = random_state(model, 4, size).q
        every = engine.forward_kinematics(q)
        assert every.shape == (*size, len(model.frame_names), 4, 4)
        some = engine.forward_kinematics(q, names)
        assert some.shape == (*size, 2, 4, 4)
        np.testing.assert_array_equal(some, every[..., [-1, 0], :, :])
        assert engine.forward_kinematics(q, []).shape == (*size, 0, 4, 4)


@each_model
def test_one_frame_is_that_of_all_frames(make: Make, model: Model) -> None:
    engine = make(model)
    state = random_state(model, 5, (4,))
    every = engine.forward_kinematics(state.q)
    for index, name in enumerate(model.frame_names):
        one = engine.forward_kinematics(state.q, name)
        ENGINE_CALLS[0].check(engine, state, one, every[:, index])


def test_a_batch_of_wrenches(make: Make) -> None:
    model = MODELS["floating"]
    engine = make(model)
    state = random_state(model, 6)
    wrenches = np.random.default_rng(6).uniform(-3.0, 3.0, (4, 6))
    together = engine.inverse_dynamics(state.q, state.v, state.a, external_forces={"tool": wrenches})
    assert together.shape == (4, model.nv)
    for wrench, torque in zip(wrenches, together, strict=True):
        alone = engine.inverse_dynamics(state.q, state.v, state.a, external_forces={"tool": wrench})
        np.testing.assert_array_equal(torque, alone)
