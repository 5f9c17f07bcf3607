"""The generators of the survey of ``dynx same``: what they keep and change, by MuJoCo."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.surveys.robot_texts import Robot, split_file, write
from benchmarks.surveys.robot_truth import coupling_difference, text_difference
from benchmarks.surveys.same_plants import PLANTS, SEEN, NotHereError, seen_size
from benchmarks.surveys.same_rewrites import (
    DROPPED,
    REWRITES,
    UNCOUPLED,
    Rewritten,
    align_chains,
    decorate,
    draw_style,
    fit_formats,
    random_robot,
)

mujoco = pytest.importorskip("mujoco")


def ball_robot(seed: int, floating: bool) -> Robot:
    """Return a random robot with a ball joint, and with all else that MJCF can say."""
    rng = np.random.default_rng(seed)
    while True:
        robot = random_robot(rng)
        if any(joint.is_ball for joint in robot.joints) and not fit_formats(robot, {"mjcf"}):
            decorate(robot, rng, floating)
            return robot


@pytest.mark.parametrize("name", REWRITES)
@pytest.mark.parametrize("floating", [False, True])
def test_a_rewrite_keeps_mass_matrices_lengths_constraints_and_keyframes(name: str, floating: bool) -> None:
    robot = ball_robot(list(REWRITES).index(name), floating)
    rng = np.random.default_rng(1)
    it = Rewritten(robot.copy())
    REWRITES[name](it, rng, floating)
    align_chains(it)
    texts = write(robot, "mjcf", floating), write(it.robot, "mjcf", floating, draw_style(rng))
    seen = text_difference((robot, texts[0], "mjcf"), (it.robot, texts[1], "mjcf"), floating, 0, it.by)
    assert seen <= DROPPED
    assert coupling_difference((robot, texts[0]), (it.robot, texts[1]), floating, 0, it.by)[0] <= UNCOUPLED


@pytest.mark.parametrize(
    "kind", [each for each in PLANTS if each.split()[0] in ("tendon", "equality", "keyframe")]
)
def test_a_planted_difference_shows_in_mujoco(kind: str) -> None:
    change, _ = PLANTS[kind]
    for seed in range(100):
        robot = ball_robot(seed, True)
        after = robot.copy()
        try:
            change(after, np.random.default_rng(seed), 1e-2)
        except NotHereError:
            continue
        break
    texts = [write(each, "mjcf", True) for each in (robot, after)]
    by = Rewritten(robot).by
    assert coupling_difference((robot, texts[0]), (after, texts[1]), True, 0, by)[0] > SEEN


def test_a_file_that_is_split_compiles_to_the_same_robot() -> None:
    text = write(ball_robot(0, True), "mjcf", True)
    main, parts = split_file(text)
    models = [
        mujoco.MjModel.from_xml_string(text),
        mujoco.MjModel.from_xml_string(main, {name: part.encode() for name, part in parts.items()}),
    ]
    assert len(parts) > 2
    for name in ("body_inertia", "geom_pos", "jnt_pos", "tendon_range", "eq_data", "key_qpos"):
        first, second = (getattr(model, name) for model in models)
        np.testing.assert_array_equal(first, second)


def test_a_moved_ball_joint_shows_in_mujoco() -> None:
    robot = ball_robot(0, False)
    after = robot.copy()
    PLANTS["ball centre"][0](after, np.random.default_rng(0), 1e-2)
    seen, moved = seen_size(robot, after, False, 0)
    assert max(seen, moved) > SEEN
