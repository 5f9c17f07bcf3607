"""Variants: each has the value of its program, whatever the batch and the threads."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynx.errors import ArgumentError, CompileError
from dynx.simd.emit import Settings
from dynx.simd.target import host
from dynx.simd.trace import trace
from dynx.simd.variants import Bytes, VariantKernel, Variants, compile_variants, emit_variants
from dynx.spatial.scalar import Array, Floats, less, sqrt, where_less

TABLE = ((1.0, 2.0), (-1.0, 2.0), (1.0, 3.0), (-1.0, 3.0))

NEWTON_STEPS = 6

TOLERANCE = 1e-12
"""Relative rounding error of a few operations."""


def first_root(square: Array, offset: Array, row: Array) -> dict[str, Array]:
    """One step of Newton's method from a start that is good for squares near 1."""
    return root(square, offset, row, 1)


def better_root(square: Array, offset: Array, row: Array) -> dict[str, Array]:
    return root(square, offset, row, NEWTON_STEPS)


def root(square: Array, offset: Array, row: Array, steps: int) -> dict[str, Array]:
    value = 0.5 * (1.0 + square[0])
    for _ in range(steps):
        value = 0.5 * (value + square[0] / value)
    rough = less(1e-13 * square[0], abs(value * value - square[0]))
    signed = row[0] * value
    return {
        "root": np.array([signed, row[1] * signed + offset[1]], dtype=object),
        "rough": np.asarray(rough),
        "positive": np.asarray(less(0.0, signed)),
    }


SHAPES: dict[str, tuple[int, ...]] = {"square": (1,), "offset": (2,), "row": (2,)}
FIRST, SECOND = (trace(each, SHAPES) for each in (first_root, better_root))
VARIANTS = Variants(FIRST, SECOND, TABLE, ("rough", "positive"), "rough")
KERNEL = VariantKernel(compile_variants(VARIANTS, host(), Settings(4)), 4, 2)


def evaluated(squares: Floats, offsets: Floats, threads: int = 1) -> tuple[Floats, Bytes, Bytes]:
    n = len(squares)
    roots, masks = np.empty((4 * n, 2)), [np.empty(n, dtype=np.uint8) for _ in range(2)]
    KERNEL([squares[:, None], offsets], [roots], masks, threads=threads)
    return roots.reshape(n, 4, 2), masks[0], masks[1]


@given(st.lists(st.floats(0.01, 100.0), min_size=1, max_size=20))
def test_every_variant_of_a_sample_is_computed(numbers: list[float]) -> None:
    squares = np.array(numbers)
    offsets = np.stack([squares, -squares], axis=-1)
    roots, rough, positive = evaluated(squares, offsets)
    table = np.array(TABLE)
    # The second program finished the roots that one step leaves rough.
    exact = table[:, 0] * np.sqrt(squares)[:, None]
    near = np.abs(squares - 1.0) < 0.5
    assert np.allclose(roots[near, :, 0], exact[near], rtol=TOLERANCE, atol=0.0)
    expected = table[:, 1] * roots[:, :, 0] - squares[:, None]
    assert np.allclose(roots[:, :, 1], expected, rtol=TOLERANCE, atol=TOLERANCE * 100.0)
    assert (positive == 0b0101).all()
    assert (rough[near] == 0).all()


def test_results_depend_neither_on_the_batch_nor_on_threads() -> None:
    rng = np.random.default_rng(0)
    squares, offsets = rng.uniform(0.1, 4.0, 40_000), rng.normal(size=(40_000, 2))
    roots, *masks = evaluated(squares, offsets)
    divided, *others = evaluated(squares, offsets, threads=3)
    assert (roots == divided).all()
    assert all((a == b).all() for a, b in zip(masks, others, strict=True))
    outputs = np.empty((4, 2))
    bound = KERNEL.bind([outputs])
    for k in range(5):
        bound.inputs[0][:], bound.inputs[1][:] = squares[k], offsets[k]
        bound.run()
        assert (outputs == roots[k]).all()
        assert bound.masks[0] == sum(int(mask[k]) << 8 * m for m, mask in enumerate(masks))


def test_an_input_may_repeat_a_row_and_outputs_may_be_strided() -> None:
    squares, wide = np.linspace(0.5, 2.0, 7), np.zeros((28, 5))
    masks = [np.empty(7, dtype=np.uint8) for _ in range(2)]
    KERNEL([squares[:, None], np.broadcast_to([0.0, 3.0], (7, 2))], [wide[:, 1:3]], masks)
    roots, *_ = evaluated(squares, np.tile([0.0, 3.0], (7, 1)))
    assert (wide[:, 1:3].reshape(7, 4, 2) == roots).all()
    assert not wide[:, [0, 3, 4]].any()


def test_an_empty_batch_writes_nothing() -> None:
    roots, *masks = evaluated(np.empty(0), np.empty((0, 2)))
    assert roots.shape == (0, 4, 2)
    assert all(mask.shape == (0,) for mask in masks)


@pytest.mark.parametrize(
    ("inputs", "outputs", "masks"),
    [
        ([np.ones((2, 2)), np.ones((2, 2))], [np.ones((8, 2))], [np.zeros(2, np.uint8)] * 2),
        ([np.ones((2, 1)), np.ones((3, 2))], [np.ones((8, 2))], [np.zeros(2, np.uint8)] * 2),
        ([np.ones((2, 1)), np.ones((2, 2))], [np.ones((2, 2))], [np.zeros(2, np.uint8)] * 2),
        ([np.ones((2, 1)), np.ones((2, 2))], [np.ones((8, 2), np.float32)], [np.zeros(2, np.uint8)] * 2),
        ([np.ones((2, 1)), np.ones((2, 2)).T[::-1].T], [np.ones((8, 2))], [np.zeros(2, np.uint8)] * 2),
        ([np.ones((2, 1)), np.ones((2, 2))], [np.ones((8, 2))], [np.zeros(2, np.uint8)]),
        ([np.ones((2, 1)), np.ones((2, 2))], [np.ones((8, 2))], [np.zeros(2)] * 2),
    ],
)
def test_arrays_that_do_not_fit_are_refused(
    inputs: list[Floats], outputs: list[Floats], masks: list[Bytes]
) -> None:
    with pytest.raises(ArgumentError):
        KERNEL(inputs, outputs, masks)


def test_programs_that_do_not_fit_are_refused() -> None:
    program = FIRST
    other = trace(lambda row: {"root": sqrt(where_less(0.0, row, row, 0.0))}, {"row": (2,)})
    for arguments in (
        (program, other, TABLE, ("rough", "positive"), "rough"),
        (program, program, TABLE[:3], ("rough", "positive"), "rough"),
        (program, program, ((1.0,),) * 4, ("rough", "positive"), "rough"),
        (program, program, TABLE, ("positive",), "rough"),
        (program, program, TABLE, ("rough", "positive"), "nothing"),
    ):
        with pytest.raises(CompileError):
            Variants(*arguments)
    with pytest.raises(CompileError, match="4 variants and 2 lanes"):
        emit_variants(VARIANTS, host(), Settings(2))
