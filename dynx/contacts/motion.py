"""Motions of bodies, recorded step by step for the cases."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from dynx.spatial.scalar import Floats
from dynx.world import World, WorldState


@dataclass(frozen=True, eq=False)
class RecordedMotion:
    """States of a world after every step, the first of them before the first step."""

    times: Floats
    """Times (n,) [s]."""
    states: tuple[WorldState, ...]

    def positions(self, body: str) -> Floats:
        """Return the origin (n, 3) of the frame of a body [m]."""
        return np.array([state.bodies[body].T_world_body[:3, 3] for state in self.states])

    def rotations(self, body: str) -> Floats:
        """Return the rotation matrices (n, 3, 3) of a body."""
        return np.array([state.bodies[body].T_world_body[:3, :3] for state in self.states])

    def velocities(self, body: str) -> Floats:
        """Return linear [m/s] and angular [rad/s] velocities (n, 6) of a body, in world axes."""
        return np.array([state.bodies[body].twist for state in self.states])


def record(world: World, duration: float, **loads: Any) -> RecordedMotion:
    """Take steps for `duration` [s], during which `loads` act (arguments of `World.step`); return the
    motion."""
    states = [world.state]
    for _ in range(step_count(world, duration)):
        world.step(**loads)
        states.append(world.state)
    return RecordedMotion(np.array([state.time for state in states]), tuple(states))


def step_count(world: World, duration: float) -> int:
    """Return the number of steps of a world that is nearest to `duration` [s], at least 1."""
    return max(1, round(duration / world.dt))


def contact_force(world: World, part: str) -> Floats:
    """Return the sum (3,) of the contact forces of the last step on a body or link [N]."""
    total: Floats = np.zeros(3)
    for contact in world.contacts():
        if contact.a == part:
            total += contact.force
        elif contact.b == part:
            total -= contact.force
    return total


def mean_contact_forces(
    world: World, parts: Sequence[str], duration: float, **loads: Any
) -> dict[str, Floats]:
    """Take steps for `duration` [s], during which `loads` act (arguments of `World.step`); return the mean
    (3,) of the contact forces on each of these bodies and links [N]."""
    steps = step_count(world, duration)
    total: dict[str, Floats] = {name: np.zeros(3) for name in parts}
    for _ in range(steps):
        world.step(**loads)
        for name in parts:
            total[name] += contact_force(world, name)
    return {name: force / steps for name, force in total.items()}


def acceleration(times: Floats, velocities: Floats) -> float:
    """Return the slope of the straight line through velocities over time (least squares)."""
    centred = times - times.mean()
    return float(centred @ velocities / (centred @ centred))


def tilts(rotations: Floats) -> Floats:
    """Return the angles (n,) [rad] of rotations (n, 3, 3) about the y axis."""
    return np.asarray(np.arctan2(rotations[:, 0, 2], rotations[:, 2, 2]))


def rate_at(angle: float, angles: Floats, rates: Floats) -> float:
    """Return the rate where angles (n,) first exceed `angle`, by linear interpolation; 0 if none does."""
    after = int(np.argmax(angles > angle))
    return (
        float(np.interp(angle, angles[after - 1 : after + 1], rates[after - 1 : after + 1])) if after else 0.0
    )
