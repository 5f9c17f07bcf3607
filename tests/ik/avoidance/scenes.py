"""Arms over a table, and what another engine says of their distances."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

import dynx
from dynx.distance.avoidance import Avoidance
from dynx.model import Model, Pose
from dynx.spatial.scalar import Floats
from dynx.world import Scene, SceneBody, SceneRobot, World, box

ARMS = {"ur5": "ee_link", "panda": "panda_hand", "kinova": "j2s6s200_end_effector"}
"""Arms and their frames that are brought to targets."""

ENGINE_ERROR = 1e-6
"""Bound [m] on MuJoCo's distances of separated hulls and boxes, whose vertices are 32-bit floats
(docs/results.md has 3e-8)."""

TABLE = box("table", (1.6, 1.6, 0.1), pose=Pose((0.0, 0.0, -0.12)))


@lru_cache
def arm(name: str) -> Model:
    """Return an arm, read once, so that its meshes are."""
    return dynx.load(name)


@lru_cache
def engine(name: str) -> dynx.Backend:
    """Return the compiled backend of an arm."""
    return dynx.backend("compiled", arm(name))


def scene(name: str, *bodies: SceneBody) -> Scene:
    """Return an arm on a table, with bodies around it; its links collide."""
    return Scene(name, robots=[SceneRobot("arm", arm(name), self_collision=True)], bodies=[TABLE, *bodies])


def least_room(world: World, avoidance: Avoidance, q: Floats) -> float:
    """Return the least distance beyond its margin [m] of a pair at q, by MuJoCo's own distances.

    Pairs count that are not to overlap; MuJoCo's depth of hulls that overlap is not exact.
    """
    world.set_state(robots={"arm": (q, np.zeros(avoidance.model.nv))})
    room = 0.05
    for pair in avoidance.pairs:
        if pair.margin >= 0.0:
            near = world.closest_points(*avoidance.names(pair), pair.margin + 0.05, native=True)
            room = min([room, *(each.distance - pair.margin for each in near)])
    return room
