"""What is asked of a path before any engine is given it."""

from __future__ import annotations

from pathlib import Path

from dynx.errors import EngineError, shown


def require_file(path: Path) -> None:
    """Raise EngineError for what is no regular file: engines crash on a folder and hang on a pipe."""
    if not path.is_file():
        raise EngineError(f"no regular file to load: {shown(path, 300)}")
