"""A scene as one model of MuJoCo: robots from their mechanisms, bodies, geoms, filters and constraints.

As in `dynx.engines.mujoco.tree` the compiler sees substitute inertias, and those of the scene are written
into the compiled model; the fields that the constraint solver derives from them are then computed again
(`mj_setConst`). Names in MuJoCo are made of numbers.

MuJoCo's frame of a floating base, and of a body of the scene that moves, is at the centre of mass; other
bodies have theirs where `Layout` has it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import product
from typing import Any, NamedTuple

import numpy as np

from dynx.backends.solvability import Solvability
from dynx.engines.mujoco.library import mujoco, silence_warnings, silent_data
from dynx.engines.mujoco.tree import MAX_NV, quat_wxyz, set_substitute_inertia
from dynx.engines.mujoco.world.coordinates import root_center
from dynx.engines.mujoco.world.filters import collision_masks, pairs_to_exclude
from dynx.engines.mujoco.world.inertias import write_body_inertia, write_rigid_inertia
from dynx.engines.mujoco.world.materials import ContactMaterials
from dynx.engines.mujoco.world.options import constraint_reference, limit_reference, set_options
from dynx.engines.mujoco.world.shapes import ShapeBuilder
from dynx.errors import EngineLimitError
from dynx.model.mechanism import ROOT
from dynx.spatial.scalar import Floats
from dynx.spatial.se3 import homogeneous
from dynx.steppers.conditioning import refuse_singular_start
from dynx.steppers.layout import WORLD, Layout, Owner, RobotLayout

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
            refuse_singular_start(robot, "use solver='pgs'")
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
    center = root_center(mechanism)
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
    """Write limits, damping and dry friction of all joints into the compiled model."""
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


def _first_indices(model: Any, number: int, robot: RobotLayout) -> tuple[int, int]:
    """Return the index in MuJoCo's q and v at which a robot begins; its coordinates are consecutive."""
    index = ROOT if robot.model.floating else 0
    if not (robot.model.floating or robot.model.mechanism.bodies):
        return 0, 0
    joint = model.joint(f"r{number}.{index}").id
    return int(model.jnt_qposadr[joint]), int(model.jnt_dofadr[joint])
