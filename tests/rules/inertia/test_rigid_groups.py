"""Links that fixed joints weld together."""

from __future__ import annotations

import numpy as np
from hypothesis import given

from dynx.model import Model, Pose
from dynx.model.mechanism import build_mechanism
from dynx.model.xml.source import XmlSource
from dynx.rules import Case
from dynx.rules.inertia import rigid_groups, static_links
from dynx.spatial.se3 import homogeneous
from dynx.testing.strategies import models
from tests.rules.documents import case_of, joint, link

EPS = float(np.finfo(float).eps)


@given(models())
def test_groups_are_the_bodies_of_the_mechanism(model: Model) -> None:
    case = Case(XmlSource(model.to_urdf()), base=model.base)
    groups = rigid_groups(case)
    mechanism = build_mechanism(model if model.floating else model.with_base_pose(Pose()))
    frames = {frame.name: frame for frame in mechanism.frames}
    for name, group in groups.items():
        assert frames[name].body == frames[group.head].body
        assert group.static == (frames[name].body == -1 and not model.floating)
        R, p = group.pose(name, group.head)
        wanted = homogeneous(frames[name].R, frames[name].p)
        scale = 64 * EPS * max(1.0, float(np.max(np.abs(frames[name].p))))
        np.testing.assert_allclose(homogeneous(R.astype(float), p.astype(float)), wanted, rtol=0, atol=scale)


@given(models())
def test_what_the_world_holds_is_the_group_of_the_root(model: Model) -> None:
    case = Case(XmlSource(model.to_urdf()), base=model.base)
    groups = rigid_groups(case)
    static = {name for name, group in groups.items() if group.static}
    assert static <= static_links(case)
    if model.floating:
        assert not static_links(case)


def test_parents_children_and_what_hangs_below() -> None:
    case = case_of(
        *(link(name) for name in "abcde"),
        joint("ab", "a", "b", type="fixed"),
        joint("bc", "b", "c", type="fixed"),
        joint("ad", "a", "d", type="fixed"),
        joint("ce", "c", "e"),
    )
    group = rigid_groups(case)["c"]
    assert group.head == "a"
    assert group.links == ("a", "b", "c", "d")
    assert group.static
    assert group.children("a") == ("b", "d")
    assert group.below("b") == ("c",)
    assert group.parents == {"b": "a", "c": "b", "d": "a"}
    assert rigid_groups(case)["e"].links == ("e",)


def test_a_joint_that_follows_a_fixed_one_welds_nothing_for_engines() -> None:
    follower = joint("bc", "b", "c", '<mimic joint="ab"/>')
    case = case_of(*(link(name) for name in "abc"), joint("ab", "a", "b", type="fixed"), follower)
    assert rigid_groups(case)["c"].head == "c"
    assert static_links(case) == {"a", "b"}
