"""Measuring the agreement of many robots in worker processes."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from dynx.cli.agree.task import AgreementTask, Entry, counts, failed, measure
from dynx.cli.shell.run import Run


def agreement_run(
    tasks: Sequence[AgreementTask], target: Callable[[AgreementTask], Entry] = measure
) -> Run[AgreementTask, Entry]:
    """The run of ``dynx agree``."""
    return Run(tasks, target, failed, _progress)


def _progress(entries: Sequence[Entry]) -> str:
    count = counts(entries)
    said = ", ".join(f"{count[word]} {word}" for word in ("differ", "refused") if count[word])
    return said or "comparing"
