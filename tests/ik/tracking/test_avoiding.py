"""Paths that keep bodies apart: what is OK or JUMPED is clear by another engine."""

from __future__ import annotations

import numpy as np
import pytest

import dynx
from dynx.ik.tracking import TrackStatus
from dynx.model import Pose
from dynx.world import World, box
from tests.ik.avoidance.scenes import ENGINE_ERROR, arm, engine, least_room, scene

MARGIN = 0.015
PANDA = np.array([0.0, 0.3, 0.0, -1.8, 0.0, 2.1, 0.8, 0.02])


def test_redundant_joints_move_around_a_post() -> None:
    """The elbow of the plain path meets the post; with `avoid` every sample is OK and clear."""
    panda = engine("panda")
    line = np.tile(panda.forward_kinematics(PANDA, "panda_hand"), (60, 1, 1))
    line[:, 1, 3] += np.linspace(0.0, 0.3, 60)
    plain = panda.track(line, "panda_hand", PANDA)
    assert plain
    elbow = panda.forward_kinematics(plain.q[-1], "panda_link4")[:3, 3] + [0.0, 0.12, 0.0]
    described = scene("panda", box("post", (0.1, 0.1, 0.5), pose=Pose(tuple(elbow.tolist()))))
    avoidance = described.avoidance(margin=MARGIN)
    followed = panda.track(line, "panda_hand", PANDA, avoid=avoidance)
    assert followed
    assert np.abs(np.diff(followed.q, axis=0)).max() <= 0.2
    with World(described, "mujoco") as world:
        assert min(least_room(world, avoidance, q) for q in plain.q[::5]) < -ENGINE_ERROR
        assert min(least_room(world, avoidance, q) for q in followed.q) >= -ENGINE_ERROR


@pytest.mark.parametrize("jumps", [True, False])
@pytest.mark.parametrize("name", ["compiled", "pinocchio"])
def test_a_path_through_a_box(name: str, jumps: bool) -> None:
    """Inside nothing is reached, and q stays clear; behind it the path goes on, or jumps."""
    q = np.array([0.6, -1.3, 1.6, -1.9, -np.pi / 2, 0.0])
    described = scene("ur5", box("box", (0.12, 0.12, 0.5), pose=Pose((0.55, 0.1, 0.2))))
    avoidance = described.avoidance(margin=MARGIN)
    with dynx.backend(name, arm("ur5")) as ur5:
        T = ur5.forward_kinematics(q, "ee_link")
        line = np.tile(T, (40, 1, 1))
        line[:, :3, 3] += np.linspace(0.0, 1.0, 40)[:, None] * ([0.55, -0.3, T[2, 3]] - T[:3, 3])
        plain = ur5.track(line, "ee_link", q, jumps=jumps)
        followed = ur5.track(line, "ee_link", q, jumps=jumps, avoid=avoidance)
    assert plain.ok.all()
    assert followed.ok[0]
    held = followed.status == TrackStatus.HELD
    assert held.any()
    assert (followed.position_error[~held] <= 1e-6).all()
    if not jumps:
        assert not (followed.status == TrackStatus.JUMPED).any()
        assert followed.reason.startswith("in collision: where the target is reached, ")
        assert "box" in followed.message
    with World(described, "mujoco") as world:
        assert min(least_room(world, avoidance, q) for q in plain.q) < -ENGINE_ERROR
        assert min(least_room(world, avoidance, q) for q in followed.q) >= -ENGINE_ERROR


def test_a_start_is_chosen_from_which_the_path_is_clear() -> None:
    described = scene("ur5", box("box", (0.3, 0.3, 0.3), pose=Pose((0.3, -0.35, 0.3))))
    avoidance, ur5 = described.avoidance(margin=MARGIN), engine("ur5")
    q = np.array([0.6, -1.3, 1.6, -1.9, -np.pi / 2, 0.0])
    line = np.tile(ur5.forward_kinematics(q, "ee_link"), (20, 1, 1))
    line[:, 2, 3] += np.linspace(0.0, 0.1, 20)
    followed = ur5.track(line, "ee_link", avoid=avoidance)
    assert followed
    assert all(avoidance.is_clear(ur5, each) for each in followed.q)
