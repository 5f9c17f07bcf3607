"""Momentum and energy of a world, from the rigid bodies that move in it: those of the scene and of robots."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dynx.model.mechanism import ROOT
from dynx.rbd.kinematics import body_poses, body_twists
from dynx.spatial.inertia import RigidInertia
from dynx.spatial.scalar import Floats
from dynx.spatial.so3 import skew
from dynx.world import Scene, SceneBody, SceneRobot, WorldState


@dataclass(frozen=True, eq=False)
class RigidBodies:
    """Every rigid body that moves, in world axes; arrays have a row for each."""

    mass: Floats
    center: Floats
    """Centre of mass (n, 3) [m]."""
    velocity: Floats
    """Velocity (n, 3) of the centre of mass [m/s]."""
    omega: Floats
    """Angular velocity (n, 3) [rad/s]."""
    inertia: Floats
    """Inertia (n, 3, 3) about the centre of mass [kg m^2]."""
    arm: Floats
    """Length (n,) [m] of the way from the base of a robot along its joints to the centre of mass; 0 for a
    body."""

    @property
    def spin(self) -> Floats:
        """Angular momentum (n, 3) of each body about its centre of mass."""
        return np.asarray(np.einsum("nij,nj->ni", self.inertia, self.omega))

    @property
    def linear(self) -> Floats:
        """Linear momentum (n, 3) of each body."""
        return self.mass[:, None] * self.velocity

    @property
    def momentum(self) -> Floats:
        """Total momentum (6,): linear, then angular about the origin of the world."""
        linear = self.linear
        angular = self.spin + np.cross(self.center, linear)
        return np.concatenate([linear.sum(axis=0), angular.sum(axis=0)])

    @property
    def kinetic_energy(self) -> float:
        """Kinetic energy [J]."""
        turning = np.einsum("ni,ni->", self.omega, self.spin)
        return 0.5 * float(np.einsum("ni,ni->", self.velocity, self.linear) + turning)

    def potential_energy(self, gravity: Floats) -> float:
        """Potential energy [J], zero at the origin of the world."""
        return -float(self.mass @ (self.center @ gravity))


def rigid_bodies(scene: Scene, state: WorldState, *, free_only: bool = False) -> RigidBodies:
    """Return the bodies that move; with `free_only` without those of robots on fixed bases."""
    rows: list[tuple[Floats, ...]] = []
    for robot in scene.robots:
        if robot.model.floating or not free_only:
            rows += _links(robot, *state.robots[robot.name])
    for body in scene.bodies:
        if not body.fixed:
            rows.append(_body(body, *state.bodies[body.name]))
    if not rows:
        none = np.zeros((0, 3))
        return RigidBodies(np.zeros(0), none, none, none, np.zeros((0, 3, 3)), np.zeros(0))
    return RigidBodies(*(np.array(column, dtype=float) for column in zip(*rows, strict=True)))


def _body(body: SceneBody, T: Floats, twist: Floats) -> tuple[Floats, ...]:
    inertial, R = body.inertial, T[:3, :3]
    lever = R @ np.array(inertial.origin.xyz)
    velocity = twist[:3] + np.cross(twist[3:], lever)
    turned = R @ inertial.tensor @ R.T
    return np.array(inertial.mass), T[:3, 3] + lever, velocity, twist[3:], turned, np.array(0.0)


def _links(robot: SceneRobot, q: Floats, v: Floats) -> list[tuple[Floats, ...]]:
    mechanism = robot.model.mechanism
    if mechanism.coupling is not None:
        q, v = mechanism.coupling.expand_q(q), mechanism.coupling.matrix() @ v
    poses = body_poses(mechanism, q)
    twists = body_twists(mechanism, poses, v)
    inertias = [mechanism.root, *(each.inertia for each in mechanism.bodies)]
    ways = {ROOT: 0.0}
    for number, body in enumerate(mechanism.bodies):
        step = float(np.linalg.norm(poses[number][1] - poses[body.parent][1]))
        ways[number] = ways[body.parent] + step
    rows = []
    for number, inertia in enumerate(inertias, ROOT):
        if (number == ROOT and not mechanism.floating) or float(inertia.mass) == 0.0:
            continue
        rows.append(_link(inertia, ways[number], *poses[number], *twists[number]))
    return rows


def _link(
    inertia: RigidInertia, way: float, R: Floats, p: Floats, v: Floats, omega: Floats
) -> tuple[Floats, ...]:
    mass = float(inertia.mass)
    center = np.asarray(inertia.first_moment, dtype=float) / mass
    arm = skew(center)
    about_center = np.asarray(inertia.rotational_inertia, dtype=float) + mass * (arm @ arm)
    lever = R @ center
    length = np.array(way + float(np.linalg.norm(lever)))
    return np.array(mass), p + lever, v + np.cross(omega, lever), omega, R @ about_center @ R.T, length
