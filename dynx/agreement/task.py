"""Agreement of one robot that the user named, as a task of a worker process."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from dynx.agreement.agreement import agree
from dynx.agreement.report import AgreementReport, refused_report
from dynx.errors import DynxError
from dynx.model import Pose
from dynx.model.loading import load
from dynx.model.tree import Base


@dataclass(frozen=True)
class AgreementTask:
    """A robot and the options of its comparison; None stands for the default of `dynx.agree`."""

    robot: str
    base: Base
    lock: tuple[tuple[str, float], ...]
    backends: tuple[str, ...] | None
    samples: int | None
    seed: int
    base_pose: Pose | None = None


def measure(task: AgreementTask) -> AgreementReport:
    """Report the agreement of one robot, or the error where it cannot be used."""
    chosen: dict[str, Any] = {"seed": task.seed}
    if task.samples is not None:
        chosen["samples"] = task.samples
    try:
        model = load(task.robot, base=task.base, lock=dict(task.lock), base_pose=task.base_pose)
        report = agree(model, backends=task.backends, **chosen)
    except DynxError as error:
        return refused(task, error)
    return replace(report, robot=task.robot)


def refused(task: AgreementTask, error: DynxError) -> AgreementReport:
    """Report a robot that could not be compared."""
    return refused_report(task.robot, error, base=task.base, backends=task.backends or ())
