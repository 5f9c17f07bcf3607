"""Write the tables of docs/contacts.md: the cases, and how far each engine is from mechanics in them.

    python -m docs.write_contacts                 # measures, which takes some minutes
    python -m docs.write_contacts contacts.json   # takes the document that dynx contacts --json wrote,
                                                  # or several, each of other engines

Tables stand between the marks of `docs.page_parts`; the other text of the page is kept.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from docs.page_parts import replaced, table
from dynx.cli.contacts import wording
from dynx.cli.contacts.page import causes, cell_figure
from dynx.contacts import find_cases

PAGE = Path(__file__).with_name("contacts.md")

LETTERS = (
    "In the following laws, g is the gravitational acceleration, and d/dt is the derivative with respect to "
    "time. Each law explains its other letters."
)
"""Paragraph before the list of laws."""

Entry = Mapping[str, Any]


def main(arguments: Sequence[str]) -> None:
    """Write the page."""
    documents = [Path(each).read_text(encoding="utf-8") for each in arguments] or [measured()]
    report = joined([json.loads(each) for each in documents])
    text = PAGE.read_text(encoding="utf-8")
    for name, part in {"cases": cases(), **results(report)}.items():
        text = replaced(PAGE, text, name, part)
    PAGE.write_text(text, encoding="utf-8")


def measured() -> str:
    """The document of a run of every case in every engine."""
    with TemporaryDirectory() as folder:
        path = os.path.join(folder, "contacts.json")
        done = subprocess.run([sys.executable, "-m", "dynx", "contacts", "--json", path], check=False)
        if done.returncode not in (0, 1):
            sys.exit(done.returncode)
        return Path(path).read_text(encoding="utf-8")


def joined(reports: Sequence[Entry]) -> Entry:
    """One document of runs of the same cases at the same steps, each with other engines."""
    first = reports[0]
    if any(each["steps"] != first["steps"] for each in reports):
        sys.exit("the documents have different steps")
    by_name = [{case["name"]: case for case in each["cases"]} for each in reports]
    if any(set(each) != set(by_name[0]) for each in by_name):
        sys.exit("the documents have different cases")
    cases_of_all = [
        {
            **case,
            **{part: [x for each in by_name for x in each[name][part]] for part in ("figures", "no_results")},
        }
        for name, case in by_name[0].items()
    ]
    engines = [engine for each in reports for engine in each["engines"]]
    return {**first, "engines": engines, "cases": cases_of_all, "runs": sum(each["runs"] for each in reports)}


def cases() -> str:
    """The table of cases, and a list with the law of each case."""
    found = find_cases()
    titles = table(("case", "title", "source"), ((f"`{c.name}`", c.title, c.source) for c in found))
    laws = "".join(f"- `{case.name}`: {case.law}\n" for case in found)
    return f"{titles}\n{LETTERS}\n\n{laws}"


def results(report: Entry) -> dict[str, str]:
    """The parts of the page that follow from a measurement, by name."""
    return {
        "conditions": conditions(report),
        "verdicts": verdicts(report),
        "settings": settings(report),
        "lacking": lacking(report),
        "pairs": pairs(report),
        "figures": figures(report),
    }


def conditions(report: Entry) -> str:
    """The engines with their versions, the steps, and the number of figures with each verdict."""
    engines = ", ".join(f"{each['engine']} {each['version']}" for each in report["engines"])
    found = [each["verdict"] for case in report["cases"] for each in case["figures"]]
    counts = ", ".join(f"{found.count(each)} {each}" for each in wording.RANKS if each in found)
    unexplained = found.count("unexplained")
    return (
        f"`python -m docs.write_contacts` measured {len(found)} figures of {len(report['cases'])} cases "
        f"({counts}), in {report['runs']} runs. The engines are {engines}. The time steps are "
        f"{wording.steps_text(report['steps'])}. "
        f"{f'{unexplained} errors are' if unexplained else 'No error is'} unexplained.\n"
    )


def verdicts(report: Entry) -> str:
    """The table of cases and engines: the verdict that deserves the first look, and its errors."""
    names = [each["engine"] for each in report["engines"]]
    rows = (
        (f"`{case['name']}`", *(cell(cell_figure(case, name)) for name in names)) for case in report["cases"]
    )
    return table(("case", *names), rows)


def cell(figure: Entry | None) -> str:
    """A verdict with the errors at the largest and the smallest step, and the values under bounds."""
    if figure is None:
        return ""
    order = f" ({wording.order_text(figure['order'])})" if figure["verdict"] == "falls" else ""
    values = "" if figure["most"] is None else f" (measured {wording.measured_text(figure)})"
    return f"{figure['verdict']}{order}, {wording.span_text(figure['errors'])}{values}"


def settings(report: Entry) -> str:
    """The table of settings that are causes, with the largest errors of a case before and after."""
    rows = [
        (
            *(removal.engine, f"`{removal.change}`", f"`{each.case}`: {each.figures}"),
            *(wording.span_text(each.before), wording.span_text(each.after), each.outcome),
            wording.price_text(each.price) if each.price else "",
        )
        for removal in causes(report["cases"])
        for each in removal.errors
    ]
    return table(("engine", "setting", "case", "errors", "with the setting", "outcome", "price"), rows)


def lacking(report: Entry) -> str:
    """The table of cases in which an engine cannot give an exact value, or refuses a trial."""
    found: dict[str, dict[str, list[str]]] = {}
    for case in report["cases"]:
        lost = {each["engine"]: each["message"] for each in case["no_results"]}
        cannot = [each for each in case["figures"] if each["verdict"] == "cannot"]
        lost |= {each["engine"]: each["reason"] for each in cannot}
        for engine, reason in lost.items():
            count = sum(each["engine"] == engine for each in cannot)
            what = f"`{case['name']}`" + (f" ({count} figures)" if count > 1 else "")
            found.setdefault(engine, {}).setdefault(reason, []).append(what)
    rows = (
        (engine, "; ".join(names), reason)
        for engine, reasons in found.items()
        for reason, names in reasons.items()
    )
    return table(("engine", "cases", "reason, for one figure of the case"), rows)


def pairs(report: Entry) -> str:
    """The table of effective coefficients of two materials."""
    names = [each["engine"] for each in report["engines"]]
    rows = []
    for case in report["cases"]:
        for name, found in (
            wording.figures_by_name(case).items() if case["name"] in wording.PAIR_CASES else ()
        ):
            exact = wording.coefficient_text(next(iter(found.values()))["exact"])
            rows.append((name, exact, *(effective(found.get(each)) for each in names)))
    return table(("materials", "geometric mean", *names), rows)


def effective(figure: Entry | None) -> str:
    """The measured value at the smallest step, with a verdict that is neither within nor falls."""
    if figure is None:
        return ""
    verdict = "" if figure["verdict"] in ("within", "falls") else f" ({figure['verdict']})"
    return wording.coefficient_text(figure["measured"][-1]) + verdict


def figures(report: Entry) -> str:
    """The table of every figure: its tolerance and the errors of each engine."""
    names = [each["engine"] for each in report["engines"]]
    rows = []
    for case in report["cases"]:
        for name, found in wording.figures_by_name(case).items():
            first = next(iter(found.values()))
            rows.append(
                (
                    f"`{case['name']}`",
                    name,
                    wording.exact_text(first),
                    f"{first['tolerance']:.0e}",
                    *(cell(found.get(each)) for each in names),
                )
            )
    return table(("case", "figure", "exact", "tolerance", *names), rows)


if __name__ == "__main__":
    main(sys.argv[1:])
