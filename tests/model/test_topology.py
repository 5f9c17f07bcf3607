"""Links and joints form one tree in depth-first order; chains of mimic joints are resolved."""

from __future__ import annotations

import random as shuffling

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynx.errors import DescriptionError
from dynx.model import Joint, Link, Mimic, Model, Note
from dynx.model.topology import depth_first, resolve_mimics
from dynx.testing.strategies import models


def tree(*pairs: str) -> tuple[list[Link], list[Joint]]:
    """Build links and joints from pairs such as "ab", a joint from a to b that has that name."""
    names = dict.fromkeys("".join(pairs))
    return [Link(name) for name in names], [Joint(pair, "fixed", pair[0], pair[1]) for pair in pairs]


def order(*pairs: str) -> tuple[str, str]:
    links, joints = depth_first(*tree(*pairs), "test")
    return "".join(link.name for link in links), " ".join(joint.name for joint in joints)


def test_children_follow_their_parent_at_once_in_the_order_of_the_document() -> None:
    assert order("ab", "ac", "bd", "be") == ("abdec", "ab bd be ac")
    assert order("ac", "ab", "be", "bd") == ("acbed", "ac ab be bd")
    # Joints of one parent keep their order even if others are listed between or before them.
    assert order("cd", "ab", "bc", "ae") == ("abcde", "ab bc cd ae")


def test_the_order_of_links_in_the_document_does_not_matter() -> None:
    links, joints = tree("ab", "ac", "bd")
    for seed in range(10):
        shuffled = list(links)
        shuffling.Random(seed).shuffle(shuffled)
        assert depth_first(shuffled, joints, "test") == depth_first(links, joints, "test")


@given(models())
def test_every_parent_precedes_its_children_and_branches_stay_together(model: Model) -> None:
    place = {link.name: k for k, link in enumerate(model.links)}
    assert [joint.child for joint in model.joints] == [link.name for link in model.links[1:]]
    last = dict(place)
    for joint in reversed(model.joints):
        assert place[joint.parent] < place[joint.child]
        last[joint.parent] = max(last[joint.parent], last[joint.child])
    for joint in model.joints:
        # The subtree of a joint is a contiguous range of links.
        below = {joint.child}
        for other in model.joints:
            if other.parent in below:
                below.add(other.child)
        assert {place[name] for name in below} == set(range(place[joint.child], last[joint.child] + 1))


@given(models(), st.randoms(use_true_random=False))
def test_ordering_is_idempotent(model: Model, random: shuffling.Random) -> None:
    links = list(model.links)
    random.shuffle(links)
    again = Model.build(model.name, links, model.joints, base=model.base, gravity=model.gravity)
    assert (again.links, again.joints) == (model.links, model.joints)


@pytest.mark.parametrize(
    ("pairs", "message"),
    [
        (("ab", "cd"), "2 links have no parent"),
        (("ab", "cb"), "link 'b' has two parents: joints 'ab' and 'cb'"),
        (("ab", "bc", "ca"), "form a cycle"),
        (("ab", "cd", "dc"), "the links 'c', 'd' form a cycle"),
        (("aa",), "joins link 'a' to itself"),
    ],
)
def test_links_that_form_no_tree_raise(pairs: tuple[str, ...], message: str) -> None:
    with pytest.raises(DescriptionError, match=message):
        depth_first(*tree(*pairs), "test")


def test_a_cycle_of_ten_thousand_links_is_named_in_short() -> None:
    n = 10_000
    links = [Link(f"l{k}") for k in range(n)]
    joints = [Joint(f"j{k}", "fixed", f"l{k}", f"l{(k + 1) % n}") for k in range(n)]
    with pytest.raises(DescriptionError) as caught:
        depth_first(links, joints, "test")
    assert len(str(caught.value)) < 300


def followers(*drivers: tuple[str, str, float, float], moving: str = "") -> list[Joint]:
    """Build joints that follow others, and independent joints, named in `moving`."""
    joints = [Joint(name, "revolute", "x", "y") for name in moving]
    joints += [
        Joint(name, "revolute", "x", "y", mimic=Mimic(driver, scale, offset))
        for name, driver, scale, offset in drivers
    ]
    return joints


def test_a_chain_of_mimics_becomes_one_step() -> None:
    joints = followers(("c", "b", 2.0, 3.0), ("b", "a", 5.0, 7.0), moving="a")
    notes: list[Note] = []
    resolved = {joint.name: joint.mimic for joint in resolve_mimics(joints, notes, "test")}
    assert resolved == {"a": None, "b": Mimic("a", 5.0, 7.0), "c": Mimic("a", 10.0, 17.0)}
    assert notes == []


def test_a_follower_of_a_joint_that_lost_its_driver_still_follows_it() -> None:
    notes: list[Note] = []
    c, b = resolve_mimics(followers(("c", "b", 2.0, 3.0), ("b", "gone", 5.0, 7.0)), notes, "test")
    assert (c.mimic, b.mimic) == (Mimic("b", 2.0, 3.0), None)
    assert [str(note) for note in notes] == [
        "joint 'b' mimics 'gone', which does not exist; it is read as an independent joint; known: c, b"
    ]


def test_a_follower_of_a_fixed_joint_is_fixed_at_its_offset() -> None:
    notes: list[Note] = []
    joints = [Joint("a", "fixed", "x", "y"), *followers(("b", "a", 2.0, 0.5), ("c", "b", 4.0, 1.0))]
    _, b, c = resolve_mimics(joints, notes, "test")
    assert (b.type, b.locked_at, c.type, c.locked_at) == ("fixed", 0.5, "fixed", 3.0)
    assert ["which cannot move" in str(note) for note in notes] == [True]


@pytest.mark.parametrize("drivers", [("aa",), ("ab", "ba"), ("ab", "bc", "cb")])
def test_mimics_in_a_cycle_raise(drivers: tuple[str, ...]) -> None:
    joints = followers(*((pair[0], pair[1], 1.0, 0.0) for pair in drivers))
    with pytest.raises(DescriptionError, match="follow each other in a cycle"):
        resolve_mimics(joints, [], "test")


def test_a_chain_that_overflows_is_refused() -> None:
    joints = followers(("c", "b", 1e200, 0.0), ("b", "a", 1e200, 0.0), moving="a")
    with pytest.raises(DescriptionError, match="multiplier inf"):
        resolve_mimics(joints, [], "test")
