"""Pictures of the same parts by other libraries, each with its own light, sky and ground.

PyBullet draws with its software renderer, and in its window, which needs an X display; its ground is
``plane.urdf`` of pybullet_data. MuJoCo draws with the sky, the ground and the lights of the scenes in its
documentation, by software (OSMesa). viser draws in headless Chromium, on the grid of its example for URDF.
All get the same triangles, normals, colours and images, and draw marks by functions of their own.
"""

from __future__ import annotations

import contextlib
import math
import os
import shutil
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageGrab

from dynx.model.elements import Inertial
from dynx.model.geometry import Box, Capsule, Cylinder, HeightField, Mesh, Shape, Sphere
from dynx.spatial.scalar import Floats
from dynx.spatial.so3 import quat_from_rotation
from dynx.steppers.camera import Camera, DrawnShape
from dynx.viewer.drawn_robot import rgb_of, wxyz
from dynx.viewer.triangles import with_edges
from dynx.world.boxes import shape_box
from tests.viewer.conftest import BROWSERS, PATIENCE, SOFTWARE

Rgb = NDArray[np.uint8]

NEAR, FAR = 0.02, 60.0
"""Depths between which PyBullet draws [m]."""

_WINDOW = 180
"""Size of the window of PyBullet with marks, whose angle of view is wider [% of that of the picture]."""

_WINDOW_PICTURES = 12
"""Number of pictures after which the window is drawn."""

_SHOWN_AFTER = 3.0
"""Time after which the page of viser is drawn [s]."""


class Arrow(NamedTuple):
    """A contact force."""

    point: Floats
    """Where it acts (3,) in the world [m]."""
    force: Floats
    """In world axes (3,) [N]."""


class Standing(NamedTuple):
    """What stands on its feet, for engines that compute contact forces themselves."""

    mass: float
    middle: Floats
    """Centre of mass (3,) in the world [m]."""
    feet: Floats
    """Middles (n, 3) of balls that touch the ground [m]."""
    radius: float
    """Radius of these balls [m]."""


class Subject(NamedTuple):
    """What is drawn, and from where."""

    shapes: tuple[DrawnShape, ...]
    """Shapes of parts, without a plane below them."""
    camera: Camera
    floor: float | None = 0.0
    """Height of the ground [m]; None for parts with a ground of their own."""
    arrows: tuple[Arrow, ...] = ()
    standing: Standing | None = None
    length: float = 0.0
    """Length of the arrow of a force of 1 N [m]."""
    frames: tuple[Floats, ...] = ()
    """Frames (4, 4) that are shown."""
    axis: float = 0.0
    """Length of their axes [m]."""
    inertias: tuple[tuple[Inertial, Floats], ...] = ()
    """Inertia that is shown as ellipsoids, with the pose (4, 4) of its link."""

    @property
    def marked(self) -> bool:
        """Whether marks are shown."""
        return bool(self.arrows or self.frames or self.inertias)


class Undrawable(Exception):
    """A library has no function for what is shown."""


def write_obj(mesh: Shape, path: Path) -> None:
    """Write a mesh or a height field as a Wavefront file with its normals and its places in the image."""
    lines = []
    if isinstance(mesh, Mesh):
        surface = mesh.surface
        vertices, faces = surface.vertices, surface.faces
        normals, uv = surface.normals, surface.uv
    else:
        assert isinstance(mesh, HeightField)
        vertices, faces = mesh.triangles()
        normals, uv = _smooth_normals(vertices, faces)[faces], None
    if normals is None:
        a, b, c = vertices[faces].swapaxes(0, 1)
        flat = np.cross(b - a, c - a)
        flat /= np.maximum(np.linalg.norm(flat, axis=1), 1e-30)[:, None]
        normals = np.repeat(flat[:, None], 3, axis=1)
    lines += [f"v {x:.7g} {y:.7g} {z:.7g}" for x, y, z in vertices[faces].reshape(-1, 3).tolist()]
    lines += [f"vn {x:.5g} {y:.5g} {z:.5g}" for x, y, z in normals.reshape(-1, 3).tolist()]
    if uv is not None:
        lines += [f"vt {u:.6g} {v:.6g}" for u, v in uv.reshape(-1, 2).tolist()]
    for k in range(1, 3 * len(faces) + 1, 3):
        corners = (f"{j}/{j}/{j}" if uv is not None else f"{j}//{j}" for j in (k, k + 1, k + 2))
        lines.append("f " + " ".join(corners))
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _smooth_normals(vertices: Floats, faces: NDArray[np.intp]) -> Floats:
    a, b, c = vertices[faces].swapaxes(0, 1)
    flat, total = np.cross(b - a, c - a), np.zeros_like(vertices)
    for k in range(3):
        np.add.at(total, faces[:, k], flat)
    return np.asarray(total / np.linalg.norm(total, axis=1)[:, None])


def _texture(shape: Shape) -> Any:
    return shape.surface.texture if isinstance(shape, Mesh) else None


def _meshes(shapes: Sequence[DrawnShape], folder: Path) -> Iterator[tuple[DrawnShape, Path | None]]:
    """Yield shapes, with the file of each that is a mesh; a mesh is written once."""
    files: dict[Shape, Path] = {}
    for each in shapes:
        shape: Any = each.shape
        if isinstance(shape, Mesh | HeightField):
            if shape not in files:
                files[shape] = folder / f"mesh{len(files)}.obj"
                write_obj(shape, files[shape])
            yield each, files[shape]
        else:
            yield each, None


# PyBullet.


def _bullet_client(*how: int, **options: str) -> Any:
    # Without types.
    return import_module("pybullet_utils.bullet_client").BulletClient(*how, **options)


def _bullet_scene(client: Any, subject: Subject, folder: Path) -> None:
    import pybullet
    import pybullet_data

    client.setAdditionalSearchPath(pybullet_data.getDataPath())
    if subject.floor is not None:
        client.loadURDF("plane.urdf", [0.0, 0.0, subject.floor])
    for number, (each, file) in enumerate(_meshes(subject.shapes, folder)):
        shape: Any = each.shape
        if file is not None:
            options = {"shapeType": pybullet.GEOM_MESH, "fileName": str(file)}
        elif isinstance(shape, Box):
            options = {"shapeType": pybullet.GEOM_BOX, "halfExtents": [0.5 * edge for edge in shape.size]}
        elif isinstance(shape, Sphere):
            options = {"shapeType": pybullet.GEOM_SPHERE, "radius": shape.radius}
        else:
            assert isinstance(shape, Cylinder | Capsule)
            kind = pybullet.GEOM_CYLINDER if isinstance(shape, Cylinder) else pybullet.GEOM_CAPSULE
            options = {"shapeType": kind, "radius": shape.radius, "length": shape.length}
        visual = client.createVisualShape(rgbaColor=list(each.rgba), **options)
        body = client.createMultiBody(
            0.0, -1, visual, each.T[:3, 3].tolist(), quat_from_rotation(each.T[:3, :3]).tolist()
        )
        texture = _texture(shape)
        if texture is not None:
            image = folder / f"image{number}.png"
            Image.fromarray(texture.pixels).save(image)
            client.changeVisualShape(body, -1, textureUniqueId=client.loadTexture(str(image)))


def _bullet_matrices(client: Any, camera: Camera) -> dict[str, Any]:
    T = camera.pose.matrix
    eye = T[:3, 3]
    view = client.computeViewMatrix(eye.tolist(), (eye + T[:3, 2]).tolist(), (-T[:3, 1]).tolist())
    aspect = camera.size[0] / camera.size[1]
    projection = client.computeProjectionMatrixFOV(math.degrees(camera.field_of_view), aspect, NEAR, FAR)
    return {"viewMatrix": view, "projectionMatrix": projection}


def _bullet_picture(client: Any, camera: Camera, renderer: int) -> Rgb:
    width, height = camera.size
    found = client.getCameraImage(width, height, renderer=renderer, **_bullet_matrices(client, camera))
    return np.asarray(found[2], np.uint8).reshape(height, width, 4)[..., :3]


def draw_by_tiny_renderer(subject: Subject, dark: bool = False) -> Rgb:
    """Return the picture of PyBullet's software renderer, which draws no lines."""
    import pybullet

    if subject.marked:
        raise Undrawable("the software renderer of PyBullet draws no marks")
    with tempfile.TemporaryDirectory() as folder:
        client = _bullet_client(pybullet.DIRECT)
        try:
            _bullet_scene(client, subject, Path(folder))
            return _bullet_picture(client, subject.camera, pybullet.ER_TINY_RENDERER)
        finally:
            client.disconnect()


def draw_in_bullet_window(subject: Subject, dark: bool = False) -> Rgb:
    """Return what PyBullet's window shows, without its panels."""
    import pybullet

    if subject.inertias:
        raise Undrawable("PyBullet shows no inertia")
    display = os.environ.get("DISPLAY")
    if not display:
        raise Undrawable("the window of PyBullet needs a display: xvfb-run -s '-screen 0 2304x1728x24'")
    larger = _WINDOW if subject.marked else 100
    width, height = (larger * side // 100 for side in subject.camera.size)
    with tempfile.TemporaryDirectory() as folder:
        client = _bullet_client(pybullet.GUI, options=f"--width={width} --height={height}")
        try:
            client.configureDebugVisualizer(pybullet.COV_ENABLE_GUI, 0)
            _bullet_scene(client, subject, Path(folder))
            if not subject.marked:
                return _bullet_picture(client, subject.camera, pybullet.ER_BULLET_HARDWARE_OPENGL)
            for arrow in subject.arrows:
                tip = arrow.point + subject.length * arrow.force
                client.addUserDebugLine(arrow.point.tolist(), tip.tolist(), [1, 0, 0], lineWidth=4)
            for T in subject.frames:
                for k in range(3):
                    end = T[:3, 3] + subject.axis * T[:3, k]
                    colour = np.eye(3)[k].tolist()
                    client.addUserDebugLine(T[:3, 3].tolist(), end.tolist(), colour, lineWidth=3)
            return _bullet_screenshot(client, subject.camera, display)
        finally:
            client.disconnect()


def _bullet_screenshot(client: Any, camera: Camera, display: str) -> Rgb:
    """Return the middle of the window, whose angle of view is its own and wider: what the camera sees."""
    T, distance = camera.pose.matrix, 1.0
    ahead = T[:3, 2]
    yaw, pitch = math.degrees(math.atan2(-ahead[0], ahead[1])), math.degrees(math.asin(ahead[2]))
    client.resetDebugVisualizerCamera(distance, yaw, pitch, (T[:3, 3] + distance * ahead).tolist())
    # The window is drawn by a thread of its own, which a picture waits for.
    for _ in range(_WINDOW_PICTURES):
        client.getCameraImage(64, 48, renderer=client.ER_BULLET_HARDWARE_OPENGL)
        time.sleep(0.2)
    width, height, _, projection = client.getDebugVisualizerCamera()[:4]
    share = math.tan(0.5 * camera.field_of_view) * projection[5]
    across, upward = 0.5 * share * height * camera.size[0] / camera.size[1], 0.5 * share * height
    box = (width / 2 - across, height / 2 - upward, width / 2 + across, height / 2 + upward)
    picture = ImageGrab.grab((0, 0, width, height), xdisplay=display).convert("RGB")
    return np.asarray(picture.resize(camera.size, Image.Resampling.LANCZOS, box), np.uint8)


# MuJoCo.


def draw_by_mujoco(subject: Subject, dark: bool = False) -> Rgb:
    """Return the picture of MuJoCo, imported while the environment variable ``MUJOCO_GL`` was osmesa."""
    import mujoco

    with tempfile.TemporaryDirectory() as folder:
        spec = _mujoco_scene(mujoco, subject, Path(folder))
        model = spec.compile()
    data = mujoco.MjData(model)
    for _ in range(1500 if subject.standing else 0):
        mujoco.mj_step(model, data)
    mujoco.mj_forward(model, data)
    option = mujoco.MjvOption()
    mujoco.mjv_defaultOption(option)
    option.flags[mujoco.mjtVisFlag.mjVIS_CONTACTFORCE] = bool(subject.arrows)
    option.flags[mujoco.mjtVisFlag.mjVIS_CONTACTPOINT] = bool(subject.arrows)
    option.flags[mujoco.mjtVisFlag.mjVIS_INERTIA] = bool(subject.inertias)
    if subject.frames:
        option.frame = mujoco.mjtFrame.mjFRAME_BODY
    width, height = subject.camera.size
    with mujoco.Renderer(model, height, width) as renderer:
        renderer.update_scene(data, camera="view", scene_option=option)
        return np.array(renderer.render(), np.uint8)


def _mujoco_scene(mujoco: Any, subject: Subject, folder: Path) -> Any:
    spec = mujoco.MjSpec()
    width, height = subject.camera.size
    spec.visual.global_.offwidth, spec.visual.global_.offheight = width, height
    spec.visual.global_.ellipsoidinertia = True
    # The infinite ground has no part in the extent and the size of bodies, to which marks are scaled.
    low, high, mean = _extent(subject.shapes)
    spec.stat.center, spec.stat.extent = 0.5 * (low + high), float(np.linalg.norm(high - low))
    spec.stat.meansize, spec.stat.meanmass = mean, 1.0
    if subject.length:
        spec.visual.map.force = 3.0 * subject.length
    # The sky, the ground and the lights of the scenes in MuJoCo's documentation and its menagerie.
    spec.visual.headlight.diffuse, spec.visual.headlight.ambient = [0.6] * 3, [0.3] * 3
    spec.visual.headlight.specular = [0.0] * 3
    spec.visual.rgba.haze = [0.15, 0.25, 0.35, 1.0]
    types, patterns = mujoco.mjtTexture, mujoco.mjtBuiltin
    spec.add_texture(
        name="skybox", type=types.mjTEXTURE_SKYBOX, builtin=patterns.mjBUILTIN_GRADIENT,
        rgb1=[0.3, 0.5, 0.7], rgb2=[0.0] * 3, width=512, height=3072,
    )  # fmt: skip
    spec.add_texture(
        name="groundplane", type=types.mjTEXTURE_2D, builtin=patterns.mjBUILTIN_CHECKER,
        mark=mujoco.mjtMark.mjMARK_EDGE, rgb1=[0.2, 0.3, 0.4], rgb2=[0.1, 0.2, 0.3], markrgb=[0.8] * 3,
        width=300, height=300,
    )  # fmt: skip
    ground = spec.add_material(name="groundplane", texuniform=True, texrepeat=[5, 5], reflectance=0.2)
    ground.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = "groundplane"
    # What is above the light has no shadow.
    top = max((float(each.T[2, 3]) for each in subject.shapes), default=0.0)
    spec.worldbody.add_light(
        pos=[0, 0, top + 1.5], dir=[0, 0, -1], type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL
    )
    if subject.floor is not None:
        spec.worldbody.add_geom(
            name="floor", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0, 0, 0.05], material="groundplane",
            pos=[0, 0, subject.floor],
        )  # fmt: skip
    T = subject.camera.pose.matrix
    # A camera of MuJoCo looks along its -z axis, and its y axis is upwards.
    R = T[:3, :3] @ np.diag([1.0, -1.0, -1.0])
    spec.worldbody.add_camera(
        name="view", pos=T[:3, 3], quat=_wxyz(R), fovy=math.degrees(subject.camera.field_of_view)
    )
    parent = spec.worldbody
    origin = np.eye(4)
    if subject.standing is not None:
        parent, origin = _mujoco_body(mujoco, spec, subject.standing)
    inverse = np.linalg.inv(origin)
    for number, (each, file) in enumerate(_meshes(subject.shapes, folder)):
        _mujoco_geom(mujoco, spec, parent, each, inverse @ each.T, number, file)
    for number, pose in enumerate(subject.frames):
        spec.worldbody.add_body(name=f"frame{number}", pos=pose[:3, 3], quat=_wxyz(pose[:3, :3]))
    for number, (inertial, pose) in enumerate(subject.inertias):
        body = spec.worldbody.add_body(name=f"link{number}", pos=pose[:3, 3], quat=_wxyz(pose[:3, :3]))
        body.mass, body.ipos, body.explicitinertial = inertial.mass, inertial.origin.matrix[:3, 3], True
        R = inertial.origin.matrix[:3, :3]
        tensor = R @ inertial.tensor @ R.T
        xx, yy, zz, xy, xz, yz = *np.diag(tensor), tensor[0, 1], tensor[0, 2], tensor[1, 2]
        body.fullinertia = [xx, yy, zz, xy, xz, yz]
    return spec


_WITH_EXTENT = (Box, Sphere, Cylinder, Capsule, Mesh)


def _extent(shapes: Sequence[DrawnShape]) -> tuple[Floats, Floats, float]:
    """Return the corners (3,) of the box around shapes and their mean size [m]."""
    boxes = np.array(
        [shape_box(each.shape, each.T) for each in shapes if isinstance(each.shape, _WITH_EXTENT)]
    )
    sizes = np.linalg.norm(boxes[:, 1] - boxes[:, 0], axis=1)
    return boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0), 0.5 * float(sizes.mean())


def _wxyz(R: Floats) -> Floats:
    return np.asarray(np.roll(quat_from_rotation(R), 1))


def _mujoco_body(mujoco: Any, spec: Any, standing: Standing) -> tuple[Any, Floats]:
    body = spec.worldbody.add_body(name="robot", pos=standing.middle)
    body.add_freejoint()
    body.mass, body.inertia, body.explicitinertial = standing.mass, 0.02 * standing.mass * np.ones(3), True
    for foot in standing.feet:
        body.add_geom(
            type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[standing.radius, 0, 0], pos=foot - standing.middle,
            rgba=[0, 0, 0, 0],
        )  # fmt: skip
    origin = np.eye(4)
    origin[:3, 3] = standing.middle
    return body, origin


def _mujoco_geom(
    mujoco: Any, spec: Any, body: Any, each: DrawnShape, T: Floats, number: int, file: Path | None
) -> None:
    kinds = mujoco.mjtGeom
    shape: Any = each.shape
    options: dict[str, Any] = {}
    if file is not None:
        kind, name = kinds.mjGEOM_MESH, file.stem
        if name not in [mesh.name for mesh in spec.meshes]:
            spec.add_mesh(name=name, file=str(file), inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL)
        options["meshname"] = name
    elif isinstance(shape, Box):
        kind, options["size"] = kinds.mjGEOM_BOX, [0.5 * edge for edge in shape.size]
    elif isinstance(shape, Sphere):
        kind, options["size"] = kinds.mjGEOM_SPHERE, [shape.radius, 0, 0]
    else:
        assert isinstance(shape, Cylinder | Capsule)
        kind = kinds.mjGEOM_CYLINDER if isinstance(shape, Cylinder) else kinds.mjGEOM_CAPSULE
        options["size"] = [shape.radius, 0.5 * shape.length, 0]
    texture = _texture(shape)
    if texture is not None:
        name = f"image{number}"
        pixels = texture.pixels[..., :3]
        spec.add_texture(
            name=name, type=mujoco.mjtTexture.mjTEXTURE_2D, width=pixels.shape[1], height=pixels.shape[0],
            nchannel=3, data=pixels[::-1].tobytes(),
        )  # fmt: skip
        spec.add_material(name=name).textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = name
        options["material"] = name
    body.add_geom(
        type=kind, pos=T[:3, 3], quat=_wxyz(T[:3, :3]), rgba=list(each.rgba), contype=0, conaffinity=0,
        mass=0.0, **options,
    )  # fmt: skip


# viser.


class ViserPages:
    """Pages of viser in one browser."""

    def __init__(self) -> None:
        self._close: list[Callable[[], object]] = []
        self._browser: Any = None

    def __enter__(self) -> ViserPages:
        return self

    def __exit__(self, *_: object) -> None:
        for close in reversed(self._close):
            close()

    def _open(self) -> Any:
        if self._browser is None:
            from playwright.sync_api import sync_playwright

            found = next(filter(None, map(shutil.which, BROWSERS)), None)
            if found is None:
                raise Undrawable(f"viser needs a browser: {' or '.join(BROWSERS)}")
            playwright = sync_playwright().start()
            self._browser = playwright.chromium.launch(executable_path=found, args=list(SOFTWARE))
            self._close += [playwright.stop, self._browser.close]
        return self._browser

    def draw(self, subject: Subject, dark: bool = False) -> Rgb:
        """Return what a page shows that has only viser's own light, and the grid of its example for URDF."""
        import viser

        if subject.inertias:
            raise Undrawable("viser shows no inertia")
        width, height = subject.camera.size
        browser = self._open()
        with contextlib.redirect_stdout(None):
            server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
        try:
            server.gui.configure_theme(dark_mode=dark)
            server.scene.set_up_direction("+z")
            _add_to_viser(server.scene, subject)
            page = browser.new_page(viewport={"width": width, "height": height})
            page.goto(f"http://127.0.0.1:{server.get_port()}")
            page.wait_for_selector("canvas[data-engine]", timeout=1e3 * PATIENCE)
            page.wait_for_timeout(1e3 * _SHOWN_AFTER)
            (client,) = server.get_clients().values()
            picture = client.get_render(
                height=height,
                width=width,
                wxyz=wxyz(subject.camera.pose.matrix[:3, :3]),
                position=tuple(subject.camera.pose.matrix[:3, 3]),
                fov=subject.camera.field_of_view,
                transport_format="png",
                timeout=PATIENCE,
            )
            page.close()
        finally:
            server.stop()
        return _over(np.asarray(picture, np.float64), 20.0 if dark else 255.0)


def _over(rgba: Floats, grey: float) -> Rgb:
    """Return colours before the background of the page, which is not in the picture that viser returns."""
    share = rgba[..., 3:] / 255.0
    return np.asarray(np.rint(share * rgba[..., :3] + (1.0 - share) * grey), np.uint8)


def _add_to_viser(scene: Any, subject: Subject) -> None:
    if subject.floor is not None:
        scene.add_grid("/grid", width=4, height=4, position=(0.0, 0.0, subject.floor))
    for number, each in enumerate(subject.shapes):
        shape: Any = each.shape
        placed = {"wxyz": wxyz(each.T[:3, :3]), "position": each.T[:3, 3]}
        if _texture(shape) is not None:
            scene.add_mesh_trimesh(f"/part{number}", _textured(shape), **placed)
            continue
        triangles, flat = with_edges(shape, None)
        scene.add_mesh_simple(
            f"/part{number}",
            triangles.vertices,
            triangles.faces,
            color=rgb_of(each.rgba),
            opacity=None if each.rgba[3] == 1.0 else each.rgba[3],
            flat_shading=flat,
            side="double",
            **placed,
        )
    if subject.arrows:
        ends = [(each.point, each.point + subject.length * each.force) for each in subject.arrows]
        thin = 0.06 * subject.length * max(float(np.linalg.norm(each.force)) for each in subject.arrows)
        sizes = {"shaft_radius": thin, "head_radius": 2.5 * thin, "head_length": 5.0 * thin}
        scene.add_arrows("/forces", np.array(ends, np.float32), (255, 0, 0), **sizes)
    for number, T in enumerate(subject.frames):
        scene.add_frame(
            f"/frame{number}",
            axes_length=subject.axis,
            axes_radius=0.05 * subject.axis,
            wxyz=wxyz(T[:3, :3]),
            position=T[:3, 3],
        )


def _textured(mesh: Mesh) -> Any:
    trimesh: Any = import_module("trimesh")  # Without types for its materials.
    surface = mesh.surface
    assert surface.texture is not None
    assert surface.uv is not None
    material = trimesh.visual.material.PBRMaterial(
        baseColorTexture=Image.fromarray(surface.texture.pixels), metallicFactor=0.0
    )
    count = 3 * len(surface.faces)
    return trimesh.Trimesh(
        surface.vertices[surface.faces].reshape(-1, 3),
        np.arange(count).reshape(-1, 3),
        visual=trimesh.visual.TextureVisuals(surface.uv.reshape(-1, 2), material=material),
        process=False,
    )
