"""Why a law of torque may diverge: a damping that is too large for the step and for what the joint moves."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from dynx import control
from dynx.backends import backend
from dynx.control.base import Controller
from dynx.model import Model
from dynx.sim.named_controllers import joint_inertia
from dynx.spatial.scalar import Floats

_LAWS_OF_TORQUE = (
    control.PD,
    control.PID,
    control.Velocity,
    control.GravityCompensatedPD,
    control.FeedForward,
)
"""Those whose kd is in N m s/rad or N s/m."""


class Overshoot(NamedTuple):
    """The joint that a step of the law brakes hardest, and kd dt / inertia there.

    A joint alone obeys v' = v (1 - kd dt / inertia) in each step: above 1 it turns round, above 2 it is
    faster afterwards than before.
    """

    joint: str
    ratio: float


def overshoot(law: Controller[Any] | None, q: Floats, control_dt: float) -> Overshoot | None:
    """Where kd dt / inertia is largest at `q` (nq,), if that is above 1; None for a law without such a kd.

    The inertia of each joint is that of the model that the law knows, the diagonal of its mass matrix.
    """
    inner = law.inner if isinstance(law, control.FrictionCompensation) else law
    kd = _damping(inner, q)
    if inner is None or kd is None or not inner.model.joint_names:
        return None
    model = inner.model
    inertia = joint_inertia(model, q)
    braked = kd[-len(inertia) :] * control_dt
    ratio = np.divide(braked, inertia, out=np.zeros_like(braked), where=inertia > 0.0)
    worst = int(np.argmax(ratio))
    return Overshoot(model.joint_names[worst], float(ratio[worst])) if ratio[worst] > 1.0 else None


def _damping(law: Controller[Any] | None, q: Floats) -> Floats | None:
    """What the law takes from each coordinate for its speed, while the others hold still."""
    if isinstance(law, _LAWS_OF_TORQUE):
        return law.kd
    if isinstance(law, control.Impedance):
        J = _jacobian(law.model, law.frame, q)
        damping: Floats = np.einsum("ij,i,ij->j", J, law.damping, J) + law.joint_damping
        return damping
    return None


def _jacobian(model: Model, frame: str, q: Floats) -> Floats:
    with backend("reference", model, validate=False) as bodies:
        return np.asarray(bodies.jacobian(q, frame))
