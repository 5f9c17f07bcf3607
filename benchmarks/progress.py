"""How far a benchmark is: a line on the terminal, and a file with the rows measured so far."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any, Generic, TypeVar

Row = TypeVar("Row")

WIDTH = 100


def tell(what: str) -> None:
    """Write `what` over the line before, on standard error; an empty text clears it. Nothing in a file."""
    if sys.stderr.isatty():
        print(f"\r{what:{WIDTH}.{WIDTH}}", end="\r" if not what else "", file=sys.stderr, flush=True)


class Record(Generic[Row]):
    """Rows (a dataclass) by what they are of, kept in a file, one in a line: an interrupted run goes on."""

    def __init__(self, row: type[Row], key: Callable[[Row], Any], path: Path | None) -> None:
        """`path` None keeps nothing."""
        self._path = path
        lines = path.read_text(encoding="utf-8").splitlines() if path is not None and path.exists() else []
        self._known = {key(each): each for each in (row(**json.loads(line)) for line in lines)}

    def get(self, key: Any, measure: Callable[[], Row]) -> Row:
        """Return the row of the file, or measure it and add it to the file."""
        found = self._known.get(key)
        if found is None:
            found = measure()
            self.add(found)
        return found

    def known(self, key: Any) -> Row | None:
        """Return the row of the file, or None."""
        return self._known.get(key)

    def add(self, row: Row) -> None:
        """Add a row to the file."""
        if self._path is not None:
            values: Any = row
            with self._path.open("a", encoding="utf-8") as file:
                print(json.dumps(asdict(values)), file=file)
