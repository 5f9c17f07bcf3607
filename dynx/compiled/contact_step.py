"""The step of a robot with PD motors that touches the ground (`dynx.rbd.contact_step`) as a kernel."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from dynx.backends.solvability import Solvability
from dynx.compiled.simplification import simplify_mechanism
from dynx.compiled.step import StepText
from dynx.errors import ArgumentError, UnsupportedFeatureError
from dynx.model import Model
from dynx.model.ball_joints import refuse_ball_joints
from dynx.model.geometry import Plane
from dynx.rbd.base_parameters import regroup_inertias
from dynx.rbd.contact_geometry import plane_point_count
from dynx.rbd.contact_step import (
    FramedShape,
    ServoJoints,
    ShapesOnPlane,
    Sweeps,
    contact_step,
)
from dynx.spatial.scalar import Array, Floats
from dynx.steppers.layout import WORLD, Layout, stop_positions
from dynx.steppers.material import contact_material


def refuse_other_joints(model: Model) -> None:
    """Raise UnsupportedFeatureError, naming the joint or robot, for ball joints and mimic joints, which the
    step does not have."""
    refuse_ball_joints(model, "a compiled step with contacts")
    if model.mechanism.coupling is not None:
        raise UnsupportedFeatureError(
            f"{model.name} has mimic joints, which a compiled step with contacts does not have"
        )


def contact_step_text(
    model: Model,
    touching: ShapesOnPlane,
    *,
    h: float,
    kp: Floats | float,
    kd: Floats | float,
    max_torque: Floats | float | None = None,
    sweeps: Sweeps | None = None,
    joint_limits: bool = False,
) -> StepText:
    """Return the text of a step of `h` [s] for `dynx.compiled.step`.

    `touching` are the shapes that may touch a plane (`shapes_on_plane` returns those of a scene). `kp` and
    `kd` (n joints,) are the gains of the motors, `max_torque` (n joints,) their largest torques [N m or N].
    Inputs and outputs are q (nq,), v (nv,) and impulses (m,): three for each contact point, normal and
    tangents, then one for each joint with dry friction or, with `joint_limits`, with a limit. Another input
    is target (n joints,), another output residual (1,). Damping, dry friction, armature and springs of the
    joints are in the step.

    Raises UnsupportedFeatureError for a robot with mimic joints or ball joints, SingularMassMatrixError for
    one without the mass to move.
    """
    refuse_other_joints(model)
    dynamics = [joint.dynamics for joint in model.coordinate_joints]
    Solvability(model).refuse_singular(joint_dynamics=any(each.armature for each in dynamics))
    n = len(dynamics)
    mechanism = simplify_mechanism(model.mechanism)
    regrouped = regroup_inertias(mechanism)
    joints = ServoJoints(
        np.full(n, kp),
        np.full(n, kd),
        np.array([each.damping for each in dynamics]),
        np.array([each.armature for each in dynamics]),
        None if max_torque is None else np.full(n, max_torque),
        np.array([each.friction for each in dynamics]),
        (
            np.array([each.stiffness for each in dynamics]),
            np.array([each.spring_reference for each in dynamics]),
        ),
        stop_positions(model) if joint_limits else None,
    )
    if sweeps is None:
        sweeps = Sweeps.of_points(redundant=touching.has_redundant_points(mechanism))
    ends = sweeps
    sizes = {
        "q": model.nq,
        "v": model.nv,
        "target": n,
        "impulses": 3 * sum(touching.counts) + len(joints.limited),
    }

    def function(**arrays: Any) -> Mapping[str, Array]:
        return contact_step(mechanism, joints, touching, ends, h, **arrays, regrouped=regrouped)

    return StepText(function, sizes, "the step with contacts cannot be compiled", repeats=True)


def shapes_on_plane(layout: Layout, *, deepest: bool = False) -> ShapesOnPlane:
    """Return the shapes of the only robot of a scene that may touch its only plane.

    Of each shape all contact points count, or the `deepest` alone; of a sphere both are the same. Raises
    UnsupportedFeatureError, naming the part, for a scene with other contacts: of moved bodies, of links with
    one another, with another ground than one plane, with restitution, torsional or rolling friction, and of
    shapes that have no such points.
    """
    if len(layout.robots) != 1:
        raise UnsupportedFeatureError(f"a kernel steps one robot; {layout.name} has {len(layout.robots)}")
    frames = layout.robots[0].model.mechanism
    found: list[FramedShape] = []
    plane: Floats | None = None
    for i, j in np.argwhere(np.triu(layout.collides)):
        own, other = layout.colliders[i], layout.colliders[j]
        if own.owner.robot is None:
            own, other = other, own
        if own.owner.robot is None or not layout.is_fixed(other.owner):
            raise UnsupportedFeatureError(
                f"{own.name} and {other.name} may touch; a kernel has contacts of the robot with the ground "
                "only"
            )
        if layout.is_fixed(own.owner):
            continue
        for ground in other.shapes:
            kind = type(ground.shape).__name__
            if not isinstance(ground.shape, Plane):
                raise UnsupportedFeatureError(f"{other.name} is a {kind}; the ground of a kernel is a plane")
            owner = other.owner
            of_body = owner.robot is None and owner.body != WORLD
            T = layout.bodies[owner.body].T @ ground.T if of_body else ground.T
            if plane is not None and not np.array_equal(plane, T):
                raise UnsupportedFeatureError(f"{other.name} is a second plane; a kernel has one")
            plane = T
        material = contact_material(own.material, other.material)
        for name in ("restitution", "torsional_friction", "rolling_friction"):
            if getattr(material, name):
                raise UnsupportedFeatureError(
                    f"{own.name} has {name.replace('_', ' ')} on {other.name}, which a kernel does not have"
                )
        number = frames.body_frames[own.owner.body + 1]
        frame = frames.frames[number]
        for placed in own.shapes:
            try:
                plane_point_count(placed.shape)
            except ArgumentError as error:
                raise UnsupportedFeatureError(f"{own.name} cannot touch the ground: {error}") from None
            R = frame.R.T @ placed.T[:3, :3]
            p = frame.R.T @ (placed.T[:3, 3] - frame.p)
            names = own.name.rpartition("/")[2], other.name
            found.append(FramedShape(number, placed.shape, R, p, material.friction, deepest, names))
    if plane is None:
        return ShapesOnPlane(())
    axes = tuple(tuple(plane[:3, k].tolist()) for k in (2, 0, 1))
    return ShapesOnPlane(tuple(found), axes, float(plane[:3, 2] @ plane[:3, 3]))
