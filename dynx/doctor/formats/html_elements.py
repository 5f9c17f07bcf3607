"""HTML as text: everything that comes from a report goes through `escape`."""

from __future__ import annotations

import html
from collections.abc import Iterable, Sequence

from dynx.doctor.formats import wording


def escape(text: object) -> str:
    """Text of dynx or of code: markup has no effect, control characters but line breaks are shown."""
    lines = str(text).split("\n")
    return "\n".join(html.escape(_printable(line)) for line in lines)


def name(text: object, limit: int = wording.NAME_LENGTH) -> str:
    """A name from a description: one line, cut where it is very long."""
    return html.escape(wording.name(text, limit))


def code(text: object) -> str:
    """A name or a word in the type of code."""
    return f"<code>{name(text)}</code>"


def pre(text: str) -> str:
    """Lines as they stand."""
    return f"<pre>{escape(text)}</pre>"


def attributes(css: str = "", title: str = "") -> str:
    """The attributes ``class`` and ``title``, as far as there are any."""
    found = f' class="{html.escape(css)}"' if css else ""
    return found + (f' title="{html.escape(title)}"' if title else "")


def cell(content: str, css: str = "", title: str = "") -> str:
    """A ``<td>``; `content` is HTML."""
    return f"<td{attributes(css, title)}>{content}</td>"


def table(head: Sequence[str], rows: Iterable[tuple[str, Sequence[str]]], css: str = "") -> str:
    """A table that scrolls by itself where it is too wide. `head` and the row heads are HTML, the
    cells are ``<td>``; a head that starts with ``>`` is aligned right."""
    heads = "".join(
        f'<th scope="col" class="number">{text[1:]}</th>'
        if text.startswith(">")
        else f'<th scope="col">{text}</th>'
        for text in head
    )
    body = "\n".join(f'<tr><th scope="row">{first}</th>{"".join(cells)}</tr>' for first, cells in rows)
    # It can be reached by keyboard, since it may have to be scrolled.
    return (
        f'<div class="scroll" tabindex="0"><table{attributes(css)}><thead><tr>{heads}</tr></thead>\n'
        f"<tbody>\n{body}\n</tbody></table></div>"
    )


def folded(summary: str, content: str, *, opened: bool = False, css: str = "") -> str:
    """Content behind a line that opens it; both are HTML."""
    state = " open" if opened else ""
    return f"<details{attributes(css)}{state}><summary>{summary}</summary>\n{content}\n</details>"


def _printable(line: str) -> str:
    return "".join(c if c.isprintable() or c == "\t" else repr(c)[1:-1] for c in line)
