"""What a worker process does for `dynx agree`: one robot in, one entry of the JSON document out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from dynx._version import __version__
from dynx.cli.shell.exits import short_line
from dynx.cli.shell.run import error_of
from dynx.errors import DynxError
from dynx.workers import Failure

if TYPE_CHECKING:
    from dynx.model.model import Base

SCHEMA = 1
"""Version of the document; a test holds it to that of `dynx.agreement`, which is slow to import."""

Entry = dict[str, Any]
"""One of the ``results`` of the document that `dynx.agreement` describes."""


@dataclass(frozen=True)
class AgreementTask:
    """A robot, and how its agreement is to be measured."""

    robot: str
    base: Base
    lock: tuple[tuple[str, float], ...]
    backends: tuple[str, ...] | None
    samples: int | None
    seed: int


def measure(task: AgreementTask) -> Entry:
    """The agreement of one robot; one that cannot be used gives an entry with its error."""
    from dynx.agreement import agree
    from dynx.model.loading import load

    chosen: dict[str, Any] = {"seed": task.seed}
    if task.samples is not None:
        chosen["samples"] = task.samples
    try:
        model = load(task.robot, base=task.base, lock=dict(task.lock))
        report = agree(model, backends=task.backends, **chosen)
    except DynxError as error:
        return refused(task, error)
    return {**report.to_dict(), "robot": task.robot}


def refused(task: AgreementTask, error: DynxError) -> Entry:
    """The entry of a robot that could not be compared."""
    from dynx.agreement import refused_report

    return refused_report(task.robot, error, base=task.base, backends=task.backends or ()).to_dict()


def failed(task: AgreementTask, failure: Failure) -> Entry:
    """The entry of a robot whose worker process gave no answer."""
    return refused(task, error_of(failure))


def label(entry: Entry) -> str:
    """The robot of an entry as one short line."""
    return short_line(entry["robot"])


def document(entries: Sequence[Entry], not_done: Sequence[str] = ()) -> dict[str, Any]:
    """What `dynx.agreement.results_document` makes of reports, made of their entries.

    `not_done` names the robots that an interrupted run left out.
    """
    return {
        "schema": SCHEMA,
        "dynx": __version__,
        "results": list(entries),
        "summary": {**counts(entries), "not_done": len(not_done)},
        "not_done": list(not_done),
    }


def verdict(entry: Entry) -> str:
    """``agree``, ``differ`` or ``refused``."""
    if entry["error"] is not None:
        return "refused"
    return "agree" if entry["agree"] else "differ"


def counts(entries: Sequence[Entry]) -> dict[str, int]:
    """How many entries there are, and of each verdict."""
    verdicts = [verdict(entry) for entry in entries]
    return {
        "robots": len(entries),
        "agree": verdicts.count("agree"),
        "differ": verdicts.count("differ"),
        "refused": verdicts.count("refused"),
    }
