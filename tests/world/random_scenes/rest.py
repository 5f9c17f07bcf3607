"""Forces on what has come to rest: on each body and robot, contacts balance the weight and its moment.

Rest is a matter of motion: a part is at rest if no rigid body of it is faster than `SPEED` and `SPIN` in any
step of a window T. Its momentum then changes by 2 m `SPEED` at most, so the mean force of its contacts and
its weight add up to at most 2 m `SPEED` / T; and the mean moment about its centre of mass is that of
2 `SPIN` I + 2 `SPEED` m r at most, for bodies of inertia I with their centres at distances r. A contact's
force acts within its gap of the points that the engine reports.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from dynx.spatial.scalar import Floats
from dynx.world import Contact, Scene, World, WorldState
from tests.world.random_scenes.laws import touches_over_surfaces
from tests.world.random_scenes.mechanics import RigidBodies, rigid_bodies

SETTLING, WINDOW = 1.5, 0.1
"""Times [s] before the window and of it."""

SPEED = 2e-3
"""Largest speed [m/s] of the centre of mass of a rigid body at rest."""
SPIN = 0.02
"""Largest angular velocity [rad/s] of a rigid body at rest."""

AT_REST = "parts at rest"
"""Name of the number of parts at rest."""

ROUNDING = 1e-9
"""Rounding of mean forces, relative to their sizes."""


@dataclass(frozen=True)
class Balance:
    """Errors of the balance of one part at rest, divided by their bounds: above 1 the law is violated."""

    part: str
    weight: float
    """Weight [N]."""
    force: float
    moment: float


class _Part:
    """A body, or a robot on a floating base, with what acts on it in the window."""

    def __init__(self, name: str, alone: Scene) -> None:
        self.name, self.rests = name, True
        self._alone = alone
        self._first: RigidBodies | None = None
        self._force, self._moment = np.zeros(3), np.zeros(3)
        self._size = self._slack = 0.0
        self._normals: list[Floats] = []

    def take(self, state: WorldState, contacts: list[Contact]) -> None:
        """Add a step that ended in this state."""
        now = rigid_bodies(self._alone, state)
        first = self._first = self._first or now
        fastest = np.linalg.norm(now.velocity, axis=1).max(initial=0.0)
        if fastest > SPEED or np.linalg.norm(now.omega, axis=1).max(initial=0.0) > SPIN:
            self.rests = False
            return
        center = first.mass @ first.center / first.mass.sum()
        for contact in contacts:
            for end, sign in ((contact.a, 1.0), (contact.b, -1.0)):
                if end.partition("/")[0] != self.name:
                    continue
                force, size = sign * contact.force, float(np.linalg.norm(contact.force))
                middle = 0.5 * (contact.point_a + contact.point_b)
                self._force += force
                self._moment += np.cross(middle - center, force)
                self._size += size
                self._slack += size * (0.5 * abs(contact.distance) + SPEED * WINDOW)
                if size > 0.0:
                    self._normals.append(contact.normal)

    def balance(self, gravity: Floats, steps: int, moments_about_normals: bool) -> Balance:
        """Return how far mean force and moment are from those of rest."""
        first = self._first
        assert first is not None
        mass = float(first.mass.sum())
        center = first.mass @ first.center / mass
        arms = np.linalg.norm(first.center - center, axis=1)
        force = self._force / steps + mass * gravity
        moment = self._moment / steps
        if not moments_about_normals and self._normals:
            _, sizes, axes = np.linalg.svd(np.array(self._normals), full_matrices=False)
            spanned = axes[sizes > 1e-3 * sizes[0]]
            moment = moment - spanned.T @ (spanned @ moment)
        rounding = ROUNDING * self._size / steps
        allowed = 2.0 * SPEED * mass / WINDOW + rounding
        turned = 2.0 * SPIN * float(np.linalg.norm(first.inertia, ord=2, axis=(1, 2)).sum())
        carried = 2.0 * SPEED * float(first.mass @ arms)
        allowed_moment = (turned + carried) / WINDOW + self._slack / steps + rounding
        return Balance(
            self.name,
            mass * float(np.linalg.norm(gravity)),
            float(np.linalg.norm(force)) / allowed,
            float(np.linalg.norm(moment)) / allowed_moment,
        )


def balances(scene: Scene, engine: str, dt: float = 1e-3, **settings: Any) -> list[Balance]:
    """Return the balance of every body and floating robot that rests at the end of a run."""
    gravity, parts, steps = np.array(scene.gravity), list(_parts(scene)), round(WINDOW / dt)
    with World(scene, engine, dt, **settings) as world:
        world.step(round(SETTLING / dt))
        for _ in range(steps):
            world.step()
            state, contacts = world.state, list(world.contacts())
            for part in parts:
                if part.rests:
                    part.take(state, contacts)
            if not any(part.rests for part in parts):
                return []
    about_normals = engine != "drake" or not touches_over_surfaces(scene)
    return [each.balance(gravity, steps, about_normals) for each in parts if each.rests]


def rest_excess(scene: Scene, engine: str, dt: float = 1e-3, **settings: Any) -> Mapping[str, float]:
    """Return the largest ratio of error and bound over all parts that rest, and the number of these parts."""
    found = balances(scene, engine, dt, **settings)
    return {
        "resting force": max((each.force for each in found), default=0.0),
        "resting moment": max((each.moment for each in found), default=0.0),
        AT_REST: float(len(found)),
    }


def _parts(scene: Scene) -> Iterator[_Part]:
    empty = replace(scene, robots=(), bodies=(), constraints=(), groups=(), ignored=())
    for robot in scene.robots:
        if robot.model.floating and robot.model.total_mass > 0.0:
            yield _Part(robot.name, replace(empty, robots=(robot,)))
    for body in scene.bodies:
        if not body.fixed:
            yield _Part(body.name, replace(empty, bodies=(body,)))
