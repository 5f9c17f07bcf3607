"""The page of ``dynx contacts``: well-formed, self-contained, complete, and unharmed by names."""

from __future__ import annotations

import json
import math
import re
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dynx.cli.contacts.page import ENGINE_STYLES, contacts_page, draw_errors, plots
from dynx.cli.contacts.run import document
from dynx.cli.contacts.wording import exact_text, figures_by_name, headline, measured_text, verdict_text
from dynx.contacts import Verdict
from dynx.files.documents import json_text
from tests.cli.contacts.documents import ENGINES, STEPS, at_one_step, conformance, example, result
from tests.examples import PROFILE
from tests.files.page import Page, contrast

ALLOWED = {
    *("html", "head", "meta", "title", "style", "body", "header", "main", "footer", "section", "div", "span"),
    *("h1", "h2", "h3", "h4", "p", "a", "code", "pre", "details", "summary", "figure", "figcaption"),
    *("table", "thead", "tbody", "tr", "th", "td", "ul", "li", "dl", "dt", "dd"),
    *("svg", "wbr", "b", "g", "defs", "path", "use", "text"),
}
"""Elements that fetch nothing and run nothing."""


def test_the_page_is_well_formed_and_needs_nothing_else() -> None:
    text = contacts_page(example(not_done=3), command="dynx contacts")
    page = Page(text)
    assert text.isascii()
    assert set(page.tags) <= ALLOWED
    assert not {key for key, _ in page.attributes if key.startswith("on") or key in ("src", "style")}
    assert all(value.startswith("#") for key, value in page.attributes if key == "href")
    assert not re.search(r"url\(|@import|https?:", text)


def test_the_page_says_everything() -> None:
    words = " ".join(Page(contacts_page(example(not_done=3), command="dynx contacts --jobs 2")).text.split())
    wanted = [
        *("1 of 9 errors are unexplained. 1 runs failed.", "3 trials of an engine were not done"),
        *(
            "one ran with impratio=10.0",
            "sliding, acceleration, slow",
            "1.0e-01 .. 1.0e-01 \u2192 1.0e-03 .. 1.0e-03",
            "order 1.0",
        ),
        *("impedance 0.9 \u2192 0.99, impratio 1 \u2192 100", "Contacts are soft.", "Contacts are springs."),
        *("(exact: -2 m/s^2)", "not finite", "crash two at 4 ms, upward: word", "dynx contacts --jobs 2"),
        *("within the tolerance in every engine: word, fast", "one 1.0", "99 runs, 12.5 s", "cannot: word"),
    ]
    assert [each for each in wanted if each not in words] == []


@pytest.mark.parametrize("number", [0, 1])
def test_a_page_without_results_is_well_formed(number: int) -> None:
    document = example()
    document["cases"] = document["cases"][:number]
    for case in document["cases"]:
        case["figures"] = []
    assert "Cases and engines" in Page(contacts_page(document)).text


def test_the_page_says_that_a_single_step_cannot_show_what_falls() -> None:
    note = "Measured at a single step: no error can be judged as falling with it"
    several = example()
    single = document(at_one_step(conformance()), 12.5)
    assert [note in Page(contacts_page(each)).text for each in (single, several)] == [True, False]


MARKUP = ("<b>", "</td>", "<script>", "<!--", "&lt;", "&", '"', "'", "$x^2$", "$", "\\", "{", "]]>")
"""What means something in HTML, in SVG, or in the text of a plot."""

hostile = st.lists(st.sampled_from(MARKUP) | st.text(max_size=5), max_size=6).map("".join)


@pytest.fixture(scope="module")
def tags() -> list[str]:
    """Return the tags of a page whose names hold nothing that has to be escaped."""
    return Page(contacts_page(example("x"))).tags


@settings(max_examples=min(PROFILE, max(12, PROFILE // 4)))
@given(hostile)
def test_nothing_escapes_from_text(tags: list[str], text: str) -> None:
    assert Page(contacts_page(example(text))).tags == tags


def test_the_page_of_the_written_document_is_the_same() -> None:
    document = example()
    assert contacts_page(json.loads(json_text(document))) == contacts_page(document)


def test_lines_hold_the_errors_and_triangles_have_their_order() -> None:
    (case,) = example()["cases"]
    fast, slow = ([*found.values()] for found in [*figures_by_name(case).values()][:2])
    for figures in (fast, slow):
        (axes,) = draw_errors(figures, STEPS, ENGINES).axes
        (left, right), (low, high) = axes.get_xlim(), axes.get_ylim()
        named = {line.get_gid(): line for line in axes.lines}
        for number, each in enumerate(figures):
            line = named[f"e{number} line"]
            assert [left < x < right for x in line.get_xdata()] == [True] * len(STEPS)
            shown = [max(error, low) if math.isfinite(error) else high for error in each["errors"]]
            assert line.get_ydata() == pytest.approx(shown)
            assert (f"e{number} line changed" in named) == (each["attribution"] is not None)
    (axes,) = draw_errors(fast, STEPS, ENGINES).axes
    (triangle,) = (patch for patch in axes.patches if patch.get_gid() == "order")
    (x0, y0), (x1, y1), _ = triangle.get_xy()[:3]
    assert math.log(y1 / y0) / math.log(x1 / x0) == pytest.approx(1.0)
    assert [text.get_text().strip() for text in axes.texts] == ["1.0"]


def test_a_plot_names_what_it_shows_and_takes_the_colours_of_the_page() -> None:
    text = contacts_page(example())
    labels = [value for key, value in Page(text).attributes if key == "aria-label"]
    (case,) = example()["cases"]
    assert labels == [f"error of {plot.title} over the step" for plot in plots(case, STEPS, ENGINES)]
    classes = {value for key, value in Page(text).attributes if key == "class"}
    assert {"grid", "within", "frame", "order", "e0 line", "e0 line changed"} <= classes


def test_lines_can_be_seen_on_either_page() -> None:
    parts = re.findall(r":root {[^}]*--e0.*?}", contacts_page(example()))
    light, dark = (dict(re.findall(r"--(e\d): (#\w{6})", part)) for part in parts)
    assert len(light) == len(dark) == ENGINE_STYLES
    for colours, ground in ((light, "#ffffff"), (dark, "#0f1317")):
        assert all(contrast(colour, ground) >= 3.0 for colour in colours.values())  # WCAG 2.1, graphics


def test_the_headline_counts_what_an_engine_cannot_do_apart() -> None:
    counts = {"within": 2, "falls": 3, "cannot": 4, "setting": 5, "unexplained": 0}
    text = headline(counts)
    assert text.startswith("No error is unexplained")
    assert "4 that the engine cannot avoid" in text


def test_bounds_are_written_with_what_was_measured_between_them() -> None:
    bounded = replace(result(verdict=Verdict("within")), exact=-3.0, most=4.0)
    (case,) = document(replace(conformance(), results=(bounded,)), 1.0)["cases"]
    (entry,) = case["figures"]
    assert exact_text(entry) == "-3 .. 4 m/s^2"
    assert measured_text(entry) == "-2.08 m/s^2 .. -2.02 m/s^2"
    assert verdict_text(entry) == (
        "within the tolerance; measured -2.08 m/s^2 .. -2.02 m/s^2, bounds -3 .. 4 m/s^2"
    )
    alone = {**entry, "measured": [1.5], "most": None}
    assert (measured_text(alone), exact_text(alone)) == ("1.5 m/s^2", "-3 m/s^2")
    assert verdict_text(alone) == "within the tolerance"
