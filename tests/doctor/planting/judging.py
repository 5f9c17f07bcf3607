"""Reports on planted robots, compared with what was planted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from dynx.doctor import DoctorReport, Finding, diagnose
from dynx.doctor.report import VariantResult
from dynx.model.tree import Base
from tests.doctor.planting.plan import Trial, plant_defects
from tests.doctor.planting.robots import clean_text
from tests.doctor.planting.site import Place, PlantedDefect


@dataclass(frozen=True)
class Verdict:
    """`right` has the rules whose defect was found at its place and proved, in a report without other
    findings; `complaints` lists the errors of the report."""

    trial: Trial
    right: tuple[str, ...]
    complaints: tuple[str, ...]
    seconds: float


def judge(trial: Trial) -> Verdict:
    """Plant the defects, diagnose the robot, and compare."""
    defects = plant_defects(trial)
    report = diagnose(defects[-1].source.text, base=trial.base, counterexamples=False)
    wrong = _report_complaints(report, defects)
    right = []
    for defect in defects:
        complaint = _complaint(report, defect)
        if complaint is not None:
            wrong.append(complaint)
        else:
            right.append(defect.place[0])
    strays_or_unexplained = bool(_report_complaints(report, defects))
    return Verdict(trial, () if strays_or_unexplained else tuple(right), tuple(wrong), report.seconds)


def complaint_about_clean(robot: str, base: Base) -> str | None:
    """Explain why a robot is not clean; None where all engines load it alike and no finding has an effect."""
    report = diagnose(clean_text(robot, base), base=base, counterexamples=False)
    if not report.alike:
        return f"{robot}, {base}: {report.verdict}"
    blamed = [_finding_text(finding) for finding in report.differences]
    return f"{robot}, {base}: {', '.join(blamed)}" if blamed else None


def run_task(task: Trial | tuple[str, Base]) -> Verdict | str | None:
    """Run one trial, or check that a robot is clean, in a worker process."""
    return judge(task) if isinstance(task, Trial) else complaint_about_clean(*task)


def _complaint(report: DoctorReport, defect: PlantedDefect) -> str | None:
    """Describe the error in how the report names the defect; None without one."""
    here = [finding for finding in report.findings if _place(finding) == defect.place]
    lines = (report.text or "").splitlines()
    here = [each for each in here if each.line is not None and defect.sign in lines[each.line - 1]]
    if not here:
        return f"{_place_text(defect.place)} not found"
    if not any(each.effect is not None for each in here):
        return f"{_place_text(defect.place)} found without an effect"
    if not any(each.effect is not None and each.proved for each in here):
        return f"{_place_text(defect.place)} not proved"
    return None


def _report_complaints(report: DoctorReport, defects: Sequence[PlantedDefect]) -> list[str]:
    """Describe an error, an unexplained difference, and findings at places without a defect."""
    if report.error is not None:
        return [report.verdict]
    wrong = [] if report.explained else [report.verdict]
    wrong += [f"{each.engine} off without a proof" for each in report.variants_off if not _is_proved(each)]
    expected = {defect.place for defect in defects}.union(*(defect.also for defect in defects))
    return wrong + [
        f"{_finding_text(each)} blamed" for each in report.differences if _place(each) not in expected
    ]


def _is_proved(variant: VariantResult) -> bool:
    return bool(variant.findings) and all(each.proved for each in variant.findings)


def _place(finding: Finding) -> Place:
    return finding.rule, finding.link, finding.joint


def _place_text(place: Place) -> str:
    rule, link, joint = place
    where = f" at link {link}" if link is not None else f" at joint {joint}" if joint is not None else ""
    return f"{rule}{where}"


def _finding_text(finding: Finding) -> str:
    assert finding.effect is not None
    effect = finding.effect
    return (
        f"{_place_text(_place(finding))} ({effect.quantity} {effect.relative_error:.1e}, {finding.message})"
    )
