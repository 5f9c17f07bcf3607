"""Kernels that all frames of a chain share: right for each frame, and few in number."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Literal

import numpy as np
import pytest
from hypothesis import given, note
from hypothesis import strategies as st

from dynx.backends import backend
from dynx.backends.quantities import QUANTITIES
from dynx.compiled.backend import CompiledBackend
from dynx.compiled.call import MAX_COPIED_SAMPLES
from dynx.compiled.frames import chain_of, on_chain, place_of
from dynx.compiled.kernels import ON_CHAINS, evaluate_quantity
from dynx.model.mechanism import ROOT
from dynx.rbd.jacobians import REFERENCES
from dynx.rbd.kinematics import ancestry
from dynx.spatial.scalar import Floats
from dynx.testing.strategies import models, samples
from tests.backends.robots import chain as a_chain
from tests.compiled.robots import ROBOTS, TIP, made, state
from tests.error_bounds import ErrorBounds, samples_at

each_quantity = pytest.mark.parametrize("quantity", sorted(ON_CHAINS))


def evaluate(
    engine: Any, quantity: str, frame: str, reference: str, *given: Floats, **options: Any
) -> Floats:
    """Evaluate a quantity of a frame at q and those of v and a that it takes."""
    arguments = given[: len(QUANTITIES[quantity].arguments)]
    result: Floats = getattr(engine, quantity)(*arguments, frame, reference=reference, **options)
    return result


@pytest.fixture(scope="module", params=ROBOTS)
def engine(request: pytest.FixtureRequest) -> CompiledBackend:
    return made(ROBOTS[request.param])


@pytest.mark.long_cases
@each_quantity
@pytest.mark.parametrize("base", ["fixed", "floating"])
@given(data=st.data())
def test_any_frame_of_any_robot(
    quantity: str, base: Literal["fixed", "floating"], data: st.DataObject
) -> None:
    """The traced function, evaluated on numbers, agrees with `dynx.rbd` for that frame."""
    model = data.draw(models(base=base))
    note(model.to_urdf())
    mechanism, drawn = model.mechanism, data.draw(samples(model))
    frame = data.draw(st.integers(0, len(mechanism.frames) - 1))
    reference = REFERENCES[data.draw(st.sampled_from(sorted(REFERENCES)))]
    coupling = mechanism.coupling
    S = np.eye(model.nv) if coupling is None else coupling.matrix()
    q = drawn.q if coupling is None else coupling.expand_q(drawn.q)
    rates = [S @ drawn.v, S @ drawn.a][: len(QUANTITIES[quantity].arguments) - 1]
    chain = chain_of(mechanism, quantity, frame, reference)
    place = place_of(mechanism, chain, frame, reference)
    got = on_chain(mechanism, quantity, chain, place, q, *rates).astype(float)
    tree = replace(mechanism, coupling=None)
    wanted = evaluate_quantity(tree, quantity, (frame, reference), q, *rates)
    if QUANTITIES[quantity].reduces_columns:
        got, wanted = got @ S, wanted @ S
    ErrorBounds(samples_at(model, drawn.q, drawn.v, drawn.a)).check(quantity, got, wanted)


@pytest.mark.long_cases
@each_quantity
@pytest.mark.parametrize("engine", ["fixed", "floating mimic"], indirect=True)
@pytest.mark.parametrize("size", [(), (3,), (MAX_COPIED_SAMPLES + 5,)])
def test_kernels_serve_every_frame_of_their_chain(
    engine: CompiledBackend, quantity: str, size: tuple[int, ...]
) -> None:
    model = engine.model
    numeric = backend("reference", model)
    given = state(model, size)
    close = ErrorBounds(samples_at(model, *given))
    for frame in model.frame_names:
        for reference in REFERENCES:
            got, wanted = (evaluate(each, quantity, frame, reference, *given) for each in (engine, numeric))
            close.check(quantity, got, wanted)


@each_quantity
def test_the_order_of_calls_changes_no_result(quantity: str) -> None:
    model = ROBOTS["floating"]
    given = state(model, (5,))
    pairs = [(frame, reference) for frame in model.frame_names for reference in REFERENCES]
    results = []
    for order in (pairs, pairs[::-1]):
        engine = made(model)
        results.append({pair: evaluate(engine, quantity, *pair, *given) for pair in order})
    for pair in pairs:
        np.testing.assert_array_equal(results[0][pair], results[1][pair])


@each_quantity
@pytest.mark.parametrize("reference", REFERENCES)
def test_every_code_path_gives_the_same_bits(engine: CompiledBackend, quantity: str, reference: str) -> None:
    """Single samples, small and large batches, strided arrays, and `out`."""
    given = state(engine.model, (MAX_COPIED_SAMPLES + 5,))
    whole = evaluate(engine, quantity, TIP, reference, *given)
    for n in (1, 2, 7):
        some = evaluate(engine, quantity, TIP, reference, *(x[:n] for x in given))
        np.testing.assert_array_equal(some, whole[:n])
    one = evaluate(engine, quantity, TIP, reference, *(x[3] for x in given))
    np.testing.assert_array_equal(one, whole[3])
    strided = evaluate(engine, quantity, TIP, reference, *(x[::2] for x in given))
    np.testing.assert_array_equal(strided, whole[::2])
    if quantity == "jacobian":
        out = np.full_like(whole, np.nan)
        assert evaluate(engine, quantity, TIP, reference, *given, out=out) is out
        np.testing.assert_array_equal(out, whole)


@pytest.mark.parametrize("robot", ROBOTS)
def test_few_kernels_are_made(robot: str) -> None:
    """One for each leaf of the tree; in `local_world_aligned` one for each body for Jacobians and for their
    derivatives."""
    mechanism = ROBOTS[robot].mechanism
    kernels = {
        (quantity, chain_of(mechanism, quantity, frame, reference))
        for quantity in ON_CHAINS
        for frame in range(len(mechanism.frames))
        for reference in REFERENCES.values()
    }
    ends = set(range(len(mechanism.bodies))) - {body.parent for body in mechanism.bodies}
    assert len(kernels) == len(ON_CHAINS) * len(ends) + 2 * (len(mechanism.bodies) + 1)


def test_frames_on_one_body_share_a_kernel() -> None:
    model = a_chain(1)
    engine = made(model)
    q, v = np.zeros(1), np.ones(1)
    for frame in model.frame_names:
        for reference in REFERENCES:
            engine.frame_velocity(q, v, frame, reference=reference)
            engine.jacobian_derivative(q, v, frame, reference="local")
    assert len(model.frame_names) > 1
    assert len(engine._chain_kernels) == 2


def test_a_chain_holds_the_body_of_its_frame() -> None:
    mechanism = ROBOTS["fixed"].mechanism
    for number, frame in enumerate(mechanism.frames):
        own = chain_of(mechanism, "jacobian", number, "local_world_aligned")
        shared = chain_of(mechanism, "frame_velocity", number, "local_world_aligned")
        assert own.bodies == tuple(reversed(ancestry(mechanism, frame.body)))
        assert frame.body == ROOT or frame.body in shared.bodies
        for each in (own, shared):
            parents = [mechanism.bodies[body].parent for body in each.bodies]
            assert parents == [ROOT, *each.bodies[:-1]][: len(parents)]


def test_closing_releases_the_kernels_of_chains() -> None:
    engine = made(a_chain(1))
    engine.frame_velocity(np.zeros(1), np.zeros(1), "link1")
    assert engine._chain_kernels
    engine.close()
    assert not engine._chain_kernels
