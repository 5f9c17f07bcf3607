"""Decoding of XML documents: byte-order marks, declared encodings, stray characters at the ends; quoting of
attributes."""

from __future__ import annotations

import codecs
import re
from dataclasses import dataclass

from dynx.errors import DescriptionError, shown
from dynx.model.elements import Note

# The longer ones of two that begin alike come first.
_MARKS = (
    (codecs.BOM_UTF8, "utf-8"),
    (codecs.BOM_UTF32_LE, "utf-32-le"),
    (codecs.BOM_UTF32_BE, "utf-32-be"),
    (codecs.BOM_UTF16_LE, "utf-16-le"),
    (codecs.BOM_UTF16_BE, "utf-16-be"),
)
_DECLARED = re.compile(rb"""\s*<\?xml\b[^>]{0,200}?\bencoding\s*=\s*["']([A-Za-z0-9._-]{1,40})["']""")
_WIDE = ("utf-16", "utf-32", "utf16", "utf32", "ucs", "iso-10646")
_NOT_CHARACTER_SETS = frozenset(
    {"idna", "punycode", "undefined", "unicode-escape", "raw-unicode-escape", "mbcs", "oem"}
)


@dataclass(frozen=True)
class TextForm:
    """Encoding of a document, and the characters before and after its XML text."""

    encoding: str = "utf-8"
    front: str = ""
    end: str = ""

    def encode(self, text: str) -> bytes:
        """Return the bytes of the document; characters missing in the encoding become references."""
        return f"{self.front}{text}{self.end}".encode(self.encoding, "xmlcharrefreplace")


def decode(data: bytes, source: str, notes: list[Note]) -> str:
    """Return the text of `data`, decoded by its byte-order mark, its declared encoding, or as UTF-8.

    Text that should be UTF-8 but is not is read as Latin-1, with a note: such bytes occur in comments of old
    files, which every engine reads.
    """
    return decode_with_encoding(data, source, notes)[0].removeprefix("\ufeff")


def decode_with_encoding(data: bytes, source: str, notes: list[Note]) -> tuple[str, str]:
    """Return the text like `decode`, but with its byte-order mark, and its encoding."""
    for mark, encoding in _MARKS:
        if data.startswith(mark):
            return "\ufeff" + _decode_strictly(data[len(mark) :], encoding, source), encoding
    for start, encoding in ((b"<\0", "utf-16-le"), (b"\0<", "utf-16-be")):
        if data.startswith(start):
            return _decode_strictly(data, encoding, source), encoding
    declared = _DECLARED.match(data)
    name = declared.group(1).decode("ascii").lower().replace("_", "-") if declared else "utf-8"
    # The declaration itself was read as ASCII, so the text cannot be in 16 or 32 bits.
    if name in ("utf8", "utf-8", "utf-8-sig", "ascii", "us-ascii") or name.startswith(_WIDE):
        try:
            return data.decode("utf-8"), "utf-8"
        except UnicodeDecodeError as error:
            line = data.count(b"\n", 0, error.start) + 1
            notes.append(Note("not valid UTF-8; read as Latin-1", line))
            return data.decode("latin-1"), "latin-1"
    return _decode_strictly(data, name, source), name


def strip_ends(text: str, notes: list[Note]) -> tuple[str, int]:
    """Return `text` without a byte-order mark, leading white space and trailing null characters.

    Also returns the number of lines removed in front.
    """
    text = text.removeprefix("\ufeff")
    if text.endswith("\0"):
        text = text.rstrip("\0")
        notes.append(Note("null characters after the end were ignored"))
    stripped = text.lstrip(" \t\r\n\ufeff")
    front = text[: len(text) - len(stripped)]
    return stripped, len(re.findall(r"\r\n|\r|\n", front))


def _decode_strictly(data: bytes, encoding: str, source: str) -> str:
    if encoding in _NOT_CHARACTER_SETS:
        message = f"declares the encoding {shown(encoding)}, which is not a character set"
        raise DescriptionError(message, source=source)
    try:
        return data.decode(encoding)
    except LookupError:
        message = f"declares the encoding {shown(encoding)}, which is unknown"
        raise DescriptionError(message, source=source) from None
    except UnicodeError as error:
        reason = getattr(error, "reason", str(error))
        raise DescriptionError(f"is not valid {encoding}: {reason}", source=source) from None


_ESCAPES = str.maketrans({"&": "&amp;", "<": "&lt;", ">": "&gt;", "\n": "&#10;", "\r": "&#13;", "\t": "&#9;"})


def quoteattr(text: str) -> str:
    """Return a text as the value of an attribute, in quotes, as `xml.sax.saxutils.quoteattr` does.

    That module imports an HTTP client, which takes a sixth of the time in which models are imported.
    """
    escaped = text.translate(_ESCAPES)
    if '"' not in escaped:
        return f'"{escaped}"'
    if "'" not in escaped:
        return f"'{escaped}'"
    return '"' + escaped.replace('"', "&quot;") + '"'
