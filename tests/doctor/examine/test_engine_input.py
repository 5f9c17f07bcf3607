"""Engines load all of a file that dynamics needs, in the encoding of the user."""

from __future__ import annotations

from pathlib import Path

from dynx.doctor.examine.engine_input import temporary_urdf, without_meshes
from dynx.model.xml.source import XmlSource
from tests.rules.documents import case_of, link

BOX = '<collision><geometry><box size="1 1 1"/></geometry></collision>'
MESH = '<{}><geometry><mesh filename="none.stl"/></geometry></{}>'


def test_shapes_that_weigh_stay_and_files_that_may_be_missing_go() -> None:
    seen = '<visual><geometry><box size="2 2 2"/></geometry></visual>'
    meshes = [MESH.format(tag, tag) for tag in ("visual", "collision")]
    case = case_of(link("a", BOX, meshes[1], seen), link("b", meshes[0]), MESH.format("gazebo", "gazebo"))
    kept = case_of(link("a", BOX), link("b"), MESH.format("gazebo", "gazebo"))
    assert without_meshes(case.source).text == kept.source.text


def test_a_texture_that_is_beside_the_description_becomes_a_colour(tmp_path: Path) -> None:
    (tmp_path / "wood.png").write_bytes(b"an image")
    material = '<material name="{0}">{1}<texture filename="{0}.png"/></material>'
    parts = material.format("wood", ""), material.format("gone", ""), link("a")
    case = case_of(*parts, source=tmp_path / "robot.urdf")
    (tmp_path / "robot.urdf").write_text(case.source.text)
    kept = without_meshes(case.source).text
    assert 'filename="wood.png"' not in kept
    assert '<material name="wood"><color rgba="0.5 0.5 0.5 1"/></material>' in kept
    assert material.format("gone", "") in kept


def test_a_file_is_written_as_it_was_read_and_is_gone_afterwards(tmp_path: Path) -> None:
    data = '<?xml version="1.0" encoding="iso-8859-1"?><robot name="é"><link name="ü"/></robot>'.encode(
        "latin-1"
    )
    with temporary_urdf(without_meshes(XmlSource(data))) as path:
        assert path.read_bytes() == data
        assert path.suffix == ".urdf"
    assert not path.exists()
