"""That a strategy draws examples of some sort."""

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
