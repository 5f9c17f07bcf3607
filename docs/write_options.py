"""Write the table of options in docs/reference/simulation.md from their declarations.

    python docs/write_options.py

tests/test_docs.py checks that the table is current.
"""

from __future__ import annotations

from pathlib import Path

from dynx.sim.scenario.options import OPTIONS, JointNumbers

PAGE = Path(__file__).parent / "reference/simulation.md"
BEGIN, END = "<!-- written by docs/write_options.py -->\n", "<!-- end -->\n"


def table() -> str:
    """The table of all options; those with "rows" may differ between the rollouts of a batch."""
    lines = [("option", "meaning", "unit", "values", "default", "batch"), ("---",) * 6]
    for name, each in OPTIONS.items():
        default = each.default_text or ("none" if each.default == () else str(each.default))
        # The page explains joint numbers once, above the table.
        values = "joint numbers" if isinstance(each.kind, JointNumbers) else each.kind.values
        lines.append((f"`{name}`", each.help, each.unit, values, default, "rows" * each.rows))
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def page(text: str) -> str:
    """The text of the page with the table as it is now."""
    before, begin, rest = text.partition(BEGIN)
    _, end, after = rest.partition(END)
    return before + begin + table() + end + after


if __name__ == "__main__":
    PAGE.write_text(page(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
