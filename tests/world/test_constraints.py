"""Welds, ball joints and self-collision on every engine."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

import dynx
from dynx import Pose
from dynx.spatial.scalar import Floats
from dynx.world import PointToPoint, Scene, SceneRobot, Weld, World, box
from dynx.world.scene.robots import LinkFrames
from tests.world.engines import WORLDS

pytestmark = pytest.mark.parametrize("engine", [*WORLDS, "dynx"])
HELD_WITHIN = {"pybullet": 2e-3, "mujoco": 1e-3, "drake": 1e-4, "dynx": 1e-5}
"""Distance [m] from the pose or point at which a constraint to the world holds a body, by engine."""


def pose_of(world: World, name: str) -> Floats:
    return world.state.bodies[name].T_world_body


def test_a_weld_keeps_the_relative_pose_of_the_start(engine: str) -> None:
    bodies = (
        box("a", (0.2, 0.2, 0.2), mass=2.0, twist=(0, 0, 0, 0.3, 0.2, 0.5)),
        box("b", (0.1, 0.3, 0.1), mass=1.0, pose=Pose((0.5, 0.1, 0.2), (0.3, -0.4, 0.8))),
    )
    with World(Scene("s", bodies=bodies, constraints=(Weld("a", "b"),)), engine) as world:
        before = np.linalg.inv(pose_of(world, "a")) @ pose_of(world, "b")
        world.step(300)
        after = np.linalg.inv(pose_of(world, "a")) @ pose_of(world, "b")
    assert_allclose(after, before, atol=5e-3)


def test_a_body_welded_to_the_world_stays(engine: str) -> None:
    start = Pose((0.3, -0.2, 1.0), (0.2, 0.5, -0.7))
    scene = Scene(
        "s", bodies=(box("a", (0.2, 0.2, 0.2), mass=2.0, pose=start),), constraints=(Weld("world", "a"),)
    )
    with World(scene, engine) as world:
        world.step(300)
        assert_allclose(pose_of(world, "a"), start.matrix, atol=HELD_WITHIN[engine])


@pytest.mark.parametrize("world_first", [False, True])
def test_a_body_hangs_on_a_point(engine: str, world_first: bool) -> None:
    at, above = (0.3, 0.0, 0.0), (0.3, 0.0, 1.0)
    hanging = PointToPoint("world", "a", above, at) if world_first else PointToPoint("a", "world", at, above)
    scene = Scene(
        "s", bodies=(box("a", (0.1, 0.1, 0.1), mass=1.0, pose=Pose((0, 0, 1.0))),), constraints=(hanging,)
    )
    with World(scene, engine) as world:
        world.step(400)
        T = pose_of(world, "a")
    assert_allclose(T @ [*at, 1.0], [*above, 1.0], atol=HELD_WITHIN[engine])
    assert T[2, 3] < 0.9


def test_a_body_welded_to_a_link_moves_with_it(engine: str) -> None:
    model = dynx.load("ur5")
    q = np.array([0.3, -0.8, 1.2, 0.1, 0.4, 0.0])
    frames = LinkFrames(model)
    held = frames.pose(q, "tool0")
    scene = Scene(
        "s",
        robots=(SceneRobot("arm", model, q=tuple(q)),),
        bodies=(box("cup", (0.05, 0.05, 0.05), mass=0.2, pose=Pose.from_matrix(held)),),
        constraints=(Weld("arm/tool0", "cup"),),
        ignored=(("arm", "cup"),),
    )
    with World(scene, engine) as world:
        world.step(200)
        moved = frames.pose(world.state.robots["arm"].q, "tool0")
        assert np.linalg.norm(moved[:3, 3] - held[:3, 3]) > 0.05
        assert_allclose(pose_of(world, "cup"), moved, atol=1e-2)


def test_links_touch_one_another_only_where_asked(engine: str) -> None:
    model = dynx.load("ur5")
    # The forearm lies folded on the upper arm.
    q = (0.0, -1.0, 3.05, 0.0, 0.0, 0.0)
    found = []
    for asked in (False, True):
        robot = SceneRobot("arm", model, q=q, self_collision=asked)
        with World(Scene("s", robots=(robot,)), engine) as world:
            found.append({(contact.a, contact.b) for contact in world.contacts()})
    assert found[0] == set()
    assert found[1]
    assert all(scene_part.startswith("arm/") for pair in found[1] for scene_part in pair)
