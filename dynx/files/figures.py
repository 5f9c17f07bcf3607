"""Figures by matplotlib, without a window or global state, as files or in pages. No other module imports
matplotlib."""

from __future__ import annotations

import os
import sys
from functools import cache
from io import BytesIO
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from dynx.errors import ArgumentError, importing, shown
from dynx.files.writing import atomic_file

RESOLUTION = 200
"""Pixels per inch of a saved picture."""

NOTEBOOK_RESOLUTION = 100
"""Pixels per inch of a picture in a notebook."""

LINE_STYLES = ("-", "--", "-.", ":")
"""Styles of lines, which distinguish curves also in print without colour."""


def line_style(k: int) -> dict[str, Any]:
    """Return the colour and the style of the k-th curve of a panel."""
    return {"color": f"C{k % 10}", "linestyle": LINE_STYLES[k % len(LINE_STYLES)]}


def literal(text: str) -> str:
    """Escape a text so that matplotlib shows it as it is: neither as a formula nor hidden from the legend."""
    return (" " if text.startswith("_") else "") + text.replace("$", r"\$")


def new_figure(width: float, height: float) -> Any:
    """Make a `matplotlib.figure.Figure` of that size [in]. Raises NotInstalledError without matplotlib."""
    Figure = _matplotlib().figure.Figure
    return _notebook_figure(Figure)(figsize=(width, height), layout="constrained")


def _matplotlib() -> Any:
    """Import matplotlib, whose settings do not depend on the folder that a program is called in."""
    is_first = "matplotlib" not in sys.modules
    with importing("a plot needs matplotlib: pip install 'dynx[plot]'"):
        import matplotlib.figure
    if not is_first:
        return matplotlib
    read = Path(matplotlib.matplotlib_fname())
    own = Path(matplotlib.get_configdir())
    if read.resolve().parent == Path.cwd() != own.resolve():
        # A file of the current folder comes first; those that come next are the user's own, and the default.
        candidates = (os.environ.get("MATPLOTLIBRC", ""), str(own))
        files = [os.path.join(each, "matplotlibrc") if os.path.isdir(each) else each for each in candidates]
        found = next((each for each in files if os.path.isfile(each)), None)
        settings = matplotlib.rcParamsDefault if found is None else matplotlib.rc_params_from_file(found)
        # As dictionaries: `update` would look for a backend that shows windows, and keep the one of the file.
        dict.update(matplotlib.rcParams, dict.items(settings))
    return matplotlib


@cache
def _notebook_figure(figure_class: type[Any]) -> type[Any]:
    """Return the class of figures that notebooks show as pictures, with or without ``%matplotlib inline``."""

    class NotebookFigure(figure_class):  # type: ignore[misc]
        """A figure that draws itself where matplotlib has no window and no notebook to draw in."""

        def _repr_png_(self) -> bytes:
            data = BytesIO()
            self.savefig(data, format="png", dpi=NOTEBOOK_RESOLUTION)
            return data.getvalue()

    return NotebookFigure


def picture_format(path: str | os.PathLike[str]) -> str:
    """Return the format that the name of a picture ends with, such as ``png``.

    Raises ArgumentError for a format that matplotlib does not write, NotInstalledError without matplotlib.
    """
    formats = new_figure(1.0, 1.0).canvas.get_supported_filetypes()
    suffix = Path(path).suffix[1:].lower()
    if suffix not in formats:
        raise ArgumentError(f"a plot is saved as .png, .pdf or .svg, not as {shown(Path(path).name)}")
    return suffix


def save_figure(figure: Any, path: str | os.PathLike[str]) -> None:
    """Write a figure to a file, in the format that its name ends with, atomically.

    Raises ArgumentError for a format that matplotlib does not write or a file that cannot be written.
    """
    kind = picture_format(path)
    with atomic_file(path) as file:
        figure.savefig(file, format=kind, dpi=RESOLUTION)


def svg_element(figure: Any) -> str:
    """Return a figure as an SVG element for a page, whose style sheet may decide on colours and fonts.

    What has a ``gid`` has it as its class. Text stays text. The background is that of the page; nothing is
    clipped, and nothing refers to other files.
    """
    from matplotlib import rc_context

    figure.patch.set_visible(False)
    for axes in figure.axes:
        axes.patch.set_visible(False)
    data = BytesIO()
    with rc_context({"svg.fonttype": "none", "svg.hashsalt": "dynx"}):
        figure.savefig(data, format="svg", metadata={"Date": None})
    root = ElementTree.fromstring(data.getvalue())
    for parent in root.iter():
        for child in list(parent):
            if child.tag.endswith(("metadata", "style", "clipPath")):
                parent.remove(child)
    width, height = root.attrib["viewBox"].split()[2:]
    root.attrib = {"viewBox": f"0 0 {width} {height}"}
    for each in root.iter():
        each.tag = each.tag.rpartition("}")[2]
        given = {name.rpartition("}")[2]: value for name, value in each.attrib.items() if name != "clip-path"}
        # A style sheet overrides attributes, but not styles.
        styles = [pair.partition(":") for pair in given.pop("style", "").split(";") if pair.strip()]
        given |= {name.strip(): value.strip() for name, _, value in styles}
        if each.tag == "g" and "id" in given:
            given["class"] = given.pop("id")
        each.attrib = given
    for marker in root.findall(".//defs/path"):
        # What uses a marker decides on its colour, since markers of several figures share one name.
        marker.attrib.pop("stroke", None)
    return ElementTree.tostring(root, encoding="unicode")
