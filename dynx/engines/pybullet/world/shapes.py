"""Collision shapes as Bullet loads them: URDF elements, files of hulls, and grounds."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from dynx.engines.decimal_point import decimal_point
from dynx.engines.pybullet.canonical_urdf import locale_free, pose_element
from dynx.engines.pybullet.world.client import WorldClient
from dynx.errors import EngineLimitError
from dynx.model.geometry import Box, Capsule, Cylinder, HeightField, Mesh, Plane, Sphere
from dynx.spatial.scalar import Floats
from dynx.spatial.so3 import quat_from_rotation
from dynx.steppers.layout import PlacedShape

MAX_VERTICES = 100_000
"""Largest number of points of a height field; Bullet takes 131,072 in one call."""


EXTENT = 1000.0
"""Half the edge [m] of the box that stands for a plane from which bodies rebound."""


class ShapeFiles:
    """URDF elements of shapes, with the hulls of meshes as files in one folder."""

    def __init__(self, folder: Path, flags: int = 0) -> None:
        """`flags` are those of Bullet's `loadURDF` for all objects with shapes."""
        self.flags = flags
        self._folder = folder
        self._files: dict[Mesh, Path] = {}

    def elements(self, shapes: tuple[PlacedShape, ...], T: Floats) -> list[str]:
        """Return the ``<collision>`` elements of shapes whose owner has the pose T (4, 4) in its link."""
        return [self._element(each, T @ each.T) for each in shapes if not is_ground(each)]

    def _element(self, placed: PlacedShape, T: Floats) -> str:
        return f"<collision>\n{pose_element(T)}\n<geometry>{self._geometry(placed)}</geometry></collision>"

    def _geometry(self, placed: PlacedShape) -> str:
        shape = placed.shape
        if isinstance(shape, Box):
            return f'<box size="{" ".join(map(locale_free, shape.size))}"/>'
        if isinstance(shape, Sphere):
            return f'<sphere radius="{locale_free(shape.radius)}"/>'
        if isinstance(shape, Cylinder | Capsule):
            kind = type(shape).__name__.lower()
            return f'<{kind} radius="{locale_free(shape.radius)}" length="{locale_free(shape.length)}"/>'
        assert isinstance(shape, Mesh)
        return f'<mesh filename="{self._hull_file(shape)}"/>'

    def _hull_file(self, mesh: Mesh) -> str:
        if mesh not in self._files:
            # Of an OBJ file Bullet makes a compound of hulls, whose margin cannot be set.
            path = self._folder / f"hull{len(self._files)}.stl"
            vertices, faces = mesh.hull
            path.write_bytes(binary_stl(vertices[faces]))
            self._files[mesh] = path
        return str(self._files[mesh])

    def block(self) -> Path:
        """Return a URDF file of a fixed box whose upper face stands for the plane z = 0."""
        path = self._folder / "block.urdf"
        size, origin = locale_free(2.0 * EXTENT), locale_free(-EXTENT)
        inertia = '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/>'
        path.write_text(
            f'<robot name="block"><link name="b"><inertial><mass value="0"/>{inertia}</inertial>'
            f'<collision><origin xyz="0 0 {origin}"/><geometry><box size="{size} {size} {size}"/></geometry>'
            "</collision></link></robot>",
            encoding="ascii",
        )
        return path


def binary_stl(triangles: Floats) -> bytes:
    """Return triangles (n, 3, 3) as a binary STL file, with the normals by which they are shaded."""
    records = np.zeros(
        len(triangles), dtype=[("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("spare", "<u2")]
    )
    records["corners"] = triangles
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    records["normal"] = normals / np.where(lengths > 0.0, lengths, 1.0)
    return b"\0" * 80 + len(triangles).to_bytes(4, "little") + records.tobytes()


def is_ground(placed: PlacedShape) -> bool:
    """Check whether a shape is a plane or a height field: only fixed bodies have one, and URDF has none."""
    return isinstance(placed.shape, Plane | HeightField)


def load_ground(
    client: WorldClient, files: ShapeFiles, placed: PlacedShape, T: Floats, rebounds: bool
) -> int:
    """Load a plane or height field whose owner has the pose T (4, 4); return Bullet's number of the body.

    A plane that `rebounds` is the upper face of a large box, because with a plane Bullet finds one point of
    contact in a step: a body that lands flat would rebound from one corner.
    """
    engine, shape, at = client.engine, placed.shape, T @ placed.T
    position, quat = at[:3, 3].tolist(), quat_from_rotation(at[:3, :3]).tolist()
    if isinstance(shape, Plane) and rebounds:
        with decimal_point():
            path = str(files.block())
            body = client.call(engine.loadURDF, path, position, quat, useFixedBase=True, flags=files.flags)
        return int(body)
    if isinstance(shape, Plane):
        number = client.call(engine.createCollisionShape, engine.GEOM_PLANE, planeNormal=[0.0, 0.0, 1.0])
    else:
        assert isinstance(shape, HeightField)
        vertices, faces = shape.triangles()
        if len(vertices) > MAX_VERTICES:
            raise EngineLimitError(
                f"a height field has {len(vertices)} points; Bullet supports at most {MAX_VERTICES}"
            )
        number = client.call(
            engine.createCollisionShape,
            engine.GEOM_MESH,
            vertices=vertices.tolist(),
            indices=np.asarray(faces).ravel().tolist(),
        )
    return int(
        client.call(
            engine.createMultiBody,
            baseMass=0.0,
            baseCollisionShapeIndex=number,
            basePosition=position,
            baseOrientation=quat,
        )
    )
