"""PyBullet computes the same inertia from the corners of a mesh's box as from the mesh."""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence
from itertools import product
from pathlib import Path

import numpy as np
import pytest

from dynx.doctor.examination import temporary_document, without_meshes
from dynx.engines.silence import silence
from dynx.loaded import installed_engines
from dynx.model.geometry.mesh_files import find_mesh
from dynx.model.library import find
from dynx.model.xml.source import XmlSource
from dynx.rules.geometry import collision_meshes
from dynx.spatial.scalar import Floats

needs_pybullet = pytest.mark.skipif("pybullet" not in installed_engines(), reason="needs PyBullet")

Writer = Callable[[Sequence[tuple[float, ...]]], bytes]

CORNERS = list(product((-0.1, 0.2), (-0.2, 0.4), (-0.3, 0.6)))
TRIANGLES = [(0, 1, 2), (1, 3, 2), (4, 5, 6), (5, 7, 6), (0, 4, 1), (1, 4, 5)]

LINK = """<robot name="r"><link name="a"><inertial><origin xyz="0.1 0.2 0.3" rpy="0.2 0 0.1"/>
<mass value="2"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>
<visual><geometry><mesh filename="none.stl"/></geometry></visual>
<collision><origin xyz="0 0 1" rpy="0.3 0.4 0.5"/><geometry><mesh filename="{}" scale="1 -2 0.5"/></geometry>
</collision></link></robot>"""


def stl(corners: Sequence[tuple[float, ...]]) -> bytes:
    """Write a binary STL file."""
    facets = [struct.pack("<12fH", 0, 0, 0, *(x for k in face for x in corners[k]), 0) for face in TRIANGLES]
    return bytes(80) + struct.pack("<I", len(facets)) + b"".join(facets)


def obj(corners: Sequence[tuple[float, ...]]) -> bytes:
    """Write an OBJ file."""
    lines = ["v {} {} {}".format(*corner) for corner in corners]
    lines += ["f {} {} {}".format(*(k + 1 for k in face)) for face in TRIANGLES]
    return "\n".join([*lines, ""]).encode()


def dae(corners: Sequence[tuple[float, ...]]) -> bytes:
    """Write a COLLADA file with another unit, another up axis, and a point without a face."""
    corners = [*corners, (9.0, 9.0, 9.0)]
    numbers = " ".join(str(x) for corner in corners for x in corner)
    faces = " ".join(str(k) for face in TRIANGLES for k in face)
    return f"""<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><unit meter="0.5"/><up_axis>Y_UP</up_axis></asset>
<library_geometries><geometry id="g"><mesh>
<source id="p"><float_array id="n" count="{3 * len(corners)}">{numbers}</float_array><technique_common>
<accessor source="#n" count="{len(corners)}" stride="3"><param name="X" type="float"/>
<param name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<triangles count="{len(TRIANGLES)}"><input semantic="VERTEX" source="#v" offset="0"/>
<p>{faces}</p></triangles>
</mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="s"><node id="k"><rotate>0 0 1 90</rotate>
<instance_geometry url="#g"/></node></visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#s"/></scene></COLLADA>""".encode()


def inertias(path: Path) -> dict[str, Floats]:
    """Load a file by PyBullet's plain call; return the moments of inertia of each link."""
    import pybullet as p

    client = p.connect(p.DIRECT)
    try:
        p.setPhysicsEngineParameter(enableFileCaching=0, physicsClientId=client)
        with silence():
            body = p.loadURDF(str(path), physicsClientId=client)
        links = [p.getJointInfo(body, k, physicsClientId=client) for k in range(p.getNumJoints(body, client))]
        numbers = {"": -1, **{info[12].decode(): info[0] for info in links}}
        return {
            name: np.array(p.getDynamicsInfo(body, k, physicsClientId=client)[2])
            for name, k in numbers.items()
        }
    finally:
        p.disconnect(client)


@needs_pybullet
@pytest.mark.parametrize(("name", "write"), [("m.stl", stl), ("m.STL", stl), ("m.obj", obj), ("m.dae", dae)])
def test_the_corners_of_a_mesh_have_its_inertia(tmp_path: Path, name: str, write: Writer) -> None:
    # More corners than those of the box, and one of them beyond all others.
    (tmp_path / name).write_bytes(write([*CORNERS[:7], (0.3, 0.5, 0.7)]))
    path = tmp_path / "robot.urdf"
    path.write_text(LINK.format(name))
    source = without_meshes(XmlSource(path.read_bytes(), str(path)), collisions=False)
    (tmp_path / "raw.urdf").write_bytes(source.to_bytes())
    right = inertias(tmp_path / "raw.urdf")[""]
    with temporary_document(source, mesh_boxes=True) as written:
        assert written.read_text().count("<collision>") == 1
        assert np.max(np.abs(inertias(written)[""] - right)) <= 1e-12 * np.max(right)
    assert np.max(right) > 0.05


@needs_pybullet
@pytest.mark.parametrize("robot", ["ur5", "solo12", "talos_arm", "kinova"])
def test_real_meshes_have_the_inertia_of_their_corners(robot: str, tmp_path: Path) -> None:
    path = find(robot)
    source = without_meshes(XmlSource(path.read_bytes(), str(path)), collisions=False)
    edits = []
    for link in source.root.all("link"):
        for _, mesh in collision_meshes(link):
            found = find_mesh(mesh.attributes["filename"], str(path))
            assert found is not None
            edits.append(source.attribute_edit(mesh, "filename", str(found)))
    assert edits
    raw = tmp_path / "raw.urdf"
    raw.write_bytes(source.apply(*edits).to_bytes())
    right = inertias(raw)
    with temporary_document(source, mesh_boxes=True) as written:
        got = inertias(written)
    for name, moments in right.items():
        assert np.max(np.abs(got[name] - moments)) <= 1e-7 * np.max(moments), name


def test_a_mesh_that_is_missing_damaged_or_of_text_is_left_out(tmp_path: Path) -> None:
    corners = "vertex 0 0 1\nvertex 0 1 0\nvertex 1 0 0\n"
    facet = f"facet normal 0 0 1\nouter loop\n{corners}endloop\nendfacet\n"
    (tmp_path / "text.stl").write_text(f"solid a\n{facet}endsolid a\n")
    (tmp_path / "short.stl").write_bytes(stl(CORNERS)[:-1])
    (tmp_path / "beyond.dae").write_bytes(dae(CORNERS[:6]))
    path = tmp_path / "robot.urdf"
    for name in (
        "none.stl",
        "text.stl",
        "short.stl",
        "beyond.dae",
        "package://elsewhere/m.stl",
        "../../m.stl",
        "m.ply",
    ):
        path.write_text(LINK.format(name))
        with temporary_document(XmlSource(path.read_bytes(), str(path)), mesh_boxes=True) as written:
            assert "<collision>" not in written.read_text()
