"""Models of MuJoCo: the tree of one robot for the backend, and a scene for the stepper.

**A robot** has one body for each frame and one joint for each moving joint. MuJoCo's compiler refuses
inertias that a description can hold (no mass on a moving body, a violated triangle inequality, a negative
principal moment). So it compiles the tree with substitute inertias, and the numbers of the description are
then written into the compiled model. The algorithms accept any inertia, because their results are affine in
it. Of the fields that the compiler derives from inertias, the algorithms used here read only
`body_subtreemass`, which is also overwritten. The substitutes have another pose than the body frames, so that
the compiler does not simplify bodies with a diagonal inertia.

**A scene** has robots from their mechanisms, bodies, geoms (meshes as the convex hulls that dynx has
computed), filters and constraints. The compiler sees substitute inertias as well, and those of the scene are
written into the compiled model; the fields that the constraint solver derives from them are then computed
again (`mj_setConst`). Names in MuJoCo are made of numbers.

MuJoCo's frame of a floating base, and of a body of the scene that moves, is at the centre of mass; other
bodies have theirs where `Layout` has it.

**Filters**: MuJoCo tests a pair of geoms if the type of one and the affinity of the other share a bit, unless
their bodies are an excluded pair. A set of colliders that never touch each other, such as the links of a
robot, shares a bit of its own that is missing in its affinity; the other pairs that may not touch are
excluded one by one.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import groupby, product
from typing import Any, NamedTuple

import numpy as np

from dynx.backends.solvability import Solvability, refuse_singular_start
from dynx.engines.mujoco.coordinates import quat_wxyz
from dynx.engines.mujoco.library import MAX_DEPTH, mujoco, silence_warnings, silent_data
from dynx.engines.mujoco.materials import ContactMaterials, constraint_reference, limit_reference, set_options
from dynx.errors import EngineError, EngineLimitError, shown
from dynx.model import Model
from dynx.model.elements import Inertial, Pose
from dynx.model.geometry import Box, Capsule, Cylinder, HeightField, Mesh, Plane, Shape, Sphere
from dynx.model.geometry.mjcf import MIN_HEIGHT_RANGE
from dynx.model.mechanism import ROOT
from dynx.spatial.inertia import RigidInertia
from dynx.spatial.scalar import FLOAT64_EPS, Array, Floats, jacobi_eigen, longdouble
from dynx.spatial.se3 import homogeneous
from dynx.spatial.so3 import rotation_from_rpy, skew
from dynx.steppers.layout import WORLD, BodyLayout, Layout, Owner, RobotLayout

MAX_NV = 1000
"""Largest number of tree velocities: compiling such a chain takes 3 s, growing cubically (measured, 4.0)."""

WORLD_BODY = 0
"""MuJoCo's body 0."""

ROOT_BODY = 1
"""MuJoCo's number for the root link."""


@dataclass(frozen=True)
class MujocoTree:
    """MuJoCo's compiled model, and MuJoCo's body for each frame of `Model.frames`.

    `masses_add` is true if MuJoCo's own centres of mass are right, because the total mass is positive and no
    mass is negative.
    """

    model: Any
    frames: tuple[int, ...]
    masses_add: bool


def build_tree(model: Model) -> MujocoTree:
    """Return MuJoCo's tree of a robot. Raises EngineLimitError for a robot that is too large for MuJoCo."""
    mechanism = model.mechanism
    if mechanism.nv > MAX_NV:
        raise EngineLimitError(
            f"{model.name} has {mechanism.nv} degrees of freedom; the backend 'mujoco' takes at most {MAX_NV}"
        )
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
            slides = joint.type == "prismatic"
            kind = mujoco.mjtJoint.mjJNT_SLIDE if slides else mujoco.mjtJoint.mjJNT_HINGE
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
    if list(compiled.jnt_bodyid[model.floating :]) != joints or compiled.nv != mechanism.nv:
        raise EngineError(f"mujoco ordered the joints of {model.name} in an unexpected way")
    # There is nothing to collide or to constrain; the engine does not need to look for it.
    compiled.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT | mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    masses = _write_tree_inertias(model, compiled, tree)
    return MujocoTree(compiled, tree, masses_add=bool(masses.min() >= 0.0 and masses.sum() > mujoco.mjMINVAL))


def _body(parent: Any, name: str, pose: Pose) -> Any:
    body = parent.add_body(name=name, pos=np.array(pose.xyz), quat=quat_wxyz(_rotation(pose)))
    set_substitute_inertia(body)
    return body


def set_substitute_inertia(body: Any) -> None:
    """Give MuJoCo's body an inertia that its compiler accepts and does not simplify."""
    body.explicitinertial = True
    body.mass = 1.0
    body.inertia = np.array([1.0, 1.0, 1.0])
    body.ipos = np.array([0.25, 0.5, 0.75])
    body.iquat = np.array([0.5, 0.5, 0.5, 0.5])


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


BITS = 31
"""Bits of a mask; a signed integer of 32 has no more."""

ALL = 2**BITS - 1

Mask = tuple[int, int]
"""MuJoCo's contype and conaffinity."""


def collision_masks(layout: Layout) -> list[Mask]:
    """Return the masks of every collider. Bit 0 is that of colliders which may touch others of their set."""
    masks = [(1, ALL)] * len(layout.colliders)
    bit = 1
    for robot, numbers in _by_robot(layout):
        apart = robot is not None and not layout.collides[np.ix_(numbers, numbers)].any()
        if apart and len(numbers) > 1 and bit < BITS:
            for number in numbers:
                masks[number] = (1 << bit, ALL ^ (1 << bit))
            bit += 1
    return masks


def pairs_to_exclude(layout: Layout, masks: list[Mask]) -> list[tuple[int, int]]:
    """Return the pairs of colliders that must not touch and that neither masks nor MuJoCo's own rules filter:
    it tests no bodies that are rigidly connected, or both fixed."""
    pairs = []
    fixed = [layout.is_fixed(collider.owner) for collider in layout.colliders]
    for a, b in np.argwhere(np.triu(~layout.collides, 1)).tolist():
        tested = masks[a][0] & masks[b][1] or masks[b][0] & masks[a][1]
        connected = layout.colliders[a].owner == layout.colliders[b].owner
        if tested and not connected and not (fixed[a] and fixed[b]):
            pairs.append((a, b))
    return pairs


def _by_robot(layout: Layout) -> list[tuple[int | None, list[int]]]:
    numbers = range(len(layout.colliders))
    groups = groupby(numbers, key=lambda number: layout.colliders[number].owner.robot)
    return [(robot, list(group)) for robot, group in groups]


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


FIELD_GROUP = 5
"""MuJoCo's geom group of height fields, which `mj_ray` can leave out; others are in group 0."""


class ShapeBuilder:
    """Adds shapes to a specification; equal meshes and height fields become one asset."""

    def __init__(self, spec: Any) -> None:
        self._spec = spec
        self._assets: dict[Any, str] = {}

    def add(self, body: Any, shape: Shape, T: Floats, name: str, options: Mapping[str, Any]) -> None:
        """Add a shape at the pose T (4, 4) to MuJoCo's body; `options` are those of every geom of the
        collider."""
        position = np.array(T[:3, 3])
        kinds = mujoco.mjtGeom
        given = dict(options, name=name, quat=quat_wxyz(T[:3, :3]))
        if isinstance(shape, Box):
            given |= {"type": kinds.mjGEOM_BOX, "size": 0.5 * np.array(shape.size)}
        elif isinstance(shape, Sphere):
            given |= {"type": kinds.mjGEOM_SPHERE, "size": [shape.radius, 0.0, 0.0]}
        elif isinstance(shape, Cylinder):
            given |= {"type": kinds.mjGEOM_CYLINDER, "size": [shape.radius, 0.5 * shape.length, 0.0]}
        elif isinstance(shape, Capsule):
            given |= {"type": kinds.mjGEOM_CAPSULE, "size": [shape.radius, 0.5 * shape.length, 0.0]}
        elif isinstance(shape, Plane):
            given |= {"type": kinds.mjGEOM_PLANE, "size": [0.0, 0.0, 1.0]}
        elif isinstance(shape, HeightField):
            lowest = min(min(row) for row in shape.heights)
            position = position + T[:3, 2] * lowest
            given |= {"type": kinds.mjGEOM_HFIELD, "hfieldname": self._field(shape), "group": FIELD_GROUP}
        else:
            given |= {"type": kinds.mjGEOM_MESH, "meshname": self._hull(shape)}
        body.add_geom(pos=position, **given)

    def _field(self, shape: HeightField) -> str:
        if shape not in self._assets:
            heights = np.array(shape.heights)
            span = max(float(np.ptp(heights)), MIN_HEIGHT_RANGE)
            rows, columns = heights.shape
            name = self._assets[shape] = str(len(self._assets))
            self._spec.add_hfield(
                name=name,
                nrow=rows,
                ncol=columns,
                size=[0.5 * shape.size[0], 0.5 * shape.size[1], span, shape.DEPTH],
                userdata=(heights - heights.min()).ravel(),
            )
        return self._assets[shape]

    def _hull(self, shape: Mesh) -> str:
        if shape not in self._assets:
            name = self._assets[shape] = str(len(self._assets))
            mesh = self._spec.add_mesh(name=name, uservert=shape.hull[0].ravel())
            # The moments of a shell need no volume, so that a tiny mesh is accepted too.
            mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL
        return self._assets[shape]


WELD_TORQUE_WEIGHT = 10
"""Index, in the data of a weld, of the weight of its torque."""


@dataclass(frozen=True, eq=False)
class BuiltScene:
    """A compiled scene and where to find its parts in it.

    `data` is that of the model, at its reference configuration. `robots` are the first index of q and v of
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


class Carrier(NamedTuple):
    """MuJoCo's body of an owner, and the origin (3,) of MuJoCo's frame in that of the owner."""

    body: Any
    origin: Floats

    def placed(self, T: Floats) -> Floats:
        """Return a pose (4, 4) in the owner's frame as one in MuJoCo's."""
        return homogeneous(T[:3, :3], T[:3, 3] - self.origin)


Carriers = dict[Owner, Carrier]


def build_scene(layout: Layout, dt: float, settings: Mapping[str, Any]) -> BuiltScene:
    """Compile a scene.

    Raises EngineLimitError for a scene that is too large for MuJoCo, SingularMassMatrixError for a robot
    without a unique acceleration, at every configuration or at the start.
    """
    total = sum(robot.model.mechanism.nv for robot in layout.robots)
    total += 6 * sum(not body.fixed for body in layout.bodies)
    if total > MAX_NV:
        raise EngineLimitError(
            f"the scene {layout.name} has {total} degrees of freedom; 'mujoco' takes at most {MAX_NV}"
        )
    spec = mujoco.MjSpec()
    spec.compiler.degree = False
    spec.compiler.fusestatic = False
    set_options(spec.option, settings, layout.gravity, dt)
    carriers = {Owner(None, WORLD): Carrier(spec.worldbody, np.zeros(3))}
    reference = constraint_reference(settings, dt)
    impedance = settings["constraint_impedance"]
    for number, robot in enumerate(layout.robots):
        Solvability(robot.model).refuse_singular(joint_dynamics=False)
        if settings["solver"] != "pgs":
            # The other solvers minimise a function that is not convex for such a mass matrix.
            refuse_singular_start(robot.model, robot.q, "use solver='pgs'")
        _add_robot(spec, number, robot, carriers)
        _couple_mimics(spec, number, robot, reference, impedance)
    for number, body in enumerate(layout.bodies):
        R, p = body.T[:3, :3], np.array(body.T[:3, 3])
        added = spec.worldbody.add_body(name=f"b{number}", pos=p, quat=quat_wxyz(R))
        set_substitute_inertia(added)
        if not body.fixed:
            added.add_freejoint(name=f"b{number}", align=False)
        carriers[Owner(None, number)] = Carrier(added, np.zeros(3) if body.fixed else body.center)
    materials = ContactMaterials(layout, settings, dt)
    _add_colliders(spec, layout, carriers, materials)
    _add_constraints(spec, layout, carriers, reference, impedance)

    model = spec.compile()
    _write_inertias(model, layout)
    _write_joints(model, layout, settings, dt)
    data = silent_data(model)
    mujoco.mj_setConst(model, data)
    # Memory for a second set of data takes longer to get than this takes.
    mujoco.mj_resetData(model, data)
    silence_warnings(data)
    geoms = tuple(
        tuple(model.geom(f"{number}.{k}").id for k in range(len(collider.shapes)))
        for number, collider in enumerate(layout.colliders)
    )
    owner = {geom: number for number, found in enumerate(geoms) for geom in found}
    return BuiltScene(
        model,
        data,
        tuple(_first_indices(model, number, robot) for number, robot in enumerate(layout.robots)),
        tuple(model.body(f"b{number}").id for number in range(len(layout.bodies))),
        tuple(owner[geom] for geom in range(model.ngeom)),
        geoms,
        materials,
    )


def _add_robot(spec: Any, number: int, robot: RobotLayout, carriers: Carriers) -> None:
    """Add the bodies of a robot, named by its number and theirs; that of a fixed base is at the world's
    origin."""
    mechanism = robot.model.extended_mechanism
    root = spec.worldbody.add_body(name=f"r{number}.{ROOT}")
    set_substitute_inertia(root)
    if mechanism.floating:
        root.add_freejoint(name=f"r{number}.{ROOT}", align=False)
    center = mechanism.root_center
    carriers[Owner(number, ROOT)] = Carrier(root, np.asarray(center, dtype=float))
    for index, moving in enumerate(mechanism.bodies):
        name = f"r{number}.{index}"
        p = moving.p - center if moving.parent == ROOT else moving.p
        parent = carriers[Owner(number, moving.parent)].body
        body = parent.add_body(name=name, pos=np.asarray(p, dtype=float), quat=quat_wxyz(moving.R))
        set_substitute_inertia(body)
        kind = mujoco.mjtJoint.mjJNT_HINGE if moving.revolute else mujoco.mjtJoint.mjJNT_SLIDE
        # Limits and losses are written into the compiled model, because the compiler refuses equal limits.
        body.add_joint(
            name=name, type=kind, axis=np.asarray(moving.axis, dtype=float), limited=True, range=[-1.0, 1.0]
        )
        carriers[Owner(number, index)] = Carrier(body, np.zeros(3))


def _couple_mimics(
    spec: Any, number: int, robot: RobotLayout, reference: tuple[float, float], impedance: tuple[float, ...]
) -> None:
    """Add an equality constraint for each mimic joint."""
    coupling = robot.model.mechanism.coupling
    if coupling is None:
        return
    moving = [joint for joint in robot.model.joints if joint.moves]
    owners = [k for k, joint in enumerate(moving) if joint.mimic is None]
    for k, joint in enumerate(moving):
        if joint.mimic is None:
            continue
        data = np.zeros(mujoco.mjNEQDATA)
        data[:2] = coupling.offset[k], coupling.scale[k]
        spec.add_equality(
            type=mujoco.mjtEq.mjEQ_JOINT,
            name1=f"r{number}.{k}",
            name2=f"r{number}.{owners[coupling.index[k]]}",
            objtype=mujoco.mjtObj.mjOBJ_JOINT,
            data=data,
            solref=reference,
            solimp=impedance,
        )


def _add_colliders(spec: Any, layout: Layout, carriers: Carriers, materials: ContactMaterials) -> None:
    """Add the shapes of all colliders, each collider on a body of its own where its owner has several."""
    shapes = ShapeBuilder(spec)
    # Explicit pairs are tested whatever the masks.
    masks = [(0, 0)] * len(layout.colliders) if materials.complete else collision_masks(layout)
    owners = [collider.owner for collider in layout.colliders]
    names = []
    for number, collider in enumerate(layout.colliders):
        carrier = carriers[collider.owner]
        body = carrier.body
        if owners.count(collider.owner) > 1 or body is spec.worldbody:
            body = body.add_body(name=f"c{number}")
            set_substitute_inertia(body)
        names.append(body.name)
        options = materials.geom(number) | {"contype": masks[number][0], "conaffinity": masks[number][1]}
        for k, placed in enumerate(collider.shapes):
            shapes.add(body, placed.shape, carrier.placed(placed.T), f"{number}.{k}", options)
    for a, b in () if materials.complete else pairs_to_exclude(layout, masks):
        spec.add_exclude(bodyname1=names[a], bodyname2=names[b])
    for a, b, options in materials.pairs:
        for i, j in product(range(len(layout.colliders[a].shapes)), range(len(layout.colliders[b].shapes))):
            spec.add_pair(geomname1=f"{a}.{i}", geomname2=f"{b}.{j}", **options)


def _add_constraints(
    spec: Any,
    layout: Layout,
    carriers: Carriers,
    reference: tuple[float, float],
    impedance: tuple[float, ...],
) -> None:
    """Add welds and point-to-point constraints, between sites at their anchors."""
    kinds = {"weld": mujoco.mjtEq.mjEQ_WELD, "point": mujoco.mjtEq.mjEQ_CONNECT}
    for number, constraint in enumerate(layout.constraints):
        for end, anchor in (("a", constraint.a), ("b", constraint.b)):
            carrier = carriers[anchor.owner]
            T = carrier.placed(anchor.T)
            carrier.body.add_site(name=f"{number}.{end}", pos=np.array(T[:3, 3]), quat=quat_wxyz(T[:3, :3]))
        # Of the data of a weld between sites only the weight of its torque counts.
        data = np.zeros(mujoco.mjNEQDATA)
        data[WELD_TORQUE_WEIGHT] = 1.0
        spec.add_equality(
            type=kinds[constraint.kind],
            name1=f"{number}.a",
            name2=f"{number}.b",
            objtype=mujoco.mjtObj.mjOBJ_SITE,
            data=data,
            solref=reference,
            solimp=impedance,
        )


def _write_inertias(model: Any, layout: Layout) -> None:
    model.body_mass[:] = 0.0
    model.body_inertia[:] = 0.0
    model.body_ipos[:] = 0.0
    model.body_iquat[:] = [1.0, 0.0, 0.0, 0.0]
    for number, robot in enumerate(layout.robots):
        mechanism = robot.model.extended_mechanism
        inertias = [mechanism.root, *(body.inertia for body in mechanism.bodies)]
        centered = mechanism.floating and mechanism.root.mass != 0.0
        for index, inertia in enumerate(inertias, ROOT):
            if index == ROOT and not mechanism.floating:
                continue
            body_id = model.body(f"r{number}.{index}").id
            write_rigid_inertia(
                model, body_id, inertia, robot.model.name, at_center=index == ROOT and centered
            )
    for number, body in enumerate(layout.bodies):
        if not body.fixed:
            write_body_inertia(model, model.body(f"b{number}").id, body)


def _write_joints(model: Any, layout: Layout, settings: Mapping[str, Any], dt: float) -> None:
    """Write limits, damping, dry friction and armature of all joints into the compiled model."""
    model.jnt_limited[:] = False
    model.jnt_solref[:] = limit_reference(settings, dt)
    model.jnt_solimp[:] = settings["impedance"]
    model.dof_solref[:] = constraint_reference(settings, dt)
    model.dof_solimp[:, :2] = settings["joint_friction_impedance"]
    for number, robot in enumerate(layout.robots):
        # The damping of coupled joints is part of the torque that couples them (`mimics`).
        damped = robot.model.mechanism.coupling is None
        for index in range(len(robot.model.mechanism.bodies)):
            joint = model.joint(f"r{number}.{index}").id
            dof = model.jnt_dofadr[joint]
            lower, upper = robot.lower[index], robot.upper[index]
            model.jnt_limited[joint] = np.isfinite(lower) or np.isfinite(upper)
            model.jnt_range[joint] = lower, upper
            model.dof_damping[dof] = robot.damping[index] if damped else 0.0
            model.dof_frictionloss[dof] = robot.friction[index]
            model.dof_armature[dof] = robot.armature[index]


def _first_indices(model: Any, number: int, robot: RobotLayout) -> tuple[int, int]:
    """Return the index in MuJoCo's q and v at which a robot begins; its coordinates are consecutive."""
    index = ROOT if robot.model.floating else 0
    if not (robot.model.floating or robot.model.mechanism.bodies):
        return 0, 0
    joint = model.joint(f"r{number}.{index}").id
    return int(model.jnt_qposadr[joint]), int(model.jnt_dofadr[joint])
