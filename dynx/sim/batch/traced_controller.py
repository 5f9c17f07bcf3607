"""A controller on symbols: `dynx.rbd`, traced with the plant, evaluates its dynamics."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import Any

import numpy as np

from dynx.compiled.kernels import evaluate_quantity
from dynx.compiled.simplification import simplify_mechanism
from dynx.control.base import Controller, chain_of, gains_of, rebind
from dynx.control.code_content import is_foreign
from dynx.control.content import attributes_of, fields_of
from dynx.control.dynamics import Dynamics, Evaluation
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


def traced_controller(controller: Controller[Any], gains: Mapping[str, Array]) -> Controller[Any]:
    """Return the controller with array code as its engine, and other gains in its innermost controller."""
    last = innermost(controller)
    if is_foreign(type(last)):
        shapes = gain_shapes(last)
        gains = {name: _like_attribute(traced_array(gain), shapes[name]) for name, gain in gains.items()}
    return rebind(
        controller,
        lambda dynamics: dynamics if isinstance(dynamics, ArrayDynamics) else ArrayDynamics(dynamics.model),
        lambda each: gains if each is last else {},
    )


def gain_shapes(controller: Controller[Any]) -> dict[str, tuple[int, ...]]:
    """Return the shapes of the numbers of a controller that may differ between the rollouts of a batch.

    These are its gains. Of a class outside dynx they are all public attributes that are a real number (shape
    ()) or an array of numbers, except fields that are declared as parameters.
    """
    shapes = {name: gain.shape for name, gain in gains_of(controller).items()}
    if not is_foreign(type(controller)):
        return shapes
    declared = {name for name, each in fields_of(controller).items() if each.metadata}
    for name, value in attributes_of(controller).items():
        real = isinstance(value, float | int | np.floating | np.integer) and not isinstance(value, bool)
        numbers = isinstance(value, np.ndarray) and value.dtype.kind in "fi"
        if name not in declared and not name.startswith("_") and (real or numbers):
            shapes[name] = np.shape(value)
    return shapes


def _like_attribute(gain: Array, shape: tuple[int, ...]) -> Array:
    """Return the input (size,) in the shape of the attribute in whose place it stands."""
    return gain[0] if shape == () else gain.reshape(shape)


def innermost(controller: Controller[Any]) -> Controller[Any]:
    """Return the controller without any wrapping controllers."""
    return list(chain_of(controller))[-1]
