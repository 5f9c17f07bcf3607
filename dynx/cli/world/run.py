"""Run of ``dynx world``: the scene in each engine, with progress, tables, files and exit code."""

from __future__ import annotations

from collections.abc import Sequence

from dynx.cli.shell.exits import BAD_INPUT, DONE, INTERRUPTED, NEGATIVE_RESULT, complain, failure_of, one_line
from dynx.cli.shell.interruption import interruptible
from dynx.cli.shell.output_file import check_json, check_writable
from dynx.cli.shell.progress import progress_bar
from dynx.cli.shell.settings import settings_by_engine
from dynx.cli.shell.terminal import console, present
from dynx.cli.world.document import document
from dynx.cli.world.export import check_suffix, export, own_path
from dynx.cli.world.plot import plot
from dynx.cli.world.tables import show
from dynx.errors import ArgumentError, DynxError
from dynx.files.figures import picture_format
from dynx.steppers.registry import installed_worlds
from dynx.world import World
from dynx.world.comparison import ComparisonInterrupted, WorldComparison, compare_engines
from dynx.world.scene import read_scene
from dynx.world.snapshot import check_world_suffix


def world(
    scene: str,
    engines: tuple[str, ...] | None,
    duration: float,
    dt: float,
    substeps: int,
    settings: Sequence[tuple[str, str]],
    within: float | None,
    json_path: str | None,
    plot_path: str | None,
    save_path: str | None,
    export_path: str | None,
    quiet: bool,
) -> int:
    """Export the scene, or run it in each engine and compare; return the exit code."""
    if export_path is not None:
        for option, path in (("--json", json_path), ("--plot", plot_path), ("--save", save_path)):
            if path is not None:
                raise ArgumentError(f"{option} is given with --export, which runs nothing")
        return _export(scene, export_path, quiet=quiet)
    check_json(json_path)
    for path in (plot_path, save_path):
        if path is not None:
            check_writable(path)
    if save_path is not None:
        check_world_suffix(save_path)
    if plot_path is not None:
        picture_format(plot_path)
    chosen = engines or installed_worlds()
    described = read_scene(scene)
    given = settings_by_engine(chosen, settings)
    errors: list[DynxError] = []

    def save(world: World) -> None:
        if save_path is not None:
            error = failure_of(world.write, own_path(save_path, world.engine, len(chosen)))
            errors.extend([error] if error is not None else [])

    with interruptible() as interruption:
        total = round(1e3 * duration) * len(chosen)
        before: dict[str, float] = {}
        with progress_bar(total, enabled=not quiet) as advance:

            def progress(engine: str, time: float) -> None:
                before[engine] = time
                advance(round(1e3 * sum(before.values())), f"{engine}, simulated time [ms]")

            ended: ComparisonInterrupted | None = None
            try:
                comparison = compare_engines(
                    described,
                    chosen,
                    duration,
                    dt,
                    substeps=substeps,
                    settings=given,
                    finish=save,
                    progress=progress,
                )
            except ComparisonInterrupted as early:
                ended, comparison = early, early.comparison
        interruption.finishing = True
        if plot_path is not None:
            error = failure_of(plot, comparison, plot_path)
            errors.extend([error] if error is not None else [])
        made = document(comparison)
        error = present(made, _nothing if quiet else show, json_path)
        errors.extend([error] if error is not None else [])
        if ended is not None:
            complain(f"{ended} of {len(chosen)}")
    for each in errors:
        complain(str(each))
    if ended is not None:
        return interruption.code or INTERRUPTED
    if errors:
        return BAD_INPUT
    return NEGATIVE_RESULT if _is_negative(comparison, within) else DONE


def _export(scene: str, path: str, *, quiet: bool) -> int:
    check_suffix(path)
    check_writable(path)
    for file in export(read_scene(scene), path):
        if not quiet:
            console().print(f"wrote {one_line(file)}")
    return DONE


def _is_negative(comparison: WorldComparison, within: float | None) -> bool:
    if any(run.error is not None for run in comparison.runs):
        return True
    return within is not None and any(max(each.distance) > within for each in comparison.separations)


def _nothing(*_: object) -> None:
    """Show nothing."""
