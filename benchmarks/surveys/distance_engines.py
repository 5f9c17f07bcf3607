"""Distances of two shapes as engines compute them, with their settings as they come and with those changed
that a difference is attributed to."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from dynx.distance import ConvexShape, Hull, distance
from dynx.model.geometry import Box, Capsule, Cylinder, Sphere
from dynx.spatial.scalar import Floats
from dynx.spatial.so3 import quat_from_rotation

REACH = 100.0
"""Distance [m] up to which engines search."""

Placed = tuple[ConvexShape, Floats]
Measure = Callable[[Placed, Placed], tuple[float, float]]
"""Distance with the settings as they come, and with changed ones."""


def bullet() -> Measure:
    """Return Bullet's distance: as it comes, and with a collision margin of 0.

    Bullet rounds the vertices of a hull to 1/10216 of its extents (`btConvexHullComputer`), and no setting
    changes that. The second distance is therefore corrected by what the rounding changes in an exact one.
    """
    import pybullet

    number = pybullet.connect(pybullet.DIRECT)

    def shape_of(shape: ConvexShape) -> int:
        create: Any = pybullet.createCollisionShape
        if isinstance(shape, Box):
            given: dict[str, Any] = {
                "shapeType": pybullet.GEOM_BOX,
                "halfExtents": [s / 2 for s in shape.size],
            }
        elif isinstance(shape, Sphere):
            given = {"shapeType": pybullet.GEOM_SPHERE, "radius": shape.radius}
        elif isinstance(shape, Cylinder | Capsule):
            kind = pybullet.GEOM_CYLINDER if isinstance(shape, Cylinder) else pybullet.GEOM_CAPSULE
            given = {"shapeType": kind, "radius": shape.radius, "height": shape.length}
        else:
            assert isinstance(shape, Hull)
            given = {"shapeType": pybullet.GEOM_MESH, "vertices": shape.points.tolist()}
        return int(create(physicsClientId=number, **given))

    def run(a: Placed, b: Placed, changed: bool) -> float:
        bodies = []
        for shape, T in (a, b):
            body = pybullet.createMultiBody(
                0.0,
                shape_of(shape),
                basePosition=T[:3, 3].tolist(),
                baseOrientation=quat_from_rotation(T[:3, :3]).tolist(),
                physicsClientId=number,
            )
            if changed:
                pybullet.changeDynamics(body, -1, collisionMargin=0.0, physicsClientId=number)
            bodies.append(body)
        points = pybullet.getClosestPoints(*bodies, REACH, physicsClientId=number)
        for body in bodies:
            pybullet.removeBody(body, physicsClientId=number)
        return min((point[8] for point in points), default=float("nan"))

    def measure(a: Placed, b: Placed) -> tuple[float, float]:
        rounding = 0.0
        if Hull in (type(a[0]), type(b[0])):
            rounding = distance(*a, *b).distance - distance(*_rounded(a), *_rounded(b)).distance
        return run(a, b, False), run(a, b, True) + rounding

    return measure


def _rounded(placed: Placed) -> Placed:
    """Return a hull with the vertices that Bullet gives it."""
    shape, T = placed
    if not isinstance(shape, Hull):
        return placed
    low, high = shape.points.min(axis=0), shape.points.max(axis=0)
    # The same operations as Bullet's: the extreme points are within rounding of a step.
    step, middle = (high - low) * (1.0 / 10216), (low + high) * 0.5
    return Hull(np.trunc((shape.points - middle) * (1.0 / step)) * step + middle), T


def mujoco() -> Measure:
    """Return MuJoCo's distance: as it comes, and with strict tolerances and, beside a capsule, boxes as
    meshes."""
    import mujoco

    kinds = mujoco.mjtGeom

    def add(spec: Any, shape: ConvexShape, T: Floats, name: str) -> None:
        x, y, z, w = quat_from_rotation(T[:3, :3]).tolist()
        given: dict[str, Any] = {"pos": T[:3, 3], "quat": [w, x, y, z]}
        if isinstance(shape, Box):
            given |= {"type": kinds.mjGEOM_BOX, "size": 0.5 * np.array(shape.size)}
        elif isinstance(shape, Sphere):
            given |= {"type": kinds.mjGEOM_SPHERE, "size": [shape.radius, 0.0, 0.0]}
        elif isinstance(shape, Cylinder | Capsule):
            kind = kinds.mjGEOM_CYLINDER if isinstance(shape, Cylinder) else kinds.mjGEOM_CAPSULE
            given |= {"type": kind, "size": [shape.radius, 0.5 * shape.length, 0.0]}
        else:
            assert isinstance(shape, Hull)
            mesh = spec.add_mesh(name=name, uservert=shape.points.ravel())
            mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL
            given |= {"type": kinds.mjGEOM_MESH, "meshname": name}
        spec.worldbody.add_geom(**given)

    def run(a: Placed, b: Placed, changed: bool) -> float:
        spec = mujoco.MjSpec()
        if changed:
            spec.option.ccd_tolerance, spec.option.ccd_iterations = 1e-12, 1000
        for name, (shape, T) in (("a", a), ("b", b)):
            add(spec, shape, T, name)
        model = spec.compile()
        data = mujoco.MjData(model)
        mujoco.mj_kinematics(model, data)
        return float(mujoco.mj_geomDistance(model, data, 0, 1, REACH, np.zeros(6)))

    def measure(a: Placed, b: Placed) -> tuple[float, float]:
        strict = a, b
        if {type(a[0]), type(b[0])} == {Box, Capsule}:
            strict = _box_as_hull(a), _box_as_hull(b)
        return run(a, b, False), run(*strict, True)

    return measure


def _box_as_hull(placed: Placed) -> Placed:
    shape, T = placed
    if not isinstance(shape, Box):
        return placed
    corners = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
    return Hull(corners * shape.size), T


def coal() -> Measure:
    """Return coal's distance: as it comes, and with a strict tolerance and, beside a cylinder, balls as
    ellipsoids.

    The tolerance of depths, 1e-6, is left as it is: at 1e-8 errors fall to 1e-8, but coal sometimes fails.
    """
    import coal

    def shape_of(shape: ConvexShape, ellipsoid: bool) -> Any:
        if isinstance(shape, Box):
            return coal.Box(*shape.size)
        if isinstance(shape, Sphere):
            return coal.Ellipsoid(*[shape.radius] * 3) if ellipsoid else coal.Sphere(shape.radius)
        if isinstance(shape, Cylinder):
            return coal.Cylinder(shape.radius, shape.length)
        if isinstance(shape, Capsule):
            return coal.Capsule(shape.radius, shape.length)
        assert isinstance(shape, Hull)
        points = coal.StdVec_Vec3s()
        for point in shape.points:
            points.append(point)
        return coal.Convex.convexHull(points, True, "")

    def run(a: Placed, b: Placed, changed: bool) -> float:
        request = coal.DistanceRequest()
        request.enable_signed_distance = True
        if changed:
            request.gjk_tolerance, request.gjk_max_iterations = 1e-10, 1000
        ellipsoid = changed and {type(a[0]), type(b[0])} == {Sphere, Cylinder}
        given: list[Any] = []
        for shape, T in (a, b):
            given += [shape_of(shape, ellipsoid), coal.Transform3s(T[:3, :3], T[:3, 3])]
        return float(coal.distance(*given, request, coal.DistanceResult()))

    return lambda a, b: (run(a, b, False), run(a, b, True))


def drake() -> Measure:
    """Return Drake's distance, twice, because nothing that it depends on can be changed."""
    from pydrake import geometry
    from pydrake.math import RigidTransform
    from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, CoulombFriction
    from pydrake.multibody.tree import SpatialInertia
    from pydrake.systems.framework import DiagramBuilder

    def shape_of(shape: ConvexShape) -> Any:
        if isinstance(shape, Box):
            return geometry.Box(*shape.size)
        if isinstance(shape, Sphere):
            return geometry.Sphere(shape.radius)
        if isinstance(shape, Cylinder):
            return geometry.Cylinder(shape.radius, shape.length)
        if isinstance(shape, Capsule):
            return geometry.Capsule(shape.radius, shape.length)
        assert isinstance(shape, Hull)
        columns: Any = np.ascontiguousarray(shape.points.T)
        return geometry.Convex(columns, "hull")

    def run(a: Placed, b: Placed) -> float:
        builder = DiagramBuilder()
        plant, graph = AddMultibodyPlantSceneGraph(builder, 0.001)
        names, bodies = [], []
        for name, (shape, _) in (("a", a), ("b", b)):
            bodies.append(plant.AddRigidBody(name, SpatialInertia.SolidSphereWithMass(1.0, 1.0)))
            names.append(
                plant.RegisterCollisionGeometry(
                    bodies[-1], RigidTransform(), shape_of(shape), name, CoulombFriction(0.0, 0.0)
                )
            )
        plant.Finalize()
        diagram = builder.Build()
        root = diagram.CreateDefaultContext()
        for body, (_, T) in zip(bodies, (a, b), strict=True):
            pose: Any = T
            plant.SetFreeBodyPose(plant.GetMyMutableContextFromRoot(root), body, RigidTransform(pose))
        query = graph.get_query_output_port().Eval(graph.GetMyContextFromRoot(root))
        return float(query.ComputeSignedDistancePairClosestPoints(*names).distance)

    def measure(a: Placed, b: Placed) -> tuple[float, float]:
        found = run(a, b)
        return found, found

    return measure


ENGINES: Mapping[str, Callable[[], Measure]] = {
    "bullet": bullet,
    "mujoco": mujoco,
    "coal": coal,
    "drake": drake,
}

CHANGES: Mapping[str, str] = {
    "bullet": "margin 0",
    "mujoco": "ccd_tolerance 1e-12",
    "coal": "gjk_tolerance 1e-10",
}
"""Settings that are changed for the second distance of an engine."""
