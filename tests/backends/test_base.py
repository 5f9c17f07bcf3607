from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from dynx.backends import Backend
from dynx.backends.hooks import solve_mass_matrix
from dynx.engines.pinocchio.backend import PinocchioBackend
from dynx.errors import NotFiniteError, SingularMassMatrixError
from dynx.model import Joint, Link, Model
from dynx.rbd import rnea
from dynx.reference.backend import ReferenceBackend
from tests.backends.robots import (
    chain,
    mixed_robot,
)

KINDS: tuple[type[Backend], ...] = (PinocchioBackend, ReferenceBackend)
each_kind = pytest.mark.parametrize("kind", KINDS)


@each_kind
def test_a_joint_that_moves_no_inertia_is_named(kind: type[Backend]) -> None:
    arm = chain(2)
    links = [*arm.links, Link("feather")]
    spinner = Joint("spinner", "continuous", "link2", "feather")
    engine = kind(Model.build("feathered", links, [*arm.joints, spinner]))
    # Without a torque the algorithm divides zero by zero, and with one something else by zero.
    for torque in (0.0, 1.0):
        with pytest.raises(SingularMassMatrixError, match="nothing that 'spinner' moves has inertia"):
            engine.forward_dynamics(np.zeros(3), np.zeros(3), np.full(3, torque))
    assert np.isfinite(engine.inverse_dynamics(np.zeros(3), np.ones(3), np.ones(3))).all()


@each_kind
def test_coordinates_that_cancel_each_other_are_named_as_such(kind: type[Backend]) -> None:
    """The massless base moves the arm, which has inertia; it and the first joint can move without the arm."""
    arm = chain(2)
    links = [Link("mount"), *arm.links[1:], Link("feather")]
    joints = [replace(arm.joints[0], parent="mount"), *arm.joints[1:]]
    floating = kind(Model.build("light base", links[:-1], joints, base="floating"))
    with pytest.raises(SingularMassMatrixError, match=r": 'base', '\w+' can move together so"):
        floating.forward_dynamics(floating.model.neutral(), np.zeros(8), np.zeros(8))
    spinner = Joint("spinner", "continuous", "link2", "feather")
    both = kind(Model.build("both", links, [*joints, spinner], base="floating"))
    with pytest.raises(SingularMassMatrixError, match=r"that 'spinner' moves .*, and 'base', '\w+' can"):
        both.forward_dynamics(both.model.neutral(), np.zeros(9), np.zeros(9))


def test_solving_with_a_singular_mass_matrix_raises() -> None:
    with pytest.raises(SingularMassMatrixError, match="is singular"):
        solve_mass_matrix(np.zeros((2, 2)), np.ones(2))


def test_an_acceleration_that_is_not_finite_is_named() -> None:
    model = mixed_robot()
    backend = ReferenceBackend(model)
    q, v = model.neutral(), np.zeros(model.nv)
    with pytest.raises(NotFiniteError, match=r"^a\b"):
        backend.frame_acceleration(q, v, np.full(model.nv, np.nan), model.root, point=[0.1, 0.0, 0.0])


def test_the_reference_evaluates_a_batch_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    shapes = []

    def counted(mechanism: Any, q: Any, v: Any, a: Any) -> Any:
        shapes.append(np.shape(q))
        return inverse_dynamics(mechanism, q, v, a)

    inverse_dynamics = rnea.inverse_dynamics
    monkeypatch.setattr(rnea, "inverse_dynamics", counted)
    model = mixed_robot()
    q = model.random(0, 6).reshape(2, 3, model.nq)
    found = ReferenceBackend(model).inverse_dynamics(q, np.ones(model.nv), np.ones(model.nv))
    assert found.shape == (2, 3, model.nv)
    assert len(shapes) == 1
