from __future__ import annotations

import mpmath
import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from dynx.agreement import Referee
from dynx.agreement.referee import DIGITS, exactly
from dynx.reference.backend import ReferenceBackend
from tests.agreement.robots import arm, pendulum

numbers = st.floats(-10.0, 10.0)
sizes = st.floats(0.125, 4.0)


@given(sizes, sizes, numbers, numbers, numbers)
def test_a_pendulum_follows_its_closed_form_to_40_digits(
    mass: float, length: float, q: float, v: float, a: float
) -> None:
    referee = Referee(pendulum(mass, length))
    tau = referee.inverse_dynamics(np.array([q]), np.array([v]), np.array([a]))[0]
    energy = referee.potential_energy(np.array([q]))
    with mpmath.mp.workdps(DIGITS):
        m, reach, angle, g = (mpmath.mpf(x) for x in (mass, length, q, 9.81))
        expected = m * reach**2 * mpmath.mpf(a) + m * g * reach * mpmath.sin(angle)
        size = m * reach**2 * abs(mpmath.mpf(a)) + m * g * reach
        assert abs(tau - expected) <= size * mpmath.mpf(10) ** -40
        assert abs(energy + m * g * reach * mpmath.cos(angle)) <= m * g * reach * mpmath.mpf(10) ** -40


def test_precision_is_left_as_it_was() -> None:
    before = mpmath.mp.prec
    referee = Referee(arm())
    referee.mass_matrix(arm().neutral())
    assert mpmath.mp.prec == before


def test_batches_have_the_shapes_of_a_backend() -> None:
    for model in (arm(), arm("floating")):
        rng = np.random.default_rng(1)
        q, v = model.random(rng, (2, 3)), rng.standard_normal((2, 3, model.nv))
        backend, referee = ReferenceBackend(model), Referee(model)
        pairs = [
            (backend.forward_kinematics(q), referee.forward_kinematics(q)),
            (backend.mass_matrix(q), referee.mass_matrix(q)),
            (backend.inverse_dynamics(q, v, v), referee.inverse_dynamics(q, v, v)),
            (backend.gravity_torque(q), referee.gravity_torque(q)),
            (backend.bias_torque(q, v), referee.bias_torque(q, v)),
            (backend.center_of_mass(q), referee.center_of_mass(q)),
            (backend.kinetic_energy(q, v), referee.kinetic_energy(q, v)),
            (backend.potential_energy(q), referee.potential_energy(q)),
        ]
        pairs += [(backend.jacobian(q, f), referee.jacobian(q, f)) for f in model.frame_names]
        for floats, digits in pairs:
            assert floats.shape == digits.shape


def test_doubles_are_exact() -> None:
    assert exactly(0.1) == mpmath.mpf(0.1)
    assert float(exactly([0.1, 1e-300])[1]) == 1e-300
