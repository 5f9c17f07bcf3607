"""Engines load all of a file that dynamics needs, in the encoding of the user."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynx.doctor import diagnose
from dynx.doctor.examination import temporary_document, with_mesh_boxes, without_meshes
from dynx.loaded import installed_engines
from dynx.model.xml.source import SourceElement, XmlSource
from tests.rules.documents import case_of, link

BOX = '<collision><geometry><box size="1 1 1"/></geometry></collision>'
MESH = '<{}><geometry><mesh filename="none.stl"/></geometry></{}>'

needs_mujoco = pytest.mark.skipif("mujoco" not in installed_engines(), reason="needs MuJoCo")


def test_shapes_that_weigh_stay_and_files_that_may_be_missing_go() -> None:
    seen = '<visual><geometry><box size="2 2 2"/></geometry></visual>'
    meshes = [MESH.format(tag, tag) for tag in ("visual", "collision")]
    case = case_of(link("a", BOX, meshes[1], seen), link("b", meshes[0]), MESH.format("gazebo", "gazebo"))
    kept = case_of(link("a", BOX), link("b"), MESH.format("gazebo", "gazebo"))
    assert without_meshes(case.source).text == kept.source.text


@given(st.data())
def test_what_is_left_stays_on_its_line(data: st.DataObject) -> None:
    """Engines name lines of their input, which users look up in their files."""
    blank, end = st.sampled_from(["", "\n", "\n\n   "]), data.draw(st.sampled_from(["\n", "\r\n"]))
    shape = MESH.replace("><", ">@<").replace(" filename", "@ filename")
    parts = [
        f'@<link name="{name}">@{shape.format(tag, tag)}@<inertial>@<mass value="1"/></inertial>@</link>'
        for name, tag in zip("abcd", ("visual", "collision", "collision", "visual"), strict=True)
    ]
    texture = '<material name="m">@<texture @filename="none.png"/></material>'
    pieces = f"@@<robot name='r'>{texture}{''.join(parts)}@</robot>".split("@")
    text = "".join(f"{piece}{data.draw(blank).replace(chr(10), end)} " for piece in pieces)
    source = XmlSource(text.encode())
    lines = {id_of(each): each.line for each in source.root.walk()}
    for engine_input in (without_meshes(source), with_mesh_boxes(source, Path("none"))):
        left = list(XmlSource(engine_input.to_bytes()).root.walk())
        assert [each.line for each in left] == [lines.get(id_of(each), each.line) for each in left]
        assert "collision" not in {each.tag for each in left}


def id_of(element: SourceElement) -> tuple[str, ...]:
    """Return the tags and names of an element and of what contains it."""
    above = () if element.parent is None else id_of(element.parent)
    return (*above, element.tag, element.attributes.get("name", ""))


@pytest.mark.parametrize(
    ("engine", "words"),
    [
        ("pybullet", "(line 13: <axis> has no xyz)"),
        pytest.param("mujoco", "line 13", marks=needs_mujoco),
    ],
)
def test_a_refusal_names_the_line_of_the_file(engine: str, words: str) -> None:
    meshes = [MESH.format(tag, tag).replace("><", ">\n<") for tag in ("visual", "collision")]
    joint = '<joint name="j" type="continuous"><parent link="a"/><child link="b"/>\n<axis/></joint>'
    case = case_of(link("a", *meshes), link("b"), joint)
    report = diagnose(case.source.text, engines=[engine], samples=1)
    assert case.source.root.all("joint")[0].all("axis")[0].line == 13
    [result] = report.engines
    assert words in str(result.no_results)


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
    with temporary_document(without_meshes(XmlSource(data))) as path:
        assert path.read_bytes() == data
        assert path.suffix == ".urdf"
    assert not path.exists()
