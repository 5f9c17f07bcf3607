"""Policies of the cart-pole: the one that tasks give, and those that users write."""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from tests.tasks.motion import advance, cart_pole_derivative
from tests.tasks.task import Array, Wrong, require, users_module

GAINS = (-1.0, -28.0, -2.5, -7.5)
FORCE_LIMIT = 10.0  # [N]
PERIOD = 0.02  # [s]

RULE = """force = 1.0 x + 28 theta + 2.5 x' + 7.5 theta', clipped to [-10, 10] N
(x [m] and theta [rad] are the slide's and the hinge's coordinates)"""

Policy = Callable[[Array], Array]


def given_policy(states: Array) -> Array:
    """Return the forces of the given policy."""
    return np.asarray(np.clip(-states @ np.array(GAINS), -FORCE_LIMIT, FORCE_LIMIT))


def step(states: Array, forces: Array, pole_mass: Array | float = 0.2, fineness: int = 4) -> Array:
    """Return the states after a period in which the forces are held."""
    return advance(cart_pole_derivative(forces, pole_mass), states, PERIOD, fineness)


def users_policy(folder: Path) -> Policy:
    """Return `act` of `policy.py` for a stack of states."""
    module = users_module(folder, "policy.py")
    require(callable(getattr(module, "act", None)), "policy.py has no function act")

    def policy(states: Array) -> Array:
        try:
            forces = [float(np.asarray(module.act(state.copy())).reshape(())) for state in states]
        except Exception as error:
            raise Wrong(f"act fails: {error!r}") from None
        return np.clip(forces, -FORCE_LIMIT, FORCE_LIMIT)

    return policy
