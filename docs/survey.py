"""Examine every file of example-robot-data and pybullet_data as engines load it; write real_robots.md.

    python docs/survey.py [--only erd|pybullet] [--engines a,b] [--jobs N] [--mended FOLDER]

Each file is examined on a fixed and on a floating base. The results of `dynx.diagnose` are written as tables
of causes and effects by robot. `--mended FOLDER` keeps the corrected files, with a list that
`tests/doctor/raw_*.py` check.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import dynx
from dynx.doctor import diagnose
from dynx.workers import Workers

SMALL = 1e-6
"""Relative difference below which robots are counted separately, as differences of rounding."""

GROUPS = {"erd": "example-robot-data", "pybullet": "pybullet_data"}


@dataclass(frozen=True)
class Task:
    """One file on one base."""

    group: str
    path: str
    base: Any
    engines: tuple[str, ...] | None
    mended: str | None


def examine(task: Task) -> dict[str, Any]:
    """The entry of the report, and the path of the corrected file."""
    report = diagnose(task.path, base=task.base, engines=task.engines, counterexamples=False)
    entry = report.to_dict()
    entry["group"], entry["path"] = task.group, task.path
    if task.mended and report.error is None:
        name = f"{task.group}-{task.base}-{abs(hash(task.path)):x}.urdf"
        where = Path(task.mended) / name
        text = report.mended if report.mended is not None else report.text
        where.write_text(text or "", encoding="utf-8")
        entry["mended"] = str(where)
    return entry


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
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", choices=["erd", "pybullet"])
    parser.add_argument("--engines")
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--mended")
    parser.add_argument("--json")
    options = parser.parse_args()
    engines = tuple(options.engines.split(",")) if options.engines else None
    if options.mended:
        Path(options.mended).mkdir(parents=True, exist_ok=True)
    tasks = [
        Task(group, path, base, engines, options.mended)
        for group, path in files()
        if options.only in (None, group)
        for base in ("fixed", "floating")
    ]
    entries: list[dict[str, Any]] = []
    with Workers(examine, options.jobs, timeout=300.0) as workers:
        for outcome in workers.run(tasks):
            task = tasks[outcome.index]
            if outcome.failure is None:
                entries.append(outcome.value)
            else:
                print(f"FAILED {task.path} {task.base}: {outcome.failure.message}")
            if entries and len(entries) % 100 == 0:
                print(f"{len(entries)} of {len(tasks)}", flush=True)
    entries.sort(key=lambda entry: (entry["group"], entry["path"], entry["base"]))
    if options.json:
        Path(options.json).write_text(json.dumps(entries), encoding="utf-8")
    summary(entries)
    if not options.only:
        Path(__file__).with_name("real_robots.md").write_text(page(entries), encoding="utf-8")


def summary(entries: Sequence[dict[str, Any]]) -> None:
    """Counts, and all robots with remaining differences or errors."""
    for group in ("erd", "pybullet"):
        for base in ("fixed", "floating"):
            of = [entry for entry in entries if (entry["group"], entry["base"]) == (group, base)]
            if of:
                print(f"{group} {base}: {counts(of)}")
            for entry in of:
                for line in remarks(entry):
                    print(f"  {label(entry)}: {line}")


def counts(entries: Sequence[dict[str, Any]]) -> str:
    """Summarise as in ``69 files: 1 refused, 46 differ, 0 with something unexplained``."""
    refused = sum(entry["error"] is not None for entry in entries)
    different = sum(differs(entry) for entry in entries)
    large = sum(differs(entry, SMALL) for entry in entries)
    left = sum(bool(entry["unexplained"]) for entry in entries)
    return (
        f"{len(entries)} files: {refused} refused, {different} differ ({large} by more than {SMALL:g}), "
        f"{left} with something unexplained"
    )


def remarks(entry: dict[str, Any]) -> Iterator[str]:
    """The remaining differences and errors of one file."""
    if entry["error"]:
        yield f"refused: {entry['error']['message'].replace(entry['path'], label(entry))}"
    for each in entry["unexplained"]:
        yield f"unexplained: {each['engine']} {each['quantity']} {each['relative_error']}"
    for rule in sorted({f["rule"] for f in entry["findings"] if f["effect"] and not f["proved"]}):
        yield f"unproved: {rule}"
    for each in entry["engines"]:
        if each["refused_after"]:
            yield f"{each['engine']} does not load it: {each['refused_after']}"


def differs(entry: dict[str, Any], above: float | None = None) -> bool:
    """Whether any engine differs from the file above the tolerance, or refuses it."""
    limit = entry["tolerance"] if above is None else above
    return any(
        engine["refused"] or any(error is None or error > limit for error in engine["before"].values())
        for engine in entry["engines"]
    )


def page(entries: Sequence[dict[str, Any]]) -> str:
    """The page: counts, then a table of causes and effects by robot."""
    lines = [
        "# Real robots: why engines differ on them",
        "",
        "Written by `python docs/survey.py`. Every file is loaded by each engine as its users load it, fixed "
        "and floating, and compared with reference values; see [doctor.md](doctor.md). The effect of a cause "
        "is how much an engine's result changes when that cause alone is removed, relative to the "
        "largest reference value; `no answer` means that the engine refuses the file, or cannot compute the "
        "quantity, until "
        "it is removed. Every cause listed is proved. Rules are explained in [rules.md](rules.md).",
        "",
    ]
    for group, title in GROUPS.items():
        of = [entry for entry in entries if entry["group"] == group]
        if not of:
            continue
        lines += [f"## {title}", ""]
        lines += [
            f"- {base} base: {counts([entry for entry in of if entry['base'] == base])}"
            for base in ("fixed", "floating")
        ]
        lines += ["", "| file | base | cause | places | effect | engines |", "|---|---|---|---|---|---|"]
        lines += merged([row for entry in of for row in rows(entry)])
        exceptions = [f"- {label(entry)}, {entry['base']}: {line}" for entry in of for line in remarks(entry)]
        if exceptions:
            lines += ["", "Not examined, or not loaded by an engine after mending either:", "", *exceptions]
        lines.append("")
    return "\n".join(lines)


def rows(entry: dict[str, Any]) -> Iterator[tuple[str, ...]]:
    """One row for each rule that has an effect on the file."""
    by_rule: dict[str, list[dict[str, Any]]] = {}
    for finding in entry["findings"]:
        if finding["effect"]:
            by_rule.setdefault(finding["rule"], []).append(finding)
    for rule, found in sorted(by_rule.items()):
        sizes = [finding["effect"]["relative_error"] for finding in found]
        worst = "no answer" if None in sizes else f"{max(sizes):.1e}"
        engines = ", ".join(sorted({engine for finding in found for engine in finding["engines"]}))
        name = f"[{rule}](rules.md#{rule.lower()}) {found[0]['name']}"
        yield label(entry), entry["base"], name, str(len(found)), worst, engines


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
            effects = sorted({row[4] for row in rows_alike}, key=lambda text: (text == "no answer", text))
            numbers = [float(text) for text in effects if text != "no answer"]
            effect = f"{min(numbers):.1e} to {max(numbers):.1e}" if numbers else "no answer"
        lines.append(f"| {name} | {first[1]} | {first[2]} | {first[3]} | {effect} | {first[5]} |")
    return lines


def label(entry: dict[str, Any]) -> str:
    """The path of a file within its collection."""
    parts = Path(entry["path"]).parts
    root = "robots" if entry["group"] == "erd" else "pybullet_data"
    return "/".join(parts[parts.index(root) + 1 :]) if root in parts else parts[-1]


if __name__ == "__main__":
    # By its own name, so that worker processes find what they are to run.
    from survey import main as run

    run()
