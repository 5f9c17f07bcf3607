"""Independence of the order of calls; threads, pickling, closing."""

from __future__ import annotations

import pickle
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynx.backends import Backend, backend
from dynx.errors import ClosedError
from dynx.model import Model
from dynx.spatial.scalar import Floats
from tests.contract.conftest import Make
from tests.contract.engine_calls import ENGINE_CALLS, State, random_state
from tests.contract.robots import branched, mimicking

FIXED = branched()
FLOATING = FIXED.with_base("floating")
# Two of equal size, so that an engine which takes one for the other is found out.
OTHER = FIXED.with_gravity((1.0, 2.0, 3.0)).with_frame("beta_too", "beta")
MODELS: tuple[Model, ...] = (FIXED, OTHER, FLOATING, mimicking())
SIZES = ((), (2,))

Call = tuple[int, int, int, int]
"""Numbers of the model, the engine call, the state, and the size."""

CALLS = st.tuples(
    st.integers(0, len(MODELS) - 1),
    st.integers(0, len(ENGINE_CALLS) - 1),
    st.integers(0, 2),
    st.integers(0, len(SIZES) - 1),
)


def state_of(call: Call) -> State:
    model, _, state, size = call
    return random_state(MODELS[model], 70 + state, SIZES[size])


def result(engine: Backend, call: Call) -> Floats:
    return np.array(ENGINE_CALLS[call[1]].evaluate(engine, state_of(call)))


@pytest.fixture(scope="module")
def alone(backend_name: str) -> dict[Call, Floats]:
    """Return the results by call, each of a new backend; tests fill it."""
    return {}


@pytest.mark.long_cases
def test_no_order_of_calls_changes_a_result(make: Make, backend_name: str, alone: dict[Call, Floats]) -> None:
    """Calls to several robots in any order, against each call to a new backend."""
    engines = [make(model) for model in MODELS]

    @given(st.lists(CALLS, min_size=2, max_size=12))
    def holds(calls: list[Call]) -> None:
        for call in calls:
            if call not in alone:
                with backend(backend_name, MODELS[call[0]]) as fresh:
                    alone[call] = result(fresh, call)
            np.testing.assert_array_equal(result(engines[call[0]], call), alone[call])

    holds()


def test_a_failed_call_leaves_nothing_behind(make: Make) -> None:
    engine = make(FLOATING)
    state = random_state(FLOATING, 80)
    for engine_call in ENGINE_CALLS:
        before = engine_call.evaluate(engine, state)
        for spoiled in (state.q[:-1], np.full(FLOATING.nq, np.nan)):
            with pytest.raises(ValueError, match="q"):
                engine_call.evaluate(engine, State(spoiled, state.v, state.a, state.tau))
        np.testing.assert_array_equal(engine_call.evaluate(engine, state), before)


@pytest.mark.long_cases
def test_several_threads_at_once(make: Make) -> None:
    """Each thread makes every call, for every robot, in another order."""
    engines = [make(model) for model in MODELS]
    calls = [
        (model, engine_call, state, size)
        for model in range(len(MODELS))
        for engine_call in range(len(ENGINE_CALLS))
        for state in range(2)
        for size in range(len(SIZES))
    ]
    wanted = [result(engines[call[0]], call) for call in calls]

    def call_all(seed: int) -> list[Floats]:
        results = [np.empty(0)] * len(calls)
        for k in np.random.default_rng(seed).permutation(len(calls)):
            results[k] = result(engines[calls[k][0]], calls[k])
        return results

    interval = sys.getswitchinterval()
    # So short that Python switches threads within calls.
    sys.setswitchinterval(1e-6)
    try:
        with ThreadPoolExecutor(4) as pool:
            found = list(pool.map(call_all, range(4)))
    finally:
        sys.setswitchinterval(interval)
    for results in found:
        for got, want in zip(results, wanted, strict=True):
            np.testing.assert_array_equal(got, want)


@pytest.mark.parametrize("model", MODELS, ids=("fixed", "other", "floating", "mimicking"))
def test_pickling_by_recipe(make: Make, model: Model) -> None:
    engine = make(model)
    state = random_state(model, 81, (2,))
    with pickle.loads(pickle.dumps(engine)) as copy:
        assert type(copy) is type(engine)
        assert copy.model == model
        for engine_call in ENGINE_CALLS:
            np.testing.assert_array_equal(
                engine_call.evaluate(copy, state), engine_call.evaluate(engine, state)
            )


def test_pickling_keeps_the_options(make: Make) -> None:
    assert pickle.loads(pickle.dumps(make(FIXED, validate=False)))._validate is False


@pytest.mark.parametrize("validate", [True, False])
def test_a_closed_backend_refuses(backend_name: str, validate: bool) -> None:
    engine = backend(backend_name, FLOATING, validate=validate)
    for size in SIZES:
        state = random_state(FLOATING, 82, size)
        for engine_call in ENGINE_CALLS:
            engine_call.evaluate(engine, state)
    engine.close()
    engine.close()
    for size in SIZES:
        state = random_state(FLOATING, 82, size)
        for engine_call in ENGINE_CALLS:
            with pytest.raises(ClosedError, match=FLOATING.name):
                engine_call.evaluate(engine, state)


def test_closing_one_leaves_the_others_open(backend_name: str) -> None:
    first, second = (backend(backend_name, FIXED) for _ in range(2))
    state = random_state(FIXED, 83)
    wanted = [engine_call.evaluate(second, state) for engine_call in ENGINE_CALLS]
    first.close()
    for engine_call, want in zip(ENGINE_CALLS, wanted, strict=True):
        np.testing.assert_array_equal(engine_call.evaluate(second, state), want)
    second.close()


def test_with_block_closes(backend_name: str) -> None:
    with backend(backend_name, FIXED) as engine:
        engine.mass_matrix(FIXED.neutral())
    with pytest.raises(ClosedError):
        engine.mass_matrix(FIXED.neutral())


def test_a_closed_backend_can_be_pickled_and_opens_anew(backend_name: str) -> None:
    engine = backend(backend_name, FIXED)
    wanted = engine.mass_matrix(FIXED.neutral())
    engine.close()
    with pickle.loads(pickle.dumps(engine)) as copy:
        np.testing.assert_array_equal(copy.mass_matrix(FIXED.neutral()), wanted)


def test_it_has_a_name_and_a_version(make: Make, backend_name: str) -> None:
    engine = make(FIXED)
    assert engine.name == backend_name
    assert engine.model is FIXED
    assert backend_name in repr(engine)
    assert any(character.isdigit() for character in engine.engine_version)


def test_many_backends_one_after_another(backend_name: str) -> None:
    """More than an engine has connections for, each closed by falling out of use or by hand."""
    state = random_state(FIXED, 84)
    wanted = None
    for turn in range(60):
        engine = backend(backend_name, FIXED)
        tau = engine.inverse_dynamics(state.q, state.v, state.a)
        wanted = tau if wanted is None else wanted
        np.testing.assert_array_equal(tau, wanted)
        if turn % 2:
            engine.close()


def test_a_backend_works_in_a_child_process(backend_name: str) -> None:
    """The backend is sent to the process by pickle."""
    engine = backend(backend_name, FIXED)
    q = FIXED.neutral()
    program = (
        "import pickle, sys; engine = pickle.load(sys.stdin.buffer);"
        "sys.stdout.buffer.write(engine.mass_matrix(engine.model.neutral()).tobytes())"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], input=pickle.dumps(engine), capture_output=True, check=True
    )
    M = np.frombuffer(done.stdout).reshape(FIXED.nv, FIXED.nv)
    np.testing.assert_array_equal(M, engine.mass_matrix(q))
    engine.close()
