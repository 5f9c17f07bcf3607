"""Laws of mechanics of a step, with bounds that follow from the scheme of each engine.

All three engines take semi-implicit Euler steps of h: velocities from forces at the beginning of the step,
then positions from the new velocities. So

- linear momentum of bodies changes by the impulses of gravity and of the contacts with what is fixed, up to
  `RESIDUAL`, what the engine's solver leaves of its equations;
- angular momentum and the momentum of robots change by these impulses and by terms of second order, because
  Coriolis and gyroscopic forces are those of the beginning of the step: with the largest angular velocity W,
  h W times the change of momentum in the step, and (h W)^2 times the momentum itself;
- a step adds at most this energy: that of the gyroscopic terms, (h a)' I (h a) / 2 with a = I^-1 (w x I w),
  (h W)^2 times the kinetic energy where there are robots, and for each contact the impulse h N times half of
  the speed at which the engine separates what penetrates by d: `RECOVERY`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np

from dynx.model.geometry import Box, Cylinder
from dynx.spatial.scalar import Floats
from dynx.world import Contact, Scene, World
from tests.world.random_scenes.mechanics import RigidBodies

RESIDUAL = {"pybullet": 1e-9, "mujoco": 1e-4, "drake": 1e-4}
"""Relative error of impulses: MuJoCo stops its solver at `tolerance`, Drake at 1e-6 of the momenta."""

RECOVERY: dict[str, Callable[[World], float]] = {
    "pybullet": lambda world: world.settings["contact_erp"] / world.dt,
    "mujoco": lambda world: world.dt / max(world.settings["time_constant"], 2.0 * world.dt) ** 2,
    "drake": lambda world: 1.0 / world.dt,
}
"""Speed of separation per penetration [1/s]: Bullet's Baumgarte term; the stiffness of MuJoCo's springs times
a step; for the springs of Drake, removal in a step."""

SECOND_ORDER = 5.0
"""Factor of terms of second order in the step."""

ROUNDING = 1e-11
"""Rounding of states, relative to the momenta and energies in the scene."""


@dataclass(frozen=True)
class Excess:
    """Errors of a step divided by their bounds: above 1 a law is violated."""

    linear: float
    angular: float


def fixed_parts(scene: Scene) -> set[str]:
    """Return what is not free: fixed bodies, robots on fixed bases, the world."""
    robots = (robot.name for robot in scene.robots if not robot.model.floating)
    return {"world", *robots, *(body.name for body in scene.bodies if body.fixed)}


def has_free_momentum(scene: Scene) -> bool:
    """Check whether no constraint connects what is free with what is not."""
    fixed = fixed_parts(scene)
    return all(_owner(each.a, fixed) == _owner(each.b, fixed) for each in scene.constraints)


def reports_moments(scene: Scene, engine: str) -> bool:
    """Check whether contacts have no moments besides those of their forces, which contacts do not report:
    torsional and rolling friction, and in Drake friction of a surface about its normal."""
    materials = [robot.material for robot in scene.robots] + [body.material for body in scene.bodies]
    if any(each.torsional_friction or each.rolling_friction for each in materials):
        return False
    links = [
        shape
        for robot in scene.robots
        for link in robot.model.links
        for shape in robot.model.geometry.collisions(link.name)
    ]
    shapes = [*links, *(shape for body in scene.bodies for shape in body.shapes)]
    return engine != "drake" or not any(isinstance(each.shape, Box | Cylinder) for each in shapes)


def momentum_excess(
    scene: Scene, world: World, before: RigidBodies, after: RigidBodies, contacts: Iterable[Contact]
) -> Excess:
    """Return the error of linear and angular momentum of what is free in one step, divided by the bounds."""
    h, gravity = world.dt, np.array(scene.gravity)
    impulse = h * np.concatenate(
        [before.mass.sum() * gravity, np.cross(before.mass @ before.center, gravity)]
    )
    size, moved = 0.0, 0.0
    speed = float(np.max(np.linalg.norm(after.velocity, axis=1), initial=0.0))
    reach = float(np.max(np.linalg.norm(before.center, axis=1), initial=0.0)) + 1.0
    for point, force, gap in _external(contacts, fixed_parts(scene)):
        impulse += h * np.concatenate([force, np.cross(point, force)])
        size += h * float(np.linalg.norm(force))
        # The point may be that of the beginning or of the end of the step, on either body.
        moved += h * float(np.linalg.norm(force)) * (abs(gap) + h * speed)
    error = after.momentum - before.momentum - impulse
    turning = h * _largest(before.omega, after.omega)
    change, total = (_sizes(after.linear - before.linear), _sizes(after.linear))
    spin_change, spin = _sizes(after.spin - before.spin), _sizes(after.spin)
    second = SECOND_ORDER * turning * (change + turning * total) if scene.robots else 0.0
    residual = RESIDUAL[world.engine] * (size + change) + ROUNDING * (1.0 + total)
    spinning = SECOND_ORDER * turning * (spin_change + turning * spin)
    return Excess(
        float(np.linalg.norm(error[:3])) / (residual + second),
        float(np.linalg.norm(error[3:])) / (reach * (residual + second) + spinning + 2.0 * moved),
    )


def energy_allowance(world: World, before: RigidBodies, after: RigidBodies, robots: bool) -> float:
    """Return the largest energy [J] that the step just taken may have added."""
    h = world.dt
    torques = np.cross(before.omega, before.spin)
    changes = np.linalg.solve(before.inertia, torques[..., None])[..., 0] if len(torques) else torques
    gyroscopic = 0.5 * h * h * float(np.einsum("ni,ni->", torques, changes))
    recovery = 0.5 * RECOVERY[world.engine](world)
    contacts = sum(h * c.normal_force * max(0.0, -c.distance) * recovery for c in world.contacts())
    turning = h * _largest(before.omega, after.omega)
    articulated = SECOND_ORDER * turning**2 * after.kinetic_energy if robots else 0.0
    return gyroscopic + contacts + articulated + ROUNDING * (1.0 + after.kinetic_energy)


def _external(contacts: Iterable[Contact], fixed: set[str]) -> Iterable[tuple[Floats, Floats, float]]:
    """Yield point, force and distance of each contact of what is free with what is not."""
    for contact in contacts:
        a, b = _owner(contact.a, fixed), _owner(contact.b, fixed)
        if a != b:
            yield (
                (contact.point_b, -contact.force, contact.distance)
                if a
                else (
                    contact.point_a,
                    contact.force,
                    contact.distance,
                )
            )


def _owner(part: str, fixed: set[str]) -> bool:
    return part.partition("/")[0] in fixed


def _sizes(vectors: Floats) -> float:
    return float(np.linalg.norm(vectors, axis=1).sum())


def _largest(*omegas: Floats) -> float:
    return max(float(np.max(np.linalg.norm(omega, axis=1), initial=0.0)) for omega in omegas)
