"""A concave mesh is divided into the objects of its file, as PyBullet does, or by convex decomposition."""

from __future__ import annotations

import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynx.errors import ArgumentError, DescriptionError, NotInstalledError, RobotNotFoundError
from dynx.model.geometry import Mesh, Visual, solid_properties
from dynx.model.geometry.convex_pieces import convex_decomposition, mesh_objects
from dynx.steppers.registry import installed_worlds
from dynx.world import Scene, SceneBody, World
from tests.model.geometry.mesh_files import stl

SIGNS = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
QUADS = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))

BOXES = st.lists(
    st.tuples(st.tuples(*[st.floats(-5.0, 5.0)] * 3), st.tuples(*[st.floats(0.1, 2.0)] * 3)),
    min_size=1,
    max_size=5,
)


def obj_of_boxes(boxes: list[tuple[tuple[float, ...], tuple[float, ...]]], tags: list[str]) -> str:
    """Return an OBJ file with an object or a group for each box, a middle and its edges."""
    lines = []
    for k, ((middle, edges), tag) in enumerate(zip(boxes, tags, strict=True)):
        corners = np.array(middle) + SIGNS * edges
        lines += [f"{tag} box{k}", *(f"v {x!r} {y!r} {z!r}" for x, y, z in corners.tolist())]
        lines += ["f " + " ".join(str(8 * k + 1 + row) for row in quad) for quad in QUADS]
    return "\n".join([*lines, "o empty", ""])


@given(BOXES, st.data())
def test_each_object_or_group_of_a_file_is_a_mesh(
    boxes: list[tuple[tuple[float, ...], tuple[float, ...]]], data: st.DataObject
) -> None:
    tags = data.draw(st.lists(st.sampled_from(["o", "g", " o"]), min_size=len(boxes), max_size=len(boxes)))
    scale = data.draw(st.tuples(*[st.sampled_from([0.5, 2.0, -1.0])] * 3))
    with TemporaryDirectory() as folder:
        path = Path(folder) / "boxes.obj"
        path.write_text(obj_of_boxes(boxes, tags))
        pieces = mesh_objects(Mesh(str(path), scale), Path(folder) / "pieces")
        assert len(pieces) == len(boxes)
        for piece, (middle, edges) in zip(pieces, boxes, strict=True):
            found = solid_properties(piece)
            assert np.allclose(found.center, np.array(scale) * middle, atol=1e-9)
            assert found.volume == pytest.approx(np.prod(edges) * abs(np.prod(scale)), rel=1e-9)
        assert sum(len(each.triangles[1]) for each in pieces) == len(Mesh(str(path)).triangles[1])


def test_a_file_without_objects_is_refused_by_name(tmp_path: Path) -> None:
    (tmp_path / "solid.stl").write_bytes(stl())
    (tmp_path / "broken.obj").write_text("o a\nv 0 0\n")
    for name, error, message in (
        ("solid.stl", ArgumentError, "'solid.stl' is no OBJ file"),
        ("broken.obj", DescriptionError, "line 2"),
        ("absent.obj", RobotNotFoundError, "absent.obj"),
    ):
        with pytest.raises(error, match=message):
            mesh_objects(Mesh(str(tmp_path / name)), tmp_path / "pieces")


DUCK_URDF = """<robot name="duck"><link name="base">
  <inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>
  <collision><geometry><mesh filename="{}"/></geometry></collision>
</link></robot>"""


@pytest.mark.parametrize("engine", installed_worlds())
def test_the_duck_of_pybullet_is_as_concave_on_every_engine_as_pybullet_loads_it(
    engine: str, tmp_path: Path
) -> None:
    pybullet = pytest.importorskip("pybullet")
    folder = Path(pytest.importorskip("pybullet_data").getDataPath())
    whole = Mesh(str(folder / "duck_vhacd.obj"))
    (tmp_path / "duck.urdf").write_text(DUCK_URDF.format(whole.file))
    low, high = (bound(whole.triangles[0], axis=0) for bound in (np.min, np.max))
    rng, length = np.random.default_rng(0), 10.0
    origins = rng.normal(size=(300, 3))
    origins = 0.5 * (low + high) + 5.0 * origins / np.linalg.norm(origins, axis=1, keepdims=True)
    directions = rng.uniform(low, high, (300, 3)) - origins
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    client = pybullet.connect(pybullet.DIRECT)
    try:
        pybullet.loadURDF(str(tmp_path / "duck.urdf"), physicsClientId=client)
        ends = origins + length * directions
        found = pybullet.rayTestBatch(origins.tolist(), ends.tolist(), physicsClientId=client)
    finally:
        pybullet.disconnect(client)
    native = np.array([length * fraction for _, _, fraction, *_ in found])
    pieces = mesh_objects(whole, tmp_path)
    assert len(pieces) == 5
    errors = []
    for shapes in (pieces, (whole,)):
        body = SceneBody("duck", shapes, mass=1.0, visuals=[Visual(whole)])
        with World(Scene("duck", bodies=(body,)), engine) as world:
            distance = np.asarray(world.cast_rays(origins, directions, length).distance)
        errors.append(np.abs(np.where(np.isfinite(distance), distance, length) - native))
    # Bullet's margin of 1 mm lets a ray along a surface hit it earlier, or at all.
    assert np.mean(errors[0] < 0.01) > 0.97
    assert np.mean(errors[1] < 0.01) < 0.85


def channel(folder: Path) -> Mesh:
    """Return a mesh of a channel: three boards of 1 m x 0.4 m x 0.1 m around a hollow, as one solid."""
    outline = [(0, 0), (1, 0), (1, 0.4), (0.9, 0.4), (0.9, 0.1), (0.1, 0.1), (0.1, 0.4), (0, 0.4)]
    lines = [f"v {x} {y} {z}" for z in (0.0, 1.0) for x, y in outline]
    quads = [(0, 1, 4, 5), (1, 2, 3, 4), (0, 5, 6, 7)]
    lines += ["f " + " ".join(str(k + 1) for k in reversed(quad)) for quad in quads]
    lines += ["f " + " ".join(str(k + 9) for k in quad) for quad in quads]
    lines += [f"f {k + 1} {(k + 1) % 8 + 1} {(k + 1) % 8 + 9} {k + 9}" for k in range(8)]
    (folder / "channel.obj").write_text("\n".join(lines) + "\n")
    return Mesh(str(folder / "channel.obj"))


def test_a_concave_solid_is_divided_into_convex_ones(tmp_path: Path) -> None:
    pytest.importorskip("coacd")
    whole = channel(tmp_path)
    pieces = convex_decomposition(whole, tmp_path / "pieces")
    solid = 0.1 + 2 * 0.03
    assert solid_properties(whole).volume == pytest.approx(0.4)
    assert sum(solid_properties(piece).volume for piece in pieces) == pytest.approx(solid, rel=0.03)
    again = convex_decomposition(whole, tmp_path / "again")
    for one, other in zip(pieces, again, strict=True):
        assert np.array_equal(one.triangles[0], other.triangles[0])


def test_a_missing_coacd_is_named_with_its_extra(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setitem(sys.modules, "coacd", None)
    whole = channel(tmp_path)
    with pytest.raises(NotInstalledError, match=r"pip install '\S*\[decomposition\]'"):
        convex_decomposition(whole, tmp_path)
    for concavity in (0.0, -1.0, 2.0, float("nan")):
        with pytest.raises(ArgumentError, match="concavity"):
            convex_decomposition(whole, tmp_path, concavity=concavity)
