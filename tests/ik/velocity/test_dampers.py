"""Velocities that keep bodies apart: distances along a motion, by another engine as well."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from dynx.distance.avoidance import Avoidance
from dynx.errors import ArgumentError
from dynx.ik.velocity import VelocityResult, VelocityTask
from dynx.model import Pose
from dynx.spatial.scalar import Floats
from dynx.world import Scene, World, box
from tests.ik.avoidance.scenes import ENGINE_ERROR, arm, engine, least_room, scene

pytest.importorskip("daqp")

DT = 0.01
CURVATURE = 0.5 * DT**2 * 1.5**2
"""What a step neglects of a distance [m]: half of the square of dt times that of the speed (1.5 rad/s) times
the reach (1 m)."""
FRAMES = {"ur5": "ee_link", "panda": "panda_hand"}
STARTS = {
    "ur5": np.array([0.0, -1.3, 1.6, -1.9, -np.pi / 2, 0.0]),
    "panda": np.array([0.0, 0.3, 0.0, -1.8, 0.0, 2.1, 0.8, 0.02]),
}


def cell(name: str, y: float = -0.325) -> Scene:
    """Return an arm on a table beside a wall, whose face is at y [m]."""
    return scene(name, box("wall", (0.6, 0.05, 0.8), pose=Pose((0.5, y - 0.025, 0.4))))


def to_wall(described: Scene, q: Floats) -> float:
    """Return the distance of the Panda from the wall [m]."""
    avoidance = described.avoidance(margin=0.0)
    near = avoidance.near(engine("panda"), q, 1.0)
    return min(each.separation.lower for each in near if "wall" in avoidance.names(each.pair))


def run(
    name: str, avoidance: Avoidance | None, target: Floats, steps: int, **options: Any
) -> tuple[Floats, list[VelocityResult]]:
    """Return the configurations of a motion towards a target, and the results of its steps."""
    q, configurations, results = STARTS[name], [STARTS[name]], []
    task = VelocityTask(FRAMES[name], target=target, gain=4.0)
    for _ in range(steps):
        found = engine(name).velocity_ik(q, task, dt=DT, avoid=avoidance, **options)
        q = q + DT * found.v
        configurations.append(q)
        results.append(found)
    return np.array(configurations), results


@pytest.mark.parametrize("name", FRAMES)
def test_the_margin_is_kept_on_the_way_into_an_obstacle(name: str) -> None:
    """The target is in the wall: the arm stops before it, where it otherwise runs into it."""
    described, kinematics = cell(name), engine(name)
    avoidance = described.avoidance(margin=0.02)
    target = kinematics.forward_kinematics(STARTS[name], FRAMES[name])
    target[:3, 3] = 0.5, -0.35, 0.3
    plain, _ = run(name, None, target, 80)
    safe, results = run(name, avoidance, target, 80)
    with World(described, "mujoco") as world:
        assert min(least_room(world, avoidance, q) for q in plain[::4]) < -0.02
        rooms = [least_room(world, avoidance, q) for q in safe]
    assert min(rooms) >= -CURVATURE - ENGINE_ERROR
    assert rooms[-1] <= 5e-3
    assert any("wall" in pair for pair in results[-1].held_back)
    assert not any(found.too_fast for found in results)
    assert all(found.success for found in results)


def test_bodies_that_are_too_close_part() -> None:
    """From within the margin the distance grows back at the rate of the gain."""
    described, panda = cell("panda", -0.13), engine("panda")
    task = VelocityTask("panda_hand")
    q = STARTS["panda"]
    avoidance = described.avoidance(margin=to_wall(described, q) + 0.03, self_margin=0.0)
    lacks = []
    for _ in range(40):
        violated = avoidance.violated(panda, q)
        lacks.append(max([0.0, *(each.pair.margin - each.separation.lower for each in violated)]))
        found = panda.velocity_ik(q, task, dt=DT, avoid=avoidance, avoid_gain=10.0)
        assert not found.too_fast
        q = q + DT * found.v
    assert lacks[0] == pytest.approx(0.03)
    assert lacks[-1] <= 0.05 * lacks[0]
    for before, after in pairwise(lacks):
        assert after <= (1.0 - 10.0 * DT) * before + CURVATURE


def test_dampers_come_before_hard_tasks() -> None:
    described, panda = cell("panda"), engine("panda")
    avoidance = described.avoidance(margin=0.02)
    down = VelocityTask("panda_hand", velocity=[0.0, -2.0, 0.0, 0.0, 0.0, 0.0], hard=True)
    q = STARTS["panda"]
    outcomes = []
    for _ in range(40):
        found = panda.velocity_ik(q, down, dt=DT, velocity_limit=10.0, avoid=avoidance)
        outcomes.append(found.success)
        q = q + DT * found.v
    assert outcomes[0]
    assert not outcomes[-1]
    assert min(each.separation.lower - each.pair.margin for each in avoidance.near(panda, q, 0.1)) > -2e-3


def test_pairs_that_cannot_part_are_named() -> None:
    """With acceleration limits a robot that flies towards the wall cannot stop at once."""
    described, panda = cell("panda", -0.13), engine("panda")
    q = STARTS["panda"]
    toward = panda.velocity_ik(
        q, VelocityTask("panda_hand", velocity=[0.0, -2.0, 0.0, 0.0, 0.0, 0.0]), dt=DT, velocity_limit=10.0
    )
    found = panda.velocity_ik(
        q,
        VelocityTask("panda_hand"),
        dt=DT,
        velocity_limit=10.0,
        acceleration_limit=1.0,
        v0=toward.v,
        avoid=described.avoidance(margin=to_wall(described, q), self_margin=0.0),
    )
    assert found.too_fast
    assert all("wall" in pair for pair in found.too_fast)
    # The last joints brake before their limits.
    assert (np.abs(found.v - toward.v)[:6] <= 0.01 + 1e-12).all()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"avoid": "wall"}, "wanted a dynx.world.Scene or World"),
        ({"avoid_gain": 200.0}, "at most 1 / dt = 100"),
    ],
    ids=["avoid", "gain"],
)
def test_invalid_arguments(options: dict[str, Any], message: str) -> None:
    arguments: dict[str, Any] = {"avoid": cell("panda"), **options}
    with pytest.raises(ArgumentError, match=message):
        engine("panda").velocity_ik(STARTS["panda"], VelocityTask("panda_hand"), dt=DT, **arguments)
    assert arm("panda").nq == 8
