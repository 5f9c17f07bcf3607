"""Numbers under misspelled names: found as such, and taken as meant by the remedies of missing attributes."""

from __future__ import annotations

from itertools import permutations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynx.doctor.mending import level_of
from dynx.model.xml.source import XmlSource
from dynx.rules import Case, find_rule
from dynx.rules.attributes import ATTRIBUTES, meant_name, misspelled_numbers
from tests.rules.documents import case_of, joint, link
from tests.rules.trap_cases import mended, only

LIMIT = '<limit lower="-1" upper="1" effort="2" velocity="3"/>'


def arm(inside: str, *, limit: str = LIMIT, type: str = "revolute", version: str = "") -> Case:
    """Return two joints, of which the second is as given; `inside` may hold its axis."""
    follower = joint("follower", "base", "other", type=type, limit=f"{limit}{inside}")
    if inside.startswith("<axis"):
        follower = follower.replace('<axis xyz="0 0 1"/>', "", 1)
    text = case_of(
        link("base"), link("arm"), link("other"), joint("elbow", "base", "arm", limit=LIMIT), follower
    ).source.text
    return Case(XmlSource(text.replace("<robot ", f"<robot {version} ", 1)))


@pytest.mark.parametrize(
    ("rule", "right", "wrong", "version"),
    [
        ("DX216", 'upper="1"', 'uper="1"', ""),
        ("DX216", 'upper="1"', 'UPPER=" 1 "', ""),
        ("DX204", 'effort="2"', 'efort="2"', ""),
        ("DX204", 'effort="2" velocity="3"', 'efort="2" velocty="3"', ""),
        ("DX222", 'lower="-1"', 'lowre="-1"', 'version="1.2"'),
        ("DX222", 'lower="-1" upper="1"', 'lower="-1" uper="1"', 'version="1.2"'),
        ("DX203", "<limit ", "<Limit ", ""),
        ("DX203", "<limit ", "<limits ", ""),
        ("DX305", 'damping="0.5"', 'dampng="0.5"', ""),
        ("DX305", 'damping="0.5"', 'frction="0.5"', ""),
        ("DX202", '<axis xyz="0 0 1"/>', '<axis x="0" y=" 0" z="1"/>', ""),
        ("DX202", '<axis xyz="0 0 -1.0"/>', '<axis z="-1.0"/>', ""),
        ("DX208", 'joint="elbow"', 'jiont="elbow"', ""),
        ("DX208", 'joint="elbow" multiplier="2"', 'joints="elbow" multiplier="2"', ""),
    ],
)
def test_the_number_under_a_misspelled_name_is_written(
    rule: str, right: str, wrong: str, version: str
) -> None:
    inside = {
        "DX305": '<dynamics damping="0.5"/>',
        "DX202": right,
        "DX208": f"<mimic {right}/>",
    }.get(rule, "")
    meant = arm(inside, version=version)
    head, found, tail = meant.source.text.rpartition(right)
    assert found
    broken = Case(XmlSource(f"{head}{wrong}{tail}"))
    each, remedy = mended(rule, broken)
    assert only(each).joint == "follower"
    if "frction" in wrong:
        meant = Case(XmlSource(f"{head}{wrong.replace('frction', 'friction')}{tail}"))
    follower = remedy.case.model.joint("follower")
    expected = meant.model.joint("follower")
    for part in ("type", "axis", "limits", "dynamics", "mimic"):
        assert getattr(follower, part) == getattr(expected, part)
    assert level_of(find_rule(rule), broken, remedy) == "physics"
    assert "misspelled name" in remedy.changed
    assert find_rule("DX515").detect(remedy.case) == []


def test_a_product_of_inertia_under_the_other_name_is_the_product() -> None:
    text = case_of(link("base"), link("arm"), joint("elbow", "base", "arm", limit=LIMIT)).source.text
    assert 'ixy="0"' in text
    head, _, tail = text.rpartition('ixy="0"')
    broken = Case(XmlSource(f'{head}iyx="0.001"{tail}'))
    _, remedy = mended("DX409", broken)
    inertial = remedy.case.model.link("arm").inertial
    assert inertial is not None
    assert inertial.tensor[0, 1] == 0.001
    assert level_of(find_rule("DX409"), broken, remedy) == "physics"


@pytest.mark.parametrize("limit", ['uper="one"', 'uper=""', 'uper="1" upperr="2"', 'soft_upper="1"'])
def test_a_name_without_one_number_is_no_end(limit: str) -> None:
    case = arm("", limit=f'<limit lower="-1" {limit} effort="2" velocity="3"/>')
    _, remedy = mended("DX216", case)
    assert remedy.case.model.joint("follower").limits.upper == 0.0
    assert not remedy.changes_physics


@pytest.mark.parametrize("wrong", ["ryp", "pry", "ypr", "RYP", "rp", "rpyy", "roll", "pitch", "Yaw"])
def test_a_misspelled_orientation_is_found_in_both_origins(wrong: str) -> None:
    origin = f'<origin xyz="0 0 1" {wrong}="0 0 1.57"/>'
    in_link = f'<link name="hand"><inertial>{origin}<mass value="1"/></inertial></link>'
    case = case_of(link("base"), link("arm"), joint("elbow", "base", "arm", origin, limit=LIMIT), in_link)
    messages = [each.message for each in find_rule("DX515").detect(case)]
    assert messages == [f"{wrong} of <origin> is ignored; rpy was meant"] * 2


@given(tag=st.sampled_from(sorted(ATTRIBUTES)), data=st.data())
def test_the_letters_of_an_absent_name_in_any_order_mean_it(tag: str, data: st.DataObject) -> None:
    known = ATTRIBUTES[tag]
    right = data.draw(st.sampled_from(known))
    word = "".join(data.draw(st.permutations(right)))
    same = [name for name in known if sorted(name) == sorted(word)]
    if word in known:
        assert meant_name(word, known, ()) is None
    else:
        assert meant_name(word, known, ()) in same
        assert meant_name(word, known, known) is None


def test_every_order_of_xyz_is_the_translation() -> None:
    for word in map("".join, permutations("xyz")):
        assert meant_name(word, ("xyz", "rpy"), ("rpy",)) == (None if word == "xyz" else "xyz")


def test_a_direction_under_another_name_is_left_to_its_own_rule() -> None:
    case = arm('<axis xzy="0 0 1"/>')
    assert find_rule("DX515").detect(case) == []
    assert len(find_rule("DX218").detect(case)) == 1


def test_a_known_attribute_stands_for_no_other() -> None:
    (root,) = XmlSource('<robot><limit lower="1" efort="2" x="3"/></robot>').root.children
    assert misspelled_numbers(root, ("upper", "effort", "velocity")) == {"effort": "efort"}
