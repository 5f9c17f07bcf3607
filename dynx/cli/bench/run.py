"""The works of ``dynx bench`` one after the other, with progress, and the end of it also after Ctrl-C."""

from __future__ import annotations

from itertools import count

from dynx.bench.machine import described
from dynx.bench.measurement import Measurement
from dynx.bench.report import document, wrong
from dynx.bench.session import Session
from dynx.cli.bench.tables import show
from dynx.cli.shell.exits import ANSWER_IS_NO, DONE, complain
from dynx.cli.shell.interruption import interruptible
from dynx.cli.shell.progress import progress_bar
from dynx.cli.shell.terminal import console, counted, echo_json


def run_bench(session: Session, *, as_json: bool) -> int:
    """Measure everything and show it, also where Ctrl-C ended it early; the exit code."""
    found: list[list[Measurement]] = []
    works = session.plan.works
    with interruptible() as interruption:
        try:
            with progress_bar(len(works) + len(session.plan.threads)) as advance:
                done = count()
                for threads in session.plan.threads:
                    advance(next(done), f"the machine, {counted(threads, 'thread')}")
                    session.measure_machine(threads)
                for work in works:
                    quantity = work.quantity.replace("_", " ")
                    advance(next(done), f"{quantity}, batch {work.batch}, {counted(work.threads, 'thread')}")
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
