"""A document that is too large to be examined is refused at its line, before any engine loads it."""

from __future__ import annotations

import pytest

from dynx.doctor import diagnose, examination
from tests.rules.documents import case_of, joint, link

PAIR = case_of(link("base"), link("arm"), joint("elbow", "base", "arm")).source.text


ELEMENTS = "<a/>" * examination.MAX_ELEMENTS

LINKS = '\n<link name="l"/>' * (examination.MAX_LINKS + 5)


def chain(length: int) -> str:
    """The text of a robot whose links follow each other."""
    parts = ['<link name="l0"/>']
    parts += [
        f'<link name="l{k}"/><joint name="j{k}" type="fixed"><parent link="l{k - 1}"/>'
        f'<child link="l{k}"/></joint>'
        for k in range(1, length)
    ]
    return '<robot name="r">\n' + "\n".join(parts) + "\n</robot>"


@pytest.mark.parametrize(
    ("text", "message", "line"),
    [
        (PAIR + " " * examination.MAX_BYTES, "bytes; at most", None),
        (PAIR.replace("</robot>", f"{ELEMENTS}</robot>"), "more than 100000 elements", None),
        (chain(examination.MAX_CHAIN + 3), "a chain of more than 500 links", 503),
        (f"<robot>{LINKS}</robot>", "has 1005 links", 1002),
    ],
    ids=["bytes", "elements", "chain", "links"],
)
def test_a_document_beyond_the_bounds_is_refused(text: str, message: str, line: int | None) -> None:
    report = diagnose(text, samples=1)
    assert report.error is not None
    assert report.error.type == "DescriptionError"
    assert message in report.error.message
    if line is not None:
        assert report.error_line == line


def test_what_is_within_the_bounds_is_examined() -> None:
    report = diagnose(chain(examination.MAX_CHAIN), samples=1, engines=["pinocchio"])
    assert report.error is None


def test_a_circle_of_joints_is_the_error_of_the_reader() -> None:
    back = '<joint name="back" type="fixed"><parent link="arm"/><child link="base"/></joint>'
    report = diagnose(PAIR.replace("</robot>", f"{back}</robot>"), samples=1)
    assert report.error is not None
    assert "cycle" in report.error.message
