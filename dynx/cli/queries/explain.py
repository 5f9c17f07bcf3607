"""``dynx explain``: the pages of the catalogue of causes."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import click

from dynx.cli.shell.options import json_flag

if TYPE_CHECKING:
    from dynx.rules import Rule

_WIDEST = 100
"""Columns of prose on a terminal, however wide it is."""


@click.command(short_help="Explain a cause of disagreement, such as DX101.")
@click.argument("rule", required=False)
@json_flag
def explain(rule: str | None, as_json: bool) -> None:
    """Print the page of a RULE, by its id or its name: what it means, what each engine does, what to do.

    Without RULE, list all rules. A rule of kind "difference" makes engines give different numbers or
    refuse the file; "practice" is bad practice, or a matter of one engine alone.

    \b
    Examples:
      dynx explain
      dynx explain DX101
      dynx explain link-without-inertial --json
    """
    from dynx.cli.shell.terminal import echo_json
    from dynx.rules import all_rules, find_rule

    if rule is None:
        if as_json:
            echo_json({"schema": 1, "rules": [_as_dict(each) for each in all_rules()]})
        else:
            _list(all_rules())
        return
    found = find_rule(rule)
    if as_json:
        echo_json({"schema": 1, "rule": _as_dict(found)})
    else:
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
        "trap": rule.trap(),
        "page": rule.page(),
    }


def _list(rules: tuple[Rule, ...]) -> None:
    from dynx.cli.shell.tables import Table
    from dynx.cli.shell.terminal import console, counted

    table = Table("id", "name", "kind", "engines", "title")
    for rule in rules:
        table.add_row(rule.id, rule.name, rule.kind, ", ".join(rule.engines) or "-", rule.title)
    out = console()
    out.print(table)
    out.print(f"\n{counted(len(rules), 'rule')}; dynx explain ID prints the page of one")


def _print_page(rule: Rule) -> None:
    from dynx.cli.shell.terminal import console

    out = console()
    if not out.is_terminal:
        facts = "\n".join(f"{label}: {value}" for label, value in _facts(rule))
        out.print(f"{rule.page()}\n\n{facts}")
        return
    from rich.markdown import Markdown

    heading, _, body = rule.page().partition("\n\n")
    facts = "\n".join(f"- **{label}**: {value}" for label, value in _facts(rule))
    out.print(
        Markdown(f"# {' '.join(heading.split())}\n\n{body}\n\n{facts}"),
        width=min(out.width, _WIDEST),
        soft_wrap=False,
    )


def _facts(rule: Rule) -> Iterator[tuple[str, str]]:
    """What the program knows of a rule beside its page."""
    yield "kind", rule.kind
    if rule.engines:
        yield "engines", ", ".join(f"{engine} {versions}" for engine, versions in rule.engines.items())
    yield "advice", rule.advice
    for name, meaning in rule.choices.items():
        yield f"--choose {rule.id}={name}", meaning
    yield "shown by", f"models/traps/{rule.trap()}"
