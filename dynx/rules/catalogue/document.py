"""Form of the document: encoding, lines, repeated and misspelled elements, versions."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from xml.parsers import expat

from dynx.errors import escaped, shown
from dynx.model.xml.source import Edit, SourceElement, Span, XmlSource
from dynx.rules import (
    EVERY_ENGINE,
    Case,
    Correction,
    Detection,
    EditingRule,
    Remedy,
    Rule,
    correction,
    found_at,
    measured_on,
)
from dynx.rules.attributes import ATTRIBUTES, meant_name
from dynx.rules.joints import misspelled_direction
from dynx.rules.numbers_in_text import KNOWN_VERSIONS, corrected_version

_ELEMENTS_THAT_OCCUR_ONCE = {
    "link": ("inertial",),
    "inertial": ("origin", "mass", "inertia"),
    "joint": ("origin", "parent", "child", "axis", "limit", "dynamics", "mimic"),
    "collision": ("origin", "geometry"),
    "visual": ("material",),
    "geometry": ("box", "sphere", "cylinder", "capsule", "mesh"),
    "material": ("color", "texture"),
}
"""Elements that may occur once, by the element that they are in."""


class RepeatedElement(EditingRule):
    """DX411 repeated-element: An element that may occur only once is repeated.

    For example, a joint has two ``<origin>``. This happens when files are merged or templates are expanded.

    - MuJoCo 4.0 refuses the file: "repeated element", with the line. It also refuses repeated elements in
      collisions and materials.
    - Pinocchio 4.1, PyBullet 3.2.7 and Drake 1.51 use the first element and ignore the others without a
      warning. dynx does the same, with a note.

    The engines that read the file agree. But an edit of the second element has no effect.

    What to do: find out which element is right, and remove the other. ``dynx doctor --fix`` keeps the first
    element, which the engines use.
    """

    stage = "reading"
    advice = "Keep the right element; engines use the first."
    engines = measured_on("mujoco")
    changed = "removed repeated elements, of which engines use the first"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield every element after the first of its kind."""
        for part in case.source.root.children:
            if part.tag in ("link", "joint", "material"):
                yield from _repeated_in(case, part)


def _repeated_in(case: Case, part: SourceElement) -> Iterable[Correction]:
    seen = set()
    for child in part.children:
        if child.tag in seen and child.tag in _ELEMENTS_THAT_OCCUR_ONCE[part.tag]:
            message = f"a further <{child.tag}> in the same <{part.tag}>; engines use the first"
            yield correction(child, message, case.source.removal(child))
        elif child.tag in _ELEMENTS_THAT_OCCUR_ONCE:
            yield from _repeated_in(case, child)
        seen.add(child.tag)


MAX_LINE_BYTES = 8191
"""Number of bytes of a line that PyBullet reads at once."""


class LineTooLong(EditingRule):
    """DX413 line-too-long: PyBullet breaks a line of more than 8191 bytes inside an element.

    PyBullet 3.2.7 reads each line into a buffer of 8192 bytes, and inserts a line break into a longer line.
    Between two elements the line break has no effect. Inside an element it can change a number: for example,
    PyBullet reads ``value="2<line break>.5"`` instead of ``value="2.5"``, and the mass is 2, without a
    warning. If the line break is inside the name of an attribute or element, PyBullet refuses the file.

    Some programs write the whole file as one line, to save white space, or because they do not indent.

    Pinocchio 4.1, MuJoCo 4.0 and Drake 1.51 read lines of any length.

    The effect depends on the position of the line break, so any edit of the file may change the effect. The
    result may be a mass without its decimals, an offset of zero, or no error.

    What to do: write one element per line. ``dynx doctor --fix`` inserts a line break before each element of
    such lines, and changes nothing else.
    """

    stage = "reading"
    advice = "Write one element per line."
    engines = measured_on("pybullet")
    changed = "broke lines of more than 8191 bytes in front of their elements"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield every element of which a tag is cut."""
        long_lines = list(_long_lines(case.source.data))
        if not long_lines:
            return
        elements = list(case.source.root.walk())
        broken: set[int] = set()
        for element in elements:
            for line in long_lines:
                cut = _cut_position(case.source.data, element, line)
                if cut is None:
                    continue
                message = (
                    f"a tag of <{element.tag}> is cut: its line has {line.end - line.start} bytes, "
                    f"and byte {cut - line.start} of it falls into the tag"
                )
                edits = () if line.start in broken else tuple(_line_breaks(case.source.data, elements, line))
                broken.add(line.start)
                yield correction(element, message, *edits)


def _long_lines(data: bytes) -> Iterator[Span]:
    start = 0
    while start < len(data):
        end = data.find(b"\n", start)
        end = len(data) if end < 0 else end
        if end - start > MAX_LINE_BYTES:
            yield Span(start, end)
        start = end + 1


def _cut_position(data: bytes, element: SourceElement, line: Span) -> int | None:
    """Return the position in `data` at which PyBullet cuts the start or end tag of the element, if any."""
    tags = [element.start_tag]
    if not element.empty:
        tags.append(Span(data.rindex(b"</", 0, element.span.end), element.span.end))
    for tag in tags:
        first = max(1, -(-(tag.start + 1 - line.start) // MAX_LINE_BYTES))
        cut = line.start + first * MAX_LINE_BYTES
        if tag.start < cut < min(tag.end, line.end):
            return cut
    return None


def _line_breaks(data: bytes, elements: list[SourceElement], line: Span) -> Iterator[Edit]:
    """Yield line breaks in front of the elements of a line, and of the attributes of a long tag."""
    for element in elements:
        tag = element.start_tag
        if line.start < tag.start < line.end and data[line.start : tag.start].strip():
            yield Edit(tag.start, tag.start, "\n")
        if tag.end - max(tag.start, line.start) > MAX_LINE_BYTES:
            for place in element.places.values():
                if line.start < place.start < line.end:
                    yield Edit(place.start, place.start, "\n")


class UnknownUrdfVersion(EditingRule):
    """DX416 unknown-urdf-version: The version of the robot is not a version of URDF.

    An example is ``<robot name="..." version="2.0">``, where the author counts revisions of the file. In URDF
    the attribute is the version of the format.

    - Pinocchio 4.1 refuses a version that is not of the form x.y or not between 1.0 and 1.2.
    - PyBullet 3.2.7, MuJoCo 4.0 and Drake 1.51 ignore it.

    What to do: remove the attribute, or write ``version="1.0"``. ``dynx doctor --fix`` removes the attribute,
    which means version 1.0. There is one exception: an origin with a quaternion needs URDF 1.1. If the file
    has such an origin and the version is above 1.2, ``dynx doctor --fix`` writes ``version="1.2"``.
    """

    stage = "reading"
    advice = "Remove the attribute version, or write 1.0."
    engines = measured_on("pinocchio")
    changed = "removed or corrected the version of the robot"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield the root element."""
        root = case.source.root
        version = root.attributes.get("version")
        if root.tag == "robot" and version is not None and version not in KNOWN_VERSIONS:
            corrected = corrected_version(case)
            edit = (
                case.source.attribute_removal(root, "version")
                if corrected == KNOWN_VERSIONS[0]
                else case.source.attribute_edit(root, "version", corrected)
            )
            yield correction(root, f"<robot> has version {shown(version)}", edit)


_LONE_CARRIAGE_RETURN = re.compile(rb"\r(?![ \t\r]*(?:\n|\Z))")


class LoneCarriageReturn(Rule):
    """DX422 lone-carriage-return: A line ends with a carriage return alone; PyBullet loses the text after it.

    Programs end a line with a line feed (Linux, macOS), or with a carriage return and a line feed (Windows).
    A carriage return alone ended lines on the Macintosh until 2001. Today it comes from conversions of line
    ends and from pasted text. It may end every line of a file, or occur at a single place that no editor
    shows.

    - PyBullet 3.2.7 reads up to the next line feed, at most 8191 bytes. Of this text it drops everything
      after the first carriage return. If the remaining text is not well-formed XML, or lacks a required
      element, PyBullet refuses the file ("Cannot load URDF file"). If only whole elements are lost, such as
      an ``<axis>`` or an ``<origin>``, PyBullet loads another robot without a warning.
    - Pinocchio 4.1, MuJoCo 4.0 and Drake 1.51 read a carriage return as the end of a line, as XML defines it.
      But their error messages count only line feeds. If the file has no line feed, every fault is in line 1.
      Reports of dynx count both kinds of line ends.

    If there are only blanks between the carriage return and the line feed, there is no effect, and dynx does
    not report it.

    What to do: save the file with line feeds. ``dynx doctor --fix`` writes a line feed for each such carriage
    return.
    """

    stage = "reading"
    advice = "Save the file with line feeds."
    engines = measured_on("pybullet")
    unambiguous = True

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield the first such line end."""
        first = _LONE_CARRIAGE_RETURN.search(case.source.data)
        if first is None:
            return
        count = len(_LONE_CARRIAGE_RETURN.findall(case.source.data))
        lines = "a line ends" if count == 1 else f"{count} lines end"
        line = case.source.line_at(first.start())
        yield Detection(None, None, line, f"{lines} with a carriage return alone")

    def remedy(self, case: Case, detections: Sequence[Detection]) -> Remedy | None:
        """Return the file with line feeds."""
        mended = case.with_source(case.source.with_line_feeds())
        return Remedy(mended, "wrote a line feed for each carriage return that stands alone")


class ProcessingInstruction(EditingRule):
    """DX423 processing-instruction: The file has a processing instruction, which no engine accepts.

    A processing instruction, such as ``<?xml-stylesheet ...?>`` or ``<?foo bar?>``, is legal anywhere in XML.
    All four engines parse URDF with tinyxml2, which accepts such text only at the beginning of the file.

    - Pinocchio 4.1, PyBullet 3.2.7, MuJoCo 4.0 and Drake 1.51 refuse the file. They accept an instruction
      only at the beginning of the file, where declarations and other instructions may precede it.
    - dynx ignores the instruction, as XML defines it.

    What to do: remove the instruction, as ``dynx doctor --fix`` does. No engine uses its content.
    """

    stage = "reading"
    advice = "Remove the processing instruction."
    engines = EVERY_ENGINE
    changed = "removed processing instructions"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield the instructions behind anything but declarations."""
        source = case.source
        lines_before = len(source.text_with_lines_before) - len(source.text)
        for start, end, line, target in _instructions(source):
            message = f"engines refuse the processing instruction {shown(f'<?{target}')}"
            yield Correction(Detection(None, None, line + lines_before, message), (Edit(start, end, ""),))


def _instructions(source: XmlSource) -> Iterator[tuple[int, int, int, str]]:
    """Yield start and end [bytes], line and target of each such instruction."""
    found: list[tuple[int, int, int, str]] = []
    parser = expat.ParserCreate(encoding="utf-8")

    def instruction(target: str, _: str) -> None:
        start = parser.CurrentByteIndex
        end = source.data.index(b"?>", start) + len(b"?>")
        found.append((start, end, parser.CurrentLineNumber, target))

    parser.ProcessingInstructionHandler = instruction
    parser.Parse(source.data, True)
    # Declarations at the beginning, and instructions among them, are read.
    at = source.data.index(b"?>") + len(b"?>") if source.data.startswith(b"<?xml ") else 0
    for start, end, line, target in found:
        if not source.data[at:start].strip():
            at = end
        else:
            yield start, end, line, target


_UTF8 = ("utf-8", "ascii", "us-ascii")

_NOT_ASCII_BASED = ("utf-16", "utf-32", "utf-7", "iso-2022", "hz")
"""Encodings in which the markup itself is not written as in ASCII."""


class TextNotUtf8(Rule):
    """DX440 text-not-utf8: The file is not in UTF-8, but engines read every file as UTF-8.

    Engines read every file as UTF-8, and ignore the encoding that the file declares. In a file in Latin-1 or
    a similar encoding, characters beyond ASCII are then invalid. Such characters have no effect in comments.
    In names of links and joints they cause errors:

    - Pinocchio 4.1 and MuJoCo 4.0 load the file, but raise UnicodeDecodeError when a program reads such a
      name.
    - Drake 1.51 raises this error when it loads the file.
    - PyBullet 3.2.7 returns the name as bytes, which ``decode()`` refuses.

    All four engines refuse a file in UTF-16 or UTF-32.

    dynx reads such files in the declared encoding. If a file declares no encoding and is not in UTF-8, dynx
    reads it as Latin-1.

    What to do: save the file in UTF-8. ``dynx doctor --fix`` writes UTF-8, and corrects the declaration.
    """

    stage = "reading"
    advice = "Save the file in UTF-8."
    engines = measured_on("pinocchio", "pybullet", "mujoco", "drake")

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield the first name of a link or joint that engines cannot read, or the root."""
        encoding = case.source.form.encoding.lower()
        if encoding in _UTF8:
            return
        root = case.source.root
        if encoding.startswith(_NOT_ASCII_BASED):
            yield found_at(root, f"the file is in {encoding.upper()}")
            return
        parts = [each for tag in ("link", "joint") for each in root.all(tag)]
        named = [each for each in parts if not each.attributes.get("name", "").isascii()]
        if named:
            first = shown(named[0].attributes["name"])
            others = f", as are {len(named) - 1} other names" if len(named) > 1 else ""
            yield found_at(named[0], f"the name {first} is in {encoding.upper()}{others}")

    def remedy(self, case: Case, detections: Sequence[Detection]) -> Remedy | None:
        """Return the file in UTF-8."""
        return Remedy(case.with_source(case.source.in_utf8()), "saved the file in UTF-8")


_KNOWN_CHILDREN = {
    "robot": ("link", "joint", "material", "transmission"),
    "link": ("inertial", "visual", "collision"),
    "joint": ("origin", "parent", "child", "axis", "limit", "dynamics", "mimic", "calibration"),
    "inertial": ("origin", "mass", "inertia"),
}


class MisspelledWord(Rule):
    """DX515 misspelled-word: An element or attribute is misspelled, so every reader ignores it.

    URDF readers ignore unknown names, mostly without a warning. With ``<intertial>`` the link has no mass,
    with ``<limit uper="1">`` the range ends at 0, and with ``<dynamics dampng="1">`` there is no damping. The
    rule reports an unknown name if a known name is missing and the two are similar, or have the same letters
    in another order (``ryp``). It examines elements of ``<robot>``, ``<link>``, ``<joint>`` and
    ``<inertial>``, and attributes that affect the dynamics. In an ``<origin>`` it also reports ``roll``,
    ``pitch`` and ``yaw`` in place of ``rpy``, and ``x``, ``y`` and ``z`` in place of ``xyz``. Extensions
    (``<gazebo>``, ``<sensor>``, names with a prefix) are not similar to known names.

    All engines ignore the same names. A corrected name changes the robot, possibly against the author's
    intention, so no edit removes the cause.
    """

    kind = "practice"
    skipped = "misspelled words"
    advice = "Correct the spelling, and check the resulting robot."

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield every such word."""
        root = case.source.root
        return [found_at(*each) for part in root.children for each in _misspelled_words(part, root)]


def _misspelled_words(part: SourceElement, root: SourceElement) -> Iterator[tuple[SourceElement, str]]:
    meant = meant_name(part.tag, _KNOWN_CHILDREN["robot"], ())
    if root.tag == "robot" and meant is not None:
        yield part, f"<{part.tag}> is ignored; <{meant}> was meant"
    if part.tag not in ("link", "joint"):
        return
    for element in _dynamic_elements(part):
        known = ATTRIBUTES.get(element.tag, ())
        for attribute in element.attributes:
            meant = meant_name(attribute, known, element.attributes)
            # The direction of an axis under another name has a rule of its own, DX218.
            other_rule = element.tag == "axis" and attribute == misspelled_direction(element)
            if meant is not None and not other_rule:
                yield element, f"{attribute} of <{element.tag}> is ignored; {meant} was meant"
        for child in element.children:
            present = {other.tag for other in element.children}
            meant = meant_name(child.tag, _KNOWN_CHILDREN.get(element.tag, ()), present)
            if meant is not None:
                yield child, f"<{child.tag}> in <{element.tag}> is ignored; <{meant}> was meant"


def _dynamic_elements(part: SourceElement) -> Iterator[SourceElement]:
    """Yield a link or joint and what it holds for dynamics; shapes have words of their own."""
    yield part
    for child in part.children:
        if child.tag in ATTRIBUTES or child.tag == "inertial":
            yield child
            yield from (below for below in child.children if below.tag in ATTRIBUTES)


_XACRO_PREFIX = "xacro:"


class LeftOverXacro(EditingRule):
    """DX531 left-over-xacro: The file has xacro elements, which every engine ignores with their contents.

    The program ``xacro`` evaluates elements such as ``<xacro:property>``, ``<xacro:include>`` and calls of
    macros. These elements remain in a file if someone expanded it by hand, or renamed it from ``.xacro`` to
    ``.urdf``. Pinocchio 4.1, PyBullet 3.2.7, MuJoCo 4.0 and Drake 1.51 ignore these elements without a
    warning, and dynx ignores them with a note. The engines agree, but the robot lacks the links, joints and
    inertias that a macro would write.

    For expressions such as ``${mass}`` in a number, see DX420 and DX429.

    What to do: expand the file with ``xacro``, or load the ``.xacro`` file itself. If nothing is missing,
    remove the elements. By default ``dynx doctor --fix`` leaves them. With ``--choose DX531=remove`` it
    removes them. The rule does not report an attribute ``xmlns:xacro``, which has no effect.
    """

    kind = "practice"
    stage = "reading"
    skipped = "xacro elements that were not expanded"
    advice = "Expand the file with xacro, or remove these elements."
    choices = {
        "keep": "leave xacro elements, which every engine ignores, in the file",
        "remove": "remove xacro elements, which every engine ignores",
    }
    changed = "removed xacro elements"

    def corrections(self, case: Case) -> Iterable[Correction]:
        """Yield one correction for each tag, at its first element."""
        by_tag: dict[str, list[SourceElement]] = {}
        for element in _outermost_xacro(case.source.root):
            by_tag.setdefault(element.tag, []).append(element)
        for tag, elements in by_tag.items():
            times = "" if len(elements) == 1 else f" ({len(elements)} times)"
            message = f"engines skip <{escaped(tag)}>{times}, which xacro did not expand"
            yield correction(elements[0], message, *map(case.source.removal, elements))


def _outermost_xacro(root: SourceElement) -> Iterator[SourceElement]:
    """Yield the xacro elements that are in no other, in document order."""
    waiting = [root]
    while waiting:
        element = waiting.pop()
        if element.tag.startswith(_XACRO_PREFIX):
            yield element
        else:
            waiting.extend(reversed(element.children))


class MalformedXml(Rule):
    """DX532 malformed-xml: The text is not well-formed XML; engines read it, and other programs refuse it.

    All four engines parse URDF with tinyxml2, which accepts some faults. Examples are ``--`` in a comment,
    ``&`` or ``<`` in a name, attributes without white space between them, and a blank after ``<``. It also
    accepts ``<!mesh ...>`` in place of a comment, a malformed or second XML declaration, text before
    ``<robot>`` and elements after ``</robot>``. Pinocchio 4.1, PyBullet 3.2.7, MuJoCo 4.0 and Drake 1.51 load
    such a file without a warning, and read the same robot. Python's XML parsers, xacro and the launch system
    of ROS refuse it.

    dynx reads the file as the engines do, with a note. tinyxml2 and dynx refuse other faults: an attribute
    that occurs twice or has no quotes, and an element that does not end. dynx names the line.

    What to do: correct the fault. Every file that ``dynx doctor --fix`` writes is well-formed.
    """

    stage = "reading"
    kind = "practice"
    advice = "Write well-formed XML."

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield the first fault of each kind."""
        return [Detection(None, None, each.line, each.message) for each in case.source.repairs]
