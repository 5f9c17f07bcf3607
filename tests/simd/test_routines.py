"""Routines called by tables, compared with the programs they are traced from."""

from __future__ import annotations

import numpy as np
import pytest

from dynx.simd.call_table import CallTable, TableKernel, load_routines
from dynx.simd.program import Port
from dynx.simd.routines import Routine, RoutineSet
from dynx.simd.target import host
from dynx.spatial.scalar import Array

X, Y = 0, 1


def _scan() -> RoutineSet:
    """Routines that read a number, add c x + sin x to a sum, and write the sum and its square."""
    routines = {
        "read": Routine.of(lambda x: {"x": x}, {"x": (X, (1,))}, {"x": "vectors"}),
        "add": Routine.of(
            lambda c, x, total: {"total": total + c[0] * x[0] + np.sin(x)[0]},
            {"c": ("constants", (1,)), "x": ("vectors", (1,)), "total": ("vectors", ())},
            {"total": "vectors"},
        ),
        "zero": Routine.of(lambda: {"total": np.asarray(0.0)}, {}, {"total": "vectors"}),
        "write": Routine.of(_powers, {"total": ("vectors", ())}, {"powers": Y}),
    }
    return RoutineSet(routines, 2, cleared=(Y,))


def _powers(total: Array) -> dict[str, Array]:
    return {"powers": np.stack([total, total * total])}


def _kernel(factors: list[float]) -> TableKernel:
    routines = _scan()
    table = CallTable(routines)
    x, total = table.reserve(1), table.reserve(1)
    table.call("zero", total)
    for column, factor in enumerate(factors):
        table.call("read", column, x)
        table.call("add", table.constants(np.array([factor])), x, total, total)
        table.call("write", total, 3 * column)
    inputs, outputs = [Port("x", (len(factors),))], [Port("y", (3 * len(factors),))]
    return TableKernel(table, inputs, outputs, load_routines(b"scan", routines))


@pytest.mark.parametrize("n", [1, 2, 3, 4, 5, 7, 8, 9, 16, 1000])
@pytest.mark.parametrize("threads", [1, 3])
def test_a_table_of_calls_is_evaluated_for_every_sample(n: int, threads: int) -> None:
    factors = [0.5, -2.0, 3.0, 0.25, 7.0]
    x = np.random.default_rng(0).uniform(-3.0, 3.0, (1000, 5))
    kernel = _kernel(factors)
    found, whole = np.full((n, 15), np.nan), np.full((1000, 15), np.nan)
    kernel([x[:n]], [found], threads=threads)
    kernel([x], [whole])
    sums = np.cumsum(np.array(factors) * x[:n] + np.sin(x[:n]), axis=1)
    expected = np.stack([sums, sums * sums, 0 * sums], axis=-1).reshape(n, 15)
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-13)
    np.testing.assert_array_equal(found, whole[:n])


def test_a_row_of_the_table_is_as_long_as_its_longest_call() -> None:
    routines = _scan()
    assert routines.table_width == 1 + len(("c", "x", "total", "sum"))
    table = CallTable(routines)
    table.call("zero", table.reserve(1))
    assert table.calls.shape == (1, routines.table_width)


def test_a_workspace_evaluates_one_sample_or_several() -> None:
    kernel, samples = _kernel([0.5, -2.0]), host().lanes + 3
    x = np.random.default_rng(1).uniform(-3.0, 3.0, (samples, 2))
    expected = np.empty((samples, 6))
    kernel([x], [expected])
    workspace = kernel.workspace(samples)
    workspace.input_rows[0][:] = x
    workspace.run_rows(samples)
    np.testing.assert_array_equal(workspace.output_rows[0], expected)
    workspace.inputs[workspace.input_slices[0]] = x[2].data
    workspace.run()
    np.testing.assert_array_equal(workspace.results[0], expected[2])


def test_the_same_code_serves_tables_of_any_size() -> None:
    for n in (1, 40):
        found = np.empty((3, 3 * n))
        _kernel([1.0] * n)([np.ones((3, n))], [found])
        np.testing.assert_allclose(found[:, 3 * n - 3], n * (1.0 + np.sin(1.0)))
