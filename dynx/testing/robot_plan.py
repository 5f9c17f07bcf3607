"""Plan of a pytest run: robots, bases and engines, checked before any test runs."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from dynx.backends.registry import backend_class
from dynx.errors import DynxError, RobotNotFoundError, shown
from dynx.loaded.registry import ENGINES
from dynx.model.expansion import ALL, RobotInput, expand, is_library_name, left_out_note
from dynx.model.loading import load
from dynx.model.tree import Base

if TYPE_CHECKING:
    from dynx.doctor.formats import Baseline


@dataclass(frozen=True)
class PlannedRobot:
    """A robot: the argument of `dynx.load`, and its label in a report of tests."""

    robot: str
    label: str


@dataclass(frozen=True)
class RobotPlan:
    """The robots of a run and how they are tested.

    `backends` None means all that are installed. `as_loaded` says whether engines also load the files
    themselves; there they may differ by at most `tolerance` (None: that of `dynx.diagnose`), except for the
    differences in `baseline`.
    """

    robots: tuple[PlannedRobot, ...]
    bases: tuple[Base, ...] = ("fixed",)
    backends: tuple[str, ...] | None = None
    as_loaded: bool = False
    tolerance: float | None = None
    baseline: Baseline | None = None
    ignore: tuple[str, ...] = ()
    only: tuple[str, ...] = ()
    """Rules as `dynx.diagnose` takes them: findings of others than `only`, and of `ignore`, are accepted."""
    left_out: tuple[str, ...] = ()
    """Robots in xacro below directories, which are not tested."""

    @property
    def engines(self) -> tuple[str, ...] | None:
        """Engines among the backends that load files; None for all that are installed."""
        return tuple(name for name in self.backends or () if name in ENGINES) or None

    @property
    def header(self) -> list[str]:
        """Lines for the head of a report."""
        labels = [robot.label for robot in self.robots]
        listed = ", ".join(labels[:5]) + (f" and {len(labels) - 5} more" if len(labels) > 5 else "")
        engines = ", ".join(self.backends or ["all engines"])
        lines = [f"dynx: {listed}; {' and '.join(self.bases)} base; {engines}"]
        lines += [f"dynx: findings of {', '.join(self.ignore)} are accepted"] if self.ignore else []
        lines += [f"dynx: findings of {', '.join(self.only)} alone fail"] if self.only else []
        return [*lines, f"dynx: {left_out_note(self.left_out)}"] if self.left_out else lines


def plan_robots(config: pytest.Config, requested: Sequence[tuple[str, Path]]) -> RobotPlan:
    """Make the plan from the options of `config` and robots, each with the folder to which its path is
    relative. Raises UsageError for invalid ones."""
    option = config.option
    try:
        expansions = [expand([path_or_name(robot, folder)]) for robot, folder in requested]
        robots = dict.fromkeys(_planned(each, config) for found in expansions for each in found.robots)
        left_out = (_label(each, config.rootpath) for found in expansions for each in found.left_out)
        ignore, only = _rules(config, "ignore"), _rules(config, "only")
        return RobotPlan(
            robots=tuple(robots),
            left_out=tuple(dict.fromkeys(left_out)),
            bases=("fixed", "floating") if option.dynx_base == "both" else (option.dynx_base or "fixed",),
            backends=None if option.dynx_backends is None else _backends(option.dynx_backends),
            as_loaded=bool(option.dynx_as_loaded),
            tolerance=option.dynx_tolerance,
            baseline=_baseline(config),
            ignore=ignore,
            only=only,
        )
    except DynxError as error:
        raise pytest.UsageError(str(error)) from error


def path_or_name(robot: str, folder: Path) -> str:
    """Return a robot as `dynx.load` takes it; a path is relative to `folder`."""
    if robot == ALL or is_library_name(robot):
        return robot
    path = os.path.join(folder, os.path.expanduser(robot))
    return path if os.path.lexists(path) else robot


def _planned(found: RobotInput, config: pytest.Config) -> PlannedRobot:
    if found.refusal is not None:
        raise found.refusal
    try:
        load(found.robot)
    except RobotNotFoundError:
        raise
    except DynxError:
        pass  # a description that cannot be read is a failing test, not an invalid command
    return PlannedRobot(found.robot, _label(found.robot, config.rootpath))


def _label(robot: str, root: Path) -> str:
    if not os.path.isabs(robot):
        return robot
    inside = os.path.relpath(robot, root)
    return Path(robot if inside.startswith(os.pardir) else inside).as_posix()


def _backends(text: str) -> tuple[str, ...]:
    names = tuple(dict.fromkeys(name.strip() for name in text.split(",") if name.strip()))
    if not names:
        raise pytest.UsageError(f"--dynx-backends is {shown(text)}; wanted names separated by commas")
    for name in names:
        backend_class(name).require_engine()
    return names


def _rules(config: pytest.Config, option: str) -> tuple[str, ...]:
    """Return the rules of an option; UnknownNameError for one that does not exist."""
    given: list[str] = getattr(config.option, f"dynx_{option}") or []
    words = (word.strip() for text in given for word in text.split(","))
    names = tuple(dict.fromkeys(word for word in words if word))
    if given and not config.option.dynx_as_loaded:
        raise pytest.UsageError(f"--dynx-{option} needs --dynx-as-loaded; give both")
    if given and not names:
        raise pytest.UsageError(
            f"--dynx-{option} is {shown(given[0])}; wanted rules separated by commas, such as DX105"
        )
    if names:
        from dynx.rules.registry import ignored_rules

        ignored_rules(names)
    return names


def _baseline(config: pytest.Config) -> Baseline | None:
    option = config.option
    if not option.dynx_as_loaded:
        for value, flag in ((option.dynx_baseline, "baseline"), (option.dynx_tolerance, "tolerance")):
            if value is not None:
                raise pytest.UsageError(f"--dynx-{flag} needs --dynx-as-loaded; give both")
        return None
    if option.dynx_tolerance is not None and not 0.0 < option.dynx_tolerance < 1.0:
        raise pytest.UsageError(f"--dynx-tolerance is {option.dynx_tolerance}; wanted it between 0 and 1")
    if option.dynx_baseline is None:
        return None
    from dynx.doctor.formats.baseline import Baseline

    return Baseline.load(os.path.join(config.invocation_params.dir, option.dynx_baseline))
