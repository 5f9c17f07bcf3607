"""The survey of the laws of contact, on some of its cases, and its bars."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from benchmarks.surveys import contact_laws
from benchmarks.surveys.contact_laws import BARS, Case, main, resting, slider
from dynx.distance import PlacedSolid, contact_points
from dynx.model.geometry import Plane


def test_some_cases_keep_every_law(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--slides", "1", "--scenes", "1", "--rest", "0.0005"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split("  ")[0] for line in lines] == list(BARS)


def test_an_interrupted_survey_keeps_its_cases_and_continues(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    record = tmp_path / "laws.jsonl"
    arguments = ["--slides", "0", "--scenes", "3", "--rest", "0", "--record", str(record)]
    measured, count = Case.measured, 0

    def interrupted(case: Case) -> contact_laws.MeasuredCase:
        nonlocal count
        count += 1
        if count == 3:
            raise KeyboardInterrupt
        return measured(case)

    monkeypatch.setattr(Case, "measured", interrupted)
    assert main(arguments) == 130
    assert capsys.readouterr().out.startswith("interrupted after 2 of 3 cases")
    assert len(record.read_text().splitlines()) == 2
    assert main(arguments) == 0
    assert count == 4
    assert "of 3 cases" in capsys.readouterr().out
    whole = [*arguments[:-2]]
    monkeypatch.setattr(Case, "measured", measured)
    assert main(whole) == 0
    alone = capsys.readouterr().out
    assert main(arguments) == 0
    assert capsys.readouterr().out == alone


def test_no_body_that_slides_would_tip(tmp_path: Path) -> None:
    rng = np.random.default_rng(2)
    kinds = set()
    for _ in range(50):
        body, friction, speed, _, tipping = slider(rng, tmp_path)
        assert friction < tipping
        assert np.linalg.norm(body.twist) == pytest.approx(speed)
        # Friction tips no body whose centre, moved by mu times its height, stays above the base.
        x, y, height = (body.pose.matrix @ np.append(body.inertial.origin.xyz, 1.0))[:3]
        placed = PlacedSolid(body.shapes[0].shape, body.pose)
        base = [each.point_b[:2] for each in contact_points(placed, PlacedSolid(Plane()), 1e-9, spares=True)]
        for angle in np.linspace(0.0, 2.0 * np.pi, 7):
            toward = np.array([np.cos(angle), np.sin(angle)])
            reach = max(np.array(point) @ toward for point in base) - toward @ (x, y)
            assert friction * height < reach
        kinds.add(type(body.shapes[0].shape).__name__)
    assert kinds == {"Box", "Cylinder", "Mesh"}


def test_slopes_are_below_the_angle_of_friction() -> None:
    for name, scene, _ in resting(1.0):
        x, _, z = scene.gravity
        assert abs(x / z) <= 0.99 * 0.5 + 1e-12, name
