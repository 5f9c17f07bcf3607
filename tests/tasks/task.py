"""A task, and the readers of what its user writes."""

import csv
import json
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


class Wrong(Exception):
    """The first thing that is wrong with an answer."""


@dataclass(frozen=True)
class Task:
    """One task: its text, the files it gives, and the check of the answer."""

    title: str
    text: str
    """What to produce."""
    check: Callable[[Path], None]
    """Raises `Wrong` for a folder with a wrong answer."""
    files: Mapping[str, Callable[[], str]] = field(default_factory=dict)
    """Text of each given file, by name."""


def require(condition: object, message: str) -> None:
    """Raise `Wrong` with this message unless the condition holds."""
    if not condition:
        raise Wrong(message)


def existing(folder: Path, name: str) -> Path:
    """Return the path of a file that the user had to write."""
    require((folder / name).is_file(), f"{name} does not exist")
    return folder / name


def users_module(folder: Path, name: str) -> ModuleType:
    """Return the module that a user wrote.

    Compiled from its text: bytecode is found by the second and the size of a file, which an edit may keep.
    """
    path = existing(folder, name).resolve()
    module = ModuleType(f"users_{path.stem}")
    module.__file__ = str(path)
    sys.modules[module.__name__] = module
    sys.path.insert(0, str(path.parent))
    try:
        exec(compile(path.read_text(), str(path), "exec"), module.__dict__)
    except Exception as error:
        raise Wrong(f"{name} fails: {error!r}") from None
    finally:
        sys.path.remove(str(path.parent))
    return module


def read_answer(folder: Path, *keys: str) -> dict[str, Any]:
    """Return `answer.json`, which must have these keys."""
    try:
        answer = json.loads(existing(folder, "answer.json").read_text())
    except ValueError as error:
        raise Wrong(f"answer.json is not JSON: {error}") from None
    require(isinstance(answer, dict), "answer.json must be an object")
    missing = [key for key in keys if key not in answer]
    require(not missing, f"answer.json lacks {', '.join(missing)}")
    return dict(answer)


def numbers(name: str, value: object, *shape: int) -> Array:
    """Return a value as finite numbers of this shape (-1 for any length)."""
    try:
        array = np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        raise Wrong(f"{name} must be numbers") from None
    fits = array.ndim == len(shape) and all(
        want in (-1, got) for want, got in zip(shape, array.shape, strict=True)
    )
    require(fits, f"{name} has shape {array.shape}, not {shape}")
    require(np.isfinite(array).all(), f"{name} has a value that is not finite")
    return array


def require_close(name: str, got: Array, want: Array, tolerance: float | Array) -> None:
    """Raise `Wrong` if a difference exceeds the tolerance; the message does not give the result away."""
    error = np.abs(got - want)
    excess = np.max(error - tolerance)
    require(excess <= 0, f"{name} is off by {np.max(error):.3g}; tolerance {np.max(tolerance):.3g}")


def read_table(folder: Path, name: str, columns: Sequence[str], rows: int) -> Array:
    """Return a CSV file that has a header of these columns and this many rows."""
    return parse_table(name, existing(folder, name).read_text(), columns, rows)


def parse_table(name: str, text: str, columns: Sequence[str], rows: int) -> Array:
    """Return the numbers of a CSV text that has a header of these columns and this many rows."""
    lines = [line for line in csv.reader(text.splitlines()) if line]
    require(bool(lines), f"{name} is empty")
    header = [cell.strip() for cell in lines[0]]
    require(header == list(columns), f"{name} begins with {','.join(header)}, not {','.join(columns)}")
    require(len(lines) == rows + 1, f"{name} has {len(lines) - 1} rows, not {rows}")
    return numbers(name, lines[1:], rows, len(columns))


def table(columns: Sequence[str], rows: Array) -> str:
    """Return rows as a CSV text."""
    lines = [",".join(columns)]
    lines += [",".join(f"{value:.9g}" for value in row) for row in rows]
    return "\n".join(lines) + "\n"
