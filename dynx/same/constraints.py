"""Tendons, equality constraints and gravity compensation of two robots, as their descriptions state them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from itertools import combinations
from typing import NamedTuple

import numpy as np

from dynx.model import Model
from dynx.model.elements import INFINITY
from dynx.model.mechanism import ROOT
from dynx.model.stated_parts import LINEAR, StatedEquality, StatedTendon
from dynx.same.attributes import Attribute, DescriptionFreedom, number_text
from dynx.same.decimals import decimals, rounded
from dynx.same.fit import BodyFit, Fit, angle_of
from dynx.same.limits import differs
from dynx.same.places import PlaceInBody, Places
from dynx.same.stated import counterparts, part_differences
from dynx.same.text import vector_text
from dynx.spatial.scalar import Array, Floats
from dynx.spatial.se3 import inverse

UNBOUNDED = (-INFINITY, INFINITY)

ROUNDING = 1e-14
"""Difference of two coefficients of a polynomial, relative to the largest number, that is rounding."""


# -- tendons ----------------------------------------------------------------------------------------------


def tendon_pairs(
    ours: Model, theirs: Model, found: Fit, tolerance: float
) -> Iterator[tuple[StatedTendon | None, StatedTendon | None]]:
    """Yield the tendons that correspond, by their names or because they are equal; None for one alone."""
    for mine, other, _ in tendon_pairs_compared(ours, theirs, found, tolerance):
        yield mine, other


def tendon_differences(ours: Model, theirs: Model, found: Fit, tolerance: float) -> Iterator[Attribute]:
    """Yield the tendons that differ, that one description has alone, or that have other names; nothing where
    a description leaves tendons open. Coefficients have the signs of the joints' positions."""
    pairs = tendon_pairs_compared(ours, theirs, found, tolerance)
    yield from part_differences(pairs, "tendon", "tendon", tendon_text, lambda each: each.joints[0])


def tendon_pairs_compared(
    ours: Model, theirs: Model, found: Fit, tolerance: float
) -> Iterator[tuple[StatedTendon | None, StatedTendon | None, bool]]:
    """Yield the pairs of `tendon_pairs`, each with whether both are equal."""
    if ours.tendons is None or theirs.tendons is None:
        return iter(())

    def are_equal(mine: StatedTendon, other: StatedTendon) -> bool:
        own, others = dict(mine.terms), dict[str, float]()
        for name, factor in other.terms:
            joint, sign = _our_joint(found, name)
            others[joint] = sign * factor
        return own.keys() == others.keys() and not any(
            differs(one, two, tolerance)
            for one, two in (
                *((own[joint], others[joint]) for joint in own),
                *zip(mine.range, other.range, strict=True),
                *zip(mine.force_range, other.force_range, strict=True),
                *zip(mine.spring_length, other.spring_length, strict=True),
                (mine.stiffness, other.stiffness),
                (mine.damping, other.damping),
                (mine.friction, other.friction),
                (mine.armature, other.armature),
            )
        )

    return counterparts(ours.tendons, theirs.tendons, are_equal, lambda each: len(each.terms))


def tendon_text(tendon: StatedTendon) -> str:
    """Write a tendon, without what it has by default."""
    words = [" + ".join(f"{number_text(factor)} {joint}" for joint, factor in tendon.terms)]
    if tendon.stiffness:
        ends = " to ".join(dict.fromkeys(map(number_text, tendon.spring_length)))
        words.append(f"stiffness {number_text(tendon.stiffness)} at length {ends}")
    numbers = (("damping", tendon.damping), ("friction", tendon.friction), ("armature", tendon.armature))
    words += [f"{name} {number_text(value)}" for name, value in numbers if value]
    ranges = (("range", tendon.range), ("forces", tendon.force_range))
    words += [f"{what} {' to '.join(map(number_text, each))}" for what, each in ranges if each != UNBOUNDED]
    return ", ".join(words)


def _our_joint(found: Fit, theirs: str) -> tuple[str, int]:
    """Return our joint for one of theirs, and the sign of its positions; their own name without a
    counterpart."""
    each = found.of_joint(theirs)
    return (theirs, 1) if each is None else (found.ours.joints[each.ours].name, each.sign)


# -- equality constraints ---------------------------------------------------------------------------------


def equality_differences(
    ours: Model, theirs: Model, found: Fit, tolerance: float
) -> Iterator[Attribute | DescriptionFreedom]:
    """Yield the equality constraints that differ, that one description has alone, or that have other names;
    nothing where a description leaves them open. Call it inside `fifty_digits`.

    A constraint of frames is equal to one of links that holds the same. One that couples the same parts in
    the other order is a freedom.
    """
    rules = Constraints(ours, theirs, found, tolerance)
    pairs = list(equality_pairs(ours, theirs, found, tolerance))
    yield from part_differences(iter(pairs), "equality", "equality", equality_text, lambda each: each.type)
    for mine, other, equal in pairs:
        if equal and mine is not None and other is not None and not rules.are_in_order(mine, other):
            name = other.name or other.type
            message = f"constraint {name} couples the same parts in the other order"
            yield DescriptionFreedom("constraint", mine.name or mine.type, name, message)


def equality_pairs(
    ours: Model, theirs: Model, found: Fit, tolerance: float
) -> Iterator[tuple[StatedEquality | None, StatedEquality | None, bool]]:
    """Yield the constraints that correspond, by their names or because they are equal, each pair with whether
    they are; None for one alone. Nothing where a description leaves them open."""
    if ours.equalities is None or theirs.equalities is None:
        return iter(())
    rules = Constraints(ours, theirs, found, tolerance)
    return counterparts(ours.equalities, theirs.equalities, rules.are_equal, lambda each: each.type)


def equality_text(equality: StatedEquality) -> str:
    """Write a constraint, without what it has by default."""
    words = [f"{equality.type} {equality.first}{f' to {equality.second}' if equality.second else ''}"]
    if equality.object_type in ("joint", "tendon"):
        numbers = [number_text(each) for each in equality.absolute_polynomial]
        if not equality.second:
            words.append(f"at {numbers[0]}")
        elif equality.polynomial != LINEAR or any(equality.references):
            words.append(f"polynomial {' '.join(numbers)}")
    elif equality.type == "connect":
        words.append(f"at {vector_text(equality.first_pose.xyz)}")
    if equality.torque_scale != 1.0:
        words.append(f"torque scale {number_text(equality.torque_scale)}")
    softness = (("solref", equality.solref), ("solimp", equality.solimp))
    words += [f"{name} {' '.join(map(number_text, each))}" for name, each in softness if each]
    return ", ".join([*words, *([] if equality.active else ["not active"])])


def coupled_as(equality: StatedEquality) -> tuple[str, str, float, float] | None:
    """Return (joint, driver, multiplier, offset) of a linear coupling of two joints; None for another one."""
    offset, multiplier, *higher = equality.absolute_polynomial.tolist()
    if equality.type != "joint" or not equality.second or any(higher) or not equality.active:
        return None
    return equality.first, equality.second, multiplier, offset


class Constraints:
    """Parts and numbers of the constraints of two robots, in names and axes of the first robot."""

    def __init__(self, ours: Model, theirs: Model, found: Fit, tolerance: float) -> None:
        self._found, self._tolerance = found, tolerance
        self._reach = tolerance * found.ours.reach
        self._places = Places(ours, theirs, found)
        self._tendons = {
            other.name: mine.name
            for mine, other in tendon_pairs(ours, theirs, found, tolerance)
            if mine is not None and other is not None
        }

    def are_equal(self, mine: StatedEquality, other: StatedEquality) -> bool:
        """Check whether two constraints hold the same with the same settings."""
        return self.with_settings(mine, other) == other and self.hold_the_same(mine, other)

    def with_settings(self, mine: StatedEquality, other: StatedEquality) -> StatedEquality:
        """Return `other` with those settings of `mine` that differ."""
        new = replace(other, active=mine.active)
        if differs(mine.torque_scale, other.torque_scale, self._tolerance):
            new = replace(new, torque_scale=mine.torque_scale)
        for name in ("solref", "solimp"):
            numbers = getattr(mine, name), getattr(other, name)
            if len(numbers[0]) != len(numbers[1]) or any(
                differs(a, b, self._tolerance) for a, b in zip(*numbers, strict=True)
            ):
                new = replace(new, **{name: numbers[0]})
        return new

    def hold_the_same(self, mine: StatedEquality, other: StatedEquality) -> bool:
        """Check whether two constraints are of one type and couple the same parts, in any order."""
        return mine.type == other.type and (self.are_in_order(mine, other) or self._are_swapped(mine, other))

    def are_in_order(self, mine: StatedEquality, other: StatedEquality) -> bool:
        """Check whether two constraints of one type hold the same, first and second part as they are."""
        if mine.type in ("joint", "tendon"):
            names, numbers = self._coupling(other)
            same = self._same_numbers(mine.absolute_polynomial, numbers, _largest(mine, other))
            return mine.objects == names and same
        return self._same_places(mine, self._ends(other))

    def _are_swapped(self, mine: StatedEquality, other: StatedEquality) -> bool:
        if mine.type not in ("joint", "tendon"):
            ends = self._ends(other)
            return self._same_places(mine, ends[::-1], swapped=mine.type == "weld")
        names, (a, b, *higher) = self._coupling(other)
        if len(names) < 2 or any(higher) or b == 0.0 or mine.objects != names[::-1]:
            return False
        swapped = np.array([-a / b, 1.0 / b, 0.0, 0.0, 0.0])
        return self._same_numbers(mine.absolute_polynomial, swapped, _largest(mine, other))

    def _coupling(self, other: StatedEquality) -> tuple[tuple[str, ...], Floats]:
        """Return the names of our joints or tendons for a coupling of theirs, and its polynomial in our
        positions."""
        numbers = np.array(other.absolute_polynomial)
        if other.type == "tendon":
            return tuple(self._tendons.get(each, each) for each in other.objects), numbers
        joints = [_our_joint(self._found, each) for each in other.objects]
        signs = [sign for _, sign in joints] + [1]
        return tuple(name for name, _ in joints), signs[0] * numbers * signs[1] ** np.arange(5.0)

    def _same_numbers(self, mine: Floats, other: Floats, largest: float) -> bool:
        # A polynomial that is written for other reference positions has rounding in each coefficient, of the
        # largest number that is written: the coefficients themselves may be 0.
        rounding = ROUNDING * float(max(np.max(np.abs(mine)), np.max(np.abs(other)), largest))
        return not any(
            abs(a - b) > rounding and differs(a, b, self._tolerance) for a, b in zip(mine, other, strict=True)
        )

    def _ends(self, other: StatedEquality) -> list[PlaceInBody | None]:
        """Return the places of what coincides, in our bodies."""
        poses = other.first_pose, other.second_pose
        places = [self._places.theirs(name) for name in other.objects]
        return [
            None if place is None else PlaceInBody(place.body, place.T @ decimals(pose.matrix))
            for place, pose in zip(places, poses, strict=True)
        ]

    def _same_places(
        self, mine: StatedEquality, ends: list[PlaceInBody | None], *, swapped: bool = False
    ) -> bool:
        """Check whether what coincides is in these places; of a `swapped` weld, MuJoCo measures the distance
        at the other body, which is no difference."""
        poses = mine.first_pose, mine.second_pose
        own = [self._places.ours(name) for name in mine.objects]
        if None in own or None in ends:
            return False
        placed = [
            PlaceInBody(place.body, place.T @ decimals(pose.matrix))
            for place, pose in zip(own, poses, strict=True)
            if place is not None
        ]
        other = [each for each in ends if each is not None]
        if [each.body for each in placed] != [each.body for each in other]:
            return False
        off = [inverse(one.T) @ two.T for one, two in zip(placed, other, strict=True)]
        if mine.type == "weld":
            # The poses in both bodies may be moved and turned together.
            relative = [one.T @ inverse(two.T) for one, two in (placed, other)]
            turned = inverse(relative[0]) @ relative[1]
            if angle_of(turned) > self._tolerance or not self._is_near(turned):
                return False
        return swapped or all(map(self._is_near, off))

    def _is_near(self, T: Array) -> bool:
        return float(np.linalg.norm(rounded(T[:3, 3]))) <= self._reach


def _largest(*equalities: StatedEquality) -> float:
    """Return the largest coefficient or reference position that couplings state, without its sign."""
    numbers = (number for each in equalities for number in (*each.polynomial, *each.references))
    return max(map(abs, numbers), default=0.0)


# -- gravity compensation ---------------------------------------------------------------------------------


def compensation_differences(ours: Model, theirs: Model, found: Fit, tolerance: float) -> Iterator[Attribute]:
    """Yield the bodies whose weight is compensated otherwise; nothing where a description leaves it open.
    Factors of links that are merged count by their masses."""
    if ours.gravity_compensation is None or theirs.gravity_compensation is None:
        return
    reach = np.array([1.0, *[found.ours.reach or 1.0] * 3])
    differing: dict[int, tuple[_Compensation, _Compensation]] = {}
    for each in found.bodies:
        mine, other = (_compensated(model, found, each, k) for k, model in enumerate((ours, theirs)))
        if mine is None or other is None:
            continue
        if None not in (mine.factor, other.factor) and mine.factor == other.factor:
            # Where the masses differ, that is the difference.
            continue
        relative = mine.moment / mine.mass, other.moment / other.mass
        size = max(1.0, float(np.abs(relative[0]).max()), float(np.abs(relative[1]).max()))
        limit = tolerance * size * reach
        # Mass without compensation may be described at another body.
        same = np.abs(relative[0] - relative[1]) <= limit
        if not (same.all() or (np.abs(mine.moment - other.moment) <= mine.mass * limit).all()):
            differing[each.ours] = mine, other
    for body in _seen_compensation(found, differing, tolerance):
        mine, other = differing[body]
        texts = mine.words, other.words if other.words != mine.words else f"placed otherwise: {other.words}"
        yield Attribute("gravity compensation", "link", mine.link, other.link, *texts, mine.line, other.line)


class _Compensation(NamedTuple):
    """Mass [kg] and first moment [kg m] (4,) of a body that are compensated, and those of the whole body, in
    the axes of our body; the factor, None for several; then a text, and the link with its line."""

    moment: Floats
    whole: Floats
    factor: float | None
    words: str
    link: str
    line: int | None

    @property
    def mass(self) -> float:
        """Mass of the body [kg]."""
        return float(self.whole[0])


def _seen_compensation(
    found: Fit, differing: Mapping[int, tuple[_Compensation, _Compensation]], tolerance: float
) -> list[int]:
    """Return the fewest of the bodies without which no state shows a difference, or all of them if two do not
    suffice: compensated mass on the axis of a joint may as well be the parent's."""
    reach = np.array([1.0, *[found.ours.reach or 1.0] * 3])
    moments = [each.moment for pair in differing.values() for each in pair]
    limit = tolerance * reach * max((float(np.max(np.abs(each) / reach)) for each in moments), default=0.0)

    def shown_without(left_out: tuple[int, ...]) -> bool:
        total = {body: np.zeros(4) for body in found.ours.children}
        for body, (mine, other) in differing.items():
            # One that is left out has our factor.
            if body not in left_out:
                total[body] += mine.moment - other.moment
            elif mine.factor is not None:
                total[body] += mine.moment - mine.factor * other.whole
        for body in reversed(range(len(found.ours.bodies))):
            moment, axis, T = total[body], found.ours.axes[body], found.ours.placements[body]
            kind, shared = found.ours.kinds[body], moment.copy()
            if kind == "revolute":
                shared[1:] = axis * float(axis @ moment[1:])
            elif kind == "ball":
                shared[1:] = 0.0
            else:
                shared[0] = 0.0
            kept = moment - shared
            if (np.abs(kept) > limit).any():
                return True
            parent = total[found.ours.bodies[body].parent]
            parent[0] += shared[0]
            parent[1:] += T[:3, :3] @ shared[1:] + T[:3, 3] * shared[0]
        # Of a fixed base no state shows it; what is compensated in one description alone is listed.
        return bool((np.abs(total[ROOT]) > limit).any())

    for count in range(3):
        for left_out in combinations(differing, min(count, len(differing))):
            if not shown_without(left_out):
                return list(left_out)
    return list(differing)


def _compensated(model: Model, found: Fit, each: BodyFit, number: int) -> _Compensation | None:
    """Return what is compensated of a body of our or their robot; None without mass, and for the world."""
    skeleton, body = (found.ours, each.ours) if number == 0 else (found.theirs, each.theirs)
    if body == ROOT and not model.floating:
        return None
    stated = {one.link: one for one in model.gravity_compensation or ()}
    heavy = skeleton.heavy_links[body]
    if not sum(float(inertia.mass) for inertia in heavy.values()):
        return None
    D = rounded(each.D) if number else np.eye(4)
    total, whole, factors = np.zeros(4), np.zeros(4), []
    for name, inertia in heavy.items():
        factors.append(stated[name].factor if name in stated else 0.0)
        moment = D[:3, :3] @ inertia.first_moment + inertia.mass * D[:3, 3]
        total += factors[-1] * np.array([inertia.mass, *moment])
        whole += np.array([inertia.mass, *moment])
    several = list(dict.fromkeys(factors))
    words = " and ".join(map(number_text, several))
    link = next((name for name in heavy if name in stated), next(iter(heavy)))
    line = stated[link].line if link in stated else model.link(link).line
    factor = several[0] if len(several) == 1 else None
    return _Compensation(total, whole, factor, words, link, line)
