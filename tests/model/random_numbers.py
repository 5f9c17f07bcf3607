"""Random numbers and vectors, as the text of a description."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from hypothesis import strategies as st

Draw = Callable[[st.SearchStrategy[Any]], Any]

numbers = st.floats(-1.0, 1.0).map(lambda x: round(x, 3))
lengths = st.floats(0.05, 0.5).map(lambda x: round(x, 3))


def vector(count: int, entries: st.SearchStrategy[float] = numbers) -> st.SearchStrategy[str]:
    return st.lists(entries, min_size=count, max_size=count).map(lambda x: " ".join(map(str, x)))


def direction(count: int = 3) -> st.SearchStrategy[str]:
    """Text of a vector that is not small."""
    return vector(count).filter(lambda text: np.linalg.norm(np.array(text.split(), float)) > 0.3)
