"""Evaluation of quantities by an engine's hooks, with arguments and results in model coordinates."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, NamedTuple

from numpy.typing import ArrayLike

from dynx.backends.arguments import Arguments
from dynx.backends.evaluation import Evaluation, Reduction
from dynx.backends.hooks import EngineHooks
from dynx.backends.joint_dynamics import JointDynamicsTerms
from dynx.backends.lifecycle import Lifecycle
from dynx.backends.quantities import QUANTITIES, Quantity
from dynx.backends.solvability import Solvability
from dynx.model import Model
from dynx.rbd.jacobians import Reference
from dynx.spatial.scalar import Floats

Forces = Mapping[str, ArrayLike]


class _Plan(NamedTuple):
    """The entry of a quantity in the table, prepared for one backend."""

    hook: str
    result_shape: tuple[int, ...]
    reduction: Reduction | None
    implied_details: tuple[Any, ...]


class QuantityCalls(Lifecycle, EngineHooks):
    """Base of backends: checks of arguments, evaluation of quantities, and terms shared by all engines."""

    def __init__(self, model: Model, *, validate: bool = True) -> None:
        super().__init__(model, Arguments(model), validate=validate)
        self._mechanism = model.mechanism
        self._evaluation = Evaluation(self._mechanism, vectorized=self.vectorized)
        self._uncoupled = self._mechanism.coupling is None
        self._joint_terms = JointDynamicsTerms(model)
        self._solvability = Solvability(model)
        self._frame_index = {name: index for index, name in enumerate(model.frame_names)}
        self._plans: dict[str, _Plan] = {}

    def _evaluate(self, name: str, q: Floats, *rates: Floats, details: tuple[Any, ...] = ()) -> Floats:
        """Evaluate the quantity `name` at checked arguments with any leading axes, in model coordinates.

        `details` are the frame and the reference of a quantity of a frame.
        """
        plan = self._plans.get(name)
        if plan is None:
            plan = self._plans[name] = self._plan(QUANTITIES[name])
        hook: Callable[..., Any] | None = getattr(self, plan.hook, None)
        if hook is None:
            hook = partial(self._derive, name)
            details = details or plan.implied_details
        return self._evaluation(hook, plan.result_shape, q, *rates, args=details, reduce=plan.reduction)

    def _plan(self, quantity: Quantity) -> _Plan:
        evaluation, reduction = self._evaluation, None
        if quantity.reduces_columns:
            reduction = evaluation.reduce_both if quantity.reduces_rows else evaluation.reduce_columns
        elif quantity.reduces_rows:
            reduction = evaluation.reduce_rows
        result_shape = quantity.shape_of(self.model, self._mechanism.nv)
        return _Plan(quantity.hook, result_shape, reduction, quantity.implied_details(self.model))

    def _index(self, frame: str) -> int:
        try:
            return self._frame_index[frame]
        except (KeyError, TypeError):
            return self.model.frame_index(frame)

    def _checked_q(self, q: Any) -> Floats:
        return self._arguments.q(q) if self._validate else q

    def _checked_v(self, v: Any, name: str = "v") -> Floats:
        return self._arguments.v(v, name) if self._validate else v

    def _checked_reference(self, reference: Any) -> Reference:
        return self._arguments.reference(reference) if self._validate else reference
