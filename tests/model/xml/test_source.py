"""Editing XML in place changes only the edited ranges."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynx.errors import DescriptionError
from dynx.model.elements import Note
from dynx.model.library import find
from dynx.model.xml.reading import Element, read_xml
from dynx.model.xml.source import Edit, SourceElement, XmlSource
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
        source.insertion(base, '<inertial>\n    <mass value="0"/>\n</inertial>'),
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
