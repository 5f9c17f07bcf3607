"""Delta debugging makes every change that can be made, and asks seldom where few must stay unmade."""

from __future__ import annotations

from collections.abc import Sequence

from hypothesis import given
from hypothesis import strategies as st

from dynx.doctor.counterexample import maximal_changes

NUMBERS = st.sets(st.integers(0, 60))


@given(st.integers(0, 61), NUMBERS)
def test_all_but_what_is_needed(count: int, needed: set[int]) -> None:
    made = maximal_changes(range(count), lambda chosen: needed.isdisjoint(chosen))
    assert made == [k for k in range(count) if k not in needed]


@given(st.integers(1, 30), st.sets(st.integers(0, 29)), st.sets(st.integers(0, 29)))
def test_no_single_change_can_be_added(count: int, one: set[int], other: set[int]) -> None:
    def holds(chosen: Sequence[int]) -> bool:
        """Neither all of `one` nor all of `other` may go, if they have anything in them."""
        return not any(group and group <= set(chosen) for group in (one, other))

    made = maximal_changes(range(count), holds)
    assert holds(made)
    assert not any(holds([*made, k]) for k in range(count) if k not in made)


def test_it_asks_seldom() -> None:
    """One change of a thousand must stay unmade: two questions for each halving, and some more."""
    asked = 0

    def holds(chosen: Sequence[int]) -> bool:
        nonlocal asked
        asked += 1
        return 617 not in chosen

    assert len(maximal_changes(range(1000), holds)) == 999
    assert asked <= 2 * 10 + 5
