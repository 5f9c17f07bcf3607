"""Run of ``dynx sim``: one simulation with progress, and its files (checked before), tables and exit code."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from dataclasses import dataclass
from importlib.util import find_spec
from typing import Any

import click

from dynx.cli.shell.exits import (
    BAD_INPUT,
    DONE,
    INTERRUPTED,
    NEGATIVE_RESULT,
    complain,
    failure_of,
    interruptible,
)
from dynx.cli.shell.output import check_json, check_writable, present, progress_bar
from dynx.cli.sim.report import EarlyEnd, document, show
from dynx.cli.sim.request import SimulationRequest, limit_message, prepare
from dynx.cli.sim.tutorial import run_tutorial
from dynx.errors import ArgumentError, DynxError, LimitError, NotInstalledError, SimulationError, shown
from dynx.files.figures import picture_format
from dynx.sim import Rollout, RolloutInterrupted, simulate
from dynx.sim.record.formats import WRITERS


@dataclass(frozen=True)
class Outputs:
    """Files for the record, each in the format of its suffix, and for the plot (None for none)."""

    save: tuple[str, ...] = ()
    plot: str | None = None

    @property
    def files(self) -> list[str]:
        """All files."""
        return [*self.save, *([] if self.plot is None else [self.plot])]

    def check(self) -> None:
        """Raise ArgumentError for a file that cannot be written or has an unknown format.

        NotInstalledError where a format needs a package that is missing.
        """
        for path in self.save:
            check_record(path)
        for path in self.files:
            check_writable(path)
            if self.files.count(path) > 1:
                raise ArgumentError(f"{shown(path, 300)} would be written twice")
        if self.plot is not None:
            picture_format(self.plot)

    def write(self, rollout: Rollout) -> dict[str, DynxError]:
        """Write all files; return the errors of those that cannot be written, by path."""
        calls: list[tuple[str, Callable[[str], object]]] = [(path, rollout.save) for path in self.save]
        if self.plot is not None:
            calls.append((self.plot, rollout.plot))
        errors = {path: failure_of(call, path) for path, call in calls}
        return {path: error for path, error in errors.items() if error is not None}


def check_record(path: str) -> None:
    """Raise ArgumentError for a name without the suffix of a record format.

    NotInstalledError where the format needs a package that is missing.
    """
    suffix = os.path.splitext(path)[1].lower()
    if suffix not in WRITERS:
        raise ArgumentError(
            f"--save {shown(path, 300)} has no suffix of a record format; wanted one of {', '.join(WRITERS)}"
        )
    if suffix == ".mcap" and find_spec("mcap") is None:
        raise NotInstalledError("--save with .mcap needs mcap: pip install 'dynx[mcap]'")


TUTORIAL_OPTIONS = {
    *("tutorial", "robot", "lock", "gravity", "to", "start", "duration", "dt", "backend"),
    *("plot", "json_path"),
}
"""Parameters that have an effect with ``--tutorial``."""


def sim(robot: str | None, tutorial: bool, json_path: str | None, **given: Any) -> int:
    """Simulate the robot, or all controllers of the tutorial; return the exit code."""
    context = click.get_current_context()
    outputs = Outputs(given.pop("save"), given.pop("plot"))
    check_json(json_path)
    if tutorial:
        _refuse_beside_tutorial(context)
        outputs.check()
        return run_tutorial(robot, given, outputs.plot, json_path=json_path)
    if robot is None:
        raise click.UsageError("ROBOT is missing; only --tutorial has a default", context)
    outputs.check()
    request = prepare({"robot": robot, **given})
    return run_sim(request, outputs, json_path=json_path)


def _refuse_beside_tutorial(context: click.Context) -> None:
    """Raise UsageError for an option that has no effect with ``--tutorial``."""
    for param in context.command.params:
        source = context.get_parameter_source(param.name or "")
        given = source is not None and source is not click.core.ParameterSource.DEFAULT
        if given and param.name not in TUTORIAL_OPTIONS:
            raise click.UsageError(f"{param.opts[0]} has no effect with --tutorial", context)


def run_sim(request: SimulationRequest, outputs: Outputs, *, json_path: str | None) -> int:
    """Simulate, write the files and show the results, also of a part; return the exit code."""
    ended: EarlyEnd = None
    started = time.perf_counter()
    with interruptible() as interruption:
        try:
            rollout = _simulate(request)
        except (SimulationError, RolloutInterrupted) as early:
            ended, rollout = early, early.rollout
        except KeyboardInterrupt:
            complain("interrupted before the first step")
            return interruption.code or INTERRUPTED
        except LimitError as error:
            raise ArgumentError(limit_message(error, request.scenario.model.name, ignorable=True)) from error
        seconds = time.perf_counter() - started
        interruption.finishing = True
        errors = outputs.write(rollout)
        written = [path for path in outputs.files if path not in errors]
        made = {**document(request, rollout, seconds, ended), "files": written}
        unwritten = present(made, show, json_path)
        if unwritten is not None:
            errors = {**errors, str(json_path): unwritten}
        if ended is not None:
            resumable = isinstance(ended, RolloutInterrupted)
            records = [path for path in written if path in outputs.save]
            complain(f"{ended}{_saved_files(records, resumable=resumable)}")
        for problem in errors.values():
            complain(str(problem))
    if interruption.code is not None:
        return interruption.code
    if isinstance(ended, RolloutInterrupted):
        return INTERRUPTED
    if errors:
        return BAD_INPUT
    return DONE if ended is None else NEGATIVE_RESULT


def _simulate(request: SimulationRequest) -> Rollout:
    with progress_bar(request.clock.n_steps, words="simulating") as advance:
        return simulate(
            request.scenario,
            **request.options,
            progress=lambda taken, wanted: advance(taken, "simulating"),
        )


def _saved_files(records: list[str], *, resumable: bool) -> str:
    """Name the files with the results so far, and the option that continues from them."""
    if not records:
        return ""
    complete = [path for path in records if path.lower().endswith(".npz")]
    hint = f"; the same command with --resume {complete[0]} continues" if resumable and complete else ""
    return f"; the results so far are in {' and '.join(records)}{hint}"
