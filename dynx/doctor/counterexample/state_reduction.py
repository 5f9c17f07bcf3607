"""The simplest state at which a difference still shows: most parts at rest, the others round.

Two ways, one after the other. The plain one starts from a state that shows the difference, puts as many
parts as it can at rest, then rounds the others one by one; it always ends with a state that shows the
difference. Hypothesis (the extra ``testing``) then looks at all combinations of simple values of those
parts: it finds what needs two parts to change at once, which the plain way cannot. It cannot be told
where to start, and among the many coordinates of the first state it would not find its way; so it comes
second, and where it is not installed the plain result stands.
"""

from __future__ import annotations

from collections.abc import Callable
from random import Random
from typing import TYPE_CHECKING

from dynx.doctor.counterexample.delta_debugging import most
from dynx.doctor.counterexample.detail_reductions import DIGITS, complexity
from dynx.doctor.counterexample.state_by_name import ATTITUDE, NamedState, Slot, Value, neutral

if TYPE_CHECKING:
    from hypothesis.strategies import SearchStrategy

Holds = Callable[[NamedState], bool]

EXAMPLES = 60
"""Combinations that Hypothesis may try before it gives up."""

_ROUND = (1.0, -1.0, 0.5, -0.5, 2.0, -2.0)
_HALF = 0.5**0.5
_TURNS: tuple[Value, ...] = tuple(
    tuple(_HALF if k in (axis, 3) else 0.0 for k in range(4)) for axis in range(3)
)
"""Quarter turns about the axes of the world."""


def simplest_state(state: NamedState, holds: Holds, seed: int) -> NamedState:
    """A state of at most the moving parts of `state`, which holds, that holds and is as simple as found."""
    return _searched(_plainly(state, holds), holds, seed)


def _plainly(state: NamedState, holds: Holds) -> NamedState:
    slots = sorted(state.parts)
    resting = most(slots, lambda chosen: holds(state.having({slot: neutral(slot) for slot in chosen})))
    state = state.having({slot: neutral(slot) for slot in resting})
    for slot in sorted(state.parts):
        for value in _simpler(slot, state.parts[slot]):
            simpler = state.having({slot: value})
            if holds(simpler):
                state = simpler
                break
    return state


def _searched(state: NamedState, holds: Holds, seed: int) -> NamedState:
    """What Hypothesis finds that is simpler than `state`; `state` itself where it finds nothing."""
    try:
        from hypothesis import HealthCheck, Phase, currently_in_test_context, find, settings
        from hypothesis.errors import NoSuchExample, Unsatisfiable
        from hypothesis.strategies import fixed_dictionaries, sampled_from
    except ImportError:
        return state
    # Hypothesis refuses to work inside one of its own tests.
    if not state.parts or currently_in_test_context():
        return state
    ladders: dict[Slot, SearchStrategy[Value]] = {
        slot: sampled_from([neutral(slot), *_simpler(slot, value), value])
        for slot, value in sorted(state.parts.items())
    }
    profile = settings(
        database=None,
        deadline=None,
        derandomize=False,
        max_examples=EXAMPLES,
        phases=[Phase.generate, Phase.shrink],
        suppress_health_check=list(HealthCheck),
    )
    try:
        parts = find(
            fixed_dictionaries(ladders),
            lambda parts: holds(state.having(parts)),
            settings=profile,
            random=Random(seed),
        )
    except (NoSuchExample, Unsatisfiable):
        return state
    return min(state, state.having(parts), key=_size)


def _simpler(slot: Slot, value: Value) -> list[Value]:
    """Values simpler than `value`, the simplest first; rest excepted."""
    if slot == ATTITUDE:
        return [turn for turn in _TURNS if value not in _TURNS]
    number = value[0]
    tried = [*_ROUND, *(float(f"{number:.{digits}g}") for digits in DIGITS)]
    order = list(dict.fromkeys(tried))
    at = _ROUND.index(number) if number in _ROUND else len(order)
    return [(each,) for each in order[:at] if each != number]


def _size(state: NamedState) -> tuple[int, int, int]:
    numbers = [number for value in state.parts.values() for number in value]
    return (
        len(state.parts),
        sum(complexity(repr(number)) for number in numbers),
        sum(number < 0.0 for number in numbers),
    )
