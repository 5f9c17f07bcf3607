"""One scene run by several engines, and how far apart their motions are."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack, closing
from dataclasses import dataclass, field
from itertools import combinations, pairwise
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from dynx.errors import ArgumentError, DynxError, UnsupportedFeatureError
from dynx.model.mechanism import ROOT
from dynx.model.numbers import positive_seconds, whole_number
from dynx.rbd.kinematics import body_poses
from dynx.spatial.scalar import Floats
from dynx.steppers.state import WorldState
from dynx.world.contacts import Contact, MeanContact
from dynx.world.record import Record, position_channel
from dynx.world.scene.scene import Scene
from dynx.world.separation import Separation, separation
from dynx.world.world import World

if TYPE_CHECKING:
    from dynx.world.sensors.readings import SensorReading

SEPARATIONS = (1e-3, 1e-2, 1e-1)
"""Distances [m]; a comparison reports when each of them is first exceeded."""

SAMPLES = 200
"""Number of times at which states are compared, unless there are fewer steps."""


@dataclass(frozen=True, eq=False)
class EngineRun:
    """The run of a scene by one engine; it ends early where the engine fails."""

    engine: str
    version: str
    times: Floats
    """Times (k,) [s] of the states."""
    states: tuple[WorldState, ...]
    contacts: tuple[Contact, ...]
    """Contacts of the last step."""
    settings: Mapping[str, Any]
    notes: tuple[str, ...] = ()
    """Overlaps and violated constraints of the start, a sentence each."""
    error: DynxError | None = None
    """Why the engine ended early."""
    interrupted: bool = False
    """Whether Ctrl-C ended it, before the states that are missing."""
    sensors: Mapping[str, SensorReading] = field(default_factory=dict)
    """Last reading of each sensor of the scene, by name."""
    mean_contacts: tuple[MeanContact, ...] = ()
    """Mean force of each pair that touched in the last `contact_interval`, if that is given."""


class EngineRefusal(NamedTuple):
    """An engine that refuses a scene, and why."""

    engine: str
    reason: str


@dataclass(frozen=True, eq=False)
class WorldComparison:
    """Runs of one scene by several engines."""

    scene: Scene
    dt: float
    substeps: int
    duration: float
    runs: tuple[EngineRun, ...]
    separations: tuple[Separation, ...] = field(default=())
    """Distances between the positions of each body that moves, and of each moving link as ``robot/link``, one
    for each pair of engines (`Separation.records`)."""
    contact_interval: float | None = None
    """Interval [s] of `EngineRun.mean_contacts`; None where contacts were not summed."""
    left_out: tuple[EngineRefusal, ...] = ()
    """Engines that refuse the scene and were left out."""

    def __repr__(self) -> str:
        engines = ", ".join(run.engine for run in self.runs)
        return f"<WorldComparison of {self.scene.name} by {engines}, {self.duration:.6g} s>"


class ComparisonInterrupted(KeyboardInterrupt):
    """Interruption of `compare` by Ctrl-C; `comparison` has the engines that ran until then."""

    def __init__(self, comparison: WorldComparison) -> None:
        last, count = comparison.runs[-1], len(comparison.runs)
        super().__init__(f"interrupted at {last.times[-1]:.6g} s of {last.engine}, engine number {count}")
        self.comparison = comparison


def compare_engines(
    scene: Scene,
    engines: Sequence[str],
    duration: float,
    dt: float = 1e-3,
    *,
    substeps: int = 1,
    settings: Mapping[str, Mapping[str, Any]] | None = None,
    samples: int = SAMPLES,
    contact_interval: float | None = None,
    leave_out: bool = False,
    finish: Callable[[World], object] | None = None,
    progress: Callable[[str, float], object] | None = None,
) -> WorldComparison:
    """Run a scene for `duration` [s] in each engine, and compare the states at `samples` times.

    The engines step `dt` / `substeps`; `settings` are those of `World` by engine, and `contact_interval` [s]
    is that of `World`, for the mean contact forces at the end. With `leave_out` engines that refuse the scene
    are left out, unless all do (`WorldComparison.left_out`). `finish` is called with each world at its end,
    and `progress` with the name of the engine and the time reached. An engine that fails in a step ends its
    run there. Raises the errors of `World` for a scene that cannot be opened, and ComparisonInterrupted, with
    what is done, after Ctrl-C.
    """
    n_steps = max(1, round(positive_seconds("duration", duration) / positive_seconds("dt", dt)))
    ends = np.unique(np.linspace(0, n_steps, whole_number("samples", samples, 1) + 1).round().astype(int))
    unknown = set(settings or {}) - set(engines)
    if unknown:
        raise ArgumentError(f"settings are given for {', '.join(sorted(unknown))}, which does not run")
    with ExitStack() as stack:
        # All are opened first, so that a scene that one engine refuses costs no time in the others.
        worlds: list[World] = []
        refusals: dict[str, UnsupportedFeatureError] = {}
        options = {"substeps": substeps, "contact_interval": contact_interval}
        for name in engines:
            opened = _open(scene, name, dt, {**options, **(settings or {}).get(name, {})})
            if isinstance(opened, World):
                worlds.append(stack.enter_context(closing(opened)))
            elif leave_out:
                refusals[name] = opened
            else:
                raise opened
        if refusals and not worlds:
            raise [*refusals.values()][-1]
        runs: list[EngineRun] = []
        for world in worlds:
            summed = contact_interval is not None
            runs.append(_run(world, ends.tolist(), finish, progress, summed=summed))
            if runs[-1].interrupted:
                break
    records = [_record(scene, run) for run in runs]
    separations = tuple(separation(a, b) for a, b in combinations(records, 2))
    left_out = tuple(EngineRefusal(name, str(error)) for name, error in refusals.items())
    comparison = WorldComparison(
        scene, dt, substeps, n_steps * dt, tuple(runs), separations, contact_interval, left_out
    )
    if runs and runs[-1].interrupted:
        raise ComparisonInterrupted(comparison)
    return comparison


def _open(
    scene: Scene, engine: str, dt: float, options: Mapping[str, Any]
) -> World | UnsupportedFeatureError:
    """Return the world of an engine, or its refusal of the scene."""
    try:
        return World(scene, engine, dt, **options)
    except UnsupportedFeatureError as error:
        return error


def _run(
    world: World,
    ends: Sequence[int],
    finish: Callable[[World], object] | None,
    progress: Callable[[str, float], object] | None,
    *,
    summed: bool,
) -> EngineRun:
    states, error, interrupted = [world.state], None, False
    try:
        for begin, end in pairwise(ends):
            world.step(end - begin)
            states.append(world.state)
            if progress is not None:
                progress(world.engine, world.time)
    except DynxError as raised:
        error = raised
    except KeyboardInterrupt:
        interrupted = True
    contacts, sensors = world.contacts(), world.read_sensors()
    means = world.mean_contacts() if summed else ()
    if finish is not None:
        finish(world)
    times = np.array([state.time for state in states])
    engine, version = world.engine, world.version
    return EngineRun(
        engine,
        version,
        times,
        tuple(states),
        contacts,
        world.settings,
        world.notes,
        error,
        interrupted,
        sensors,
        means,
    )


def _record(scene: Scene, run: EngineRun) -> Record:
    """Return the positions of what moves."""
    paths: dict[str, Floats] = {}
    for body in scene.bodies:
        if not body.fixed:
            paths[body.name] = np.array([state.bodies[body.name].T_world_body[:3, 3] for state in run.states])
    for robot in scene.robots:
        mechanism = robot.model.mechanism
        q = np.array([state.robots[robot.name].q for state in run.states])
        poses = body_poses(mechanism, mechanism.tree_q(q))
        if robot.model.floating:
            paths[f"{robot.name}/{robot.model.root}"] = poses[ROOT][1]
        moving = (joint.child for joint in robot.model.joints if joint.moves)
        # A position that no joint before it changes is the same at all times.
        paths |= {
            f"{robot.name}/{link}": np.broadcast_to(poses[k][1], (len(run.states), 3))
            for k, link in enumerate(moving)
        }
    return Record(run.engine, run.times, {name: position_channel(name, rows) for name, rows in paths.items()})
