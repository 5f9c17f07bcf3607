"""Figures by matplotlib, without a window or global state. No other module imports matplotlib."""

from __future__ import annotations

import os
from functools import cache
from io import BytesIO
from pathlib import Path
from typing import Any

from dynx.errors import ArgumentError, NotInstalledError, shown
from dynx.files.writing import atomic_file

RESOLUTION = 200
"""Pixels per inch of a saved picture."""

NOTEBOOK_RESOLUTION = 100
"""Pixels per inch of a picture in a notebook."""


def new_figure(width: float, height: float) -> Any:
    """Make a `matplotlib.figure.Figure` of that size [in]. Raises NotInstalledError without matplotlib."""
    try:
        from matplotlib.figure import Figure
    except ImportError as error:
        raise NotInstalledError("a plot needs matplotlib: pip install 'dynx[plot]'") from error
    return _notebook_figure(Figure)(figsize=(width, height), layout="constrained")


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
