"""Laws of mechanics of a step, with bounds that follow from the scheme of each engine.

All three engines take semi-implicit Euler steps of h: velocities from forces at the beginning of the step,
then positions from the new velocities. So

- linear momentum of bodies changes by the impulses of gravity and of the contacts with what is fixed, up to
  `solver_residual`, what the engine's solver leaves of its equations;
- angular momentum and the momentum of robots change by these impulses and by terms of second order, because
  Coriolis and gyroscopic forces are those of the beginning of the step: with the largest angular velocity W,
  h W times the change of momentum in the step, and (h W)^2 times the momentum itself. The momentum of a link
  counts with that of its turning about the joints, m r W at the distance r along the robot, which may change
  while its centre of mass keeps its velocity;
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

RESIDUAL = {"pybullet": 1e-9, "mujoco": 1e-4, "dynx": 1e-9}
"""Relative error of impulses: MuJoCo stops its solver at `tolerance`."""

DRAKE_TOLERANCE = 1e-6
"""Tolerance at which Drake's solver stops (`SapSolverParameters.rel_tolerance`), relative to the momenta p in
the norm sqrt(p^T M^-1 p), that of the kinetic energy."""

RECOVERY: dict[str, Callable[[World], float]] = {
    "pybullet": lambda world: world.settings["contact_erp"] / world.dt,
    "mujoco": lambda world: world.dt / max(world.settings["time_constant"], 2.0 * world.dt) ** 2,
    "drake": lambda world: 1.0 / world.dt,
    "dynx": lambda world: 0.0,
}
"""Speed of separation per penetration [1/s]: Bullet's Baumgarte term; the stiffness of MuJoCo's springs times
a step; for the springs of Drake, removal in a step; 0 for dynx, which moves bodies apart without velocity."""

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
    return engine != "drake" or not touches_over_surfaces(scene)


def touches_over_surfaces(scene: Scene) -> bool:
    """Check whether shapes of the scene touch over surfaces in Drake, and not at a point."""
    links = [
        shape
        for robot in scene.robots
        for link in robot.model.links
        for shape in robot.model.geometry.collisions(link.name)
    ]
    shapes = [*links, *(shape for body in scene.bodies for shape in body.shapes)]
    return any(isinstance(each.shape, Box | Cylinder) for each in shapes)


def solver_residual(world: World, before: RigidBodies, after: RigidBodies, size: float) -> float:
    """Return the error of the momentum [kg m/s] that the solver of the engine may leave in a step.

    The impulses of contacts with what is fixed add up to `size`.

    An error of the momenta p_i with sum p_i^2 / m_i <= e^2 is at most e sqrt(sum m_i) in total.
    """
    change = after.linear - before.linear
    if world.engine != "drake":
        return RESIDUAL[world.engine] * (size + _sizes(change))
    energy = max(before.kinetic_energy, after.kinetic_energy)
    total = float(before.mass.sum())
    if total == 0.0:
        return 0.0
    gained = float(np.sum(change**2 / before.mass[:, None]))
    norm = np.sqrt(2.0 * energy) + np.sqrt(gained) + size / np.sqrt(total)
    return DRAKE_TOLERANCE * float(np.sqrt(total) * norm)


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
    turned = float(np.max(np.linalg.norm(after.omega - before.omega, axis=1), initial=0.0))
    swing = float(before.mass @ before.arm)
    change = _sizes(after.linear - before.linear) + swing * turned
    total = _sizes(after.linear) + swing * turning / h
    spin_change, spin = _sizes(after.spin - before.spin), _sizes(after.spin)
    second = SECOND_ORDER * turning * (change + turning * total) if scene.robots else 0.0
    residual = solver_residual(world, before, after, size) + ROUNDING * (1.0 + total)
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
