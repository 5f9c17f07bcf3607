"""HTML page of two descriptions side by side: one self-contained file without scripts."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

from dynx._version import __version__
from dynx.errors import escaped
from dynx.files.excerpts import TextChanges, excerpt_of, text_changes
from dynx.files.pages import page_environment, page_text
from dynx.model.loading import read_description
from dynx.model.xml.several_files import file_of_line
from dynx.model.xml.source import XmlSource
from dynx.same.formats.baseline import SameBaseline
from dynx.same.formats.findings import bases_text
from dynx.same.report import SameReport

if TYPE_CHECKING:
    from dynx.files.pages import Environment

MAX_ROWS = 500
"""Largest number of elements, and of rows of a table; the JSON document has all."""


Texts = tuple[str | None, str | None]
"""Texts of both descriptions, for excerpts; None where they are not known."""


def html_page(
    report: SameReport,
    *,
    texts: Texts = (None, None),
    command: str | None = None,
    baseline: SameBaseline | None = None,
) -> str:
    """Make the page, in ASCII, with lines of both `texts`, and the `command` line that reproduces it."""
    footer = f"dynx {__version__}. Tolerance {report.tolerance:g}, {bases_text(report)}. "
    return page_text(
        template_environment().get_template("same.html.j2"),
        report=report,
        texts=texts,
        changes=changes(report, texts[1]),
        comparison=None if baseline is None else baseline.compare(report),
        command=command,
        footer=f"{footer}{report.seconds:.1f} s.",
    )


@cache
def template_environment() -> Environment:
    """Return the templates with the functions that they use."""
    environment = page_environment("dynx.same.formats")
    environment.filters.update({"name": escaped, "size": size})
    environment.globals.update({"excerpt": excerpt, "MAX_ROWS": MAX_ROWS})
    return environment


def size(value: float | None) -> str:
    """Write a relative size with two digits."""
    return "" if value is None else "0" if value == 0.0 else f"{value:.2g}"


def excerpt(text: str | None, line: int | None) -> list[tuple[int, str]]:
    """Return the lines about `line` with their numbers; none where the text or the line is unknown."""
    if text is None or line is None or file_of_line(line) is not None:
        return []
    return excerpt_of(text, line)


def changes(report: SameReport, text: str | None) -> TextChanges | None:
    """Compare the `text` of the second file with the mended one; None where nothing was mended or `text` is
    None."""
    if text is None or report.mended_text is None:
        return None
    return text_changes(text, report.mended_text.decode("utf-8", "replace"))


def description_text(robot: str) -> str | None:
    """Return the text to which the line numbers of the elements refer; None where it includes other files."""
    data, source, _ = read_description(robot)
    found = XmlSource(data, source)
    if any(each.tag in ("include", "attach") for each in found.root.walk()):
        return None
    return found.text_with_lines_before
