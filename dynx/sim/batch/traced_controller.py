"""A controller on symbols: `dynx.rbd`, traced with the plant, evaluates its dynamics."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import Any

from dynx.compiled.kernels import evaluate_quantity
from dynx.compiled.simplification import simplify_mechanism
from dynx.control.base import Controller, chain_of, rebind
from dynx.control.dynamics import Dynamics, Evaluation
from dynx.model import Mechanism
from dynx.rbd.jacobians import LOCAL_WORLD_ALIGNED
from dynx.spatial.scalar import Array

FRAME_FUNCTIONS = {"forward_kinematics": "frame_placement"}
"""Names of `dynx.compiled.kernels` for quantities of a frame, where they are others."""


class ArrayDynamics(Dynamics):
    """Dynamics evaluated by the array code of `dynx.rbd`, for symbols as for numbers."""

    @cached_property
    def _mechanism(self) -> Mechanism:
        # Many batches find their kernels in the cache and evaluate nothing.
        return simplify_mechanism(self.model.mechanism)

    def evaluation(self, quantity: str) -> Evaluation:
        """Return the function of `dynx.rbd` for the quantity."""
        model = self.model

        def evaluate(*arguments: Any, reference: str = LOCAL_WORLD_ALIGNED) -> Array:
            if not isinstance(arguments[-1], str):
                return evaluate_quantity(self._mechanism, quantity, (), *arguments)
            *arrays, frame = arguments
            details = (model.frame_index(frame), *(() if quantity == "forward_kinematics" else (reference,)))
            return evaluate_quantity(
                self._mechanism, FRAME_FUNCTIONS.get(quantity, quantity), details, *arrays
            )

        return evaluate

    def content_key(self) -> tuple[Any, ...]:
        """Return the key that is equal for equal models."""
        return (self.model,)


def traced_controller(controller: Controller[Any], gains: Mapping[str, Array]) -> Controller[Any]:
    """Return the controller over array code in the place of an engine, with other gains in the innermost
    one."""
    last = innermost(controller)
    return rebind(
        controller,
        lambda dynamics: dynamics if isinstance(dynamics, ArrayDynamics) else ArrayDynamics(dynamics.model),
        lambda each: gains if each is last else {},
    )


def innermost(controller: Controller[Any]) -> Controller[Any]:
    """Return the controller without those that are wrapped around it."""
    return list(chain_of(controller))[-1]
