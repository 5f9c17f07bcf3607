"""Examine all files of example-robot-data and pybullet_data as engines load them; write real_robots.md.

    python -m docs.survey [--only erd|pybullet] [--engines a,b] [--jobs N] [--json OUT] [--mended FOLDER]

Each file is examined on a fixed and on a floating base; see benchmarks/surveys/files.py for the options. The
results are written as tables of causes and effects by robot. With ``--only`` the other section
of the page stays, and with ``--engines`` the whole page.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Iterator, Sequence
from pathlib import Path

import dynx
from benchmarks.surveys.files import Entry, add_options, counts, make_tasks, remarks, survey
from docs.page_parts import replaced

_NO_ANSWER, _PRESENT = "no answer", "present"

PAGE = Path(__file__).with_name("real_robots.md")
GROUPS = {"erd": "example-robot-data", "pybullet": "pybullet_data"}


def files() -> Iterator[tuple[str, str]]:
    """(group, path) of every file."""
    for robot in dynx.robots():
        if robot.source == "example-robot-data":
            yield "erd", str(robot.path)
    import pybullet_data

    for path in sorted(Path(pybullet_data.getDataPath()).rglob("*.urdf")):
        yield "pybullet", str(path)


def main() -> None:
    """Examine, print what remains unexplained, write the page."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--only", choices=["erd", "pybullet"])
    add_options(parser)
    options = parser.parse_args()
    groups = {path: group for group, path in files() if options.only in (None, group)}
    tasks = make_tasks(groups, ("fixed", "floating"), options.engines, options.mended)
    entries = survey(tasks, options.jobs, options.seconds, options.json)
    for entry in entries:
        entry["group"] = groups[entry["path"]]
    entries.sort(key=lambda entry: (entry["group"], entry["path"], entry["base"]))
    summary(entries)
    if options.engines:
        return  # the page is about all engines
    text = PAGE.read_text(encoding="utf-8")
    for group in sorted(set(groups.values())):
        of = [entry for entry in entries if entry["group"] == group]
        text = replaced(PAGE, text, group, "\n".join(section(of)) + "\n")
    PAGE.write_text(text, encoding="utf-8")


def summary(entries: Sequence[Entry]) -> None:
    """Counts, and all robots with remaining differences or errors."""
    for group in GROUPS:
        for base in ("fixed", "floating"):
            of = [entry for entry in entries if (entry["group"], entry["base"]) == (group, base)]
            if of:
                print(f"{group} {base}: {counts(of)}")
            for entry in of:
                for line in exceptions(entry):
                    print(f"  {label(entry)}: {line}")


def exceptions(entry: Entry) -> Iterator[str]:
    """The remarks on a file, with its label for its path."""
    for line in remarks(entry):
        yield line.replace(entry["path"], label(entry))


def section(entries: Sequence[Entry]) -> Iterator[str]:
    """Yield the lines of a collection: counts, causes and effects by robot, files without results."""
    for base in ("fixed", "floating"):
        yield f"- {base} base: {counts([entry for entry in entries if entry['base'] == base])}"
    yield from ("", "| file | base | cause | places | effect | engines |", "|---|---|---|---|---|---|")
    yield from merged([row for entry in entries for row in rows(entry)])
    left = [f"- {label(entry)}, {entry['base']}: {line}" for entry in entries for line in exceptions(entry)]
    if left:
        yield ""
        yield (
            "The next list has files that dynx refused, and engines without results for a file. Such an "
            "engine was not used, or does not load the file even after dynx's repair:"
        )
        yield ""
        yield from left


def rows(entry: Entry) -> Iterator[tuple[str, ...]]:
    """One row for each rule that has an effect on the file."""
    by_rule: dict[str, list[Entry]] = {}
    for finding in entry["findings"]:
        if finding["effect"]:
            by_rule.setdefault(finding["rule"], []).append(finding)
    for rule, found in sorted(by_rule.items()):
        worst = max((finding["effect"] for finding in found), key=_rank)
        engines = ", ".join(sorted({engine for finding in found for engine in finding["engines"]}))
        name = f"[{rule}](rules.md#{rule.lower()}) {found[0]['name']}"
        yield label(entry), entry["base"], name, str(len(found)), _text(worst), engines


def _rank(effect: Entry) -> float:
    """Order of effects: by the error, an engine without a result after every number."""
    if effect["relative_error"] is not None:
        return float(effect["relative_error"])
    return 0.0 if effect["quantity"] == "contact_forces" else math.inf


def _text(effect: Entry) -> str:
    """The effect in the table; forces of contacts depend on the state so much that they have no number."""
    if effect["relative_error"] is not None:
        return f"{effect['relative_error']:.1e}"
    return _PRESENT if effect["quantity"] == "contact_forces" else _NO_ANSWER


def merged(table: Sequence[tuple[str, ...]]) -> list[str]:
    """The rows as text; many files of one folder with the same cause become one row with a range."""
    groups: dict[tuple[str, ...], list[tuple[str, ...]]] = {}
    for row in table:
        folder = str(Path(row[0]).parent.parent)
        alike = (folder, *row[1:4], row[5]) if folder.endswith("random_urdfs") else row
        groups.setdefault(alike, []).append(row)
    lines = []
    for rows_alike in groups.values():
        first = rows_alike[0]
        name = first[0]
        effect = first[4]
        if len(rows_alike) > 1:
            name = f"{name} and {len(rows_alike) - 1} more in that folder"
            effects = sorted({row[4] for row in rows_alike})
            numbers = [float(text) for text in effects if text not in (_PRESENT, _NO_ANSWER)]
            effect = f"{min(numbers):.1e} to {max(numbers):.1e}" if numbers else ", ".join(effects)
        lines.append(f"| {name} | {first[1]} | {first[2]} | {first[3]} | {effect} | {first[5]} |")
    return lines


def label(entry: Entry) -> str:
    """The path of a file within its collection."""
    parts = Path(entry["path"]).parts
    root = "robots" if entry["group"] == "erd" else "pybullet_data"
    return "/".join(parts[parts.index(root) + 1 :]) if root in parts else parts[-1]


if __name__ == "__main__":
    main()
