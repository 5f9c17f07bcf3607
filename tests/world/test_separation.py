"""One distance of two motions for rollouts, worlds, environments and the viewer: what NumPy gives by part."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium import spaces

import dynx
from dynx.envs.distance import engine_distance
from dynx.errors import ArgumentError
from dynx.sim import Rollout, ScenePlant
from dynx.viewer.motion import motion_of_rollout, motion_of_run, motion_separation
from dynx.world import Scene, SceneRobot, box, separation
from dynx.world.record import Channel, Record, position_channel

ARM = dynx.load("double_pendulum")
CUBE = box("cube", (0.1, 0.1, 0.1), mass=1.0, pose=dynx.Pose((3.0, 0.0, 2.0)))
SCENE = Scene("arm and cube", robots=(SceneRobot("arm", ARM, q=(0.4, -0.3)),), bodies=(CUBE,))


def fallen(engine: str, dt: float) -> Rollout:
    return dynx.simulate(
        ARM, None, q0=[0.4, -0.3], plant=ScenePlant(SCENE, "arm", engine=engine), duration=0.1, dt=dt
    )


def test_rollouts_worlds_and_motions_of_the_viewer_are_apart_as_numpy_says() -> None:
    pytest.importorskip("mujoco")
    pytest.importorskip("pybullet")
    ours, theirs = fallen("mujoco", 1e-3), fallen("pybullet", 1e-3)
    apart = dynx.compare(ours, theirs, rerun=False).separation
    assert ours.surroundings is not None
    assert theirs.surroundings is not None
    cubes = ours.surroundings.bodies["cube"][:, :3, 3] - theirs.surroundings.bodies["cube"][:, :3, 3]
    expected = np.column_stack([np.abs(ours.q - theirs.q), np.linalg.norm(cubes, axis=1)])
    np.testing.assert_array_equal(apart.distances, expected)
    assert apart.names == (*ARM.joint_names, "cube")
    assert apart.units == ("rad", "rad", "m")
    np.testing.assert_array_equal(apart.distance, expected.max(axis=1))
    assert apart.parts == tuple(apart.names[k] for k in expected.argmax(axis=1))

    compared = dynx.compare(SCENE, ["mujoco", "pybullet"], 0.1, samples=20)
    (worlds,) = compared.separations
    assert worlds.records == ("mujoco", "pybullet")
    column = worlds.names.index("cube")
    paths = [np.array([s.bodies["cube"].T_world_body[:3, 3] for s in run.states]) for run in compared.runs]
    np.testing.assert_array_equal(worlds.distances[:, column], np.linalg.norm(paths[0] - paths[1], axis=1))
    shown = motion_separation(*(motion_of_run(SCENE, run) for run in compared.runs))
    np.testing.assert_allclose(shown.distance, worlds.distance, rtol=0.0, atol=1e-13)
    pair = motion_separation(motion_of_rollout(ours), motion_of_rollout(theirs))
    np.testing.assert_allclose(
        pair.distances[:, pair.names.index("cube")],
        np.interp(pair.times, ours.t, expected[:, -1]),
        rtol=0.0,
        atol=1e-13,
    )


class Counting(gymnasium.Env[Any, Any]):
    """The number of the step, and on the engine `other` that number squared."""

    observation_space = spaces.Box(-1e3, 1e3, (2,), np.float64)
    action_space = spaces.Box(-1.0, 1.0, (), np.float64)

    def __init__(self, engine: str) -> None:
        self._power = 2 if engine == "other" else 1

    def reset(self, *, seed: int | None = None, options: Any = None) -> tuple[Any, dict[str, Any]]:
        super().reset(seed=seed)
        self._step = 0
        return np.zeros(2), {}

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        self._step += 1
        return np.array([0.0, float(self._step**self._power)]), 0.0, False, False, {}


def test_episodes_are_apart_as_their_observations_are() -> None:
    found = engine_distance(Counting, ["one", "other"], seeds=[0], steps=5, tolerance=3.0)
    (difference,) = found.differences
    assert (difference.step, difference.entry, difference.largest) == (3, 1, 20.0)


def test_a_value_that_is_not_a_number_is_infinitely_far() -> None:
    t = np.linspace(0.0, 1.0, 5)
    rows = np.where(np.arange(5)[:, None] == 3, np.nan, np.zeros((5, 2)))
    ours = Record("ours", t, {"y": Channel(rows, ("a", "b"), ("", ""))})
    theirs = Record("theirs", t, {"y": Channel(np.zeros((5, 2)), ("a", "b"), ("", ""))})
    assert separation(ours, theirs).first_beyond(1e9) == (0.75, "a")
    assert separation(ours, replace(theirs, times=t[:3], channels=theirs.channels)).largest == 0.0


def test_records_without_a_common_part_are_refused() -> None:
    t = np.linspace(0.0, 1.0, 5)
    ours = Record("ours", t, {"cube": position_channel("cube", np.zeros((5, 3)))})
    theirs = Record("theirs", t, {"ball": position_channel("ball", np.zeros((5, 3)))})
    with pytest.raises(ArgumentError, match="no part in common: cube; ball"):
        separation(ours, theirs)


def test_old_names_of_the_comparison_name_the_new_one() -> None:
    for package, name in (
        (dynx, "compare_rollouts"),
        (dynx.sim, "compare_rollouts"),
        (dynx.world, "compare_worlds"),
    ):
        with pytest.raises(ImportError, match=r"is now dynx\.compare"):
            getattr(package, name)


def test_the_text_of_a_separation_is_one_short_line() -> None:
    t = np.linspace(0.0, 1.0, 11)
    nothing = separation(Record("ours", t, {}), Record("theirs", t, {}))
    assert repr(nothing) == "<Separation of ours and theirs: nothing compared>"
    ours = Record("ours", t, {"cube": position_channel("cube", np.outer(t, (0.0, 0.3, 0.4)))})
    theirs = Record("theirs", t, {"cube": position_channel("cube", np.zeros((11, 3)))})
    text = "<Separation of ours and theirs: at most 0.5 m, cube at 1 s, 11 times>"
    assert repr(separation(ours, theirs)) == text


def test_records_without_parts_have_no_farthest() -> None:
    empty = Record("a", np.array([0.0, 1.0]), {})
    apart = separation(empty, replace(empty, name="b"))
    assert (apart.largest, apart.parts) == (0.0, ("", ""))
    assert apart.first_beyond(-1.0) is None
    with pytest.raises(ArgumentError, match="a and b have no part in common"):
        _ = apart.farthest
