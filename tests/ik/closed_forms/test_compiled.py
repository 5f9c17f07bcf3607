"""The compiled closed form has the solutions of NumPy's."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from dynx.backends import Backend, backend
from dynx.errors import ArgumentError, ClosedError
from dynx.ik import IKSolutions, closed_form
from dynx.model import Model
from dynx.model.loading import load
from dynx.spatial.scalar import Floats
from tests.ik.closed_forms.arms import angle_difference, pose_difference, random_arm

REACHED = 1e-13
"""Error of a pose [1, m] that a solution of an arm of exact axes has at most."""

ARMS = [
    (load("ur5"), "tool0"),
    (random_arm("spherical: axes 2 and 3 parallel", np.random.default_rng(0)), "tool"),
    (random_arm("parallel: general", np.random.default_rng(1)), "tool"),
    (random_arm("spherical: general", np.random.default_rng(2)), "tool"),
]


@pytest.mark.parametrize(("model", "frame"), ARMS, ids=lambda each: getattr(each, "name", None))
def test_compiled_solutions_equal_those_of_numpy(model: Model, frame: str) -> None:
    rng = np.random.default_rng(0)
    with backend("reference", model) as engine:
        T = engine.forward_kinematics(np.array([model.random(rng) for _ in range(200)]), frame)
    T[::7, :3, 3] *= 1.5
    by_numpy = closed_form(model, frame).solve(T)
    form = closed_form(model, frame, compiled=True)
    compiled = form.solve(T)
    assert (by_numpy.counts == compiled.counts).all()
    # Rounding may number the roots of a quartic differently.
    difference = angle_difference(by_numpy.q[:, :, None], compiled.q[:, None])
    assert (
        difference.min(axis=2, where=compiled.success[:, None], initial=9.0)[by_numpy.success] < 1e-6
    ).all()
    for k in range(5):
        alone = form.solve(T[k])
        assert alone.branches == tuple(np.array(form.branches)[compiled.success[k]])
        assert (alone.q == compiled.q[k][compiled.success[k]]).all()


def all_of(engine: Backend, T: Floats, frame: str, position_tolerance: float = 1e-6) -> IKSolutions:
    """Return all solutions, which have their own type: mypy checks it here."""
    return engine.inverse_kinematics(T, frame, all_solutions=True, position_tolerance=position_tolerance)


def test_the_compiled_backend_has_the_same_solutions_alone_and_in_a_batch() -> None:
    model, frame = ARMS[0]
    rng = np.random.default_rng(5)
    q = np.array([model.random(rng) for _ in range(200)])
    # Singular poses, which are reviewed: the wrist aligned, the elbow straight.
    q[::20, 4], q[7::20, 2] = 0.0, 0.0
    with backend("compiled", model, threads=2) as engine, backend("pinocchio", model) as other:
        T = engine.forward_kinematics(q, frame)
        batch = all_of(engine, T, frame)
        assert (batch.q[~batch.success] == 0.0).all()
        for k in range(len(T)):
            # The first call of an option makes the call that the others take.
            alone = all_of(engine, T[k], frame)
            rows = batch.success[k]
            assert (alone.q == batch.q[k][rows]).all()
            assert (alone.position_error == batch.position_error[k][rows]).all()
            assert (alone.rotation_error == batch.rotation_error[k][rows]).all()
            assert alone.branches == tuple(np.array(batch.branches)[rows])
            assert (alone.arbitrary == batch.arbitrary[k][rows]).all()
            assert alone.success.all()
            assert alone.iterations.tolist() == alone.restarts.tolist() == [0] * len(alone)
            reached = other.forward_kinematics(alone.q, frame)
            assert pose_difference(reached, T[k]).max() < REACHED
            assert alone.arbitrary.any() or angle_difference(alone.q, q[k]).min() < 1e-5
    assert batch.arbitrary.any()
    assert (batch.position_error[batch.success] < REACHED).all()


def test_a_single_pose_is_checked_like_a_batch() -> None:
    model, frame = ARMS[0]
    with backend("compiled", model) as engine:
        T = engine.forward_kinematics([0.3, -0.5, 0.9, 0.4, 0.8, 0.2], frame)
        found = all_of(engine, T, frame)
        assert len(found) == 8
        short: Any = T.astype(np.float32)
        assert angle_difference(all_of(engine, short, frame).q, found.q).max() < 1e-4
        assert (all_of(engine, T.tolist(), frame).q == found.q).all()
        assert (all_of(engine, np.asfortranarray(T), frame).q == found.q).all()
        for wrong in (2.0 * T, np.where(T == 1.0, np.nan, T), -T, T.T):
            for target in (wrong, np.array([T, wrong])):
                with pytest.raises(ArgumentError, match="target"):
                    all_of(engine, target, frame)
        # Tolerances below the accuracy of the kernel are compared with the measured errors.
        assert len(all_of(engine, T, frame, position_tolerance=1e-30)) < 8
        far = T.copy()
        far[:3, 3] = 9.0
        assert len(all_of(engine, far, frame)) == 0
        assert "no solution" in repr(all_of(engine, far, frame))
        assert all_of(engine, np.empty((0, 4, 4)), frame).q.shape == (0, 8, 6)
    with pytest.raises(ClosedError):
        all_of(engine, T, frame)
