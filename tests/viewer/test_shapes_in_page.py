"""Shapes in the page: reduced meshes, pieces of a concave mesh, and edges as sharp as the file says."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import dynx
from dynx.model.geometry import Mesh
from dynx.model.geometry.convex_pieces import convex_decomposition, mesh_objects
from dynx.spatial.scalar import Floats
from dynx.steppers.camera import Camera
from dynx.viewer import Viewer
from tests.conftest import needs_examples
from tests.viewer.conftest import PATIENCE, OpenPage, connected, until, without_surroundings
from tests.viewer.test_page import drawn_silhouette, rendered_silhouette

SAME = 0.93
"""Share of the pixels of a silhouette that a reduced and a whole mesh have in common."""


@needs_examples
def test_a_reduced_robot_has_the_silhouette_of_the_whole_one(open_page: OpenPage) -> None:
    model = dynx.load("ur5")
    camera = Camera.look_at((1.3, -1.3, 0.8), (0.2, 0.0, 0.3), size=(320, 240))
    with model.view(whole_meshes=False) as viewer:
        drawn, whole = viewer.view.robot._shapes._reduced
        assert drawn < 0.5 * whole
        without_surroundings(viewer)
        page = open_page(viewer.url)
        q = model.random(1)
        viewer.view.put(q)
        expected = drawn_silhouette(model, q, camera)

        def common() -> float:
            found = rendered_silhouette(viewer, camera)
            return float((found & expected).sum() / (found | expected).sum())

        until(lambda: common() > SAME, "the silhouette of the whole meshes")
        assert not page.errors


def channel(folder: Path, *, objects: bool) -> Mesh:
    """Return a mesh of a channel, open towards +y: three boards around a hollow, as three objects or one."""
    outlines = (
        [[(0, 0), (1, 0), (1, 0.1), (0, 0.1)]]
        + [[(x, 0.1), (x + 0.1, 0.1), (x + 0.1, 0.8), (x, 0.8)] for x in (0, 0.9)]
        if objects
        else [[(0, 0), (1, 0), (1, 0.8), (0.9, 0.8), (0.9, 0.1), (0.1, 0.1), (0.1, 0.8), (0, 0.8)]]
    )
    caps = [[(0, 1, 2, 3)]] * 3 if objects else [[(0, 1, 4, 5), (1, 2, 3, 4), (0, 5, 6, 7)]]
    lines, first = [], 1
    for number, (outline, ends) in enumerate(zip(outlines, caps, strict=True)):
        n = len(outline)
        lines.append(f"o board{number}")
        lines += [f"v {x} {y} {z}" for z in (0.0, 0.5) for x, y in outline]
        lines += ["f " + " ".join(str(first + k) for k in reversed(quad)) for quad in ends]
        lines += ["f " + " ".join(str(first + n + k) for k in quad) for quad in ends]
        sides = [(k, (k + 1) % n, (k + 1) % n + n, k + n) for k in range(n)]
        lines += ["f " + " ".join(str(first + k) for k in quad) for quad in sides]
        first += 2 * n
    (folder / "channel.obj").write_text("\n".join(lines) + "\n")
    return Mesh(str(folder / "channel.obj"))


@pytest.mark.parametrize("how", ["objects", "decomposition", "whole"])
def test_the_hollow_of_a_concave_mesh_is_open_where_its_pieces_collide(
    open_page: OpenPage, tmp_path: Path, how: str
) -> None:
    if how == "decomposition":
        pytest.importorskip("coacd")
    whole = channel(tmp_path, objects=how == "objects")
    divide = {"objects": mesh_objects, "decomposition": convex_decomposition}.get(how)
    pieces = divide(whole, tmp_path / "pieces") if divide else (whole,)
    files = [Path(piece.file).relative_to(tmp_path) for piece in pieces]
    shapes = [f'<geometry><mesh filename="{file}"/></geometry>' for file in files]
    described = "".join(f"<collision>{shape}</collision>" for shape in shapes)
    (tmp_path / "channel.urdf").write_text(f'<robot name="c"><link name="base">{described}</link></robot>')
    hollow, board = np.array([0.5, 0.45, 0.5]), np.array([0.05, 0.45, 0.5])
    camera = Camera.look_at((0.5, 0.45, 3.0), (0.5, 0.45, 0.0), up=(0.0, 1.0, 0.0), size=(320, 240))
    with dynx.load(tmp_path / "channel.urdf").view(collisions=True) as viewer:
        without_surroundings(viewer)
        page = open_page(viewer.url)
        connected(viewer)

        def seen() -> Any:
            return rendered_silhouette(viewer, camera, 0.2)

        until(lambda: seen()[pixel(camera, board)], "a board")
        # One hull of the whole mesh, as engines collide it, has no hollow.
        assert bool(seen()[pixel(camera, hollow)]) == (how == "whole")
        assert not page.errors


def pixel(camera: Camera, point: Floats) -> tuple[int, int]:
    """Return row and column at which a camera sees a point (3,)."""
    x, y, z = np.linalg.inv(camera.pose.matrix)[:3] @ [*point, 1.0]
    width, height = camera.size
    focal = 0.5 * height / math.tan(0.5 * camera.field_of_view)
    return round(0.5 * height + focal * y / z), round(0.5 * width + focal * x / z)


def roof(folder: Path, *, smooth: bool) -> Path:
    """Return a file that describes a roof of two squares at a right angle, smooth or sharp at its ridge."""
    lines = ["v -1 -1 0", "v 1 -1 0", "v 1 0 1", "v -1 0 1", "v 1 1 0", "v -1 1 0"]
    lines += ["s 1" if smooth else "s off", "f 1 2 3", "f 1 3 4", "f 4 3 5", "f 4 5 6"]
    (folder / "roof.obj").write_text("\n".join(lines))
    (folder / "roof.urdf").write_text(
        '<robot name="roof"><link name="base"><visual><geometry><mesh filename="roof.obj"/></geometry>'
        '<material name="grey"><color rgba="0.5 0.5 0.5 1"/></material></visual></link></robot>'
    )
    return folder / "roof.urdf"


def step_at_the_ridge(viewer: Viewer) -> float:
    """Return the change of brightness across the ridge, as a share of that between the eaves."""
    (client,) = connected(viewer)
    # Straight from above, the ridge is the line in the middle.
    picture: Any = client.get_render(
        height=240,
        width=240,
        wxyz=(0.0, 1.0, 0.0, 0.0),
        position=(0.0, 0.0, 5.0),
        fov=0.5,
        transport_format="png",
        timeout=PATIENCE,
    )
    grey = picture[..., :3].mean(axis=2)
    column = grey[:, 100:140].mean(axis=1)[picture[:, 120, 3] > 127]
    assert len(column) > 100
    middle, far = len(column) // 2, len(column) // 2 - 5
    whole = abs(column[middle - far] - column[middle + far])
    return float(abs(column[middle - 4] - column[middle + 4]) / max(whole, 1.0))


@pytest.mark.long_cases
@pytest.mark.parametrize("smooth", [True, False])
@pytest.mark.parametrize("software", [True, False])
def test_an_edge_is_as_sharp_as_its_file_says(
    open_page: OpenPage, tmp_path: Path, smooth: bool, software: bool
) -> None:
    with dynx.load(roof(tmp_path, smooth=smooth)).view(whole_meshes=not software) as viewer:
        without_surroundings(viewer)
        page = open_page(viewer.url)

        def as_wanted() -> bool:
            step = step_at_the_ridge(viewer)
            return step < 0.3 if smooth else step > 0.8

        until(as_wanted, "the edge as its file has it")
        assert not page.errors
