"""Checks of a robot: each quantity and each identity of `dynx.agree`.

The agreement of a robot on a base is measured once per run of pytest. Each test reads its part of the report,
and shows how to reproduce a difference.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from os import PathLike
from pathlib import Path
from typing import Any

import pytest

from dynx.agreement import AgreementReport, Comparison, IdentityCheck, WorstSample, agree, refused_report
from dynx.agreement.compared_quantities import compared_quantities
from dynx.agreement.identities import IDENTITIES
from dynx.doctor import DoctorReport, Finding, diagnose
from dynx.doctor.formats import Baseline, wording
from dynx.doctor.report import Effect
from dynx.errors import DynxError
from dynx.files.baseline import PlacedDifference
from dynx.model.loading import load
from dynx.model.tree import Base
from dynx.testing.robot_plan import PlannedRobot, RobotPlan

CHECKS: tuple[str, ...] = (
    *(quantity.name for quantity in compared_quantities()),
    "forward_dynamics",
    "inverse_kinematics",
    *(identity.name for identity in IDENTITIES),
    "inverse dynamics of forward dynamics",
)
"""Names of the tests of a robot on a base: the quantities and identities of an agreement report."""

Key = tuple[str, Base, "tuple[str, ...] | None"]
_MEASURED = pytest.StashKey[dict[Key, AgreementReport]]()


class Disagreement(AssertionError):
    """Engines differ on a robot; shown by its message alone, without a traceback."""


def measured_agreement(
    config: pytest.Config, robot: str, base: Base, backends: Sequence[str] | None
) -> AgreementReport:
    """Return the agreement of a robot, which is measured by the first call in the run of `config`."""
    known = config.stash.setdefault(_MEASURED, {})
    key = (robot, base, None if backends is None else tuple(backends))
    if key not in known:
        try:
            known[key] = agree(load(robot, base=base), backends)
        except DynxError as error:
            known[key] = refused_report(robot, error, base=base)
    return known[key]


def require_agreement(report: AgreementReport, check: str, label: str) -> None:
    """Raise Disagreement where a check fails; skip the test where the report does not have it."""
    head = f"{check} of {label}, {report.base} base"
    if report.error is not None:
        raise Disagreement(f"{head}: not measured\n  {report.error.type}: {report.error.message}")
    rows: list[Comparison | IdentityCheck] = [row for row in report.quantities if row.quantity == check]
    rows += [row for row in report.identities if row.identity == check]
    if not rows:
        pytest.skip(f"{head}: nothing to compare ({', '.join(report.backends)}; nv {report.nv})")
    wrong = [row for row in rows if not row.agree]
    if not wrong:
        return
    suspects = [suspect for suspect in report.suspects if suspect.quantity == check]
    lines = [head, *(line for row in wrong for line in _row(row))]
    lines += [f"  suspect: {each.backend} ({'; '.join(each.evidence)})" for each in suspects]
    chosen = ",".join(report.backends)
    lines.append(f"  to see it again: dynx agree {label} --base {report.base} --engine {chosen}")
    raise Disagreement("\n".join(lines))


def _row(row: Comparison | IdentityCheck) -> list[str]:
    if isinstance(row, Comparison):
        who, error = row.pair, row.max_rel_error
    else:
        who, error = row.backend, row.max_error
    note = "" if row.note is None else f" ({row.note})"
    lines = [f"  {who}: relative error {error:.2e}, tolerance {row.tolerance:.2e}{note}"]
    return lines if row.worst_sample is None else lines + _sample(row.worst_sample)


def _sample(worst: WorstSample) -> list[str]:
    frame = "" if worst.frame is None else f", frame {worst.frame}"
    reference = "" if worst.reference is None else f" ({worst.reference})"
    lines = [f"    worst sample: number {worst.index} ({worst.kind}){frame}{reference}"]
    return lines + [f"      {name} = {list(getattr(worst, name))}" for name in ("q", "v", "a", "tau")]


# Check that engines that load a robot's file themselves differ no more than a baseline accepts.


def require_same_loading(plan: RobotPlan, robot: str, label: str, base: Base) -> None:
    """Raise Disagreement where engines differ in a way that the baseline of the plan does not accept."""
    chosen: dict[str, Any] = {} if plan.tolerance is None else {"tolerance": plan.tolerance}
    head = f"{label}, {base} base, as engines load the file"
    try:
        report = diagnose(
            robot, base=base, engines=plan.engines, ignore=plan.ignore, only=plan.only, **chosen
        )
    except DynxError as error:
        raise Disagreement(f"{head}: not examined\n  {type(error).__name__}: {error}") from None
    if report.error is not None:
        raise Disagreement(f"{head}: not examined\n  {report.error.type}: {report.error.message}")
    # A baseline identifies a robot by its name or by its path.
    baseline = plan.baseline or Baseline(os.curdir)
    new = baseline.compare(replace(report, robot=robot)).new
    if new:
        lines = [f"{head}: {report.verdict}", *(line for each in new for line in _difference(each, report))]
        lines += [f"  {wording.ignored(report)}"] if report.ignored else []
        tolerance = "" if plan.tolerance is None else f" --tolerance {plan.tolerance:g}"
        lines.append(
            f"  the proof, and the file mended: dynx doctor {label} --base {base}{tolerance} --fix OUT.urdf"
        )
        raise Disagreement("\n".join(lines))


def _difference(each: PlacedDifference, report: DoctorReport) -> list[str]:
    engines = ", ".join(sorted(each.engines))
    lines = [f"  {each.place} ({engines}): {_error(each, report)}"]
    return lines + [f"    {_where(found, report)}{found.message}" for found in _findings(each, report)]


def _error(each: PlacedDifference, report: DoctorReport) -> str:
    if math.isfinite(each.relative_error):
        return f"relative error {each.relative_error:.2e}"
    effects = (found.effect for found in _findings(each, report) if found.effect is not None)
    largest = max(effects, key=lambda effect: effect.relative_error, default=None)
    return wording.effect(largest or Effect(each.place.quantity or "", each.relative_error))


def _findings(each: PlacedDifference, report: DoctorReport) -> list[Finding]:
    place = each.place
    return [
        found
        for found in report.differences
        if (found.rule, found.link, found.joint) == (place.rule, place.link, place.joint)
    ]


def _where(found: Finding, report: DoctorReport) -> str:
    return "" if found.line is None else f"{report.source}:{found.line}: "


# Robots as nodes of pytest: a collector for each robot and base, a test for each check.


READING = "description"
"""Name of the one test of a robot whose description cannot be read."""

AS_LOADED = "as loaded"
"""Name of the test in which engines load the file themselves."""


def robot_nodes(session: pytest.Session, plan: RobotPlan) -> Iterator[RobotNode]:
    """Make a collector for each robot and base of the plan.

    A node is named ``my.urdf::fixed``; ``pytest -n auto --dist loadscope`` leaves it to one worker.
    """
    for planned in plan.robots:
        for base in plan.bases:
            yield RobotNode.from_parent(
                session,
                name=f"{planned.label} {base}",
                nodeid=f"{planned.label}::{base}",
                path=session.path,
                plan=plan,
                planned=planned,
                robot_base=base,
            )


class RobotNode(pytest.Collector):
    """One robot on one base."""

    def __init__(self, plan: RobotPlan, planned: PlannedRobot, robot_base: Base, **node: Any) -> None:
        super().__init__(**node)
        self.plan = plan
        self.planned = planned
        self.robot_base = robot_base

    def collect(self) -> Iterator[RobotItem]:
        """Make a test for each check, or one that fails where the description cannot be read."""
        try:
            load(self.planned.robot, base=self.robot_base)
        except DynxError as error:
            message = f"{self.name} base: {type(error).__name__}: {error}"
            yield RobotItem.from_parent(self, name=READING, check=partial(self._fail, message))
            return
        for check in CHECKS:
            yield RobotItem.from_parent(self, name=check, check=partial(self._compare, check))
        if self.plan.as_loaded:
            yield RobotItem.from_parent(self, name=AS_LOADED, check=self._compare_as_loaded)

    def _fail(self, message: str) -> None:
        raise Disagreement(message)

    def _compare(self, check: str) -> None:
        report = measured_agreement(self.config, self.planned.robot, self.robot_base, self.plan.backends)
        require_agreement(report, check, self.planned.label)

    def _compare_as_loaded(self) -> None:

        require_same_loading(self.plan, self.planned.robot, self.planned.label, self.robot_base)


class RobotItem(pytest.Item):
    """One test of a robot: a check that raises Disagreement."""

    parent: RobotNode

    def __init__(self, check: Callable[[], None], **node: Any) -> None:
        super().__init__(**node)
        self._check = check

    def runtest(self) -> None:
        """Run the check."""
        self._check()

    def repr_failure(self, excinfo: pytest.ExceptionInfo[BaseException], *_: Any) -> Any:
        """Show the message of a Disagreement without a traceback."""
        if isinstance(excinfo.value, Disagreement):
            return str(excinfo.value)
        return super().repr_failure(excinfo)

    def reportinfo(self) -> tuple[PathLike[str] | str, int | None, str]:
        """Return the file, the line and the title of the test."""
        return Path(self.parent.planned.label), None, f"{self.parent.name}: {self.name}"
