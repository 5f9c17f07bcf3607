"""Bullet's own nearest points of a scene in its stepper, and pictures by its software renderer."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from types import ModuleType
from typing import Any, ClassVar

import numpy as np

from dynx.engines.pybullet.build import binary_stl
from dynx.engines.pybullet.library import bullet
from dynx.engines.pybullet.stepper import BulletStepper, touching_point
from dynx.errors import EngineError, EngineLimitError
from dynx.files.temporary import temporary_folder
from dynx.model.geometry import Box, Capsule, Cylinder, Ellipsoid, HeightField, Mesh, Plane, Sphere
from dynx.spatial.scalar import Floats
from dynx.spatial.se3 import inverse
from dynx.spatial.so3 import quat_from_rotation
from dynx.steppers.camera import Camera, Drawing, DrawnShape
from dynx.steppers.native_queries import NativeQueries
from dynx.steppers.stepper import TouchingPoint

GROUND_SIDE = 200.0
"""Length of the edges of the square that is drawn for a plane [m]."""


class BulletQueries(NativeQueries):
    """Nearest points by Bullet, and pictures by its software renderer.

    The renderer draws balls, cylinders and capsules as polyhedra, and samples the lower left corners of
    pixels, which the projection makes up for.
    """

    name: ClassVar[str] = "pybullet"

    def __init__(self, stepper: BulletStepper) -> None:
        super().__init__(stepper)
        self.stepper: BulletStepper = stepper

    def closest(self, a: int, b: int, within: float) -> TouchingPoint | None:
        client, places = self.stepper.client, self.stepper.contact_reader.places
        found: list[TouchingPoint] = []
        for body_a, link_a in places[a]:
            for body_b, link_b in places[b]:
                points = client.call(client.engine.getClosestPoints, body_a, body_b, within, link_a, link_b)
                found += [touching_point(a, b, point, 0.0, None) for point in points or ()]
        return min(found, key=lambda point: point.distance, default=None)

    @classmethod
    def draw(cls, shapes: Sequence[DrawnShape], T_world_camera: Floats, camera: Camera) -> Drawing:
        """Return what PyBullet draws of the shapes in a client of its own.

        Raises EngineLimitError for a camera whose `far` PyBullet cannot resolve, EngineError where it fails.
        """
        if camera.far > 1e5 * camera.near:
            raise EngineLimitError(
                f"far is {camera.far}; wanted at most 1e5 times near, {camera.near}, because PyBullet stores "
                "depths in single precision"
            )
        engine = bullet()
        client = int(engine.connect(engine.DIRECT))
        if client < 0:
            raise EngineError("Bullet has no client left (1,024 at most); close worlds that are not needed")
        try:
            with temporary_folder() as folder:
                for number, each in enumerate(shapes):
                    _add(engine, client, each, Path(folder, str(number)))
                return _picture(engine, client, T_world_camera, camera)
        except (SystemError, TypeError, ValueError, engine.error) as error:
            raise EngineError(f"pybullet failed to draw: {error}") from error
        finally:
            engine.disconnect(client)


def _add(engine: ModuleType, client: int, drawn: DrawnShape, file: Path) -> None:
    """Add a body without mass, whose number is that of the shape."""
    visual = engine.createVisualShape(
        **_visual(engine, drawn, file), rgbaColor=(*drawn.rgba[:3], 1.0), physicsClientId=client
    )
    engine.createMultiBody(
        baseVisualShapeIndex=visual,
        basePosition=drawn.T[:3, 3].tolist(),
        baseOrientation=quat_from_rotation(drawn.T[:3, :3]).tolist(),
        physicsClientId=client,
    )


def _visual(engine: ModuleType, drawn: DrawnShape, file: Path) -> dict[str, Any]:
    """Return the arguments of a visual shape; shapes that Bullet lacks are written as meshes, beside
    `file`."""
    shape = drawn.shape
    if isinstance(shape, Box):
        return {"shapeType": engine.GEOM_BOX, "halfExtents": [0.5 * edge for edge in shape.size]}
    if isinstance(shape, Sphere):
        return {"shapeType": engine.GEOM_SPHERE, "radius": shape.radius}
    if isinstance(shape, Cylinder | Capsule):
        kind = engine.GEOM_CYLINDER if isinstance(shape, Cylinder) else engine.GEOM_CAPSULE
        return {"shapeType": kind, "radius": shape.radius, "length": shape.length}
    if isinstance(shape, Plane):
        x, y = 0.5 * GROUND_SIDE * np.array([[-1, 1, 1, -1], [-1, -1, 1, 1]])
        corners = np.stack([x, y, np.zeros(4)], axis=1)[[[0, 1, 2], [0, 2, 3]]]
    else:
        assert isinstance(shape, Mesh | HeightField | Ellipsoid)
        vertices, faces = shape.triangles if isinstance(shape, Mesh) else shape.triangles()
        corners = vertices[faces]
        if drawn.painted and isinstance(shape, Mesh) and shape.surface.texture is not None:
            return {"shapeType": engine.GEOM_MESH, "fileName": _write_obj(shape, file)}
    written = file.with_suffix(".stl")
    written.write_bytes(binary_stl(corners))
    return {"shapeType": engine.GEOM_MESH, "fileName": str(written)}


def _write_obj(mesh: Mesh, file: Path) -> str:
    """Write a mesh with its image as OBJ, MTL and PNG files, and return the path of the first."""
    surface = mesh.surface
    assert surface.texture is not None
    assert surface.uv is not None
    file.with_suffix(".png").write_bytes(surface.texture.png)
    file.with_suffix(".mtl").write_text(f"newmtl m\nKd 1 1 1\nmap_Kd {file.name}.png\n")
    corners = np.arange(1, surface.faces.size + 1).reshape(-1, 3)
    lines = [f"mtllib {file.name}.mtl", "usemtl m"]
    lines += [f"v {x!r} {y!r} {z!r}" for x, y, z in surface.vertices[surface.faces.reshape(-1)].tolist()]
    lines += [f"vt {u!r} {v!r}" for u, v in surface.uv.reshape(-1, 2).tolist()]
    if surface.normals is not None:
        lines += [f"vn {x!r} {y!r} {z!r}" for x, y, z in surface.normals.reshape(-1, 3).tolist()]
    corner = "{0}/{0}" if surface.normals is None else "{0}/{0}/{0}"
    lines += ["f " + " ".join(corner.format(each) for each in face) for face in corners.tolist()]
    written = file.with_suffix(".obj")
    written.write_text("\n".join(lines) + "\n")
    return str(written)


def _picture(engine: ModuleType, client: int, T_world_camera: Floats, camera: Camera) -> Drawing:
    """Draw the scene of a client by TinyRenderer; the bodies are the numbers of its shapes."""
    width, height = camera.size
    near, far, scale = camera.near, camera.far, 2.0 * camera.focal_length
    # OpenGL's camera looks along -z, with y upwards; its matrices are stored by columns.
    view = np.diag([1.0, -1.0, -1.0, 1.0]) @ inverse(T_world_camera)
    projection = np.zeros((4, 4))
    projection[0, 0], projection[1, 1] = scale / width, scale / height
    projection[:2, 2] = 1.0 / width, 1.0 / height
    projection[2, 2:] = -(far + near) / (far - near), -2.0 * far * near / (far - near)
    projection[3, 2] = -1.0
    image = engine.getCameraImage(
        width,
        height,
        view.T.ravel().tolist(),
        projection.T.ravel().tolist(),
        shadow=0,
        renderer=engine.ER_TINY_RENDERER,
        physicsClientId=client,
    )
    colours, levels, numbers = (np.asarray(image[k]) for k in (2, 3, 4))
    number = numbers.reshape(-1).astype(np.intp)
    level = levels.reshape(-1).astype(np.float64)
    depth = np.where(number >= 0, far * near / (far - (far - near) * level), np.inf)
    rgb = colours.reshape(-1, 4)[:, :3].astype(np.uint8)
    return Drawing(rgb, depth, number)
