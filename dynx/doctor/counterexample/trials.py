"""Whether a smaller robot, at a simpler state, still shows a difference; asked a bounded number of times."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable
from time import perf_counter

from dynx.doctor.counterexample.state_by_name import NamedState
from dynx.doctor.examine.right_answers import free_model
from dynx.doctor.prove.mending import Place, detections, place
from dynx.errors import DynxError
from dynx.model import Model
from dynx.rules import Case, all_rules
from dynx.spatial.scalar import Floats

Difference = Callable[[Case, Model, Floats, Floats, Floats], float]
"""(case, model, q, v, a) -> relative error of the engine in question; 0 where it cannot be evaluated."""

MAX_TRIALS = 1500
"""Of which each loads an engine, for 5 to 50 ms."""


class Trials:
    """Asks `difference`, remembers its answers, and stops when the budget is spent.

    A robot counts only if it brings in no cause that the catalogue knows and that was not in the
    `original` already: a link that loses its ``<inertial>``, say, would show that difference instead.
    A state counts only within the limits of the joints, outside which some engines push; the joints of
    the original whose limits leave no room are excepted.
    """

    def __init__(self, difference: Difference, original: Case, budget: float | None) -> None:
        self._difference = difference
        self._known_causes = _causes(original)
        self._until = math.inf if budget is None else perf_counter() + budget
        self._errors: dict[tuple[bytes, object], float] = {}
        self._sound: dict[bytes, bool] = {}
        self._last_model: tuple[bytes, Model | None] = (b"", None)
        self._count = 0
        self.threshold = 0.0
        model = self.model(original)
        self._stuck = frozenset() if model is None else _without_room(model)

    @property
    def spent(self) -> bool:
        """Whether nothing more can be tried."""
        return self._count >= MAX_TRIALS or perf_counter() >= self._until

    def holds(self, case: Case, state: NamedState) -> bool:
        """Whether the error is above the threshold; False for what was not tried before the end."""
        return self.error(case, state) > self.threshold and self._is_sound(case)

    def error(self, case: Case, state: NamedState) -> float:
        """The relative error, infinite for NaN; 0 for what does not count or cannot be tried any more."""
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
        """The robot in the coordinates of all its moving joints; None where dynx refuses the text."""
        text = _digest(case)
        if self._last_model[0] != text:
            try:
                self._last_model = text, free_model(case.source, case.base)
            except DynxError:
                self._last_model = text, None
        return self._last_model[1]

    def _is_within_limits(self, model: Model, q: Floats) -> bool:
        joints = model.coordinate_joints
        fine = (model.lower <= q) & (q <= model.upper)
        inside = fine[len(q) - len(joints) :]
        outside = {joint.name for joint, fits in zip(joints, inside, strict=True) if not fits}
        return outside <= self._stuck

    def _is_sound(self, case: Case) -> bool:
        text = _digest(case)
        if text not in self._sound:
            self._sound[text] = _causes(case) <= self._known_causes
        return self._sound[text]


def _digest(case: Case) -> bytes:
    return hashlib.blake2b(case.source.data, digest_size=16).digest()


def _causes(case: Case) -> frozenset[Place]:
    causes = [rule for rule in all_rules() if rule.kind == "difference"]
    return frozenset(place(rule, each) for rule, each in detections(case, causes))


def _without_room(model: Model) -> frozenset[str]:
    return frozenset(
        joint.name for joint in model.coordinate_joints if joint.limits.lower >= joint.limits.upper
    )
