"""The sample of planted faults in a run of all tests: a quarter, by turns from commit to commit.

A run that names this folder, `pytest tests/faults`, tries every fault.
"""

from __future__ import annotations

import subprocess
from pathlib import Path
from zlib import crc32

import pytest

PARTS = 4
"""Number of commits after which each fault has been tried by runs of all tests."""

TURNS = {"test_a_fault_is_caught", "test_without_a_fault_the_same_tests_pass"}
"""Tests that take turns; those of the second are in the suite themselves."""


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Leave out the faults whose turn it is not."""
    turn = None if is_selective(config) else commit_number()
    if turn is None:
        return
    left_out = [item for item in items if takes_turns(item) and (crc32(item.name.encode()) + turn) % PARTS]
    config.hook.pytest_deselected(items=left_out)
    items[:] = [item for item in items if item not in left_out]


def is_selective(config: pytest.Config) -> bool:
    """Return whether a run was asked for faults, or for tests by their name."""
    folders = (Path(argument.partition("::")[0]).parts for argument in config.args)
    return bool(config.option.keyword) or any("faults" in parts for parts in folders)


def takes_turns(item: pytest.Item) -> bool:
    return isinstance(item, pytest.Function) and item.originalname in TURNS


def commit_number() -> int | None:
    """Return the number of commits up to the present one; None outside of a repository."""
    command = ["git", "rev-list", "--count", "HEAD"]
    try:
        done = subprocess.run(command, cwd=Path(__file__).parent, capture_output=True, text=True, check=True)
    except (OSError, subprocess.CalledProcessError):
        return None
    return int(done.stdout)
