"""Which parts of a scene in MJCF may touch, and with what friction.

MuJoCo tests two geoms if `contype` and `conaffinity` say so, unless their bodies are excluded, rigidly
connected, or parent and child. It tests the pairs of geoms that the file names in any case. A contact has the
larger coefficients of its two geoms, where a scene has the geometric means.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations, combinations_with_replacement, islice, product

from dynx.errors import shown
from dynx.model.mjcf.contacts import read_contacts
from dynx.model.mjcf.document import MjcfText
from dynx.model.mjcf.reader import MjcfBody
from dynx.model.mjcf.shapes import Geom, GeomContact
from dynx.model.xml.reading import Element
from dynx.steppers.material import Material
from dynx.world.scene.filters import CollisionFilter

Pairs = tuple[tuple[str, str], ...]
Groups = tuple[tuple[str, tuple[str, ...]], ...]

MAX_NAMED = 3
"""Largest number of pairs that a note names."""

MAX_PAIRS = 250_000
"""Largest number of pairs of parts, some of which a file names, that are compared one by one."""


@dataclass(frozen=True)
class MjcfCollider:
    """A part of the scene with the geoms by which it collides, and its body; None for the world itself."""

    part: str
    body: MjcfBody | None
    geoms: tuple[Geom, ...]

    @property
    def element(self) -> Element:
        """The element that notes on the part name."""
        return self.geoms[0].element

    @property
    def material(self) -> Material:
        """Material of the part: the largest friction of its geoms in each direction."""
        rows = [geom.contact.acting_friction for geom in self.geoms]
        sliding, torsional, rolling = (max(column) for column in zip(*rows, strict=True))
        return Material(sliding, torsional, rolling)


class ContactRules:
    """What a file in MJCF says of the contacts between its colliders."""

    def __init__(
        self,
        document: MjcfText,
        bodies: dict[str, MjcfBody],
        kept: dict[str, str],
        colliders: Sequence[MjcfCollider],
        taken: set[str],
    ) -> None:
        """`bodies` are all bodies of the file by name, `kept` names the one that has the shapes of each, and
        `taken` are the names of parts."""
        self._reading, self._colliders, self._taken = document.reading, colliders, taken
        self._bodies = bodies
        stated = read_contacts(document)
        self._disabled, self._filters_parents = not stated.enabled, stated.filters_parents
        self._excluded = {frozenset(kept.get(name, name) for name in pair) for pair in stated.excluded}
        self._pairs = {frozenset(pair): element for pair, element in stated.paired.items()}
        self._paired_names = stated.paired_geoms

    def touching_inside(self, robot: str) -> bool:
        """Check whether MuJoCo tests any two links of a robot."""
        own = [each for each in self._colliders if each.part.startswith(f"{robot}/")]
        return any(self._touches(a, b) for a, b in combinations(own, 2))

    def _touches(self, a: MjcfCollider, b: MjcfCollider) -> bool:
        """Check whether MuJoCo tests any geom of one collider with one of the other."""
        return self._named(a, b) or (self._meets(a, b) and not self._filtered(a, b))

    def _meets(self, a: MjcfCollider, b: MjcfCollider) -> bool:
        """Check whether the masks of two colliders let any of their geoms touch."""
        return not self._disabled and any(one.meets(two) for one in _masks(a) for two in _masks(b))

    def _candidates(
        self, firsts: Sequence[MjcfCollider], seconds: Sequence[MjcfCollider]
    ) -> Iterator[tuple[MjcfCollider, MjcfCollider]]:
        """Yield the pairs of colliders of which the file names geoms."""
        if not self._pairs:
            return
        named = [
            [each for each in some if any(geom.name in self._paired_names for geom in each.geoms)]
            for some in (firsts, seconds)
        ]
        if len(named[0]) * len(named[1]) > MAX_PAIRS:
            raise self._reading.unsupported(
                next(iter(self._pairs.values())),
                f"the file names contact pairs of more than {MAX_PAIRS} pairs of bodies",
            )
        yield from ((a, b) for a in named[0] for b in named[1] if a is not b)

    def ignored(self, own_filter: CollisionFilter) -> tuple[Pairs, Groups]:
        """Return the pairs that MuJoCo does not test and `own_filter`, that of the scene without them, has;
        and the groups that they name.

        Adds notes on pairs that the scene cannot have.
        """
        classes: dict[frozenset[GeomContact], list[MjcfCollider]] = {}
        for each in self._colliders:
            classes.setdefault(_masks(each), []).append(each)
        groups: dict[frozenset[GeomContact], tuple[str, tuple[str, ...]]] = {}
        pairs: list[tuple[str, str]] = []
        parted: list[tuple[MjcfCollider, MjcfCollider]] = []
        for one, two in combinations_with_replacement(classes, 2):
            firsts, seconds = classes[one], classes[two]
            meets = [a.meets(b) for a in one for b in two]
            has = ((a, b) for a, b in _members(firsts, seconds) if own_filter.may_collide(a.part, b.part))
            if self._disabled or not any(meets):
                if next(has, None) is None:
                    continue
                if not any(self._named(a, b) for a, b in self._candidates(firsts, seconds)):
                    pairs.append((self._group(groups, one, firsts), self._group(groups, two, seconds)))
                    continue
                pairs += [
                    (a.part, b.part)
                    for a, b in _members(firsts, seconds)
                    if own_filter.may_collide(a.part, b.part) and not self._named(a, b)
                ]
            elif not all(meets):
                parted += islice(((a, b) for a, b in has if not self._filtered(a, b)), MAX_NAMED)
        found, lost = self._filtered_pairs(own_filter)
        self._note(parted, "have geoms that may touch and others that may not; in the scene all of them may")
        self._note(lost, "may touch in MuJoCo; a joint connects them, so that they never touch in the scene")
        return (*pairs, *found), tuple(groups.values())

    def _filtered_pairs(
        self, own_filter: CollisionFilter
    ) -> tuple[list[tuple[str, str]], list[tuple[MjcfCollider, MjcfCollider]]]:
        """Return the pairs that MuJoCo leaves out although their geoms may touch, and those that it has and
        the scene has not."""
        by_owner: dict[str, list[MjcfCollider]] = {}
        by_body: dict[str, list[MjcfCollider]] = {}
        for each in self._colliders:
            owner, slash, _ = each.part.partition("/")
            if slash:
                by_owner.setdefault(owner, []).append(each)
            by_body.setdefault(_body_name(each), []).append(each)
        # Only bodies of one tree are parent and child.
        candidates = [pair for own in by_owner.values() for pair in combinations(own, 2)]
        for names in self._excluded:
            ends = [by_body.get(name, []) for name in names]
            if len(ends) == 2:
                candidates += [(a, b) for a in ends[0] for b in ends[1]]
        found: dict[tuple[str, str], None] = {}
        lost = []
        for a, b in candidates:
            has, touches = own_filter.may_collide(a.part, b.part), self._touches(a, b)
            if has and not touches and self._meets(a, b):
                found.setdefault((b.part, a.part) if (b.part, a.part) in found else (a.part, b.part))
            if touches and not has and not (own_filter.is_fixed(a.part) and own_filter.is_fixed(b.part)):
                lost.append((a, b))
        return list(found), lost

    def note_friction(self, may_collide: CollisionFilter) -> None:
        """Add a note on pairs whose friction in MuJoCo is not the geometric mean that the scene has."""
        reading = self._reading
        kinds: dict[tuple[Material, GeomContact], list[MjcfCollider]] = {}
        for each in self._colliders:
            contacts = {geom.contact for geom in each.geoms}
            if len({contact.acting_friction for contact in contacts}) > 1:
                reading.note(
                    each.element,
                    f"the geoms of {shown(each.part)} differ in friction; in the scene all have the largest",
                )
            kinds.setdefault((each.material, _largest(contacts)), []).append(each)
        differing: list[tuple[MjcfCollider, MjcfCollider]] = []
        for (one, firsts), (two, seconds) in combinations_with_replacement(kinds.items(), 2):
            contact = _contact_friction(one[1], two[1])
            mean = tuple(
                (getattr(one[0], name) * getattr(two[0], name)) ** 0.5
                for name in ("friction", "torsional_friction", "rolling_friction")
            )
            if all(abs(a - b) <= 1e-12 * max(a, b) for a, b in zip(contact, mean, strict=True)):
                continue
            pairs = ((a, b) for a, b in product(firsts, seconds) if a is not b)
            found = next(
                (
                    pair
                    for pair in islice(pairs, MAX_PAIRS)
                    if may_collide.may_collide(pair[0].part, pair[1].part)
                ),
                None,
            )
            if found is not None:
                differing.append(found)
        self._note(
            differing,
            "have different friction; MuJoCo takes the larger coefficients of two geoms (or those of higher "
            "priority), the scene their geometric means",
        )
        if self._pairs:
            element = next(iter(self._pairs.values()))
            reading.note(
                element, "parameters of <pair> are not read: its geoms touch with their own friction"
            )

    # -- MuJoCo's rules -------------------------------------------------------------------------

    def _named(self, a: MjcfCollider, b: MjcfCollider) -> bool:
        """Check whether the file names a pair of geoms of two colliders."""
        if self._disabled or not self._pairs:
            return False
        ends = [[g.name for g in each.geoms if g.name in self._paired_names] for each in (a, b)]
        return any(frozenset((one, two)) in self._pairs for one in ends[0] for two in ends[1])

    def _filtered(self, a: MjcfCollider, b: MjcfCollider) -> bool:
        """Check whether MuJoCo leaves out two bodies, whatever their geoms say."""
        names = frozenset(map(_body_name, (a, b)))
        if names in self._excluded:
            return True
        one, two = self._welded(a.body), self._welded(b.body)
        if _name(one) == _name(two):
            return True
        if not self._filters_parents or one is None or two is None:
            return False
        return _name(self._parent(one)) == _name(two) or _name(self._parent(two)) == _name(one)

    def _welded(self, body: MjcfBody | None) -> MjcfBody | None:
        """Return the body that moves a body, itself or one above it; None for one that is fixed."""
        while body is not None and not (body.jointed or body.mocap):
            body = self._above(body)
        return body

    def _parent(self, body: MjcfBody) -> MjcfBody | None:
        return self._welded(self._above(body))

    def _above(self, body: MjcfBody) -> MjcfBody | None:
        return None if body.parent is None else self._bodies[body.parent]

    # -- groups and notes -----------------------------------------------------------------------

    def _group(
        self,
        groups: dict[frozenset[GeomContact], tuple[str, tuple[str, ...]]],
        masks: frozenset[GeomContact],
        members: Sequence[MjcfCollider],
    ) -> str:
        if len(members) == 1:
            return members[0].part
        if masks not in groups:
            numbers = sorted({(each.contype, each.conaffinity) for each in masks})
            stem = "contype_" + "_".join(f"{each}_{other}" for each, other in numbers[:4])
            name, count = stem, 2
            while name in self._taken:
                name, count = f"{stem}_{count}", count + 1
            self._taken.add(name)
            groups[masks] = (name, tuple(each.part for each in members))
        return groups[masks][0]

    def _note(self, pairs: Sequence[tuple[MjcfCollider, MjcfCollider]], what: str) -> None:
        if not pairs:
            return
        named = "; ".join(f"{shown(a.part)} and {shown(b.part)}" for a, b in pairs[:MAX_NAMED])
        more = f"; and {len(pairs) - MAX_NAMED} more pairs" if len(pairs) > MAX_NAMED else ""
        self._reading.note(pairs[0][0].element, f"{named}{more}: {what}")


def _members(
    firsts: Sequence[MjcfCollider], seconds: Sequence[MjcfCollider]
) -> Iterator[tuple[MjcfCollider, MjcfCollider]]:
    """Return the pairs of two different colliders, one of each class."""
    return combinations(firsts, 2) if firsts is seconds else product(firsts, seconds)


def _body_name(collider: MjcfCollider) -> str:
    return "world" if collider.body is None else collider.body.name


def _masks(collider: MjcfCollider) -> frozenset[GeomContact]:
    """Return what `meets` depends on, of all geoms of a collider."""
    return frozenset(
        GeomContact(each.contact.contype, each.contact.conaffinity, 3, (0.0, 0.0, 0.0), 0.0)
        for each in collider.geoms
    )


def _largest(contacts: Iterable[GeomContact]) -> GeomContact:
    found = list(contacts)
    highest = max(each.priority for each in found)
    columns = zip(*(each.friction for each in found), strict=True)
    sliding, torsional, rolling = (max(column) for column in columns)
    return GeomContact(0, 0, max(each.condim for each in found), (sliding, torsional, rolling), highest)


def _contact_friction(a: GeomContact, b: GeomContact) -> tuple[float, ...]:
    """Return the coefficients of a contact in MuJoCo."""
    if a.priority != b.priority:
        return (a if a.priority > b.priority else b).acting_friction
    return _largest((a, b)).acting_friction


def _name(body: MjcfBody | None) -> str | None:
    return None if body is None else body.name
