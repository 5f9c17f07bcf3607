"""Checks that a strategy draws examples of some kind, and the simplest of them."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

from hypothesis import Phase, find, settings
from hypothesis import strategies as st

T = TypeVar("T")

FIRST = settings(max_examples=3000, phases=[Phase.generate], database=None, derandomize=True)


def assert_occurs(strategy: st.SearchStrategy[T], sort: Callable[[T], bool]) -> None:
    """Assert that an example of the sort is drawn; it is not shrunk, which takes long."""
    find(strategy, sort, settings=FIRST)


SHRUNK = settings(max_examples=2000, phases=[Phase.generate, Phase.shrink], database=None, derandomize=True)


def simplest(strategy: st.SearchStrategy[T], sort: Callable[[T], bool]) -> T:
    """Return the example of the sort to which Hypothesis shrinks, without its slow phase `explain`."""
    return find(strategy, sort, settings=SHRUNK)
