"""HTML for people: pages of one self-contained file without scripts, for screen and paper, and tables for
notebooks.

No other module imports Jinja2. The folder `templates` holds the frame, the colours and the parts that all
pages share; a package has its own beside its module. Everything they print is escaped, and control characters
are made visible: names in a description may hold anything.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from html import escape
from typing import TYPE_CHECKING, Any

from dynx._version import __version__

if TYPE_CHECKING:
    from jinja2 import Environment as Environment
    from jinja2 import Template


def page_environment(package: str) -> Environment:
    """Return the templates of a package, which also find those of this room."""
    from jinja2 import ChoiceLoader, Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=ChoiceLoader([PackageLoader(package), PackageLoader("dynx.files")]),
        autoescape=True,
        finalize=_printable,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.globals["version"] = __version__
    environment.filters["capitalized"] = lambda text: text[:1].upper() + text[1:]
    return environment


def page_text(template: Template, **values: Any) -> str:
    """Make a page in ASCII, which no encoding of a server or an editor changes."""
    return template.render(values).encode("ascii", "xmlcharrefreplace").decode("ascii")


def _printable(value: Any) -> Any:
    """Make the control characters of a text visible, except line breaks and tabs; markup stays as it is."""
    if not isinstance(value, str) or hasattr(value, "__html__"):
        return value
    return "".join(c if c.isprintable() or c in "\n\t" else repr(c)[1:-1] for c in value)


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
