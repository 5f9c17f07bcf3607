"""Joint friction and armature in compiled stages, with the bits of the plain loop."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from dynx.control import PD
from dynx.model.loading import load
from tests.sim.test_compiled_loop import ARM, both


@pytest.mark.parametrize("plant", ["pinocchio", "compiled"])
@pytest.mark.parametrize(
    "options",
    [
        {"joint_friction": 1.0},
        {"joint_damping": 0.5, "joint_friction": 0.2, "joint_armature": 0.1, "substeps": 2},
    ],
)
@pytest.mark.parametrize("name", ["ur5", "solo12"])
def test_joint_friction_and_armature(plant: str, options: dict[str, Any], name: str) -> None:
    robot = load(name, base="floating" if name == "solo12" else "fixed")
    law, v0 = PD(robot, kp=5, kd=0.1), np.random.default_rng(0).normal(size=robot.nv)
    both(robot, law, robot.neutral(), plant=plant, v0=v0, duration=0.06, **options)


def test_smoothed_friction() -> None:
    both(ARM, PD(ARM, kp=5, kd=0.1), np.zeros(6), duration=0.06, joint_friction=0.1, friction_slip=1.0)
