"""Run of ``dynx bench``: one benchmark case after the other, with progress, tables and exit code."""

from __future__ import annotations

from itertools import count

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
from dynx.cli.bench.tables import show
from dynx.cli.shell.exits import BAD_INPUT, DONE, NEGATIVE_RESULT, complain
from dynx.cli.shell.inputs import Locks, chosen_frame, load_robot
from dynx.cli.shell.interruption import interruptible
from dynx.cli.shell.output_file import check_json
from dynx.cli.shell.progress import progress_bar
from dynx.cli.shell.terminal import counted, present
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
        if error is not None:
            complain(str(error))
    if interruption.code is not None:
        return interruption.code
    if error is not None:
        return BAD_INPUT
    return NEGATIVE_RESULT if wrong_ones else DONE
