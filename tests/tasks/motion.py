"""Motion of the tasks' robots, by the equations of motion and a Runge-Kutta method of order four."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin

from tests.tasks.task import Array

GRAVITY = 9.81  # [m/s2]

Derivative = Callable[[Array], Array]


def runge_kutta(derivative: Derivative, state: Array, dt: float) -> Array:
    """Return the state after a step of `dt` seconds."""
    k1 = derivative(state)
    k2 = derivative(state + dt / 2 * k1)
    k3 = derivative(state + dt / 2 * k2)
    k4 = derivative(state + dt * k3)
    return state + dt / 6 * (k1 + 2 * k2 + 2 * k3 + k4)


def advance(derivative: Derivative, state: Array, duration: float, steps: int) -> Array:
    """Return the state after a duration [s] in equal steps."""
    for _ in range(steps):
        state = runge_kutta(derivative, state, duration / steps)
    return state


def cart_pole_derivative(
    force: Array | float, pole_mass: Array | float = 0.2, cart_mass: Array | float = 1.0
) -> Derivative:
    """Return the derivative of states (..., x, theta, x', theta') under a force on the cart [N]."""
    half = 0.5  # [m] from the hinge to the centre of the uniform pole of 1 m
    moment = pole_mass / 12 + pole_mass * half**2

    def derivative(state: Array) -> Array:
        angle, velocity, omega = state[..., 1], state[..., 2], state[..., 3]
        coupling = pole_mass * half * np.cos(angle)
        total = cart_mass + pole_mass
        push = force + pole_mass * half * np.sin(angle) * omega**2
        torque = pole_mass * GRAVITY * half * np.sin(angle)
        determinant = total * moment - coupling**2
        acceleration = (moment * push - coupling * torque) / determinant
        alpha = (total * torque - coupling * push) / determinant
        return np.stack([velocity, omega, acceleration, alpha], axis=-1)

    return derivative


def arm_derivative(model: Any, torque: Array, viscous: Array | float = 0.0) -> Derivative:
    """Return the derivative of states (q, v) of a fixed-base robot under joint torques."""
    data = model.createData()

    def derivative(state: Array) -> Array:
        q, v = state[: model.nq], state[model.nq :]
        acceleration = np.array(pin.aba(model, data, q, v, torque - viscous * v))
        return np.concatenate([v, acceleration])

    return derivative
