"""Figures are shown by notebooks as pictures, without a backend of matplotlib."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree

import pytest

from dynx.files.figures import NOTEBOOK_RESOLUTION, line_style, literal, new_figure, svg_element


def test_a_notebook_shows_a_figure_as_a_picture() -> None:
    pytest.importorskip("matplotlib")
    figure = new_figure(2.0, 1.5)
    figure.subplots().plot([0.0, 1.0], [1.0, 0.0])
    picture = figure._repr_png_()
    assert picture.startswith(b"\x89PNG\r\n")
    width, height = (int.from_bytes(picture[k : k + 4], "big") for k in (16, 20))
    assert (width, height) == (2.0 * NOTEBOOK_RESOLUTION, 1.5 * NOTEBOOK_RESOLUTION)


def drawn(gid: str) -> str:
    """Return the SVG element of a curve with this group name, and of a title."""
    figure = new_figure(2.0, 1.5)
    axes = figure.subplots()
    (curve,) = axes.plot([0.0, 1.0, 2.0], [1.0, 0.0, 3.0], marker="o", color="red")
    curve.set_gid(gid)
    axes.set_title("torque [N m]")
    return svg_element(figure)


def test_an_svg_element_is_styled_by_the_page_and_refers_to_nothing_else() -> None:
    pytest.importorskip("matplotlib")
    text = drawn("elbow")
    root = ElementTree.fromstring(text)
    assert root.tag == "svg"
    assert root.attrib.keys() == {"viewBox"}
    size = [float(number) for number in root.attrib["viewBox"].split()]
    assert size == pytest.approx([0.0, 0.0, 2.0 * 72.0, 1.5 * 72.0])
    assert not {"metadata", "style", "clipPath"} & {each.tag for each in root.iter()}
    assert not {"style", "clip-path"} & {name for each in root.iter() for name in each.attrib}
    # Text is text, that can be searched and has the font of the page.
    assert "torque [N m]" in ["".join(each.itertext()).strip() for each in root.iter("text")]
    groups = list(root.iter("g"))
    assert "elbow" in [each.get("class") for each in groups]
    assert not any("id" in each.attrib for each in groups)
    # Markers are used by their name in the same element, in the colour of what uses them.
    names = {each.get("id") for each in root.iter() if "id" in each.attrib}
    used = {each.attrib["href"] for each in root.iter() if "href" in each.attrib}
    assert used
    assert used <= {f"#{name}" for name in names}
    assert not any("stroke" in marker.attrib for marker in root.findall(".//defs/path"))
    assert any("#ff0000" in each.attrib.values() for each in root.iter("path"))
    # Without a background: no area is filled.
    fills = re.findall(r'fill="(#[0-9a-f]+)"', text)
    assert "#ffffff" not in fills


def test_equal_figures_have_equal_svg_elements() -> None:
    pytest.importorskip("matplotlib")
    assert drawn("elbow") == drawn("elbow")
    assert drawn("elbow") == drawn("wrist").replace("wrist", "elbow")


@pytest.mark.parametrize("own", [False, True])
def test_a_file_of_settings_in_the_current_folder_changes_no_figure(tmp_path: Path, own: bool) -> None:
    pytest.importorskip("matplotlib")
    here, settings = tmp_path / "here", tmp_path / "settings"
    here.mkdir()
    settings.mkdir()
    if own:
        (settings / "matplotlibrc").write_text("lines.linewidth: 5\n", encoding="utf-8")
    program = (
        "from dynx.files.figures import new_figure, svg_element\n"
        "figure = new_figure(2.0, 1.5)\n"
        "figure.subplots().plot([0.0, 1.0])\n"
        "import matplotlib\n"
        "print(svg_element(figure), dict(matplotlib.rcParams))\n"
    )
    printed = []
    for text in ("lines.linewidth: 37\nbackend: module://evil\nfont.size: 3\n", None):
        file = here / "matplotlibrc"
        file.unlink(missing_ok=True)
        if text is not None:
            file.write_text(text, encoding="utf-8")
        run = subprocess.run(
            [sys.executable, "-c", program],
            capture_output=True,
            text=True,
            cwd=here,
            env={**os.environ, "MPLCONFIGDIR": str(settings)},
            check=True,
        )
        printed.append(run.stdout)
    assert printed[0] == printed[1]
    assert ("'lines.linewidth': 5.0" in printed[0]) == own


def test_names_are_shown_as_they_are() -> None:
    name = "_arm$1$"
    axes = new_figure(2.0, 2.0).subplots()
    axes.plot([0.0, 1.0], label=literal(name), **line_style(13))
    (handle,), (label,) = axes.get_legend_handles_labels()
    text = axes.legend().get_texts()[0]
    assert text.get_text().strip() == label.strip() == r"_arm\$1\$"
    element = ElementTree.fromstring(svg_element(axes.figure))
    assert name in {(each.text or "").strip() for each in element.iter("text")}
    assert (handle.get_linestyle(), handle.get_color()) == ("--", "C3")
