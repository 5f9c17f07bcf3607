"""Pictures of scenes: the shapes of every part at its pose, shaded by a lamp beside the camera."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from dynx.errors import ArgumentError
from dynx.model.geometry.visible_shapes import link_shapes
from dynx.rbd.link_poses import link_poses
from dynx.spatial.scalar import Floats
from dynx.spatial.se3 import inverse
from dynx.steppers.camera import Camera, Draw, Drawing, DrawnShape
from dynx.steppers.state import WorldState
from dynx.world.camera.buffer import DepthBuffer
from dynx.world.camera.picture import Picture
from dynx.world.scene import Scene

BACKGROUND = (0.85, 0.9, 0.95)
"""Colour of pixels in which nothing is seen."""

AMBIENT = 0.35
"""Share of the light that does not depend on the direction of a surface."""

LAMP = np.array([-0.36, -0.48, -0.8])
"""Unit vector (3,) towards the lamp, above and to the left of the camera, in the axes of the camera."""


def cast_rays(shapes: Sequence[DrawnShape], T_world_camera: Floats, camera: Camera) -> Drawing:
    """Draw shapes by the rays through the centres of pixels."""
    T_camera_world = np.asarray(inverse(T_world_camera))
    buffer = DepthBuffer(camera)
    for number, each in enumerate(shapes):
        buffer.draw(number, each.shape, T_camera_world @ each.T)
    colours = np.array([BACKGROUND, *(each.rgba[:3] for each in shapes)])[buffer.number + 1]
    rgb = np.rint(255.0 * colours * _light(buffer, camera)[:, None]).astype(np.uint8)
    return Drawing(rgb, buffer.depth, buffer.number)


def draw_picture(scene: Scene, state: WorldState, camera: Camera, draw: Draw = cast_rays) -> Picture:
    """Return what a camera sees of a scene in a state.

    Links are drawn as their visual shapes, and as their collision shapes where they have none or where one
    cannot be read; bodies as their shapes, meshes as their triangles. Textures are ignored, and colours are
    opaque, except for those of opacity 0, which are not drawn. Raises UnknownNameError for an unknown part
    that carries the camera.
    """
    if not isinstance(camera, Camera):
        raise ArgumentError(f"camera is of type {type(camera).__name__}; wanted a Camera")
    frames = dict(part_poses(scene, state))
    T_world_camera = camera.pose.matrix
    if camera.part is not None:
        scene.material(camera.part)
        T_world_camera = frames[camera.part] @ T_world_camera
    shapes = [each for each in drawn_shapes(scene, frames) if each.rgba[3] > 0.0]
    drawing = draw(shapes, T_world_camera, camera)
    parts = np.array([-1, *(each.part for each in shapes)], np.intp)
    rows = (camera.size[1], camera.size[0])
    return Picture(
        drawing.rgb.reshape(*rows, 3),
        drawing.depth.reshape(rows),
        parts[drawing.number + 1].reshape(rows),
        scene.parts,
    )


def part_poses(scene: Scene, state: WorldState) -> Iterator[tuple[str, Floats]]:
    """Yield every body and every link, as ``robot/link``, with its pose in the world (4, 4)."""
    for robot in scene.robots:
        for link, T in link_poses(robot.model, state.robots[robot.name].q):
            yield f"{robot.name}/{link}", T
    for name, body in state.bodies.items():
        yield name, body.T_world_body


def drawn_shapes(scene: Scene, frames: dict[str, Floats]) -> Iterator[DrawnShape]:
    """Yield the shapes of all parts; `frames` are the poses of the parts."""
    number = {name: k for k, name in enumerate(scene.parts)}
    for robot in scene.robots:
        for link in robot.model.links:
            name = f"{robot.name}/{link.name}"
            for shape, rgba, T in link_shapes(robot.model.geometry, link.name):
                yield DrawnShape(number[name], shape, rgba, frames[name] @ T)
    for body in scene.bodies:
        for placed in body.shapes:
            T = frames[body.name] @ placed.origin.matrix
            yield DrawnShape(number[body.name], placed.shape, body.material.rgba, T)


def _light(buffer: DepthBuffer, camera: Camera) -> Floats:
    """Return the brightness of each pixel: largest where the visible side of the surface faces the lamp."""
    columns, rows = camera.rays()
    x, y = np.meshgrid(columns, rows)
    normal = buffer.normal
    along = normal[:, 0] * x.ravel() + normal[:, 1] * y.ravel() + normal[:, 2]
    length = np.linalg.norm(normal, axis=1)
    facing = np.where(along > 0.0, -1.0, 1.0) * (normal @ LAMP) / np.where(length > 0.0, length, 1.0)
    return np.where(buffer.number >= 0, AMBIENT + (1.0 - AMBIENT) * np.maximum(facing, 0.0), 1.0)
