"""The page of two descriptions: self-contained, with the lines of both, and no markup from names."""

from __future__ import annotations

from pathlib import Path

import pytest

from dynx.model.loading import load
from dynx.model.tree import Base
from dynx.same import same_robot
from dynx.same.formats import SameBaseline, html_page
from dynx.same.formats.html import description_text
from tests.doctor.formats.test_html import ALLOWED
from tests.files.page import Page
from tests.same.formats.reports import FIRST, SECOND, alike, differing, hostile, shorter

ELEMENTS = {"alike": alike, "differing": differing, "shorter": shorter, "hostile": hostile}


@pytest.mark.parametrize("name", ELEMENTS)
def test_the_page_is_well_formed_and_needs_nothing_else(name: str) -> None:
    text = html_page(ELEMENTS[name](), texts=(FIRST, SECOND), command="dynx same a.urdf b.urdf")
    page = Page(text)
    assert text.isascii()
    assert set(page.tags) <= ALLOWED
    assert {key for key, _ in page.attributes} <= {
        *("class", "tabindex", "scope", "charset", "lang", "content", "http-equiv", "name", "open")
    }


def test_the_page_shows_the_lines_of_both_files() -> None:
    page = Page(html_page(differing(), texts=(FIRST, SECOND), command="dynx same a.urdf b.urdf"))
    for each in differing().differences:
        for wanted in (each.theirs, each.part, each.first, each.second, each.wanted):
            assert wanted in page.text
        for text, line in ((FIRST, each.first_line), (SECOND, each.second_line)):
            assert line is not None
            assert text.splitlines()[line - 1] in page.text
    for words in ("damping", "dynx same a.urdf b.urdf", "What mending changes", "Tolerance 1e-09"):
        assert words in page.text


def test_a_baseline_is_counted() -> None:
    page = Page(html_page(differing(), baseline=SameBaseline()))
    assert f"{len(differing().differences)} new, 0 known, 0 gone" in page.text


def test_a_file_that_includes_others_has_no_excerpts(tmp_path: Path) -> None:
    (tmp_path / "part.xml").write_text("<mujoco><option/></mujoco>", encoding="utf-8")
    body = '<body name="b"><joint/><inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/></body>'
    for name, more in (("a.xml", ""), ("b.xml", '<include file="part.xml"/>')):
        (tmp_path / name).write_text(
            f"<mujoco>{more}<worldbody>{body}</worldbody></mujoco>", encoding="utf-8"
        )
    paths = [str(tmp_path / name) for name in ("a.xml", "b.xml")]
    assert same_robot(*paths).same
    assert [description_text(path) is None for path in paths] == [False, True]


def test_the_page_names_the_bases() -> None:
    assert "fixed base." in Page(html_page(alike())).text
    model = load(FIRST)
    pairs: tuple[tuple[Base, Base], ...] = (("fixed", "floating"), ("floating", "fixed"))
    for first, second in pairs:
        report = same_robot(model.with_base(first), model.with_base(second))
        assert f"{first} base against a {second} one." in Page(html_page(report)).text
