"""Which shapes of two robots may touch, as their descriptions state it, and what drives their joints."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product

from dynx.model import Model
from dynx.model.elements import INFINITY, ZERO, Joint
from dynx.model.geometry.links import ContactFilter, ShapeNumber
from dynx.model.mechanism import ROOT
from dynx.model.stated_parts import Actuator, StatedTendon
from dynx.same.attributes import (
    Attribute,
    DescriptionFreedom,
    Tag,
    collision_pairs,
    line_of_link,
    listed,
    number_text,
)
from dynx.same.constraints import tendon_pairs
from dynx.same.fit import Fit
from dynx.same.limits import differs
from dynx.same.skeleton import Skeleton
from dynx.same.text import vector_text

MAX_PAIRS = 250_000
"""Largest number of pairs of shapes for which the links are listed that other bits let touch."""

UNBOUNDED = (-INFINITY, INFINITY)

LinkPair = tuple[str, str]


class _Contacts:
    """Which shapes of one robot may touch."""

    def __init__(self, skeleton: Skeleton, stated: ContactFilter) -> None:
        self._skeleton, self.stated = skeleton, stated
        self.excluded = {frozenset(pair) for pair in stated.excluded}
        self.paired = {frozenset(pair) for pair in stated.paired}

    def touch(self, one: ShapeNumber, two: ShapeNumber) -> bool:
        """Check whether two shapes may touch."""
        stated, bodies = self.stated, self._skeleton.bodies
        if frozenset((one, two)) in self.paired:
            return True
        a, b = (self._skeleton.body_of[link] for link, _ in (one, two))
        if a == b or frozenset((one[0], two[0])) in self.excluded:
            return False
        if stated.filters_parents:
            for child, parent in ((a, b), (b, a)):
                moves = parent != ROOT or self._skeleton.model.floating
                if child != ROOT and bodies[child].parent == parent and moves:
                    return False
        first, second = stated.bits_of(one), stated.bits_of(two)
        return bool(first[0] & second[1] or second[0] & first[1])

    @property
    def named_links(self) -> dict[frozenset[str], None]:
        """Pairs of links that are excluded or have paired shapes, in the order of the description."""
        stated = self.stated
        paired = [(one[0], two[0]) for one, two in stated.paired]
        return dict.fromkeys(map(frozenset, [*stated.excluded, *paired]))


@dataclass(frozen=True)
class _ShapePair:
    """A collision shape and its counterpart."""

    ours: ShapeNumber
    theirs: ShapeNumber

    @property
    def links(self) -> LinkPair:
        return self.ours[0], self.theirs[0]


def contact_differences(
    ours: Model, theirs: Model, found: Fit, tolerance: float
) -> Iterator[Attribute | DescriptionFreedom]:
    """Yield which shapes may touch in one description alone; nothing where one of them leaves it open.

    Compared are shapes that both robots have. An exclusion that changes no contact is a freedom: of shapes
    that do not touch anyway, or that touch as a pair.
    """
    if ours.contact_filter is None or theirs.contact_filter is None:
        return
    mine, other = _Contacts(found.ours, ours.contact_filter), _Contacts(found.theirs, theirs.contact_filter)
    for name, words in (
        ("enabled", ("contacts are computed", "no contacts are computed")),
        ("filters_parents", ("links of one joint do not touch", "links of one joint may touch")),
    ):
        first, second = (getattr(each.stated, name) for each in (mine, other))
        if first != second:
            yield Attribute(
                "contact filter", "robot", ours.name, theirs.name, words[not first], words[not second]
            )
            return
    if not mine.stated.enabled:
        return
    pairs = [_ShapePair(*each) for each in collision_pairs(found, tolerance)]
    other_bits = {
        each for each in pairs if mine.stated.bits_of(each.ours) != other.stated.bits_of(each.theirs)
    }
    yield from _bit_differences(ours, theirs, mine, other, pairs, other_bits)
    alike = [each for each in pairs if each not in other_bits]
    yield from _pair_differences(ours, theirs, mine, other, alike)


def _bit_differences(
    ours: Model,
    theirs: Model,
    mine: _Contacts,
    other: _Contacts,
    pairs: list[_ShapePair],
    differing: set[_ShapePair],
) -> Iterator[Attribute]:
    """Yield the links with shapes of other bits, which count for what the robot touches, too."""
    known: set[tuple[LinkPair, str, str]] = set()
    for shape in (each for each in pairs if each in differing):
        first, second = (
            "contype {}, conaffinity {}".format(*bits)
            for bits in (mine.stated.bits_of(shape.ours), other.stated.bits_of(shape.theirs))
        )
        if len(differing) * len(pairs) <= MAX_PAIRS:
            changed: tuple[dict[str, None], dict[str, None]] = {}, {}
            for each in pairs:
                touches = mine.touch(shape.ours, each.ours), other.touch(shape.theirs, each.theirs)
                if touches[0] != touches[1]:
                    changed[touches[1]][each.ours[0] if touches[0] else each.theirs[0]] = None
            first += f"; touches {listed([*changed[0]])}" if changed[0] else ""
            second += f"; touches {listed([*changed[1]])}" if changed[1] else ""
        if (shape.links, first, second) not in known:
            known.add((shape.links, first, second))
            yield _of_links(ours, theirs, shape.links, first, second)


def _pair_differences(
    ours: Model, theirs: Model, mine: _Contacts, other: _Contacts, pairs: list[_ShapePair]
) -> Iterator[Attribute | DescriptionFreedom]:
    """Yield the pairs of links that only one description excludes, or names as a pair."""
    of_mine: dict[str, list[_ShapePair]] = {}
    of_theirs: dict[str, list[_ShapePair]] = {}
    for each in pairs:
        of_mine.setdefault(each.ours[0], []).append(each)
        of_theirs.setdefault(each.theirs[0], []).append(each)
    found: dict[tuple[LinkPair, LinkPair], bool] = {}
    effective: set[tuple[int, frozenset[str]]] = set()
    for side, contacts, table in ((0, mine, of_mine), (1, other, of_theirs)):
        for links in contacts.named_links:
            a, b = (*links, *links)[:2]
            for one, two in product(table.get(a, ()), table.get(b, ())):
                touches = mine.touch(one.ours, two.ours)
                if touches != other.touch(one.theirs, two.theirs):
                    found.setdefault((one.links, two.links), touches)
                    effective.add((side, links))
    known: set[frozenset[LinkPair]] = set()
    for (one_links, two_links), touches in found.items():
        if frozenset((one_links, two_links)) in known:
            continue
        known.add(frozenset((one_links, two_links)))
        words = [
            f"{'may touch' if touching else 'does not touch'} {name}"
            for touching, name in zip((touches, not touches), two_links, strict=True)
        ]
        yield _of_links(ours, theirs, one_links, *words)
    names = _names_of_links(pairs)
    for side, contacts, others in ((0, mine, other), (1, other, mine)):
        for links in [each for each in contacts.named_links if each in contacts.excluded]:
            translated = frozenset(names[side].get(link, link) for link in links)
            if (side, links) not in effective and others.excluded.isdisjoint((links, translated)):
                a, b = (*sorted(links), *links)[:2]
                where = ("first", "second")[side]
                yield DescriptionFreedom(
                    "contacts", a, b, f"the {where} excludes {a} and {b}, which changes no contact"
                )


def _names_of_links(pairs: list[_ShapePair]) -> tuple[dict[str, str], dict[str, str]]:
    links = [each.links for each in pairs]
    return dict(links), {b: a for a, b in links}


def _of_links(ours: Model, theirs: Model, links: LinkPair, first: str, second: str) -> Attribute:
    lines = line_of_link(ours, links[0]), line_of_link(theirs, links[1])
    return Attribute("contact filter", "link", *links, first, second, *lines)


# -- actuators ------------------------------------------------------------------------------------


def actuator_differences(ours: Model, theirs: Model, found: Fit, tolerance: float) -> Iterator[Attribute]:
    """Yield the joints with other actuators, and actuators of other names; nothing where a description leaves
    open what drives the joints. Commands have the sign of the joint's position."""
    if ours.actuators is None or theirs.actuators is None:
        return
    mine, other = _by_joint(ours.actuators), _by_joint(theirs.actuators)
    for each in found.bodies:
        if each.ours != ROOT:
            ends = found.ours.joints[each.ours], found.theirs.joints[each.theirs]
            yield from _of_part("joint", *ends, each.sign, mine, other, tolerance)
    mine, other = _by_tendon(ours.actuators), _by_tendon(theirs.actuators)
    for tendon, their_tendon in tendon_pairs(ours, theirs, found, tolerance):
        one, two = tendon or their_tendon, their_tendon or tendon
        if one is not None and two is not None:
            yield from _of_part("tendon", one, two, 1, mine, other, tolerance)


def _of_part(
    tag: Tag,
    joint: Joint | StatedTendon,
    their_joint: Joint | StatedTendon,
    sign: int,
    mine: dict[str, list[Actuator]],
    other: dict[str, list[Actuator]],
    tolerance: float,
) -> Iterator[Attribute]:
    left, alone = list(other.get(their_joint.name, ())), []
    renamed = []
    for actuator in mine.get(joint.name, ()):
        same = [one for one in left if _are_equal(actuator, one, sign, tolerance)]
        same.sort(key=lambda one: one.name != actuator.name)
        if not same:
            alone.append(actuator)
            continue
        left = [one for one in left if one is not same[0]]
        if same[0].name != actuator.name:
            renamed.append((actuator, same[0]))
    if alone or left:
        first, second = ("; ".join(map(actuator_text, some)) or "none" for some in (alone, left))
        if first == second:
            second = f"commands and bias of the other sign: {second}"
        lines = alone[0].line if alone else joint.line, left[0].line if left else their_joint.line
        yield Attribute("actuator", tag, joint.name, their_joint.name, first, second, *lines)
    for one, two in renamed:
        names = one.name or "none", two.name or "none"
        yield Attribute("name", "actuator", one.name, two.name, *names, one.line, two.line)


def _by_joint(actuators: tuple[Actuator, ...]) -> dict[str, list[Actuator]]:
    found: dict[str, list[Actuator]] = {}
    for each in actuators:
        if not each.tendon:
            found.setdefault(each.joint, []).append(each)
    return found


def _by_tendon(actuators: tuple[Actuator, ...]) -> dict[str, list[Actuator]]:
    found: dict[str, list[Actuator]] = {}
    for each in actuators:
        if each.tendon:
            found.setdefault(each.tendon, []).append(each)
    return found


def _are_equal(one: Actuator, other: Actuator, sign: int, tolerance: float) -> bool:
    """Check whether two actuators are equal if positions and efforts of the second one are those of the first
    times `sign`, and commands either are too or stay the same."""
    return any(_are_equal_with(one, other, sign, command, tolerance) for command in {sign, 1})


def _are_equal_with(one: Actuator, other: Actuator, sign: int, command: int, tolerance: float) -> bool:
    """Check whether two actuators are equal if positions and efforts of the second one are those of the first
    times `sign`, and commands and forces times `command`.

    With a reversed force, the gear has the sign that reverses the effort again, and ``gear q`` is what the
    force adds to it.
    """
    pairs = [
        (one.gear, sign * command * other.gear),
        (one.gain, other.gain),
        (one.bias[0], command * other.bias[0]),
        *zip(one.bias[1:], other.bias[1:], strict=True),
    ]
    for mine, theirs in ((one.control_range, other.control_range), (one.force_range, other.force_range)):
        pairs += zip(mine, sorted(command * end for end in theirs), strict=True)
    return not any(differs(first, second, tolerance) for first, second in pairs)


def actuator_text(actuator: Actuator) -> str:
    """Write an actuator, without what it has by default."""
    words = [f"gear {number_text(actuator.gear)}"]
    if actuator.gain != 1.0:
        words.append(f"gain {number_text(actuator.gain)}")
    if actuator.bias != ZERO:
        words.append(f"bias {vector_text(actuator.bias)}")
    for what, ends in (("commands", actuator.control_range), ("forces", actuator.force_range)):
        if ends != UNBOUNDED:
            words.append(f"{what} {number_text(ends[0])} to {number_text(ends[1])}")
    return ", ".join(words)
