"""Models of MuJoCo: the tree of one robot for the backend, and a scene for the stepper.

**A robot** has one body for each frame and one joint for each moving joint. MuJoCo's compiler refuses
inertias that a description can hold (no mass on a moving body, a violated triangle inequality, a negative
principal moment). So it compiles the tree with substitute inertias, and the numbers of the description are
then written into the compiled model. The algorithms accept any inertia, because their results are affine in
it. Of the fields that the compiler derives from inertias, the algorithms used here read only
`body_subtreemass`, which is also overwritten. The substitutes have another pose than the body frames, so that
the compiler does not simplify bodies with a diagonal inertia.

**A scene** is the MJCF document that dynx exports (`mjcf`). Where it has substitute inertias as well, those
of the scene are written into the compiled model; the fields that the constraint solver derives from them are
then computed again (`mj_setConst`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from dynx.backends.singular_direction import refuse_singular_start
from dynx.backends.solvability import Solvability
from dynx.engines.mujoco.library import MAX_DEPTH, mujoco, silence_warnings, silent_data
from dynx.engines.mujoco.materials import ContactMaterials
from dynx.engines.mujoco.mjcf import SUBSTITUTE, MjcfDocument
from dynx.errors import EngineError, EngineLimitError
from dynx.model import Model
from dynx.model.elements import Inertial, Pose
from dynx.model.mjcf.attributes import quat_wxyz
from dynx.spatial.scalar import Array, Floats, jacobi_eigen, longdouble
from dynx.spatial.so3 import rotation_from_rpy
from dynx.steppers.layout import Layout, RobotLayout

MAX_NV = 1000
"""Largest number of tree velocities: compiling such a chain takes 3 s, growing cubically (measured, 4.0)."""

WORLD_BODY = 0
"""MuJoCo's body 0."""

ROOT_BODY = 1
"""MuJoCo's number for the root link."""

_JOINT_TYPES = {"prismatic": mujoco.mjtJoint.mjJNT_SLIDE, "ball": mujoco.mjtJoint.mjJNT_BALL}
"""Joints other than hinges."""


@dataclass(frozen=True)
class MujocoTree:
    """MuJoCo's compiled model, and MuJoCo's body for each frame of `Model.frames`.

    `masses_add` is true if MuJoCo's own centres of mass are right, because the total mass is positive and no
    mass is negative.
    """

    model: Any
    frames: tuple[int, ...]
    masses_add: bool


def refuse_large(model: Model) -> None:
    """Raise EngineLimitError for a robot with too many degrees of freedom, mimic joints included.

    They are counted in the description: merging the links of a large robot takes a second.
    """
    nv = sum(joint.n_rates for joint in model.joints) + (6 if model.floating else 0)
    if nv > MAX_NV:
        raise EngineLimitError(
            f"{model.name} has {nv} degrees of freedom; the backend 'mujoco' takes at most {MAX_NV}"
        )


def build_tree(model: Model) -> MujocoTree:
    """Return MuJoCo's tree of a robot. Raises EngineLimitError for a robot that is too large for MuJoCo."""
    refuse_large(model)
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    spec.compiler.fusestatic = False
    spec.option.gravity = np.array(model.gravity)
    # Frames become bodies named by numbers, so that no name of the description clashes with one of MuJoCo's.
    numbers = {name: str(number) for number, name in enumerate(model.frame_names)}
    root = _body(spec.worldbody, numbers[model.root], model.base_pose)
    if model.floating:
        # Aligning would move the body frame to the centre of mass.
        root.add_freejoint(align=False)
    bodies, depths = {model.root: root}, {model.root: 1}
    for joint in model.joints:
        depths[joint.child] = depths[joint.parent] + 1
        bodies[joint.child] = body = _body(bodies[joint.parent], numbers[joint.child], joint.origin)
        if joint.moves:
            kind = _JOINT_TYPES.get(joint.type, mujoco.mjtJoint.mjJNT_HINGE)
            body.add_joint(type=kind, axis=np.array(joint.axis))
    for frame in model.extra_frames:
        _body(bodies[frame.link], numbers[frame.name], frame.placement)
    if max(depths.values()) > MAX_DEPTH:
        raise EngineLimitError(
            f"{model.name} has {max(depths.values())} links in a row; "
            f"the backend 'mujoco' takes at most {MAX_DEPTH}"
        )
    compiled = spec.compile()
    tree = tuple(compiled.body(numbers[name]).id for name in model.frame_names)
    joints = [tree[model.frame_index(joint.child)] for joint in model.joints if joint.moves]
    if list(compiled.jnt_bodyid[model.floating :]) != joints or compiled.nv != model.mechanism.nv:
        raise EngineError(f"mujoco ordered the joints of {model.name} in an unexpected way")
    # There is nothing to collide or to constrain; the engine does not need to look for it.
    compiled.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT | mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    masses = _write_tree_inertias(model, compiled, tree)
    return MujocoTree(compiled, tree, masses_add=bool(masses.min() >= 0.0 and masses.sum() > mujoco.mjMINVAL))


def _body(parent: Any, name: str, pose: Pose) -> Any:
    body = parent.add_body(name=name, pos=np.array(pose.xyz), quat=quat_wxyz(_rotation(pose)))
    _set_substitute_inertia(body)
    return body


def _set_substitute_inertia(body: Any) -> None:
    body.explicitinertial = True
    body.mass = SUBSTITUTE["mass"]
    body.inertia, body.ipos, body.iquat = (
        np.array(SUBSTITUTE[name]) for name in ("diaginertia", "pos", "quat")
    )


def _write_tree_inertias(model: Model, compiled: Any, tree: tuple[int, ...]) -> Floats:
    """Replace the substitute inertias by those of the description; return the masses by body."""
    compiled.body_mass[:] = 0.0
    compiled.body_inertia[:] = 0.0
    compiled.body_ipos[:] = 0.0
    compiled.body_iquat[:] = [1.0, 0.0, 0.0, 0.0]
    for link in model.links:
        if link.inertial is not None:
            number = tree[model.frame_index(link.name)]
            moments, axes = _principal(link.inertial)
            compiled.body_mass[number] = link.inertial.mass
            compiled.body_inertia[number] = moments
            compiled.body_ipos[number] = link.inertial.origin.xyz
            compiled.body_iquat[number] = quat_wxyz(axes)
    masses = np.array(compiled.body_mass)
    total = masses.copy()
    for number in range(len(total) - 1, WORLD_BODY, -1):
        total[compiled.body_parentid[number]] += total[number]
    # MuJoCo refers all velocities to the centre of mass of the tree, or without mass to that of its root
    # body. With negative masses the former may be far away, which would cost digits.
    compiled.body_subtreemass[:] = total if masses.min() >= 0.0 else 0.0
    return masses


def _principal(inertial: Inertial) -> tuple[Floats, Array]:
    """Return the principal moments (3,), and their axes as columns of a rotation (3, 3), in link axes."""
    tensor = inertial.tensor
    moments, axes = jacobi_eigen(longdouble(tensor))
    return np.asarray(moments, dtype=np.float64), _rotation(inertial.origin) @ axes


def _rotation(pose: Pose) -> Array:
    return rotation_from_rpy(longdouble(pose.rpy))


@dataclass(frozen=True, eq=False)
class BuiltScene:
    """A compiled scene and where to find its parts in it.

    `data` is that of the model, at the start of the scene. `robots` are the first index of q and v of
    each robot; `bodies` MuJoCo's number of each body of the scene; `geom_collider` the collider of each geom,
    and `collider_geoms` the geoms of each collider.
    """

    model: Any
    data: Any
    robots: tuple[tuple[int, int], ...]
    bodies: tuple[int, ...]
    geom_collider: tuple[int, ...]
    collider_geoms: tuple[tuple[int, ...], ...]
    materials: ContactMaterials


def build_scene(layout: Layout, dt: float, settings: Mapping[str, Any]) -> BuiltScene:
    """Compile a scene; `data` is at its start.

    Raises EngineLimitError for a scene that is too large for MuJoCo, SingularMassMatrixError for a robot
    without a unique acceleration, at every configuration or at the start, UnsupportedFeatureError for a
    ground that moves.
    """
    total = sum(robot.model.mechanism.nv for robot in layout.robots)
    total += 6 * sum(not body.fixed for body in layout.bodies)
    if total > MAX_NV:
        raise EngineLimitError(
            f"the scene {layout.name} has {total} degrees of freedom; 'mujoco' takes at most {MAX_NV}"
        )
    for robot in layout.robots:
        Solvability(robot.model).refuse_singular(joint_dynamics=bool(robot.armature.any()))
        if settings["solver"] != "pgs":
            # The other solvers minimise a function that is not convex for such a mass matrix.
            refuse_singular_start(robot.model, robot.q, robot.armature, "use solver='pgs'")
    document = MjcfDocument(layout, dt, settings)
    model = mujoco.MjModel.from_xml_string(document.text())
    data = silent_data(model)
    if document.refused:
        for name, inertia, _ in document.refused:
            body = model.body(name).id
            model.body_mass[body] = inertia.mass
            model.body_ipos[body] = inertia.center
            model.body_inertia[body] = inertia.moments
            model.body_iquat[body] = quat_wxyz(inertia.axes)
        mujoco.mj_setConst(model, data)
        # Memory for a second set of data takes longer to get than this takes.
        mujoco.mj_resetData(model, data)
    if model.nkey:
        mujoco.mj_resetDataKeyframe(model, data, 0)
    silence_warnings(data)
    geoms = tuple(
        tuple(model.geom(f"{collider.name}/{k}").id for k in range(len(collider.shapes)))
        for collider in layout.colliders
    )
    owner = {geom: number for number, found in enumerate(geoms) for geom in found}
    return BuiltScene(
        model,
        data,
        tuple(_first_indices(model, robot) for robot in layout.robots),
        tuple(model.body(document.free.get(body.name, body.name)).id for body in layout.bodies),
        tuple(owner[geom] for geom in range(model.ngeom)),
        geoms,
        document.materials,
    )


def _first_indices(model: Any, robot: RobotLayout) -> tuple[int, int]:
    """Return the index in MuJoCo's q and v at which a robot begins; its coordinates are consecutive."""
    moving = (f"{robot.name}/{joint.name}" for joint in robot.model.joints if joint.moves)
    first = robot.name if robot.model.floating else next(moving, None)
    if first is None:
        return 0, 0
    joint = model.joint(first).id
    return int(model.jnt_qposadr[joint]), int(model.jnt_dofadr[joint])
