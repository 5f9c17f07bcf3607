"""Pictures by MuJoCo's renderer, without a display."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from dynx.engines.mujoco.library import mujoco, offscreen_context
from dynx.errors import EngineError, EngineLimitError
from dynx.model.geometry import Box, Capsule, Cylinder, Ellipsoid, HeightField, Mesh, Plane, Shape, Sphere
from dynx.spatial.scalar import Floats
from dynx.spatial.so3 import quat_from_rotation
from dynx.steppers.camera import Camera, Drawing, DrawnShape, DrawnTriangles

_MOST_GEOMS = 100
"""Number of geoms in a scene beside the shapes: lights and the sky."""

_ZENITH, _HORIZON = [0.50, 0.67, 0.86], [0.90, 0.93, 0.96]
"""Colours of the sky."""

_GROUND_SIDE = 100.0
"""Distance from the origin of a plane to its edges [m]."""


def draw(shapes: Sequence[DrawnShape], T_world_camera: Floats, camera: Camera) -> Drawing:
    """Return what MuJoCo draws of the shapes in a model of its own, each in one colour.

    Raises EngineLimitError for a shape that MuJoCo does not take and where no context of OpenGL without a
    display can be had, EngineError where drawing fails.
    """
    width, height = camera.size
    model = _model(shapes, camera)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    with offscreen_context(width, height):
        context = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_100)
        try:
            mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, context)
            if context.currentBuffer != mujoco.mjtFramebuffer.mjFB_OFFSCREEN:
                raise EngineError("MuJoCo draws only in windows here; leave renderer out to draw without it")
            context.readDepthMap = mujoco.mjtDepthMap.mjDEPTH_ZEROFAR
            scene = _scene(model, data, T_world_camera, camera, len(shapes))
            # The sky has a depth, too, and is left out of the second picture.
            rgb, _ = _pixels(scene, context, width, height)
            scene.flags[mujoco.mjtRndFlag.mjRND_SEGMENT] = True
            scene.flags[mujoco.mjtRndFlag.mjRND_IDCOLOR] = True
            coded, level = _pixels(scene, context, width, height)
        finally:
            context.free()
    return Drawing(rgb.reshape(-1, 3), _depth(level, camera), _numbers(coded, scene))


def _model(shapes: Sequence[DrawnShape], camera: Camera) -> Any:
    spec = mujoco.MjSpec()
    spec.stat.extent = 1.0
    spec.visual.map.znear, spec.visual.map.zfar = camera.near, camera.far
    spec.visual.global_.offwidth, spec.visual.global_.offheight = camera.size
    spec.visual.quality.offsamples = 0  # Numbers of parts at edges would be mixed.
    spec.visual.headlight.ambient, spec.visual.headlight.diffuse = [0.4] * 3, [0.2] * 3
    spec.worldbody.add_light(
        type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL, dir=[-0.2, 0.7, -1.0], diffuse=[0.5, 0.5, 0.5]
    )
    spec.add_texture(
        name="sky",
        type=mujoco.mjtTexture.mjTEXTURE_SKYBOX,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_GRADIENT,
        rgb1=_ZENITH,
        rgb2=_HORIZON,
        width=64,
        height=384,
    )
    for number, each in enumerate(shapes):
        kind, size = _geom(each.shape)
        options: dict[str, Any] = {}
        if kind == mujoco.mjtGeom.mjGEOM_MESH:
            options["meshname"] = _add_mesh(spec, number, each.shape)
        else:
            options["size"] = size
        spec.worldbody.add_geom(
            type=kind,
            pos=each.T[:3, 3],
            quat=np.roll(quat_from_rotation(each.T[:3, :3]), 1),
            rgba=[*each.rgba[:3], 1.0],
            contype=0,
            conaffinity=0,
            **options,
        )
    try:
        return spec.compile()
    except ValueError as error:
        raise EngineLimitError(
            f"MuJoCo cannot draw the scene: {str(error).splitlines()[0]}; leave renderer out to draw it"
        ) from error


def _geom(shape: Shape | DrawnTriangles) -> tuple[Any, list[float]]:
    kinds = mujoco.mjtGeom
    if isinstance(shape, Box):
        return kinds.mjGEOM_BOX, [0.5 * edge for edge in shape.size]
    if isinstance(shape, Sphere):
        return kinds.mjGEOM_SPHERE, [shape.radius, 0.0, 0.0]
    if isinstance(shape, Cylinder | Capsule):
        kind = kinds.mjGEOM_CYLINDER if isinstance(shape, Cylinder) else kinds.mjGEOM_CAPSULE
        return kind, [shape.radius, 0.5 * shape.length, 0.0]
    if isinstance(shape, Ellipsoid):
        return kinds.mjGEOM_ELLIPSOID, list(shape.radii)
    if isinstance(shape, Plane):
        return kinds.mjGEOM_PLANE, [_GROUND_SIDE, _GROUND_SIDE, 1.0]
    return kinds.mjGEOM_MESH, []


def _add_mesh(spec: Any, number: int, shape: Shape | DrawnTriangles) -> str:
    if isinstance(shape, DrawnTriangles):
        vertices, faces = shape
    else:
        assert isinstance(shape, Mesh | HeightField)
        vertices, faces = shape.triangles if isinstance(shape, Mesh) else shape.triangles()
    # A mesh that is open has no volume, and is drawn from both sides.
    # Each side has vertices of its own, or their normals would cancel out.
    both = np.concatenate([faces, faces[:, ::-1] + len(vertices)])
    mesh = spec.add_mesh(
        name=f"mesh{number}",
        uservert=np.tile(np.asarray(vertices, dtype=np.float64).reshape(-1), 2).tolist(),
        userface=both.reshape(-1).tolist(),
        inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL,
    )
    return str(mesh.name)


def _scene(model: Any, data: Any, T_world_camera: Floats, camera: Camera, count: int) -> Any:
    scene = mujoco.MjvScene(model, count + _MOST_GEOMS)
    option, view = mujoco.MjvOption(), mujoco.MjvCamera()
    option.geomgroup[:] = 1
    everything = mujoco.mjtCatBit.mjCAT_ALL
    mujoco.mjv_updateScene(model, data, option, mujoco.MjvPerturb(), view, everything, scene)
    scene.flags[mujoco.mjtRndFlag.mjRND_HAZE] = False
    top = camera.near * math.tan(0.5 * camera.field_of_view)
    for eye in scene.camera:
        eye.pos, eye.forward, eye.up = T_world_camera[:3, 3], T_world_camera[:3, 2], -T_world_camera[:3, 1]
        eye.frustum_center, eye.frustum_width = 0.0, 0.0
        eye.frustum_bottom, eye.frustum_top = -top, top
        eye.frustum_near, eye.frustum_far = camera.near, camera.far
    return scene


def _pixels(scene: Any, context: Any, width: int, height: int) -> tuple[Any, Any]:
    rectangle = mujoco.MjrRect(0, 0, width, height)
    rgb, level = np.zeros((height, width, 3), np.uint8), np.zeros((height, width), np.float32)
    mujoco.mjr_render(rectangle, scene, context)
    mujoco.mjr_readPixels(rgb, level, rectangle, context)
    return rgb[::-1], level[::-1]


def _depth(level: Any, camera: Camera) -> Floats:
    """Return depths (n,) [m] of levels that are 1 at `near` and 0 at `far`."""
    near, far, value = camera.near, camera.far, level.reshape(-1).astype(np.float64)
    depth = near * far / (near + value * (far - near))
    return np.asarray(np.where(value > 0.0, depth, np.inf))


def _numbers(coded: Any, scene: Any) -> Any:
    number = coded.reshape(-1, 3).astype(np.intp) @ np.array([1, 256, 65536])
    table = np.full(scene.maxgeom + 1, -1, dtype=np.intp)
    for each in scene.geoms[: scene.ngeom]:
        if each.objtype == mujoco.mjtObj.mjOBJ_GEOM and each.segid >= 0:
            table[each.segid + 1] = each.objid
    return table[np.minimum(number, scene.maxgeom)]
