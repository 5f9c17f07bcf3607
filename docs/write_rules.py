"""Write docs/rules.md: all rules of the catalogue on one page, with an anchor for each.

    python docs/write_rules.py

The text comes from the docstrings of the rules' classes, which ``dynx explain`` prints; tests/test_docs.py
checks that the page is current. ``docs/rules.md#dx101`` is the address of a rule in reports.
"""

from __future__ import annotations

import re
from pathlib import Path

from dynx.rules import Rule, all_rules

PAGE = Path(__file__).with_name("rules.md")

HEAD = """<!-- Written by docs/write_rules.py from the classes in dynx/rules/catalogue; edit those. -->

# Why engines differ on a file

`dynx doctor` checks these rules. Each rule describes one reason why engines differ on a robot file, or one
bad practice. Rules have two kinds:

- A *difference* makes an engine return another result, or makes an engine refuse the file.
- A *practice* is bad practice, or a property of one engine, that causes no measurable difference.

Each rule names the versions of the engines with which it was measured. Its last line links a small robot
file that shows the cause. `dynx explain DX101` prints the text of a rule.

Words on this page:

- Two links are *rigidly connected* if all joints between them are fixed.
- The *principal moments* are the eigenvalues of an inertia tensor. In a tensor that *a body can have*, no
  principal moment is negative, and none exceeds the sum of the other two.
- The *largest double* is 1.7976931348623157e+308. dynx reads a limit of this size as "no limit".
- A *unit in the last place* is the distance from a number to the next double, about 1e-16 of the number.
- *Off by 1 %* means an error of 1 % of the largest entry of the right result.
- `dynx doctor --fix` writes a repaired copy of the file. Each rule describes its *remedy*.
- Some rules have several remedies, in lines with `--choose`. The first remedy is the default.
"""

GROUPS = {
    "1": "Inertia",
    "2": "Joints",
    "3": "Joint dynamics",
    "4": "Text",
    "5": "Practice",
    "6": "MJCF",
    "7": "SDF",
}


def page() -> str:
    """The whole page."""
    parts = [HEAD, _table()]
    for digit, group in GROUPS.items():
        rules = [rule for rule in all_rules() if rule.id[2] == digit]
        if rules:
            parts += [f"## {group}\n", *map(_section, rules)]
    return "\n".join(parts)


def _table() -> str:
    rows = ["| rule | kind | engines | what the rule reports |", "|---|---|---|---|"]
    for rule in all_rules():
        engines = ", ".join(rule.engines) or "-"
        link = f"[{rule.id}](#{rule.id.lower()}) {rule.name}"
        rows.append(f"| {link} | {rule.kind} | {engines} | {_escaped(rule.title)} |")
    return "\n".join([*rows, ""])


def _section(rule: Rule) -> str:
    _, _, body = rule.page().partition("\n\n")
    facts = [f"- kind: {rule.kind}"]
    if rule.engines:
        named = ", ".join(f"{engine} `{versions}`" for engine, versions in rule.engines.items())
        facts.append(f"- engines: {named}")
    facts.append(f"- advice: {_escaped(rule.advice)}")
    facts += [
        f"- `--choose {rule.id}={choice}`: {_escaped(meaning)}" for choice, meaning in rule.choices.items()
    ]
    facts.append(f"- shown by: [{rule.trap()}](../models/traps/{rule.trap()})")
    heading = f'<a id="{rule.id.lower()}"></a>\n\n### {rule.id} {rule.name}\n\n**{_escaped(rule.title)}**'
    return "\n".join([heading, "", _escaped(body), "", *facts, ""])


def _escaped(text: str) -> str:
    """Markdown in which a tag outside of code is shown, not taken for HTML."""
    parts = re.split(r"(``.*?``|`[^`]*`)", text, flags=re.DOTALL)
    return "".join(
        part if k % 2 else part.replace("<", "&lt;").replace("|", "\\|") for k, part in enumerate(parts)
    )


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
