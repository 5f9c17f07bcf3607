"""The step of a robot with PD motors that touches the ground (`dynx.rbd.contact_step`) as a kernel."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from dynx.compiled.simplification import simplify_mechanism
from dynx.compiled.step import StepText
from dynx.errors import ArgumentError, UnsupportedFeatureError, shown
from dynx.model import Model
from dynx.model.ball_joints import refuse_ball_joints
from dynx.rbd.base_parameters import regroup_inertias
from dynx.rbd.contact_step import ServoJoints, SpheresOnPlane, Sweeps, contact_step
from dynx.spatial.scalar import Array, Floats
from dynx.steppers.layout import stop_positions

INPUTS = ("friction", "gravity", "kp", "kd", "max_torque")
"""Numbers that may be inputs of the kernel."""


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
    joint_limits: bool = False,
    inputs: Sequence[str] = (),
) -> StepText:
    """Return the text of a step of `h` [s] for `dynx.compiled.step`.

    `spheres` has the radius [m] of a sphere at the origin of each frame, `kp` and `kd` (n joints,) are the
    gains of the motors, `max_torque` (n joints,) their largest torques [N m or N]. Inputs and outputs are q
    (nq,), v (nv,) and impulses (m,): three for each sphere, normal and tangents, then one for each joint with
    dry friction or, with `joint_limits`, with a limit. Another input is target (n joints,), another output
    residual (1,). `axes` and `offset` are those of the plane (`SpheresOnPlane`). Damping, dry friction,
    armature and springs of the joints are in the step.

    Numbers named in `inputs` are inputs of the kernel instead of constants, so that they may differ from lane
    to lane: "friction" (a coefficient for each sphere), "gravity" (3,), "kp", "kd" and "max_torque"
    (n joints,).

    Raises UnsupportedFeatureError for a robot with mimic joints or ball joints, UnknownNameError for an
    unknown frame, and ArgumentError for an unknown input.
    """
    refuse_ball_joints(model, "a compiled step with contacts")
    if model.mechanism.coupling is not None:
        raise UnsupportedFeatureError(
            f"{model.name} has mimic joints, which a compiled step with contacts lacks"
        )
    for name in inputs:
        if name not in INPUTS:
            raise ArgumentError(f"input {shown(name)} is unknown; wanted {' or '.join(INPUTS)}")
    dynamics = [joint.dynamics for joint in model.coordinate_joints]
    n = len(dynamics)
    mechanism = simplify_mechanism(model.mechanism)
    regrouped = regroup_inertias(mechanism)
    stops = dict(zip(("lower", "upper"), stop_positions(model), strict=True)) if joint_limits else {}
    joints = ServoJoints.of(
        np.full(n, kp),
        np.full(n, kd),
        damping=np.array([each.damping for each in dynamics]),
        armature=np.array([each.armature for each in dynamics]),
        friction=np.array([each.friction for each in dynamics]),
        stiffness=np.array([each.stiffness for each in dynamics]),
        reference=np.array([each.spring_reference for each in dynamics]),
        max_torque=None if max_torque is None else np.full(n, max_torque),
        **stops,
    )
    touching = SpheresOnPlane(
        tuple(model.frame_index(name) for name in spheres), tuple(spheres.values()), tuple(axes), offset
    )
    limits = Sweeps() if sweeps is None else sweeps
    sizes = {
        "q": model.nq,
        "v": model.nv,
        "target": n,
        "impulses": 3 * len(spheres) + len(joints.limited),
        **{name: {"friction": len(spheres), "gravity": 3}.get(name, n) for name in inputs},
    }

    def function(**arrays: Any) -> Mapping[str, Array]:
        given = {name: arrays.pop(name) for name in inputs}
        arrays["friction"] = given.pop("friction", [friction] * len(spheres))
        moved, fewer = mechanism, regrouped
        if "gravity" in given:
            gravity = given.pop("gravity")
            moved, fewer = (replace(each, gravity=gravity) for each in (mechanism, regrouped))
        return contact_step(moved, replace(joints, **given), touching, limits, h, **arrays, regrouped=fewer)

    return StepText(function, sizes, "the step with contacts cannot be compiled", repeats=True)
