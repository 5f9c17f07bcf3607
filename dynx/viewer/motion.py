"""`MotionFrames`: a recorded motion as frames of a film, and how far two of them are apart."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dynx.errors import ArgumentError
from dynx.model import Model
from dynx.rbd.kinematics import link_poses
from dynx.sim import BatchRollouts, Rollout, ScenePlant
from dynx.spatial.scalar import Floats
from dynx.steppers.state import WorldState
from dynx.world import Scene, SceneBody
from dynx.world.camera import part_poses
from dynx.world.comparison import EngineRun
from dynx.world.record import Record, position_channel
from dynx.world.separation import Separation, separation

FRAME_RATE = 60.0
"""Largest number of frames a second of the motion."""

MAX_FRAMES = 6000
"""Largest number of frames."""

_SAME_TIME = 1e-9
"""Difference of times that are the same [s]."""

PARTED = 1e-3
"""Distance [m] from which two motions count as parted."""


class Arrows(NamedTuple):
    """Contact forces: the points (m, 3) [m] at which they act, and the forces (m, 3) [N], in world axes.

    A force is that on the first part of a contact, or on the second where the first is fixed.
    """

    points: Floats
    forces: Floats


@dataclass(frozen=True, eq=False)
class MotionFrames:
    """Poses of parts at n times; a part is a body, or a link as ``robot/link``."""

    name: str
    t: Floats
    """Times (n,) [s], ascending."""
    poses: Mapping[str, Floats]
    """Pose in the world (n, 4, 4) of each part that moves."""
    robots: Mapping[str, Model]
    bodies: tuple[SceneBody, ...] = ()
    contacts: tuple[Arrows, ...] = ()
    """Contact forces at each time; empty where none were recorded."""

    @property
    def record(self) -> Record:
        """Positions of the parts."""
        paths = {part: position_channel(part, T[:, :3, 3]) for part, T in self.poses.items()}
        return Record(self.name, self.t, paths)

    def frame_at(self, time: float) -> int:
        """Return the number of the last frame whose time is not after `time`."""
        return max(int(np.searchsorted(self.t, time + _SAME_TIME, side="right")) - 1, 0)

    def at(self, k: int) -> dict[str, Floats]:
        """Return the pose (4, 4) of each part that moves in frame k."""
        return {name: rows[k] for name, rows in self.poses.items()}


def fixed_bodies(scene: Scene) -> frozenset[str]:
    """Return the names of the bodies that do not move, of whose contacts the force on the other part is
    drawn: that on the ground lies below the ground."""
    return frozenset(body.name for body in scene.bodies if body.fixed)


def motion_of_rollout(rollout: Rollout, name: str = "") -> MotionFrames:
    """Return the motion of a rollout, with the other robots and the bodies of its scene.

    Raises ArgumentError for a state that is not finite, and for times that do not ascend.
    """
    _require_motion(name or rollout.model.name, rollout.t, rollout.q, "q")
    frames = _frames(rollout.t)
    plant = rollout.scenario.plant if rollout.scenario is not None else None
    around = rollout.surroundings
    simulated = str(plant.robot) if isinstance(plant, ScenePlant) else rollout.model.name
    robots = {simulated: rollout.model}
    bodies: tuple[SceneBody, ...] = ()
    poses = dict(_poses(simulated, rollout.model, rollout.q[frames]))
    contacts: tuple[Arrows, ...] = ()
    if isinstance(plant, ScenePlant) and around is not None:
        bodies = plant.scene.bodies
        for robot in plant.scene.robots:
            if robot.name in around.robots:
                robots[robot.name] = robot.model
                poses |= _poses(robot.name, robot.model, around.robots[robot.name][frames])
        poses |= {body: rows[frames] for body, rows in around.bodies.items()}
        table = around.contacts
        force = table.normal_force[:, None] * table.normal + table.friction_force
        fixed = fixed_bodies(plant.scene)
        force[[table.names[a] in fixed for a in table.a.tolist()]] *= -1.0
        point = 0.5 * (table.point_a + table.point_b)
        # Contacts belong to steps, of which there is one fewer than states.
        steps = np.minimum(frames, table.n_steps - 1)
        first, end = np.searchsorted(table.step, steps, "left"), np.searchsorted(table.step, steps, "right")
        contacts = tuple(Arrows(point[a:b], force[a:b]) for a, b in zip(first, end, strict=True))
    return MotionFrames(name or rollout.model.name, rollout.t[frames], poses, robots, bodies, contacts)


def motion_of_reference(rollout: Rollout) -> MotionFrames | None:
    """Return the motion that the robot of a rollout should have followed; None without a reference.

    Raises ArgumentError for a state that is not finite, and for times that do not ascend.
    """
    if rollout.reference is None:
        return None
    _require_motion(rollout.model.name, rollout.t, rollout.reference.q, "q of the reference")
    frames = _frames(rollout.t)
    plant = rollout.scenario.plant if rollout.scenario is not None else None
    name = str(plant.robot) if isinstance(plant, ScenePlant) else rollout.model.name
    poses = dict(_poses(name, rollout.model, rollout.reference.q[frames]))
    return MotionFrames("reference", rollout.t[frames], poses, {name: rollout.model})


def motion_of_robot(model: Model, q: Floats) -> MotionFrames:
    """Return the motion of a robot that stands still at the configuration q (nq,)."""
    return MotionFrames(model.name, np.zeros(1), _poses(model.name, model, q[None]), {model.name: model})


MAX_POSES = 400_000
"""Largest number of poses of links in the motion of a batch; a longer or larger one has fewer frames."""


def motion_of_copies(
    model: Model, t: Floats, q: Floats, spacing: float = 0.0, robots: Mapping[str, Model] = {}
) -> MotionFrames:
    """Return the motion of n robots with the configurations q (n, len(t), nq), which stand on a square grid
    with a `spacing` [m]; as pictures show them, they are those of `robots`."""
    names = [f"{model.name} {k}" for k in range(len(q))]
    side = math.ceil(math.sqrt(len(q)))
    column, row = np.arange(len(q)) % side, np.arange(len(q)) // side
    rows = math.ceil(len(q) / side)
    places = spacing * np.stack([column - 0.5 * (side - 1), 0.5 * (rows - 1) - row], axis=1)
    poses: dict[str, Floats] = {}
    for link, T in link_poses(model, q):
        moved = np.array(np.broadcast_to(T, (*q.shape[:2], 4, 4)))
        moved[..., :2, 3] += places[:, None]
        poses |= {f"{name}/{link}": moved[k] for k, name in enumerate(names)}
    return MotionFrames(f"{len(q)} {model.name}", t, poses, dict(robots) or dict.fromkeys(names, model))


def motion_of_batch(rollouts: BatchRollouts, spacing: float = 0.0) -> tuple[MotionFrames, list[str]]:
    """Return the motion of the rollouts of a batch that were computed, and sentences on those that are not
    shown as they are: one that diverged stays where its state was finite last.

    Raises ArgumentError for a batch without a record.
    """
    model = rollouts.scenario.model
    computed = np.flatnonzero(rollouts.done)
    finite = np.asarray(np.isfinite(rollouts.q_record).all(axis=2))
    shown_rows = computed[finite[computed, :1].any(axis=1)] if finite.shape[1] else computed[:0]
    if not len(shown_rows):
        raise ArgumentError(
            "the batch has no states to show; simulate_batch records every k-th state with record_every=k"
        )
    frames = _frames(rollouts.t, max(2, MAX_POSES // (len(shown_rows) * len(model.links))))
    q, good = rollouts.q_record[shown_rows], finite[shown_rows]
    # The last state that is finite, at each time.
    latest = np.maximum.accumulate(np.where(good, np.arange(good.shape[1]), 0), axis=1)[:, frames]
    notes = []
    if not good.all():
        stopped = int((~good.all(axis=1)).sum())
        notes.append(f"{stopped} of {len(rollouts)} rollouts diverged; they stay where they were finite last")
    if len(shown_rows) < len(rollouts):
        notes.append(f"{len(rollouts) - len(shown_rows)} of {len(rollouts)} rollouts have no state to show")
    moved = np.take_along_axis(q, latest[:, :, None], axis=1)
    return motion_of_copies(model, rollouts.t[frames], moved, spacing), notes


def motion_of_state(scene: Scene, state: WorldState) -> MotionFrames:
    """Return the motion of a scene that stands still in a state."""
    poses = {name: T[None] for name, T in part_poses(scene, state)}
    return MotionFrames(scene.name, np.zeros(1), poses, {r.name: r.model for r in scene.robots}, scene.bodies)


def motion_of_run(scene: Scene, run: EngineRun) -> MotionFrames:
    """Return the motion of a scene in one engine."""
    frames = [dict(part_poses(scene, state)) for state in run.states]
    fixed = {body.name for body in scene.bodies if body.fixed}
    poses = {name: np.array([frame[name] for frame in frames]) for name in frames[0] if name not in fixed}
    robots = {robot.name: robot.model for robot in scene.robots}
    return MotionFrames(run.engine, run.times[: len(frames)], poses, robots, scene.bodies)


def motion_separation(a: MotionFrames, b: MotionFrames) -> Separation:
    """Measure how far apart the parts of two motions are, at the times of `a` at which `b` lasts.

    Positions of `b` are interpolated linearly between its frames. Raises ArgumentError for motions without a
    common part or without a common time.
    """
    if not a.poses and not b.poses:
        raise ArgumentError(f"{a.name} and {b.name} cannot be compared: nothing moves in them")
    return separation(a.record, b.record, a.t)


def _frames(t: Floats, most: int = MAX_FRAMES) -> NDArray[np.intp]:
    """Return the indices of the states that are shown, at `most` so many, the last among them."""
    duration = float(t[-1] - t[0])
    count = min(len(t), most, MAX_FRAMES, max(2, round(duration * FRAME_RATE) + 1))
    return np.unique(np.linspace(0, len(t) - 1, count).round().astype(np.intp))


def _poses(robot: str, model: Model, q: Floats) -> dict[str, Floats]:
    n = len(q)
    return {f"{robot}/{link}": np.broadcast_to(T, (n, 4, 4)) for link, T in link_poses(model, q)}


def _require_motion(name: str, t: Floats, q: Floats, what: str) -> None:
    # A file may have been written or changed by another program.
    wrong = np.flatnonzero(~np.isfinite(t))
    if wrong.size:
        raise ArgumentError(f"{name} cannot be shown: the time of state {wrong[0]} is {t[wrong[0]]}")
    wrong = np.flatnonzero(np.diff(t) < 0.0)
    if wrong.size:
        k = int(wrong[0])
        raise ArgumentError(
            f"{name} cannot be shown: its times must ascend; after {t[k]:g} s comes {t[k + 1]:g} s "
            f"(state {k + 1})"
        )
    states, entries = np.nonzero(~np.isfinite(q))
    if states.size:
        k, entry = int(states[0]), int(entries[0])
        raise ArgumentError(
            f"{name} cannot be shown: entry {entry} of {what} is {q[k, entry]} at {t[k]:g} s "
            f"(state {k} of {len(t)})"
        )
