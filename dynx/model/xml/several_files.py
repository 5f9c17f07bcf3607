"""Several files read as one model: the file that each element is from, and the bounds of including."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import dataclass, field

from dynx.errors import DescriptionError, UnsupportedFeatureError, nearest, shown
from dynx.files.reading import printable, read_file
from dynx.model.xml.reading import MAX_DEPTH, Element, read_xml
from dynx.model.xml.values import Reading

MAX_INCLUDES = 1000
"""Largest number of files of one model."""


class IncludedLine(int):
    """Line of a file that another one includes or attaches: a number that knows its file."""

    file: str

    def __new__(cls, line: int, file: str = "") -> IncludedLine:
        """Return the line of that number, and keep the file."""
        found = super().__new__(cls, line)
        found.file = file
        return found

    def __getnewargs__(self) -> tuple[int, str]:  # type: ignore[override]  # that of int has no file
        return int(self), self.file


def file_of_line(line: int | None) -> str | None:
    """Return the file of a line that is not of the file that was given; None for another line."""
    return line.file if isinstance(line, IncludedLine) else None


@dataclass
class FilesReading(Reading):
    """State of reading a model whose elements may come from several files."""

    files: dict[int, tuple[Element, str]] = field(default_factory=dict)
    """Element from an included file, and that file, by the identity of the element."""

    included: int = 0
    """Number of files that were included."""

    def source_of(self, element: Element) -> str:
        """Return the file that holds `element`."""
        held = self.files.get(id(element))
        return self.source if held is None else held[1]

    def error(self, element: Element, message: str) -> DescriptionError:
        """Return the error to raise about `element`."""
        return DescriptionError(message, source=self.source_of(element), line=element.line)

    def unsupported(self, element: Element, message: str) -> UnsupportedFeatureError:
        """Return the error to raise about a feature that dynx does not support."""
        return UnsupportedFeatureError(message, source=self.source_of(element), line=element.line)

    def note(self, element: Element, message: str) -> None:
        """Add a note on how `element` was read."""
        source = self.source_of(element)
        super().note(element, message if source == self.source else f"{source}: {message}")

    def require_known_attributes(self, element: Element, known: Iterable[str]) -> None:
        """Raise DescriptionError for an attribute that an element of the format has not."""
        known = tuple(known)
        for attribute in element.attributes:
            if attribute not in known:
                raise self.error(
                    element,
                    f"<{element.tag}> has the unknown attribute {shown(attribute)}"
                    f"{nearest(attribute, known)}",
                )

    def like(self, element: Element, attributes: dict[str, str]) -> Element:
        """Return an element at the place of another one, with other attributes and the same content."""
        new = Element(element.tag, attributes, element.line, element.children, element.text)
        held = self.files.get(id(element))
        if held is not None:
            self.files[id(new)] = (new, held[1])
        return new

    def choice(self, element: Element, attribute: str, what: str, known: Iterable[str], default: str) -> str:
        """Return an attribute that is one of some words."""
        known = tuple(known)
        value = element.attributes.get(attribute, default)
        if value not in known:
            raise self.error(
                element,
                f"{attribute} of {what} is {shown(value)}; wanted one of {', '.join(known)}"
                f"{nearest(value, known)}",
            )
        return value

    def count_included(self, include: Element, depth: int) -> None:
        """Count an included file; raise DescriptionError for too many or too deep ones."""
        self.included += 1
        if depth > MAX_DEPTH or self.included > MAX_INCLUDES:
            raise self.error(include, f"more than {MAX_INCLUDES} files are included")

    def read_included(
        self, path: str, *, opaque: Collection[str] = (), with_text: Collection[str] = ()
    ) -> Element:
        """Read an included file, and return its root element."""
        name = printable(path)
        root = read_xml(read_file(path), name, self.notes, opaque=opaque, with_text=with_text)
        stack = [root]
        while stack:
            each = stack.pop()
            self.files[id(each)] = (each, name)
            each.line = IncludedLine(each.line, name)
            stack += each.children
        return root


def free_name(name: str, taken: Collection[str]) -> str:
    """Return a name that is not taken: `name`, else the first of ``name_2``, ``name_3`` and so on."""
    free, number = name, 2
    while free in taken:
        free, number = f"{name}_{number}", number + 1
    return free
