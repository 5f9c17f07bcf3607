"""The step of a robot with PD motors whose spheres touch a plane (`dynx.rbd.contact_step`) as a kernel."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from dynx.compiled.simplification import simplify_mechanism
from dynx.compiled.step import StepText
from dynx.errors import UnsupportedFeatureError
from dynx.model import Model
from dynx.model.ball_joints import refuse_ball_joints
from dynx.rbd.base_parameters import regroup_inertias
from dynx.rbd.contact_step import ServoJoints, SpheresOnPlane, Sweeps, contact_step
from dynx.spatial.scalar import Array, Floats


def contact_step_text(
    model: Model,
    spheres: Mapping[str, float],
    *,
    h: float,
    kp: Floats | float,
    kd: Floats | float,
    friction: float,
    max_torque: Floats | float | None = None,
    axes: Sequence[tuple[float, float, float]] = ((0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)),
    offset: float = 0.0,
    sweeps: Sweeps | None = None,
) -> StepText:
    """Return the text of a step of `h` [s] for `dynx.compiled.step`.

    `spheres` has the radius [m] of a sphere at the origin of each frame, `kp` and `kd` (n joints,) are the
    gains of the motors, `max_torque` (n joints,) their largest torques [N m or N]. Inputs and outputs are q
    (nq,), v (nv,) and impulses (3 n,). Another input is target (n joints,), another output residual (1,).
    `axes` and `offset` are those of the plane (`SpheresOnPlane`). Damping and armature of the joints are in
    the step. Raises UnsupportedFeatureError for a robot with mimic joints, ball
    joints, dry friction or springs, and UnknownNameError for an unknown frame.
    """
    refuse_ball_joints(model, "a compiled step with contacts")
    if model.mechanism.coupling is not None:
        raise UnsupportedFeatureError(
            f"{model.name} has mimic joints, which a compiled step with contacts lacks"
        )
    dynamics = [joint.dynamics for joint in model.coordinate_joints]
    for joint, found in zip(model.coordinate_joints, dynamics, strict=True):
        if found.friction or found.stiffness:
            raise UnsupportedFeatureError(
                f"joint {joint.name} has dry friction or a spring, which a compiled step with contacts lacks"
            )
    n = len(dynamics)
    mechanism = simplify_mechanism(model.mechanism)
    regrouped = regroup_inertias(mechanism)
    joints = ServoJoints(
        np.full(n, kp),
        np.full(n, kd),
        np.array([each.damping for each in dynamics]),
        np.array([each.armature for each in dynamics]),
        None if max_torque is None else np.full(n, max_torque),
    )
    touching = SpheresOnPlane(
        tuple(model.frame_index(name) for name in spheres),
        tuple(spheres.values()),
        friction,
        tuple(axes),
        offset,
    )
    limits = Sweeps() if sweeps is None else sweeps

    def function(**arrays: Any) -> Mapping[str, Array]:
        return contact_step(mechanism, joints, touching, limits, h, **arrays, regrouped=regrouped)

    sizes = {"q": model.nq, "v": model.nv, "target": n, "impulses": 3 * len(spheres)}
    return StepText(function, sizes, "the step with contacts cannot be compiled", repeats=True)
