"""Robots as nodes of pytest: a collector for each robot and base, a test for each check."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from os import PathLike
from pathlib import Path
from typing import Any

import pytest

from dynx.errors import DynxError
from dynx.model.loading import load
from dynx.model.tree import Base
from dynx.testing.robot_checks import CHECKS, Disagreement, measured_agreement, require_agreement
from dynx.testing.robot_plan import PlannedRobot, RobotPlan

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
        from dynx.testing.loaded_check import require_same_loading

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
