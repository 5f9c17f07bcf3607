"""Calls of kernels: `out`, and equal bits from every code path."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from dynx.compiled.backend import CompiledBackend
from dynx.compiled.call import MAX_COPIED_SAMPLES, KernelCall
from dynx.errors import ArgumentError, DTypeError, DynxError, ShapeError
from dynx.model import Model
from dynx.model.numbers import MAX_MAGNITUDE
from dynx.simd.target import host
from dynx.spatial.scalar import Floats
from tests.backends.robots import chain
from tests.compiled.robots import ROBOTS, TIP, made, state

Method = Callable[..., Floats]

WITH_OUT: dict[str, tuple[Method, Callable[[Model], tuple[int, ...]]]] = {
    "inverse_dynamics": (lambda e, q, v, a, **o: e.inverse_dynamics(q, v, a, **o), lambda m: (m.nv,)),
    "joint dynamics": (
        lambda e, q, v, a, **o: e.inverse_dynamics(q, v, a, joint_dynamics=True, **o),
        lambda m: (m.nv,),
    ),
    "forward_dynamics": (lambda e, q, v, a, **o: e.forward_dynamics(q, v, a, **o), lambda m: (m.nv,)),
    "pushed": (
        lambda e, q, v, a, **o: e.forward_dynamics(q, v, a, external_forces={TIP: np.ones(6)}, **o),
        lambda m: (m.nv,),
    ),
    "mass_matrix": (lambda e, q, v, a, **o: e.mass_matrix(q, **o), lambda m: (m.nv, m.nv)),
    "with rotors": (
        lambda e, q, v, a, **o: e.mass_matrix(q, joint_dynamics=True, **o),
        lambda m: (m.nv, m.nv),
    ),
    "jacobian": (lambda e, q, v, a, **o: e.jacobian(q, TIP, reference="local", **o), lambda m: (6, m.nv)),
    "jacobian at a point": (
        lambda e, q, v, a, **o: e.jacobian(q, TIP, point=(0.1, 0.2, 0.3), **o),
        lambda m: (6, m.nv),
    ),
    "placement": (lambda e, q, v, a, **o: e.forward_kinematics(q, TIP, **o), lambda m: (4, 4)),
    "placements": (
        lambda e, q, v, a, **o: e.forward_kinematics(q, **o),
        lambda m: (len(m.frame_names), 4, 4),
    ),
    "two placements": (
        lambda e, q, v, a, **o: e.forward_kinematics(q, [TIP, "link2"], **o),
        lambda m: (2, 4, 4),
    ),
}


@pytest.fixture(scope="module", params=ROBOTS)
def engine(request: pytest.FixtureRequest) -> CompiledBackend:
    return made(ROBOTS[request.param])


@pytest.mark.parametrize("size", [(), (0,), (1,), (2, 3), (MAX_COPIED_SAMPLES + 5,)])
@pytest.mark.parametrize(("method", "tail"), WITH_OUT.values(), ids=WITH_OUT)
def test_out(
    engine: CompiledBackend, method: Method, tail: Callable[[Model], tuple[int, ...]], size: tuple[int, ...]
) -> None:
    given = state(engine.model, size)
    wanted = method(engine, *given)
    out = np.full((*size, *tail(engine.model)), np.nan)
    assert method(engine, *given, out=out) is out
    np.testing.assert_array_equal(out, wanted)


@pytest.mark.parametrize("size", [(), (3,), (MAX_COPIED_SAMPLES + 5,)])
@pytest.mark.parametrize(("method", "tail"), WITH_OUT.values(), ids=WITH_OUT)
def test_out_that_does_not_fit(
    engine: CompiledBackend, method: Method, tail: Callable[[Model], tuple[int, ...]], size: tuple[int, ...]
) -> None:
    given = state(engine.model, size)
    shape = (*size, *tail(engine.model))
    locked = np.empty(shape)
    locked.flags.writeable = False
    for out, error in [
        (np.empty((*shape, 1)), ShapeError),
        (np.empty((2, *shape)), ShapeError),
        (np.empty(shape, dtype=np.float32), DTypeError),
        (np.empty(shape).tolist(), ArgumentError),
        (locked, ArgumentError),
        (np.empty((*shape[:-1], 2 * shape[-1]))[..., ::2], ArgumentError),
    ]:
        with pytest.raises(error, match="out"):
            method(engine, *given, out=out)


@pytest.mark.parametrize("size", [(), (3,), (MAX_COPIED_SAMPLES + 5,)])
def test_out_over_an_argument(engine: CompiledBackend, size: tuple[int, ...]) -> None:
    """Arguments stay valid even where a quaternion has to be scaled after the first evaluation."""
    q, v, a = state(engine.model, size)
    if engine.model.floating:
        q[..., 3:7] *= 1.0 + 1e-9
    wanted = engine.inverse_dynamics(q, v, a)
    np.testing.assert_array_equal(engine.inverse_dynamics(q, v, a, out=v), wanted)
    assert engine.inverse_dynamics(q, v, a, out=v) is v


@pytest.mark.parametrize(
    "n",
    [1, 2, 3, 8, MAX_COPIED_SAMPLES - 1, MAX_COPIED_SAMPLES, MAX_COPIED_SAMPLES + 1, 3 * MAX_COPIED_SAMPLES],
)
def test_every_code_path_gives_the_same_bits(engine: CompiledBackend, n: int) -> None:
    """Single samples, copied to the workspace, read in place, strided, broadcast, and on several threads."""
    q, v, a = state(engine.model, (n,))
    whole = engine.inverse_dynamics(q, v, a)
    for k in range(n):
        np.testing.assert_array_equal(engine.inverse_dynamics(q[k], v[k], a[k]), whole[k])
    doubled = [np.repeat(x, 2, axis=0)[::2] for x in (q, v, a)]
    np.testing.assert_array_equal(engine.inverse_dynamics(*doubled), whole)
    turned = [np.asfortranarray(x) for x in (q, v, a)]
    np.testing.assert_array_equal(engine.inverse_dynamics(*turned), whole)
    np.testing.assert_array_equal(engine.inverse_dynamics(q[:, None], v[:, None], a[:, None])[:, 0], whole)
    spread = engine.inverse_dynamics(q, v[0], a[0])
    np.testing.assert_array_equal(spread[0], whole[0])
    np.testing.assert_array_equal(spread, engine.inverse_dynamics(q, np.tile(v[0], (n, 1)), a[:1]))


def test_threads_change_nothing() -> None:
    model = ROBOTS["floating"]
    q, v, a = state(model, (20_000,))
    results = [made(model, threads=threads).inverse_dynamics(q, v, a) for threads in (1, 2, 5, None)]
    for result in results[1:]:
        np.testing.assert_array_equal(result, results[0])


def test_a_batch_that_does_not_fit_into_memory() -> None:
    model = chain(2)
    q = np.broadcast_to(np.zeros(2), (10**14, 2))
    with pytest.raises(MemoryError):
        made(model).mass_matrix(q)


@pytest.mark.parametrize("n", [host().lanes, 100, 1000, 5000])
def test_contiguous_rows_take_the_fastest_path(n: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Batches of more than 256 samples had taken five microseconds before they were computed."""
    engine = made(ROBOTS["floating"], threads=1)
    q, v, a = state(engine.model, (n,))
    v, a = v.copy(), a.copy()
    expected = engine.inverse_dynamics(q, v, a)
    expected_jacobian = engine.jacobian(q, TIP, reference="world")
    monkeypatch.setattr(KernelCall, "_batch", None)
    monkeypatch.setattr(KernelCall, "_evaluate_copies", None)
    np.testing.assert_array_equal(engine.inverse_dynamics(q, v, a), expected)
    np.testing.assert_array_equal(engine.jacobian(q, TIP, reference="world"), expected_jacobian)
    out = np.full_like(expected, np.nan)
    assert engine.inverse_dynamics(q, v, a, out=out) is out
    np.testing.assert_array_equal(out, expected)
    for x in (q, v, a):
        x.setflags(write=False)
    np.testing.assert_array_equal(engine.inverse_dynamics(q, v, a), expected)


@pytest.mark.parametrize("n", [host().lanes, 100, 1000, 9000])
def test_one_bad_row_is_found_on_the_fastest_path(n: int) -> None:
    engine = made(ROBOTS["fixed"], threads=1)
    q, v, a = (np.ascontiguousarray(x) for x in state(engine.model, (n,)))
    for value in (np.nan, np.inf, 1e200):
        for row in (0, n // 2, n - 1):
            bad = v.copy()
            bad[row, 1] = value
            with pytest.raises(DynxError, match=rf"v\[{row}"):
                engine.inverse_dynamics(q, bad, a)
    # Numbers just below the bound are not refused, although their squares add up to more than its square.
    assert engine.inverse_dynamics(q, np.full_like(v, 0.9 * MAX_MAGNITUDE), a).shape == v.shape
    inside = q.copy()
    np.testing.assert_array_equal(
        engine.inverse_dynamics(q, inside, a, out=inside), engine.inverse_dynamics(q, q.copy(), a)
    )
