"""Editing XML in place changes only the edited ranges."""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path
from xml.sax.saxutils import quoteattr as expected

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynx.engines.silence import silence
from dynx.errors import DescriptionError, EngineError
from dynx.loaded import installed_engines, load_as
from dynx.model.elements import Note
from dynx.model.library import find
from dynx.model.loading import load
from dynx.model.xml.reading import Element, read_xml, repaired
from dynx.model.xml.source import Edit, SourceElement, XmlSource
from dynx.model.xml.text import quoteattr
from dynx.testing.strategies import urdf_text

ARM = """<?xml version='1.0'?>
<!-- an arm -->
<robot name="arm">
    <link name='base'/>   <!-- no mass -->
    <link  name="hand"  >
        <inertial><mass value="1"/></inertial>
    </link>
    <joint name="a" type="fixed"
           foo='x &gt; "y"'>
        <parent link="base"/> <child link="hand"/>
    </joint>
</robot>
<!-- end -->
"""


def same_tree(read: Element, placed: SourceElement) -> bool:
    """Return whether two trees have the same tags, attributes, lines and children."""
    return (
        (read.tag, read.attributes, read.line) == (placed.tag, placed.attributes, placed.line)
        and len(read.children) == len(placed.children)
        and all(map(same_tree, read.children, placed.children))
    )


@given(urdf_text())
def test_it_reads_what_the_reader_reads(text: str) -> None:
    notes: list[Note] = []
    assert same_tree(read_xml(text, "t", notes), XmlSource(text).root)


@pytest.mark.parametrize("name", ["ur5", "talos", "pr2"])
def test_positions_of_all_elements_of_real_files(name: str) -> None:
    path = find(name)
    source = XmlSource(path.read_bytes(), name)
    assert same_tree(read_xml(path.read_bytes(), name, []), source.root)
    for element in source.root.walk():
        assert source.data[element.span.start :].startswith(f"<{element.tag}".encode())
        assert source.data[: element.span.end].endswith(b">")
        assert set(element.places) == set(element.attributes)


@given(urdf_text(), st.data())
def test_an_attribute_is_set_and_all_else_stays(text: str, data: st.DataObject) -> None:
    source = XmlSource(text)
    element = data.draw(st.sampled_from(list(source.root.walk())))
    name = data.draw(st.sampled_from(["name", "xyz", "value", "new"]))
    value = data.draw(st.text(st.characters(codec="utf-8", exclude_categories=("Cc", "Cs")), max_size=8))
    if any(character in "\ufffe\uffff" for character in value):
        return
    edited = source.apply(source.attribute_edit(element, name, value))
    again = next(each for each in edited.root.walk() if each.span.start == element.span.start)
    assert again.attributes == {**element.attributes, name: value}
    place = element.places.get(name)
    start = place.start if place else again.places[name].start
    end = place.end if place else start
    assert edited.data[:start] == source.data[:start]
    assert edited.data.endswith(source.data[end:])


@given(urdf_text(), st.data())
def test_removing_an_inserted_element_restores_the_text(text: str, data: st.DataObject) -> None:
    source = XmlSource(text)
    parent = data.draw(st.sampled_from([each for each in source.root.walk() if not each.empty]))
    edited = source.apply(source.insertion(parent, "<new/>", first=data.draw(st.booleans())))
    new = next(each for each in edited.root.walk() if each.tag == "new")
    left = edited.apply(edited.removal(new)).text
    assert "".join(left.split()) == "".join(source.text.split())


def test_edits_keep_comments_quotes_and_indentation() -> None:
    source = XmlSource(ARM)
    base, hand = source.root.all("link")
    (joint,) = source.root.all("joint")
    edited = source.apply(
        source.insertion(base, '<inertial>\n  <mass value="0"/>\n</inertial>'),
        source.attribute_edit(hand.children[0].children[0], "value", "2"),
        source.attribute_edit(joint, "foo", 'a & "b"'),
        source.attribute_removal(joint, "type"),
        source.removal(joint.children[0]),
    )
    assert edited.text == (
        ARM.replace(
            "<link name='base'/>",
            "<link name='base'>\n        <inertial>\n            <mass value=\"0\"/>\n        </inertial>\n"
            "    </link>",
        )
        .replace('value="1"', 'value="2"')
        .replace("""foo='x &gt; "y"'""", """foo='a &amp; "b"'""")
        .replace(' type="fixed"', "")
        .replace('<parent link="base"/>', "")
    )


def test_an_element_alone_on_its_line_is_removed_with_the_line() -> None:
    source = XmlSource("<r>\n  <a/>\n  <b/>\n</r>")
    assert source.apply(source.removal(source.root.children[0])).text == "<r>\n  <b/>\n</r>"


def test_text_behind_an_element_is_preserved() -> None:
    source = XmlSource("<r>\n  <a/> <!-- why -->\n  <b/><c/>\n</r>")
    a, b, c = source.root.children
    assert source.apply(source.removal(a)).text == "<r>\n   <!-- why -->\n  <b/><c/>\n</r>"
    assert source.apply(source.removal(b)).text == "<r>\n  <a/> <!-- why -->\n  <c/>\n</r>"
    assert source.apply(source.removal(c)).text == "<r>\n  <a/> <!-- why -->\n  <b/>\n</r>"


@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_line_ends_are_kept(end: str) -> None:
    source = XmlSource(end.join(["<r>", "  <a/>", "</r>"]))
    (a,) = source.root.children
    edited = source.apply(source.insertion(a, "<b>\n  <c/>\n</b>"))
    lines = ["<r>", "  <a>", "    <b>", "      <c/>", "    </b>", "  </a>", "</r>"]
    assert edited.text == end.join(lines)


def test_overlapping_edits_raise() -> None:
    source = XmlSource("<r><a/></r>")
    with pytest.raises(ValueError, match="overlap"):
        source.apply(Edit(3, 7, ""), Edit(4, 5, "x"))


def test_line_numbers_include_text_before_the_first_element() -> None:
    source = XmlSource("\ufeff\n\n<r>\n<a/>\n</r>")
    assert source.root.children[0].line == 4
    assert source.excerpt(4, around=1) == [(3, "<r>"), (4, "<a/>"), (5, "</r>")]


def test_a_declared_encoding_is_kept() -> None:
    data = '<?xml version="1.0" encoding="iso-8859-1"?><r n="é"/>'.encode("latin-1")
    source = XmlSource(data)
    edited = source.apply(source.attribute_edit(source.root, "m", "é€"))
    assert edited.to_bytes() == (
        '<?xml version="1.0" encoding="iso-8859-1"?><r n="é" m="é&#8364;"/>'.encode("latin-1")
    )


def test_text_is_written_in_the_encoding_that_it_declares() -> None:
    text = '<?xml version="1.0" encoding="iso-8859-1"?><r n="é€"/>'
    assert XmlSource(text).to_bytes() == text.replace("€", "&#8364;").encode("latin-1")


def test_malformed_xml_raises_with_file_and_line() -> None:
    with pytest.raises(DescriptionError, match=r"arm\.urdf:2"):
        XmlSource("<r>\n<a></r>", "arm.urdf")


def test_a_document_is_declared_in_the_encoding_that_it_is_saved_in() -> None:
    text = '<?xml version="1.0" encoding="iso-8859-1"?><robot name="é"/>'
    saved = XmlSource(text.encode("iso-8859-1"), "x").in_utf8()
    assert saved.text == '<?xml version="1.0" encoding="UTF-8"?><robot name="é"/>'
    assert saved.data.decode("utf-8") == saved.text
    assert XmlSource(b"<robot/>", "x").in_utf8().text == "<robot/>"


@given(st.text(alphabet=st.one_of(st.sampled_from("&<>\"'\n\r\t;#"), st.characters())))
def test_values_are_quoted_as_by_the_standard_library(text: str) -> None:
    assert quoteattr(text) == expected(text)


def test_models_are_imported_without_an_http_client() -> None:
    code = "import sys, dynx.model; print('http.client' in sys.modules)"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == "False"


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
    "an element disabled by !": ("<link", '<!mesh filename="a.obj" /!>\n<link', "<! that begins no comment"),
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
        st.sampled_from(
            ["<a", "<b ", "/>", ">", "</a>", "</b>", ' x="1"', "y='<&'", "<!-- -", "--", "-->", "<!b"]
        )
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
        "<!DOCTYPE a []>\n<a b='&c;'/>",
        "<!-- a -- b -->\n<!DOCTYPE a [<!ENTITY c 'd'>]>\n<a b='&c;'/>",
    ):
        with pytest.raises(DescriptionError, match="document type"):
            read_xml(text, "t", [])


@pytest.mark.parametrize("part", ["<", "<a ", "<!--", "&", "<a x='", "</a>", "<a/>", " ", "<a\n", "<?xml?>"])
def test_repair_takes_linear_time(part: str) -> None:
    start = time.process_time()
    repaired("<a>" + part * 200_000)
    assert time.process_time() - start < 10.0


@pytest.mark.parametrize(
    "name", ["utf-8", "UTF8", "utf-8-sig", "utf_8_sig", "ascii", "utf-16", "latin1", "u8"]
)
@given(st.text(alphabet="ab<&ä", max_size=8), st.booleans())
def test_a_text_is_encoded_as_it_was_read(name: str, comment: str, marked: bool) -> None:
    data = f'<?xml version="1.0" encoding="{name}"?>\n<robot name="r"><!--{comment}--></robot>\n'.encode()
    data = b"\xef\xbb\xbf" * marked + data
    source = XmlSource(data, "robot.urdf")
    assert source.form.encode(source.text) == data
