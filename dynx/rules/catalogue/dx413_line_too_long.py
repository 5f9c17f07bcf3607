"""DX413 line-too-long: PyBullet cuts a line of more than 8191 bytes, and the cut falls into an element.

PyBullet 3.2.7 reads a file line by line into 8192 bytes, and puts a line break where a line does not fit.
Between elements that has no effect. Inside an element it can: where the cut falls into ``value="2.5"``,
PyBullet reads ``value="2<line break>.5"``, and the mass is 2. It prints no warning. Inside the name of an
attribute or a tag the file is refused.

Files of one long line are written by programs that save white space: minified XML, or the output of
serialisers that do not indent.

Pinocchio 4.1, MuJoCo 4.0 and Drake 1.51 read lines of any length.

The effect depends on which byte is the 8191st, so it comes and goes with every edit of the file: a mass off
by its decimals, an offset that is zero, or nothing.

What to do: write one element per line. ``dynx doctor --fix`` breaks such lines in front of each element and
changes nothing else.
"""

from collections.abc import Iterable, Iterator

from dynx.model.xml.source import Edit, SourceElement, Span
from dynx.rules import Case, Correction, EditingRule, correction, measured_on

MAX_LINE_BYTES = 8191
"""Number of bytes of a line that PyBullet reads at once."""


class LineTooLong(EditingRule):
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
                edits = () if line.start in broken else tuple(_breaks(case.source.data, elements, line))
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


def _breaks(data: bytes, elements: list[SourceElement], line: Span) -> Iterator[Edit]:
    """Yield line breaks in front of the elements of a line, and of the attributes of a long tag."""
    for element in elements:
        tag = element.start_tag
        if line.start < tag.start < line.end and data[line.start : tag.start].strip():
            yield Edit(tag.start, tag.start, "\n")
        if tag.end - max(tag.start, line.start) > MAX_LINE_BYTES:
            for place in element.places.values():
                if line.start < place.start < line.end:
                    yield Edit(place.start, place.start, "\n")
