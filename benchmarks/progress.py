"""A line that says how far a benchmark is."""

from __future__ import annotations

import sys

WIDTH = 100


def tell(what: str) -> None:
    """Write `what` over the line before, on standard error; an empty text clears it. Nothing in a file."""
    if sys.stderr.isatty():
        print(f"\r{what:{WIDTH}.{WIDTH}}", end="\r" if not what else "", file=sys.stderr, flush=True)
