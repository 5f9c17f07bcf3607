"""Forward dynamics of robots whose inertias no body can have: every regular mass matrix is solved.

Such a mass matrix may be indefinite, and elimination without pivoting then meets a pivot of zero although the
matrix is regular.
"""

from __future__ import annotations

import numpy as np
import pytest

from dynx.errors import SingularMassMatrixError
from dynx.model import Inertial, Joint, Link, Model, Pose
from tests.contract.conftest import Make

FREE_LINK = Model.build(
    "free link",
    [Link("base", Inertial(1.0, Pose((0.0, 0.0, 0.125)), ixx=0.0, iyy=0.0, izz=0.125, ixy=0.0625))],
    [],
    base="floating",
)
"""A link whose mass matrix has a negative eigenvalue of -0.06, and a condition number of 17."""

CROSSED = Model.build(
    "crossed",
    [Link("base"), Link("middle"), Link("tip", Inertial(0.0, ixy=0.5))],
    [
        Joint("first", "revolute", "base", "middle", axis=(1.0, 0.0, 0.0)),
        Joint("second", "revolute", "middle", "tip", axis=(0.0, 1.0, 0.0)),
    ],
)
"""Two joints with the mass matrix [[0, 1/2], [1/2, 0]] at rest."""


def test_an_indefinite_mass_matrix_of_a_floating_base_is_solved(make: Make) -> None:
    engine, q, v = make(FREE_LINK), FREE_LINK.neutral(), np.zeros(6)
    tau = np.arange(1.0, 7.0)
    expected = [-7.5, 11.75, -6.81, 78.0, 68.0, 48.0]
    np.testing.assert_allclose(engine.forward_dynamics(q, v, tau), expected, rtol=1e-13)
    # The next call takes the fast path.
    np.testing.assert_allclose(engine.forward_dynamics(q, v, tau), expected, rtol=1e-13)
    batch = engine.forward_dynamics(np.stack([q, q]), v, np.stack([0 * tau, tau]))
    np.testing.assert_allclose(batch, [[0.0, 0.0, -9.81, 0.0, 0.0, 0.0], expected], rtol=1e-13, atol=1e-13)


def test_a_mass_matrix_with_a_diagonal_of_zeros_is_solved(make: Make) -> None:
    a = make(CROSSED).forward_dynamics(np.zeros(2), np.zeros(2), np.array([1.0, 2.0]))
    np.testing.assert_allclose(a, [4.0, 2.0], rtol=1e-13)


def test_what_is_singular_at_one_configuration_is_refused_in_the_same_words(make: Make) -> None:
    """A point mass at the end of two links in one line moves neither along the line nor about itself."""
    links = [Link("base"), Link("upper"), Link("lower", Inertial(1.0, Pose((1.0, 0.0, 0.0))))]
    joints = [
        Joint("shoulder", "revolute", "base", "upper", axis=(0.0, 0.0, 1.0)),
        Joint("elbow", "revolute", "upper", "lower", Pose((1.0, 0.0, 0.0)), axis=(0.0, 0.0, 1.0)),
    ]
    engine = make(Model.build("line", links, joints))
    regular = engine.forward_dynamics(np.array([0.0, 1.0]), np.zeros(2), np.ones(2))
    assert np.isfinite(regular).all()
    words = "^the mass matrix of line is singular at this configuration: no unique acceleration exists$"
    with pytest.raises(SingularMassMatrixError, match=words):
        engine.forward_dynamics(np.zeros(2), np.zeros(2), np.ones(2))
    with pytest.raises(SingularMassMatrixError, match=r"is singular at sample \[1\]: "):
        engine.forward_dynamics(np.array([[0.0, 1.0], [0.0, 0.0]]), np.zeros(2), np.ones(2))
