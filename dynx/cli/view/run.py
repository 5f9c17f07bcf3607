"""Run of ``dynx view``: what the targets are, the page or the exported file, and the end by Ctrl-C."""

from __future__ import annotations

import os
from contextlib import suppress
from typing import Any

from dynx.cli.shell.exits import DONE, one_line
from dynx.cli.shell.inputs import Numbers, configuration
from dynx.cli.shell.interruption import interruptible
from dynx.cli.shell.output_file import check_writable
from dynx.cli.shell.terminal import console
from dynx.cli.view.targets import check_options, kind_of_targets, load_robot, single_engine
from dynx.model.tree import Base
from dynx.viewer import Viewer


def view(
    targets: tuple[str, ...],
    compare: bool,
    engines: tuple[str, ...] | None,
    duration: float | None,
    dt: float | None,
    base: Base | None,
    q: Numbers,
    shapes: str | None,
    collisions: bool,
    whole_meshes: bool,
    play: bool,
    dark: bool,
    host: str,
    port: int,
    no_browser: bool,
    export_path: str | None,
) -> int:
    """Show the targets until Ctrl-C, or export them; return the exit code."""
    if export_path is not None:
        check_writable(export_path)
    kind = kind_of_targets(targets, compare)
    given = {
        "--engine": engines,
        "--duration": duration,
        "--dt": dt,
        "--base": base,
        "--q": q,
        "--shapes": shapes,
        "--collisions": collisions or None,
        "--play": play or None,
    }
    check_options(kind, given)
    moves = {"play": play and export_path is None}
    opened: object
    hints: tuple[str, ...] = ()
    options: dict[str, Any]
    if kind == "robot":
        opened = load_robot(targets[0], base or "fixed")
        start = None if q is None else configuration(opened, q)
        options = {"q": start, "engine": single_engine(engines), "collisions": collisions}
    elif kind == "scene":
        from dynx.cli.view.scenes import open_scene

        opened = open_scene(targets[0], export_path, compare, engines, duration, dt)
        options = moves
    else:
        from dynx.cli.view.rollouts import has_shapes, read_rollout

        rollouts = tuple(read_rollout(target, shapes) for target in targets)
        if shapes is None and not all(map(has_shapes, rollouts)):
            hints = ("--shapes ROBOT, a name or a file, draws a rollout with the shapes of its robot",)
        options = moves | {"names": tuple(map(os.path.basename, targets))} if compare else moves
        opened = rollouts if compare else rollouts[0]
    with Viewer(
        opened,
        host=host,
        port=0 if export_path is not None else port,
        dark=dark,
        whole_meshes=True if whole_meshes else None,
        open_browser=not no_browser and export_path is None,
        **options,
    ) as viewer:
        out = console()
        for note in (*viewer.notes, *hints):
            out.print(f"note: {one_line(note)}", style="yellow")
        if export_path is not None:
            _export(viewer, export_path)
            out.print(f"wrote {one_line(export_path)}")
            return DONE
        with suppress(KeyboardInterrupt), interruptible():
            out.print(f"{one_line(repr(viewer)[1:-1])}; Ctrl-C ends it", soft_wrap=True)
            viewer.wait()
    return DONE


def _export(viewer: Viewer, path: str) -> None:
    from dynx.cli.shell.progress import progress_bar
    from dynx.viewer.export import film_length

    film = path.lower().endswith(".gif") and viewer.view.duration
    total = film_length(viewer.view.motions) if film else 0
    with progress_bar(total, words="pictures", enabled=total > 0) as advance:
        viewer.export(path, lambda done: advance(done, "pictures"))
