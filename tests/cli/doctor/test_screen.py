"""The report of one robot fits a screen: 40 rows, and 27 for a robot without a fault."""

from __future__ import annotations

from dataclasses import replace
from io import StringIO

import pytest
from rich.console import Console

from dynx.cli.doctor.run import doctor_command
from dynx.cli.doctor.tables import SCREEN, show_one
from dynx.doctor import diagnose
from dynx.doctor.report import DoctorReport
from dynx.doctor.task import DoctorTask
from dynx.loaded import ENGINES, installed_engines
from dynx.rules.registry import find_trap
from tests.conftest import needs_examples
from tests.doctor.formats.reports import differing

pytestmark = pytest.mark.skipif(
    not set(installed_engines()).issuperset({"pinocchio", "pybullet", "mujoco", "drake"}),
    reason="the rows of four engines are counted",
)

COLUMNS = 100


def rows(report: DoctorReport) -> int:
    """Return the rows that a report takes on a terminal of 100 columns."""
    text = shown(report)
    return sum(max(1, -(-len(line) // COLUMNS)) for line in text.splitlines())


def shown(report: DoctorReport, width: int = COLUMNS) -> str:
    """Return the report of one robot."""
    out = StringIO()
    console = Console(file=out, width=width, soft_wrap=True, markup=False, emoji=False)
    show_one(console, report, {}, None, doctor_command(DoctorTask(report.robot, "fixed")))
    return out.getvalue()


@needs_examples
def test_the_report_of_ur5_fits_a_screen() -> None:
    report = diagnose("ur5")
    assert len(report.engines) >= len(set(ENGINES) & set(installed_engines()))
    assert rows(report) <= SCREEN[0], shown(report)
    assert "bad practice (more about a rule: dynx explain DX" in shown(report)


def test_the_report_of_a_robot_without_a_fault_has_27_rows() -> None:
    mended = diagnose(find_trap("DX201")).mended
    assert mended is not None
    report = diagnose(mended)
    assert report.alike
    assert not report.findings
    assert rows(report) <= 27, shown(report)


def test_the_damping_of_a_step_is_no_cause_and_is_stated_below_the_call_that_loads_the_file() -> None:
    mended = diagnose(find_trap("DX201")).mended
    assert mended is not None
    report = diagnose(mended)
    assert report.alike
    rows = shown(report).splitlines()
    call = next(k for k, row in enumerate(rows) if "p.loadURDF(" in row)
    assert rows[call + 1 : call + 3] == [
        "      not compared: a step of the engine damps every link by 0.04 per second, unless you write",
        "      p.changeDynamics(robot, -1, linearDamping=0, angularDamping=0)",
    ]
    still = diagnose('<robot name="r"><link name="a"/></robot>', engines=["pybullet"])
    assert not still.engines[0].step_defaults


def test_the_report_of_a_robot_that_only_another_call_misreads_has_27_rows() -> None:
    report = diagnose(find_trap("DX115"))
    assert report.alike
    assert rows(report) <= 27, shown(report)


def test_places_are_left_out_where_the_report_would_not_fit() -> None:
    report = differing()
    many = tuple(replace(report.findings[0], link=f"link_{k}", line=k) for k in range(30))
    few = replace(report, findings=many[:3], unexplained=(), choices=(), calls=())
    assert "and 1 more" not in shown(few)
    crowded = replace(few, choices=tuple(f"choice {k}" for k in range(SCREEN[0] - rows(few))))
    assert "; and " in shown(crowded)
    assert rows(crowded) <= SCREEN[0]


def test_a_report_is_the_same_on_a_terminal_and_in_a_file() -> None:
    report = differing()
    assert shown(report, 10_000).count("line ") == shown(report, COLUMNS).count("line ")


@pytest.mark.parametrize(("error", "stated"), [(4.5e-11, True), (3e-13, False), (2e-9, False)])
def test_errors_that_a_mended_file_keeps_are_explained_beside_the_table(error: float, stated: bool) -> None:
    report = replace(differing(), mended="<robot/>")
    engines = tuple(replace(each, after=dict.fromkeys(each.before, error)) for each in report.engines)
    text = " ".join(shown(replace(report, engines=engines)).split())
    assert ("the mended file keeps errors of up to 1e-09" in text) == stated
    assert ("check it with --tolerance 1e-09" in text) == stated
