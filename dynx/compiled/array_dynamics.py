"""Dynamics of a controller or a task by array code, on symbols or on numbers."""

from __future__ import annotations

from functools import cached_property
from typing import Any

from dynx.backends.dynamics import Dynamics, Evaluation
from dynx.compiled.kernels import evaluate_quantity
from dynx.compiled.simplification import simplify_mechanism
from dynx.model import Mechanism
from dynx.rbd.jacobians import LOCAL_WORLD_ALIGNED
from dynx.simd.user_code.arrays import is_traced, symbol_array, traced_array
from dynx.spatial.scalar import Array

FRAME_FUNCTIONS = {"forward_kinematics": "frame_placement"}
"""Names in `dynx.compiled.kernels` of quantities of a frame that have another name there."""


class ArrayDynamics(Dynamics):
    """Dynamics evaluated by the array code of `dynx.rbd`, on symbols or on numbers."""

    @cached_property
    def _mechanism(self) -> Mechanism:
        # Computed on first use: a batch whose kernels are cached evaluates nothing.
        return simplify_mechanism(self.model.mechanism)

    def evaluation(self, quantity: str) -> Evaluation:
        """Return the function of `dynx.rbd` for the quantity."""
        model = self.model

        def evaluate(*arguments: Any, reference: str = LOCAL_WORLD_ALIGNED) -> Array:
            if any(map(is_traced, arguments)):
                plain = (x if isinstance(x, str) else symbol_array(x) for x in arguments)
                return traced_array(evaluate(*plain, reference=reference))
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
