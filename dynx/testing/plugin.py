"""The pytest plugin: ``pytest --dynx-robot my.urdf`` tests whether engines agree on your robot.

Each robot and base becomes one test per quantity and per identity that `dynx.agree` checks;
no test file is needed. ``--dynx-as-loaded`` adds one test in which every engine loads the file itself
(`dynx.diagnose`). In an ini file, ``dynx_robots`` lists robots for every run. The page "Testing
your robot descriptions" of the documentation shows more.

pytest imports this module in every run if dynx is installed, so it imports nothing slow and does nothing
without its options.
"""

from __future__ import annotations

import os
from collections.abc import Generator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from dynx.testing.robot_plan import RobotPlan

_OPTIONS = {
    "dynx_base": "--dynx-base",
    "dynx_backends": "--dynx-backends",
    "dynx_as_loaded": "--dynx-as-loaded",
    "dynx_baseline": "--dynx-baseline",
    "dynx_tolerance": "--dynx-tolerance",
    "dynx_ignore": "--dynx-ignore",
    "dynx_only": "--dynx-only",
}
_PLAN: pytest.StashKey[RobotPlan] = pytest.StashKey()


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the options, which all begin with ``--dynx``."""
    group = parser.getgroup("dynx", "agreement of rigid-body engines on your robot")
    group.addoption(
        "--dynx-robot",
        action="append",
        default=[],
        metavar="ROBOT",
        help="test a robot: a URDF file, a directory of them, or a name (see `dynx robots`); "
        "may be given several times",
    )
    group.addoption(
        "--dynx-base",
        choices=("fixed", "floating", "both"),
        help="whether the root link is fixed to the world or free (default: fixed)",
    )
    group.addoption(
        "--dynx-backends", metavar="A,B", help="the engines to compare (default: all that are installed)"
    )
    group.addoption(
        "--dynx-as-loaded",
        action="store_true",
        default=None,
        help="also let every engine load the file itself, and fail where they differ",
    )
    group.addoption(
        "--dynx-baseline",
        metavar="FILE",
        help="differences that --dynx-as-loaded accepts, as `dynx doctor --write-baseline` writes them",
    )
    group.addoption(
        "--dynx-tolerance",
        type=float,
        metavar="ERROR",
        help="relative error above which engines differ for --dynx-as-loaded (default: 1e-12)",
    )
    for option, subject in (
        ("--dynx-ignore", "rules of `dynx doctor` that --dynx-as-loaded counts and accepts"),
        ("--dynx-only", "rules for which --dynx-as-loaded fails; it counts and accepts all others"),
    ):
        group.addoption(
            option, action="append", metavar="RULE,...", help=f"{subject}; may be given several times"
        )
    parser.addini(
        "dynx_robots",
        "robots to test in every run, one to a line; paths are relative to the ini file",
        type="linelist",
    )


def pytest_configure(config: pytest.Config) -> None:
    """Find the robots and the engines, so that a wrong name ends the run before any test."""
    listed = config.getini("dynx_robots") if _everything_is_run(config) else []
    if not config.option.dynx_robot and not listed:
        _refuse_idle_options(config)
        return
    from dynx.testing.robot_plan import plan_robots

    home = config.inipath.parent if config.inipath is not None else config.rootpath
    here = config.invocation_params.dir
    robots = [(robot, here) for robot in config.option.dynx_robot] + [(robot, home) for robot in listed]
    config.stash[_PLAN] = plan_robots(config, robots)


def pytest_report_header(config: pytest.Config) -> list[str] | None:
    """Describe what is compared, if anything is."""
    plan = config.stash.get(_PLAN, None)
    return None if plan is None else plan.header


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report(
    collector: pytest.Collector,
) -> Generator[None, pytest.CollectReport, pytest.CollectReport]:
    """Append the robots to the items that the session collects from files."""
    report = yield
    if isinstance(collector, pytest.Session) and report.passed:
        plan = collector.config.stash.get(_PLAN, None)
        if plan is not None:
            from dynx.testing.robot_checks import robot_nodes

            report.result = [*report.result, *robot_nodes(collector, plan)]
    return report


def _everything_is_run(config: pytest.Config) -> bool:
    """Check that some argument is a directory: ``pytest test_one.py`` runs that file alone."""
    named = [Path(os.path.join(config.invocation_params.dir, arg.split("::")[0])) for arg in config.args]
    return not named or not all(os.path.isfile(path) for path in named)


def _refuse_idle_options(config: pytest.Config) -> None:
    idle = [flag for name, flag in _OPTIONS.items() if getattr(config.option, name) is not None]
    if idle and not config.getini("dynx_robots"):
        raise pytest.UsageError(f"{idle[0]} needs robots to test, and none is given: use --dynx-robot")
