"""The intrinsics of a camera are those of its rays."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynx.steppers.camera import Camera

SIDES = st.integers(1, 2000)


@given(SIDES, SIDES, st.floats(0.01, 3.0))
def test_the_intrinsics_take_the_rays_to_the_columns_and_rows(width: int, height: int, angle: float) -> None:
    camera = Camera(field_of_view=angle, size=(width, height))
    columns, rows = camera.rays()
    K = camera.intrinsics
    for column in {0, width // 2, width - 1}:
        for row in {0, height - 1}:
            pixel = K @ [columns[column], rows[row], 1.0]
            assert pixel == pytest.approx([column, row, 1.0], abs=1e-9 * max(width, height))
    # The upper and the lower edge lie half a pixel beyond the first and the last row.
    edge = np.tan(0.5 * angle)
    assert (K @ [0.0, -edge, 1.0])[1] == pytest.approx(-0.5, abs=1e-9 * height)
