"""Roots of quadratic polynomials in cosine and sine, made from known ones."""

from __future__ import annotations

import numpy as np
from hypothesis import example, given
from hypothesis import strategies as st

from dynx.ik.closed_forms.candidates import SIGNS
from dynx.ik.closed_forms.subproblems import conic_root

angles = st.floats(-np.pi, np.pi)
numbers = st.floats(-10.0, 10.0)


@given(st.lists(angles, min_size=4, max_size=4), st.floats(0.01, 100.0))
@example([0.0, -1.0, -0.75, -0.75], 1.0)
@example([-2.0281937545415776, -0.876342042178837, -1.4200551607570175, -1.4200551607570175], 1.0)
def test_four_real_roots_are_found(roots: list[float], scale: float) -> None:
    # The chords through two pairs of points on the circle are two factors of the polynomial.
    (a, b, c), (d, e, f) = (
        (np.cos(0.5 * (x - y)), -np.cos(0.5 * (x + y)), -np.sin(0.5 * (x + y)))
        for x, y in (roots[:2], roots[2:])
    )
    conic = tuple(
        np.array(scale * k) for k in (a * d, a * e + b * d, a * f + c * d, b * e, b * f + c * e, c * f)
    )
    found = conic_root(conic, SIGNS[::2, 0], SIGNS[::2, 1])  # type: ignore[arg-type]
    for root in roots:
        distance = np.hypot(found.cos - np.cos(root), found.sin - np.sin(root)).min()
        # The distance of a multiple root is the root of the error, of the order of its multiplicity.
        order = sum(np.hypot(np.cos(x) - np.cos(root), np.sin(x) - np.sin(root)) < 0.3 for x in roots)
        assert distance < 1e3 * (1e-14) ** (1.0 / order)


@given(st.lists(numbers, min_size=6, max_size=6))
def test_results_are_unit_vectors_for_any_coefficients(coefficients: list[float]) -> None:
    found = conic_root(*(tuple(np.array(k) for k in coefficients), *SIGNS[::2, :2].T))
    np.testing.assert_allclose(found.cos**2 + found.sin**2, 1.0, rtol=1e-12)
