"""The page: well-formed, self-contained, complete, and unharmed by names."""

from __future__ import annotations

import re
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynx.doctor.diagnosis import compare_as_loaded
from dynx.doctor.formats import html_page, read_baseline
from dynx.doctor.formats.html import (
    ALL_STEPS,
    SAME,
    excerpt,
    model_tables,
    step_of,
    template_environment,
)
from dynx.doctor.report import DoctorReport
from dynx.files.lines import lines_of
from dynx.loaded.difference import Deviation
from dynx.rules.registry import all_rules
from tests.doctor.formats.reports import HOSTILE, TEXT, alike, differing, hostile, refused
from tests.files.page import Page, contrast

ALLOWED = {
    *("html", "head", "meta", "title", "style", "body", "header", "main", "footer", "article", "div", "span"),
    *("h1", "h2", "h3", "h4", "p", "a", "br", "b", "i", "strong", "code", "pre", "details", "summary"),
    *("table", "thead", "tbody", "tr", "th", "td", "ul", "li", "dl", "dt", "dd"),
}
"""Elements that fetch nothing and run nothing."""


REPORTS = [differing(), alike("ur5"), refused(), hostile(), differing(base="floating")]


@pytest.mark.parametrize(
    "reports", [[], *[[each] for each in REPORTS], REPORTS], ids=lambda reports: str(len(reports))
)
def test_the_page_is_well_formed_and_needs_nothing_else(reports: list[DoctorReport]) -> None:
    text = html_page(reports, command="dynx doctor a.urdf")
    page = Page(text)
    assert text.isascii()
    assert set(page.tags) <= ALLOWED
    keys = {key for key, _ in page.attributes}
    assert not {key for key in keys if key.startswith("on")} | (
        keys & {"src", "srcset", "style", "action"}
    ) - {"style"}
    assert all(value.startswith("#") for key, value in page.attributes if key == "href")
    assert not re.search(r"url\(|@import|https?:", text)


def test_the_page_of_one_robot_says_everything() -> None:
    page = Page(html_page([differing()], command="dynx doctor arm.urdf"))
    report = differing()
    wanted = [report.source, "DX901", "planted-cause", "mass matrix off by 1900 %", "off by 3e-11 (rounding)"]
    wanted += ["1.9e+01", "line 3", '<link name="base"/>', "+    <inertial>", "p.changeDynamics(robot, link)"]
    wanted += [
        "--choose DX901=keep",
        "inertia must be positive",
        "It loads the mended file.",
        "pinocchio 4.1.0",
    ]
    wanted += [each.call for each in report.engines]
    wanted += ["dynx doctor arm.urdf", "seed 0", "DX903", "q = [0.5]", "no valid mass matrix"]
    assert [words for words in wanted if words is None or words not in page.text] == []


def test_each_number_of_a_property_that_differs_has_a_row() -> None:
    file = [[1.0, 0.0, 0.0], [0.0, 2.0, 0.25], [0.0, 0.25, 3.0]]
    other = [[1.0, 0.0, 0.5], [0.0, 2.5, 0.25], [0.5, 0.25, 3.0]]
    third = [[1.0, 0.0, 0.75], [0.0, 2.0, 0.25], [0.75, 0.25, 3.0]]
    found = (
        Deviation("pybullet", "link", "tool", "inertia", file, other),
        Deviation("drake", "link", "tool", "inertia", file, third),
        Deviation("drake", "joint", "elbow", "axis", [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]),
        Deviation("drake", "joint", "elbow", "axis", [0.0, 0.0, 1.0], None),
    )
    large, small = model_tables(replace(differing(), model_difference=found))
    assert (large.count, small.count) == (4, 0)
    rows = {
        (owner, row.title): (row.file, {engine: text for engine, text in row.engine_values.items() if text})
        for owner, each in large.owners
        for row in each
    }
    numbers = {
        place: (float(text), {engine: float(value) for engine, value in values.items()})
        for place, (text, values) in rows.items()
        if place[1] != "axis"
    }
    assert numbers == {
        ("link tool", "iyy"): (2.0, {"pybullet": 2.5}),
        ("link tool", "ixz"): (0.0, {"pybullet": 0.5, "drake": 0.75}),
        ("joint elbow", "axis y"): (0.0, {"drake": 1.0}),
        ("joint elbow", "axis z"): (1.0, {"drake": 0.0}),
    }
    assert rows["joint elbow", "axis"][1] == {"drake": "not there"}


def test_each_robot_of_many_has_a_row_that_leads_to_it() -> None:
    page = Page(html_page(REPORTS))
    targets = [value[1:] for key, value in page.attributes if key == "href"]
    assert targets == [value for key, value in page.attributes if key == "id"]
    assert len(targets) == len(REPORTS)


def test_a_cause_leads_to_the_page_of_its_rule() -> None:
    rule = all_rules()[0]
    finding = replace(differing().findings[0], rule=rule.id, name=rule.name)
    page = Page(html_page([replace(differing(), findings=(finding,))]))
    assert rule.page() in page.text
    anchor = f"rule-{rule.id.lower()}"
    assert ("href", f"#{anchor}") in page.attributes
    assert ("id", anchor) in page.attributes


@given(st.text(), st.sampled_from(["text", "text | name", "code(text)", "lines(text)", "listed([text])"]))
def test_nothing_escapes_from_text(text: str, printed: str) -> None:
    macros = '{% from "elements.html.j2" import code, listed %}{% from "parts.html.j2" import lines %}'
    template = template_environment().from_string(f"{macros}{{{{ {printed} }}}}")
    written, safe = (template.render(text=each) for each in (text, "x" * (text != "")))
    for mark in "<\">'":
        assert written.count(mark) == safe.count(mark)
    assert all(c.isprintable() or c in "\n\t" for c in written)


@given(st.text(st.characters(exclude_characters="\r"), max_size=20))
def test_a_name_of_any_kind_adds_no_element(text: str) -> None:
    report = differing(text, link=text, joint=text, message=text)
    plain = differing("x", link="y", joint="z", message="w")
    assert Page(html_page([report])).tags == Page(html_page([plain])).tags


def test_a_very_long_name_is_cut() -> None:
    assert len(html_page([hostile()])) < len(html_page([differing()])) + 60 * len(HOSTILE[:200])
    assert "x" * 1000 not in html_page([hostile()])


def test_the_marked_line_is_the_one_that_is_meant() -> None:
    for number, line in enumerate(TEXT.splitlines(), start=1):
        assert (number, line) in excerpt(differing(), number)
        finding = replace(differing().findings[0], line=number)
        page = html_page([replace(differing(), findings=(finding,))])
        here = re.findall(r'<span class="here">(<span class="line">.*?</span>.*?)</span>', page)
        assert [Page(each).text for each in here] == [f"{number}{line}"]


def test_lines_are_those_of_the_file_also_after_empty_lines() -> None:
    text = '\n\n<robot name="a">\n  <link name="b"/>\n</robot>\n'
    report = compare_as_loaded(text.encode(), engines=["pinocchio"])
    assert excerpt(report, 4, around=0) == [(4, '  <link name="b"/>')]


@given(st.lists(st.sampled_from(["a", "\u2028", "\x0b", "\n", "\r\n", "\r"])))
def test_lines_are_counted_as_xml_counts_them(pieces: list[str]) -> None:
    text = "".join(pieces)
    assert len(lines_of(text)) == text.replace("\r\n", "\n").replace("\r", "\n").count("\n") + 1


def test_the_baseline_is_on_the_page() -> None:
    known = read_baseline('{"schema": 1, "known": []}', "known.json")
    assert "4 new, 0 known, 0 gone" in Page(html_page([differing()], baseline=known)).text


def test_numbers_can_be_read_on_every_colour() -> None:
    page = html_page([])
    for step in ALL_STEPS:
        for pair in (step.light, step.dark):
            assert all(re.fullmatch("#[0-9a-f]{6}", colour) and colour in page for colour in pair), step.label
            assert contrast(*pair) >= 4.5, step.label  # what WCAG 2.1 AA asks of text


@given(st.floats(min_value=0.0), st.floats(min_value=0.0))
def test_a_larger_error_is_on_no_lower_step(one: float, other: float) -> None:
    small, large = sorted((one, other))
    assert ALL_STEPS.index(step_of(small, 1e-12)) <= ALL_STEPS.index(step_of(large, 1e-12))
    assert (step_of(one, 1e-12) is SAME) == (one <= 1e-12)
