"""The list of mutants that no test can catch describes lines that are there."""

from __future__ import annotations

import ast
import json
from pathlib import Path

import pytest

from tests.mutation.report import EQUIVALENT

ROOT = Path(__file__).parents[2]
ENTRIES: list[dict[str, str]] = json.loads(EQUIVALENT.read_text(encoding="utf-8"))


def function_lines(path: Path, function: str) -> list[str]:
    """Return the lines of a function ``Class.name`` without indentation; of the module for an empty name.
    Raises KeyError where there is none."""
    text = path.read_text(encoding="utf-8")
    body: ast.AST = ast.parse(text)
    for name in filter(None, function.split(".")):
        defined = {
            node.name: node for node in ast.walk(body) if isinstance(node, ast.FunctionDef | ast.ClassDef)
        }
        body = defined[name]
    lines = [line.strip() for line in text.splitlines()]
    if isinstance(body, ast.FunctionDef | ast.ClassDef):
        return lines[body.lineno - 1 : body.end_lineno]
    return lines


@pytest.mark.parametrize("entry", ENTRIES, ids=lambda entry: f"{entry['path']}:{entry['function']}")
def test_an_entry_is_a_mutant_of_the_code_as_it_stands(entry: dict[str, str]) -> None:
    assert set(entry) == {"path", "function", "before", "after", "reason"}
    assert entry["before"] in function_lines(ROOT / entry["path"], entry["function"])
    assert entry["after"] != entry["before"]


def test_entries_of_code_that_is_gone_are_found(tmp_path: Path) -> None:
    source = tmp_path / "f.py"
    source.write_text("class A:\n    def f(self):\n        return 1\n\n\ndef f():\n    return 2\n")
    assert "return 1" in function_lines(source, "A.f")
    assert "return 2" not in function_lines(source, "A.f")
    assert "return 2" in function_lines(source, "")
    with pytest.raises(KeyError):
        function_lines(source, "A.g")


def test_no_entry_is_listed_twice() -> None:
    keys = [(each["path"], each["function"], each["before"], each["after"]) for each in ENTRIES]
    assert len(keys) == len(set(keys))
