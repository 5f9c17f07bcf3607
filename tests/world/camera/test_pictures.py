"""Cameras of worlds: on links, of robots, beside PyBullet's own renderer, and in PNG files."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

import dynx
from dynx.errors import ArgumentError, EngineLimitError, UnknownBackendError
from dynx.model import Pose
from dynx.model.geometry import HeightField
from dynx.world import Camera, Material, Picture, Scene, SceneBody, SceneRobot, World, box, ground, sphere

pytest.importorskip("pybullet")


def scene() -> Scene:
    red = Material(rgba=(1.0, 0.0, 0.0, 1.0))
    bodies = (
        ground(),
        box("cube", (0.3, 0.3, 0.3), mass=1.0, pose=Pose((0.6, 0.4, 0.15)), material=red),
        sphere("ball", 0.2, mass=1.0, pose=Pose((0.6, -0.4, 0.2))),
    )
    return Scene("scene", (SceneRobot("arm", dynx.load("ur5"), (0.0, -1.2, 1.0, 0.0, 0.0, 0.0)),), bodies)


def test_robots_and_bodies_are_seen_by_name() -> None:
    with World(scene(), "pybullet") as world:
        picture = world.camera(Camera.look_at((2.5, 0.0, 1.5), (0.3, 0.0, 0.3)))
        again = world.camera(Camera.look_at((2.5, 0.0, 1.5), (0.3, 0.0, 0.3)))
    assert picture.depth.shape == (240, 320)
    for name in ("arm", "arm/forearm_link", "cube", "ball", "ground"):
        assert picture.mask(name).any()
    red, green, blue = picture.rgb[picture.mask("cube")].astype(int).T
    assert (red > 80).all()
    assert not green.any()
    assert not blue.any()
    assert np.array_equal(picture.rgb, again.rgb)
    assert "cube" in repr(picture)


def test_a_camera_moves_with_the_link_that_carries_it() -> None:
    # 10 cm before the flange, looking along its y axis, which is that of the last joint.
    at = Pose.from_matrix(np.array([[1.0, 0, 0, 0], [0, 0, 1, 0.2], [0, -1, 0, 0], [0, 0, 0, 1]]))
    camera = Camera(at, part="arm/wrist_3_link", size=(80, 60))
    depths = []
    with World(scene(), "pybullet") as world:
        engine = dynx.backend("reference", world.scene.robots[0].model)
        number = engine.model.frame_index("wrist_3_link")
        # The second joint changes the height of the camera; the first alone would leave a view of the plane.
        for q in ([0.0, -1.2, 1.0, 0.0, 0.0, 0.0], [1.0, -1.0, 1.0, 0.0, 0.0, 0.0]):
            world.set_state(robots={"arm": (q, np.zeros(6))})
            T = engine.forward_kinematics(world.state.robots["arm"].q)[number]
            fixed = world.camera(Camera(Pose.from_matrix(T @ at.matrix), size=(80, 60)))
            depths.append(world.camera(camera).depth)
            assert np.allclose(depths[-1], fixed.depth, rtol=1e-6)
    assert not np.allclose(depths[0], depths[1], rtol=0.01)


@pytest.mark.parametrize("mesh", [False, True])
def test_pybullet_renders_the_same_depth_and_parts(mesh: bool) -> None:
    camera = Camera.look_at((1.6, 0.3, 1.2), (0.4, 0.0, 0.2), size=(160, 120), near=0.2, far=6.0)
    robots = scene().robots if mesh else ()
    with World(Scene("s", robots, scene().bodies), "pybullet") as world:
        picture, other = world.camera(camera), world.camera(camera, "pybullet")
        assert np.array_equal(picture.depth, world.camera(camera).depth)
    inner = away_from_edges(picture) & away_from_edges(other)
    assert inner.mean() > (0.6 if mesh else 0.8)
    assert np.array_equal(picture.segmentation[inner], other.segmentation[inner])
    # PyBullet draws a ball as a polyhedron.
    ball = inner & picture.mask("ball")
    flat = inner & (picture.segmentation >= 0) & ~picture.mask("ball")
    assert np.abs(picture.depth[flat] - other.depth[flat]).max() < 1e-4
    assert np.abs(picture.depth[ball] - other.depth[ball]).max() < 0.05


def mujoco_picture(world: World, camera: Camera) -> Picture:
    """Return MuJoCo's picture; the test is skipped where OpenGL needs a display."""
    pytest.importorskip("mujoco")
    try:
        return world.camera(camera, "mujoco")
    except EngineLimitError as error:
        if "without a display" not in str(error):
            raise
        pytest.skip(str(error))


@pytest.mark.parametrize("mesh", [False, True])
def test_mujoco_renders_the_same_depth_and_parts(mesh: bool) -> None:
    camera = Camera.look_at((1.6, 0.3, 1.2), (0.4, 0.0, 0.2), size=(160, 120), near=0.2, far=6.0)
    robots = scene().robots if mesh else ()
    with World(Scene("s", robots, scene().bodies), "pybullet") as world:
        picture, other = world.camera(camera), mujoco_picture(world, camera)
    inner = away_from_edges(picture) & away_from_edges(other)
    assert inner.mean() > 0.8
    assert np.array_equal(picture.segmentation[inner], other.segmentation[inner])
    ball = inner & picture.mask("ball")
    flat = inner & (picture.segmentation >= 0) & ~picture.mask("ball")
    assert np.abs(picture.depth[flat] - other.depth[flat]).max() < 1e-4
    assert np.abs(picture.depth[ball] - other.depth[ball]).max() < 0.05
    cube = other.rgb[inner & other.mask("cube")].astype(int)
    assert (cube[:, 0] > cube[:, 1] + 30).all()


def test_a_height_field_an_empty_scene_and_a_camera_on_a_part_are_drawn_by_mujoco() -> None:
    heights = 0.2 * np.sin(np.arange(20.0))[:, None] * np.ones(16)
    field = SceneBody("hill", (HeightField(heights, (2.0, 1.6)),))
    camera = Camera(Pose((0.0, 0.0, 2.0), (np.pi, 0.0, 0.3)), size=(80, 60), part="eye", near=0.1, far=10.0)
    eye = box("eye", (0.01, 0.01, 0.01), mass=1.0, pose=Pose((0.1, 0.0, 0.5)))
    with World(Scene("hills", bodies=(field, eye)), "mujoco") as world:
        picture, other = world.camera(camera), mujoco_picture(world, camera)
    both = np.isfinite(picture.depth) & np.isfinite(other.depth)
    assert both.mean() > 0.2
    assert (np.isfinite(picture.depth) == np.isfinite(other.depth)).mean() > 0.97
    assert np.median(np.abs(picture.depth[both] - other.depth[both])) < 1e-4
    with World(Scene("nothing"), "mujoco") as world:
        assert (mujoco_picture(world, Camera(size=(8, 6))).segmentation == -1).all()


def test_an_unknown_way_to_open_gl_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    library = pytest.importorskip("dynx.engines.mujoco.library")
    if not sys.platform.startswith("linux"):
        pytest.skip("MuJoCo has one way elsewhere")

    def missing(name: str) -> None:
        raise ImportError(f"no {name}")

    monkeypatch.setattr(library.importlib, "import_module", missing)
    with (
        pytest.raises(EngineLimitError, match=r"without a display here \(egl: no mujoco.egl; osmesa: "),
        library.offscreen_context(8, 8),
    ):
        pass


def away_from_edges(picture: Picture) -> NDArray[np.bool_]:
    """Return the pixels around which one part is seen, whose depths lie in one plane."""
    seen, depth = picture.segmentation, 1.0 / picture.depth
    inner = np.zeros_like(seen, bool)
    inner[1:-1, 1:-1] = True
    for axis in (0, 1):
        for step in (-1, 1):
            inner &= np.roll(seen, step, axis) == seen
        bend = np.roll(depth, 1, axis) + np.roll(depth, -1, axis) - 2.0 * depth
        inner &= (np.abs(bend) < 1e-3) | picture.mask("ball")
    return inner


def test_engines_without_a_renderer_are_refused() -> None:
    pytest.importorskip("pydrake")
    with World(scene(), "pybullet") as world:
        with pytest.raises(EngineLimitError, match="no renderer"):
            world.camera(Camera(), "drake")
        with pytest.raises(UnknownBackendError, match="did you mean 'pybullet'"):
            world.camera(Camera(), "bullet")
        with pytest.raises(UnknownBackendError, match=r"'opengl'; wanted None, .* or 'pybullet'"):
            world.camera(Camera(), "opengl")
        with pytest.raises(ArgumentError, match="renderer is '1'"):
            world.camera(Camera(), 1)  # type: ignore[arg-type]
        with pytest.raises(EngineLimitError, match="at most 1e5 times near"):
            world.camera(Camera(far=1e4), "pybullet")


def test_pictures_in_png_files_hold_colour_depth_and_parts(tmp_path: Path) -> None:
    with World(scene(), "pybullet") as world:
        picture = world.camera(Camera.look_at((2.5, 0.0, 1.5), (0.3, 0.0, 0.3), size=(64, 48), far=60.0))
    for what in ("rgb", "depth", "segmentation"):
        picture.write_png(tmp_path / f"{what}.png", what)
    assert picture._repr_png_() == (tmp_path / "rgb.png").read_bytes()
    read = {what: np.array(Image.open(tmp_path / f"{what}.png")) for what in ("rgb", "depth", "segmentation")}
    assert np.array_equal(read["rgb"], picture.rgb)
    assert np.array_equal(read["segmentation"], picture.segmentation + 1)
    seen = np.isfinite(picture.depth)
    assert np.abs(read["depth"] / 1000.0 - picture.depth)[seen].max() <= 5.001e-4
    assert (read["depth"][~seen] == 65535).all()
    with pytest.raises(ArgumentError, match="wanted 'rgb'"):
        picture.write_png(tmp_path / "a.png", "colour")
    with pytest.raises(ArgumentError, match="written as"):
        picture.write_png(tmp_path / "a.jpg")


def test_a_view_straight_down_names_the_argument_that_is_missing() -> None:
    with pytest.raises(ArgumentError, match=r"along the view from .* such as up=\[1.0, 0.0, 0.0\]"):
        Camera.look_at((0, 0, 2), (0, 0, 0))
    assert Camera.look_at((0, 0, 2), (0, 0, 0), up=(1, 0, 0)).pose.matrix[2, 2] == pytest.approx(-1.0)
