"""A `MultibodyPlant` with the moving bodies of a mechanism, and the map of its frames and coordinates.

Drake's `SpatialInertia` is mass, centre of mass and inertia per unit of mass; without its check it may be
unphysical. It cannot represent inertia without mass: such a body is made of two rigidly connected parts of
mass s and -s, whose sum is the inertia. Drake's inverse dynamics, energies and articulated-body algorithm add
forces and 6 x 6 matrices, so the parts cancel to rounding; its composite-body mass matrix divides by the mass
of the sum and must not be used.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from dynx.engines.drake.coordinates import DrakeCoordinates
from dynx.engines.drake.library import (
    FixedOffsetFrame,
    MultibodyPlant,
    PrismaticJoint,
    QuaternionFloatingJoint,
    RevoluteJoint,
    RigidTransform,
    RotationMatrix,
    SpatialInertia,
    UnitInertia,
)
from dynx.model import Mechanism
from dynx.model.mechanism import ROOT
from dynx.spatial.inertia import RigidInertia
from dynx.spatial.scalar import Array, Floats
from dynx.spatial.se3 import homogeneous

MAX_RATIO = 1e150
"""Bound on a length [m] and on a squared radius of gyration [m^2], above which products may overflow."""


@dataclass(frozen=True, eq=False)
class BuiltPlant:
    """A finalized plant.

    `bodies` are the engine's bodies, the root first; `frames` the engine's frames by the number of
    the dynx frame; `body_of_frame` (n_frames,) and `T_body_frame` (n_frames, 4, 4) place each frame in
    `bodies`. `counterweighted`: some body is made of parts of opposite mass.
    """

    plant: Any
    coordinates: DrakeCoordinates
    bodies: list[Any]
    frames: list[Any]
    body_of_frame: Array
    T_body_frame: Floats
    counterweighted: bool


def build_plant(mechanism: Mechanism) -> BuiltPlant:
    """Return the plant of a mechanism, with one numbered body for each of its bodies."""
    plant = MultibodyPlant(time_step=0.0)
    plant.mutable_gravity_field().set_gravity_vector(np.array(mechanism.gravity))
    bodies: list[Any] = []
    counterweighted = False
    for index, inertia in enumerate([mechanism.root, *(body.inertia for body in mechanism.bodies)]):
        first, *others = inertia_parts(inertia)
        bodies.append(plant.AddRigidBody(f"{index}", first))
        for number, part in enumerate(others):
            counterweight = plant.AddRigidBody(f"{index}:{number}", part)
            plant.WeldFrames(bodies[-1].body_frame(), counterweight.body_frame())
            counterweighted = True

    base: Any = None
    if mechanism.floating:
        base = plant.AddJoint(QuaternionFloatingJoint("base", plant.world_frame(), bodies[0].body_frame()))
    else:
        plant.WeldFrames(plant.world_frame(), bodies[0].body_frame())
    joints: list[Any] = []
    for index, body in enumerate(mechanism.bodies):
        carrier = bodies[body.parent - ROOT].body_frame()
        before = plant.AddFrame(FixedOffsetFrame(f"before:{index}", carrier, drake_pose(body.R, body.p)))
        kind = RevoluteJoint if body.revolute else PrismaticJoint
        moved = bodies[index + 1].body_frame()
        joints.append(plant.AddJoint(kind(f"{index}", before, moved, np.array(body.axis))))
    frames = []
    for index, frame in enumerate(mechanism.frames):
        carrier = bodies[frame.body - ROOT].body_frame()
        placed = FixedOffsetFrame(f"frame:{index}", carrier, drake_pose(frame.R, frame.p))
        frames.append(plant.AddFrame(placed))
    plant.Finalize()

    coordinates = DrakeCoordinates(
        [joint.position_start() for joint in joints],
        [joint.velocity_start() for joint in joints],
        plant.num_positions(),
        plant.num_velocities(),
        None if base is None else (base.position_start(), base.velocity_start()),
    )
    placements = [homogeneous(np.asarray(frame.R), np.asarray(frame.p)) for frame in mechanism.frames]
    return BuiltPlant(
        plant,
        coordinates,
        bodies,
        frames,
        np.array([frame.body - ROOT for frame in mechanism.frames], dtype=int),
        np.array(placements, dtype=float),
        counterweighted,
    )


def inertia_parts(inertia: RigidInertia) -> list[Any]:
    """Return Drake's inertia, or several that add up to it if it cannot be divided by its mass."""
    mass = float(inertia.mass)
    if not (inertia.first_moment.any() or inertia.rotational_inertia.any()):
        return [_inertia(mass, inertia)]
    largest = float(max(np.max(np.abs(inertia.first_moment)), np.max(np.abs(inertia.rotational_inertia))))
    if mass and largest < MAX_RATIO * abs(mass):
        return [_inertia(mass, inertia)]
    point = RigidInertia(inertia.mass, np.zeros(3), np.zeros((3, 3)))
    parts = [_inertia(largest, inertia), _inertia(-largest, point)]
    return [*parts, _inertia(mass, point)] if mass else parts


def _inertia(mass: float, moments: RigidInertia) -> Any:
    """Return Drake's inertia with this mass and the first and second moment of `moments`."""
    divisor = mass or 1.0
    G = moments.rotational_inertia / divisor
    unit = UnitInertia(G[0, 0], G[1, 1], G[2, 2], G[0, 1], G[0, 2], G[1, 2])
    return SpatialInertia(mass, moments.first_moment / divisor, unit, skip_validity_check=True)


def drake_pose(R: Array, p: Array) -> Any:
    """Return Drake's rigid transform for a rotation (3, 3) and a translation (3,)."""
    # Release builds of Drake, such as the wheels, do not check the matrix.
    return RigidTransform(RotationMatrix(np.asarray(R, dtype=float)), np.asarray(p, dtype=float))
