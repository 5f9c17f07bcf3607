"""Boxes of meshes: every format gives the box of the same corners."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynx.model.geometry.formats.collada import collada_points
from dynx.rules.geometry import Box, mesh_box
from dynx.spatial.scalar import Floats

Corner = tuple[float, float, float]

# Numbers that single precision holds, since binary STL does.
numbers = st.floats(-1000.0, 1000.0, width=32)
triangles = st.lists(st.tuples(*[st.tuples(numbers, numbers, numbers)] * 3), min_size=1, max_size=8)


def binary_stl(facets: list[tuple[Corner, ...]], head: bytes = b"") -> bytes:
    """Return a binary STL file."""
    body = b"".join(struct.pack("<12fH", 0, 0, 1, *np.ravel(facet), 0) for facet in facets)
    return head.ljust(80, b" ") + struct.pack("<I", len(facets)) + body


def ascii_stl(facets: list[tuple[Corner, ...]]) -> bytes:
    """Return a text STL file."""
    lines = ["solid part"]
    for facet in facets:
        corners = [f"      vertex {x!r} {y!r} {z!r}" for x, y, z in facet]
        lines += ["  facet normal 0 0 1", "    outer loop", *corners, "    endloop", "  endfacet"]
    return "\n".join([*lines, "endsolid part", ""]).encode()


def obj(facets: list[tuple[Corner, ...]]) -> bytes:
    """Return an OBJ file; normals and texture coordinates are no corners."""
    lines = ["# a part", "vn 5000 0 0", "vt 6000 0"]
    lines += [f"v {x!r} {y!r} {z!r}" for facet in facets for x, y, z in facet]
    return "\n".join([*lines, "f 1//1 2//1 3//1", ""]).encode()


def dae(facets: list[tuple[Corner, ...]], up: str = "Z_UP", node: str = "", unit: float = 1.0) -> bytes:
    """Return a COLLADA file whose one node holds `node` and the mesh."""
    numbers = " ".join(repr(value) for facet in facets for corner in facet for value in corner)
    count = 3 * len(facets)
    return f"""<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
  <asset><unit meter="{unit!r}"/><up_axis>{up}</up_axis></asset>
  <library_geometries><geometry id="part"><mesh>
    <source id="positions">
      <float_array id="numbers" count="{3 * count}">{numbers}</float_array>
      <technique_common><accessor source="#numbers" count="{count}" stride="3"/></technique_common>
    </source>
    <vertices id="corners"><input semantic="POSITION" source="#positions"/></vertices>
  </mesh></geometry></library_geometries>
  <library_visual_scenes><visual_scene id="scene"><node>{node}
    <instance_geometry url="#part"/>
  </node></visual_scene></library_visual_scenes>
</COLLADA>
""".encode()


def box_of(facets: list[tuple[Corner, ...]]) -> Box:
    """Return the box of all corners."""
    corners = np.array(facets).reshape(-1, 3)
    low, high = corners.min(axis=0).tolist(), corners.max(axis=0).tolist()
    return (low[0], low[1], low[2]), (high[0], high[1], high[2])


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return one folder for all examples; boxes are kept by path, so each example takes a name of its own."""
    return tmp_path_factory.mktemp("meshes")


@pytest.mark.parametrize(
    ("suffix", "write"), [("stl", binary_stl), ("STL", ascii_stl), ("obj", obj), ("dae", dae)]
)
@given(data=st.data())
def test_the_box_holds_all_corners_and_no_more(
    folder: Path, data: st.DataObject, suffix: str, write: object
) -> None:
    assert callable(write)
    facets = data.draw(triangles)
    path = folder / f"{len(list(folder.iterdir()))}.{suffix}"
    path.write_bytes(write(facets))
    assert mesh_box(path) == box_of(facets)


def test_a_binary_file_that_begins_with_solid(tmp_path: Path) -> None:
    facets: list[tuple[Corner, ...]] = [((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 2.0, 3.0))]
    path = tmp_path / "part.stl"
    path.write_bytes(binary_stl(facets, b"solid exported"))
    assert mesh_box(path) == ((0.0, 0.0, 0.0), (1.0, 2.0, 3.0))


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("a.stl", b"not a mesh"),
        ("b.stl", b""),
        ("c.stl", b"solid x\nvertex one two three\nendsolid"),
        ("d.obj", b"# no corner\n"),
        ("e.obj", b"v 1 2 nan\n"),
        ("f.dae", b"<COLLADA/>"),
        ("g.dae", b"<COLLADA><"),
        ("h.dae", b'<!DOCTYPE c [<!ENTITY a "a">]><COLLADA>&a;</COLLADA>'),
        ("i.ply", b"ply\n"),
    ],
)
def test_what_cannot_be_read_has_no_box(tmp_path: Path, name: str, content: bytes) -> None:
    path = tmp_path / name
    path.write_bytes(content)
    assert mesh_box(path) is None


def test_a_file_that_is_not_there_has_no_box(tmp_path: Path) -> None:
    assert mesh_box(tmp_path / "nothing.stl") is None


FACET: list[tuple[Corner, ...]] = [((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 2.0, 3.0))]


def points(data: bytes) -> Floats:
    """Return the points of a COLLADA file that can be read."""
    found = collada_points(data)
    assert found is not None
    return found


def test_nodes_move_turn_and_scale_in_the_order_written() -> None:
    node = "<translate>10 0 0</translate><rotate>0 0 1 90</rotate><scale>2 2 2</scale>"
    right = np.array([[10.0, 0.0, 0.0], [10.0, 2.0, 0.0], [6.0, 0.0, 6.0]])
    # cos of a right angle in floating point is off zero by less than one rounding of the numbers above.
    assert np.max(np.abs(points(dae(FACET, node=node)) - right)) <= 10.0 * np.finfo(float).eps


def test_a_matrix_and_a_unit() -> None:
    node = "<matrix>1 0 0 5  0 1 0 6  0 0 1 7  0 0 0 1</matrix>"
    found = points(dae(FACET, node=node, unit=0.5)).tolist()
    assert found == [[2.5, 3.0, 3.5], [3.0, 3.0, 3.5], [2.5, 4.0, 5.0]]


@pytest.mark.parametrize(
    ("up", "turned"), [("Y_UP", [0.0, -3.0, 2.0]), ("X_UP", [-2.0, -3.0, 0.0]), ("Z_UP", None)]
)
def test_a_file_that_is_not_z_up_is_taken_both_ways(up: str, turned: list[float] | None) -> None:
    found = points(dae(FACET, up=up)).tolist()
    assert [0.0, 2.0, 3.0] in found
    assert len(found) == (3 if turned is None else 6)
    assert turned is None or turned in found


@pytest.mark.parametrize(
    "node",
    [
        "<lookat>0 0 0 1 0 0 0 0 1</lookat>",
        '<instance_controller url="#skin"/>',
        '<instance_node url="other.dae#part"/>',
        '<instance_node url="#missing"/>',
        "<matrix>1 2 3</matrix>",
    ],
)
def test_what_the_reader_does_not_follow_gives_no_box(tmp_path: Path, node: str) -> None:
    path = tmp_path / "part.dae"
    path.write_bytes(dae(FACET, node=node))
    assert mesh_box(path) is None
