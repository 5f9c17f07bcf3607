"""Images, colours of corners and normals of meshes in every format, and files that cannot be shown."""

from __future__ import annotations

import base64
import io
import json
import struct
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

import dynx
from dynx.model.geometry import Appearance, Box, Cylinder, Ellipsoid, Mesh, Shape, Sphere, Visual
from dynx.model.geometry.drawn_shapes import coloured_shapes, look_notes
from dynx.model.geometry.images import MAX_PIXELS, Texture, read_texture

Image = pytest.importorskip("PIL.Image")

GREY = (0.5, 0.5, 0.5, 1.0)
PIXELS = np.array([[[255, 0, 0], [0, 255, 0]], [[0, 0, 255], [250, 240, 10]]], np.uint8)
"""An image: red and green above blue and yellow."""

SQUARE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], np.float32)
UV = SQUARE[:, :2]
FACES = np.array([[0, 1, 2], [0, 2, 3]], np.uint32)
LEAN = np.array([0.6, 0.0, 0.8], np.float32)
"""A normal that is none of the flat square's."""


def png(pixels: np.ndarray[tuple[int, ...], np.dtype[np.uint8]] = PIXELS) -> bytes:
    stream = io.BytesIO()
    Image.fromarray(pixels).save(stream, format="PNG")
    return stream.getvalue()


def obj_square(image: str = "picture.png") -> dict[str, bytes]:
    """Return an OBJ file of the square, its materials and their image, by name."""
    lines = [f"v {x} {y} {z}" for x, y, z in SQUARE.tolist()]
    lines += [f"vt {u} {v}" for u, v in UV.tolist()]
    lines += ["vn 0.6 0 0.8", "mtllib square.mtl", "usemtl m", "f 1/1/1 2/2/1 3/3/1 4/4/1"]
    material = f"newmtl m\nKd 0.2 0.3 0.4\nmap_Kd -s 1 1 1 {image}\n"
    return {
        "square.obj": "\n".join(lines).encode(),
        "square.mtl": material.encode(),
        "picture.png": png(),
    }


def collada_square(image: str = "picture.png") -> dict[str, bytes]:
    """Return a COLLADA file of the square and its image, by name."""

    def source(name: str, values: NDArray[Any], width: int) -> str:
        numbers = " ".join(map(repr, values.reshape(-1).tolist()))
        return (
            f'<source id="{name}"><float_array id="{name}a" count="{values.size}">{numbers}</float_array>'
            f'<technique_common><accessor source="#{name}a" count="{len(values)}" stride="{width}"/>'
            "</technique_common></source>"
        )

    corners = " ".join(f"{k} 0 {k}" for k in range(4))
    text = (
        '<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1"><asset/>'
        f'<library_images><image id="i"><init_from>{image}</init_from></image></library_images>'
        '<library_effects><effect id="e"><profile_COMMON>'
        '<newparam sid="f"><surface type="2D"><init_from>i</init_from></surface></newparam>'
        '<newparam sid="s"><sampler2D><source>f</source></sampler2D></newparam>'
        '<technique sid="t"><lambert><diffuse><texture texture="s" texcoord="UV"/></diffuse></lambert>'
        "</technique></profile_COMMON></effect></library_effects>"
        '<library_materials><material id="m"><instance_effect url="#e"/></material></library_materials>'
        '<library_geometries><geometry id="g"><mesh>'
        + source("p", SQUARE, 3)
        + source("n", LEAN[None], 3)
        + source("u", UV, 2)
        + '<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>'
        '<polylist count="1" material="a"><input semantic="VERTEX" source="#v" offset="0"/>'
        '<input semantic="NORMAL" source="#n" offset="1"/>'
        '<input semantic="TEXCOORD" source="#u" offset="2" set="0"/>'
        f"<vcount>4</vcount><p>{corners}</p></polylist></mesh></geometry></library_geometries>"
        '<library_visual_scenes><visual_scene id="w"><node><instance_geometry url="#g"><bind_material>'
        '<technique_common><instance_material symbol="a" target="#m">'
        '<bind_vertex_input semantic="UV" input_semantic="TEXCOORD" input_set="0"/></instance_material>'
        "</technique_common></bind_material></instance_geometry></node></visual_scene></library_visual_scenes>"
        "</COLLADA>"
    )
    return {"square.dae": text.encode(), "picture.png": png()}


def gltf_square(image: str = "picture.png", factor: tuple[float, ...] = (1, 1, 1, 1)) -> dict[str, bytes]:
    """Return a glTF file of the square and its image, by name."""
    parts: list[NDArray[Any]] = [SQUARE, np.tile(LEAN, (4, 1)), UV * [1, -1] + [0, 1], FACES.reshape(-1)]
    contents = [each.astype(np.uint32 if k == 3 else np.float32).tobytes() for k, each in enumerate(parts)]
    starts = np.cumsum([0, *map(len, contents)]).tolist()
    kinds = [("VEC3", 4, 5126), ("VEC3", 4, 5126), ("VEC2", 4, 5126), ("SCALAR", 6, 5125)]
    uri = "data:application/octet-stream;base64," + base64.b64encode(b"".join(contents)).decode()
    tree = {
        "asset": {"version": "2.0"},
        "buffers": [{"byteLength": starts[-1], "uri": uri}],
        "bufferViews": [
            {"buffer": 0, "byteOffset": start, "byteLength": len(each)}
            for start, each in zip(starts, contents, strict=False)
        ],
        "accessors": [
            {"bufferView": k, "componentType": number, "count": count, "type": kind}
            for k, (kind, count, number) in enumerate(kinds)
        ],
        "images": [{"uri": image}],
        "textures": [{"source": 0}],
        "materials": [
            {
                "pbrMetallicRoughness": {
                    "baseColorFactor": list(factor),
                    "baseColorTexture": {"index": 0},
                }
            }
        ],
        "meshes": [
            {
                "primitives": [
                    {
                        "attributes": {"POSITION": 0, "NORMAL": 1, "TEXCOORD_0": 2},
                        "indices": 3,
                        "material": 0,
                    }
                ]
            }
        ],
        "nodes": [{"mesh": 0}],
        "scenes": [{"nodes": [0]}],
        "scene": 0,
    }
    return {"square.gltf": json.dumps(tree).encode(), "picture.png": png()}


SQUARES = {"square.obj": obj_square, "square.dae": collada_square, "square.gltf": gltf_square}


def written(folder: Path, files: dict[str, bytes]) -> None:
    for name, content in files.items():
        (folder / name).write_bytes(content)


def square_in(folder: Path, name: str, image: str = "picture.png") -> Mesh:
    if name.endswith(".gltf"):
        pytest.importorskip("trimesh")
    written(folder, SQUARES[name](image))
    return Mesh(str(folder / name), (2.0, 2.0, 2.0))


@pytest.mark.parametrize("name", SQUARES)
def test_every_format_gives_the_same_image_and_normals(tmp_path: Path, name: str) -> None:
    mesh = square_in(tmp_path, name)
    ((part, look),) = mesh.parts
    surface = part.surface
    assert look.is_varied
    assert not mesh.notes
    assert surface.texture is not None
    assert surface.uv is not None
    assert surface.normals is not None
    assert np.array_equal(surface.texture.pixels, PIXELS)
    assert np.allclose(surface.uv, surface.vertices[surface.faces][..., :2] / 2.0)
    assert np.allclose(surface.normals, LEAN)
    assert np.array_equal(surface.vertices[surface.faces], mesh.triangles[0][mesh.triangles[1]])


@pytest.mark.parametrize("scale", [(-2.0, 1.0, 1.0), (1.0, -1.0, -3.0), (1.0, 1.0, 0.5)])
@pytest.mark.parametrize("name", SQUARES)
def test_scales_and_mirrors_keep_image_and_normals_on_the_surface(
    tmp_path: Path, name: str, scale: tuple[float, float, float]
) -> None:
    mesh = Mesh(square_in(tmp_path, name).file, scale)
    surface = mesh.parts[0][0].surface
    assert surface.uv is not None
    assert surface.normals is not None
    corners = surface.vertices[surface.faces]
    assert np.allclose(surface.uv, corners[..., :2] / np.array(scale)[:2])
    expected = LEAN / np.array(scale)
    assert np.allclose(surface.normals, expected / np.linalg.norm(expected))
    assert np.array_equal(corners, mesh.triangles[0][mesh.triangles[1]])


REFUSED = {
    "absent.png": "no such file",
    "../../outside.png": "outside the folder",
    "/etc/hostname": "outside the folder",
    "damaged.png": "cannot be read",
    "huge.png": "pixels; at most",
    "empty.png": "cannot be read: it is none of PNG, JPEG",
    "https://evil.test/absent.png": "dynx reads no 'https://'",
}


@pytest.mark.parametrize("image", REFUSED)
@pytest.mark.parametrize("name", SQUARES)
def test_an_image_that_cannot_be_shown_is_named(tmp_path: Path, name: str, image: str) -> None:
    inside = tmp_path / "package" / "meshes"
    inside.mkdir(parents=True)
    (tmp_path / "package" / "package.xml").write_text("<package><name>package</name></package>")
    (tmp_path / "outside.png").write_bytes(png())
    (inside / "damaged.png").write_bytes(png()[:40])
    (inside / "empty.png").write_bytes(b"")
    head = struct.pack(">IIBBBBB", 2**13, 2**13, 8, 2, 0, 0, 0)
    crc = struct.pack(">I", zlib.crc32(b"IHDR" + head))
    (inside / "huge.png").write_bytes(png()[:16] + head + crc + png()[33:])
    image = image.replace("../../", "../../../") if image.startswith("..") else image
    mesh = square_in(inside, name, image)
    colours = [rgba for _, rgba, _ in coloured_shapes(Visual(mesh), None, GREY)]
    # The colour of the material is left, where the format has one beside the image.
    assert colours == [{"square.obj": (0.2, 0.3, 0.4, 1.0), "square.gltf": (1, 1, 1, 1)}.get(name, GREY)]
    (note,) = look_notes(Visual(mesh))
    assert name in note
    assert REFUSED.get(image, "outside the folder") in note


def test_an_image_beside_the_mesh_is_found_by_its_name(tmp_path: Path) -> None:
    mesh = square_in(tmp_path, "square.dae", "file:///C:/work/of/somebody/picture.png")
    assert mesh.parts[0][1].texture is not None
    (tmp_path / "package.xml").write_text("<package><name>here</name></package>")
    for folder in ("meshes", "textures"):
        (tmp_path / folder).mkdir()
    mesh = square_in(tmp_path / "meshes", "square.obj", "../textures/picture.png")
    (tmp_path / "meshes" / "picture.png").rename(tmp_path / "textures" / "picture.png")
    assert mesh.parts[0][1].texture is not None


def test_no_image_is_read_beyond_the_largest() -> None:
    side = int(np.sqrt(MAX_PIXELS)) + 1
    for kind in ("PNG", "JPEG", "BMP", "GIF"):
        stream = io.BytesIO()
        Image.new("L", (side, side)).save(stream, format=kind)
        with pytest.raises(ValueError, match="pixels; at most"):
            read_texture(stream.getvalue())


PLACES = st.tuples(st.floats(-3.0, 3.0), st.floats(-3.0, 3.0))


@given(PLACES)
def test_an_image_repeats_and_is_read_at_the_middle_of_its_pixels(place: tuple[float, float]) -> None:
    texture = Texture(PIXELS)
    column, row = (int(np.floor(2.0 * share)) % 2 for share in place)
    middle = np.array([[np.floor(2.0 * share) / 2.0 + 0.25 for share in place]])
    assert np.allclose(255.0 * texture.colours(middle, np.ones(1)), PIXELS[1 - row, column])
    clamped = Texture(PIXELS, (False, False))
    outside = np.array([[10.0 * np.sign(share - 0.5) for share in place]])
    expected = PIXELS[0 if outside[0, 1] > 0 else 1, 1 if outside[0, 0] > 0 else 0]
    assert np.allclose(255.0 * clamped.colours(outside, np.ones(1)), expected)


@given(st.integers(1, 9), st.integers(1, 9), st.integers(0, 2**32 - 1))
def test_seen_from_afar_an_image_has_its_mean_colour(height: int, width: int, seed: int) -> None:
    pixels = np.random.default_rng(seed).integers(0, 256, (2**height, 2**width, 3)).astype(np.uint8)
    far = 255.0 * Texture(pixels).colours(np.full((1, 2), 0.5), np.full(1, 1e9))
    level = Texture(pixels).levels[-1]
    assert min(level.shape[:2]) == 1
    assert np.abs(level.mean(axis=(0, 1)) - pixels.mean(axis=(0, 1))).max() < 0.5 * len(
        Texture(pixels).levels
    )
    assert (far >= level.min(axis=(0, 1)) - 1e-9).all()
    assert (far <= level.max(axis=(0, 1)) + 1e-9).all()


def test_base_colours_of_gltf_are_amounts_of_light(tmp_path: Path) -> None:
    pytest.importorskip("trimesh")
    written(tmp_path, gltf_square("absent.png", (0.214041, 0.5, 1.0, 0.3)))
    (_, look) = Mesh(str(tmp_path / "square.gltf")).parts[0]
    assert look.rgba is not None
    assert look.rgba == pytest.approx((0.5, 0.735357, 1.0, 1.0), abs=1e-5)


@pytest.mark.parametrize("smooth", [True, False])
def test_smoothing_groups_make_edges_smooth(tmp_path: Path, smooth: bool) -> None:
    lines = ["v 0 0 0", "v 1 0 0", "v 0 1 0", "v 0 0 1", "s 1" if smooth else "s off", "f 1 3 2", "f 1 2 4"]
    (tmp_path / "fold.obj").write_text("\n".join(lines))
    normals = Mesh(str(tmp_path / "fold.obj")).surface.normals
    if not smooth:
        assert normals is None
    else:
        assert normals is not None
        assert np.allclose(normals[0, 0], normals[1, 0])
        assert np.allclose(normals[0, 0, 1:], -np.sqrt(0.5))
        assert np.allclose(normals[0, 1], [0.0, 0.0, -1.0])
        assert np.allclose(normals[1, 2], [0.0, -1.0, 0.0])


def test_vertices_of_an_obj_file_may_have_colours(tmp_path: Path) -> None:
    lines = ["v 0 0 0 1 0 0", "v 1 0 0 0 1 0", "v 0 1 0 0 0.5 1", "f 1 2 3"]
    (tmp_path / "a.obj").write_text("\n".join(lines))
    ((mesh, look),) = Mesh(str(tmp_path / "a.obj")).parts
    assert look.is_varied
    colours = mesh.surface.colours
    assert colours is not None
    assert np.array_equal(colours, np.array([[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.5, 1.0]]]))


@pytest.mark.parametrize("materialise", [True, False])
def test_facets_of_stl_files_may_have_colours(tmp_path: Path, materialise: bool) -> None:
    head = b"COLOR=" + bytes([10, 20, 30, 255]) if materialise else b"colours"
    red = 31 if materialise else 31 << 10 | 1 << 15
    facets = b"".join(struct.pack("<12fH", *range(12), each) for each in (red, 1 << 15 if materialise else 0))
    (tmp_path / "a.stl").write_bytes(head.ljust(80) + struct.pack("<I", 2) + facets)
    found = {look.rgba: part.surface.faces.tolist() for part, look in Mesh(str(tmp_path / "a.stl")).parts}
    other = (10 / 255, 20 / 255, 30 / 255, 1.0) if materialise else None
    assert found == {(1.0, 0.0, 0.0, 1.0): [[0, 1, 2]], other: [[0, 1, 2]]}


def test_empty_attributes_of_stl_files_are_no_colours(tmp_path: Path) -> None:
    facet = struct.pack("<12fH", *range(12), 0)
    (tmp_path / "a.stl").write_bytes(b"COLOR=\xff\xff\xff\xff".ljust(80) + struct.pack("<I", 1) + facet)
    ((_, look),) = Mesh(str(tmp_path / "a.stl")).parts
    assert look.rgba is None
    assert not look.is_varied


@pytest.mark.parametrize(
    "shape", [Box((1.0, 2.0, 3.0)), Sphere(0.5), Cylinder(0.5, 2.0), Ellipsoid((1.0, 0.5, 2.0))]
)
def test_images_of_urdf_materials_lie_on_primitives(tmp_path: Path, shape: Shape) -> None:
    (tmp_path / "picture.png").write_bytes(png())
    visual = Visual(shape, material=Appearance("a", None, str(tmp_path / "picture.png")))
    ((drawn, rgba, _),) = coloured_shapes(visual, None, GREY)
    assert isinstance(drawn, Mesh)
    assert rgba == (1.0, 1.0, 1.0, 1.0)
    assert not look_notes(visual)
    vertices, faces = drawn.triangles
    volume = float(np.linalg.det(vertices[faces]).sum() / 6.0)
    exact = dynx.model.geometry.solid_properties(shape).volume
    assert 0.99 * exact < volume <= exact * (1.0 + 1e-9)
    uv = drawn.surface.uv
    assert uv is not None
    assert uv.min() >= 0.0
    assert uv.max() <= 1.0
    absent = Visual(shape, material=Appearance("a", (1.0, 0.0, 0.0, 1.0), str(tmp_path / "absent.png")))
    assert [rgba for _, rgba, _ in coloured_shapes(absent, None, GREY)] == [(1.0, 0.0, 0.0, 1.0)]
    assert "absent.png" in look_notes(absent)[0]


def test_the_image_of_a_named_material_is_found_in_the_package(tmp_path: Path) -> None:
    (tmp_path / "picture.png").write_bytes(png())
    (tmp_path / "a.urdf").write_text(
        '<robot name="a"><link name="l"><visual><geometry><box size="1 1 1"/></geometry><material name="m"/>'
        '</visual></link><material name="m"><texture filename="picture.png"/></material></robot>'
    )
    model = dynx.load(tmp_path / "a.urdf")
    (visual,) = model.geometry.visuals("l")
    ((drawn, _, _),) = coloured_shapes(visual, None, GREY)
    assert isinstance(drawn, Mesh)
    assert drawn.surface.texture is not None


OUTSIDE = ("../outside.png", "/{folder}/outside.png", "file:///{folder}/outside.png", "absent.png")


@pytest.mark.parametrize("name", OUTSIDE)
def test_no_image_of_a_material_is_read_outside_of_the_package(tmp_path: Path, name: str) -> None:
    (tmp_path / "outside.png").write_bytes(png())
    (tmp_path / "inside").mkdir()
    name = name.format(folder=str(tmp_path).lstrip("/"))
    (tmp_path / "inside" / "a.urdf").write_text(
        '<robot name="a"><link name="l"><visual><geometry><box size="1 1 1"/></geometry>'
        f'<material name="m"><texture filename="{name}"/></material></visual></link></robot>'
    )
    model = dynx.load(tmp_path / "inside" / "a.urdf")
    (visual,) = model.geometry.visuals("l")
    assert visual.material is not None
    assert visual.material.texture == name
    assert [shape for shape, _, _ in coloured_shapes(visual, None, GREY)] == [Box((1.0, 1.0, 1.0))]
    (note,) = look_notes(visual)
    assert "is not shown" in note
