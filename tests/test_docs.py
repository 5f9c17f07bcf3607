"""Pages of docs that are written by a program are those that it writes."""

from __future__ import annotations

import runpy
from pathlib import Path

import pytest

from dynx.rules import all_rules

DOCS = Path(__file__).parents[1] / "docs"


@pytest.fixture(scope="module")
def rules_page() -> str:
    """Return the text that the program writes now."""
    written = runpy.run_path(str(DOCS / "write_rules.py"))["page"]()
    assert isinstance(written, str)
    return written


def test_the_page_of_rules_is_current(rules_page: str) -> None:
    current = (DOCS / "rules.md").read_text(encoding="utf-8")
    assert current == rules_page, "run: python docs/write_rules.py"


def test_every_rule_has_one_anchor_and_its_trap_is_linked(rules_page: str) -> None:
    for rule in all_rules():
        assert rules_page.count(f'<a id="{rule.id.lower()}"></a>') == 1
        assert f"(../models/traps/{rule.trap()})" in rules_page
