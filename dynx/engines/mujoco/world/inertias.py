"""Inertias of rigid bodies in MuJoCo's form: mass, centre of mass, principal moments and axes."""

from __future__ import annotations

from typing import Any

import numpy as np

from dynx.engines.mujoco.tree import quat_wxyz
from dynx.errors import EngineLimitError, shown
from dynx.spatial.extended import FLOAT64_EPS, jacobi_eigen, longdouble
from dynx.spatial.inertia import RigidInertia
from dynx.spatial.scalar import Array
from dynx.spatial.so3 import skew
from dynx.steppers.layout import BodyLayout


def write_rigid_inertia(model: Any, body: int, inertia: RigidInertia, robot: str, *, at_center: bool) -> None:
    """Write the inertia of a body of a robot into a compiled model. With `at_center` MuJoCo's frame of the
    body is at its centre of mass.

    Raises EngineLimitError for a first moment without a mass, which MuJoCo cannot represent.
    """
    mass, center = longdouble(inertia.mass), longdouble(np.zeros(3))
    if mass != 0.0:
        center = longdouble(inertia.first_moment) / mass
    elif np.any(inertia.first_moment != 0.0):
        raise EngineLimitError(
            f"a body of {shown(robot)} has a first moment and no mass, because masses of its links cancel; "
            "'mujoco' cannot represent that"
        )
    arm = skew(center)
    moments, axes = jacobi_eigen(longdouble(inertia.rotational_inertia) + mass * (arm @ arm))
    # Merging leaves a point mass with rounding errors of either sign.
    noise = 4.0 * FLOAT64_EPS * float(np.max(np.abs(inertia.rotational_inertia)))
    origin = longdouble(np.zeros(3)) if at_center else center
    _write(model, body, float(mass), origin, np.where(np.abs(moments) <= noise, 0.0, moments), axes)


def write_body_inertia(model: Any, number: int, body: BodyLayout) -> None:
    """Write the inertia of a body of a scene, whose centre of mass is the origin of MuJoCo's frame."""
    _write(model, number, body.mass, np.zeros(3), *jacobi_eigen(longdouble(body.inertia)))


def _write(model: Any, body: int, mass: float, center: Array, moments: Array, axes: Array) -> None:
    model.body_mass[body] = mass
    model.body_ipos[body] = np.asarray(center, dtype=np.float64)
    model.body_inertia[body] = np.asarray(moments, dtype=np.float64)
    model.body_iquat[body] = quat_wxyz(axes)
