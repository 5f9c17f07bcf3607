"""Overshoot of a controller's damping in discrete time: kd dt / inertia of each joint."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from dynx import control
from dynx.backends import backend
from dynx.control.base import Controller
from dynx.control.content import attributes_of, fields_of
from dynx.sim.named_controllers import joint_inertia
from dynx.spatial.scalar import Floats


class Overshoot(NamedTuple):
    """The joint with the largest ratio kd dt / inertia, and that ratio.

    The velocity of a single joint changes in each control step to v' = v (1 - kd dt / inertia). If the ratio
    is above 1 it changes sign, above 2 it also grows.
    """

    joint: str
    ratio: float


def largest_overshoot(controller: Controller[Any] | None, q: Floats, control_dt: float) -> Overshoot | None:
    """Find the largest kd dt / inertia at `q` (nq,), with `control_dt` in s.

    None where no ratio exceeds 1, and for a controller without a damping in N m s/rad or N s/m. The inertia
    of each joint is the diagonal of the mass matrix of the controller's model.
    """
    inner = controller.inner if isinstance(controller, control.FrictionCompensation) else controller
    kd = None if inner is None else _joint_damping(inner, q)
    if inner is None or kd is None or not inner.model.joint_names:
        return None
    inertia = joint_inertia(inner.model, q)
    velocity_change = kd[-len(inertia) :] * control_dt
    ratio = np.divide(velocity_change, inertia, out=np.zeros_like(inertia), where=inertia > 0.0)
    worst = int(np.argmax(ratio))
    return Overshoot(inner.model.joint_names[worst], float(ratio[worst])) if ratio[worst] > 1.0 else None


def _joint_damping(controller: Controller[Any], q: Floats) -> Floats | None:
    """Return the damping gain of each coordinate (n,) [N m s/rad or N s/m] while the others are at rest;
    None for a controller without one."""
    kd = fields_of(controller).get("kd")
    if kd is not None and kd.metadata.get("unit", "").startswith("N"):
        damping: Floats = attributes_of(controller)["kd"]
        return damping
    if isinstance(controller, control.Impedance):
        with backend("reference", controller.model, validate=False) as engine:
            J = np.asarray(engine.jacobian(q, controller.frame))
        return np.asarray(np.einsum("ij,i,ij->j", J, controller.damping, J) + controller.joint_damping)
    return None
