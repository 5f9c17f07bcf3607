"""Fixture for every test of the command line."""

from __future__ import annotations

import pytest


@pytest.fixture(autouse=True)
def _piped(monkeypatch: pytest.MonkeyPatch) -> None:
    """Write output to a pipe without a width, whatever terminal (or test runner) started pytest."""
    monkeypatch.delenv("COLUMNS", raising=False)
