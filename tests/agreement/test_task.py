"""Agreement of one robot as a task of a worker process."""

from __future__ import annotations

from dynx.agreement import agree
from dynx.agreement.agreement import AgreementTask, measure
from dynx.model.loading import load


def test_a_task_is_the_comparison_with_its_options() -> None:
    report = measure(AgreementTask("ur5", "floating", (("elbow_joint", 0.5),), ("reference",), 2, 7))
    wanted = agree(load("ur5", base="floating", lock={"elbow_joint": 0.5}), ["reference"], samples=2, seed=7)
    assert report.quantities == wanted.quantities
    assert (report.robot, report.base, report.samples, report.seed) == ("ur5", "floating", 2, 7)


def test_a_robot_that_cannot_be_used_is_a_report_of_its_error() -> None:
    report = measure(AgreementTask("nowhere", "fixed", (), None, 2, 0))
    assert report.error is not None
    assert not report.agree
