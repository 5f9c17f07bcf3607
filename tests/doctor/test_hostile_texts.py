"""Descriptions made to break the doctor, or to occupy it for ever: each is examined or refused in time."""

from __future__ import annotations

import re
import time

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynx.doctor import diagnose
from dynx.doctor.report import DoctorReport
from dynx.rules import all_rules
from dynx.rules.registry import find_trap
from tests.rules.documents import case_of, joint, link

ENGINES = ["pinocchio", "pybullet"]

SECONDS = 60.0
"""Limit for a text of 100 kB [s of processor time]: linear reading takes 2, quadratic reading far more."""

LENGTH = 100_000

ROBOT = case_of(link("base"), link("arm"), joint("elbow", "base", "arm")).source.text

COMMA = ROBOT.replace('"1"', '"1,5"', 1)

ATTRIBUTES = " ".join(f'a{k}="1"' for k in range(LENGTH // 10))

TEXTS = {
    "empty lines": COMMA.replace("</link>", "</link>" + "\n" * LENGTH, 1),
    "equal lines": COMMA.replace("</robot>", "<gazebo/>\n" * (LENGTH // 50) + "</robot>"),
    "nested": ROBOT.replace("</robot>", "<a>" * LENGTH + "</robot>"),
    "attributes": ROBOT.replace("<robot ", f"<robot {ATTRIBUTES} "),
    "long name": ROBOT.replace('"arm"', f'"{"a" * LENGTH}"'),
    "format": ROBOT.replace('"arm"', f'"{"%n" * 20}"'),
    "entities": '<!DOCTYPE r [<!ENTITY a "aa"><!ENTITY b "&a;&a;">]>' + ROBOT,
    "null": ROBOT.replace('"arm"', '"a\0m"'),
    "comment": ROBOT.replace("</robot>", f"<!-- {'- ' * LENGTH} --></robot>"),
    "character data": ROBOT.replace("</robot>", f"<![CDATA[{']' * LENGTH}]]></robot>"),
    "ampersands": ROBOT.replace('"arm"', f'"{"&" * LENGTH}"'),
    "declaration": f'<?xml version="1.0" {"encoding " * (LENGTH // 9)}?>{ROBOT}',
    "mesh": ROBOT.replace(
        "</link>",
        '<collision><geometry><mesh filename="../../../../etc/passwd.stl"/></geometry></collision></link>',
    ),
}

VALUES = [
    *(" " * LENGTH, "\t" * LENGTH + "1", "," * LENGTH, "1," * LENGTH, "1 " * LENGTH, "a" * LENGTH),
    *("1." * LENGTH, "1e" * LENGTH, "-" * LENGTH),
    *("1" + "0" * LENGTH, "1." + "3" * LENGTH, "1e" + "9" * LENGTH),
    *("nan", "inf", "1e999", "1e-999", "0x1p5", "", "%n%s", "\u0661", "1_0"),
]


def require_end(text: str | bytes) -> DoctorReport:
    """Examine a text; a refusal names the text."""
    started = time.process_time()
    report = diagnose(text, samples=1, counterexamples=False, engines=ENGINES)
    assert time.process_time() - started < SECONDS
    assert report.error is None or report.error.message.startswith("<string>")
    return report


@pytest.mark.parametrize("name", TEXTS)
def test_a_hostile_text_is_examined_or_refused(name: str) -> None:
    require_end(TEXTS[name])


@pytest.mark.parametrize("attribute", ["xyz", "value", "name"])
@pytest.mark.parametrize("number", range(len(VALUES)))
def test_a_hostile_value_is_examined_or_refused(attribute: str, number: int) -> None:
    text = find_trap("DX201").read_text(encoding="utf-8")
    require_end(re.sub(rf'\b{attribute}="[^"]*"', lambda _: f'{attribute}="{VALUES[number]}"', text, count=2))


@given(st.data())
def test_a_damaged_trap_is_examined_or_refused(data: st.DataObject) -> None:
    rule = data.draw(st.sampled_from(all_rules()))
    content = bytearray(find_trap(rule).read_bytes())
    for _ in range(data.draw(st.integers(1, 4))):
        spans = [each.span(1) for each in re.finditer(rb'"([^"]*)"', content)] or [(0, len(content))]
        first, last = data.draw(st.sampled_from(spans))
        match data.draw(st.sampled_from(["value", "byte", "cut", "other"])):
            case "value":
                content[first:last] = data.draw(st.sampled_from(VALUES))[:50].encode()
            case "byte":
                content[first : first + 1] = bytes([data.draw(st.integers(0, 255))])
            case "cut":
                del content[first : first + data.draw(st.integers(1, 60))]
            case _:
                start, end = data.draw(st.sampled_from(spans))
                content[first:last] = content[start:end]
    require_end(bytes(content))
