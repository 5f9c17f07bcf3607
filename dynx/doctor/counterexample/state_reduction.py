"""Search for the simplest state with a difference: most parts at rest, the others round numbers.

The parts of a state are identified by the names of joints, so that it can be used for a robot from which
joints were removed. The reduction has two steps. The greedy one starts from a state that shows the
difference, sets as many parts as possible to rest, then rounds the others one by one; it always ends with a
state that shows the difference. Hypothesis (the extra ``testing``) then searches all combinations of simple
values of the parts that are left: it also finds simplifications in which two parts change together. It comes
second, because it cannot start from a given state and all coordinates have too many combinations. Without
Hypothesis the greedy result is used.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from random import Random
from typing import TYPE_CHECKING

import numpy as np

from dynx.doctor.counterexample.delta_debugging import maximal_changes
from dynx.doctor.counterexample.detail_reductions import DIGITS, complexity
from dynx.model import Model
from dynx.spatial.scalar import Floats

if TYPE_CHECKING:
    from hypothesis.strategies import SearchStrategy

Slot = tuple[str, int]
"""A part of a state: the joint, or "" for the base, and the number of the part."""

Value = tuple[float, ...]
"""One number, or the four numbers of an attitude."""

ATTITUDE: Slot = ("", 3)
UPRIGHT: Value = (0.0, 0.0, 0.0, 1.0)

MAX_EXAMPLES = 60
"""Largest number of combinations that Hypothesis tries."""

ROUND_VALUES = (1.0, -1.0, 0.5, -0.5, 2.0, -2.0)
_HALF = 0.5**0.5
QUARTER_TURNS: tuple[Value, ...] = tuple(
    tuple(_HALF if k in (axis, 3) else 0.0 for k in range(4)) for axis in range(3)
)
"""Quarter turns about the axes of the world."""


@dataclass(frozen=True)
class ReducibleState:
    """The parts of a state that are not zero.

    A joint has the parts 0 (position), 1 (velocity) and 2 (acceleration). A floating base has its
    position in 0-2, its attitude (quaternion xyzw) in 3, its velocity in 4-9, its acceleration in 10-15.
    """

    parts: Mapping[Slot, Value]

    @classmethod
    def of(cls, model: Model, q: Floats, v: Floats, a: Floats) -> ReducibleState:
        """Make the state from q (nq,), v (nv,), a (nv,) of `model`."""
        parts: dict[Slot, Value] = {}
        nb = 6 if model.floating else 0
        if model.floating:
            base = [*q[:3], None, *v[:6], *a[:6]]
            parts = {("", k): (float(x),) for k, x in enumerate(base) if x is not None}
            parts[ATTITUDE] = tuple(float(x) for x in q[3:7])
        for k, name in enumerate(model.joint_names):
            values = (q[k + model.nq - len(model.joint_names)], v[nb + k], a[nb + k])
            parts.update({(name, number): (float(x),) for number, x in enumerate(values)})
        return cls({}).with_parts(parts)

    def on(self, model: Model) -> tuple[Floats, Floats, Floats]:
        """Return (q, v, a) of `model`. Parts that the model does not have are left out, and parts that are
        missing here are at rest."""
        nb = 6 if model.floating else 0
        q, v, a = model.neutral(), np.zeros(model.nv), np.zeros(model.nv)
        if model.floating:
            q[3:7] = self.parts.get(ATTITUDE, UPRIGHT)
            flat = [self.parts.get(("", k), (0.0,))[0] for k in range(16) if k != ATTITUDE[1]]
            q[:3], v[:6], a[:6] = flat[:3], flat[3:9], flat[9:]
        for k, name in enumerate(model.joint_names):
            values = [self.parts.get((name, number), (0.0,))[0] for number in range(3)]
            q[nb + k + (1 if nb else 0)], v[nb + k], a[nb + k] = values
        return q, v, a

    def within(self, model: Model) -> ReducibleState:
        """Keep the parts that `model` has."""
        known = {*model.joint_names, *([""] if model.floating else [])}
        return ReducibleState({slot: value for slot, value in self.parts.items() if slot[0] in known})

    def with_parts(self, changed: Mapping[Slot, Value]) -> ReducibleState:
        """Change some parts; parts at rest are removed."""
        parts = {**self.parts, **changed}
        return ReducibleState({slot: value for slot, value in parts.items() if value != rest(slot)})

    @property
    def key(self) -> tuple[tuple[Slot, Value], ...]:
        """Hashable form, equal for equal states."""
        return tuple(sorted(self.parts.items()))

    @property
    def complexity(self) -> tuple[int, int, int]:
        """Measure of complexity: number of parts, digits of their numbers, and number of negative numbers."""
        numbers = [number for value in self.parts.values() for number in value]
        digits = sum(complexity(repr(number)) for number in numbers)
        return len(self.parts), digits, sum(number < 0.0 for number in numbers)


Holds = Callable[[ReducibleState], bool]


def rest(slot: Slot) -> Value:
    """Return the value of a part at rest at zero."""
    return UPRIGHT if slot == ATTITUDE else (0.0,)


def simplest_state(state: ReducibleState, holds: Holds, seed: int) -> ReducibleState:
    """Find the simplest state for which `holds` is true, starting from `state`, for which it is; no part
    is added."""
    return _search(_reduce_greedily(state, holds), holds, seed)


def _reduce_greedily(state: ReducibleState, holds: Holds) -> ReducibleState:
    slots = sorted(state.parts)
    resting = maximal_changes(
        slots, lambda chosen: holds(state.with_parts({slot: rest(slot) for slot in chosen}))
    )
    state = state.with_parts({slot: rest(slot) for slot in resting})
    for slot in sorted(state.parts):
        for value in _simpler_values(slot, state.parts[slot]):
            simpler = state.with_parts({slot: value})
            if holds(simpler):
                state = simpler
                break
    return state


def _search(state: ReducibleState, holds: Holds, seed: int) -> ReducibleState:
    """Let Hypothesis search for a simpler state; `state` itself where it finds none."""
    try:
        from hypothesis import HealthCheck, Phase, currently_in_test_context, find, settings
        from hypothesis.errors import NoSuchExample, Unsatisfiable
        from hypothesis.strategies import fixed_dictionaries, sampled_from
    except ImportError:
        return state
    # Hypothesis refuses to run inside one of its own tests.
    if not state.parts or currently_in_test_context():
        return state
    ladders: dict[Slot, SearchStrategy[Value]] = {
        slot: sampled_from([rest(slot), *_simpler_values(slot, value), value])
        for slot, value in sorted(state.parts.items())
    }
    profile = settings(
        database=None,
        deadline=None,
        derandomize=False,
        max_examples=MAX_EXAMPLES,
        phases=[Phase.generate, Phase.shrink],
        suppress_health_check=list(HealthCheck),
    )
    try:
        parts = find(
            fixed_dictionaries(ladders),
            lambda parts: holds(state.with_parts(parts)),
            settings=profile,
            random=Random(seed),
        )
    except (NoSuchExample, Unsatisfiable):
        return state
    return min(state, state.with_parts(parts), key=lambda each: each.complexity)


def _simpler_values(slot: Slot, value: Value) -> list[Value]:
    """List values simpler than `value`, the simplest first, without the value at rest."""
    if slot == ATTITUDE:
        return [] if value in QUARTER_TURNS else list(QUARTER_TURNS)
    number = value[0]
    rounded = [*ROUND_VALUES, *(float(f"{number:.{digits}g}") for digits in DIGITS)]
    order = list(dict.fromkeys(rounded))
    end = ROUND_VALUES.index(number) if number in ROUND_VALUES else len(order)
    return [(each,) for each in order[:end] if each != number]
