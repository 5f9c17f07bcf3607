"""Write the tables of docs/engines.md: what each engine gets right and wrong, measured on this machine.

    python -m docs.write_engines                 # every table, which takes ten minutes or more
    python -m docs.write_engines files speed     # these tables
    python -m docs.write_engines contacts --documents one.json other.json
                                                 # of runs of dynx contacts --json, each of other engines

Each table has the command that measured it, the day, the processor and the versions beside it. The text
between the tables is kept.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from datetime import date
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

import dynx
from benchmarks.surveys.distance_engines import ENGINES as DISTANCE_ENGINES
from benchmarks.surveys.distances import BLOCK, PLACEMENTS, Row, measure_block, shown
from benchmarks.surveys.files import SMALL, Entry, make_tasks, survey
from docs.page_parts import conditions, measured_before, replaced, table, two_digits
from docs.write_contacts import joined
from docs.write_results import output_of
from docs.write_results import shown as shown_command
from dynx.bench.machine import load
from dynx.cli.contacts import wording
from dynx.rules import find_rule

PAGE = Path(__file__).with_name("engines.md")
JOBS = 2
PAIRS = 2250
"""Pairs of shapes whose distances are compared."""
MAX_CAUSES = 8
"""Causes that are listed for an engine."""
AGREEING = ("ur5", "panda", "a1", "talos")
MECHANICS = ("forward_kinematics", "jacobian", "inverse_dynamics", "forward_dynamics", "mass_matrix")


def files() -> str:
    """Examine every file of example-robot-data, as `docs.survey` does."""
    paths = [str(robot.path) for robot in dynx.robots() if robot.source == "example-robot-data"]
    entries = survey(make_tasks(paths, ("fixed", "floating"), None, None), JOBS)
    done = [entry for entry in entries if "failed" not in entry and not entry["error"]]
    return (
        f"{len(paths)} files, each on a fixed and on a floating base; dynx reads {len(done)} of "
        f"{len(entries)}.\n\n{files_table(done)}\n{causes_table(done)}"
    )


def files_table(entries: Sequence[Entry]) -> str:
    """Return the number of files that each engine gets right and wrong, by quantity."""
    results = [each for entry in entries for each in entry["engines"]]
    names = list(dict.fromkeys(each["engine"] for each in results))
    quantities = list(dict.fromkeys(quantity for each in results for quantity in each["before"]))
    rows = []
    for name in names:
        own = [each for each in results if each["engine"] == name]
        used = [each for each in own if not (each["refused"] or each["not_used"])]
        wrong = [
            sum(quantity in each["before"] and is_wrong(each["before"][quantity]) for each in used)
            for quantity in quantities
        ]
        alike = sum(not any(map(is_wrong, each["before"].values())) for each in used)
        after = sum(
            not (
                each["refused_after"] or each["not_used_after"] or any(map(is_wrong, each["after"].values()))
            )
            for each in own
        )
        refused = sum(bool(each["refused"]) for each in own)
        unused = sum(bool(each["not_used"]) for each in own)
        numbers = (len(own), refused, unused, alike, *wrong, after)
        rows.append((f"{name} {own[0]['version']}", *map(str, numbers)))
    wrong_heads = (f"wrong {each.replace('_', ' ')}" for each in quantities)
    heads = ("engine", "files", "refused", "not usable", "right", *wrong_heads)
    return table(
        (*heads, "right after mending"), [tuple(cell.replace("_", " ") for cell in row) for row in rows]
    )


def is_wrong(error: float | None) -> bool:
    """Check whether an error is above `SMALL`, or is none because the engine has no result."""
    return error is None or error > SMALL


def causes_table(entries: Sequence[Entry]) -> str:
    """Return the causes that change the results of most files in each engine."""
    counts: dict[str, Counter[str]] = {}
    for entry in entries:
        found = {(engine, each["rule"]) for each in entry["findings"] for engine in wrong_engines(each)}
        for engine, rule in found:
            counts.setdefault(engine, Counter())[rule] += 1
    rows = [
        (engine, ", ".join(f"{linked(rule)} {number}" for rule, number in counter.most_common(MAX_CAUSES)))
        for engine, counter in sorted(counts.items())
    ]
    return table(
        ("engine", f"the most frequent proved causes of errors above {SMALL:g}, with the number of files"),
        rows,
    )


def wrong_engines(finding: Entry) -> Iterator[str]:
    """Return the engines in which a proved cause has an effect above `SMALL`, or prevents a result."""
    for engine, effect in finding["effects"].items():
        if finding["proved"] and is_wrong(effect["relative_error"]):
            yield engine


def linked(rule: str) -> str:
    """Return the number and the name of a rule, linked to the catalogue."""
    return f"[{rule}](rules.md#{rule.lower()}) {find_rule(rule).name}"


def mechanics() -> str:
    """Compare every backend with 50 digits, on the same description."""
    return mechanics_table(json.loads(output_of(COMMANDS["mechanics"])))


def mechanics_table(document: Mapping[str, Any]) -> str:
    """Return the largest error of each backend against the referee, by quantity."""
    errors: dict[str, dict[str, float]] = {}
    for result in document["results"]:
        for row in result["quantities"]:
            name, _, other = row["pair"].partition("~")
            if other == "referee" and row["max_rel_error"] is not None:
                found = errors.setdefault(name, {})
                quantity = row["quantity"]
                found[quantity] = max(found.get(quantity, 0.0), row["max_rel_error"])
    rows = [
        (name, *(f"{found[each]:.0e}" if each in found else "" for each in MECHANICS))
        for name, found in errors.items()
    ]
    return table(("engine", *(each.replace("_", " ") for each in MECHANICS)), rows)


def contacts() -> str:
    """Run every case of `dynx contacts`."""
    return contacts_tables(json.loads(output_of(COMMANDS["contacts"])))


def contacts_tables(report: Mapping[str, Any]) -> str:
    """Return the number of figures with each verdict, and the cases that an engine cannot get right."""
    ranks = wording.RANKS
    rows = [
        (f"{each['engine']} {each['version']}", *(str(each["verdicts"].get(rank, 0)) for rank in ranks))
        for each in report["engines"]
    ]
    by_engine = []
    for each in report["engines"]:
        cells = []
        for rank in ("setting", "cannot"):
            cases = [case["name"] for case in report["cases"] if has_verdict(case, each["engine"], rank)]
            cells.append(", ".join(f"`{name}`" for name in cases))
        by_engine.append((each["engine"], *cells))
    meanings = "".join(f"- *{rank}*: {wording.VERDICT_MEANINGS[rank]}\n" for rank in ranks)
    heads = (
        "engine",
        "cases with an error that a setting causes",
        "cases with an error because the engine lacks a parameter",
    )
    return f"{table(('engine', *ranks), rows)}\n{meanings}\n{table(heads, by_engine)}"


def has_verdict(case: Mapping[str, Any], engine: str, verdict: str) -> bool:
    """Check whether any figure of a case has a verdict in an engine."""
    return any(each["engine"] == engine and each["verdict"] == verdict for each in case["figures"])


def distances() -> str:
    """Compare distances of random pairs of shapes, as `benchmarks.surveys.distances` does."""
    engines = tuple(DISTANCE_ENGINES)
    with ProcessPoolExecutor(JOBS) as pool:
        blocks = list(pool.map(partial(measure_block, engines), range(-(-PAIRS // BLOCK))))
    return distances_table([row for block in blocks for row in block], engines)


def distances_table(rows: Sequence[Row], engines: Sequence[str]) -> str:
    """Return the largest and the median error of each engine as it comes, by placement."""
    lines = []
    for engine in engines:
        cells = []
        for place in PLACEMENTS:
            found = [(row.errors[engine][0], row.case) for row in rows if row.case[2] == place]
            errors = np.array([error for error, _ in found])
            worst = max(found)
            cells.append(
                f"{shown(worst[0])} ({worst[1][0]}, {worst[1][1]}); {shown(float(np.median(errors)))}"
            )
        lines.append((engine, *cells))
    return table(("engine", *(f"{place} [m]" for place in PLACEMENTS)), lines)


def speed() -> str:
    """Time one call and a batch of five quantities on every engine."""
    return speed_table(json.loads(output_of(COMMANDS["speed"])))


def speed_table(document: Mapping[str, Any]) -> str:
    """Return microseconds of one call and nanoseconds of a sample in a batch, by engine and quantity."""
    times: dict[str, dict[str, dict[int, float]]] = {}
    for result in document["results"]:
        for way in result["ways"]:
            if way["role"] == "backend" and way["ns"] is not None:
                found = times.setdefault(way["way"], {}).setdefault(result["quantity"], {})
                found[result["batch"]] = way["ns"]
    quantities = list(dict.fromkeys(result["quantity"] for result in document["results"]))
    rows = [
        (name, *(times_cell(found.get(quantity, {})) for quantity in quantities))
        for name, found in times.items()
    ]
    return table(("engine", *(each.replace("_", " ") for each in quantities)), rows)


def times_cell(by_batch: Mapping[int, float]) -> str:
    """Return the times of one sample and of a sample in the largest batch [us]."""
    return ", ".join(two_digits(by_batch[batch] / 1e3) for batch in sorted(by_batch))


PARTS: dict[str, Callable[[], str]] = {
    "files": files,
    "mechanics": mechanics,
    "contacts": contacts,
    "distances": distances,
    "speed": speed,
}
COMMANDS = {
    "mechanics": ("dynx", "agree", *AGREEING, "--json-samples", "--json", "-"),
    "contacts": ("dynx", "contacts", "--json", "-"),
    "speed": (
        "dynx",
        "bench",
        "ur5",
        "--batch",
        "1",
        "--batch",
        "1024",
        "--threads",
        "1",
        "--quick",
        "--json",
        "-",
    ),
}


def command(name: str) -> str:
    """Return the command that measures a part, as a user types it."""
    return shown_command(COMMANDS.get(name, ("docs.write_engines", name)))


def measured(name: str) -> str:
    """Return the text of a part: its command, the conditions and the tables."""
    before, began = load(), time.monotonic()
    text = PARTS[name]()
    return f"    {command(name)}\n\n{conditions(time.monotonic() - began, before)}\n{text}"


def contacts_of_documents(documents: Sequence[Path]) -> str:
    """Return the text of the part on contacts from documents of `dynx contacts --json`."""
    report = joined([json.loads(each.read_text(encoding="utf-8")) for each in documents])
    day = date.fromtimestamp(min(each.stat().st_mtime for each in documents))
    return f"    {command('contacts')}\n\n{measured_before(day)}\n{contacts_tables(report)}"


def main(arguments: Sequence[str]) -> None:
    """Measure the parts that are named, or all, and write the page."""
    parser = argparse.ArgumentParser(prog="python -m docs.write_engines", description=__doc__)
    parser.add_argument("parts", nargs="*", metavar="PART", help=f"one of {', '.join(PARTS)}; default: all")
    parser.add_argument("--documents", nargs="+", type=Path, metavar="FILE", help="for the part contacts")
    given = parser.parse_args(arguments)
    names = given.parts
    if given.documents and names != ["contacts"]:
        parser.error("--documents are for the part contacts alone")
    unknown = [name for name in names if name not in PARTS]
    if unknown:
        parser.error(f"no part {', '.join(unknown)}; known are {', '.join(PARTS)}")
    for name in names or PARTS:
        print(f"{name} ...", file=sys.stderr, flush=True)
        part = contacts_of_documents(given.documents) if given.documents else measured(name)
        PAGE.write_text(replaced(PAGE, PAGE.read_text(encoding="utf-8"), name, part), encoding="utf-8")


if __name__ == "__main__":
    # By its own name, so that worker processes find what they are to run.
    from docs.write_engines import main as run

    run(sys.argv[1:])
