"""Fixtures for every test of the command line."""

from __future__ import annotations

from typing import Any

import pytest
from click.testing import CliRunner, Result

from tests.conftest import EXAMPLES_INSTALLED

MISSING_ROBOT = " in the library, and no such file"
"""Part of the message about a robot that no installed package has."""


@pytest.fixture(autouse=True)
def _piped(monkeypatch: pytest.MonkeyPatch) -> None:
    """Write output to a pipe without a width, whatever terminal (or test runner) started pytest."""
    monkeypatch.delenv("COLUMNS", raising=False)


@pytest.fixture(autouse=True)
def _skipped_without_robot(monkeypatch: pytest.MonkeyPatch) -> None:
    """Skip a test whose command does not find a robot, where example-robot-data is not installed.

    The command turns the error into an exit code, so the hooks of `tests.conftest` do not see it.
    """
    if EXAMPLES_INSTALLED:
        return
    invoke = CliRunner.invoke

    def invoked(runner: CliRunner, *args: Any, **options: Any) -> Result:
        result = invoke(runner, *args, **options)
        if MISSING_ROBOT in " ".join(result.output.split()):
            pytest.skip("needs example-robot-data")
        return result

    monkeypatch.setattr(CliRunner, "invoke", invoked)
