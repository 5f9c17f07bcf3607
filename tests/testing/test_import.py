"""Without Hypothesis the package says which extra brings it."""

from __future__ import annotations

import importlib
import importlib.util
import sys

import pytest

from dynx.errors import NotInstalledError


def test_without_hypothesis(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in [name for name in sys.modules if name.startswith("dynx.testing")]:
        monkeypatch.delitem(sys.modules, name)
    find_spec = importlib.util.find_spec
    monkeypatch.setattr(
        importlib.util, "find_spec", lambda name: None if name == "hypothesis" else find_spec(name)
    )
    with pytest.raises(NotInstalledError, match=r"pip install '\S*\[testing\]'") as caught:
        importlib.import_module("dynx.testing.strategies")
    assert isinstance(caught.value, ImportError)


def test_everything_published_exists() -> None:
    from dynx.testing import strategies

    for name in strategies.__all__:
        assert getattr(strategies, name).__doc__
