"""The survey of sliding bodies, on some of them: means over an interval have a fraction of the spread."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path

import pytest

from benchmarks.surveys.sliding_forces import (
    DURATION,
    INTERVALS,
    SLIDERS,
    SPEED,
    STARTING,
    WEIGHT,
    main,
    sliding_scene,
    spreads,
)
from tests.world.engines import WORLDS

ENGINES = [name for name in WORLDS if find_spec(name) is not None]


@pytest.mark.parametrize("engine", ENGINES)
def test_the_mean_over_a_tenth_of_a_second_spreads_less_than_a_step(engine: str, tmp_path: Path) -> None:
    # The plate as a mesh, which rattles on every engine.
    single, *means = spreads(sliding_scene(SLIDERS[-1], tmp_path), engine, 2e-3)
    assert single > 0.01
    assert means[INTERVALS.index(0.1)] < 0.2 * single


def test_all_bodies_slide_while_forces_are_read() -> None:
    assert all(slider.friction * WEIGHT * (STARTING + DURATION) < SPEED for slider in SLIDERS)
    # None may tip: the load is at mu h ahead of the middle.
    assert all(slider.friction * slider.size[2] < min(slider.size[:2]) for slider in SLIDERS)


def test_the_table_has_a_line_for_each_engine_and_step(capsys: pytest.CaptureFixture[str]) -> None:
    main(["--engine", ENGINES[0], "--dt", "0.004", "0.002", "--count", "1"])
    lines = capsys.readouterr().out.splitlines()
    assert [line.count("|") for line in lines] == [7] * 4
    assert lines[3].startswith(f"| {ENGINES[0]} | 2 ms |")
