"""Kernels called with arrays of every kind: sizes, strides, overlaps, lifetimes."""

from __future__ import annotations

import gc
import multiprocessing
import os
import pickle
import weakref
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest

from dynx.errors import ArgumentError, ClosedError, CompileError, DTypeError, ShapeError
from dynx.simd import kernel as kernel_module
from dynx.simd.emit import Settings
from dynx.simd.image import Image
from dynx.simd.kernel import Kernel
from dynx.simd.trace import trace
from dynx.spatial.scalar import Array, Floats, cos, sin


def function(x: Array, y: Array) -> Mapping[str, Array]:
    """Compute sums of x (3,) and y (2,); each operation rounds alike in NumPy and in a strict kernel."""
    return {"sums": np.stack([x[0] + y[0], x[1] * y[1], x[2] - y[0], x[0] / y[1]]), "first": x[:1]}


PROGRAM = trace(function, {"x": (3,), "y": (2,)}, simplify=None)
LANES = (2, 4, 8)


@pytest.fixture(scope="module", params=LANES)
def kernel(request: pytest.FixtureRequest) -> Kernel:
    """Compile a strict kernel of `function`, for every number of lanes."""
    return Kernel(PROGRAM, settings=Settings(request.param, fast=False))


def batch(n: int) -> tuple[Floats, Floats]:
    rng = np.random.default_rng(n)
    return rng.standard_normal((n, 3)), rng.standard_normal((n, 2))


def expected(x: Floats, y: Floats) -> tuple[Floats, Floats]:
    sums = np.stack([x[:, 0] + y[:, 0], x[:, 1] * y[:, 1], x[:, 2] - y[:, 0], x[:, 0] / y[:, 1]], axis=-1)
    return sums, x[:, :1].copy()


def empty(n: int) -> tuple[Floats, Floats]:
    return np.full((n, 4), np.nan), np.full((n, 1), np.nan)


def assert_results(found: tuple[Floats, Floats], x: Floats, y: Floats) -> None:
    for got, want in zip(found, expected(x, y), strict=True):
        np.testing.assert_array_equal(got, want)


@pytest.mark.parametrize("n", [*range(20), 100, 1001])
def test_any_number_of_samples(kernel: Kernel, n: int) -> None:
    x, y = batch(n)
    # Memory behind the last row is not written.
    around = np.full((n + 3, 4), 7.0), np.full((n + 3, 1), 7.0)
    kernel([x, y], [array[:n] for array in around])
    assert_results((around[0][:n], around[1][:n]), x, y)
    assert all(np.all(array[n:] == 7.0) for array in around)


LAYOUTS: dict[str, Callable[[Floats], Floats]] = {
    "every other row": lambda a: np.repeat(a, 2, axis=0)[::2],
    "backwards": lambda a: np.ascontiguousarray(a[::-1])[::-1],
    "columns of a wider array": lambda a: np.hstack([a, a])[:, : a.shape[1]],
    "Fortran order": np.asfortranarray,
    "every other column": lambda a: np.repeat(a, 2, axis=1)[:, ::2],
    "off the alignment": lambda a: _misaligned(a),
    "read-only": lambda a: _locked(a),
}


def _misaligned(a: Floats) -> Floats:
    raw = np.zeros(a.nbytes + 8, dtype=np.uint8)
    moved = raw[1 : 1 + a.nbytes].view(np.float64).reshape(a.shape)
    moved[...] = a
    return moved


def _locked(a: Floats) -> Floats:
    a = a.copy()
    a.flags.writeable = False
    return a


@pytest.mark.parametrize("n", [1, 3, 13])
@pytest.mark.parametrize("layout", LAYOUTS.values(), ids=LAYOUTS)
def test_inputs_of_any_layout(kernel: Kernel, n: int, layout: Callable[[Floats], Floats]) -> None:
    x, y = batch(n)
    found = empty(n)
    kernel([layout(x), layout(y)], found)
    assert_results(found, x, y)


@pytest.mark.parametrize("n", [1, 3, 13])
@pytest.mark.parametrize("how", [how for how in LAYOUTS if how != "read-only"])
def test_outputs_of_any_layout(kernel: Kernel, n: int, how: str) -> None:
    x, y = batch(n)
    sums, first = (LAYOUTS[how](array) for array in empty(n))
    kernel([x, y], [sums, first])
    assert_results((sums, first), x, y)


@pytest.mark.parametrize("n", [1, 2, 9])
def test_one_sample_for_a_whole_batch(kernel: Kernel, n: int) -> None:
    x, y = batch(n)
    row = np.broadcast_to(x[:1], (n, 3))
    found = empty(n)
    kernel([row, y], found)
    assert_results(found, np.array(row), y)


@pytest.mark.parametrize("n", [1, 3, 21])
@pytest.mark.parametrize("shift", [-1, 0, 1])
def test_output_sharing_memory_with_an_input(kernel: Kernel, n: int, shift: int) -> None:
    """The results are as if all inputs had been read before any output is written."""
    room = np.random.default_rng(n).standard_normal((n + 2, 5))
    x = room[1 : n + 1, :3]
    y = batch(n)[1]
    before = x.copy()
    sums, first = room[1 + shift : n + 1 + shift, 1:], np.empty((n, 1))
    kernel([x, y], [sums, first])
    assert_results((sums, first), before, y)


def test_outputs_sharing_memory(kernel: Kernel) -> None:
    """The later one is written last."""
    x, y = batch(9)
    room = np.empty((9, 4))
    kernel([x, y], [room, room[:, 2:3]])
    want = expected(x, y)
    np.testing.assert_array_equal(room[:, 2:3], want[1])
    np.testing.assert_array_equal(room[:, [0, 1, 3]], want[0][:, [0, 1, 3]])


def test_ports_without_entries() -> None:
    """A robot without joints."""
    nothing = trace(lambda q, x: {"tau": q, "twice": 2.0 * x}, {"q": (0,), "x": (1,)})
    x, tau, twice = np.arange(5.0)[:, None], np.empty((5, 0)), np.empty((5, 1))
    Kernel(nothing)([np.empty((5, 0)), x], [tau, twice])
    np.testing.assert_array_equal(twice, 2.0 * x)
    Kernel(trace(lambda q: q, {"q": (0,)}))([np.empty((5, 0))], [tau])
    constant = np.empty((5, 2))
    Kernel(trace(lambda q: np.array([1.0, 2.0]), {"q": (0,)}))([np.empty((5, 0))], [constant])
    np.testing.assert_array_equal(constant, np.tile([1.0, 2.0], (5, 1)))


def test_results_do_not_depend_on_other_samples() -> None:
    """A sample has the same result bits alone, in any lane, beside NaN and within a batch."""
    kernel = Kernel(trace(lambda x: np.stack([sin(x[0]) * x[1], cos(x[1]) + x[0]]), {"x": (2,)}))
    x = np.random.default_rng(1).uniform(-9.0, 9.0, (37, 2))
    x[5], x[20] = np.nan, 1e7
    whole = np.empty((37, 2))
    kernel([x], [whole])
    room = kernel.workspace()
    for k in range(37):
        alone = np.empty((1, 2))
        kernel([x[k : k + 1]], [alone])
        np.testing.assert_array_equal(alone[0], whole[k])
        room.inputs[room.input_slices[0]] = x[k].data
        room.run()
        np.testing.assert_array_equal(room.results[0], whole[k])
    for first in range(12):
        part = np.empty((37 - first, 2))
        kernel([x[first:]], [part])
        np.testing.assert_array_equal(part, whole[first:])


@pytest.mark.parametrize("threads", [2, 3, 16])
@pytest.mark.parametrize("n", [1, 3, 8, 9, 100, 1003])
def test_results_do_not_depend_on_the_number_of_threads(
    kernel: Kernel, monkeypatch: pytest.MonkeyPatch, n: int, threads: int
) -> None:
    monkeypatch.setattr(kernel_module, "MIN_PART_WORK", 1.0)
    x, y = batch(n)
    found = empty(n)
    kernel([x, y], found, threads=threads)
    assert_results(found, x, y)
    backwards = empty(n)
    kernel([x[::-1], y[::-1]], [array[::-1] for array in backwards], threads=threads)
    assert_results(backwards, x, y)


def test_several_threads_share_a_kernel(kernel: Kernel) -> None:
    def evaluate(n: int) -> None:
        x, y = batch(n)
        found = empty(n)
        kernel([x, y], found)
        assert_results(found, x, y)

    with ThreadPoolExecutor(4) as pool:
        for done in [pool.submit(evaluate, n) for n in range(200)]:
            done.result()


@pytest.mark.parametrize("samples", [1, 5, 64])
def test_workspace_of_several_samples(kernel: Kernel, samples: int) -> None:
    room = kernel.workspace(samples)
    for n in range(1, samples + 1):
        x, y = batch(n)
        room.input_rows[0][:n], room.input_rows[1][:n] = x, y
        room.run_rows(n)
        assert_results((room.output_rows[0][:n], room.output_rows[1][:n]), x, y)
        room.inputs[room.input_slices[0]] = x[0].data
        room.inputs[room.input_slices[1]] = y[0].data
        room.run()
        assert_results((room.results[0][None], room.results[1][None]), x[:1], y[:1])
        assert room.output_values[room.output_slices[1]].tolist() == [x[0, 0]]


# -- refused -----------------------------------------------------------------------------------------


def test_arrays_that_do_not_fit(kernel: Kernel) -> None:
    x, y = batch(5)
    good = empty(5)
    locked = np.empty((5, 4))
    locked.flags.writeable = False
    swapped = x.astype(">f8")
    for inputs, outputs, error, message in [
        ([x[:4], y], good, ShapeError, r"x has shape \(4, 3\); wanted \(5, 3\)"),
        ([x, x], good, ShapeError, r"y has shape \(5, 3\); wanted \(5, 2\)"),
        ([x[0], y], good, ShapeError, r"x has shape \(3,\)"),
        ([x, y], (good[0], good[1][:, 0]), ShapeError, r"first has shape \(5,\)"),
        ([x.astype(np.float32), y], good, DTypeError, "x has dtype float32"),
        ([swapped, y], good, DTypeError, "x has dtype >f8"),
        ([x, y], (np.zeros((5, 4), dtype=int), good[1]), DTypeError, "sums has dtype int"),
        ([x, y], (locked, good[1]), ArgumentError, "sums is read-only"),
        ([x], good, ArgumentError, "2 inputs and 2 outputs was given 1 and 2"),
        ([x, y], good[:1], ArgumentError, "2 inputs and 2 outputs was given 2 and 1"),
    ]:
        with pytest.raises(error, match=message):
            kernel(inputs, outputs)
    assert np.isnan(good[0]).all()


def test_an_invalid_image_raises() -> None:
    image = Kernel(PROGRAM).image
    with pytest.raises(CompileError, match="linked"):
        Kernel(replace(image, objects=(b"no object file",)))


# -- lifetimes ---------------------------------------------------------------------------------------


def test_a_closed_kernel_refuses_and_frees_its_code() -> None:
    kernel = Kernel(PROGRAM)
    room = kernel.workspace()
    code = weakref.ref(kernel._open_code())
    kernel.close()
    kernel.close()
    x, y = batch(4)
    with pytest.raises(ClosedError):
        kernel([x, y], empty(4))
    with pytest.raises(ClosedError):
        kernel.workspace()
    # A workspace that is still referenced keeps working.
    room.inputs[room.input_slices[0]], room.inputs[room.input_slices[1]] = x[0].data, y[0].data
    room.run()
    assert_results((room.results[0][None], room.results[1][None]), x[:1], y[:1])
    assert code() is not None
    del room
    gc.collect()
    assert code() is None


def test_an_unreferenced_kernel_frees_its_code() -> None:
    kernel = Kernel(PROGRAM)
    code = weakref.ref(kernel._open_code())
    kernel([*batch(3)], empty(3))
    del kernel
    gc.collect()
    assert code() is None


def test_pickling(kernel: Kernel) -> None:
    copy: Kernel = pickle.loads(pickle.dumps(kernel))
    x, y = batch(11)
    found = empty(11)
    copy([x, y], found)
    assert_results(found, x, y)


def test_another_machines_code_is_refused() -> None:
    image: Image = Kernel(PROGRAM).image
    foreign = Kernel.__new__(Kernel)
    foreign.image = replace(image, target=replace(image.target, cpu="some-other-cpu"))
    with pytest.raises(CompileError, match="compiled for some-other-cpu"):
        pickle.loads(pickle.dumps(foreign))


def _ask_in_child(kernel: Kernel, x: Floats, y: Floats) -> None:
    found = empty(len(x))
    kernel([x, y], found, threads=2)
    Kernel(PROGRAM)([x, y], found)
    assert_results(found, x, y)


@pytest.mark.skipif(not hasattr(os, "fork"), reason="this system cannot fork")
@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")
def test_a_forked_child_uses_and_makes_kernels(kernel: Kernel, monkeypatch: pytest.MonkeyPatch) -> None:
    """After the parent has started threads, of which the child has none."""
    monkeypatch.setattr(kernel_module, "MIN_PART_WORK", 1.0)
    x, y = batch(1000)
    kernel([x, y], empty(1000), threads=2)
    child = multiprocessing.get_context("fork").Process(target=_ask_in_child, args=(kernel, x, y))
    child.start()
    child.join(60)
    assert child.exitcode == 0
