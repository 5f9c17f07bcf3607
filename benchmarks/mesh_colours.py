"""Colours of drawn meshes beside those that an independent reader finds at the same points.

``python -m benchmarks.mesh_colours`` draws robots without light: by the camera of a world, as an exported
picture, and in the page, in headless Chromium by software. At random pixels that are two or more away from an
edge, a ray is cast through the meshes as trimesh reads them (COLLADA by pycollada), and the colour of the
material that it hits, its image sampled there, should be that of the picture within 3 of 255. The colours of
URDF are read by ElementTree. ``--subject`` and ``--picture`` choose some, and ``--samples`` the number of
pixels. Then matte balls are drawn in light: their hue should stay within 5 degrees, and no more than 2 % of
them become black or white.

It needs trimesh, pycollada and, for the page, Chromium and the Python package playwright (extra ``test``).
"""

from __future__ import annotations

import argparse
import colorsys
import math
import shutil
import tempfile
from collections.abc import Callable, Iterator
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

import dynx
from dynx.model import Model
from dynx.model.geometry import Box, Cylinder, Mesh, Sphere
from dynx.rbd.kinematics import link_poses
from dynx.spatial.scalar import Floats
from dynx.spatial.so3 import quat_from_rotation
from dynx.steppers.camera import Camera, DrawnShape
from dynx.steppers.state import RobotState, WorldState
from dynx.viewer import Viewer
from dynx.viewer.export import Stage, picture_of
from dynx.viewer.motion import motion_of_state
from dynx.world import Scene, SceneRobot
from dynx.world.camera import Picture, cast_rays, draw_picture
from dynx.world.scenery import DARK, LIGHT, Scenery
from tests.viewer.conftest import BROWSERS, PATIENCE, SOFTWARE

UNLIT = LIGHT._replace(key=0.0, fill=0.0, sky_light=1.0, ground_light=1.0, polish=0.0)
"""Light by which every surface has its own colour."""

CLOSE = 3
"""Largest difference of a value of a colour, of 255."""

SHARE = 0.99
"""Least share of the pixels whose colour is that close."""

EDGE = 2
"""Distance from an edge within which pixels are not compared [pixels]."""

GLOSS = 0.02
"""Share of even light that the material of the page reflects as a mirror does, and so does not show."""

STEP = 40.0
"""Difference of a value of the colours two pixels apart, of 255, that is an edge of an image."""

SIZE = (320, 240)
"""Size of the pictures [pixels]."""


class Subject(NamedTuple):
    """A robot, and where it is looked at from."""

    model: Model
    eye: tuple[float, float, float]
    target: tuple[float, float, float]

    @property
    def camera(self) -> Camera:
        """The camera that sees it."""
        return Camera.look_at(self.eye, self.target, size=SIZE)


def _of_pybullet(name: str) -> Path:
    import pybullet_data

    return Path(pybullet_data.getDataPath(), name)


def _textured_gltf() -> Model:
    """Return a robot of a wavy sheet of glTF with an image, written by trimesh."""
    from PIL import Image

    # trimesh has no types for its materials.
    trimesh: Any = import_module("trimesh")
    folder = Path(tempfile.mkdtemp())
    side = np.linspace(-0.5, 0.5, 40)
    x, y = np.meshgrid(side, side)
    points = np.stack([x, y, 0.1 * np.sin(6.0 * x) * np.cos(5.0 * y)], axis=-1).reshape(-1, 3)
    row = np.arange(39)[:, None] * 40
    corner = (row + np.arange(39)).reshape(-1)
    faces = np.concatenate(
        [np.stack([corner, corner + 1, corner + 41], 1), np.stack([corner, corner + 41, corner + 40], 1)]
    )
    u, v = np.meshgrid(np.arange(64), np.arange(64))
    pixels = np.stack([4 * u, 4 * v, 127 + 100 * np.sin(u / 5.0)], axis=-1).astype(np.uint8)
    material = trimesh.visual.material.PBRMaterial(baseColorTexture=Image.fromarray(pixels))
    visual = trimesh.visual.TextureVisuals(uv=points[:, :2] + 0.5, material=material)
    trimesh.Trimesh(points, faces, visual=visual, process=False).export(folder / "sheet.glb")
    (folder / "sheet.urdf").write_text(
        '<robot name="sheet"><link name="sheet"><visual><geometry><mesh filename="sheet.glb"/></geometry>'
        "</visual></link></robot>"
    )
    return dynx.load(folder / "sheet.urdf")


SUBJECTS: dict[str, Callable[[], Subject]] = {
    "panda": lambda: Subject(dynx.load("panda"), (1.1, -0.9, 0.9), (0.05, 0.0, 0.5)),
    "plane": lambda: Subject(dynx.load(_of_pybullet("plane.urdf")), (1.0, -1.4, 1.6), (0.1, 0.2, 0.0)),
    "duck": lambda: Subject(dynx.load(_of_pybullet("duck_vhacd.urdf")), (0.13, -0.1, 0.12), (0.0, 0.0, 0.04)),
    "r2d2": lambda: Subject(dynx.load(_of_pybullet("r2d2.urdf")), (1.1, -1.2, 0.7), (0.0, 0.1, 0.0)),
    "gltf": lambda: Subject(_textured_gltf(), (0.6, -0.8, 0.8), (0.0, 0.0, 0.0)),
}


# The independent reader.


GREY = np.full(3, 0.7)
"""Colour of shapes without one of their own."""


class _Part(NamedTuple):
    """Triangles in the world, and a function that returns the colours (n, 3) at points of them by the
    numbers of the triangles (n,) and weights of their corners (n, 3)."""

    corners: Floats
    colours: Callable[[NDArray[np.intp], Floats], Floats]


def _constant(rgb: Floats, triangles: NDArray[np.intp], weights: Floats) -> Floats:
    return np.broadcast_to(rgb, (len(triangles), 3))


def _sampled(uv: Floats, image: Any, rgb: Floats, triangles: NDArray[np.intp], weights: Floats) -> Floats:
    # trimesh takes (0, 0) for the middle of a pixel, renderers take it for the corner of the image.
    pixels = np.asarray(image.convert("RGB"), np.float64)
    height, width = pixels.shape[:2]
    u, v = np.einsum("ij,ijk->ik", weights, uv[triangles]).T
    x, y = u * width - 0.5, (1.0 - v) * height - 0.5
    column, row = np.floor(x).astype(np.intp), np.floor(y).astype(np.intp)
    found = np.zeros((len(u), 3))
    for right, below in ((0, 0), (0, 1), (1, 0), (1, 1)):
        share = np.abs(1 - right - (x - column)) * np.abs(1 - below - (y - row))
        found += share[:, None] * pixels[(row + below) % height, (column + right) % width]
    return found * rgb


def _colour_of(mesh: Any, rgba: Floats | None) -> Callable[[NDArray[np.intp], Floats], Floats]:
    material = getattr(mesh.visual, "material", None)
    image = getattr(material, "image", None) or getattr(material, "baseColorTexture", None)
    if image is not None:
        tint = np.ones(3) if rgba is None else rgba[:3]
        return partial(_sampled, np.asarray(mesh.visual.uv)[mesh.faces], image, tint)
    if rgba is not None:
        return partial(_constant, 255.0 * rgba[:3])
    if material is None:
        return partial(_constant, 255.0 * GREY)
    return partial(_constant, np.asarray(material.main_color, np.float64)[:3])


def _read(model: Model) -> Iterator[_Part]:
    """Yield what the robot consists of, as trimesh and ElementTree read it."""
    import trimesh

    root = ElementTree.parse(str(model.source)).getroot()
    named = {
        each.get("name"): np.array([float(word) for word in colour.get("rgba", "").split()])
        for each in root.iter("material")
        for colour in each.findall("color")
    }
    visuals = {link.get("name"): link.findall("visual") for link in root.findall("link")}
    for link, T_link in link_poses(model, model.neutral()):
        for visual, element in zip(model.geometry.visuals(link), visuals[link], strict=True):
            material = element.find("material")
            rgba = None if material is None else named.get(material.get("name"))
            T, shape = T_link @ visual.origin.matrix, visual.shape
            if isinstance(shape, Mesh):
                scene = trimesh.load_scene(shape.file, process=False)
                meshes = []
                for node in scene.graph.nodes_geometry:
                    pose, name = scene.graph[node]
                    mesh = scene.geometry[name]
                    if hasattr(mesh, "faces"):
                        meshes.append((mesh, mesh.vertices @ pose[:3, :3].T + pose[:3, 3]))
                low, high = (f([f(points, axis=0) for _, points in meshes], axis=0) for f in (np.min, np.max))
                ours = shape.triangles[0][np.unique(shape.triangles[1])] / shape.scale
                assert np.allclose([low, high], [ours.min(axis=0), ours.max(axis=0)], atol=1e-5), shape.file
                for mesh, points in meshes:
                    placed = (points * shape.scale) @ T[:3, :3].T + T[:3, 3]
                    yield _Part(placed[mesh.faces], _colour_of(mesh, rgba))
                continue
            if isinstance(shape, Box):
                solid = trimesh.creation.box(shape.size)
            elif isinstance(shape, Sphere):
                solid = trimesh.creation.icosphere(5, shape.radius)
            else:
                assert isinstance(shape, Cylinder)
                solid = trimesh.creation.cylinder(shape.radius, shape.length, 256)
            corners = (solid.vertices @ T[:3, :3].T + T[:3, 3])[solid.faces]
            yield _Part(corners, partial(_constant, 255.0 * (GREY if rgba is None else rgba[:3])))


def expected_colours(model: Model, camera: Camera, pixels: NDArray[np.intp]) -> tuple[Floats, Floats]:
    """Return the colours (n, 3), from 0 to 255, that rays through pixels (n,) hit, and their depths (n,) [m]
    along the optical axis; NaN and infinity for nothing."""
    x, y = camera.rays()
    width, T = camera.size[0], camera.pose.matrix
    rays = np.stack([x[pixels % width], y[pixels // width], np.ones(len(pixels))], axis=1) @ T[:3, :3].T
    depth, colours = np.full(len(pixels), np.inf), np.full((len(pixels), 3), np.nan)
    unit = rays / np.linalg.norm(rays, axis=1)[:, None]
    for part in _read(model):
        a = part.corners[:, 0] - T[:3, 3]
        along, beside = part.corners[:, 1] - part.corners[:, 0], part.corners[:, 2] - part.corners[:, 0]
        normal = np.cross(along, beside)
        height = np.einsum("ij,ij->i", normal, a)
        low, high = (f(part.corners, axis=(0, 1)) - T[:3, 3] for f in (np.min, np.max))
        middle, radius = 0.5 * (low + high), 0.5 * np.linalg.norm(high - low) + 1e-6
        near = np.linalg.norm(np.cross(unit, middle), axis=1) <= radius
        for k in np.flatnonzero(near):
            # Moeller and Trumbore (1997).
            with np.errstate(divide="ignore", invalid="ignore"):
                inverse = 1.0 / (normal @ rays[k])
                t = height * inverse
                offset = np.cross(a, rays[k])
                v = np.einsum("ij,ij->i", beside, offset) * inverse
                w = -np.einsum("ij,ij->i", along, offset) * inverse
            hit = (v >= 0.0) & (w >= 0.0) & (v + w <= 1.0) & (t > 0.0)
            if not hit.any():
                continue
            first = int(np.argmin(np.where(hit, t, np.inf)))
            if t[first] < depth[k]:
                depth[k] = t[first]
                weights = np.array([[1.0 - v[first] - w[first], v[first], w[first]]])
                colours[k] = part.colours(np.array([first]), weights)[0]
    return colours, depth


# The pictures.


def _scene(model: Model) -> Scene:
    return Scene("robot", robots=(SceneRobot("robot", model),))


def _state(model: Model) -> WorldState:
    return WorldState(0.0, {"robot": RobotState(model.neutral(), np.zeros(model.nv))}, {})


def by_camera(subject: Subject, scenery: Scenery = UNLIT) -> Picture:
    """Return what the camera of a world sees."""
    scene = _scene(subject.model)
    return draw_picture(scene, _state(subject.model), subject.camera, partial(cast_rays, scenery=scenery))


def by_export(subject: Subject) -> NDArray[np.uint8]:
    """Return an exported picture."""
    scene = _scene(subject.model)
    motion = motion_of_state(scene, _state(subject.model))
    return picture_of((motion,), 0.0, Stage(subject.camera, UNLIT))


MATTE = "window.__dynxRoughness = 1"
"""Program of the page that takes the gloss from its surfaces."""


def unlit_page(viewer: Viewer) -> None:
    """Light a page from everywhere alike, so that every surface has its own colour; run `MATTE` in it."""
    scene = viewer.page.scene
    for name in ("/ground", "/sky", "/sun", "/fill"):
        scene.remove_by_name(name)
    scene.configure_default_lights(False)
    scene.configure_environment_map(None)
    # A matte surface reflects light evenly over the half-space, whose measure is pi.
    scene.add_light_ambient("/everywhere", intensity=math.pi / (1.0 - GLOSS))


def by_page(viewer: Viewer, camera: Camera) -> NDArray[np.uint8]:
    """Return what the open page of a viewer shows from the place of a camera."""
    (client,) = viewer.page.server.get_clients().values()
    x, y, z, w = quat_from_rotation(camera.pose.matrix[:3, :3])
    picture = client.get_render(
        height=camera.size[1],
        width=camera.size[0],
        wxyz=(w, x, y, z),
        position=tuple(camera.pose.matrix[:3, 3]),
        fov=camera.field_of_view,
        transport_format="png",
        timeout=PATIENCE,
    )
    return np.asarray(picture[..., :3], np.uint8)


# The comparison.


def pixels_off_edges(subject: Subject, count: int, seed: int = 0) -> NDArray[np.intp]:
    """Return numbers of random pixels in which the robot is seen, two or more away from an edge between
    shapes, materials, or places whose depths are far apart."""
    from dynx.world.camera import drawn_shapes, part_poses

    scene, camera = _scene(subject.model), subject.camera
    shapes = list(drawn_shapes(scene, dict(part_poses(scene, _state(subject.model)))))
    drawing = cast_rays([DrawnShape(*each[:4]) for each in shapes], camera.pose.matrix, camera)
    number = drawing.number.reshape(SIZE[1], SIZE[0])
    good = number >= 0
    depth = drawing.depth.reshape(number.shape)
    for rows in range(-EDGE, EDGE + 1):
        for columns in range(-EDGE, EDGE + 1):
            good &= np.roll(number, (rows, columns), (0, 1)) == number
            with np.errstate(invalid="ignore"):
                good &= np.abs(np.roll(depth, (rows, columns), (0, 1)) - depth) < 0.05 * depth
    good[:EDGE] = good[-EDGE:] = good[:, :EDGE] = good[:, -EDGE:] = False
    found = np.flatnonzero(good)
    return np.random.default_rng(seed).choice(found, min(count, len(found)), replace=False)


def without_edges(subject: Subject, pixels: NDArray[np.intp]) -> tuple[NDArray[np.intp], Floats]:
    """Return those pixels without an edge of an image within two pixels, and colours (n, 3) to expect."""
    around = [EDGE * (down * SIZE[0] + right) for down in (-1, 0, 1) for right in (-1, 0, 1)]
    found, _ = expected_colours(subject.model, subject.camera, np.add.outer(around, pixels).ravel())
    colours = found.reshape(len(around), len(pixels), 3)
    smooth = np.abs(colours - colours[len(around) // 2]).max(axis=(0, 2)) <= STEP
    return pixels[smooth], colours[len(around) // 2][smooth]


def share_close(rgb: NDArray[np.uint8], pixels: NDArray[np.intp], expected: Floats) -> float:
    """Return the share of the pixels whose colours are close to those expected (n, 3)."""
    found = rgb.reshape(-1, 3)[pixels].astype(np.float64)
    return float(np.mean(np.abs(found - expected).max(axis=1) <= CLOSE))


# Balls in light.


def lit_ball(rgb: tuple[float, float, float], scenery: Scenery) -> tuple[float, float]:
    """Return the largest difference of the hue of a matte ball from its own [degrees] in 99 % of its pixels,
    and the share of its pixels that are black or white."""
    ball = DrawnShape(0, Sphere(0.5), (*rgb, 1.0), np.eye(4))
    camera = Camera.look_at((1.5, -1.5, 1.0), (0.0, 0.0, 0.0), size=(200, 160))
    drawing = cast_rays([ball], camera.pose.matrix, camera, scenery)
    seen = drawing.rgb[drawing.number == 0].astype(np.float64) / 255.0
    hues = np.array([colorsys.rgb_to_hsv(*pixel)[0] for pixel in seen])
    turn = (hues - colorsys.rgb_to_hsv(*rgb)[0] + 0.5) % 1.0 - 0.5
    clipped = float(np.mean((seen.max(axis=1) < 2 / 255) | (seen.min(axis=1) > 253 / 255)))
    return 360.0 * float(np.quantile(np.abs(turn), 0.99)), clipped


BALLS = ((0.8, 0.2, 0.1), (0.2, 0.7, 0.3), (0.15, 0.3, 0.85), (0.9, 0.8, 0.2), (0.6, 0.3, 0.6))
"""Colours of matte balls."""


def main() -> None:
    """Print the share of each picture of each robot; end with an error where one is below the bar."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--subject", default=",".join(SUBJECTS), help="robots, between commas")
    options.add_argument("--picture", default="camera,export,page", help="pictures, between commas")
    options.add_argument("--samples", type=int, default=400, help="pixels of each picture")
    given = options.parse_args()
    pictures = given.picture.split(",")
    good = True
    browser: Any = None
    if "page" in pictures:
        from playwright.sync_api import sync_playwright

        found = next(filter(None, map(shutil.which, BROWSERS)), None)
        playwright = sync_playwright().start()
        browser = playwright.chromium.launch(executable_path=found, args=list(SOFTWARE))
    for name in given.subject.split(","):
        subject = SUBJECTS[name]()
        pixels, expected = without_edges(subject, pixels_off_edges(subject, given.samples))
        shares = {}
        if "camera" in pictures:
            shares["camera"] = share_close(by_camera(subject).rgb, pixels, expected)
        if "export" in pictures:
            shares["export"] = share_close(by_export(subject), pixels, expected)
        for whole in (True, False) if "page" in pictures else ():
            with subject.model.view(whole_meshes=whole) as viewer:
                unlit_page(viewer)
                page = browser.new_page(viewport={"width": 900, "height": 600})
                page.goto(viewer.url)
                page.evaluate(MATTE)
                page.wait_for_selector("canvas[data-engine]", timeout=1e3 * PATIENCE)
                page.wait_for_timeout(3000)
                label = "page" if whole else "page, meshes reduced"
                shares[label] = share_close(by_page(viewer, subject.camera), pixels, expected)
                page.close()
        good &= min(shares.values()) >= SHARE
        text = ", ".join(f"{where} {100 * share:.1f} %" for where, share in shares.items())
        print(f"{name}: {len(pixels)} pixels, within {CLOSE} of 255: {text}", flush=True)
    if browser is not None:
        browser.close()
        playwright.stop()
    for look, scenery in (("light", LIGHT), ("dark", DARK)):
        hue, clipped = (max(each) for each in zip(*(lit_ball(rgb, scenery) for rgb in BALLS), strict=True))
        good &= hue <= 5.0 and clipped <= 0.02
        print(
            f"balls, {look}: hue within {hue:.2f} degrees, {100 * clipped:.2f} % black or white", flush=True
        )
    if not good:
        raise SystemExit(1)


if __name__ == "__main__":
    main()
