"""Welds, ball joints and self-collision on every engine."""

from __future__ import annotations

import re

import numpy as np
import pytest
from numpy.testing import assert_allclose

import dynx
from dynx import Pose
from dynx.errors import ArgumentError, UnknownNameError
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


def test_a_weld_is_switched_on_and_off_and_saved(engine: str) -> None:
    at = Pose((0.0, 0.0, 0.5), (0.1, 0.2, 0.3))
    post = box("post", (0.1, 0.1, 0.1), pose=Pose((0.0, 0.0, 0.45)))
    body = box("body", (0.1, 0.1, 0.1), mass=1.0, pose=at)
    grip = Weld("post", "body", name="grip", active=False)
    scene = Scene("s", bodies=(post, body), constraints=(grip,))
    with World(scene, engine) as world:
        world.set_state(bodies={"body": (Pose((0.0, 0.0, 0.8), (0.1, 0.2, 0.3)), None)})
        world.step(20)
        caught = pose_of(world, "body")
        assert caught[2, 3] < 0.8 - 1e-3
        world.set_state(bodies={"body": (caught, None)})
        world.set_active("grip")
        assert (world.is_active("grip"), world.is_active(0)) == (True, True)
        assert_allclose(world.time, 0.02, atol=1e-12)
        world.step(50)
        assert_allclose(pose_of(world, "body"), caught, atol=HELD_WITHIN[engine])
        saved = world.save()
        world.step(20)
        later = pose_of(world, "body")
        world.reset()
        assert not world.is_active("grip")
        world.restore(saved)
        assert world.is_active("grip")
        world.step(20)
        np.testing.assert_array_equal(pose_of(world, "body"), later)
        world.set_active("grip", False)
        world.step(50)
        assert_allclose(later[2, 3] - pose_of(world, "body")[2, 3], 0.5 * 9.81 * 0.05**2, rtol=0.05)


def test_ends_that_do_not_collide_pass_through_each_other_while_they_are_tied(engine: str) -> None:
    post = box("post", (0.1, 0.1, 0.1))
    body = box("body", (0.1, 0.1, 0.1), mass=1.0, pose=Pose((0.0, 0.0, 0.101)))
    weld = Weld("post", "body", Pose((0.0, 0.0, 0.05)), name="in", active=False, collides=False)
    with World(Scene("s", bodies=(post, body), constraints=(weld,)), engine) as world:
        world.step(20)
        assert world.contacts("body")
        world.set_active("in")
        assert any(re.search(r"(50|49\.\d*) mm apart", note) for note in world.notes)
        world.step(200)
        assert not world.contacts("body")
        assert_allclose(pose_of(world, "body")[:3, 3], [0.0, 0.0, 0.05], atol=HELD_WITHIN[engine])


def test_notes_on_constraints_are_those_at_the_state_that_was_set(engine: str) -> None:
    ends = box("a", (0.1, 0.1, 0.1)), box("b", (0.1, 0.1, 0.1), mass=1.0, pose=Pose((0.5, 0.0, 0.0)))
    weld = Weld("a", "b", Pose((0.2, 0.0, 0.0)))
    with World(Scene("s", bodies=ends, constraints=(weld,)), engine) as world:
        assert any("300 mm apart" in note for note in world.notes)
        world.set_state(bodies={"b": (Pose((0.25, 0.0, 0.0)), None)})
        world.step()
        assert [note for note in world.notes if "apart" in note and "50 mm apart" in note]
        assert not any("300 mm apart" in note for note in world.notes)
        world.set_state(bodies={"b": (Pose((0.2, 0.0, 0.0)), None)})
        assert not any("apart" in note for note in world.notes)


def test_only_constraints_of_the_scene_are_switched(engine: str) -> None:
    body = box("body", (0.1, 0.1, 0.1), mass=1.0)
    held = (Weld("body", "world", name="grip"), PointToPoint("body", "world"))
    with World(Scene("s", bodies=(body,), constraints=held), engine) as world:
        with pytest.raises(UnknownNameError, match="no constraint 'grab' in s; known: grip"):
            world.set_active("grab")
        with pytest.raises(ArgumentError, match="constraint is '2'; wanted"):
            world.set_active(2)
        world.set_active("grip")
        world.set_active(1, False)
        assert (world.is_active(0), world.is_active(1)) == (True, False)
    with pytest.raises(ArgumentError, match="two constraints are called 'grip'"):
        Scene("s", bodies=(body,), constraints=(held[0], Weld("world", "body", name="grip")))


def test_wrenches_are_those_of_the_constraints_that_act(engine: str) -> None:
    body = box("body", (0.1, 0.1, 0.1), mass=2.0)
    grip = Weld("world", "body", name="grip", active=False)
    scene = Scene("s", bodies=(body,), constraints=(PointToPoint("body", "world", active=False), grip))
    with World(scene, engine, keep_last_step=True) as world:
        world.step()
        assert world.constraint_wrenches() == ()
        world.set_state(bodies={"body": (Pose(), None)})
        world.set_active("grip")
        world.step(100)
        (held,) = world.constraint_wrenches()
        assert (held.kind, held.a, held.b) == ("weld", "world", "body")
        assert_allclose(held.on_b[:3], [0.0, 0.0, 2.0 * 9.81], rtol=0.0, atol=0.02)
