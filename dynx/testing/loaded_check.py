"""Check that engines that load a robot's file themselves differ no more than a baseline accepts."""

from __future__ import annotations

import math
import os
from dataclasses import replace
from typing import Any

from dynx.doctor import DoctorReport, Finding, diagnose
from dynx.doctor.formats import Baseline, wording
from dynx.doctor.formats.baseline import PlacedDifference
from dynx.doctor.report import Effect
from dynx.errors import DynxError
from dynx.model.tree import Base
from dynx.testing.robot_checks import Disagreement
from dynx.testing.robot_plan import RobotPlan


def require_same_loading(plan: RobotPlan, robot: str, label: str, base: Base) -> None:
    """Raise Disagreement where engines differ in a way that the baseline of the plan does not accept."""
    chosen: dict[str, Any] = {} if plan.tolerance is None else {"tolerance": plan.tolerance}
    head = f"{label}, {base} base, as engines load the file"
    try:
        report = diagnose(robot, base=base, engines=plan.engines, **chosen)
    except DynxError as error:
        raise Disagreement(f"{head}: not examined\n  {type(error).__name__}: {error}") from None
    if report.error is not None:
        raise Disagreement(f"{head}: not examined\n  {report.error.type}: {report.error.message}")
    # A baseline identifies a robot by its name or by its path.
    baseline = plan.baseline or Baseline(os.curdir)
    new = baseline.compare(replace(report, robot=robot)).new
    if new:
        lines = [f"{head}: {report.verdict}", *(line for each in new for line in _difference(each, report))]
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
