"""Inverse kinematics that keeps margins: every solution checked by another engine's distances."""

from __future__ import annotations

import pickle
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import dynx
from dynx.distance.avoidance import Avoidance
from dynx.errors import ArgumentError
from dynx.model import Pose
from dynx.spatial.scalar import Floats
from dynx.world import Scene, SceneBody, SceneRobot, Weld, World, box
from tests.ik.avoidance.scenes import ARMS, ENGINE_ERROR, TABLE, arm, engine, least_room, scene

MARGIN = 0.015


@st.composite
def boxes(draw: st.DrawFn) -> tuple[SceneBody, ...]:
    """Draw one to three boxes within the reach of an arm."""
    bodies = []
    for k in range(draw(st.integers(1, 3))):
        size = [draw(st.floats(0.05, 0.4)) for _ in range(3)]
        angle, radius = draw(st.floats(-np.pi, np.pi)), draw(st.floats(0.25, 0.7))
        xyz = (radius * np.cos(angle), radius * np.sin(angle), draw(st.floats(0.0, 0.8)))
        bodies.append(box(f"box{k}", size, pose=Pose(xyz, (0.0, draw(st.floats(0.0, 1.5)), angle))))
    return tuple(bodies)


@pytest.mark.long_cases
@pytest.mark.parametrize("name", ARMS)
def test_solutions_keep_their_margins_by_another_engine(name: str) -> None:
    compiled, frame = engine(name), ARMS[name]
    counts = {"REACHED": 0, "IN_COLLISION": 0}

    @settings(max_examples=5, deadline=None)
    @given(boxes(), st.integers(0, 2**20))
    def check(bodies: tuple[SceneBody, ...], seed: int) -> None:
        described = scene(name, *bodies)
        avoidance = described.avoidance(margin=MARGIN)
        q = arm(name).random(seed, 3)
        targets = compiled.forward_kinematics(q, frame)
        found = compiled.inverse_kinematics(targets, frame, avoid=avoidance, max_restarts=48)
        with World(described, "mujoco") as world:
            for k, target in enumerate(targets):
                status = found.status[k]
                counts[status] += 1
                # Whether it is clear or not: the target is reached, within the limits.
                reached = compiled.forward_kinematics(found.q[k], frame)
                np.testing.assert_allclose(reached, target, atol=3e-6)
                assert (found.q[k] >= arm(name).lower).all()
                assert (found.q[k] <= arm(name).upper).all()
                room = least_room(world, avoidance, found.q[k])
                if found.success[k]:
                    assert room >= -ENGINE_ERROR
                else:
                    assert found.collision is not None
                    assert room <= ENGINE_ERROR or _overlaps(avoidance, found.q[k], name)
                    assert any(
                        f"{a} and {b}" in found.collision[k] for a, b in map(avoidance.names, avoidance.pairs)
                    )
                # All solutions of the closed form are tried, so that one that exists is found.
                if name == "ur5" and avoidance.is_clear(compiled, q[k]):
                    assert found.success[k]

    check()
    assert counts["REACHED"]


def _overlaps(avoidance: Avoidance, q: Floats, name: str) -> bool:
    """Return whether links overlap more than at the neutral configuration, which MuJoCo does not measure."""
    violated = avoidance.violated(engine(name), q)
    return any(each.pair.margin < 0.0 for each in violated)


def test_redundant_joints_move_away_from_an_obstacle() -> None:
    """Without another start, only the null space leads away from the post beside the elbow."""
    panda, frame = engine("panda"), ARMS["panda"]
    q = arm("panda").clip([0.0, 0.3, 0.0, -1.8, 0.0, 2.1, 0.8, 0.02])
    target = panda.forward_kinematics(q, frame)
    elbow = panda.forward_kinematics(q, "panda_link4")[:3, 3] + [0.0, 0.08, 0.0]
    described = scene("panda", box("post", (0.1, 0.1, 0.1), pose=Pose(tuple(elbow.tolist()))))
    avoidance = described.avoidance(margin=MARGIN)
    plain = panda.inverse_kinematics(target, frame, q, max_restarts=0)
    assert plain.success
    assert not avoidance.is_clear(panda, plain.q)
    found = panda.inverse_kinematics(target, frame, q, avoid=avoidance, max_restarts=0)
    assert found.success
    assert found.restarts == 0
    with World(described, "mujoco") as world:
        assert least_room(world, avoidance, plain.q) < -MARGIN - ENGINE_ERROR
        assert least_room(world, avoidance, found.q) >= -ENGINE_ERROR


@pytest.mark.parametrize("name", ["pinocchio", "compiled"])
def test_the_bodies_that_prevent_a_solution_are_named(name: str) -> None:
    """Behind a wall each solution is blocked; in the table the target itself. Neither is unreachable."""
    described = scene("ur5", box("wall", (0.02, 3.0, 3.0), pose=Pose((0.35, 0.0, 1.3))))
    with dynx.backend(name, arm("ur5")) as ur5:
        target = np.diag([1.0, -1.0, -1.0, 1.0])
        target[:3, 3] = 0.6, 0.1, 0.2
        behind = ur5.inverse_kinematics(target, "ee_link", avoid=described)
        assert behind.status == "IN_COLLISION"
        assert not behind
        every = ur5.inverse_kinematics(target, "ee_link", all_solutions=True)
        assert "solutions of the closed form" in behind.message
        assert "and wall" in behind.message
        assert min(np.abs(np.sin((q - behind.q) / 2.0)).max() for q in every.q) < 1e-6
        target[:3, 3] = 0.3, 0.1, -0.1
        sunk = ur5.inverse_kinematics(target, "ee_link", avoid=described)
        assert sunk.status == "IN_COLLISION"
        assert sunk.restarts == 0
        assert "and table" in sunk.message
        assert "every configuration that reaches the target" in sunk.message
        assert sunk.position_error <= 1e-6
        target[:3, 3] *= 10.0
        assert ur5.inverse_kinematics(target, "ee_link", avoid=described).status == "UNREACHABLE"


def test_what_the_target_decides_holds_for_every_solution() -> None:
    """Bodies that are fixed to the frame are as close to what does not move in all solutions of a target."""
    described = scene("ur5", box("box", (0.3, 0.3, 0.3), pose=Pose((0.45, 0.1, 0.2))))
    avoidance, ur5 = described.avoidance(margin=0.05), engine("ur5")
    sentences = set()
    for target in ur5.forward_kinematics(arm("ur5").random(21, 24), "ee_link"):
        found = ur5.inverse_kinematics(target, "ee_link", avoid=avoidance)
        every = ur5.inverse_kinematics(target, "ee_link", all_solutions=True)
        decided = "every configuration that reaches the target" in found.message
        sentences.add(decided)
        clear = [avoidance.is_clear(ur5, q) for q in every.q[every.success]]
        assert found.success == any(clear)
        if decided:
            for q in every.q[every.success]:
                assert any(
                    "arm/ee_link" in pair or "arm/wrist_3_link" in pair for pair in _violated(avoidance, q)
                )
    assert sentences == {True, False}


def _violated(avoidance: Avoidance, q: Floats) -> list[tuple[str, str]]:
    return [avoidance.names(each.pair) for each in avoidance.violated(engine("ur5"), q)]


def test_a_pair_that_the_joints_do_not_move_ends_the_search() -> None:
    """Joint 1, which alone moves link 1, turns the hand and the forearm that it meets alike."""
    panda, frame = engine("panda"), "panda_link1"
    avoidance = scene("panda").avoidance(margin=0.0)
    for q in arm("panda").random(9, 200):
        pairs = [avoidance.names(each.pair) for each in avoidance.violated(panda, q)]
        if pairs and not any(name.endswith(("link0", "link1", "table")) for pair in pairs for name in pair):
            break
    target = panda.forward_kinematics(arm("panda").random(5), frame)
    found = panda.inverse_kinematics(target, frame, q, avoid=avoidance)
    assert found.status == "IN_COLLISION"
    assert found.restarts == 0
    assert any(f"{a} and {b} overlap" in found.message for a, b in pairs)
    assert "the joints that move the frame do not change that" in found.message


def test_a_batch_has_the_results_of_its_samples() -> None:
    ur5, described = engine("ur5"), scene("ur5", box("box", (0.3, 0.3, 0.4), pose=Pose((0.4, 0.2, 0.1))))
    targets = ur5.forward_kinematics(arm("ur5").random(3, 12), "ee_link")
    found = ur5.inverse_kinematics(targets, "ee_link", avoid=described)
    assert 0 < found.success.sum() < 12
    assert f"{int((~found.success).sum())} only in collision" in found.message
    for k in (0, 5):
        alone = ur5.inverse_kinematics(targets[k], "ee_link", avoid=described)
        np.testing.assert_array_equal(alone.q, found.q[k])
        assert alone.status == found.status[k]


def test_preferences_choose_among_solutions_that_are_clear() -> None:
    panda, frame = engine("panda"), ARMS["panda"]
    avoidance = scene("panda", box("box", (0.3, 0.3, 0.4), pose=Pose((0.4, 0.2, 0.1)))).avoidance()
    goal = arm("panda").clip(arm("panda").neutral())
    q = next(q for q in arm("panda").random(8, 50) if avoidance.is_clear(panda, q))
    target = panda.forward_kinematics(q, frame)
    first = panda.inverse_kinematics(target, frame, avoid=avoidance)
    near = panda.inverse_kinematics(target, frame, avoid=avoidance, nearest=goal)
    free = panda.inverse_kinematics(target, frame, avoid=avoidance, maximize="manipulability")
    for found in (first, near, free):
        assert found.success
        assert avoidance.is_clear(panda, found.q)
    assert np.linalg.norm(near.q - goal) <= np.linalg.norm(first.q - goal)


def test_a_body_that_the_robot_carries_moves_with_it() -> None:
    """A rod in the gripper reaches the table where the gripper alone does not."""
    model, ur5 = arm("ur5"), engine("ur5")
    q = np.array([0.0, -1.3, 1.6, -1.9, -np.pi / 2, 0.0])
    target = ur5.forward_kinematics(q, "ee_link")
    rod = box("rod", (0.3, 0.02, 0.02), mass=0.1, pose=Pose((2.0, 0.0, 0.0)))
    hand = Weld("arm/ee_link", "rod", Pose((0.16, 0.0, 0.0)))
    empty = Scene(robots=[SceneRobot("arm", model)], bodies=[TABLE])
    carrying = Scene(robots=[SceneRobot("arm", model)], bodies=[TABLE, rod], constraints=[hand])
    held = carrying.avoidance()
    T_rod = ur5.forward_kinematics(q, "ee_link") @ Pose((0.16, 0.0, 0.0)).matrix
    lowest = T_rod[2, 3] - 0.5 * np.abs(T_rod[2, :3]) @ [0.3, 0.02, 0.02]
    near = {held.names(each.pair): each for each in held.near(ur5, q, beyond=1.0)}
    assert near["rod", "table"].separation.distance == pytest.approx(lowest + 0.07, abs=1e-9)
    target[2, 3] += 0.3 - (lowest + 0.07)
    assert ur5.inverse_kinematics(target, "ee_link", avoid=empty, nearest=q)
    assert ur5.inverse_kinematics(target, "ee_link", avoid=carrying, nearest=q)
    target[2, 3] -= 0.31
    assert ur5.inverse_kinematics(target, "ee_link", avoid=empty, nearest=q)
    held_low = ur5.inverse_kinematics(target, "ee_link", avoid=carrying)
    assert held_low.status == "IN_COLLISION"
    assert "rod and table" in held_low.message


def test_links_that_are_close_by_the_way_they_are_modelled() -> None:
    """Hulls of the Panda's forearm and hand overlap at the neutral configuration: said, and allowed."""
    panda = engine("panda")
    avoidance = scene("panda").avoidance(margin=0.01, self_margin=0.005)
    neutral = arm("panda").clip(arm("panda").neutral())
    assert avoidance.is_clear(panda, neutral)
    assert "overlap by" in avoidance.exceptions["arm/panda_link5", "arm/panda_link7"]
    margins = {avoidance.names(pair): pair.margin for pair in avoidance.pairs}
    assert margins["arm/panda_link5", "arm/panda_link7"] < 0.0
    assert margins["arm/panda_link2", "arm/panda_link7"] == 0.005
    assert margins["arm/panda_link7", "table"] == 0.01
    # Links that a joint connects, and a base that cannot leave the table.
    assert ("arm/panda_link1", "arm/panda_link2") not in margins
    assert ("arm/panda_link0", "table") not in margins
    # The first link turns 0.2 m above the table, whatever the joints do.
    high = scene("panda").avoidance(margin=0.3, self_margin=0.0)
    assert "kept so" in high.exceptions["arm/panda_link1", "table"]
    assert {high.names(pair): pair.margin for pair in high.pairs}["arm/panda_link1", "table"] > 0.15
    assert high.is_clear(panda, neutral)


@pytest.mark.parametrize(
    ("avoid", "message"),
    [
        (lambda: "table", "wanted a dynx.world.Scene or World"),
        (lambda: scene("panda"), "none with the joints and links of the backend's"),
        (lambda: _moved(), "at another base pose"),
        (lambda: scene("ur5").avoidance(margin=-0.1), r"margin is '?-0.1"),
        (lambda: Scene(bodies=[TABLE]).avoidance(), "no robot; add a SceneRobot, or use avoidance_for"),
    ],
    ids=["no scene", "another robot", "another place", "negative", "no robot"],
)
def test_what_cannot_be_avoided_is_refused(avoid: Any, message: str) -> None:
    with pytest.raises(ArgumentError, match=message):
        engine("ur5").inverse_kinematics(np.eye(4), "ee_link", avoid=avoid())


def _moved() -> Scene:
    return Scene(robots=[SceneRobot("arm", arm("ur5").with_base_pose(Pose((0.0, 0.0, 1.0))))])


def test_options_that_do_not_go_with_it_are_refused() -> None:
    described = scene("ur5")
    for options in ({"method": "engine"}, {"all_solutions": True}):
        with pytest.raises(ArgumentError, match="avoid"):
            engine("ur5").inverse_kinematics(np.eye(4), "ee_link", avoid=described, **options)


def test_a_scene_of_obstacles_has_the_robot_of_the_backend() -> None:
    target = engine("ur5").forward_kinematics(arm("ur5").random(4), "ee_link")
    alone = engine("ur5").inverse_kinematics(target, "ee_link", avoid=Scene(bodies=[TABLE]))
    with_robot = engine("ur5").inverse_kinematics(target, "ee_link", avoid=scene("ur5"))
    np.testing.assert_array_equal(alone.q, with_robot.q)
    assert alone.status == with_robot.status


def test_a_world_is_avoided_as_it_stands() -> None:
    """A box that starts elsewhere and stands in the way now."""
    model, ur5 = arm("ur5"), engine("ur5")
    block = box("block", (0.2, 0.2, 0.2), mass=1.0, pose=Pose((3.0, 0.0, 1.0)))
    described = Scene(robots=[SceneRobot("arm", model)], bodies=[TABLE, block])
    q = np.array([0.0, -1.3, 1.6, -1.9, -np.pi / 2, 0.0])
    target = ur5.forward_kinematics(q, "ee_link")
    with World(described, "mujoco") as world:
        assert ur5.inverse_kinematics(target, "ee_link", avoid=world)
        world.set_state(bodies={"block": (target, np.zeros(6))})
        found = ur5.inverse_kinematics(target, "ee_link", avoid=world)
        assert found.status == "IN_COLLISION"
        assert "and block" in found.message
        assert ur5.inverse_kinematics(target, "ee_link", avoid=described)
        now = world.avoidance(margin=0.03)
        met = {name for each in now.violated(ur5, q) for name in now.names(each.pair)}
        assert {"arm/ee_link", "block"} <= met


def test_avoidance_can_be_pickled() -> None:
    avoidance = scene("ur5").avoidance()
    again = pickle.loads(pickle.dumps(avoidance))
    q = arm("ur5").random(2)
    for one, other in zip(
        avoidance.near(engine("ur5"), q, 0.3), again.near(engine("ur5"), q, 0.3), strict=True
    ):
        assert one.separation.lower == other.separation.lower


def test_derivatives_of_distances() -> None:
    """They are those of central differences, where the nearest features do not change."""
    for name in ARMS:
        kinematics = engine(name)
        avoidance = scene(name, box("box", (0.2, 0.2, 0.2), pose=Pose((0.5, 0.2, 0.2)))).avoidance()
        q, h = arm(name).random(1), 1e-6
        near = [each for each in avoidance.near(kinematics, q, 0.4) if each.separation.lower > 0.02]
        assert len(near) > 3
        gradients = avoidance.gradients(kinematics, q, near)
        assert np.abs(gradients).max() > 0.1
        for k in range(arm(name).nv):
            step = np.eye(arm(name).nv)[k] * h
            ends = [
                {
                    each.pair: each.separation.distance
                    for each in avoidance.near(kinematics, q + s * step, 0.5)
                }
                for s in (1.0, -1.0)
            ]
            slopes = [(ends[0][each.pair] - ends[1][each.pair]) / (2.0 * h) for each in near]
            # Distances are C1 between convex bodies that are apart; faces make their second derivative large.
            np.testing.assert_allclose(gradients[:, k], slopes, atol=1e-4)
