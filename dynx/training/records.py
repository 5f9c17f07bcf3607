"""Files of JSON lines that grow while a run goes on, and survive its sudden end."""

from __future__ import annotations

import contextlib
import json
import os
from pathlib import Path
from typing import Any

from dynx.errors import ArgumentError, shown
from dynx.files.documents import parse_json, to_json_values
from dynx.files.reading import read_file
from dynx.files.writing import write_text


class JsonLines:
    """JSON documents, one a line, each with its number of `steps`.

    Lines of more steps than `until`, and a last line that was cut off, are removed first: a run that goes on
    from a checkpoint writes them again.
    """

    def __init__(self, path: Path, until: int) -> None:
        self._path = path
        kept = [line for line in read_lines(path) if line["steps"] <= until]
        write_text(path, "".join(map(_line, kept)))

    def add(self, document: dict[str, Any]) -> None:
        """Write a document, and wait until it is on the disk."""
        try:
            with open(self._path, "a", encoding="ascii") as file:
                file.write(_line(document))
                file.flush()
                os.fsync(file.fileno())
        except OSError as error:
            raise ArgumentError(f"{shown(self._path, 300)} cannot be written: {error.strerror}") from error


def read_lines(path: Path) -> list[dict[str, Any]]:
    """Return the documents of a file of JSON lines; none if there is no file.

    Raises DescriptionError for a device, a FIFO, and a file that is too large.
    """
    found: list[dict[str, Any]] = []
    if not os.path.exists(path):
        return found
    for line in read_file(str(path)).decode("ascii", "replace").splitlines():
        with contextlib.suppress(ValueError):
            document = parse_json(line)
            if isinstance(document, dict) and type(document.get("steps")) is int:
                found.append(document)
    return found


def _line(document: dict[str, Any]) -> str:
    return json.dumps(to_json_values(document), allow_nan=False) + "\n"
