"""Functions of NumPy on traced arrays give what they give on numbers, up to rounding."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynx.errors import TraceError
from dynx.simd.cache import load_kernel, program_recipe
from dynx.simd.trace import trace
from dynx.simd.user_code.arrays import MAX_SOLVED_SIZE, symbol_array, traced_array
from dynx.spatial.scalar import Floats
from tests.simd.interp import interpret

N = 4
TABLE = np.array([-1.0, 0.0, 0.5]), np.array([2.0, 1.0, -3.0])
MATRIX = np.arange(16.0).reshape(N, N) ** 1.5 + np.eye(N)

Function = Callable[[Any, Any], Any]
FUNCTIONS: dict[str, Function] = {
    "clip": lambda a, b: np.clip(a, -0.5, b + 1.0),
    "clip method": lambda a, b: a.clip(-0.5, 0.5) + np.clip(b, None, 1.0),
    "clip of an entry": lambda a, b: np.stack([np.clip(a[0], -0.1, 0.1), *b[1:]]),
    "minimum": lambda a, b: np.minimum(a, b) + np.minimum(a, 0.25) + np.minimum(-0.5, b),
    "maximum": lambda a, b: np.maximum(a, b) + np.maximum(a[0], 0.25),
    "sign": lambda a, b: np.sign(a) * abs(b) + np.sign(b[0]),
    "abs": lambda a, b: np.abs(a) + np.absolute(b) + abs(a[1]) + np.fabs(b),
    "where": lambda a, b: np.where(a > b, a, -b),
    "where with logic": lambda a, b: np.where((a > 0) & (b < 0.5) | ~(a <= b), b, 0.0),
    "where of an entry": lambda a, b: np.where(a[0] >= b[1], a, b),
    "where against division by zero": lambda a, b: np.where(a > 0.5, b / np.maximum(a - 0.5, 0.0), b),
    "xor": lambda a, b: np.where((a > 0) ^ (b > 0), 1.0, np.logical_not(a > 1) * 2.0),
    "equal": lambda a, b: (a == b) * b + (a != 0.25) * a + (a[0] == 0.5),
    "condition as a number": lambda a, b: (a > 0) * 3.0 - (b > 0) * a,
    "powers": lambda a, b: a**2 + b**3 - (2.0 + a * a) ** -1 + np.abs(b) ** 0.5 + np.power(a, 4) + a**0,
    "elementary": lambda a, b: np.sin(a) + np.cos(b) + np.exp(a) + np.tanh(b) + np.arctan(a) + np.sqrt(b * b),
    "angles": lambda a, b: np.arctan2(a, b) + np.arctan2(a, 0.3),
    "inverse sines": lambda a, b: np.arcsin(np.tanh(a)) + np.arccos(np.tanh(b)),
    "others": lambda a, b: np.tan(np.tanh(a)) + np.sinh(a) + np.cosh(b) + np.hypot(a, b) + np.deg2rad(a),
    "norms": lambda a, b: a / np.linalg.norm(a + 10.0) + np.linalg.norm(np.outer(a, b), axis=1),
    "extremes": lambda a, b: a * np.max(b) + b.min() + np.outer(a, b).max(axis=0),
    "any and all": lambda a, b: np.where(np.any(a > 1) | np.all(b > 0), a, b),
    "sums": lambda a, b: a * np.sum(b) + np.mean(a) + np.cumsum(b) + np.outer(a, b).sum(axis=1),
    "products": lambda a, b: a * np.dot(a, b) + MATRIX @ b + (a @ MATRIX) * np.inner(a, b),
    "cross": lambda a, b: np.concatenate([np.cross(a[:3], b[:3]), a[:1]]),
    "shapes": lambda a, b: np.hstack([np.vstack([a, b]).T[1], a[0], 1.0]) + np.zeros_like(a),
    "append": lambda a, b: np.append(a[1:], 2.0) + np.tile(b[:2], 2),
    "in place": lambda a, b: in_place(a.copy(), b),
    "scalars of NumPy": lambda a, b: np.float64(2.0) * a[0] + np.int64(3) * b - b[0] * np.float32(0.5),
    "table": lambda a, b: np.interp(a, *TABLE) + np.interp(b[0], *TABLE),
    "solve": lambda a, b: np.linalg.solve(MATRIX, a) + np.linalg.solve(definite(a, b), b),
    "solve with exchanged rows": lambda a, b: np.linalg.solve(np.roll(definite(a, b), 1, axis=0), b),
    "inverse": lambda a, b: np.linalg.inv(definite(a, b)) @ np.linalg.inv(MATRIX) @ b,
}  # fmt: skip


def in_place(x: Any, y: Any) -> Any:
    """Change an array in every way that keeps its size."""
    x += y
    x[0] = y[1]
    x[2:] *= 2.0
    np.maximum(x, 0.1, out=x)
    np.clip(x, None, 2.0, out=x)
    return x


def definite(a: Any, b: Any) -> Any:
    """Return a matrix whose condition number is small, of entries that are far from diagonal."""
    return np.outer(a, b) * 0.05 + np.diag(2.0 + a * a) + 0.3 * MATRIX / 60.0


def traced(function: Function, a: Floats, b: Floats, *, compiled: bool = False) -> Floats:
    """Return the result of a traced function, by the interpreter or by a kernel."""
    program = trace(
        lambda a, b: symbol_array(function(traced_array(a), traced_array(b))), {"a": (N,), "b": (N,)}
    )
    rows = [np.repeat(x[None], 16, axis=0) for x in (a, b)]
    if not compiled:
        return np.asarray(interpret(program, rows)[0][0])
    found = np.empty((16, program.outputs[0].size))
    load_kernel(program_recipe(program), lambda: program)(rows, [found])
    return np.asarray(found[0])


numbers = st.one_of(
    st.sampled_from([0.0, 1.0, -1.0, 0.5, -0.5, 0.25, 0.1]), st.floats(-3.0, 3.0, allow_subnormal=False)
)
rows = st.lists(numbers, min_size=N, max_size=N).map(np.array)


@pytest.mark.parametrize("name", FUNCTIONS)
@given(a=rows, b=rows)
def test_traced_functions_agree_with_numpy(name: str, a: Floats, b: Floats) -> None:
    with np.errstate(all="ignore"):
        expected = np.asarray(FUNCTIONS[name](a, b), dtype=np.float64)
    np.testing.assert_allclose(traced(FUNCTIONS[name], a, b), expected, rtol=1e-11, atol=1e-11)


@pytest.mark.parametrize("name", ["clip", "where with logic", "xor", "angles", "table", "solve"])
def test_kernels_agree_with_numpy(name: str) -> None:
    rng = np.random.default_rng(0)
    for _ in range(5):
        a, b = rng.normal(size=(2, N))
        got = traced(FUNCTIONS[name], a, b, compiled=True)
        np.testing.assert_allclose(got, FUNCTIONS[name](a, b), rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("position", [0, 1, 2, 3])
@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_invalid_numbers_propagate_as_in_numpy(position: int, bad: float) -> None:
    clean, dirty = np.array([0.3, -0.2, 0.7, 0.1]), np.array([0.5, 0.4, -0.6, 0.2])
    dirty[position] = bad
    names = ["clip", "minimum", "maximum", "where", "where with logic", "condition as a number"]
    for a, b in ((clean, dirty), (dirty, clean)):
        for name in names:
            with np.errstate(all="ignore"):
                expected = FUNCTIONS[name](a, b)
            np.testing.assert_array_equal(traced(FUNCTIONS[name], a, b), expected)
        for check in (np.isnan, np.isfinite, np.isinf):

            def checked(a: Any, b: Any, check: Any = check) -> Any:
                return check(a) * 1.0

            np.testing.assert_array_equal(traced(checked, a, b), check(a))


REFUSED: dict[str, tuple[Function, str]] = {
    "if": (lambda a, b: a if a[0] > 0 else b, "branches on a traced value"),
    "min": (lambda a, b: np.stack([min(a[0], b[0])]), r"use np\.where, np\.minimum"),
    "and": (lambda a, b: np.where((a[0] > 0) and (b[0] > 0), a, b), "branches on a traced value"),
    "np.array": (lambda a, b: np.clip(np.array([a[0], b[0]]), -1, 1), r"np\.stack .* than by np\.array"),
    "float": (lambda a, b: a * float(b[0]), "needs the number"),
    "entry": (lambda a, b: np.zeros(N).__setitem__(0, a[0]), r"np\.zeros_like\(measurement\.v\)"),
    "in place": (lambda a, b: np.zeros(N).__iadd__(a), r"array of float64: make it by np\.zeros_like"),
    "index": (lambda a, b: a[int(b[0])], "needs the whole number"),
    "round": (lambda a, b: np.round(a), r"calls np\.round"),
    "log": (lambda a, b: np.log(a), r"calls np\.log, which has no traced form"),
    "modulo": (lambda a, b: a % 1.0, r"calls np\.remainder"),
    "eigenvalues": (lambda a, b: np.linalg.eigvalsh(np.outer(a, a)), r"calls np\.linalg\.eigvalsh"),
    "exponent": (lambda a, b: a**0.3, "has the exponent 0.3"),
    "traced exponent": (lambda a, b: 2.0**b, "traced exponent"),
    "norm": (lambda a, b: np.linalg.norm(a, 1), "wanted the 2-norm"),
    "singular": (lambda a, b: np.linalg.solve(np.zeros((N, N)), b), "singular matrix"),
    "shapes": (lambda a, b: np.linalg.solve(np.eye(3), b), r"shapes \(3, 3\) and \(4,\)"),
    "size": (lambda a, b: np.linalg.inv(a[0] * np.eye(MAX_SOLVED_SIZE + 1)), "solves for 19 unknowns"),
    "places": (lambda a, b: np.where(a > 0), r"wanted np\.where\(condition, x, y\)"),
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
def test_what_has_no_traced_form_is_refused_with_its_line(name: str) -> None:
    function, message = REFUSED[name]
    with pytest.raises(TraceError, match=message) as caught:
        traced(function, np.ones(N), np.ones(N))
    assert f"{__file__}:" in str(caught.value)


SUMMED: dict[str, Function] = {
    "sum": lambda a, b: np.sum(a) + b,
    "mean": lambda a, b: np.mean(a) + b,
    "average": lambda a, b: np.average(a) + b,
    "prod": lambda a, b: np.prod(a) + b,
    "cumsum": lambda a, b: np.cumsum(a),
    "dot": lambda a, b: np.dot(a, MATRIX),
    "inner": lambda a, b: np.inner(np.ones(N), b) + a,
    "vdot": lambda a, b: np.vdot(a, b) + a,
    "einsum": lambda a, b: np.einsum("i,i", a, b) + a,
    "tensordot": lambda a, b: np.tensordot(a, b, 1) + a,
    "linalg.norm": lambda a, b: np.linalg.norm(a) * b,
    "linalg.solve": lambda a, b: np.linalg.solve(MATRIX, a),
    "interp": lambda a, b: np.interp(a, *TABLE),
    "sinh": lambda a, b: np.sinh(a),
    "": lambda a, b: np.where(a > b, np.maximum(a, b), np.clip(b, -1.0, 1.0)) * np.sin(a) + b / 3.0,
}  # fmt: skip


@pytest.mark.parametrize("name", SUMMED)
def test_a_function_that_a_kernel_may_round_otherwise_is_noted(name: str) -> None:
    noted: list[str] = []

    def function(a: Any, b: Any) -> Any:
        found = symbol_array(SUMMED[name](traced_array(a), traced_array(b)))
        noted.append(a[0].graph.reordered)
        return found

    trace(function, {"a": (N,), "b": (N,)})
    # A sum is noted by the name of what it reduces by: np.add.
    assert [bool(each) for each in noted] == [bool(name)]
