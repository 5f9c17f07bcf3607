"""Likely causes of divergence, and of torques that reverse in every control step.

They are overshoot of a controller's damping in discrete time (kd dt / inertia of each joint, or kd dt), and
friction that is compensated beyond that of the plant."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from dynx import control
from dynx.backends import backend
from dynx.backends.joint_friction import JointFriction
from dynx.control.base import Controller, chain_of
from dynx.control.content import attributes_of, fields_of
from dynx.model import Model
from dynx.spatial.scalar import Floats

MIN_REVERSALS = 20
"""Number of successive control steps in each of which the torque of a joint reverses if its oscillation does
not decay."""


class Overshoot(NamedTuple):
    """The joint with the largest ratio kd dt / inertia, and that ratio.

    The velocity of a single joint changes in each control step to v' = v (1 - kd dt / inertia). If the ratio
    is above 1 it changes sign, above 2 it also grows. Computed torque multiplies kd by the inertia, so that
    its ratio is kd dt.
    """

    joint: str
    ratio: float
    gain: str
    """Name of the gain: ``kd`` or ``damping``."""
    by_inertia: bool
    """Whether the gain is divided by the inertia of the joint."""

    def finding(self, step: str = "control_dt") -> str:
        """Return what a sustained overshoot is; `step` is the control step's name, dt or control_dt."""
        return f"the torque of {self.joint} reverses in every control step, because {self.hint(step)}"

    def hint(self, step: str) -> str:
        """Return the ratio and what can be done; `step` is the control step's name, dt or control_dt."""
        from dynx.steppers.stability import SEMI_IMPLICIT

        ratio = f"{self.gain} {step} / inertia" if self.by_inertia else f"{self.gain} {step}"
        return (
            f"{ratio} is {self.ratio:.3g} at {self.joint}, and a step is unstable above "
            f"{SEMI_IMPLICIT.damping:g}; smaller gains or a smaller {step} can help"
        )


def largest_overshoot(
    controller: Controller[Any] | None, q: Floats, control_dt: float, *, armature: Floats | None = None
) -> Overshoot | None:
    """Find the largest kd dt / inertia at `q` (nq,), with `control_dt` in s.

    None where no ratio exceeds 1, and for a controller without a damping of joints. The inertia of each joint
    is the diagonal of the mass matrix of the controller's model, plus the `armature` (nv,) of the plant.
    """
    return max(_overshoots(controller, q, control_dt, armature), key=lambda each: each.ratio, default=None)


def sustained_overshoot(
    controller: Controller[Any] | None, q: Floats, control_dt: float, armature: Floats, tau: Floats
) -> Overshoot | None:
    """Find the joint with the largest unstable ratio among those whose torque reverses in `MIN_REVERSALS`
    successive control steps; None without one.

    Effort limits and joint limits bound the motion of such a joint, so that nothing diverges. `tau`
    (steps, n) are the torques of the joints in each control step, `armature` (nv,) is that of the plant.
    """
    reverses = tau[1:] * tau[:-1] < 0.0
    if len(reverses) < MIN_REVERSALS:
        return None
    oscillates = np.asarray(sliding_window_view(reverses, MIN_REVERSALS, axis=0).all(axis=-1).any(axis=0))
    if not oscillates.any() or controller is None:
        return None
    from dynx.steppers.stability import SEMI_IMPLICIT  # loops that do not oscillate need none

    names = [name for name, found in zip(controller.model.coordinate_names, oscillates, strict=True) if found]
    unstable = (
        each
        for each in _overshoots(controller, q, control_dt, armature)
        if each.joint in names and each.ratio > SEMI_IMPLICIT.damping
    )
    return max(unstable, key=lambda each: each.ratio, default=None)


def joint_inertia(model: Model, q: Floats) -> Floats:
    """Return the inertia (n,) [kg m^2 or kg] of each joint at `q`, with the others at rest.

    With a floating base it is 1 / (M^-1)_ii, the inertia with all other coordinates free: the smallest
    possible, so that gains scaled by it do not overshoot.
    """
    with backend("reference", model, validate=False) as bodies:
        M: Floats = bodies.mass_matrix(q)
    if not model.floating:
        return np.maximum(np.diag(M), 0.0)
    yielding = np.diag(np.linalg.pinv(M))[6:]
    return np.divide(1.0, yielding, out=np.zeros_like(yielding), where=yielding > 0.0)


def _overshoots(
    controller: Controller[Any] | None, q: Floats, control_dt: float, armature: Floats | None
) -> list[Overshoot]:
    """Return the joints whose ratio exceeds 1."""
    if controller is None:
        return []
    *_, inner = chain_of(controller)
    if not inner.model.coordinate_names:
        return []
    n = len(inner.model.coordinate_names)
    if isinstance(inner, control.ComputedTorque):
        ratio, by_inertia = inner.kd[-n:] * control_dt, False
    else:
        kd = _joint_damping(inner, q)
        if kd is None:
            return []
        inertia, by_inertia = joint_inertia(inner.model, q), True
        if armature is not None:
            inertia = inertia + armature[-n:]
        ratio = np.divide(kd[-n:] * control_dt, inertia, out=np.zeros(n), where=inertia > 0.0)
    gain = "damping" if isinstance(inner, control.Impedance) else "kd"
    return [
        Overshoot(name, float(each), gain, by_inertia)
        for name, each in zip(inner.model.coordinate_names, ratio, strict=True)
        if each > 1.0
    ]


def overcompensated_friction(controller: Controller[Any] | None, plant: JointFriction) -> str | None:
    """Return a sentence on the joint whose friction a compensation by the measured speed exceeds most.

    Such a joint is driven away in the direction of its motion. None where no coefficient of a coordinate is
    above that of the `plant`; mimic joints count in the coordinate that they follow.
    """
    if not isinstance(controller, control.FrictionCompensation) or controller.speed != "measured":
        return None
    own, joints = controller.losses, slice(6 if controller.model.floating else 0, None)
    for name, unit, ours, theirs in (
        ("damping", "N m s/rad or N s/m", own.viscous[joints], plant.viscous[joints]),
        ("friction", "N m or N", own.dry[joints], plant.dry[joints]),
    ):
        if not len(ours):
            return None
        worst = int(np.argmax(ours - theirs))
        if ours[worst] > theirs[worst]:
            joint = own.model.coordinate_names[worst]
            return (
                f"the compensation adds {name} of {ours[worst]:.4g} {unit} at {joint}, "
                f"where the plant has {theirs[worst]:.4g}, and so drives the joint away; compensate at most "
                'that, or with speed="setpoint"'
            )
    return None


def _joint_damping(controller: Controller[Any], q: Floats) -> Floats | None:
    """Return the damping gain of each coordinate (n,) [N m s/rad or N s/m] while the others are at rest;
    None for a controller without one, and for one whose ``kd`` is not numbers."""
    kd = fields_of(controller).get("kd")
    if kd is not None and str(kd.metadata.get("unit", "")).startswith("N"):
        # A controller of a user may have one gain for all coordinates, or keep something else under the name.
        try:
            gain = np.asarray(attributes_of(controller).get("kd"), dtype=float)
        except (AttributeError, TypeError, ValueError):
            return None
        n = controller.model.nv
        return np.broadcast_to(gain, n) if gain.shape in ((), (1,), (n,)) else None
    if isinstance(controller, control.Impedance):
        with backend("reference", controller.model, validate=False) as engine:
            J = np.asarray(engine.jacobian(q, controller.frame))
        return np.asarray(np.einsum("ij,i,ij->j", J, controller.damping, J) + controller.joint_damping)
    return None
