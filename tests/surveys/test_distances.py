"""The survey of engines finds what its table says, on a few pairs."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.surveys.distance_engines import ENGINES
from benchmarks.surveys.distances import measure, table

CAUSES = {
    "bullet": (("Box", "Hull", "separated"), 1e-5, 1e-12),
    "mujoco": (("Cylinder", "Cylinder", "overlapping"), 1e-7, 1e-10),
    "coal": (("Cylinder", "Cylinder", "separated"), 1e-8, 1e-8),
    "drake": (("Box", "Capsule", "overlapping"), 1e-7, 1e-5),
}
"""For each engine a case, the error that it exceeds as it comes, and the error that it stays below after the
change, if there is one; no case of touching shapes, whose errors depend on the rounding of the processor."""


@pytest.mark.parametrize("engine", ENGINES)
def test_a_changed_setting_removes_the_error(engine: str) -> None:
    pytest.importorskip({"bullet": "pybullet", "drake": "pydrake"}.get(engine, engine))
    case, least, most = CAUSES[engine]
    run = ENGINES[engine]()
    rows = [measure({engine: run}, np.random.default_rng(seed), case) for seed in range(6)]
    errors = np.array([row.errors[engine] for row in rows])
    assert errors[:, 0].max() > least
    assert errors[:, 1].max() < most
    assert f"| {case[0]}, {case[1]} |" in "\n".join(table(rows, [engine]))
