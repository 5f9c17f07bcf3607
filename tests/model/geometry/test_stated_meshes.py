"""Meshes that a description states itself: read, written in every format, drawn, and colliding."""

from __future__ import annotations

import pickle
from pathlib import Path

import numpy as np
import pytest

import dynx
from dynx.errors import ArgumentError, DescriptionError, ShapeError
from dynx.model import Link, Model
from dynx.model.conversion import convert
from dynx.model.document_format import Format
from dynx.model.geometry import Appearance, Collision, Geometry, LinkGeometry, Mesh, Visual, solid_properties
from dynx.model.geometry.convex_pieces import mesh_objects
from dynx.model.geometry.drawn_shapes import colliding_geometry, coloured_shapes, look_notes
from dynx.model.geometry.stated_mesh import StatedMesh
from dynx.world import Scene, SceneBody, World, ground, read_scene, write_scene
from tests.world.engines import WORLDS

POINTS = ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
CORNERS = ((0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3))
TETRAHEDRON = StatedMesh(points=POINTS, corners=CORNERS, label="corner")


def test_triangles_hull_and_volume() -> None:
    for mesh in (TETRAHEDRON, StatedMesh(points=POINTS)):
        assert solid_properties(mesh).volume == pytest.approx(1.0 / 6.0)
        assert mesh.triangles[0].shape == (4, 3)
        assert pickle.loads(pickle.dumps(mesh)) == mesh
    scaled = StatedMesh(points=POINTS, corners=CORNERS, scale=(-2.0, 1.0, 1.0))
    vertices, faces = scaled.triangles
    assert np.linalg.det(vertices[faces]).sum() / 6.0 == pytest.approx(2.0 / 6.0)


def test_it_is_drawn_without_an_image() -> None:
    plain = Visual(TETRAHEDRON, material=Appearance(rgba=(1.0, 0.0, 0.0, 1.0)))
    ((drawn, rgba, _),) = coloured_shapes(plain, None, (0.5, 0.5, 0.5, 1.0))
    assert (drawn, rgba) == (TETRAHEDRON, (1.0, 0.0, 0.0, 1.0))
    assert not look_notes(plain)
    model = robot()
    (hull,) = colliding_geometry(model.geometry, ["a"], (0.5, 0.5, 0.5, 1.0)).visuals("a")
    assert isinstance(hull.shape, Mesh)
    assert len(hull.shape.triangles[1]) == 4
    with pytest.raises(ArgumentError, match="'corner' is no OBJ file"):
        mesh_objects(TETRAHEDRON, "unused")


def robot() -> Model:
    shapes = LinkGeometry((Visual(TETRAHEDRON),), (Collision(TETRAHEDRON),))
    return Model.build("r", [Link("a")], [], geometry=Geometry({"a": shapes}))


def test_texts_state_it() -> None:
    model = robot()
    for text in (model.to_urdf(geometry=True), model.to_mjcf()):
        back = dynx.load(text).geometry
        (visual,), (collision,) = back.visuals("a"), back.collisions("a")
        for shape in (visual.shape, collision.shape):
            assert isinstance(shape, StatedMesh)
            assert (shape.points, shape.corners) == (POINTS, CORNERS)


def test_sdf_states_it_in_a_file_alone() -> None:
    assert "Meshes without a file are left out" in robot().to_sdf()


@pytest.mark.parametrize(("to", "suffix"), [("mjcf", ".xml"), ("urdf", ".urdf"), ("sdf", ".sdf")])
def test_a_conversion_writes_a_file(to: Format, suffix: str, tmp_path: Path) -> None:
    found = convert(robot(), to)
    assert found.differences == found.shape_differences == ()
    assert any(name.endswith("corner.obj") for name in found.files)
    path = tmp_path / f"r{suffix}"
    found.write(path)
    (placed,) = dynx.load(path).geometry.collisions("a")
    assert solid_properties(placed.shape).volume == pytest.approx(1.0 / 6.0)


@pytest.mark.parametrize("engine", WORLDS)
def test_it_lands_on_each_engine_and_is_saved_with_the_scene(engine: str, tmp_path: Path) -> None:
    body = SceneBody("b", TETRAHEDRON, mass=1.0, pose=dynx.Pose((0.0, 0.0, 0.01)))
    path = tmp_path / "scene.toml"
    write_scene(Scene("s", bodies=(ground(), body)), path)
    scene = read_scene(path)
    assert scene.body("b").shapes == body.shapes
    with World(scene, engine) as world:
        world.run(0.5)
        assert abs(world.state.bodies["b"].position[2]) < 2e-3


def test_invalid_meshes_are_errors() -> None:
    with pytest.raises(ShapeError, match="shape"):
        StatedMesh(points=((0.0, 0.0),))  # type: ignore[arg-type]
    with pytest.raises(ArgumentError, match="vertex 9; wanted 0 to 3"):
        StatedMesh(points=POINTS, corners=((0, 1, 9),))
    with pytest.raises(ArgumentError, match="no zero"):
        StatedMesh(points=POINTS, scale=(1.0, 0.0, 1.0))
    with pytest.raises(DescriptionError, match="one line"):
        _ = StatedMesh(points=((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (2.0, 0.0, 0.0))).triangles
    short = robot().to_urdf(geometry=True).replace('vertices="0.0 ', 'vertices="')
    with pytest.raises(
        DescriptionError, match="vertices of <collision> 1 of link 'a' has 11 numbers"
    ) as caught:
        dynx.load(short).geometry.collisions("a")
    assert caught.value.line is not None
