"""Delta debugging: search for as many changes as possible while a condition holds.

The minimising algorithm of Zeller and Hildebrandt, "Simplifying and isolating failure-inducing input" (IEEE
Transactions on Software Engineering 28, 2002, section 3), without the complements. Those save trials if few
changes can be made, but most of a robot that shows a difference can be removed.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeVar

Change = TypeVar("Change")


def maximal_changes(changes: Sequence[Change], holds: Callable[[Sequence[Change]], bool]) -> list[Change]:
    """Find changes that can be made together with `holds` staying true, to which no other single one of
    `changes` can be added; they keep their order.

    `holds` is called with sets of changes, large sets first; neighbours in the list are tried together.
    """
    made: set[int] = set()
    size = len(changes)
    while size:
        found = _try_chunks(changes, holds, made, size)
        # A change may become possible only by another one, so single ones are tried until none is.
        if not (size == 1 and found):
            size //= 2
    return _select(changes, made)


def _try_chunks(
    changes: Sequence[Change], holds: Callable[[Sequence[Change]], bool], made: set[int], size: int
) -> bool:
    """Try the changes not made yet in chunks of `size`; return whether any could be made."""
    waiting = [k for k in range(len(changes)) if k not in made]
    found = False
    for start in range(0, len(waiting), size):
        chunk = waiting[start : start + size]
        if holds(_select(changes, made.union(chunk))):
            made.update(chunk)
            found = True
    return found


def _select(changes: Sequence[Change], numbers: set[int]) -> list[Change]:
    return [changes[k] for k in sorted(numbers)]
