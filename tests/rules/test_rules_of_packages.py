"""A rule of another package: its page names the trap beside its module, where there is one."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from pathlib import Path

import pytest

from dynx.cli.queries.explain import explain
from dynx.rules import Case, Detection, Rule, registry

MODULE = '''
from dynx.rules import Rule

class Theirs(Rule):
    """ACME001 heavy-gripper: A gripper is heavy.

    Page.
    """
    kind = "practice"
    advice = "Make it light."

    def occurrences(self, case):
        return []
'''


class Untrapped(Rule):
    """ACME002 light-gripper: A gripper is light.

    Page.
    """

    kind = "practice"
    advice = "Make it heavy."

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield nothing."""
        return []


def page_of(rule: Rule, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> str:
    """Return what ``dynx explain`` prints for a rule of another package."""
    rules = (*registry.all_rules(), rule)
    monkeypatch.setattr(registry, "all_rules", lambda: rules)
    explain(rule.id, None)
    return capsys.readouterr().out


def test_a_page_names_a_trap_that_is_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "acme_rules_of_test.py").write_text(MODULE, encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    module = __import__("acme_rules_of_test")
    try:
        rule = module.Theirs()
        assert "shown by" not in page_of(rule, monkeypatch, capsys)
        trap = tmp_path / rule.trap()
        trap.write_text('<robot name="r"><link name="l"/></robot>', encoding="utf-8")
        assert f"shown by: {trap}" in page_of(rule, monkeypatch, capsys)
    finally:
        del sys.modules["acme_rules_of_test"]


def test_a_page_names_no_trap_that_is_not_there(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert "shown by" not in page_of(Untrapped(), monkeypatch, capsys)
    assert "shown by: models/traps/dx105" in page_of(registry.find_rule("DX105"), monkeypatch, capsys)
