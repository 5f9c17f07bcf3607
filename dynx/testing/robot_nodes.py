"""Robots as nodes of pytest: a collector for each robot and base, a test for each check."""

from __future__ import annotations

from collections.abc import Iterator
from os import PathLike
from pathlib import Path
from typing import Any

import pytest

from dynx.errors import DynxError
from dynx.model.loading import load
from dynx.model.model import Base
from dynx.testing.robot_checks import CHECKS, Disagreement, measured, require_agreement
from dynx.testing.robot_plan import PlannedRobot, RobotPlan

READING = "description"
"""Name of the one test of a robot whose description cannot be read."""

AS_LOADED = "as loaded"


def robot_nodes(session: pytest.Session, plan: RobotPlan) -> Iterator[RobotNode]:
    """A collector for each robot and base of the plan."""
    for robot in plan.robots:
        for base in plan.bases:
            yield RobotNode.of(session, plan, robot, base)


class RobotNode(pytest.Collector):
    """One robot on one base."""

    def __init__(self, plan: RobotPlan, planned: PlannedRobot, robot_base: Base, **node: Any) -> None:
        super().__init__(**node)
        self.plan = plan
        self.planned = planned
        self.robot_base = robot_base

    @classmethod
    def of(cls, session: pytest.Session, plan: RobotPlan, planned: PlannedRobot, base: Base) -> RobotNode:
        """The node ``my.urdf::fixed``; ``pytest -n auto --dist loadscope`` leaves it to one worker."""
        node: RobotNode = cls.from_parent(
            session,
            name=f"{planned.label} {base}",
            nodeid=f"{planned.label}::{base}",
            path=session.path,
            plan=plan,
            planned=planned,
            robot_base=base,
        )
        return node

    def collect(self) -> Iterator[RobotItem]:
        """A test for each check; one that fails where the description cannot be read."""
        try:
            load(self.planned.robot, base=self.robot_base)
        except DynxError:
            yield DescriptionItem.from_parent(self, name=READING)
            return
        for check in CHECKS:
            yield AgreementItem.from_parent(self, name=check)
        if self.plan.as_loaded:
            yield AsLoadedItem.from_parent(self, name=AS_LOADED)


class RobotItem(pytest.Item):
    """One test of a robot."""

    parent: RobotNode

    def repr_failure(self, excinfo: pytest.ExceptionInfo[BaseException], *_: Any) -> Any:
        """What is said of a failure: no traceback where engines differ."""
        if isinstance(excinfo.value, Disagreement):
            return str(excinfo.value)
        return super().repr_failure(excinfo)

    def reportinfo(self) -> tuple[PathLike[str] | str, int | None, str]:
        """Where the test is, and what it is called."""
        return Path(self.parent.planned.label), None, f"{self.parent.name}: {self.name}"


class DescriptionItem(RobotItem):
    """Fails with what is wrong in the description."""

    def runtest(self) -> None:
        """Read it again."""
        try:
            load(self.parent.planned.robot, base=self.parent.robot_base)
        except DynxError as error:
            raise Disagreement(f"{self.parent.name} base: {type(error).__name__}: {error}") from None


class AgreementItem(RobotItem):
    """One quantity or law, in all engines."""

    def runtest(self) -> None:
        """Look it up in the robot's agreement."""
        node = self.parent
        report = measured(self.config, node.planned.robot, node.robot_base, node.plan.backends)
        require_agreement(report, self.name, node.planned.label)


class AsLoadedItem(RobotItem):
    """The file, loaded by the engines themselves."""

    def runtest(self) -> None:
        """Ask the doctor."""
        from dynx.testing.loaded_check import require_same_loading

        node = self.parent
        require_same_loading(node.plan, node.planned.robot, node.planned.label, node.robot_base)
