"""Trials of smaller robots at simpler states: whether each still shows a difference, within a budget."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable
from time import perf_counter

import numpy as np

from dynx.doctor.counterexample.state_reduction import ReducibleState
from dynx.doctor.examine.examination import Examiner
from dynx.doctor.examine.reference_values import States, model_without_mimics, reference_values
from dynx.doctor.prove.mending import Place, detections, place_of
from dynx.errors import DynxError
from dynx.model import Model
from dynx.rules import Case, all_rules
from dynx.spatial.scalar import Floats

Difference = Callable[[Case, Model, Floats, Floats, Floats], float]
"""Function of (case, model, q, v, a) that returns the relative error of the engine in question; 0 where it
cannot be evaluated."""

MAX_TRIALS = 1500
"""Largest number of trials; each loads an engine, which takes 5 to 50 ms."""


class ReductionTrials:
    """Evaluator of `difference` that stores its values and stops when the budget [s] is spent.

    A robot is tried only if it has no cause of the catalogue that the `original` does not have: a link
    without ``<inertial>``, for example, would show that difference instead. A state is tried only within the
    limits of the joints, outside which some engines apply a force; an exception are joints of the original
    whose limits leave no range.
    """

    def __init__(self, difference: Difference, original: Case, budget: float | None) -> None:
        self._difference = difference
        self._known_causes = _causes(original)
        self._until = math.inf if budget is None else perf_counter() + budget
        self._errors: dict[tuple[bytes, object], float] = {}
        self._cause_free: dict[bytes, bool] = {}
        self._last_model: tuple[bytes, Model | None] = (b"", None)
        self._count = 0
        self.threshold = 0.0
        model = self.model(original)
        self._without_range = frozenset() if model is None else _joints_without_range(model)

    @property
    def spent(self) -> bool:
        """True if the budget is spent."""
        return self._count >= MAX_TRIALS or perf_counter() >= self._until

    def holds(self, case: Case, state: ReducibleState) -> bool:
        """Check that the error is above the threshold; False if it was not tried within the budget."""
        return self.error(case, state) > self.threshold and self._adds_no_cause(case)

    def error(self, case: Case, state: ReducibleState) -> float:
        """Return the relative error, infinite for NaN; 0 where nothing was tried."""
        model = self.model(case)
        if model is None:
            return 0.0
        key = (_digest(case), state.within(model).key)
        if key not in self._errors:
            q, v, a = state.on(model)
            if self.spent or not self._is_within_limits(model, q):
                return 0.0
            self._count += 1
            found = float(self._difference(case, model, q, v, a))
            self._errors[key] = math.inf if math.isnan(found) else found
        return self._errors[key]

    def model(self, case: Case) -> Model | None:
        """Return the robot in the coordinates of all its moving joints; None where dynx refuses the text."""
        text = _digest(case)
        if self._last_model[0] != text:
            try:
                self._last_model = text, model_without_mimics(case.source, case.base)
            except DynxError:
                self._last_model = text, None
        return self._last_model[1]

    def _is_within_limits(self, model: Model, q: Floats) -> bool:
        joints = model.coordinate_joints
        fine = (model.lower <= q) & (q <= model.upper)
        inside = fine[len(q) - len(joints) :]
        outside = {joint.name for joint, fits in zip(joints, inside, strict=True) if not fits}
        return outside <= self._without_range

    def _adds_no_cause(self, case: Case) -> bool:
        text = _digest(case)
        if text not in self._cause_free:
            self._cause_free[text] = _causes(case) <= self._known_causes
        return self._cause_free[text]


def _digest(case: Case) -> bytes:
    return hashlib.blake2b(case.source.data, digest_size=16).digest()


def _causes(case: Case) -> frozenset[Place]:
    causes = [rule for rule in all_rules() if rule.kind == "difference"]
    return frozenset(place_of(rule, each) for rule, each in detections(case, causes))


def _joints_without_range(model: Model) -> frozenset[str]:
    return frozenset(
        joint.name for joint in model.coordinate_joints if joint.limits.lower >= joint.limits.upper
    )


def difference_of(examiner: Examiner, engine: str, quantity: str) -> Difference:
    """Return the relative error of `engine` in `quantity` when it loads the text of a case."""

    def difference(case: Case, model: Model, q: Floats, v: Floats, a: Floats) -> float:
        try:
            free = model_without_mimics(case.source, case.base)
            if (free.nq, free.nv) != (len(q), len(v)):
                return 0.0
            rows = [np.asarray(row, dtype=np.float64)[None] for row in (q, v, a)]
            states = States(rows[0], rows[1], rows[2], np.zeros_like(rows[2]))
            examination = examiner.examine(case, [engine], reference=reference_values(free, states))
        except DynxError:
            return 0.0
        output = examination.outputs[engine]
        if output.no_results is not None or quantity in output.failed:
            return 0.0
        return examination.error(engine, quantity)

    return difference
