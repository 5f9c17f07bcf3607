"""Run of ``dynx compare``: both files read, compared and reported, with the exit code."""

from __future__ import annotations

from pathlib import Path

from dynx.cli.compare.document import document
from dynx.cli.compare.tables import show
from dynx.cli.shell.exits import BAD_INPUT, DONE, NEGATIVE_RESULT, complain
from dynx.cli.shell.output_file import check_json
from dynx.cli.shell.progress import progress_bar
from dynx.cli.shell.terminal import present
from dynx.errors import ArgumentError
from dynx.model.loading import load
from dynx.sim.comparison.comparison import TOLERANCE, compare
from dynx.sim.record.rollout import Rollout


def compare_files(
    first: str,
    second: str,
    tolerance: float | None,
    list_only: bool,
    robot: str | None,
    json_path: str | None,
    quiet: bool,
) -> int:
    """Compare two files of rollouts; return the exit code."""
    check_json(json_path)
    ours, theirs = _read(first, second, robot)
    with progress_bar(1, enabled=not quiet) as advance:

        def progress(done: int, total: int) -> None:
            advance(done, "reruns", total)

        comparison = compare(
            ours,
            theirs,
            tolerance=TOLERANCE if tolerance is None else tolerance,
            rerun=not list_only,
            progress=progress,
        )
    error = present(document(comparison, first, second), _nothing if quiet else show, json_path)
    if error is not None:
        complain(str(error))
        return BAD_INPUT
    return DONE if comparison.alike else NEGATIVE_RESULT


def _read(first: str, second: str, robot: str | None) -> tuple[Rollout, Rollout]:
    """Read both files; a table has the robot that is given, or that of the other file."""
    paths = (first, second)
    tables = [_is_table(path) for path in paths]
    if robot is not None and not any(tables):
        raise ArgumentError("--robot is the robot of a .csv file; both of these files have their own")
    model = None if robot is None else load(robot)
    complete = {path: Rollout.load(path) for path, table in zip(paths, tables, strict=True) if not table}
    if model is None and complete:
        model = next(iter(complete.values())).model
    if any(tables) and model is None:
        raise ArgumentError("a .csv file does not have its robot: name it by --robot")
    ours, theirs = (complete[path] if path in complete else Rollout.load(path, model=model) for path in paths)
    return ours, theirs


def _is_table(path: str) -> bool:
    return Path(path).suffix.lower() == ".csv"


def _nothing(*_: object) -> None:
    """Show nothing."""
