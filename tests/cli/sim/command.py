"""Calls of `dynx sim` for the tests."""

from __future__ import annotations

import json
from typing import Any

from click.testing import CliRunner, Result

from dynx.cli.shell.main import cli

SHORT = ["--duration", "0.05", "--to", "elbow_joint=0.01"]
"""Fifty steps, slow enough for the limits of the arm."""


def sim(*arguments: str) -> Result:
    """Run ``dynx sim``."""
    return CliRunner().invoke(cli, ["sim", *arguments])


def document(*arguments: str, code: int = 0) -> dict[str, Any]:
    """Return the document that ``--json`` writes."""
    result = sim(*arguments, "--json")
    assert result.exit_code == code, result.output
    made: dict[str, Any] = json.loads(result.stdout)
    return made
