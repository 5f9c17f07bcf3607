"""HTML tables by which notebooks show objects."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from html import escape


def html_table(title: str, rows: Mapping[str, object]) -> str:
    """Return a table of two columns under a title; text is escaped."""
    return html_grid(title, (), ((name, value) for name, value in rows.items()))


def html_grid(title: str, head: Iterable[str], rows: Iterable[Iterable[object]]) -> str:
    """Return a table with a head under a title; text is escaped."""
    top = "".join(f"<th>{escape(name)}</th>" for name in head)
    body = "".join(
        "<tr>" + "".join(f"<td>{escape(str(cell))}</td>" for cell in row) + "</tr>" for row in rows
    )
    return f"<table><caption>{escape(title)}</caption>{f'<tr>{top}</tr>' if top else ''}{body}</table>"
