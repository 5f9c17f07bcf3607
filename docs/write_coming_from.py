"""Write the tables of docs/coming-from: each call of a library, and the call of dynx that does the same.

    python docs/write_coming_from.py

The calls are those of `dynx.engine_names` and of the table of quantities, which AttributeErrors name, too;
tests/test_coming_from.py checks that the pages are current.
"""

from __future__ import annotations

import re
from pathlib import Path

from dynx.backends.quantities import QUANTITIES
from dynx.engine_names import TABLES, method_call

ROOT = Path(__file__).parents[1]
BEGIN = "<!-- written: calls -->\n"
END = "<!-- end -->"
OWNER = r"\b(?:dynx|World|Backend|Model|Scene|SceneRobot|PDMotor|Weld|numpy|gymnasium)"
NAME = OWNER + r"(?:\.\w+|\[\w+\]|\[:\d\])*"
CALL = re.compile(NAME + r"(?:\((?:[^()]|\([^()]*\))*\)|\b|(?<=\]))|<\w+>")


def page_of(library: str) -> str:
    """Return the file of the page ``Coming from ...`` for those who come from a library."""
    return f"docs/coming-from/{library.lower()}.md"


def calls(library: str) -> dict[str, str]:
    """Return the call of dynx by each name of a library, in the order of these names."""
    found = dict(TABLES[library])
    for quantity in QUANTITIES.values():
        if library in quantity.other_names:
            call = method_call(quantity)
            other = quantity.other_names[library]
            if other not in found:
                found[other] = call
            elif f"Backend.{quantity.name}(" not in found[other]:
                found[other] = f"{found[other]}; {call}"
    return dict(sorted(found.items(), key=lambda item: item[0].lower()))


def table(library: str) -> str:
    """Return the rows of a library."""
    rows = [f"| {library} | dynx |", "|---|---|"]
    for name, call in calls(library).items():
        rows.append(f"| `{name}` | {marked(call)} |")
    return "\n".join(rows) + "\n"


def marked(call: str) -> str:
    """Return a clause whose calls are marked as code."""
    parts = call.split("`")  # what is marked already
    return "`".join(part if k % 2 else CALL.sub(r"`\g<0>`", part) for k, part in enumerate(parts))


def page(library: str) -> str:
    """Return the page of a library with its present table."""
    text = (ROOT / page_of(library)).read_text(encoding="utf-8")
    head, _, rest = text.partition(BEGIN)
    return head + BEGIN + table(library) + END + rest.partition(END)[2]


if __name__ == "__main__":
    for each in TABLES:
        (ROOT / page_of(each)).write_text(page(each), encoding="utf-8")
