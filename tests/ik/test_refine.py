"""Secondary objectives: the nearest solution of all, and the null space, without harm to the target."""

from __future__ import annotations

from itertools import combinations, pairwise
from typing import Any

import numpy as np
import pytest

import dynx
from dynx.backends import Backend, backend
from dynx.errors import ArgumentError, NotFiniteError, ShapeError
from dynx.ik import refine
from dynx.model.loading import load
from dynx.spatial.scalar import Floats
from dynx.world import Scene, SceneRobot, box
from tests.oracles.closed_form import MODELS

TOLERANCE = 1e-6
"""Default tolerances of `inverse_kinematics` [m, rad]."""
SIX, SEVEN = load(MODELS / "six_axis_arm.urdf"), load(MODELS / "seven_axis_arm.urdf")
ENGINES = ("pinocchio", "compiled")


def manipulability(engine: Backend, q: Floats, frame: str) -> Floats:
    J = engine.jacobian(q, frame)
    return np.asarray(np.sqrt(np.linalg.det(J @ np.swapaxes(J, -1, -2))))


@pytest.mark.parametrize("name", ENGINES)
def test_the_nearest_of_all_solutions_is_returned(name: str) -> None:
    """The closed form names all solutions of six joints."""
    with backend(name, SIX) as engine:
        frame = SIX.frame_names[-1]
        targets, goals = engine.forward_kinematics(SIX.random(1, 6), frame), SIX.random(2, 6)
        found = engine.inverse_kinematics(targets, frame, nearest=goals)
        assert found.success.all()
        for k in range(6):
            every = engine.inverse_kinematics(targets[k], frame, goals[k], all_solutions=True)
            least = np.linalg.norm(every.q - goals[k], axis=-1).min()
            assert np.linalg.norm(found.q[k] - goals[k]) <= least + 1e-5
        alone = engine.inverse_kinematics(targets[3], frame, nearest=goals[3])
        np.testing.assert_array_equal(alone.q, found.q[3])
        np.testing.assert_array_equal(
            alone.q, engine.inverse_kinematics(targets[3], frame, nearest=goals[3]).q
        )


@pytest.mark.parametrize("name", ENGINES)
def test_the_null_space_of_seven_joints(name: str) -> None:
    """No solution beside the one returned is better, and the target is reached as before."""
    frame = SEVEN.frame_names[-1]
    with backend(name, SEVEN) as engine:
        q = SEVEN.random(4, 3)
        targets, goal = engine.forward_kinematics(q, frame), SEVEN.clip(SEVEN.neutral())
        plain = engine.inverse_kinematics(targets, frame)
        near = engine.inverse_kinematics(targets, frame, nearest=goal)
        free = engine.inverse_kinematics(targets, frame, maximize="manipulability")
        middle = engine.inverse_kinematics(targets, frame, maximize="limit_distance")
        for found in (near, free, middle):
            assert found.success.all()
            assert max(found.position_error.max(), found.rotation_error.max()) <= TOLERANCE
            assert (found.q >= SEVEN.lower).all()
            assert (found.q <= SEVEN.upper).all()

        def distance(q: Floats) -> Floats:
            return np.asarray(np.linalg.norm(q - goal, axis=-1))

        def share(q: Floats) -> Floats:
            half = 0.5 * (SEVEN.upper - SEVEN.lower)
            return np.asarray(np.linalg.norm((q - 0.5 * (SEVEN.upper + SEVEN.lower)) / half, axis=-1))

        others = (plain.q, q)
        assert all((distance(near.q) <= distance(other) + 1e-6).all() for other in others)
        assert all((share(middle.q) <= share(other) + 1e-6).all() for other in others)
        best = manipulability(engine, free.q, frame)
        assert all((best >= manipulability(engine, other, frame) - 1e-9).all() for other in others)
        # A start that is as near as possible stays.
        again = engine.inverse_kinematics(targets, frame, nearest=near.q)
        np.testing.assert_allclose(again.q, near.q, atol=1e-4)


def test_an_unreachable_target_keeps_its_proof() -> None:
    with backend("compiled", SEVEN) as engine:
        found = engine.inverse_kinematics([9.0, 0.0, 0.0], SEVEN.frame_names[-1], nearest=SEVEN.random(1))
        assert found.status == "UNREACHABLE"


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        ({"maximize": "manipulabilty"}, ArgumentError, "did you mean 'manipulability'"),
        ({"maximize": "manipulability", "nearest": np.zeros(7)}, ArgumentError, "one objective"),
        ({"maximize": "manipulability", "method": "engine"}, ArgumentError, "method 'dynx'"),
        ({"nearest": np.zeros(3)}, ShapeError, "nearest"),
        ({"nearest": np.full(7, np.nan)}, NotFiniteError, "nearest"),
        ({"nearest": np.zeros((2, 7))}, ShapeError, "do not broadcast"),
    ],
)
def test_invalid_objectives(options: dict[str, Any], error: type[Exception], message: str) -> None:
    with backend("compiled", SEVEN) as engine, pytest.raises(error, match=message):
        engine.inverse_kinematics(np.ones((3, 3)) * 0.2, SEVEN.frame_names[-1], **options)


@pytest.mark.parametrize("name", ["reference", "compiled"])
def test_further_starts_give_no_solution_that_was_tried_before(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A planar arm reaches a point in two ways, which each round of starts finds again."""
    rounds: list[list[Floats]] = []
    distinct = refine._distinct

    def recorded(found: Any, seen: Any, *others: Any) -> list[Floats]:
        new = distinct(found, seen, *others)
        # The first solution is a row of the result, into which the best is written.
        rounds.append([q.copy() for q in (*seen, *new)])
        return new

    monkeypatch.setattr(refine, "_distinct", recorded)
    ball = '<collision><geometry><sphere radius="0.02"/></geometry></collision>'
    joint = '<axis xyz="0 0 1"/><limit lower="-3" upper="3" effort="9" velocity="9"/><origin xyz="0.5 0 0"/>'
    model = dynx.load(
        '<robot name="arm"><link name="base"/><link name="upper"/><link name="lower"/>'
        f'<link name="tip">{ball}</link>'
        f'<joint name="a" type="revolute"><parent link="base"/><child link="upper"/>{joint}</joint>'
        f'<joint name="b" type="revolute"><parent link="upper"/><child link="lower"/>{joint}</joint>'
        '<joint name="c" type="fixed"><parent link="lower"/><child link="tip"/><origin xyz="0.4 0 0"/>'
        "</joint></robot>"
    )
    tip = "tip"
    with dynx.backend(name, model) as engine:
        target = engine.forward_kinematics([0.3, 0.9], tip)[:3, 3]
        wall = box("wall", (0.2, 0.2, 0.2), pose=dynx.Pose(tuple(target.tolist())))
        blocked = Scene("s", robots=(SceneRobot("arm", model),), bodies=(wall,))
        engine.inverse_kinematics(target, tip, avoid=blocked, max_restarts=120)
    assert len(rounds) >= 3
    for before, after in pairwise(rounds):
        assert len(before) <= len(after)
        np.testing.assert_array_equal(before, after[: len(before)])
    for a, b in combinations(rounds[-1], 2):
        assert np.abs(a - b).max() > 1e-6
