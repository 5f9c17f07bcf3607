"""Names of elements and attributes that no reader knows, and the known names that were meant."""

import difflib
from collections.abc import Collection, Sequence

_CLOSE = 0.8
"""Ratio of matching letters (difflib): one letter wrong, missing or doubled in a word of five or more."""


def meant_name(word: str, known: Sequence[str], present: Collection[str]) -> str | None:
    """Return the known name closest to an unknown one, if it is absent."""
    if word in known or ":" in word:
        return None
    absent = [other for other in known if other not in present]
    close = difflib.get_close_matches(word.lower(), absent, n=1, cutoff=_CLOSE)
    return close[0] if close else None
