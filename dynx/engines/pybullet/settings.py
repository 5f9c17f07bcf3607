"""What a user can change in a robot after PyBullet has loaded it: the remedies at run time."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from dynx.engines.pybullet.loaded_client import ROOT, BulletWorld, Setting
from dynx.model import Model
from dynx.spatial.so3 import rotation_from_quat

CALLS: Mapping[str, str] = {
    "pybullet.set_inertias": (
        "p.changeDynamics(robot, link, localInertiaDiagonal=[ixx, iyy, izz])"
        "  # the principal moments of the file; before the first calculateInverseDynamics"
    ),
    "pybullet.no_damping": (
        "for j in range(p.getNumJoints(robot)): p.changeDynamics(robot, j, jointDamping=0)"
    ),
    "pybullet.no_limits": (
        "for j in range(p.getNumJoints(robot)): "
        "p.changeDynamics(robot, j, jointLowerLimit=-1e300, jointUpperLimit=1e300)"
    ),
    "pybullet.extrapolate_inertias": (
        "# load it into two clients; s is larger than any |moment|; k = 1 in the first, 2 in the second\n"
        "p.changeDynamics(robot, link, localInertiaDiagonal=[ixx + k * s, iyy + k * s, izz + k * s])\n"
        "tau = 2 * tau_of_the_first - tau_of_the_second  # likewise the mass matrix"
    ),
}
"""The lines of code, by the id of the remedy."""


def simulation_off(world: BulletWorld) -> None:
    """No motor, damping of the whole body or speed clamp: they belong to the simulation, not the file."""
    engine = world.engine
    # In a call of its own: together with a setting of a link Bullet would send that to the root.
    world.ask(
        engine.changeDynamics, world.body, ROOT, linearDamping=0.0, angularDamping=0.0, maxJointVelocity=1e300
    )
    if world.moving:
        still = [0.0] * len(world.moving)
        world.ask(
            engine.setJointMotorControlArray, world.body, world.moving, engine.VELOCITY_CONTROL, forces=still
        )


def no_damping(world: BulletWorld) -> None:
    """No damping in the joints."""
    for k in range(world.n_joints):
        world.ask(world.engine.changeDynamics, world.body, k, jointDamping=0.0)


def no_limits(world: BulletWorld) -> None:
    """Limits that no joint reaches."""
    for k in world.moving:
        world.ask(world.engine.changeDynamics, world.body, k, jointLowerLimit=-1e300, jointUpperLimit=1e300)


def set_inertias(model: Model, links: Mapping[str, int]) -> Setting:
    """The moments that Bullet put to zero, as the file has them, about the axes that Bullet holds."""

    def change(world: BulletWorld) -> None:
        for name, k in links.items():
            inertial = model.inertial(name)
            held = world.dynamics(k)
            if any(held[2]) or not inertial.tensor.any() or (k == ROOT and world.static):
                continue
            R = rotation_from_quat(np.array(held[4])).T @ inertial.origin.matrix[:3, :3]
            moments = np.diagonal(R @ inertial.tensor @ R.T).tolist()
            world.ask(world.engine.changeDynamics, world.body, k, localInertiaDiagonal=moments)

    return change


def with_ballast(times: int) -> Setting:
    """`times` the same rotational inertia about every axis, on each link that no body could be.

    Inverse dynamics f and the mass matrix are affine in the inertia of each link, so that
    f(I) = 2 f(I + s) - f(I + 2 s); and with s larger than any moment Bullet takes the link.
    """

    def change(world: BulletWorld) -> None:
        for k in range(ROOT, world.n_joints):
            moments = world.dynamics(k)[2]
            if (k == ROOT and world.static) or _possible(*sorted(moments)):
                continue
            # A power of two, so that adding it costs as few digits as can be.
            s = 2.0 ** np.ceil(np.log2(2.0 * max(map(abs, moments))))
            loaded = [float(moment + times * s) for moment in moments]
            world.ask(world.engine.changeDynamics, world.body, k, localInertiaDiagonal=loaded)

    return change


def _possible(small: float, middle: float, large: float) -> bool:
    """Whether these are the principal moments of a body, with room for the way Bullet rounds."""
    return small >= 0.0 and small + middle >= large * (1.0 + 64.0 * float(np.finfo(float).eps))
