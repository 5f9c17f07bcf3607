"""Every installed backend against the closed forms, over random states."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynx.backends import Backend, backend, installed_backends
from dynx.model.loading import load
from dynx.testing.strategies import configurations, samples
from tests.error_bounds import ErrorBounds, samples_at
from tests.examples import one_robot
from tests.oracles.cart_pole import CartPole
from tests.oracles.closed_form import MODELS, ClosedForm
from tests.oracles.free_body import FreeBody
from tests.oracles.pendulums import DoublePendulum, Pendulum
from tests.oracles.planar_arms import Planar2R, Planar3R
from tests.oracles.scara import Scara

FORMS: tuple[ClosedForm, ...] = (
    Pendulum(),
    DoublePendulum(),
    Planar2R(),
    Planar3R(),
    CartPole(),
    Scara(),
    FreeBody(),
)
STATES = 4
"""States in one example, evaluated as a batch."""


def engine_of(form: ClosedForm, name: str) -> Backend:
    model = load(MODELS / f"{form.robot}.urdf", base=form.base, gravity=form.gravity)
    return backend(name, model)


@pytest.mark.long_cases
@pytest.mark.parametrize("name", installed_backends())
@pytest.mark.parametrize("form", FORMS, ids=lambda form: form.robot)
def test_backend_matches_closed_form(form: ClosedForm, name: str) -> None:
    with engine_of(form, name) as engine:

        @one_robot
        @given(st.lists(samples(engine.model), min_size=STATES, max_size=STATES))
        def matches(states: list[tuple[np.ndarray, np.ndarray, np.ndarray]]) -> None:
            q, v, a = (np.stack(column) for column in zip(*states, strict=True))
            check_kinematics(form, engine, q, v, a)
            check_dynamics(form, engine, q, v, a)

        matches()


def check_kinematics(form: ClosedForm, engine: Backend, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> None:
    close = ErrorBounds(samples_at(engine.model, q, v, a))
    J, dJ = form.jacobian(q), form.jacobian_derivative(q, v)
    close.check("forward_kinematics", engine.forward_kinematics(q, form.tip), form.placement(q))
    close.check("jacobian", engine.jacobian(q, form.tip), J)
    close.check("jacobian_derivative", engine.jacobian_derivative(q, v, form.tip), dJ)
    close.check("frame_velocity", engine.frame_velocity(q, v, form.tip), np.einsum("nij,nj->ni", J, v))
    acceleration = np.einsum("nij,nj->ni", J, a) + np.einsum("nij,nj->ni", dJ, v)
    close.check("frame_acceleration", engine.frame_acceleration(q, v, a, form.tip), acceleration)


def check_dynamics(form: ClosedForm, engine: Backend, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> None:
    wanted = form.inverse_dynamics(q, v, a)
    close = ErrorBounds(samples_at(engine.model, q, v, a, tau=wanted))
    products, gravity = form.velocity_torque(q, v), form.gravity_torque(q)
    close.check("inverse_dynamics", engine.inverse_dynamics(q, v, a), wanted)
    close.check("mass_matrix", engine.mass_matrix(q), form.mass_matrix(q))
    close.check("bias_torque", engine.bias_torque(q, v), products + gravity)
    close.check("gravity_torque", engine.gravity_torque(q), gravity)
    close.check("kinetic_energy", engine.kinetic_energy(q, v), form.kinetic_energy(q, v))
    close.check("potential_energy", engine.potential_energy(q), form.potential_energy(q))
    C = engine.coriolis_matrix(q, v)
    close.check("bias_torque", np.einsum("nij,nj->ni", C, v) + gravity, products + gravity)
    christoffel = form.coriolis_matrix(q, v)
    if christoffel is not None:
        close.check("coriolis_matrix", C, christoffel)
    found = engine.forward_dynamics(q, v, wanted)
    close.check_solves(found, form.inverse_dynamics(q, v, found), wanted)


@pytest.mark.parametrize("name", installed_backends())
def test_momentum_of_a_free_body(name: str) -> None:
    form = FreeBody()
    with engine_of(form, name) as engine:

        @one_robot
        @given(samples(engine.model))
        def matches(state: tuple[np.ndarray, np.ndarray, np.ndarray]) -> None:
            q, v, _ = state
            close = ErrorBounds(samples_at(engine.model, q, v))
            close.check("centroidal_momentum", engine.centroidal_momentum(q, v), form.momentum(q, v))
            center = q[:3] + form.rotation(q) @ form.c
            close.check("center_of_mass", engine.center_of_mass(q), center)

        matches()


@pytest.mark.parametrize("name", installed_backends())
def test_wrist_centre_of_the_six_axis_arm(name: str) -> None:
    """The position depends on three joints: s, h offset and height, u upper arm, e, f offset and forearm."""
    s, h, u, e, f = 0.10, 0.40, 0.45, 0.05, 0.42
    model = load(MODELS / "six_axis_arm.urdf")
    with backend(name, model) as engine:

        @one_robot
        @given(configurations(model))
        def is_where_it_should_be(q: np.ndarray) -> None:
            raised = q[1] + q[2]
            out = s + u * np.sin(q[1]) + e * np.sin(raised) + f * np.cos(raised)
            up = h + u * np.cos(q[1]) + e * np.cos(raised) - f * np.sin(raised)
            wrist = engine.forward_kinematics(q, "wrist")
            wanted = wrist.copy()
            wanted[:3, 3] = out * np.cos(q[0]), out * np.sin(q[0]), up
            close = ErrorBounds(samples_at(model, q))
            close.check("forward_kinematics", wrist, wanted)
            flange = engine.forward_kinematics(q, "flange")
            wanted = flange.copy()
            wanted[:3, 3] = wrist[:3, 3]
            close.check("forward_kinematics", flange, wanted)

        is_where_it_should_be()


@pytest.mark.parametrize("name", installed_backends())
def test_distance_of_the_seven_axis_arms_wrist(name: str) -> None:
    """The distance from the shoulder centre depends on the elbow alone (law of cosines)."""
    h, u, f = 0.34, 0.40, 0.39
    model = load(MODELS / "seven_axis_arm.urdf")
    with backend(name, model) as engine:

        @one_robot
        @given(configurations(model))
        def follows_from_the_elbow(q: np.ndarray) -> None:
            wrist = engine.forward_kinematics(q, "link6")
            arm = wrist[:3, 3] - np.array([0.0, 0.0, h])
            distance2 = u * u + f * f + 2 * u * f * np.cos(q[3])
            # Both squares in the place of a position: their size is that of the robot, about 1.
            got, wanted = wrist.copy(), wrist.copy()
            got[:3, 3], wanted[:3, 3] = [arm @ arm, 0.0, 0.0], [distance2, 0.0, 0.0]
            ErrorBounds(samples_at(model, q)).check("forward_kinematics", got, wanted)

        follows_from_the_elbow()
