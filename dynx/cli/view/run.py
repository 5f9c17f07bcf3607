"""Run of ``dynx view``: what the targets are, the page or the exported file, and the end by Ctrl-C."""

from __future__ import annotations

import os
from contextlib import suppress
from dataclasses import replace
from typing import Any

from dynx.cli.shell.exits import DONE, one_line
from dynx.cli.shell.interruption import interruptible
from dynx.cli.shell.output_file import check_writable
from dynx.cli.shell.progress import progress_bar
from dynx.cli.shell.terminal import console
from dynx.errors import ArgumentError, RobotNotFoundError, nearest, shown
from dynx.model import Model
from dynx.model.geometry import Geometry
from dynx.model.loading import load
from dynx.model.model import Base
from dynx.registry import DEFAULT_ENGINE
from dynx.sim import Rollout
from dynx.viewer import Viewer
from dynx.viewer.film import film_length
from dynx.viewer.motion import FRAME_RATE, MAX_FRAMES
from dynx.world import World
from dynx.world.comparison import WorldComparison, compare_worlds
from dynx.world.registry import installed_worlds
from dynx.world.scene import read_scene, scene_names

_SCENES = (".toml", ".json")
_ROLLOUT = ".npz"
_OTHER_RECORDS = (".mcap", ".csv")

DEFAULT_STEP = 1e-3
"""Step of a world [s]."""
DEFAULT_DURATION = 2.0
"""Time for which a scene is recorded [s]."""

_OPTIONS = {
    "robot": ("--engine", "--base", "--collisions"),
    "rollout": ("--shapes", "--play"),
    "comparison of rollouts": ("--shapes", "--play"),
    "scene": ("--engine", "--duration", "--dt", "--play"),
}
"""Options that have an effect on each kind of target."""


def view(
    targets: tuple[str, ...],
    compare: bool,
    engines: tuple[str, ...] | None,
    duration: float | None,
    dt: float | None,
    base: Base | None,
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
    kind = _kind(targets, compare)
    given = {
        "--engine": engines,
        "--duration": duration,
        "--dt": dt,
        "--base": base,
        "--shapes": shapes,
        "--collisions": collisions or None,
        "--play": play or None,
    }
    for option, value in given.items():
        if value is not None and option not in _OPTIONS[kind]:
            raise ArgumentError(f"{option} has no effect on a {kind}; it takes {', '.join(_OPTIONS[kind])}")
    moves = {"play": play and export_path is None}
    opened: object
    options: dict[str, Any]
    if kind == "robot":
        opened = _robot(targets[0], base or "fixed")
        options = {"engine": _single_engine(engines) or DEFAULT_ENGINE, "collisions": collisions}
    elif kind == "scene":
        opened = _scene(targets[0], export_path, compare, engines, duration, dt)
        options = moves
    else:
        opened = tuple(_rollout(target, shapes) for target in targets)
        options = moves | {"names": tuple(map(os.path.basename, targets))} if compare else moves
        opened = opened if compare else opened[0]
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


def _kind(targets: tuple[str, ...], compare: bool) -> str:
    """Return what the targets are, a key of `_OPTIONS`. Raises ArgumentError for targets that do not fit."""
    kinds = [_kind_of(target) for target in targets]
    if compare and kinds == ["rollout", "rollout"]:
        return "comparison of rollouts"
    if compare and kinds != ["scene"]:
        found = " and ".join(f"{shown(t, 300)}, a {kind}" for t, kind in zip(targets, kinds, strict=True))
        raise ArgumentError(f"--compare takes two rollouts (.npz), or one scene in two engines; got {found}")
    if len(targets) != 1:
        raise ArgumentError(f"{len(targets)} targets; wanted one, or two rollouts with --compare")
    return kinds[0]


def _kind_of(target: str) -> str:
    suffix = os.path.splitext(target)[1].lower()
    if suffix in _OTHER_RECORDS:
        raise ArgumentError(
            f"{shown(target, 300)}: a rollout is shown from .npz, as dynx sim --save FILE.npz writes it: "
            "that has the robot and every digit"
        )
    if suffix == _ROLLOUT:
        return "rollout"
    return "scene" if suffix in _SCENES or target in scene_names() else "robot"


def _robot(target: str, base: Base) -> Model:
    try:
        return load(target, base=base)
    except RobotNotFoundError as error:
        similar = nearest(target, scene_names())
        if similar and os.sep not in target and "." not in target:
            raise RobotNotFoundError(f"no robot and no scene {shown(target)}{similar}") from error
        raise


def _scene(
    target: str,
    export_path: str | None,
    compare: bool,
    engines: tuple[str, ...] | None,
    duration: float | None,
    dt: float | None,
) -> World | WorldComparison:
    scene, step = read_scene(target), DEFAULT_STEP if dt is None else dt
    if export_path is None and not compare:
        if duration is not None:
            raise ArgumentError("--duration is that of a recorded scene: with --compare or --export")
        return World(scene, _single_engine(engines) or installed_worlds()[0], step)
    chosen = engines or installed_worlds()[: 2 if compare else 1]
    if len(chosen) != (2 if compare else 1):
        wanted = "two, with --compare" if compare else "one, or two with --compare"
        raise ArgumentError(f"--engine names {len(chosen)} engines; wanted {wanted}")
    time = DEFAULT_DURATION if duration is None else duration
    samples = min(MAX_FRAMES, max(2, round(FRAME_RATE * time)))
    total = round(1e3 * time) * len(chosen)
    before: dict[str, float] = {}
    with progress_bar(total, words="simulated time [ms]") as advance:

        def progress(engine: str, now: float) -> None:
            before[engine] = now
            advance(round(1e3 * sum(before.values())), f"{engine}, simulated time [ms]")

        return compare_worlds(scene, chosen, time, step, samples=samples, progress=progress)


def _rollout(path: str, shapes: str | None) -> Rollout:
    if not os.path.isfile(path):
        what = "it is a folder" if os.path.isdir(path) else "there is none"
        raise RobotNotFoundError(f"no file {shown(path, 300)}: {what}")
    rollout = Rollout.load(path)
    if shapes is None:
        return rollout
    links = [link.name for link in rollout.model.links]
    robot = load(shapes)
    missing = [name for name in links if name not in robot.geometry.links]
    if missing:
        raise ArgumentError(
            f"{shown(shapes, 300)} has no link {shown(missing[0])}, which {rollout.model.name} has; --shapes "
            "names the robot of the rollout"
        )
    geometry = Geometry({name: robot.geometry.links[name] for name in links})
    return replace(rollout, model=replace(rollout.model, geometry=geometry))


def _single_engine(engines: tuple[str, ...] | None) -> str | None:
    """Return the engine named, or None; ArgumentError for several."""
    if engines is not None and len(engines) != 1:
        raise ArgumentError(f"--engine names {len(engines)} engines; wanted one")
    return engines[0] if engines else None
