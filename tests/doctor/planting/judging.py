"""Reports on planted robots, compared with what was planted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from dynx.doctor import DoctorReport, Finding, diagnose
from dynx.model.model import Base
from tests.doctor.planting.plan import Trial, planted
from tests.doctor.planting.robots import clean_text
from tests.doctor.planting.site import Place, Planted


@dataclass(frozen=True)
class Verdict:
    """`right` has the rules whose defect was named at its place, proved and explained, in a report that
    blames nothing else; `complaints` say what is wrong."""

    trial: Trial
    right: tuple[str, ...]
    complaints: tuple[str, ...]
    seconds: float


def judge(trial: Trial) -> Verdict:
    """Plant, let the doctor look, and compare."""
    defects = planted(trial)
    report = diagnose(defects[-1].source.text, base=trial.base, counterexamples=False)
    wrong = _about_the_whole(report, defects)
    right = []
    for defect in defects:
        complaint = _about(report, defect)
        if complaint is not None:
            wrong.append(complaint)
        else:
            right.append(defect.place[0])
    strays_or_unexplained = bool(_about_the_whole(report, defects))
    return Verdict(trial, () if strays_or_unexplained else tuple(right), tuple(wrong), report.seconds)


def complaint_about_clean(robot: str, base: Base) -> str | None:
    """Why a robot is not clean: None where all engines load it alike and nothing has an effect."""
    report = diagnose(clean_text(robot, base), base=base, counterexamples=False)
    if not report.alike:
        return f"{robot}, {base}: {report.verdict}"
    blamed = [_said(finding) for finding in report.differences]
    return f"{robot}, {base}: {', '.join(blamed)}" if blamed else None


def work(task: Trial | tuple[str, Base]) -> Verdict | str | None:
    """One trial, or the check that a robot is clean; what a worker process is asked."""
    return judge(task) if isinstance(task, Trial) else complaint_about_clean(*task)


def _about(report: DoctorReport, defect: Planted) -> str | None:
    """Describe the error in how the report names the defect; None without one."""
    here = [finding for finding in report.findings if _place(finding) == defect.place]
    lines = (report.text or "").splitlines()
    here = [each for each in here if each.line is not None and defect.sign in lines[each.line - 1]]
    if not here:
        return f"{_words(defect.place)} not found"
    if not any(each.effect is not None for each in here):
        return f"{_words(defect.place)} found without an effect"
    if not any(each.effect is not None and each.proved for each in here):
        return f"{_words(defect.place)} not proved"
    return None


def _about_the_whole(report: DoctorReport, defects: Sequence[Planted]) -> list[str]:
    """An error, a difference without explanation, and blame for what is not to blame."""
    if report.error is not None:
        return [report.verdict]
    wrong = [] if report.explained else [report.verdict]
    expected = {defect.place for defect in defects}.union(*(defect.also for defect in defects))
    return wrong + [f"{_said(each)} blamed" for each in report.differences if _place(each) not in expected]


def _place(finding: Finding) -> Place:
    return finding.rule, finding.link, finding.joint


def _words(place: Place) -> str:
    rule, link, joint = place
    where = f" at link {link}" if link is not None else f" at joint {joint}" if joint is not None else ""
    return f"{rule}{where}"


def _said(finding: Finding) -> str:
    assert finding.effect is not None
    effect = finding.effect
    return f"{_words(_place(finding))} ({effect.quantity} {effect.relative_error:.1e}, {finding.message})"
