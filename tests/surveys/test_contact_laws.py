"""The survey of the laws of contact, on some of its cases, and its bars."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.surveys.contact_laws import BARS, main, resting, slider


def test_some_cases_keep_every_law(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--slides", "1", "--scenes", "1", "--rest", "0.0005"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split("  ")[0] for line in lines] == list(BARS)


def test_no_body_that_slides_would_tip() -> None:
    rng = np.random.default_rng(2)
    for _ in range(50):
        body, friction, speed, _ = slider(rng)
        lower = 2.0 * body.pose.matrix[2, 3]
        shape = body.shapes[0].shape
        width = min(shape.size[:2]) if hasattr(shape, "size") else 2.0 * getattr(shape, "radius", 0.0)
        assert friction * lower < width
        assert np.linalg.norm(body.twist) == pytest.approx(speed)


def test_slopes_are_below_the_angle_of_friction() -> None:
    for name, scene, _ in resting(1.0):
        x, _, z = scene.gravity
        assert abs(x / z) <= 0.99 * 0.5 + 1e-12, name
