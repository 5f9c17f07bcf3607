"""What stands at the head of every answer about one configuration: robot, base and backend."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from dynx.cli.shell.exits import one_line

if TYPE_CHECKING:
    from dynx.backends import Backend


def head(engine: Backend) -> dict[str, Any]:
    """The first entries of the JSON document."""
    return {
        "schema": 1,
        "robot": engine.model.name,
        "base": engine.model.base,
        "backend": engine.name,
    }


def title(result: dict[str, Any]) -> str:
    """The same as the first words above a table."""
    return f"{one_line(result['robot'])}, {result['base']} base, {result['backend']}"
