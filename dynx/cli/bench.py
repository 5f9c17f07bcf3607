"""Run of ``dynx bench``: one benchmark case after the other, with progress, tables and exit code."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import count

from rich.console import Console
from rich.text import Text

from dynx.backends.registry import backend_class
from dynx.bench.cases import BENCHMARK_QUANTITIES
from dynx.bench.machine import processor_description
from dynx.bench.measurement import BenchmarkMeasurement
from dynx.bench.report import document, wrong
from dynx.bench.session import (
    BATCHES,
    MIN_BATCH_FOR_THREADS,
    QUICK_REPETITIONS,
    REPETITIONS,
    Plan,
    Session,
    benchmark_cases,
)
from dynx.cli.shell.exits import (
    complain,
    exit_code,
    interruptible,
    one_line,
)
from dynx.cli.shell.inputs import Locks, chosen_frame, load_robot
from dynx.cli.shell.output import Entry, check_json, counted, present, progress_bar
from dynx.cli.shell.tables import Table
from dynx.model.tree import Base
from dynx.simd.machine import core_count


def bench(
    robot: str,
    quantities: tuple[str, ...],
    batches: tuple[int, ...],
    threads: tuple[int, ...],
    backends: tuple[str, ...] | None,
    frame: str | None,
    base: Base,
    base_pose: list[float] | None,
    lock: Locks,
    seed: int,
    quick: bool,
    json_path: str | None,
) -> int:
    """Time the backends on the robot; return the exit code."""
    check_json(json_path)
    for name in backends or ():
        backend_class(name)
    model = load_robot(robot, base, lock, base_pose)
    plan = Plan(
        model,
        chosen_frame(model, frame),
        benchmark_cases(
            quantities or tuple(BENCHMARK_QUANTITIES),
            batches or BATCHES,
            threads or (1, core_count()),
            1 if threads else MIN_BATCH_FOR_THREADS,
        ),
        backends,
        QUICK_REPETITIONS if quick else REPETITIONS,
        seed,
    )
    with Session(plan) as session:
        return run_bench(session, json_path=json_path)


def run_bench(session: Session, *, json_path: str | None) -> int:
    """Measure every case and show the results, also after Ctrl-C; return the exit code."""
    found: list[list[BenchmarkMeasurement]] = []
    cases = session.plan.cases
    with interruptible() as interruption:
        try:
            with progress_bar(len(cases) + len(session.plan.threads)) as advance:
                done = count()
                for threads in session.plan.threads:
                    advance(next(done), f"peaks of the machine, {counted(threads, 'thread')}")
                    session.measure_machine(threads)
                for case in cases:
                    quantity = case.quantity.replace("_", " ")
                    advance(next(done), f"{quantity}, batch {case.batch}, {counted(case.threads, 'thread')}")
                    found.append(session.measure(case))
        except KeyboardInterrupt:
            complain(f"interrupted: {len(cases) - len(found)} of {counted(len(cases), 'case')} not done")
        interruption.finishing = True
        made = document(session, found, processor_description())
        error = present(made, show, json_path)
        wrong_ones = wrong(found)
        for each in wrong_ones:
            complain(f"{each.implementation}, {each.case.quantity.replace('_', ' ')}: {each.problem}")
        code = exit_code(error, negative=bool(wrong_ones))
    return code if interruption.code is None else interruption.code


MAX_IDLE_LOAD = 0.5
"""Largest load average before the run [processes] at which the machine counts as idle."""


def show(out: Console, report: Entry) -> None:
    """Print the robot, the machine, and a table for each benchmark case."""
    out.print(
        f"{one_line(report['robot'])}, {report['base']} base, nq {report['nq']}, nv {report['nv']}, "
        f"frame {one_line(report['frame'])}, {counted(report['repetitions'], 'repetition')}"
        f"  ({one_line(report['source'])})",
        style="bold",
    )
    out.print(report["processor"])
    if report["load"] is not None and report["load"] > MAX_IDLE_LOAD:
        load = f"load {report['load']:.1f} before the run"
        out.print(f"{load}: other processes were running, so times vary", style="yellow")
    for peak in report["peaks"]:
        out.print(
            f"{counted(peak['threads'], 'thread')}: copy bandwidth {peak['copy_bandwidth'] / 1e9:.3g} GB/s "
            f"(read and written), multiply-add peak {2e-9 * peak['multiply_adds']:.3g} GFLOP/s"
        )
    for result in report["results"]:
        _show_result(out, result)
    if report["not_done"]:
        out.print(f"\n{counted(len(report['not_done']), 'case')} not done", style="yellow")


def _show_result(out: Console, result: Entry) -> None:
    quantity = result["quantity"].replace("_", " ")
    batch = "one sample" if result["batch"] == 1 else f"batch {result['batch']}"
    out.print(f"\n{quantity}, {batch}, {counted(result['threads'], 'thread')}", style="bold")
    entries: list[Entry] = result["ways"]
    peers = [entry["way"] for entry in entries if entry["role"] == "peer" and entry["ns"] is not None]
    bounded = any(entry["roofline"] is not None for entry in entries)
    ratios = ["faster than\n" + peer.replace(" ", "\n", 1) for peer in peers]
    limits = ["of copy\nbandwidth", "of multiply-\nadd peak", "bound by"] if bounded else []
    columns = ["threads", "samples", "ns per\nsample", "spread", *ratios, *limits]
    table = Table("implementation", *columns, right=[each for each in columns if each != "bound by"], keys=1)
    for entry in sorted(entries, key=_speed):
        cells = [entry["way"], str(entry["threads"]), str(entry["samples"]), _ns(entry["ns"]), _spread(entry)]
        cells += [_ratio(entry["ratios"].get(peer)) for peer in peers]
        table.add_row(*cells, *(_limits(entry["roofline"]) if bounded else []))
    out.print(table)
    for problem in dict.fromkeys(entry["problem"] for entry in entries if entry["problem"] is not None):
        out.print(_problem(problem, [entry for entry in entries if entry["problem"] == problem]))


def _speed(entry: Entry) -> tuple[bool, float]:
    """Sort key: the fastest first, those without a time last."""
    return entry["ns"] is None, entry["ns"] or 0.0


def _ns(ns: float | None) -> str:
    if ns is None:
        return "-"
    return f"{ns:.3g}" if ns < 1000.0 else f"{ns:.0f}"


def _spread(entry: Entry) -> str:
    """Return the interquartile range over the median."""
    if not entry["ns"]:
        return "-"
    low, high = entry["ns_quartiles"]
    return f"{(high - low) / entry['ns']:.0%}"


def _ratio(ratio: float | None) -> str:
    """Write a ratio of times."""
    if ratio is None:
        return "-"
    return f"{ratio:.2f}x" if ratio < 10.0 else f"{ratio:.0f}x"


def _limits(roofline: Entry | None) -> Sequence[str]:
    if roofline is None:
        return ("", "", "")
    return (f"{roofline['memory_share']:.0%}", f"{roofline['arithmetic_share']:.0%}", roofline["binds"])


def _problem(problem: str, entries: Sequence[Entry]) -> Text:
    """Write why some implementations were not timed."""
    wrong = any(entry["error"] is not None for entry in entries) and all(
        entry["ns"] is None for entry in entries
    )
    names = ", ".join(entry["way"] for entry in entries)
    return Text(f"{names}: {one_line(problem)}", "bold red" if wrong else "yellow")
