"""Whatever is cut from a robot, a robot remains."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynx import load
from dynx.doctor.counterexample import (
    Reductions,
    complexity,
    fewer_extras,
    fewer_links,
    fewer_moving_joints,
    format_document,
    frame_axes,
    higher_links,
    plain_numbers,
    round_numbers,
    shortest,
    unit_numbers,
)
from dynx.model import Model
from dynx.model.documents import bare_urdf
from dynx.model.library import find
from dynx.model.xml.source import XmlSource
from dynx.testing.strategies import models

ROBOTS = models(from_urdf=True, locks=False, mimics=False)


@pytest.mark.parametrize("cut", [fewer_links, higher_links])
@given(st.data())
def test_links_are_taken_from_a_tree(cut: Callable[[XmlSource], Reductions], data: st.DataObject) -> None:
    model = data.draw(ROBOTS)
    source = XmlSource(bare_urdf(model))
    reductions = cut(source)
    assert len(reductions.changes) == len(model.joints)
    chosen = [change for change in reductions.changes if data.draw(st.booleans())]
    left = load(reductions.apply(chosen).text)
    assert len(left.links) == len(model.links) - len(chosen)
    assert {link.name for link in left.links} <= {link.name for link in model.links}
    stayed = {joint.name: joint for joint in model.joints}
    for joint in left.joints:
        assert joint.origin == stayed[joint.name].origin
        assert joint.type == stayed[joint.name].type
    if cut is fewer_links:
        assert left.root == model.root


@given(ROBOTS)
def test_a_single_link_can_be_left_of_any_robot(model: Model) -> None:
    source = XmlSource(bare_urdf(model))
    for cut in (fewer_links, higher_links):
        assert len(load(cut(source).apply(cut(source).changes).text).links) == 1


@given(st.data())
def test_joints_become_fixed(data: st.DataObject) -> None:
    model = data.draw(ROBOTS)
    reductions = fewer_moving_joints(XmlSource(bare_urdf(model)))
    chosen = [joint for joint in reductions.changes if data.draw(st.booleans())]
    names = {joint.attributes["name"] for joint in chosen}
    left = load(reductions.apply(chosen).text)
    assert left.joint_names == tuple(name for name in model.joint_names if name not in names)


@pytest.mark.parametrize("robot", ["talos", "tiago", "ur5"])
def test_what_says_nothing_about_dynamics_goes(robot: str) -> None:
    source = XmlSource(find(robot).read_bytes())
    reductions = fewer_extras(source)
    assert reductions.changes
    left = reductions.apply(reductions.changes)
    assert load(left.text) == load(source.text)
    assert not fewer_extras(left).changes


@given(ROBOTS, st.booleans())
def test_tidy_text_says_the_same(model: Model, numbers: bool) -> None:
    source = XmlSource(bare_urdf(model))
    text = format_document(source, numbers=numbers)
    assert load(text) == load(source.text)
    assert format_document(XmlSource(text), numbers=numbers) == text


@pytest.mark.parametrize(
    "cut", [plain_numbers, unit_numbers, frame_axes, lambda source: round_numbers(source, 2)]
)
@given(st.data())
def test_numbers_become_simpler_and_stay_so(
    cut: Callable[[XmlSource], Reductions], data: st.DataObject
) -> None:
    source = XmlSource(bare_urdf(data.draw(ROBOTS)))
    reductions = cut(source)
    chosen = [change for change in reductions.changes if data.draw(st.booleans())]
    simpler = reductions.apply(chosen)
    assert _complexity(simpler) < _complexity(source) or not chosen
    everything = reductions.apply(reductions.changes)
    assert not cut(everything).changes


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_the_shortest_text_of_a_number(number: float) -> None:
    assert float(shortest(repr(number))) == number
    assert len(shortest(repr(number))) <= len(repr(number))
    assert complexity(shortest(repr(number))) == complexity(repr(number))


def _complexity(source: XmlSource) -> int:
    total = 0
    for element in source.root.walk():
        for name, value in element.attributes.items():
            if name not in ("name", "type", "link", "joint", "version"):
                total += sum(complexity(word) for word in value.split())
    return total
