"""Run of ``dynx view``: what the targets are, the page or the exported file, and the end by Ctrl-C."""

from __future__ import annotations

import os
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from dynx.cli.shell.exits import DONE, interruptible, one_line
from dynx.cli.shell.inputs import Numbers, configuration
from dynx.cli.shell.output import check_writable, console, progress_bar, simulated_time_bar
from dynx.errors import ArgumentError, DynxError, RobotNotFoundError, nearest, shown
from dynx.files.films import WRITERS
from dynx.files.reading import irregularity, read_file
from dynx.model import Model
from dynx.model.elements import Joint
from dynx.model.geometry import Geometry
from dynx.model.library import robots, scene_names
from dynx.model.loading import load
from dynx.model.tree import Base
from dynx.viewer import Viewer

# A robot is on the page sooner without simulations and worlds, which others need alone.
if TYPE_CHECKING:
    from dynx.sim import Rollout
    from dynx.world import World
    from dynx.world.comparison import WorldComparison


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
    port: int | None,
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
    moves = {"play": play and export_path is None, "collisions": collisions}
    opened: object
    hints: tuple[str, ...] = ()
    options: dict[str, Any]
    if kind == "robot":
        opened = load_robot(targets[0], base)
        start = None if q is None else configuration(opened, q)
        options = {"q": start, "engine": single_engine(engines), "collisions": collisions}
    elif kind == "scene":
        opened = open_scene(targets[0], export_path, compare, engines, duration, dt)
        options = moves
    else:
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
    from dynx.viewer.export import film_length

    film = os.path.splitext(path)[1].lower() in WRITERS and viewer.view.duration
    total = film_length(viewer.view.motions) if film else 0
    with progress_bar(total, words="pictures", enabled=total > 0) as advance:
        viewer.export(path, lambda done: advance(done, "pictures"))


_SCENES = (".toml", ".json")
_MJCF = (".xml", ".mjcf")
_ROLLOUTS = (".npz", ".mcap")
_TABLE = ".csv"

_OPTIONS = {
    "robot": ("--engine", "--base", "--q", "--collisions"),
    "rollout": ("--shapes", "--play", "--collisions"),
    "comparison of rollouts": ("--shapes", "--play", "--collisions"),
    "scene": ("--engine", "--duration", "--dt", "--play", "--collisions"),
}
"""Options that have an effect on each kind of target."""


def check_options(kind: str, given: Mapping[str, object]) -> None:
    """Raise ArgumentError for an option that is given (not None) and has no effect on a kind of target."""
    for option, value in given.items():
        if value is not None and option not in _OPTIONS[kind]:
            raise ArgumentError(f"{option} has no effect on a {kind}; it takes {', '.join(_OPTIONS[kind])}")


def kind_of_targets(targets: tuple[str, ...], compare: bool) -> str:
    """Return what the targets are, a key of `_OPTIONS`. Raises ArgumentError for targets that do not fit."""
    kinds = [_kind_of(target) for target in targets]
    if compare and kinds == ["rollout", "rollout"]:
        return "comparison of rollouts"
    if compare and kinds != ["scene"]:
        found = " and ".join(f"{shown(t, 300)}, a {kind}" for t, kind in zip(targets, kinds, strict=True))
        raise ArgumentError(
            f"--compare takes two rollouts (.npz or .mcap), or one scene in two engines; got {found}"
        )
    if len(targets) != 1:
        raise ArgumentError(f"{len(targets)} targets; wanted one, or two rollouts with --compare")
    return kinds[0]


def _kind_of(target: str) -> str:
    suffix = os.path.splitext(target)[1].lower()
    if suffix == _TABLE:
        raise ArgumentError(
            f"{shown(target, 300)}: a rollout is shown from .npz or .mcap, as dynx sim --save FILE.npz "
            "writes it: that has the robot and every digit"
        )
    if suffix in _ROLLOUTS:
        return "rollout"
    if suffix in _SCENES or target in scene_names() or (suffix in _MJCF and _holds_several(target)):
        return "scene"
    return "robot"


def _holds_several(path: str) -> bool:
    """Check whether a file in MJCF has several trees that move; another is read, or refused, as a robot."""
    from dynx.model.mjcf.reader import read_trees

    try:
        found = read_trees(read_file(path), path)
    except DynxError:
        return False
    trees = () if found is None else found.trees
    return sum(tree.free or any(body.jointed for body in tree.bodies) for tree in trees) > 1


def load_robot(target: str, base: Base | None) -> Model:
    """Load a robot; where there is none of that name, the error names a scene with a similar one."""
    try:
        return load(target, base=base)
    except RobotNotFoundError as error:
        if os.sep not in target and "." not in target:
            similar = nearest(target, [*scene_names(), *(entry.name for entry in robots())])
            raise RobotNotFoundError(f"no robot and no scene {shown(target)}{similar}") from error
        raise


def single_engine(engines: tuple[str, ...] | None) -> str | None:
    """Return the engine named, or None; ArgumentError for several."""
    if engines is not None and len(engines) != 1:
        raise ArgumentError(f"--engine names {', '.join(engines) or 'no engine'}; wanted one")
    return engines[0] if engines else None


_SAME = 1e-9
"""Largest difference of joint origins [m, and entries of a rotation] of a robot that is the same."""


def read_rollout(path: str, shapes: str | None) -> Rollout:
    """Return the rollout of a file, drawn with the shapes of the robot named `shapes`.

    Without one it has the shapes of the robot of the library that has its name and its joints, if there is
    one: the file came from anyone, so it does not choose which files are read.
    """
    from dynx.sim import Rollout

    if not os.path.isfile(path):
        other = irregularity(path)
        raise RobotNotFoundError(f"no file {shown(path, 300)}{f': {other}' if other else ''}")
    rollout = Rollout.load(path)
    model = rollout.model
    if shapes is None:
        robot = _of_library(model)
        return rollout if robot is None else replace(rollout, model=_with_shapes(model, robot))
    robot = load(shapes)
    missing = [link.name for link in model.links if link.name not in robot.geometry.links]
    if missing:
        raise ArgumentError(
            f"{shown(shapes, 300)} has no link {shown(missing[0])}, which {model.name} has; --shapes "
            "names the robot of the rollout"
        )
    return replace(rollout, model=_with_shapes(model, robot))


def _with_shapes(model: Model, robot: Model) -> Model:
    geometry = Geometry({link.name: robot.geometry.links[link.name] for link in model.links})
    return replace(model, geometry=geometry)


def has_shapes(rollout: Rollout) -> bool:
    """Check whether the robot of a rollout has visual or collision shapes."""
    return any(link.visuals or link.collisions for link in rollout.model.geometry.links.values())


def _of_library(model: Model) -> Model | None:
    """Return the robot of the library with the name, links and joints of a model; None without one.

    The name of a robot in its description, which a rollout has, is often another than that of its entry, so
    all of them are compared (0.3 s) unless an entry with the name has these joints.
    """
    entries = sorted(robots(), key=lambda entry: model.name not in (entry.name, *entry.aliases))
    for entry in entries:
        try:
            robot = load(entry.name)
        except DynxError:
            continue
        if model.name in (robot.name, entry.name, *entry.aliases) and _has_parts_of(robot, model):
            return robot
    return None


def _has_parts_of(robot: Model, model: Model) -> bool:
    there = {joint.name: joint for joint in robot.joints}
    return all(link.name in robot.geometry.links for link in model.links) and all(
        _same(joint, there.get(joint.name)) for joint in model.joints
    )


def _same(joint: Joint, other: Joint | None) -> bool:
    return (
        other is not None
        and (joint.parent, joint.child) == (other.parent, other.child)
        and bool(np.abs(joint.origin.matrix - other.origin.matrix).max() < _SAME)
    )


DEFAULT_STEP = 1e-3
"""Step of a world [s]."""
DEFAULT_DURATION = 2.0
"""Time for which a scene is recorded [s]."""


def open_scene(
    target: str,
    export_path: str | None,
    compare: bool,
    engines: tuple[str, ...] | None,
    duration: float | None,
    dt: float | None,
) -> World | WorldComparison:
    """Return the world of a scene, or its recorded motion for an export and for a comparison."""
    from dynx.steppers.registry import installed_worlds
    from dynx.viewer.motion import FRAME_RATE, MAX_FRAMES
    from dynx.world import World, read_scene
    from dynx.world.comparison import compare_engines

    scene, step = read_scene(target), DEFAULT_STEP if dt is None else dt
    if export_path is None and not compare:
        if duration is not None:
            raise ArgumentError("--duration is that of a recorded scene: with --compare or --export")
        return World(scene, single_engine(engines) or installed_worlds()[0], step)
    chosen = engines or installed_worlds()[: 2 if compare else 1]
    if len(chosen) != (2 if compare else 1):
        wanted = "two different ones, with --compare" if compare else "one, or two with --compare"
        raise ArgumentError(f"--engine names {', '.join(chosen)}; wanted {wanted}")
    time = DEFAULT_DURATION if duration is None else duration
    samples = min(MAX_FRAMES, max(2, round(FRAME_RATE * time)))
    with simulated_time_bar(len(chosen), time) as progress:
        return compare_engines(scene, chosen, time, step, samples=samples, progress=progress)
