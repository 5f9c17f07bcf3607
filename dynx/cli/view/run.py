"""Run of ``dynx view``: what the targets are, the page or the exported file, and the end by Ctrl-C."""

from __future__ import annotations

import os
from contextlib import suppress
from typing import Any

from dynx.cli.shell.exits import DONE, one_line
from dynx.cli.shell.interruption import interruptible
from dynx.cli.shell.output_file import check_writable
from dynx.cli.shell.progress import progress_bar
from dynx.cli.shell.terminal import console
from dynx.errors import ArgumentError, RobotNotFoundError, shown
from dynx.model.loading import load
from dynx.model.model import Base
from dynx.registry import DEFAULT_ENGINE
from dynx.sim import Rollout
from dynx.viewer import Viewer
from dynx.viewer.film import film_length
from dynx.world import World
from dynx.world.comparison import WorldComparison, compare_worlds
from dynx.world.registry import installed_worlds
from dynx.world.scene import read_scene, scene_names

_SCENES = (".toml", ".json")
_ROLLOUT = ".npz"
_OTHER_RECORDS = (".mcap", ".csv")


def view(
    targets: tuple[str, ...],
    compare: bool,
    engines: tuple[str, ...] | None,
    duration: float,
    dt: float,
    base: Base,
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
    recorded = export_path is not None
    opened, options = _opened(targets, recorded, compare, engines, duration, dt, base)
    if not isinstance(opened, Rollout | tuple | WorldComparison | World):
        options["collisions"] = collisions
    else:
        options["play"] = play and export_path is None
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
        for note in viewer.notes:
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
    motion = getattr(viewer.view, "motion", None)
    total = film_length(motion) if motion is not None and path.lower().endswith(".gif") else 0
    with progress_bar(total, words="pictures", enabled=total > 0) as advance:
        viewer.export(path, lambda done: advance(done, "pictures"))


def _opened(
    targets: tuple[str, ...],
    moves: bool,
    compare: bool,
    engines: tuple[str, ...] | None,
    duration: float,
    dt: float,
    base: Base,
) -> tuple[object, dict[str, Any]]:
    """Return what is shown, and the options of its view; a scene is simulated first if it `moves` later."""
    if compare and len(targets) == 2:
        return tuple(_rollout(target) for target in targets), {}
    if len(targets) != 1:
        raise ArgumentError(f"{len(targets)} targets; wanted one, or two rollouts with --compare")
    (target,) = targets
    suffix = os.path.splitext(target)[1].lower()
    if suffix == _ROLLOUT:
        if compare:
            raise ArgumentError("--compare with one rollout; wanted two")
        return _rollout(target), {}
    if suffix in _OTHER_RECORDS:
        raise ArgumentError(
            f"{shown(target, 300)}: a rollout is shown from .npz, as dynx sim --save FILE.npz writes it: "
            "that has the robot and every digit"
        )
    if suffix in _SCENES or target in scene_names():
        return _scene(target, compare or moves, engines, duration, dt), {}
    if compare:
        raise ArgumentError("--compare shows two rollouts, or one scene in two engines; not a robot")
    if engines is not None and len(engines) != 1:
        raise ArgumentError(f"--engine names {len(engines)} engines; wanted one for a robot")
    return load(target, base=base), {"engine": engines[0] if engines else DEFAULT_ENGINE}


def _scene(
    target: str, simulated: bool, engines: tuple[str, ...] | None, duration: float, dt: float
) -> World | WorldComparison:
    chosen = engines or installed_worlds()[: 2 if simulated else 1]
    wanted = 2 if simulated else 1
    if len(chosen) != wanted:
        raise ArgumentError(f"--engine names {len(chosen)} engines; wanted {wanted}")
    scene = read_scene(target)
    if not simulated:
        return World(scene, chosen[0], dt)
    samples = max(2, round(60.0 * duration))
    return compare_worlds(scene, chosen, duration, dt, samples=samples)


def _rollout(path: str) -> Rollout:
    if not os.path.isfile(path):
        raise RobotNotFoundError(f"no file {shown(path, 300)}")
    return Rollout.load(path)
