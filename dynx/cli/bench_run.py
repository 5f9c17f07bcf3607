"""The works of ``dynx bench`` one after the other, with progress, and the end of it also after Ctrl-C."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from dynx.bench.machine import described
from dynx.bench.measurement import Measurement
from dynx.bench.report import document, wrong
from dynx.bench.session import Session
from dynx.cli.bench_tables import show
from dynx.cli.exits import ANSWER_IS_NO, DONE, complain
from dynx.cli.interruption import interruptible
from dynx.cli.terminal import console, counted, echo_json

Advance = Callable[[str], None]
"""Says what is done next; what was said before is then done."""


def run_bench(session: Session, *, as_json: bool) -> int:
    """Measure everything and show it, also where Ctrl-C ended it early; the exit code."""
    found: list[list[Measurement]] = []
    works = session.plan.works
    with interruptible() as interruption:
        try:
            with _progress(len(works) + len(session.plan.threads)) as advance:
                for threads in session.plan.threads:
                    advance(f"the machine, {counted(threads, 'thread')}")
                    session.measure_machine(threads)
                for work in works:
                    quantity = work.quantity.replace("_", " ")
                    advance(f"{quantity}, batch {work.batch}, {counted(work.threads, 'thread')}")
                    found.append(session.measure(work))
        except KeyboardInterrupt:
            complain(f"interrupted: {len(works) - len(found)} of {counted(len(works), 'work')} not done")
        interruption.finishing = True
        made = document(session, found, described())
        if as_json:
            echo_json(made)
        else:
            show(console(), made)
        wrong_ones = wrong(found)
        for each in wrong_ones:
            complain(f"{each.way}, {each.work.quantity.replace('_', ' ')}: {each.problem}")
    if interruption.code is not None:
        return interruption.code
    return ANSWER_IS_NO if wrong_ones else DONE


@contextmanager
def _progress(total: int) -> Iterator[Advance]:
    """A bar on standard error while the run lasts, on a terminal only."""
    if not sys.stderr.isatty():
        yield lambda _: None
        return
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
    )
    screen = console(err=True)
    screen.soft_wrap = False  # a bar that ran over the line could not be drawn again in place
    with Progress(*columns, console=screen, transient=True) as progress:
        bar = progress.add_task("", total=total)
        begun = iter(range(total))

        def advance(next_one: str) -> None:
            progress.update(bar, completed=next(begun), description=next_one)

        yield advance
