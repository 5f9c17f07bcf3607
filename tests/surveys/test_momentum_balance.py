"""A sample of ``python -m benchmarks.surveys.momentum_balance``, which measures 12 robots."""

from __future__ import annotations

import pytest

from benchmarks.surveys.momentum_balance import BARS, exceeding, measure, scene_of
from benchmarks.surveys.sensors import BASES, Worst
from dynx.model.tree import Base

for package in ("mujoco", "pydrake", "pybullet", "pinocchio"):
    pytest.importorskip(package)


@pytest.mark.long_cases
@pytest.mark.parametrize("engine", BARS)
@pytest.mark.parametrize("base", BASES)
@pytest.mark.parametrize("name", ["a1", "panda"])
def test_base_contacts_constraints_and_weight_are_the_rate_of_momentum(
    name: str, base: Base, engine: str
) -> None:
    worst: Worst = {}
    touched: dict[str, int] = {}
    measure(scene_of(name, base, 0), engine, worst, touched)
    floats = [f"{engine}: floating base"] if base == "floating" else []
    assert sorted(worst) == sorted([f"{engine}: robot", f"{engine}: bodies", *floats])
    assert not exceeding(worst), worst
    assert touched[engine]
