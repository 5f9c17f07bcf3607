"""Remedies at run time: settings applied to a robot that PyBullet has loaded."""

from __future__ import annotations

from collections.abc import Collection, Mapping

import numpy as np

from dynx.engines.pybullet.loaded_client import LoadedClient, Setting
from dynx.loaded.calls import called_joints
from dynx.model import Model
from dynx.model.mechanism import ROOT
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

_JOINT_VALUES = {
    "pybullet.no_damping": {"jointDamping": 0.0},
    # Limits that no joint reaches.
    "pybullet.no_limits": {"jointLowerLimit": -1e300, "jointUpperLimit": 1e300},
}
"""The values of joints that a call sets."""


def disable_simulation_settings(client: LoadedClient) -> None:
    """Switch off motors, damping of the base and the limit of speeds, which do not come from the file."""
    client.disable_damping()
    client.release_motors()


def set_joints(joints: Mapping[str, int], calls: Collection[str]) -> Setting:
    """Return the setting that applies those of `calls` that act on joints, which `joints` numbers by name."""

    def change(client: LoadedClient) -> None:
        for call, values in _JOINT_VALUES.items():
            for name in called_joints(calls, call, joints):
                client.call(client.engine.changeDynamics, client.body, joints[name], **values)

    return change


def set_inertias(model: Model, links: Mapping[str, int]) -> Setting:
    """Return the setting that restores the moments of the file where Bullet replaced them by zero."""

    def change(client: LoadedClient) -> None:
        for name, k in links.items():
            inertial = model.inertial(name)
            held = client.dynamics(k)
            if any(held[2]) or not inertial.tensor.any() or (k == ROOT and not client.floating):
                continue
            R = rotation_from_quat(np.array(held[4])).T @ inertial.origin.matrix[:3, :3]
            moments = np.diagonal(R @ inertial.tensor @ R.T).tolist()
            client.call(client.engine.changeDynamics, client.body, k, localInertiaDiagonal=moments)

    return change


def with_ballast(times: int) -> Setting:
    """Return the setting that adds `times` times a rotational inertia s, the same about every axis, to each
    impossible inertia.

    Inverse dynamics f and the mass matrix are affine in the inertia of each link, so that
    f(I) = 2 f(I + s) - f(I + 2 s); and with s larger than any moment Bullet accepts the link.
    """

    def change(client: LoadedClient) -> None:
        for k in (ROOT, *client.links):
            moments = client.dynamics(k)[2]
            if (k == ROOT and not client.floating) or _possible(*sorted(moments)):
                continue
            # A power of two, so that adding it loses the fewest digits.
            s = 2.0 ** np.ceil(np.log2(2.0 * max(map(abs, moments))))
            loaded = [float(moment + times * s) for moment in moments]
            client.call(client.engine.changeDynamics, client.body, k, localInertiaDiagonal=loaded)

    return change


def _possible(small: float, middle: float, large: float) -> bool:
    """Check whether a body can have these principal moments, with a margin for the rounding of Bullet."""
    return small >= 0.0 and small + middle >= large * (1.0 + 64.0 * float(np.finfo(float).eps))
