"""Integration schemes for robots of a task, as array code on floats or on symbols.

Each takes one step of `h` seconds from q, v with ``accelerate(q, v)``, under a constant torque.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from dynx.errors import UnsupportedFeatureError
from dynx.model import Model
from dynx.sim.plants.integrators import RungeKutta4, SemiImplicitEuler
from dynx.spatial.scalar import Array

Accelerate = Callable[[Array, Array], Array]
Advance = Callable[[Accelerate, Array, Array], tuple[Array, Array]]
"""One step: q and v after it, from `accelerate`, q and v."""


class ExplicitEuler:
    """First-order integrator q' = q + h v, v' = v + h a(q, v), which adds energy to an oscillation.

    It is here because environments of Gymnasium use it; for a fixed base only.
    """

    def __init__(self, model: Model, h: float) -> None:
        if model.floating:
            raise UnsupportedFeatureError("the integrator euler is for robots with a fixed base")
        self._h = h

    def __call__(self, accelerate: Accelerate, q: Array, v: Array) -> tuple[Array, Array, Array]:
        """Return q and v after the step, and the acceleration at its beginning."""
        a = accelerate(q, v)
        return q + self._h * v, v + self._h * a, a


SCHEMES: dict[str, Callable[[Model, float], Any]] = {
    "euler": ExplicitEuler,
    "semi_implicit": SemiImplicitEuler,
    "rk4": RungeKutta4,
}
"""Integration schemes by name, made of a model and a step [s]."""
