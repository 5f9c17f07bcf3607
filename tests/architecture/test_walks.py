"""The walks of docs/architecture.md: each flow calls its functions in the order of the page."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable
from pathlib import Path
from types import FrameType
from typing import Any

import gymnasium
import numpy as np
import pytest

import dynx
import dynx.envs
from dynx.control import ComputedTorque
from dynx.doctor import diagnose
from dynx.world import World, read_scene
from tests.conftest import needs_examples
from tests.oracles.closed_form import MODELS

PAGE = Path(__file__).parents[2] / "docs" / "architecture.md"
PACKAGE = Path(dynx.__file__).parent
STEP = re.compile(r"^\d+\. `(.+?)\.py`, `(\w+)`: ", re.MULTILINE)
LONGEST, SHORT = 18, {"Load a robot and compute torques": 12, "A step of a world": 12}
"""Largest number of files to read."""


def load_and_compute() -> None:
    model = dynx.load("ur5")
    with dynx.backend("pinocchio", model) as engine:
        engine.inverse_dynamics(np.zeros(6), np.zeros(6), np.zeros(6))


def find_causes() -> None:
    diagnose(MODELS / "six_axis_arm.urdf", engines=["pinocchio", "pybullet"])


def simulate() -> None:
    model = dynx.load("ur5")
    controller = ComputedTorque(model, kp=100.0, kd=20.0)
    dynx.simulate(model, controller, np.zeros(6), q0=np.full(6, 0.1), duration=0.3)


def step_a_world() -> None:
    with World(read_scene("standing"), engine="mujoco") as world:
        world.step(2)


def solve_inverse_kinematics() -> None:
    with dynx.backend("pinocchio", dynx.load("ur5")) as engine:
        engine.inverse_kinematics(engine.forward_kinematics(np.full(6, 0.3), "tool0"), "tool0")


def step_an_environment() -> None:
    env = gymnasium.make("dynx/CartPole-v0", engine="mujoco")
    env.reset(seed=0)
    env.step(env.action_space.sample())
    env.close()


FLOWS: dict[str, Callable[[], None]] = {
    "Load a robot and compute torques": load_and_compute,
    "Find why engines differ": find_causes,
    "Simulate": simulate,
    "A step of a world": step_a_world,
    "Inverse kinematics": solve_inverse_kinematics,
    "A step of an environment": step_an_environment,
}


def walk_of(title: str) -> list[tuple[str, str]]:
    """Return the modules and functions of a walk, in the order of the page."""
    text = PAGE.read_text(encoding="utf-8").split("\n## Walks\n")[1].split("\n## ")[0]
    return STEP.findall(text.split(f"\n### {title}\n")[1].split("\n### ")[0])


def calls_of(flow: Callable[[], None], among: list[tuple[str, str]]) -> list[tuple[str, str]]:
    """Return the calls of some functions while a flow runs, in their order."""
    called: list[tuple[str, str]] = []
    by_path = {(str(PACKAGE / f"{module}.py"), name): (module, name) for module, name in among}

    def record(frame: FrameType, event: str, _: Any) -> None:
        if event == "call":
            step = by_path.get((frame.f_code.co_filename, frame.f_code.co_name))
            if step is not None:
                called.append(step)

    sys.setprofile(record)
    try:
        flow()
    finally:
        sys.setprofile(None)
    return called


@needs_examples
@pytest.mark.parametrize("title", FLOWS)
def test_the_functions_of_a_walk_are_called_in_its_order(title: str) -> None:
    walk = walk_of(title)
    calls = iter(calls_of(FLOWS[title], walk))
    for step in walk:
        assert step in calls, f"{step} is not called after the steps before it"


@pytest.mark.parametrize("title", FLOWS)
def test_a_walk_is_short_and_enters_no_room_twice(title: str) -> None:
    modules = [module for module, _ in walk_of(title)]
    rooms = [module.split("/")[0] for module in modules]
    entered = [room for k, room in enumerate(rooms) if k == 0 or rooms[k - 1] != room]
    assert len(entered) == len(set(entered)) > 1
    assert len(set(modules)) <= SHORT.get(title, LONGEST)
