"""Motions that the page plays, and how far two of them are apart."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import dynx
from dynx.errors import ArgumentError
from dynx.viewer.motion import MAX_FRAMES, motion_of_reference, motion_of_rollout, motion_of_run, separation
from dynx.world.comparison import compare_worlds
from dynx.world.scene import read_scene

GOAL = [0.5, -0.4, 0.3, 0.2, -0.3, 0.4]


@pytest.fixture(scope="module")
def rollout() -> dynx.Rollout:
    """An arm on its way to a goal, from a start beside the reference."""
    arm = dynx.load("six_axis_arm")
    motion = dynx.trajectory.cycloidal(np.zeros(6), GOAL, duration=0.5)
    controller = dynx.control.ComputedTorque(arm, kp=100.0, kd=20.0)
    return dynx.simulate(arm, controller, motion, q0=np.full(6, 0.05), dt=1e-3)


def test_frames_begin_with_the_first_state_and_end_with_the_last(rollout: dynx.Rollout) -> None:
    motion = motion_of_rollout(rollout)
    assert motion.t[0] == rollout.t[0]
    assert motion.t[-1] == rollout.t[-1]
    assert len(motion.t) <= MAX_FRAMES
    with dynx.backend("reference", rollout.model) as engine:
        for k, state in ((0, 0), (-1, -1)):
            for link in rollout.model.links:
                expected = engine.forward_kinematics(rollout.q[state], link.name)
                found = motion.poses[f"{rollout.model.name}/{link.name}"][k]
                assert np.abs(found - expected).max() < 1e-12, link.name


def test_frames_are_found_by_time(rollout: dynx.Rollout) -> None:
    motion = motion_of_rollout(rollout)
    assert motion.frame_at(-1.0) == 0
    assert motion.frame_at(float(motion.t[3])) == 3
    assert motion.frame_at(0.5 * float(motion.t[3] + motion.t[4])) == 3
    assert motion.frame_at(1e9) == len(motion.t) - 1


def test_the_reference_is_another_motion_of_the_same_parts(rollout: dynx.Rollout) -> None:
    motion, reference = motion_of_rollout(rollout), motion_of_reference(rollout)
    assert reference is not None
    assert set(reference.poses) == set(motion.poses)
    distance, farthest = separation(motion, reference)
    assert distance[0] > 1e-3
    assert distance[-1] < distance[0]
    assert set(farthest) <= set(motion.poses)
    assert motion_of_reference(replace(rollout, reference=None)) is None


def test_a_motion_is_not_apart_from_itself(rollout: dynx.Rollout) -> None:
    motion = motion_of_rollout(rollout)
    assert not separation(motion, motion)[0].any()


def test_what_is_not_finite_is_refused(rollout: dynx.Rollout) -> None:
    q = rollout.q.copy()
    q[-1, 2] = np.nan
    with pytest.raises(ArgumentError, match=r"configuration number \d+ is not finite"):
        motion_of_rollout(replace(rollout, q=q))


def test_motions_without_a_common_part_are_refused(rollout: dynx.Rollout) -> None:
    motion = motion_of_rollout(rollout)
    renamed = replace(motion, poses={f"other/{name}": T for name, T in motion.poses.items()})
    with pytest.raises(ArgumentError, match="no part in common"):
        separation(motion, renamed)


def test_runs_of_a_scene_are_as_far_apart_as_their_comparison_says() -> None:
    pytest.importorskip("mujoco")
    pytest.importorskip("pybullet")
    scene = read_scene("slope")
    compared = compare_worlds(scene, ["pybullet", "mujoco"], 0.2, samples=10)
    a, b = (motion_of_run(scene, run) for run in compared.runs)
    assert np.allclose(separation(a, b)[0], compared.separations[0].distance, atol=1e-12)
