"""Modules that a fresh process loads until a first result: which rooms, how many modules, how many lines.

A ceiling is what was measured when it was last set, within `SLACK`. A flow that loads clearly less lowers it.
It rises only for new physics that every robot may have, as for springs and ball joints. `loaded_now` are the
exceptions: what is still loaded of the rooms that a flow does not need. An entry is deleted with its imports.
"""

from __future__ import annotations

import json
import subprocess
import sys
from dataclasses import dataclass
from functools import cache

import pytest

COUNT = """
import json, sys
modules = {n: m.__file__ for n, m in sys.modules.items() if n == "dynx" or n.startswith("dynx.")}
lines = sum(len(open(f, encoding="utf-8").read().splitlines()) for f in modules.values())
print(json.dumps([sorted(modules), lines]))
"""

ROBOT = "import dynx, numpy as np\nrobot = dynx.load('ur5')\nq = np.full(6, 0.3)\n"
ENGINE = ROBOT + "engine = dynx.backend('pinocchio', robot)\n"


SLACK = 0.05
"""Share by which a flow may lie below a ceiling before the ceiling is lowered."""


@dataclass(frozen=True)
class Flow:
    """What a program does first, the rooms it does not need, and ceilings of modules and lines."""

    program: str
    not_needed: tuple[str, ...]
    loaded_now: tuple[str, ...]
    modules: int
    lines: int


FLOWS = {
    "inverse dynamics": Flow(
        ENGINE + "engine.inverse_dynamics(q, q, q)",
        (
            "ik",
            "distance",
            "world",
            "sim",
            "control",
            "trajectory",
            "compiled",
            "simd",
            "doctor",
            "envs",
            "viewer",
        ),
        (),
        67,
        11960,
    ),
    "inverse kinematics": Flow(
        ENGINE + "engine.inverse_kinematics(engine.forward_kinematics(q, 'tool0'), 'tool0', q)",
        ("world", "sim", "ik.closed_forms"),
        (),
        101,
        19000,
    ),
    "simulate": Flow(
        ROBOT + "from dynx import control\n"
        "law = control.ComputedTorque(robot, natural_frequency=20.0)\n"
        "dynx.simulate(robot, law, robot.neutral(), duration=0.01, plant='pinocchio')",
        (
            "world.camera",
            "steppers.camera",
            "world.queries",
            "world.world",
            "world.scene.documents",
            "sim.compiled_loop",
            "sim.record.formats",
            "compiled.kernels",
            "compiled.step",
            "simd.kernel",
            "distance",
            "ik",
            "envs",
        ),
        (),
        152,
        25650,
    ),
    "step of a box": Flow(
        "from dynx.world import Scene, World, box\n"
        "World(Scene('box', bodies=(box('box', (0.1, 0.1, 0.1), mass=1.0),)), 'mujoco').step()",
        ("ik", "sim", "envs", "doctor"),
        (),
        104,
        19300,
    ),
    "step of the cart-pole": Flow(
        "import gymnasium, dynx.envs\n"
        "environment = gymnasium.make('dynx/CartPole-v0')\n"
        "environment.reset(seed=0)\n"
        "environment.step(environment.action_space.sample())",
        ("distance", "ik", "world.camera", "steppers.camera", "compiled", "simd"),
        (),
        112,
        20700,
    ),
}


@cache
def loaded(name: str) -> tuple[frozenset[str], int]:
    """Return the modules of dynx that a fresh process has loaded after a flow, and their lines."""
    run = [sys.executable, "-c", FLOWS[name].program + "\n" + COUNT]
    modules, lines = json.loads(subprocess.run(run, capture_output=True, text=True, check=True).stdout)
    return frozenset(modules), lines


@pytest.mark.parametrize("name", FLOWS)
def test_a_flow_loads_no_room_that_it_does_not_need(name: str) -> None:
    flow, (modules, _) = FLOWS[name], loaded(name)
    needless = {
        room for room in flow.not_needed for module in modules if f"{module}.".startswith(f"dynx.{room}.")
    }
    assert needless == set(flow.loaded_now)


@pytest.mark.parametrize("name", FLOWS)
def test_a_flow_loads_as_many_modules_and_lines_as_its_ceilings_say(name: str) -> None:
    flow, (modules, lines) = FLOWS[name], loaded(name)
    for count, ceiling in ((len(modules), flow.modules), (lines, flow.lines)):
        assert (1.0 - SLACK) * ceiling <= count <= ceiling, (len(modules), lines)
