"""Evaluation of quantities by an engine's hooks, with arguments and results in model coordinates.

Control loops evaluate one sample thousands of times a second, so one sample has a straight path for every
quantity: one check of all arguments together, and the engine's hook. All else (batches, lists, invalid
arguments, quantities that dynx derives) is checked argument by argument and evaluated by `Evaluation`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy import ndarray
from numpy.typing import ArrayLike

from dynx.backends.arguments import Arguments
from dynx.backends.evaluation import Evaluation, Reduction, common_batch
from dynx.backends.hooks import EngineHooks, solve_mass_matrix, untranslated
from dynx.backends.joint_dynamics import JointDynamicsTerms
from dynx.backends.lifecycle import Lifecycle
from dynx.backends.quantities import QUANTITIES
from dynx.backends.solvability import Solvability
from dynx.model import Model
from dynx.spatial.scalar import Floats

Forces = Mapping[str, ArrayLike]

Of = str | tuple[str, str] | None
"""Name of a frame, or names of a frame and a reference, or None for a quantity of the whole robot."""

ONE_FRAME, ALL_FRAMES = "frame_placement", "frame_placements"
"""Names under which `QuantityCalls` evaluates the poses of one frame and of all frames."""


class _Plan(NamedTuple):
    """The entry of a quantity in the table, prepared for one backend."""

    arguments: tuple[str, ...]
    hook: str
    result_shape: tuple[int, ...]
    reduction: Reduction | None = None
    implied_details: tuple[Any, ...] = ()
    solves: bool = False


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
        self._details: dict[Of, tuple[Any, ...]] = {None: ()}
        all_poses = (len(self._frame_index), 4, 4)
        self._plans = {
            ONE_FRAME: _Plan(("q",), "_frame_placement", (4, 4)),
            ALL_FRAMES: _Plan(("q",), "_frame_placements", all_poses),
        }
        # Functions of this object, one sample and its details, by the quantity: hooks without the translation
        # of exceptions. A quantity gets its function when it is first evaluated.
        self._straight: dict[str, Callable[..., Any]] = {}

    def _evaluate(self, name: str, arguments: tuple[Any, ...], of: Of = None) -> Floats:
        """Check the arguments of the quantity `name`, with any leading axes, and evaluate it.

        `of` is the frame, or the frame and the reference, of a quantity of a frame.
        """
        try:
            call, details = self._straight[name], self._details[of]
        except (KeyError, TypeError):
            return self._evaluate_samples(name, arguments, of)
        if self._validate:
            if not self._arguments.are_sample(arguments):
                return self._evaluate_samples(name, arguments, of)
        else:
            for argument in arguments:
                if argument.ndim != 1:
                    return self._evaluate_samples(name, arguments, of)
        try:
            result = call(self, *arguments, *details)
        except (Exception, SystemExit):
            if not hasattr(getattr(self, self._plans[name].hook), "untranslated"):
                raise
            # The hook itself raises the error that its engine's exception stands for.
            return self._evaluate_samples(name, arguments, of)
        return result if type(result) is ndarray else np.asarray(result)

    def _evaluate_samples(self, name: str, arguments: tuple[Any, ...], of: Of) -> Floats:
        """Evaluate the quantity `name` as `_evaluate` does, by the path that takes everything."""
        plan = self._plans.get(name) or self._plan(name)
        q = self._checked_q(arguments[0])
        rates = tuple(map(self._checked_v, arguments[1:], plan.arguments[1:]))
        details = self._frame_details(of)
        if plan.solves:
            common_batch(q, *rates)
            self._solvability.refuse_singular(False)
            if not self._uncoupled:
                return self._solved_acceleration(q, *rates)
        hook: Callable[..., Any] | None = getattr(self, plan.hook, None)
        if hook is None:
            hook = partial(self._derive, name)
            details = details or plan.implied_details
        elif plan.hook not in vars(self):
            function = untranslated(getattr(type(self), plan.hook))
            self._straight[name] = self._evaluation.of_sample(function, len(rates), plan.reduction)
        return self._evaluation(hook, plan.result_shape, q, *rates, args=details, reduce=plan.reduction)

    def _solved_acceleration(self, q: Floats, v: Floats, tau: Floats) -> Floats:
        """Solve for the acceleration of a robot with mimic joints, which reduce the equation of motion."""
        hooks = ("_mass_matrix", "_bias_torque")
        if vars(self).keys().isdisjoint(hooks):
            functions = (untranslated(getattr(type(self), hook)) for hook in hooks)
            self._straight["forward_dynamics"] = self._evaluation.solution_of_sample(*functions)
        return solve_mass_matrix(
            self._evaluate("mass_matrix", (q,)), tau - self._evaluate("bias_torque", (q, v))
        )

    def _frame_details(self, of: Of) -> tuple[Any, ...]:
        """Return what hooks take for a frame, or a frame and a reference: its number, the checked name."""
        try:
            return self._details[of]
        except (KeyError, TypeError):
            if isinstance(of, tuple):
                details: tuple[Any, ...] = self._index(of[0]), self._arguments.reference(of[1])
            else:
                details = (self._index(str(of)),)
            self._details[of] = details
            return details

    def _plan(self, name: str) -> _Plan:
        quantity, evaluation, reduction = QUANTITIES[name], self._evaluation, None
        if quantity.reduces_columns:
            reduction = evaluation.reduce_both if quantity.reduces_rows else evaluation.reduce_columns
        elif quantity.reduces_rows:
            reduction = evaluation.reduce_rows
        plan = self._plans[name] = _Plan(
            quantity.arguments,
            quantity.hook,
            quantity.shape_of(self.model, self._mechanism.nv),
            reduction,
            quantity.implied_details(self.model),
            quantity.solves,
        )
        return plan

    def _index(self, frame: str) -> int:
        try:
            return self._frame_index[frame]
        except (KeyError, TypeError):
            return self.model.frame_index(frame)

    def _checked_q(self, q: Any) -> Floats:
        return self._arguments.q(q) if self._validate else q

    def _checked_v(self, v: Any, name: str = "v") -> Floats:
        return self._arguments.v(v, name) if self._validate else v
