"""Progress bars, on a terminal alone and with words for the time that they show; entries of documents."""

from __future__ import annotations

import io
import re
import sys
from types import SimpleNamespace
from typing import Any, TypedDict

import numpy as np
import pytest
from rich.console import Console

from dynx.cli.shell.output import entry_of, progress_bar


class Screen(io.StringIO):
    """Standard error that claims to be a terminal, or not."""

    def __init__(self, *, terminal: bool) -> None:
        super().__init__()
        self._terminal = terminal

    def isatty(self) -> bool:
        return self._terminal


def shown(monkeypatch: pytest.MonkeyPatch, *, terminal: bool, **options: Any) -> str:
    """Return what a bar that advances to 3 of 7 writes."""
    screen = Screen(terminal=terminal)
    wide = Console(file=screen, width=80, force_terminal=True, color_system=None)
    monkeypatch.setattr("dynx.cli.shell.output.console", lambda *, err: wide)
    monkeypatch.setattr(sys, "stderr", screen)
    with progress_bar(7, 0, "simulating", **options) as advance:
        advance(3, "simulating")
    return screen.getvalue()


def test_the_time_of_a_bar_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    bar = shown(monkeypatch, terminal=True)
    assert re.search(r"simulating .* 3/7 0:00:0\d elapsed", bar)


@pytest.mark.parametrize(("terminal", "enabled"), [(False, True), (True, False)])
def test_without_a_terminal_or_with_quiet_there_is_no_bar(
    terminal: bool, enabled: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert shown(monkeypatch, terminal=terminal, enabled=enabled) == ""


class Part(TypedDict):
    name: str
    numbers: list[float]
    pair: list[str]


def test_an_entry_has_the_attributes_that_its_keys_name() -> None:
    source = SimpleNamespace(name="arm", numbers=np.array([1.0, 2.0]), pair=("a", "b"), other=3)
    entry = entry_of(Part, source, name="leg")
    assert entry == {"name": "leg", "numbers": [1.0, 2.0], "pair": ["a", "b"]}
    assert isinstance(entry["numbers"], list)
    with pytest.raises(AttributeError):
        entry_of(Part, SimpleNamespace(name="arm"))
    with pytest.raises(AssertionError):
        entry_of(Part, source, names="a key that no entry has")
