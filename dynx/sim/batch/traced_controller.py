"""A controller on symbols: `dynx.rbd`, traced with the plant, evaluates its dynamics."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from dynx.compiled.kernels import evaluate_quantity
from dynx.compiled.simplification import simplify_mechanism
from dynx.control.base import Controller, chain_of, rebind
from dynx.control.dynamics import Dynamics, Evaluation
from dynx.model import Model
from dynx.rbd.jacobians import LOCAL_WORLD_ALIGNED
from dynx.spatial.scalar import Array

FRAME_FUNCTIONS = {"forward_kinematics": "frame_placement"}
"""Names of `dynx.compiled.kernels` for quantities of a frame, where they are others."""


class ArrayDynamics(Dynamics):
    """Dynamics evaluated by the array code of `dynx.rbd`, for symbols as for numbers."""

    def __init__(self, model: Model) -> None:
        self._mechanism = simplify_mechanism(model.mechanism)
        super().__init__(model)

    def evaluation(self, quantity: str) -> Evaluation:
        """Function of `dynx.rbd` for the quantity."""
        mechanism, model = self._mechanism, self.model

        def evaluate(*arguments: Any, reference: str = LOCAL_WORLD_ALIGNED) -> Array:
            if not isinstance(arguments[-1], str):
                return evaluate_quantity(mechanism, quantity, (), *arguments)
            *arrays, frame = arguments
            details = (model.frame_index(frame), *(() if quantity == "forward_kinematics" else (reference,)))
            return evaluate_quantity(mechanism, FRAME_FUNCTIONS.get(quantity, quantity), details, *arrays)

        return evaluate

    def content_key(self) -> tuple[Any, ...]:
        """Key that is equal for equal models."""
        return (self.model,)


def traced_controller(controller: Controller[Any], gains: Mapping[str, Array]) -> Controller[Any]:
    """The controller over array code in the place of an engine, with other gains in the innermost one."""
    last = innermost(controller)
    return rebind(
        controller,
        lambda dynamics: dynamics if isinstance(dynamics, ArrayDynamics) else ArrayDynamics(dynamics.model),
        lambda each: gains if each is last else {},
    )


def innermost(controller: Controller[Any]) -> Controller[Any]:
    """The controller without those that are wrapped around it."""
    return list(chain_of(controller))[-1]
