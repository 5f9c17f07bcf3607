"""Meshes are drawn in the colours of the materials of their files, COLLADA and OBJ."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import dynx
from dynx.model import Link, Model
from dynx.model.geometry import Appearance, Box, Collision, Geometry, LinkGeometry, Mesh, Visual
from dynx.model.geometry.drawn_shapes import coloured_shapes, link_shapes
from dynx.model.geometry.links import Colour
from dynx.spatial.scalar import Floats
from dynx.steppers.camera import Camera
from dynx.steppers.registry import installed_worlds
from dynx.world import Scene, SceneBody, SceneRobot, World
from tests.conftest import needs_examples

SHARES = st.integers(0, 255).map(lambda value: value / 255.0)
COLOURS = st.tuples(SHARES, SHARES, SHARES)
FACES = st.lists(st.integers(0, 3), min_size=1, max_size=20)


def obj_in_colours(uses: list[int], library: str = "colours.mtl") -> str:
    """Return an OBJ file with a triangle at each height, of the material named; 3 is none that is known."""
    lines = [f"mtllib {library}"]
    for height, number in enumerate(uses):
        lines += [f"v {x} {y} {height}" for x, y in ((0, 0), (1, 0), (0, 1))]
        lines += [f"usemtl colour {number}", "f -3 -2 -1"]
    return "\n".join(lines) + "\n"


def colours_by_height(mesh: Mesh) -> dict[int, Colour | None]:
    """Return the colour of the triangle at each height."""
    found: dict[int, Colour | None] = {}
    for part, look in mesh.parts:
        colour = look.rgba
        vertices, faces = part.triangles
        assert len(np.unique(faces)) == len(vertices)
        for face in faces:
            height = round(float(vertices[face, 2].mean()))
            assert height not in found
            found[height] = colour
    return found


@given(FACES, st.lists(COLOURS, min_size=3, max_size=3), SHARES)
def test_each_triangle_of_an_obj_file_has_the_colour_of_its_material(
    uses: list[int], colours: list[tuple[float, float, float]], opacity: float
) -> None:
    with TemporaryDirectory() as folder:
        library = [
            f"newmtl colour {k}\nKa 1 1 1\nKd {r!r} {g!r} {b!r}" for k, (r, g, b) in enumerate(colours)
        ]
        (Path(folder) / "colours.mtl").write_text("\n".join([*library, f"d {opacity!r}", ""]))
        (Path(folder) / "mesh.obj").write_text(obj_in_colours(uses))
        mesh = Mesh(str(Path(folder) / "mesh.obj"))
        given_colours = [(*colours[0], 1.0), (*colours[1], 1.0), (*colours[2], opacity), None]
        found = colours_by_height(mesh)
        assert found == {height: given_colours[number] for height, number in enumerate(uses)}
        assert sum(len(part.triangles[1]) for part, _ in mesh.parts) == len(mesh.triangles[1])


@given(SHARES, SHARES)
def test_the_opacity_of_a_material_is_given_or_what_its_transparency_leaves(one: float, other: float) -> None:
    clear = 1.0 - one
    with TemporaryDirectory() as folder:
        lines = {
            f"d {one!r}": one,
            f"Tr {clear!r}": 1.0 - clear,
            f"Tr {other!r}\nd {one!r}": one,
            "Tr 0.25 0.5 0.75": 0.75,
        }
        library = [f"newmtl colour {k}\nKd 1 0 0\n{line}" for k, line in enumerate(lines)]
        (Path(folder) / "colours.mtl").write_text("\n".join([*library, ""]))
        (Path(folder) / "mesh.obj").write_text(obj_in_colours([*range(len(lines))]))
        found = colours_by_height(Mesh(str(Path(folder) / "mesh.obj")))
        assert found == {k: (1.0, 0.0, 0.0, alpha) for k, alpha in enumerate(lines.values())}


@pytest.mark.parametrize("library", ["absent.mtl", "../outside.mtl", "/etc/hostname", "damaged.mtl"])
def test_a_library_that_gives_no_colour_leaves_the_triangles_without(tmp_path: Path, library: str) -> None:
    folder = tmp_path / "inside"
    folder.mkdir()
    (tmp_path / "outside.mtl").write_text("newmtl colour 0\nKd 1 0 0\n")
    (folder / "damaged.mtl").write_bytes(b"Kd\nnewmtl colour 0\nKd red\nKd 1 2\nd\n\xff\xfe\n")
    (folder / "mesh.obj").write_text(obj_in_colours([0, 0], library))
    mesh = Mesh(str(folder / "mesh.obj"))
    assert set(colours_by_height(mesh).values()) == {None}
    assert any(library in note for note in mesh.notes) or library == "damaged.mtl"


COLLADA = """<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><unit meter="1"/><up_axis>Z_UP</up_axis></asset>
<library_effects>
<effect id="red"><profile_COMMON><technique sid="t"><phong><ambient><color>0 1 0 1</color></ambient>
<diffuse><color>0.8 0.1 0.2 0.5</color></diffuse></phong></technique></profile_COMMON></effect>
<effect id="blue"><profile_COMMON><technique sid="t"><lambert><diffuse><color>0 0.25 1.5</color></diffuse>
</lambert></technique></profile_COMMON></effect>
<effect id="picture"><profile_COMMON><technique sid="t"><phong><diffuse><texture texture="a" texcoord="b"/>
</diffuse></phong></technique></profile_COMMON></effect></library_effects>
<library_materials><material id="m1"><instance_effect url="#red"/></material>
<material id="m2"><instance_effect url="#blue"/></material>
<material id="m3"><instance_effect url="#picture"/></material></library_materials>
<library_geometries><geometry id="g"><mesh><source id="s">
<float_array id="a" count="36">{points}</float_array>
<technique_common><accessor source="#a" count="12" stride="3"/></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#s"/></vertices>{primitives}</mesh></geometry>
</library_geometries><library_visual_scenes><visual_scene id="w"><node><instance_geometry url="#g">
<bind_material><technique_common><instance_material symbol="one" target="#m1"/>
<instance_material symbol="two" target="#m2"/><instance_material symbol="three" target="#m3"/>
<instance_material symbol="lost" target="#m9"/></technique_common></bind_material></instance_geometry></node>
</visual_scene></library_visual_scenes></COLLADA>"""


def test_each_triangle_of_a_collada_file_has_the_diffuse_colour_bound_to_it(tmp_path: Path) -> None:
    points = " ".join(f"{x} {y} {height}" for height in range(4) for x, y in ((0, 0), (1, 0), (0, 1)))
    primitives = "".join(
        f'<triangles count="1" material="{symbol}"><input semantic="VERTEX" source="#v" offset="0"/>'
        f"<p>{3 * height} {3 * height + 1} {3 * height + 2}</p></triangles>"
        for height, symbol in enumerate(("one", "two", "three", "lost"))
    )
    (tmp_path / "mesh.dae").write_text(COLLADA.format(points=points, primitives=primitives))
    found = colours_by_height(Mesh(str(tmp_path / "mesh.dae"), (2.0, 2.0, 1.0)))
    assert found == {0: (0.8, 0.1, 0.2, 1.0), 1: (0.0, 0.25, 1.0, 1.0), 2: None, 3: None}


@needs_examples
@pytest.mark.filterwarnings("ignore")
def test_the_materials_of_panda_are_those_that_pycollada_reads() -> None:
    collada = pytest.importorskip("collada")
    model, compared = dynx.load("panda"), 0
    for link in model.links:
        for visual in model.geometry.visuals(link.name):
            shape = visual.shape
            if not isinstance(shape, Mesh) or not shape.name.endswith(".dae"):
                continue
            read = collada.Collada(shape.file, ignore=[collada.common.DaeUnsupportedError])
            expected: dict[Colour, int] = {}
            for geometry in read.scene.objects("geometry"):
                for primitive in geometry.primitives():
                    if isinstance(primitive, collada.lineset.BoundLineSet):
                        continue
                    triangles = primitive.triangleset() if hasattr(primitive, "triangleset") else primitive
                    red, green, blue = primitive.material.effect.diffuse[:3]
                    colour = (red, green, blue, 1.0)
                    expected[colour] = expected.get(colour, 0) + len(triangles)
            found = {look.rgba: len(part.triangles[1]) for part, look in shape.parts}
            assert found == expected
            compared += len(found)
    assert compared > 15


def hue(rgb: Floats) -> Floats:
    return np.asarray(rgb / np.maximum(rgb.max(axis=-1, keepdims=True), 1))


RED, BLUE = (1.0, 0.2, 0.0), (0.0, 0.4, 1.0)


def floor_tiles(folder: Path) -> Mesh:
    """Return a mesh of a red tile for x below 0 and a blue one for x above 0."""
    (folder / "tiles.mtl").write_text("newmtl red\nKd 1 0.2 0\nnewmtl blue\nKd 0 0.4 1\n")
    lines = ["mtllib tiles.mtl"]
    for name, low in (("red", -1), ("blue", 0)):
        lines += [f"v {x} {y} 0" for x, y in ((low, -1), (low + 1, -1), (low + 1, 1), (low, 1))]
        lines += [f"usemtl {name}", "f -4 -3 -2 -1"]
    (folder / "tiles.obj").write_text("\n".join(lines) + "\n")
    return Mesh(str(folder / "tiles.obj"))


@pytest.mark.parametrize("renderer", [None, "pybullet"])
def test_pictures_of_robots_and_bodies_show_the_colours_of_meshes(
    tmp_path: Path, renderer: str | None
) -> None:
    if renderer is not None:
        pytest.importorskip(renderer)
    tiles = floor_tiles(tmp_path)
    geometry = Geometry({"base": LinkGeometry((Visual(tiles),))})
    robot = Model.build("tiles", [Link("base")], [], geometry=geometry)
    body = SceneBody("tiles", Box((0.1, 0.1, 0.1)), visuals=[Visual(tiles)])
    camera = Camera.look_at((0.0, 0.0, 3.0), (0.0, 0.0, 0.0), up=(0.0, 1.0, 0.0), size=(80, 60))
    for scene in (Scene(robots=(SceneRobot("robot", robot),)), Scene(bodies=(body,))):
        with World(scene, installed_worlds()[0]) as world:
            picture = world.camera(camera, renderer)
        seen = picture.segmentation == 0
        columns = np.broadcast_to(np.arange(80), seen.shape)
        for side, colour in ((columns < 38, RED), (columns > 41, BLUE)):
            shown = hue(picture.rgb[seen & side].astype(np.float64))
            assert len(shown) > 200
            assert np.mean(np.abs(shown - colour).max(axis=1) < 0.02) > 0.99


def test_the_colour_of_a_visual_comes_before_those_of_its_mesh(tmp_path: Path) -> None:
    tiles, green = floor_tiles(tmp_path), (0.0, 1.0, 0.0, 1.0)
    visual = Visual(tiles, material=Appearance("green", green))
    drawn = list(coloured_shapes(visual, None, (0.5, 0.5, 0.5, 1.0)))
    assert [(shape, rgba) for shape, rgba, _ in drawn] == [(tiles, green)]
    named = list(coloured_shapes(Visual(tiles, material=Appearance("named")), None, green))
    assert {rgba[:3] for _, rgba, _ in named} == {RED, BLUE}


def test_shapes_without_a_colour_are_grey() -> None:
    box = Box((0.1, 0.1, 0.1))
    geometry = Geometry({"seen": LinkGeometry((Visual(box),)), "felt": LinkGeometry((), (Collision(box),))})
    colours = {colour for link in geometry.links for _, colour, _ in link_shapes(geometry, link)}
    ((red, green, blue, alpha),) = colours
    assert 0.0 < red == green == blue < 1.0
    assert alpha == 1.0


def test_the_page_draws_a_node_for_each_colour(tmp_path: Path) -> None:
    geometry = Geometry({"base": LinkGeometry((Visual(floor_tiles(tmp_path)),))})
    with Model.build("tiles", [Link("base")], [], geometry=geometry).view() as viewer:
        nodes = viewer.view.visuals["base"]
        colours = {tuple(node.color) for node in nodes}
        assert colours == {tuple(round(255 * share) for share in each) for each in (RED, BLUE)}
        assert len(list(link_shapes(geometry, "base"))) == 2
