"""A sample of the robots of ``python -m benchmarks.surveys.joint_wrenches``, which measures 30."""

from __future__ import annotations

import pytest

from benchmarks.surveys.joint_wrenches import BAR, BULLET_BAR, ROBOTS, Moving, errors
from dynx.model.loading import load
from dynx.model.tree import Base

pytest.importorskip("mujoco")
pytest.importorskip("pydrake")
pytest.importorskip("pybullet")

SAMPLE = ("allegro_right_hand", "bolt", "talos", "ur5_gripper")
"""A hand, a robot with rotors without mass, a humanoid, and an arm with mimic joints."""


@pytest.mark.long_cases
@pytest.mark.parametrize("base", ["fixed", "floating"])
@pytest.mark.parametrize("name", SAMPLE)
def test_joint_wrenches_are_what_the_engines_measure(name: str, base: Base) -> None:
    found = errors(Moving.draw(load(name, base=base), 1), ("pinocchio", "mujoco"))
    assert {"pinocchio", "mujoco", "sensors of MuJoCo", "sensors of Bullet"} <= set(found)
    assert ("reactions of Drake" in found) == (name != "bolt")
    for way, size in found.items():
        assert size < (BULLET_BAR if way == "sensors of Bullet" else BAR), way


def test_thirty_robots_are_measured() -> None:
    assert len(set(ROBOTS)) == 30
