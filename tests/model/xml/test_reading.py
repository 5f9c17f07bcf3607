"""Hardened XML reader: encodings, line numbers, and errors."""

from __future__ import annotations

import codecs
import time

import pytest

from dynx.errors import DescriptionError
from dynx.model.elements import Note
from dynx.model.xml.reading import MAX_ATTRIBUTES, MAX_DEPTH, Element, read_xml


def read(data: str | bytes, opaque: frozenset[str] = frozenset()) -> tuple[Element, list[Note]]:
    notes: list[Note] = []
    return read_xml(data, "test.urdf", notes, opaque=opaque), notes


def refusal(data: str | bytes) -> DescriptionError:
    with pytest.raises(DescriptionError) as caught:
        read(data)
    assert caught.value.source == "test.urdf"
    return caught.value


def test_elements_know_their_tag_attributes_and_line() -> None:
    root, notes = read('<?xml version="1.0"?>\n<a>\n\n <b x="1"\n y="&lt;2"/><c:d/>\n</a>')
    assert (root.tag, root.line, notes) == ("a", 2, [])
    assert [(child.tag, child.line) for child in root.children] == [("b", 4), ("c:d", 5)]
    assert root.children[0].attributes == {"x": "1", "y": "<2"}


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_lines_are_counted_whatever_ends_them(end: str) -> None:
    text = end.join(["", "", '<?xml version="1.0"?>', "<!-- a", "comment -->", "<a>", "<b/>", "</a>"])
    for data in (text, text.encode()):
        root, _ = read(data)
        assert (root.line, root.children[0].line) == (6, 7)


@pytest.mark.parametrize(
    "data",
    [
        "\ufeff<a n='ä☃𝄞'/>",
        codecs.BOM_UTF8 + "<a n='ä☃𝄞'/>".encode(),
        codecs.BOM_UTF16_LE + "<a n='ä☃𝄞'/>".encode("utf-16-le"),
        codecs.BOM_UTF16_BE + '<?xml version="1.0" encoding="UTF-16"?><a n="ä☃𝄞"/>'.encode("utf-16-be"),
        '<?xml version="1.0" encoding="UTF-16"?><a n="ä☃𝄞"/>'.encode("utf-16-le"),
        codecs.BOM_UTF32_LE + "<a n='ä☃𝄞'/>".encode("utf-32-le"),
        "\r\n\t <?xml version='1.0' encoding='UTF-8'?>\n<a n='ä☃𝄞'/>".encode(),
        # The declaration was not updated when the text was saved in another encoding.
        '<?xml version="1.0" encoding="UTF-16"?><a n="ä☃𝄞"/>'.encode(),
        '<?xml version="1.0" encoding="ISO-8859-1"?><a n="ä☃𝄞"/>',
    ],
)
def test_text_is_read_by_its_mark_its_declaration_or_as_utf8(data: str | bytes) -> None:
    root, notes = read(data)
    assert root.attributes == {"n": "ä☃𝄞"}
    assert notes == []


@pytest.mark.parametrize("encoding", ["ISO-8859-1", "latin-1", "windows-1252", "ISO_8859-15", "GB18030"])
def test_a_declared_encoding_is_used(encoding: str) -> None:
    data = f"<?xml version='1.0' encoding='{encoding}'?>\n<a n='Gelenk ö'/>".encode(encoding)
    root, notes = read(data)
    assert (root.attributes, root.line, notes) == ({"n": "Gelenk ö"}, 2, [])


def test_bytes_that_are_not_utf8_are_latin1_with_a_note() -> None:
    root, notes = read(b"<a>\n<!-- M\xfcller -->\n<b n='\xe4'/></a>")
    assert root.children[0].attributes == {"n": "ä"}
    assert [note.line for note in notes] == [2]
    assert "Latin-1" in notes[0].message


@pytest.mark.parametrize(
    "encoding", ["no-such", "idna", "rot13", "hex", "zlib", "unicode_escape", "undefined"]
)
def test_an_invalid_encoding_raises(encoding: str) -> None:
    error = refusal(f"<?xml version='1.0' encoding='{encoding}'?><a/>".encode())
    assert "encoding" in error.message


def test_null_characters_after_the_end_are_noted() -> None:
    root, notes = read("<a/>\n\0\0")
    assert root.tag == "a"
    assert "null characters" in notes[0].message


@pytest.mark.parametrize(
    ("text", "line", "message"),
    [
        ("", 1, "the text has no element; wanted <robot name=...>"),
        ("  \n ", 2, "the text has no element"),
        ("robot", 1, "not XML"),
        ("\n\n{}", 3, "not XML"),
        ("<a>\n<b>\n", 3, "ends too early"),
        ("<a>\n<b", 2, "ends too early"),
        ("<a>\n<![CDATA[", 2, "ends too early"),
        ("<a>\n<b></a>", 2, "mismatched tag"),
        ("<a>\n<b x=1/></a>", 2, "not well-formed XML: invalid token"),
        ("<a>\n<b x='1' x='2'/></a>", 2, "duplicate attribute"),
        ("<a>\n&#0;</a>", 2, "invalid character number"),
        ("<a/>\ntext", 2, "one root element"),
        ("<a/>\n<b>", 2, "one root element"),
        ("<a/>\n<!-- b", 2, "ends too early"),
        ("<a>\n\ud800</a>", 2, "surrogate"),
    ],
)
def test_malformed_xml_raises_with_its_line(text: str, line: int, message: str) -> None:
    error = refusal(text)
    assert message in error.message
    assert error.line == line


BILLION_LAUGHS = (
    '<?xml version="1.0"?>\n<!DOCTYPE lolz [\n <!ENTITY lol "lol">\n'
    + "".join(f' <!ENTITY lol{k} "{f"&lol{k - 1 or str()};" * 10}">\n' for k in range(1, 10))
    + "]>\n<robot>&lol9;</robot>"
)


@pytest.mark.parametrize(
    "text",
    [
        BILLION_LAUGHS,
        '\n<!DOCTYPE robot SYSTEM "file:///etc/passwd">\n<robot/>',
        '\n<!DOCTYPE robot [<!ENTITY x SYSTEM "http://localhost/">]>\n<robot name="&x;"/>',
    ],
)
def test_a_document_type_is_refused_with_its_line(text: str) -> None:
    error = refusal(text)
    assert "document type" in error.message
    assert error.line == 2


@pytest.mark.parametrize("closed", [True, False])
def test_deep_nesting_is_refused_not_followed(closed: bool) -> None:
    n = 100_000
    error = refusal("<a>\n" * n + ("</a>" * n if closed else ""))
    assert "nested" in error.message
    assert error.line == MAX_DEPTH + 1


def test_nesting_within_the_bound_is_read() -> None:
    root, _ = read("<a>" * MAX_DEPTH + "</a>" * MAX_DEPTH)
    depth = 1
    while root.children:
        (root,) = root.children
        depth += 1
    assert depth == MAX_DEPTH


def test_too_many_elements_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("dynx.model.xml.reading.MAX_ELEMENTS", 10)
    read("<a>" + "<b/>" * 9 + "</a>")
    assert "more than 10 elements" in refusal("<a>" + "<b/>" * 10 + "</a>").message


def test_the_content_of_an_opaque_element_is_checked_but_not_stored() -> None:
    text = "<a><visual><b><visual/></b></visual><c/><visual/><d/></a>"
    root, _ = read(text, frozenset({"visual"}))
    assert [child.tag for child in root.children] == ["visual", "c", "visual", "d"]
    assert all(child.children == [] for child in root.children)
    with pytest.raises(DescriptionError, match="mismatched tag"):
        read("<a><visual><b></visual></a>", frozenset({"visual"}))


def test_one_long_attribute_and_many_attributes_are_read_in_linear_time() -> None:
    many = " ".join(f'a{k}="{k}"' for k in range(MAX_ATTRIBUTES - 1))
    start = time.process_time()
    root, _ = read(f'<a x="{"y" * 5_000_000}" {many}/>')
    assert time.process_time() - start < 10.0
    assert len(root.attributes) == MAX_ATTRIBUTES
    with pytest.raises(DescriptionError, match="1001 attributes; at most 1000 are read"):
        read(f'<a x="y" {many} last=""/>')


def test_character_data_are_kept_where_they_are_asked_for() -> None:
    root = read_xml("<a><b>one<!-- x --> two</b><c>three</c></a>", "x", [], with_text=("b",))
    assert [each.text for each in root.children] == ["one two", ""]
