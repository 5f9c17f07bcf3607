"""What every test of the command line needs."""

from __future__ import annotations

import pytest


@pytest.fixture(autouse=True)
def _piped(monkeypatch: pytest.MonkeyPatch) -> None:
    """Output goes to a pipe of no width, whatever the terminal (or test runner) that started pytest says."""
    monkeypatch.delenv("COLUMNS", raising=False)
