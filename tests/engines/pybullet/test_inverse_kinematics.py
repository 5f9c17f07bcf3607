"""PyBullet's own inverse kinematics."""

from __future__ import annotations

import numpy as np
import pytest

from dynx.agreement.tolerances import TARGET_TOLERANCE
from dynx.engines.pybullet.backend import PyBulletBackend
from dynx.errors import ArgumentError, NotFiniteError
from dynx.model.loading import load
from dynx.model.tree import Base
from dynx.spatial.se3 import pose_error
from tests.backends.robots import BASES, chain, mixed_robot, motion

pytest.importorskip("pybullet")

NAN = float("nan")


@pytest.mark.parametrize(("name", "base", "frame"), [("ur5", "fixed", "tool0"), ("ur5", "floating", "tool0")])
def test_bullet_s_solver_reaches_targets_nearby(name: str, base: Base, frame: str) -> None:
    model = load(name, base=base)
    rng = np.random.default_rng(0)
    reached = 0
    with PyBulletBackend(model) as engine:
        for q in model.random(rng, 20):
            start = q.copy()
            start[-6:] += rng.uniform(-0.1, 0.1, 6)
            T = engine.forward_kinematics(q, frame)
            found = engine.engine_inverse_kinematics(T, frame, start, iterations=500)
            np.testing.assert_array_equal(found[:-6], q[:-6])
            off, turned = pose_error(T, engine.forward_kinematics(found, frame))
            reached += bool(
                np.linalg.norm(off) <= TARGET_TOLERANCE and np.linalg.norm(turned) <= TARGET_TOLERANCE
            )
    # The solver has no step control and misses some targets; with a wrong frame it would miss all.
    assert reached >= 10


@pytest.mark.parametrize("limits", [True, False])
@pytest.mark.parametrize("mimic", [False, True])
@pytest.mark.parametrize("base", BASES)
def test_bullet_s_solver_answers_for_every_frame(base: Base, mimic: bool, limits: bool) -> None:
    model = mixed_robot(base, mimic=mimic)
    with PyBulletBackend(model) as engine:
        q = motion(model)[0]
        for frame in model.frame_names:
            far = np.eye(4)
            far[:3, 3] = 100.0
            found = engine.engine_inverse_kinematics(far, frame, q, limits=limits)
            assert found.shape == (model.nq,)
            assert np.isfinite(found).all()


def test_bullet_s_solver_refuses_what_it_cannot_use() -> None:
    engine = PyBulletBackend(chain(2))
    with pytest.raises(ArgumentError, match="T_world_target"):
        engine.engine_inverse_kinematics(np.eye(4)[None], "link1", np.zeros(2))
    with pytest.raises(NotFiniteError):
        engine.engine_inverse_kinematics(np.full((4, 4), NAN), "link1", np.zeros(2))
