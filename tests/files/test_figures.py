"""Figures are shown by notebooks as pictures, without a backend of matplotlib."""

from __future__ import annotations

import pytest

from dynx.files.figures import NOTEBOOK_RESOLUTION, new_figure


def test_a_notebook_shows_a_figure_as_a_picture() -> None:
    pytest.importorskip("matplotlib")
    figure = new_figure(2.0, 1.5)
    figure.subplots().plot([0.0, 1.0], [1.0, 0.0])
    picture = figure._repr_png_()
    assert picture.startswith(b"\x89PNG\r\n")
    width, height = (int.from_bytes(picture[k : k + 4], "big") for k in (16, 20))
    assert (width, height) == (2.0 * NOTEBOOK_RESOLUTION, 1.5 * NOTEBOOK_RESOLUTION)
