from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from dynx.backends import Backend
from dynx.backends.arguments import Arguments
from dynx.engines.pinocchio.backend import PinocchioBackend
from dynx.errors import (
    ArgumentError,
    ShapeError,
    SingularMassMatrixError,
    UnknownNameError,
)
from dynx.model.numbers import MAX_MAGNITUDE
from tests.backends.robots import chain, motion

ENGINE = PinocchioBackend(chain(3))
FLOATING = PinocchioBackend(chain(3).with_base("floating"))
ZERO = np.zeros(3)


def test_an_invalid_quaternion_of_a_batch_is_named_by_its_index() -> None:
    q = np.tile(FLOATING.model.neutral(), (2, 3, 1))
    q[1, 2, 3:7] = 0.5, 0.0, 0.0, 0.0
    with pytest.raises(ArgumentError, match=r"q\[1, 2, 3:7\] is a quaternion .* of length 0\.5;"):
        FLOATING.gravity_torque(q)


def test_numbers_below_the_bound_are_accepted_though_their_norm_exceeds_it() -> None:
    tau = np.full(3, 0.9 * MAX_MAGNITUDE)
    assert np.linalg.norm(tau) > MAX_MAGNITUDE
    assert ENGINE._arguments.v(tau) is tau


def test_forward_kinematics_takes_names_only() -> None:
    number: Any = 3
    with pytest.raises(ArgumentError, match="frame is of type int"):
        ENGINE.forward_kinematics(ZERO, number)
    with pytest.raises(UnknownNameError, match="no frame 'lnik1'"):
        ENGINE.forward_kinematics(ZERO, "lnik1")


@pytest.mark.parametrize("engine", [ENGINE, PinocchioBackend(chain(3), validate=False)])
def test_leading_axes_must_broadcast(engine: Backend) -> None:
    q, v, _ = motion(engine.model, size=(2,))
    with pytest.raises(ShapeError, match=r"leading axes of \(2, 3\), \(5, 3\) do not broadcast"):
        engine.bias_torque(q, np.zeros((5, 3)))
    with pytest.raises(ShapeError, match=r"\(2, 3\), \(2, 3\), \(3, 3\) do not broadcast"):
        engine.inverse_dynamics(q, v, np.zeros((3, 3)))
    with pytest.raises(ShapeError, match="do not broadcast"):
        engine.inverse_dynamics(q, v, v, external_forces={"link1": np.zeros((5, 6))})
    tau = np.zeros((5, 3))
    for joint_dynamics in (False, True):
        with pytest.raises(ShapeError, match="do not broadcast"):
            engine.forward_dynamics(q, v, tau, joint_dynamics=joint_dynamics)
    for point in (None, (0.1, 0.2, 0.3)):
        with pytest.raises(ShapeError, match="do not broadcast"):
            engine.frame_velocity(q, tau, "link1", point=point)
        with pytest.raises(ShapeError, match="do not broadcast"):
            engine.frame_acceleration(q, v, tau, "link1", point=point)
        with pytest.raises(ShapeError, match="do not broadcast"):
            engine.jacobian_derivative(q, tau, "link1", point=point)


@pytest.mark.parametrize(
    ("rows", "where"),
    [([2], r"at sample \[2\]: no"), ([1, 2], r"at sample \[1\] \(and 1 more\): no")],
)
def test_samples_without_an_acceleration_are_named(rows: list[int], where: str) -> None:
    a = np.zeros((4, 3))
    a[rows, 1] = np.nan
    with pytest.raises(SingularMassMatrixError, match=where):
        Arguments(chain(3)).finite_acceleration(a)
