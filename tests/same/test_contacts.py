"""Contact filters and actuators of two descriptions: what `dynx.same` lists, and what MuJoCo does."""

from __future__ import annotations

from itertools import combinations
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import dynx
from dynx.same import SameReport, same_robot
from dynx.same.attributes import Attribute

NAMES = "abcde"

TREE = """<mujoco>
  <worldbody><body name="a" pos="0 0 1">BASE<geom name="ga" size="0.1"/><site name="s"/>
    <body name="b"><joint name="j" axis="0 0 1"/><geom name="gb" size="0.11"/>
      <body name="c"><joint name="k" axis="1 0 0"/><geom name="gc" size="0.12"/></body>
      <body name="d"><geom name="gd" size="0.13"/></body>
    </body>
    <body name="e"><joint name="l" axis="0 1 0"/><geom name="ge" size="0.14"/></body>
  </body></worldbody>
  SECTIONS
</mujoco>"""


def attributes_of(report: SameReport, kind: str) -> list[Attribute]:
    return [each for each in report.attributes if each.kind == kind]


@st.composite
def filters(draw: st.DrawFn, base: str) -> str:
    """Draw a file with bits of geoms, exclusions, pairs, and sometimes a flag."""
    pairs = st.lists(st.sampled_from([*combinations(NAMES, 2)]), max_size=2, unique=True)
    section = "".join(f'<exclude body1="{a}" body2="{b}"/>' for a, b in draw(pairs))
    section += "".join(f'<pair geom1="g{a}" geom2="g{b}"/>' for a, b in draw(pairs))
    text = TREE.replace("SECTIONS", f"<contact>{section}</contact>").replace("BASE", base)
    for name in NAMES:
        # Geoms that touch nothing are no collision shapes; those are compared as such.
        bits = draw(st.sampled_from(["1 1", "1 1", "1 2", "2 1", "3 3"])).split()
        text = text.replace(f'name="g{name}"', f'name="g{name}" contype="{bits[0]}" conaffinity="{bits[1]}"')
    return text


def touching(text: str) -> set[frozenset[str]]:
    """Return the pairs of geoms that MuJoCo tests where all of them are in one place."""
    mujoco = pytest.importorskip("mujoco")
    engine = mujoco.MjModel.from_xml_string(text)
    state = mujoco.MjData(engine)
    mujoco.mj_forward(engine, state)
    names = [engine.geom(k).name for k in range(engine.ngeom)]
    return {frozenset(names[k] for k in each.geom) for each in state.contact}


def listed_changes(report: SameReport) -> set[frozenset[str]]:
    """Return the pairs of links of which a report says that they touch in one description alone."""
    found = set()
    for each in attributes_of(report, "contact filter"):
        for words in (each.first, each.second):
            for start in ("may touch ", "; touches "):
                for other in words.partition(start)[2].split(", "):
                    found |= {frozenset((each.ours or "", other))} if other else set()
    return found


@given(st.data())
def test_the_pairs_listed_are_those_that_mujoco_tests_in_one_file_alone(data: st.DataObject) -> None:
    base = data.draw(st.sampled_from(["", "<freejoint/>"]))
    first, second = (data.draw(filters(base)) for _ in range(2))
    report = same_robot(first, second)
    assert report.same
    wanted = {
        frozenset(name[1] for name in pair) for pair in touching(first) ^ touching(second) if len(pair) == 2
    }
    listed = listed_changes(report)
    more = [each for each in report.attributes if " more" in each.first + each.second]
    assert listed == wanted or (more and listed <= wanted | {frozenset(("", ""))})


def test_bits_that_matter_outside_the_robot_alone_are_listed() -> None:
    text = TREE.replace("SECTIONS", "").replace("BASE", "")
    (found,) = same_robot(text, text.replace('name="gc"', 'name="gc" contype="3"')).attributes
    assert (found.ours, found.kind) == ("c", "contact filter")
    assert (found.first, found.second) == ("contype 1, conaffinity 1", "contype 3, conaffinity 1")


def test_an_exclusion_without_effect_is_a_freedom() -> None:
    text = TREE.replace("BASE", "<freejoint/>")
    parts = '<contact><exclude body1="b" body2="c"/></contact>'
    for pair in ((text, text.replace("SECTIONS", parts)), (text.replace("SECTIONS", parts), text)):
        report = same_robot(*(each.replace("SECTIONS", "") for each in pair))
        assert report.same
        assert report.attributes == ()
        assert [each.kind for each in report.freedoms] == ["contacts"]


def test_flags_of_contacts_are_listed_for_the_robot() -> None:
    text = TREE.replace("SECTIONS", "").replace("BASE", "<freejoint/>")
    for flag in ("contact", "filterparent"):
        other = text.replace("<worldbody>", f'<option><flag {flag}="disable"/></option><worldbody>')
        (found,) = same_robot(text, other).attributes
        assert (found.kind, found.tag) == ("contact filter", "robot")


def test_what_urdf_leaves_open_is_noted_and_not_compared() -> None:
    sections = '<contact><exclude body1="b" body2="e"/></contact><actuator><motor joint="j"/></actuator>'
    text = TREE.replace("SECTIONS", sections).replace("BASE", "")
    report = same_robot(dynx.load(text).to_urdf(geometry=True), text)
    assert report.same
    assert not {"actuator", "contact filter"} & {each.kind for each in report.attributes}
    assert sum("not compared" in each for each in report.notes) == 2


# -- actuators ------------------------------------------------------------------------------------


def with_actuators(elements: str, axis: str = "0 0 1") -> str:
    text = TREE.replace("SECTIONS", f"<actuator>{elements}</actuator>").replace("BASE", "")
    return text.replace('axis="0 0 1"', f'axis="{axis}"')


@given(
    st.sampled_from(["gear", "kp", "ctrlrange", "forcerange", "kv"]),
    st.floats(-8.0, 0.0).map(lambda exponent: 10.0**exponent),
    st.booleans(),
)
def test_a_number_of_an_actuator_that_differs_is_listed(name: str, size: float, reverse: bool) -> None:
    numbers = {"gear": [3.0], "kp": [20.0], "kv": [2.0], "ctrlrange": [-1.0, 2.0], "forcerange": [-3.0, 4.0]}

    def element(sign: int) -> str:
        given = {
            key: [x * sign for x in value[::sign]] if "range" in key else value
            for key, value in numbers.items()
        }
        words = (f'{key}="{" ".join(map(repr, value))}"' for key, value in given.items())
        return f'<position name="p" joint="j" {" ".join(words)}/>'

    first, second = (
        with_actuators(element(1)),
        with_actuators(element(-1 if reverse else 1), "0 0 -1" if reverse else "0 0 1"),
    )
    assert same_robot(first, second).attributes == ()
    end = -1 if name.endswith("range") else 0
    numbers[name][end] *= 1.0 + size
    changed = with_actuators(element(-1 if reverse else 1), "0 0 -1" if reverse else "0 0 1")
    (found,) = same_robot(first, changed, tolerance=1e-9).attributes
    assert (found.kind, found.ours, found.theirs) == ("actuator", "j", "j")


def test_actuators_that_are_missing_renamed_or_written_otherwise() -> None:
    first = with_actuators('<motor name="p" joint="j"/><position name="q" joint="k" kp="3"/>')
    other = with_actuators('<general name="q" joint="k" gainprm="3" biastype="affine" biasprm="0 -3"/>')
    (found,) = same_robot(first, other).attributes
    assert (found.kind, found.ours, found.first, found.second) == ("actuator", "j", "gear 1", "none")
    (found,) = same_robot(first, first.replace('"p"', '"r"')).attributes
    assert (found.kind, found.tag, found.ours, found.theirs) == ("name", "actuator", "p", "r")


@pytest.mark.parametrize("motor", ['motor joint="j" gear="{}"', 'position joint="j" gear="{}" kp="3" kv="2"'])
def test_a_motor_with_its_own_joint_reversed_keeps_its_command_or_the_sign_of_its_gear(motor: str) -> None:
    """With the gear of the other sign, the same command gives the same effort on the same side."""
    first = with_actuators(f"<{motor.format(2)}/>")
    for gear in (2, -2):
        report = same_robot(first, with_actuators(f"<{motor.format(gear)}/>", "0 0 -1"))
        assert report.attributes == ()
        (row,) = [each for each in report.coordinates if each.ours == "j"]
        assert row.sign == -1
    (found,) = same_robot(first, with_actuators(f"<{motor.format(-2)}/>")).attributes
    assert found.kind == "actuator"


@pytest.mark.parametrize(("gear", "ends"), [("2", "-3 1"), ("-2", "-1 3")])
def test_ranges_of_commands_are_reversed_with_the_commands_alone(gear: str, ends: str) -> None:
    motor = '<motor joint="j" gear="{}" ctrlrange="{}" ctrllimited="true"/>'
    first = with_actuators(motor.format("2", "-1 3"))
    assert same_robot(first, with_actuators(motor.format(gear, ends), "0 0 -1")).attributes == ()
    swapped = " ".join(str(-float(each)) for each in reversed(ends.split()))
    (found,) = same_robot(first, with_actuators(motor.format(gear, swapped), "0 0 -1")).attributes
    assert found.kind == "actuator"


def test_reports_of_actuators_and_contacts_are_documents() -> None:
    text = with_actuators('<motor joint="j"/>')
    document: dict[str, Any] = same_robot(text, text.replace('joint="j"', 'joint="j" gear="2"')).to_dict()
    assert document["attributes"][0]["kind"] == "actuator"
    assert np.isfinite(document["tolerance"])
