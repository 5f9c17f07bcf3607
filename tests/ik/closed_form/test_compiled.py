"""The compiled closed form has the solutions of NumPy's."""

from __future__ import annotations

import numpy as np
import pytest

from dynx.backends import backend
from dynx.ik import IKSolutions, closed_form
from dynx.model import Model
from dynx.model.loading import load
from tests.ik.closed_form.arms import angle_difference, random_arm

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


def test_the_compiled_backend_uses_it() -> None:
    model, frame = ARMS[0]
    with backend("compiled", model) as engine:
        T = engine.forward_kinematics([0.3, -0.5, 0.9, 0.4, 0.8, 0.2], frame)
        found = engine.inverse_kinematics(T, frame, all_solutions=True)
    assert isinstance(found, IKSolutions)
    assert len(found.q) == 8
