"""Depths of primitives in closed form, and of meshes as of the same primitives."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from dynx.errors import ArgumentError, UnknownNameError
from dynx.model import Pose
from dynx.model.elements import IDENTITY
from dynx.model.geometry import Box, Capsule, Collision, Cylinder, Ellipsoid, HeightField, Mesh, Shape, Sphere
from dynx.spatial.scalar import Floats
from dynx.world import BodyState, Camera, Picture, Scene, SceneBody, WorldState, ground
from dynx.world.camera import draw_picture
from dynx.world.scenery import LIGHT


def see(camera: Camera, *bodies: SceneBody) -> Picture:
    """Return the picture of bodies at their start."""
    state = WorldState(0.0, {}, {each.name: BodyState(each.pose.matrix, np.zeros(6)) for each in bodies})
    return draw_picture(Scene("scene", bodies=bodies), state, camera)


def solid(name: str, shape: Shape, pose: Pose = IDENTITY) -> SceneBody:
    """Return a fixed body of one shape."""
    return SceneBody(name, (Collision(shape),), pose)


def rays(camera: Camera) -> tuple[Floats, Floats]:
    """Return the pinhole (3,) and the rays (height, width, 3) of depth 1 in world axes."""
    x, y = np.meshgrid(*camera.rays())
    T = camera.pose.matrix
    return T[:3, 3], np.stack([x, y, np.ones_like(x)], axis=-1) @ T[:3, :3].T


def test_the_depth_of_a_ball_and_of_the_ground() -> None:
    camera = Camera.look_at((3.0, -2.0, 1.5), (0.0, 0.0, 0.5), size=(160, 120))
    picture = see(camera, ground(), solid("ball", Sphere(0.5), Pose((0.0, 0.0, 0.5))))
    eye, along = rays(camera)
    to = eye - [0.0, 0.0, 0.5]
    a, b, c = (along**2).sum(axis=-1), along @ to, to @ to - 0.25
    with np.errstate(invalid="ignore"):
        ball = np.where(b * b > a * c, (-b - np.sqrt(b * b - a * c)) / a, np.inf)
    floor = np.where(along[..., 2] < 0.0, -eye[2] / along[..., 2], np.inf)
    wanted = np.minimum(ball, floor)
    wanted[wanted > camera.far] = np.inf
    assert np.allclose(picture.depth, wanted, rtol=1e-9)
    assert (picture.mask("ball") == (ball < floor)).all()
    assert picture.mask("ball").sum() > 100
    sky = picture.segmentation == -1
    unit = along[sky] / np.linalg.norm(along[sky], axis=-1, keepdims=True)
    assert np.abs(picture.rgb[sky] - 255.0 * LIGHT.sky(unit)).max() <= 0.51


def test_the_middle_of_the_picture_is_the_target_and_up_is_up() -> None:
    target = solid("target", Sphere(0.05))
    above = solid("above", Sphere(0.05), Pose((0.0, 0.0, 0.3)))
    right = solid("right", Sphere(0.05), Pose((0.0, 0.3, 0.0)))
    picture = see(Camera.look_at((2.0, 0.0, 0.0), (0.0, 0.0, 0.0), size=(101, 101)), target, above, right)
    assert picture.names[picture.segmentation[50, 50]] == "target"
    assert picture.depth[50, 50] == pytest.approx(1.95)
    rows, columns = np.nonzero(picture.mask("above"))
    assert rows.mean() < 40.0
    assert columns.mean() == pytest.approx(50.0)
    # Seen from +x with z up, +y is to the right.
    assert np.nonzero(picture.mask("right"))[1].mean() > 60.0


ANGLES = st.floats(-math.pi, math.pi)


@given(st.tuples(ANGLES, ANGLES, ANGLES), st.tuples(*[st.floats(-0.3, 0.3)] * 3), st.sampled_from(range(5)))
@settings(max_examples=20, deadline=None)
def test_a_mesh_looks_like_its_primitive(
    tmp_path_factory: pytest.TempPathFactory,
    rpy: tuple[float, float, float],
    xyz: tuple[float, float, float],
    which: int,
) -> None:
    make = trimesh.creation
    cases: list[tuple[Shape, trimesh.Trimesh, float]] = [
        (Box((0.6, 0.4, 0.2)), make.box([0.6, 0.4, 0.2]), 1e-6),
        (Sphere(0.3), make.icosphere(subdivisions=4, radius=0.3), 3e-2),
        (Cylinder(0.2, 0.5), make.cylinder(0.2, 0.5, sections=256), 3e-2),
        (Capsule(0.2, 0.3), make.capsule(0.3, 0.2, count=[64, 64]), 3e-2),
        (Ellipsoid((0.3, 0.2, 0.4)), make.icosphere(subdivisions=4), 3e-2),
    ]
    shape, surface, error = cases[which]
    if which == 3:
        surface.apply_translation(-surface.bounds.mean(axis=0))
    if which == 4:
        surface.apply_transform(np.diag([0.3, 0.2, 0.4, 1.0]))
    path = tmp_path_factory.mktemp("mesh") / "a.obj"
    path.write_text(str(surface.export(file_type="obj", digits=12)))
    camera = Camera(size=(64, 48))
    at = Pose((xyz[0], xyz[1], xyz[2] + 1.5), rpy)
    exact = see(camera, solid("a", shape, at))
    mesh = see(camera, solid("a", Mesh(str(path)), at))
    both = np.isfinite(exact.depth) & np.isfinite(mesh.depth)
    assert both.sum() > 30
    # A mesh is inside of the round solid, so that it is deeper, most so where it is seen at a small angle.
    assert np.quantile(np.abs(exact.depth[both] - mesh.depth[both]), 0.9) < error
    assert (np.isfinite(exact.depth) != np.isfinite(mesh.depth)).mean() < 0.02


def test_no_ray_passes_between_triangles(tmp_path: Path) -> None:
    path = tmp_path / "ball.obj"
    path.write_text(trimesh.creation.icosphere(subdivisions=3).export(file_type="obj"))
    inside = see(Camera(size=(120, 90), field_of_view=2.0), solid("ball", Mesh(str(path))))
    assert np.isfinite(inside.depth).all()
    field = HeightField(tuple(tuple(row) for row in np.zeros((30, 30)).tolist()), (40.0, 40.0))
    above = Camera.look_at((0.1, 0.2, 2.0), (0.3, 0.1, 0.0), size=(120, 90))
    assert np.isfinite(see(above, solid("field", field)).depth).all()


def test_many_triangles_are_drawn_in_parts(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "ball.obj"
    path.write_text(trimesh.creation.icosphere(subdivisions=2).export(file_type="obj"))
    ball = solid("ball", Mesh(str(path)), Pose((0.0, 0.0, 3.0)))
    whole = see(Camera(size=(64, 48)), ball)
    monkeypatch.setattr("dynx.world.camera.MAX_PAIRS", 50)
    parts = see(Camera(size=(64, 48)), ball)
    assert np.array_equal(whole.depth, parts.depth)
    assert np.array_equal(whole.rgb, parts.rgb)


def test_near_and_far_bound_what_is_seen() -> None:
    balls = [solid(f"b{z}", Sphere(0.1), Pose((0.0, 0.0, z))) for z in (0.5, 2.0, 5.0)]
    middle = (24, 32)
    for near, far, depth in ((0.01, 9.0, 0.4), (0.7, 9.0, 1.9), (0.5, 9.0, 0.6), (3.0, 4.0, np.inf)):
        picture = see(Camera(size=(65, 49), near=near, far=far), *balls)
        assert picture.depth[middle] == pytest.approx(depth)


def test_shapes_are_placed_in_their_body_and_colours_of_no_opacity_are_not_drawn() -> None:
    shapes = (
        Collision(Sphere(0.1), Pose((0.3, 0.0, 0.0))),
        Collision(Box((0.1, 0.1, 0.1)), Pose((-0.3, 0.0, 0.0))),
    )
    picture = see(Camera(size=(65, 49)), SceneBody("pair", shapes, Pose((0.0, 0.0, 2.0))))
    row = picture.mask("pair")[24]
    assert row[:32].any()
    assert row[33:].any()
    assert not row[32]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"field_of_view": 0.0}, "field_of_view"),
        ({"field_of_view": 4.0}, "field_of_view is 4; wanted"),
        ({"field_of_view": 90}, "90 degrees are 1.571"),
        ({"field_of_view": "wide"}, "field_of_view is 'wide'"),
        ({"size": (0, 10)}, "size"),
        ({"size": (10_000, 10)}, "at most 8192"),
        ({"size": 10}, "wanted width and height"),
        ({"near": 2.0, "far": 1.0}, "wanted less than far"),
        ({"near": math.nan}, "near"),
        ({"pose": np.zeros((4, 4))}, "rigid"),
    ],
)
def test_cameras_that_cannot_be_are_refused(options: dict[str, object], message: str) -> None:
    with pytest.raises(ArgumentError, match=message):
        Camera(**options)  # type: ignore[arg-type]


def test_views_that_have_no_direction_are_refused() -> None:
    with pytest.raises(ArgumentError, match="different points"):
        Camera.look_at((1.0, 0.0, 0.0), (1.0, 0.0, 0.0))
    with pytest.raises(ArgumentError, match="along the view"):
        Camera.look_at((0.0, 0.0, 1.0), (0.0, 0.0, 0.0))
    shape: Shape = Sphere(0.1)
    with pytest.raises(UnknownNameError, match="no part 'table'"):
        see(Camera(part="table"), solid("a", shape))
    with pytest.raises(UnknownNameError, match="did you mean 'ball'"):
        see(Camera(), solid("ball", shape)).mask("bal")
