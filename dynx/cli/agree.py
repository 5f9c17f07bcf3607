"""Run of ``dynx agree``: each robot is compared in a worker process, then come files and tables."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import click
from rich.console import Console
from rich.text import Text

from dynx.agreement.agreement import AgreementTask, measure, refused
from dynx.agreement.report import AgreementReport, results_document, summarized
from dynx.backends.registry import backend_class
from dynx.cli.shell.exits import BAD_INPUT, DONE, NEGATIVE_RESULT, complain, failure_of, one_line, short_line
from dynx.cli.shell.inputs import Locks, pose_of
from dynx.cli.shell.lazy import import_object
from dynx.cli.shell.output import Entry, check_json, console, counted, require_apart, summary_line, write_json
from dynx.cli.shell.run import TaskRun, carry_out
from dynx.cli.shell.tables import Table
from dynx.errors import DynxError
from dynx.model.expansion import expand, refusals
from dynx.model.tree import Base

AgreementRun = TaskRun[AgreementTask, AgreementReport]


def agree(
    robots: tuple[str, ...],
    backends: tuple[str, ...] | None,
    as_loaded: bool,
    base: Base | None,
    base_pose: list[float] | None,
    lock: Locks,
    samples: int | None,
    seed: int,
    jobs: int | None,
    timeout: float,
    json_path: str | None,
    json_samples: bool,
    quiet: bool,
) -> int:
    """Compare the engines on each robot; return the exit code."""
    if as_loaded:
        if lock or base_pose is not None:
            option = "--lock" if lock else "--base-pose"
            raise click.UsageError(f"{option} changes the robot, and --as-loaded compares files as they are")
        # Importing the doctor here would take a third of the time that other comparisons need to start.
        compare: Callable[..., int] = import_object("dynx.cli.doctor.as_loaded:compare")
        return compare(
            robots,
            base or "fixed",
            backends,
            samples,
            seed,
            jobs=jobs,
            timeout=timeout,
            json_path=json_path,
            quiet=quiet,
        )
    check_json(json_path)
    for name in backends or ():  # Checked once, so that an error is not reported for every robot.
        backend_class(name)
    found = expand(robots)
    inputs = found.robots
    if json_path is not None:
        require_apart([json_path], (each.robot for each in inputs), "a robot that is read")
    pose = None if base_pose is None else pose_of(base_pose, "--base-pose")
    tasks = [AgreementTask(each.robot, base, lock, backends, samples, seed, pose) for each in inputs]
    run = agreement_run(tasks, refusals=refusals(inputs), left_out=found.left_out)
    return carry_out(run, jobs, timeout, quiet, lambda: _report(run, json_path, json_samples, quiet))


def agreement_run(
    tasks: Sequence[AgreementTask],
    target: Callable[[AgreementTask], AgreementReport] = measure,
    refusals: dict[int, DynxError] | None = None,
    left_out: Sequence[str] = (),
) -> AgreementRun:
    """Prepare the run of ``dynx agree``."""
    return TaskRun(tasks, target, refused, _problem, _verdict, "comparing", refusals, left_out)


def _verdict(report: AgreementReport) -> str:
    return _problem(report) or "agree"


def _problem(report: AgreementReport) -> str | None:
    if report.error is not None:
        return "refused"
    return None if report.agree else "differ"


def _report(run: AgreementRun, json_path: str | None, json_samples: bool, quiet: bool) -> int:
    """Write the document, the tables and the errors; return the exit code."""
    document = results_document(run.results, run.not_done, run.left_out)
    entries: list[dict[str, Any]] = document["results"]
    # The document is written first, so that it is not lost if a pipe closes while the table is written.
    error = failure_of(write_json, document if json_samples else summarized(document), json_path)
    if not quiet:
        out = console(err=json_path == "-")
        if len(run.tasks) == 1:
            for entry in entries:
                show_one(out, entry)
        else:
            show_many(out, entries)
            show_summary(out, document["summary"], run.seconds)
    for entry in entries:
        if verdict(entry) == "refused":
            complain(_refusal(entry))
    if error is not None:
        complain(str(error))
    if error is not None or document["summary"]["refused"]:
        return BAD_INPUT
    return NEGATIVE_RESULT if document["summary"]["differ"] else DONE


def _refusal(entry: dict[str, Any]) -> str:
    """Write the reason why a robot was refused, after its name where the message does not contain that."""
    message: str = entry["error"]["message"]
    return message if entry["robot"] in message else f"{label(entry)}: {message}"


Check = dict[str, Any]
"""An entry of ``quantities`` or ``identities``."""

_TITLES: dict[str | None, str] = {
    None: "largest difference between two engines",
    "referee": "error against the referee (50 digits)",
    "derived": "engine's own result against the one derived from its poses and torques",
}
"""Titles of the tables by the reference of a pair; None for pairs of two backends."""

_ITERATIVE_QUANTITY = "inverse_kinematics"
"""Quantity found by iteration: its error is the tolerance of the iteration, not rounding."""

_MAX_DIFFERENCES = 6
"""Number of differences listed for each of several robots; the JSON document has all."""


def show_one(out: Console, entry: Entry) -> None:
    """Print the full report of one robot: quantities by pair, identities by backend, notes."""
    if verdict(entry) == "refused":
        out.print(f"{label(entry)}: refused")
        return
    out.print(
        f"{label(entry)}, {entry['base']} base, nq {entry['nq']}, nv {entry['nv']}, "
        f"{counted(entry['samples'], 'sample')}, seed {entry['seed']}  ({one_line(entry['source'])})",
        style="bold",
    )
    checks: list[Check] = entry["quantities"]
    for reference, title in _TITLES.items():
        group = [check for check in checks if _reference(check) == reference]
        if group:
            out.print(f"\n{title}, relative", style="bold")
            out.print(_pivot(group, "quantity", "pair", "max_rel_error"))
    identities: list[Check] = entry["identities"]
    if identities:
        out.print("\nresidual of the laws of mechanics, relative", style="bold")
        out.print(_pivot(identities, "identity", "backend", "max_error"))
    out.print()
    for note in dict.fromkeys(filter(None, (check["note"] for check in [*checks, *identities]))):
        out.print(f"* {one_line(note)}")
    for note in entry["notes"]:
        out.print(f"note: {one_line(note)}", style="yellow")
    _show_differences(out, entry, None)
    out.print(_conclusion(entry))


def show_many(out: Console, entries: Sequence[Entry]) -> None:
    """Print one line for each robot, then the differences."""
    pairs = list(dict.fromkeys(c["pair"] for e in entries for c in e["quantities"] if _reference(c) is None))
    found = {_reference(check) for entry in entries for check in entry["quantities"]}
    references = [each for each in _TITLES if each is not None and each in found]
    headings = [_heading(pair) for pair in pairs]
    right = ["nv", *headings, *references, "s"]
    table = Table("robot", "nv", *headings, *references, "verdict", "s", right=right, keys=1)
    for entry in entries:
        checks: list[Check] = entry["quantities"]
        cells = [_largest_error([check for check in checks if check["pair"] == pair]) for pair in pairs]
        cells += [
            _largest_error([each for each in checks if _reference(each) == name]) for name in references
        ]
        refused = verdict(entry) == "refused"
        table.add_row(
            label(entry),
            "" if refused else str(entry["nv"]),
            *cells,
            _verdict_text(entry),
            f"{entry['seconds']:.1f}",
        )
    out.print(
        "largest relative error over all quantities except inverse kinematics",
        style="bold",
    )
    out.print(table)
    out.print()
    for entry in entries:
        _show_differences(out, entry, _MAX_DIFFERENCES)


def show_summary(out: Console, summary: dict[str, int], seconds: float) -> None:
    """Print the last line: the counts of the document's ``summary``, and the time."""
    counts = {word: summary[word] for word in ("agree", "differ", "refused")}
    out.print(summary_line(counted(summary["robots"], "robot"), counts, summary["not_done"], seconds))


def label(entry: Entry) -> str:
    """Return the robot of an entry as one short line."""
    return short_line(entry["robot"])


def verdict(entry: Entry) -> str:
    """Return ``agree``, ``differ`` or ``refused``."""
    if entry["error"] is not None:
        return "refused"
    return "agree" if entry["agree"] else "differ"


def _pivot(checks: Sequence[Check], row_key: str, column_key: str, error_key: str) -> Table:
    """Make a row for each quantity or identity, with a column for each pair or backend."""
    columns = list(dict.fromkeys(check[column_key] for check in checks))
    headings = [_heading(column) for column in columns]
    right = [*headings, "tolerance", "digits"]
    table = Table(row_key, *headings, "tolerance", "digits", "verdict", right=right, keys=1)
    for row in dict.fromkeys(check[row_key] for check in checks):
        of_row = [check for check in checks if check[row_key] == row]
        by_column = {check[column_key]: check for check in of_row}
        largest = max(of_row, key=lambda check: _severity(check, error_key))
        table.add_row(
            row.replace("_", " "),
            *(_cell(by_column.get(column), error_key) for column in columns),
            f"{largest['tolerance']:.1e}",
            _digits(largest[error_key]),
            _agreement(all(check["agree"] for check in of_row)),
        )
    return table


def _reference(check: Check) -> str | None:
    """Return ``referee`` or ``derived``, or None where the pair is two backends."""
    partner = check["pair"].partition("~")[2]
    return partner if partner in _TITLES else None


def _heading(pair: str) -> str:
    """Write a pair of backends in two lines; for a pair with a reference, write only the backend."""
    first, _, partner = pair.partition("~")
    return first if not partner or partner in _TITLES else f"{first}\n~{partner}"


def _severity(check: Check, error_key: str) -> float:
    error = check[error_key]
    if error is None:
        return -1.0 if check["agree"] else math.inf
    return math.inf if not check["tolerance"] else error / check["tolerance"]


def _cell(check: Check | None, error_key: str) -> Text:
    if check is None:
        return Text("")
    mark = "*" if check["note"] else ""
    return Text(_error(check[error_key], check["agree"]) + mark, "" if check["agree"] else "bold red")


def _largest_error(checks: Sequence[Check]) -> Text:
    if not checks:
        return Text("")
    agree = all(check["agree"] for check in checks)
    known = _rounding_errors(checks)
    failed = any(check["max_rel_error"] is None and not check["agree"] for check in checks)
    text = "none" if failed else _error(max(known, default=None), agree)
    return Text(text, "" if agree else "bold red")


def _rounding_errors(checks: Sequence[Check]) -> list[float]:
    """Return the relative errors that are due to rounding: all but those of iterations."""
    return [
        check["max_rel_error"]
        for check in checks
        if check["max_rel_error"] is not None
        and (check["quantity"] != _ITERATIVE_QUANTITY or not check["agree"])
    ]


def _error(error: float | None, agree: bool) -> str:
    """Write an error with two digits, or ``none`` where a result was absent."""
    if error is None:
        return "-" if agree else "none"
    return "0" if error == 0.0 else f"{error:.1e}"


def _digits(error: float | None) -> str:
    """Write the number of agreeing decimal digits, at most 16, the precision of a double."""
    if error is None or math.isnan(error):
        return "-"
    if error == 0.0:
        return "16.0"
    return f"{min(16.0, max(0.0, -math.log10(error))):.1f}"


def _agreement(agree: bool) -> Text:
    return Text("agree", "green") if agree else Text("DIFFER", "bold red")


def _verdict_text(entry: Entry) -> Text:
    if verdict(entry) == "refused":
        return Text(f"refused ({entry['error']['type']})", "yellow")
    return _agreement(entry["agree"])


def _show_differences(out: Console, entry: Entry, limit: int | None) -> None:
    """Print the checks that failed, each with the sample of its largest error, and the suspects."""
    failed = [
        *((check, check["quantity"], check["pair"], check["max_rel_error"]) for check in entry["quantities"]),
        *((check, check["identity"], check["backend"], check["max_error"]) for check in entry["identities"]),
    ]
    lines = [_difference(*each) for each in failed if not each[0]["agree"]]
    for line in lines[:limit]:
        out.print(f"{label(entry)}: {line}", style="red")
    if limit is not None and len(lines) > limit:
        out.print(f"{label(entry)}: and {len(lines) - limit} more", style="red")
    for suspect in entry["suspects"][:limit]:
        evidence = one_line("; ".join(suspect["evidence"]))
        what = suspect["quantity"].replace("_", " ")
        out.print(f"{label(entry)}: suspect {suspect['backend']}, {what}: {evidence}", style="red")


def _difference(check: Check, what: str, who: str, error: float | None) -> str:
    sample = check["worst_sample"]
    where = "" if sample is None else f", sample {sample['index']} ({sample['kind']})"
    if sample is not None and sample["frame"] is not None:
        where += f", frame {one_line(sample['frame'])}"
    why = f" ({one_line(check['note'])})" if check["note"] else ""
    return (
        f"{what.replace('_', ' ')} of {who}: error {_error(error, False)}, "
        f"tolerance {check['tolerance']:.1e}{where}{why}"
    )


def _conclusion(entry: Entry) -> Text:
    """Make the last line: whether the engines agree, and to how many digits."""
    engines: list[str] = entry["backends"]
    agree: bool = entry["agree"]
    if len(engines) == 1:
        words = "agrees with" if agree else "DIFFERS from"
        text, whose = f"{engines[0]} alone {words} the referee and the laws of mechanics", "its"
    else:
        text = f"{', '.join(engines[:-1])} and {engines[-1]} {'agree' if agree else 'DIFFER'}"
        whose = "their"
    largest = max(_rounding_errors(entry["quantities"]), default=None)
    if agree and largest is not None:
        text += (
            f"; {whose} results to {_digits(largest)} digits or more "
            "(except inverse kinematics and numerical derivatives)"
        )
    return Text(f"{text}; {entry['seconds']:.1f} s", "bold green" if agree else "bold red")
