"""Body of ``dynx explain``: the pages of the catalogue of rules."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterator
from typing import Any

from rich.markdown import Markdown

from dynx.cli.shell.output import console, counted, write_json
from dynx.errors import RobotNotFoundError
from dynx.model.library import TRAPS
from dynx.rules import Rule, all_rules, find_rule
from dynx.rules.registry import find_trap

_MAX_WIDTH = 100
"""Width of prose on a terminal and of the list of rules, at most [columns]."""


def explain(rule: str | None, json_path: str | None) -> None:
    """Print the page of a rule, or the list of all rules."""
    if rule is None:
        if not write_json({"schema": 1, "rules": [_as_dict(each) for each in all_rules()]}, json_path):
            _list(all_rules())
        return
    found = find_rule(rule)
    if not write_json({"schema": 1, "rule": _as_dict(found)}, json_path):
        _print_page(found)


def _as_dict(rule: Rule) -> dict[str, Any]:
    return {
        "id": rule.id,
        "name": rule.name,
        "title": rule.title,
        "kind": rule.kind,
        "engines": dict(rule.engines),
        "advice": rule.advice,
        "choices": dict(rule.choices),
        "trap": None if _trap(rule) is None else rule.trap(),
        "page": rule.page(),
    }


def _list(rules: tuple[Rule, ...]) -> None:
    out = console()
    width = min(out.width, _MAX_WIDTH)
    indent = " " * (2 + max(len(rule.id) for rule in rules))
    for rule in rules:
        engines = f": {', '.join(rule.engines)}" if rule.engines else ""
        text = f"{rule.id:<{len(indent)}}{rule.name}: {rule.title} ({rule.kind}{engines})"
        lines = textwrap.wrap(
            text, width, subsequent_indent=indent, break_on_hyphens=False, break_long_words=False
        )
        out.print("\n".join(lines))
    out.print(f"\n{counted(len(rules), 'rule')}; dynx explain ID prints the page of a rule")


def _print_page(rule: Rule) -> None:
    out = console()
    if not out.is_terminal:
        facts = "\n".join(f"{label}: {value}" for label, value in _facts(rule))
        out.print(f"{rule.page()}\n\n{facts}")
        return
    heading, _, body = rule.page().partition("\n\n")
    facts = "\n".join(f"- **{label}**: {value}" for label, value in _facts(rule))
    out.print(
        Markdown(_without_tags(f"# {' '.join(heading.split())}\n\n{body}\n\n{facts}")),
        width=min(out.width, _MAX_WIDTH),
        soft_wrap=False,
    )


def _without_tags(text: str) -> str:
    """Return Markdown in which ``<inertial>`` outside code is text and no HTML, which would not be shown."""
    parts = re.split(r"(```.*?```|``.*?``|`[^`]*`)", text, flags=re.DOTALL)
    return "".join(part if k % 2 else part.replace("<", "\\<") for k, part in enumerate(parts))


def _facts(rule: Rule) -> Iterator[tuple[str, str]]:
    """Yield the facts about a rule that its page does not contain, as label and text."""
    yield "kind", rule.kind
    if rule.engines:
        yield "engines", ", ".join(f"{engine} {versions}" for engine, versions in rule.engines.items())
    yield "advice", rule.advice
    for name, meaning in rule.choices.items():
        yield f"--choose {rule.id}={name}", meaning
    if (trap := _trap(rule)) is not None:
        yield "shown by", trap


def _trap(rule: Rule) -> str | None:
    """Return the file that shows the cause: below dynx's models, or beside the module of another package.

    None where there is none.
    """
    try:
        path = find_trap(rule)
    except RobotNotFoundError:
        return None
    return f"models/{TRAPS}/{path.name}" if type(rule).__module__.startswith("dynx.") else str(path)
