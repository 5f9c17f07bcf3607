"""Repair of malformed XML: what every engine reads, dynx reads alike and notes, in linear time."""

from __future__ import annotations

import time
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynx.engines.silence import silence
from dynx.errors import DescriptionError, EngineError
from dynx.loaded import installed_engines, load_as
from dynx.model.elements import Note
from dynx.model.library import find
from dynx.model.loading import load
from dynx.model.xml.reading import read_xml, repaired
from dynx.model.xml.source import XmlSource

TEXT = find("scara").read_text(encoding="utf-8")

FAULTS = {
    "hyphens in a comment": ("<link", "<!-- a -- b ---><link", "-- in a comment"),
    "a control character": ("<link", "<!-- \x01 -->\x02<link", "a control character"),
    "a bare ampersand": ('<robot name="', '<robot name="R&D & ', "& that is not written &amp;"),
    "an unknown entity": ("<link", "&nbsp;<link", "& that is not written &amp;"),
    "less than in an attribute": ('<robot name="', '<robot name="a<b', "< that is not written &lt;"),
    "no white space": ('" type=', '"type=', "no white space between attributes"),
    "a blank behind <": ("<link", "< link", "white space behind <"),
    "a line break behind <": ("<link", "<\n link", "white space behind <"),
    "text in front": ("<robot", "URDF: <robot", "text outside of the root element"),
    "a declaration without quotes": ("<?xml", "<?xml version=1.0?><!-- --><!--", "a malformed XML decl"),
    "two declarations": ("<?xml", '<?xml version="1.0"?>\n<?xml', "a second XML declaration"),
    "an end tag too many": ("</robot>", "</robot>\n</robot>", "an end tag without a start tag"),
    "a second robot": (
        "</robot>",
        '</robot>\n<robot name="b"><c/></robot>',
        "content behind the root element",
    ),
}


def faulty(fault: str) -> str:
    old, new, _ = FAULTS[fault]
    assert old in TEXT
    return TEXT.replace(old, new, 1)


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_that_engines_forgive_is_read_with_a_note(fault: str) -> None:
    text = faulty(fault)
    model, clean = load(text), load(TEXT)
    assert (model.links, model.joints) == (clean.links, clean.joints)
    assert [FAULTS[fault][2] in str(note) for note in model.notes].count(True) == 1


@pytest.mark.parametrize("fault", FAULTS)
@pytest.mark.parametrize("engine", installed_engines())
def test_every_engine_forgives_it(engine: str, fault: str, tmp_path: Path) -> None:
    path = tmp_path / "robot.urdf"
    path.write_text(faulty(fault), encoding="utf-8", newline="")
    model = load(path)
    with silence(), load_as(engine, path, model) as robot:
        assert set(robot.describe().joints) == set(model.joint_names)


REFUSED = {
    "an attribute twice": ("<link name=", '<link name="x" name='),
    "no quotes": ("<link name=", "<link x=1 name="),
    "no value": ("<link name=", "<link x name="),
    "a declaration behind a comment": ("<?xml", "<!-- a --><?xml"),
    "a comment without end": ("<link", "<!-- <link"),
    "no end": ("</robot>", ""),
    "another end": ("</robot>", "</Robot>"),
    "text behind": ("</robot>", "</robot> end"),
    "an element without end behind": ("</robot>", "</robot><b>"),
}


@pytest.mark.parametrize("fault", REFUSED)
def test_a_fault_that_no_engine_forgives_is_refused(fault: str, tmp_path: Path) -> None:
    old, new = REFUSED[fault]
    text = TEXT.replace(old, new, 1)
    assert text != TEXT
    with pytest.raises(DescriptionError):
        load(text)
    path = tmp_path / "robot.urdf"
    path.write_text(text, encoding="utf-8", newline="")
    for engine in installed_engines():
        with pytest.raises(EngineError), silence():
            load_as(engine, path, load(TEXT))


@given(
    st.lists(
        st.sampled_from(["<a", "<b ", "/>", ">", "</a>", "</b>", ' x="1"', "y='<&'", "<!-- -", "--", "-->"])
    )
)
def test_repaired_text_is_well_formed_has_the_same_lines_and_needs_no_repair(parts: list[str]) -> None:
    text = "<a>\n" + "\n".join(parts) + "\n</a>"
    found = repaired(text)
    if found is None:
        return
    assert found.notes
    assert found.text.count("\n") == text.count("\n")
    notes: list[Note] = []
    try:
        root = read_xml(text, "t", notes)
    except DescriptionError:  # tags that do not match, or an attribute that occurs twice
        return
    assert root.tag == "a"
    assert XmlSource(text).text == found.text
    assert repaired(found.text) is None


def test_a_document_type_is_refused_before_and_after_a_repair() -> None:
    for text in (
        "<!DOCTYPE a>\n<a b='&c;'/>",
        "<!-- a -- b -->\n<!DOCTYPE a [<!ENTITY c 'd'>]>\n<a b='&c;'/>",
    ):
        with pytest.raises(DescriptionError, match="document type"):
            read_xml(text, "t", [])


@pytest.mark.parametrize("part", ["<", "<a ", "<!--", "&", "<a x='", "</a>", "<a/>", " ", "<a\n", "<?xml?>"])
def test_repair_takes_linear_time(part: str) -> None:
    start = time.perf_counter()
    repaired("<a>" + part * 200_000)
    assert time.perf_counter() - start < 10.0
