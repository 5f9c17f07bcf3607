"""Processes that start while children are isolated import nothing from the current folder."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from dynx.safe_path import isolate_children, isolated_children

pytestmark = pytest.mark.skipif(sys.version_info < (3, 11), reason="older Pythons always search the folder")

VARIABLE = "PYTHONSAFEPATH"


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Make a folder with a module the current one, and restore the environment afterwards."""
    (tmp_path / "stranger.py").touch()
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv(VARIABLE, "")


def child_finds_module() -> bool:
    program = "import importlib.util; print(importlib.util.find_spec('stranger') is not None)"
    return subprocess.check_output([sys.executable, "-c", program], text=True).strip() == "True"


@pytest.mark.parametrize("before", [None, "", "1"])
def test_a_block_isolates_and_leaves_the_environment_as_it_was(before: str | None) -> None:
    if before is None:
        del os.environ[VARIABLE]
    else:
        os.environ[VARIABLE] = before
    with isolated_children():
        assert not child_finds_module()
    assert os.environ.get(VARIABLE) == before
    assert child_finds_module() == (before != "1")


def test_a_block_that_fails_or_clears_the_variable_is_left_like_any_other() -> None:
    with pytest.raises(ZeroDivisionError), isolated_children():
        raise ZeroDivisionError
    assert os.environ[VARIABLE] == ""
    del os.environ[VARIABLE]
    with isolated_children():
        del os.environ[VARIABLE]
    assert VARIABLE not in os.environ


def test_isolation_without_a_block_stays() -> None:
    assert child_finds_module()
    isolate_children()
    assert not child_finds_module()
