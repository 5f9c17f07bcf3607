"""Meshes of every format give the same triangles, and a damaged file one clear error."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from dynx.errors import DescriptionError, ModelError
from dynx.model.geometry import Mesh
from dynx.model.geometry import mesh_reading as mesh_module
from dynx.spatial.scalar import Floats
from tests.model.geometry.mesh_files import accessor, dae, gltf, obj, stl, text_stl

trimesh = pytest.importorskip("trimesh")

GOOD = {
    "binary.stl": stl(),
    "solid.stl": b"solid" + stl()[5:],
    "longer.stl": stl() + b"tail",
    "plain.obj": obj(),
    "lines_of_windows.obj": obj().replace(b"\n", b"\r\n"),
    "counted_back.obj": obj().replace(b"f 2 3 4", b"f -3 -2 -1"),
    "normals.obj": obj().replace(b"f 2 3 4", b"f 2//1 3/1/1 4/1"),
    "materials.obj": b"mtllib ../../../../etc/passwd\n" + obj("usemtl a\n"),
    "continued.obj": obj().replace(b"f 2 3 4", b"f 2 \\\n3 4"),
    "triangles.dae": dae(),
    "lists.dae": dae("polylist", vcount="3 3 3 3"),
    "real_numbers.dae": dae("polylist", vcount="3.0 3 3e0 3"),
    "signs_and_lines.dae": dae("polylist", vcount="+3\n\t 3\r\n003 3 "),
    "plain.gltf": gltf(),
    "image.gltf": gltf(images=[{"uri": "../../secret.png"}], textures=[{"source": 0}]),
}

DAMAGED = {
    "truncated.stl": (stl()[:-10], "it is truncated: 4 triangles take 284 bytes, and it has 274"),
    "announced.stl": (stl(announced=2**32 - 1), "it is truncated"),
    "empty.stl": (b"", "truncated"),
    "no_facet.stl": (stl(0), "holds no triangle"),
    "open_loop.stl": (text_stl(end=""), "3 corners in 0 closed loops"),
    "nan.stl": (text_stl("nan 0 0"), "vertex that is not finite"),
    "word.stl": (text_stl("zero 0 0"), "could not convert"),
    "range.obj": (obj("f 1 2 9\n"), "names vertex 9, and the file has 4"),
    "zero.obj": (obj("f 0 1 2\n"), "line 9: a face names vertex '0'"),
    "negative.obj": (obj("f -1 -2 -9\n"), "line 9: a face names vertex '-9'"),
    "short.obj": (b"v 0 0\n" + obj(), "line 1: a vertex has 2 numbers"),
    "line.obj": (obj("f 1 2\n"), "line 9: a face has 2 corners"),
    "nan.obj": (b"v nan 0 0\n" + obj(), "vertex that is not finite"),
    "huge.obj": (b"v 1e300 0 0\n" + obj(), "not below 1e"),
    "no_face.obj": (b"v 0 0 0\n", "holds no triangle"),
    "range.dae": (dae(p="0 2 1 0 1 9"), "names a point that is not among the 4"),
    "negative.dae": (dae(p="0 2 -1"), "names a point that is not among the 4"),
    "large.dae": (dae(p="0 2 99999999999999999999"), "names a point that is not among the 4"),
    "joined.dae": (dae(p="0 2 1-1"), "could not convert"),
    # Counts whose sum overflows to that of the corners.
    "sum.dae": (
        dae("polylist", vcount="9223372036854775807 9223372036854775807 14"),
        "number of corners is none of 0 to 12",
    ),
    "half.dae": (dae("polylist", vcount="3 3 3.5 2.5"), "number of corners is none of 0 to 12"),
    "nan.dae": (dae("polylist", vcount="3 3 3 nan"), "number of corners is none of 0 to 12"),
    "count.dae": (dae("polylist", vcount="3 3"), "has 12 corners, not 6"),
    "skew.dae": (dae(node="<skew>45 0 1 0 1 0 0</skew>"), "<skew> is not supported"),
    "entity.dae": (b"<!DOCTYPE a [<!ENTITY b 'c'>]>" + dae(), "document type"),
    "truncated.dae": (dae()[:-30], "COLLADA|not complete XML"),
    "truncated.gltf": (gltf()[:-30], "not JSON"),
    "range.gltf": (
        gltf(accessors=[accessor(0, 5126, 3, "VEC3"), accessor(1, 5125, 12, "SCALAR")]),
        "among its 3",
    ),
    "bomb.gltf": (
        gltf(accessors=[accessor(None, 5126, 10**9, "VEC3"), accessor(1, 5125, 12, "SCALAR")]),
        "more than 20000000 entries",
    ),
    "outside.gltf": (gltf(buffers=[{"byteLength": 96, "uri": "../secret.bin"}]), "outside the folder"),
    "elsewhere.gltf": (gltf(buffers=[{"byteLength": 96, "uri": "http://a/b"}]), "outside the folder"),
    "absent.gltf": (gltf(buffers=[{"byteLength": 96, "uri": "absent.bin"}]), "no such file"),
    "cycle.gltf": (gltf(nodes=[{"mesh": 0, "children": [0]}]), "in a cycle"),
    "shared.gltf": (gltf(nodes=[{"children": [2]}, {"children": [2]}, {"mesh": 0}]), "child of two nodes"),
    "short.gltf": (gltf(buffers=[{"byteLength": 960, "uri": "data:;base64,AAAA"}]), "960 are announced"),
    "head.glb": (b"glTF" + bytes(30), "not JSON"),
    "cloud.ply": (b"", "has the suffix '.ply'"),
}


def corners(mesh: Mesh) -> list[list[float]]:
    """Return the corners of the triangles, each triangle from its lowest corner, in order."""
    vertices, faces = mesh.triangles
    turned = [np.roll(each, -int(np.lexsort(each.T[::-1])[0]), axis=0) for each in vertices[faces]]
    return sorted(each.ravel().tolist() for each in turned)


def written(folder: Path, name: str, content: bytes) -> Mesh:
    (folder / name).write_bytes(content)
    return Mesh(str(folder / name))


@pytest.mark.parametrize("name", GOOD)
def test_every_format_gives_the_same_triangles(tmp_path: Path, name: str) -> None:
    found = corners(written(tmp_path, name, GOOD[name]))
    wanted = corners(written(tmp_path, "reference.stl", stl()))
    assert found == wanted


@pytest.mark.parametrize("name", DAMAGED)
def test_a_damaged_mesh_is_refused_by_name(tmp_path: Path, name: str) -> None:
    content, message = DAMAGED[name]
    mesh = written(tmp_path, name, content)
    with pytest.raises(ModelError, match=message) as caught:
        _ = mesh.triangles
    assert name in str(caught.value) or "absent.bin" in str(caught.value)


def test_what_is_no_file_is_not_read(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "endless.stl")
    for mesh in (Mesh(str(tmp_path / "endless.stl")), Mesh("/dev/zero.stl"), Mesh(str(tmp_path))):
        with pytest.raises(ModelError):
            _ = mesh.triangles


def test_a_file_above_the_limit_is_not_read(tmp_path: Path) -> None:
    with (tmp_path / "large.obj").open("wb") as file:
        file.truncate(65 * 1024**2)
    with pytest.raises(DescriptionError, match="larger than 64 MiB"):
        _ = Mesh(str(tmp_path / "large.obj")).triangles


def test_too_many_triangles_are_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mesh_module, "MAX_TRIANGLES", 3)
    with pytest.raises(DescriptionError, match="holds 4 triangles; at most 3"):
        _ = written(tmp_path, "a.stl", stl()).triangles


def test_a_file_that_changes_is_read_again(tmp_path: Path) -> None:
    assert len(written(tmp_path, "a.obj", obj()).triangles[1]) == 4
    assert len(written(tmp_path, "a.obj", obj("f 1 2 3\n")).triangles[1]) == 5


@pytest.mark.parametrize("kind", ["stl", "stl_ascii", "obj", "glb", "dae"])
def test_files_of_trimesh_read_back(tmp_path: Path, kind: str) -> None:
    solid = trimesh.creation.icosphere(subdivisions=1).apply_scale([1.0, 2.0, 3.0])
    if kind == "dae":
        pytest.importorskip("collada")
    suffix = "stl" if kind == "stl_ascii" else kind
    mesh = written(tmp_path, f"ball.{suffix}", _bytes(solid.export(file_type=kind)))
    vertices, faces = mesh.triangles
    again = trimesh.Trimesh(vertices, faces)
    assert np.allclose(again.bounds, solid.bounds, atol=1e-6)
    assert np.isclose(again.volume, solid.volume, rtol=1e-5)


def test_nodes_and_scales_place_and_mirror(tmp_path: Path) -> None:
    node = {"mesh": 0, "scale": [2, -2, 2], "translation": [1, 0, 0]}
    mirrored = written(tmp_path, "a.gltf", gltf(nodes=[node]))
    scaled = written(tmp_path, "b.stl", stl())
    plain = Mesh(scaled.file, (2.0, -2.0, 2.0))
    assert corners(mirrored) == sorted(
        np.add(np.reshape(each, (-1, 3)), [1, 0, 0]).ravel().tolist() for each in corners(plain)
    )
    assert volume(*plain.triangles) == pytest.approx(8.0)
    assert volume(*mirrored.triangles) == pytest.approx(8.0)


def volume(vertices: Floats, faces: np.ndarray[tuple[int, int], np.dtype[np.intp]]) -> float:
    """Return the signed volume of a closed surface."""
    return float(np.linalg.det(vertices[faces]).sum() / 6.0)


def _bytes(content: str | bytes) -> bytes:
    return content.encode() if isinstance(content, str) else content
