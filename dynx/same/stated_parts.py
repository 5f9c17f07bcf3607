"""Tendons, equality constraints and named configurations of the first robot in the names and coordinates of
the second one: what the second is to state, and the effect of what it states instead."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from dynx.model import Model
from dynx.model.elements import Pose
from dynx.model.mjcf.sensor_objects import WORLD
from dynx.model.stated_parts import NamedConfiguration, StatedEquality, StatedTendon
from dynx.same.attributes import StatedEffect
from dynx.same.configurations import ConfigurationPair, configuration_pairs, joints_of_other_kinds
from dynx.same.constraints import Constraints, equality_pairs, tendon_pairs_compared
from dynx.same.decimals import decimals, rounded
from dynx.same.effects import SEED, STATES
from dynx.same.fit import Fit
from dynx.same.limits import differs
from dynx.same.places import WORLD_BODY, Places
from dynx.same.text_edits import are_near
from dynx.spatial.scalar import Floats
from dynx.spatial.se3 import homogeneous, inverse
from dynx.spatial.so3 import quat_from_rotation, rotation_from_quat

Section = Literal["tendon", "equality", "keyframe"]
StatedPart = StatedTendon | StatedEquality | NamedConfiguration


@dataclass(frozen=True)
class StatedChange:
    """A part `old` of the second robot, None if it has none, and what it is to be; None: not there.

    `other_types` tells that the part states positions of joints whose types differ.
    """

    section: Section
    old: StatedPart | None
    new: StatedPart | None
    other_types: bool = False

    @property
    def words(self) -> str:
        """Kind and name of the part."""
        each = self.old or self.new
        assert each is not None
        return f"{self.section} {each.name or 'without a name'}"


class StatedParts:
    """Parts of the first robot in the names and coordinates of the second; call it inside `fifty_digits`."""

    def __init__(self, ours: Model, theirs: Model, found: Fit, tolerance: float) -> None:
        self._ours, self._theirs, self._found, self._tolerance = ours, theirs, found, tolerance
        fits = [each for each in found.bodies if each.ours >= 0]
        self._fits = {found.ours.joints[each.ours].name: each for each in fits}
        self._names = {mine: found.theirs.joints[each.theirs].name for mine, each in self._fits.items()}
        self._other_kinds = joints_of_other_kinds(ours, theirs, found)
        self._coupled = {mine: name for mine, name in self._names.items() if name not in self._other_kinds}
        self._places = Places(ours, theirs, found)

    def changes(self) -> Iterator[StatedChange | str]:
        """Yield what differs with what it is to be, or in words what has no counterpart in the second."""
        both = self._ours, self._theirs, self._found, self._tolerance
        self._tendons = {
            mine.name: other.name
            for mine, other, _ in tendon_pairs_compared(*both)
            if mine is not None and other is not None
        }
        for mine, other, equal in tendon_pairs_compared(*both):
            if not equal:
                yield self._change("tendon", mine, other, None if mine is None else self._tendon(mine, other))
        self._constraints = Constraints(*both)
        for held, by, equal in equality_pairs(*both):
            if not equal:
                yield self._change("equality", held, by, None if held is None else self._equality(held, by))
        for pair in configuration_pairs(*both):
            if not pair.equal:
                new = None if pair.mine is None else self._configuration(pair)
                yield self._change("keyframe", pair.mine, pair.other, new)

    def _change(
        self, section: Section, mine: StatedPart | None, old: StatedPart | None, new: StatedPart | None
    ) -> StatedChange | str:
        if mine is not None and new is None:
            return (
                f"{section} {mine.name or 'without a name'} is not mended: the second robot lacks its parts"
            )
        if new is not None and old is not None:
            new = replace(new, name=old.name, line=old.line)
        return StatedChange(section, old, new, section == "keyframe" and bool(self._other_kinds))

    # -- what the second robot is to state ----------------------------------------------------------------

    def _tendon(self, mine: StatedTendon, other: StatedTendon | None) -> StatedTendon | None:
        """Return a tendon of the first robot, with the numbers of `other` that do not differ."""
        if any(joint not in self._coupled for joint in mine.joints):
            return None
        factors = {self._names[joint]: self._fits[joint].sign * factor for joint, factor in mine.terms}
        if other is None:
            return replace(mine, terms=tuple(factors.items()))
        old = dict(other.terms)
        names = [*(name for name in old if name in factors), *(name for name in factors if name not in old)]
        terms = tuple((name, self._kept(factors[name], old.get(name))) for name in names)
        return replace(
            mine,
            terms=terms,
            range=self._kept_ends(mine.range, other.range),
            spring_length=self._kept_ends(mine.spring_length, other.spring_length),
            force_range=self._kept_ends(mine.force_range, other.force_range),
            stiffness=self._kept(mine.stiffness, other.stiffness),
            damping=self._kept(mine.damping, other.damping),
            friction=self._kept(mine.friction, other.friction),
            armature=self._kept(mine.armature, other.armature),
        )

    def _kept_ends(self, mine: tuple[float, float], other: tuple[float, float]) -> tuple[float, float]:
        low, high = map(self._kept, mine, other)
        return low, high

    def _kept(self, mine: float, other: float | None) -> float:
        """Return the number of `other` if it does not differ, else that of `mine`."""
        return mine if other is None or differs(mine, other, self._tolerance) else other

    def _equality(self, mine: StatedEquality, other: StatedEquality | None) -> StatedEquality | None:
        """Return a constraint of the first robot, with what `other` has of it."""
        if other is not None and self._constraints.hold_the_same(mine, other):
            return self._constraints.with_settings(mine, other)
        new = self._equality_of_second(mine)
        if new is None or other is None or new.type != other.type:
            return new
        new = self._constraints.with_settings(
            new, replace(new, **{name: getattr(other, name) for name in _SETTINGS})
        )
        if new.objects != other.objects or new.type not in ("joint", "tendon"):
            return new
        pairs = zip(new.polynomial, other.absolute_polynomial.tolist(), strict=True)
        a, b, c, d, e = (self._kept(one, two) for one, two in pairs)
        return replace(new, polynomial=(a, b, c, d, e))

    def _equality_of_second(self, mine: StatedEquality) -> StatedEquality | None:
        if mine.type in ("joint", "tendon"):
            names = self._coupled if mine.type == "joint" else self._tendons
            if any(each not in names for each in mine.objects):
                return None
            signs = [self._fits[each].sign if mine.type == "joint" else 1 for each in mine.objects] + [1]
            numbers = signs[0] * mine.absolute_polynomial * signs[1] ** np.arange(5.0)
            a, b, c, d, e = (numbers + 0.0).tolist()
            first, second = ([*(names[each] for each in mine.objects), ""])[:2]
            return replace(
                mine, first=first, second=second, polynomial=(a, b, c, d, e), references=(0.0, 0.0)
            )
        ends = []
        for name, pose in zip(mine.objects, (mine.first_pose, mine.second_pose), strict=True):
            place = self._places.ours(name)
            if place is None:
                return None
            T = place.T @ decimals(pose.matrix)
            found = self._link(name, place.body, T)
            if found is None:
                return None
            ends.append(found)
        (first, T_first), (second, T_second) = ends
        if mine.type == "connect":
            # Only the points coincide.
            T_first, T_second = (homogeneous(np.eye(3), T[:3, 3]) for T in (T_first, T_second))
        else:
            # The second pose is only a place in MJCF: both are turned together.
            R = T_second[:3, :3].T
            T_first, T_second = (T @ homogeneous(R, np.zeros(3)) for T in (T_first, T_second))
        poses = Pose.from_matrix(T_first), Pose.from_matrix(T_second)
        return replace(
            mine,
            object_type="xbody",
            first=first,
            second=second,
            first_pose=poses[0],
            second_pose=Pose(poses[1].xyz),
        )

    def _link(self, name: str, body: int, T: Floats) -> tuple[str, Floats] | None:
        """Return a link of the second robot in the counterpart of our body, that of our link's name if it is
        there, and the pose (4, 4) in it of a pose T in our body."""
        if body == WORLD_BODY:
            return WORLD, rounded(T)
        each = next((each for each in self._found.bodies if each.ours == body), None)
        if each is None:
            return None
        skeleton = self._found.theirs
        links = {skeleton.model.links[k].name: k for k in skeleton.links[each.theirs]}
        number = links.get(name, next(iter(links.values())))
        back = inverse(skeleton.link_pose(number)) @ inverse(each.D)
        return skeleton.model.links[number].name, rounded(back @ T)

    def _configuration(self, pair: ConfigurationPair) -> NamedConfiguration:
        """Return a configuration of the first robot in the joints of the second, with the types of the first,
        and with the positions of its counterpart that do not differ."""
        mine, theirs = pair.mine, self._theirs
        assert mine is not None
        q, neutral = self._ours.configurations[mine.name], theirs.neutral()
        kept = {} if pair.other is None else dict(pair.other.positions)
        other: dict[str, Floats] = {}
        for name in theirs.joint_names:
            if name not in self._other_kinds:
                j = theirs.position_index(name)
                other[name] = neutral[j : j + (4 if theirs.joint(name).type == "ball" else 1)]
        for joint, name in self._names.items():
            if joint not in self._ours.joint_names or (name not in other and name not in self._other_kinds):
                continue
            each, i = self._fits[joint], self._ours.position_index(joint)
            if name in kept and joint not in pair.joints:
                other[name] = np.array(kept[name])
            elif each.before is None:
                other[name] = each.sign * q[i : i + 1]
            else:
                before, after = each.turns
                if (before == np.eye(3)).all() and (after == np.eye(3)).all():
                    other[name] = q[i : i + 4]
                    continue
                other[name] = quat_from_rotation(before.T @ rotation_from_quat(q[i : i + 4]) @ after.T)
        base = None
        if theirs.floating and self._ours.floating:
            T = homogeneous(rotation_from_quat(q[3:7]), q[:3]) @ rounded(self._found.bodies[0].D)
            base = (*T[:3, 3].tolist(), *quat_from_rotation(T[:3, :3]).tolist())
            if pair.other is not None and pair.other.base is not None:
                base = self._kept_of_base(base, pair.other.base) if pair.base else pair.other.base
        positions = tuple(
            (part.name, tuple((other[part.name] + 0.0).tolist()))
            for part in theirs.joints
            if part.name in other
        )
        return NamedConfiguration(mine.name, positions, base)

    def _kept_of_base(self, mine: tuple[float, ...], other: tuple[float, ...]) -> tuple[float, ...]:
        """Return the pose of a base with the entries of `other` that do not differ."""
        xyz = (two if are_near(one, two) else one for one, two in zip(mine[:3], other[:3], strict=True))
        turned = np.abs(rotation_from_quat(np.array(mine[3:])) - rotation_from_quat(np.array(other[3:])))
        return (*xyz, *(mine[3:] if turned.max() > self._tolerance else other[3:]))


_SETTINGS = ("active", "torque_scale", "solref", "solimp")
"""Fields of a constraint that are independent of what it couples."""


def changed_model(theirs: Model, changes: Iterable[StatedChange]) -> Model:
    """Return the second robot with parts changed."""
    parts: dict[str, list[StatedPart]] = {
        "tendon": [*(theirs.tendons or ())],
        "equality": [*(theirs.equalities or ())],
        "keyframe": [*(theirs.stated_configurations or ())],
    }
    for each in changes:
        own = parts[each.section]
        old = each.old
        # Where a joint has another type now, `theirs` may lack its positions, tendons and couplings: a
        # configuration is found by its name, and a part that is not there is added.
        at = next(
            (
                k
                for k, part in enumerate(own)
                if old is not None and (part == old or (each.section == "keyframe" and part.name == old.name))
            ),
            len(own),
        )
        own[at : at + 1] = [] if each.new is None else [each.new]
    return replace(
        theirs,
        tendons=tuple(each for each in parts["tendon"] if isinstance(each, StatedTendon)),
        equalities=tuple(each for each in parts["equality"] if isinstance(each, StatedEquality)),
        stated_configurations=tuple(
            each for each in parts["keyframe"] if isinstance(each, NamedConfiguration)
        ),
    )


# -- effects ------------------------------------------------------------------------------------------------


def effects_of(change: StatedChange, theirs: Model) -> tuple[StatedEffect, ...]:
    """Return the effects of a part of the second robot that differs: over random states within its limits, or
    at the configuration. There is none of a part that one robot has alone, and of positions of joints whose
    types differ."""
    old, new = change.old, change.new
    if isinstance(old, StatedTendon) and isinstance(new, StatedTendon):
        return _effects_of_tendon(old, new, theirs)
    if isinstance(old, StatedEquality) and isinstance(new, StatedEquality):
        return _effects_of_equality(old, new, theirs)
    if isinstance(old, NamedConfiguration) and isinstance(new, NamedConfiguration) and not change.other_types:
        return _effects_of_configuration(old, new, theirs)
    return ()


def _states(theirs: Model) -> tuple[Floats, Floats]:
    rng = np.random.default_rng(SEED)
    return theirs.random(rng, STATES), rng.uniform(-1.0, 1.0, (STATES, theirs.nv))


def _effects_of_tendon(old: StatedTendon, new: StatedTendon, theirs: Model) -> tuple[StatedEffect, ...]:
    q, v = _states(theirs)
    lengths, efforts = [], []
    for each in (old, new):
        length, rate = np.zeros(STATES), np.zeros(STATES)
        for joint, factor in each.terms:
            length += factor * q[:, theirs.position_index(joint)]
            rate += factor * v[:, theirs.coordinate_index(joint)]
        low, high = each.spring_length
        stretch = np.maximum(length - high, 0.0) - np.maximum(low - length, 0.0)
        tension = -each.stiffness * stretch - each.damping * rate - each.friction * np.sign(rate)
        effort = np.zeros((STATES, theirs.nv))
        for joint, factor in each.terms:
            effort[:, theirs.coordinate_index(joint)] += factor * tension
        lengths.append(length)
        efforts.append(effort)
    return (
        StatedEffect("length of the tendon", float(np.max(np.abs(lengths[0] - lengths[1]))), "rad or m"),
        StatedEffect("effort of a joint", float(np.max(np.abs(efforts[0] - efforts[1]))), "N m or N"),
    )


def _effects_of_equality(old: StatedEquality, new: StatedEquality, theirs: Model) -> tuple[StatedEffect, ...]:
    """Return by how much what both constraints hold at 0 differs."""
    q, _ = _states(theirs)
    if (old.type in ("joint", "tendon")) != (new.type in ("joint", "tendon")):
        return ()
    if new.type in ("joint", "tendon"):
        errors = [_coupling_error(each, theirs, q) for each in (old, new)]
        size = float(np.max(np.abs(errors[0] - errors[1])))
        return (StatedEffect("error of the coupling", size, "rad or m"),)
    from dynx.reference.backend import ReferenceBackend  # rarely needed

    poses = ReferenceBackend(theirs).forward_kinematics(q)
    frames = {frame.name: number for number, frame in enumerate(theirs.frames)}

    def place(name: str, pose: Pose) -> Floats:
        if name in frames:
            return np.asarray(poses[:, frames[name]] @ pose.matrix)
        return np.broadcast_to(pose.matrix, (STATES, 4, 4))

    gaps = []
    for each in (old, new):
        one, two = place(each.first, each.first_pose), place(each.second, each.second_pose)
        gaps.append((two[:, :3, 3] - one[:, :3, 3], np.swapaxes(one[:, :3, :3], -1, -2) @ two[:, :3, :3]))
    (shift, turn), (other_shift, other_turn) = gaps
    gap = float(np.max(np.linalg.norm(shift - other_shift, axis=-1)))
    found = [StatedEffect("gap of the constraint", gap, "m")]
    if old.type == new.type == "weld":
        cosines = (np.einsum("nij,nij->n", turn, other_turn) - 1.0) / 2.0
        found.append(
            StatedEffect(
                "rotation of the constraint", float(np.arccos(np.clip(cosines, -1.0, 1.0)).max()), "rad"
            )
        )
    return tuple(found)


def _coupling_error(equality: StatedEquality, theirs: Model, q: Floats) -> Floats:
    def value(name: str) -> Floats:
        if equality.type == "joint":
            return np.asarray(q[:, theirs.position_index(name)])
        tendon = next(each for each in theirs.tendons or () if each.name == name)
        return np.asarray(sum(factor * q[:, theirs.position_index(joint)] for joint, factor in tendon.terms))

    y, x = value(equality.first), value(equality.second) if equality.second else np.zeros(STATES)
    numbers = equality.absolute_polynomial
    return y - (np.polynomial.Polynomial(numbers)(x) if equality.second else numbers[0])


def _effects_of_configuration(
    old: NamedConfiguration, new: NamedConfiguration, theirs: Model
) -> tuple[StatedEffect, ...]:
    from dynx.reference.backend import ReferenceBackend  # rarely needed

    model = replace(theirs, stated_configurations=(replace(old, name="old"), replace(new, name="new")))
    q = np.stack([model.configurations["old"], model.configurations["new"]])
    poses = ReferenceBackend(theirs).forward_kinematics(q)
    moved = float(np.max(np.linalg.norm(poses[1, :, :3, 3] - poses[0, :, :3, 3], axis=-1)))
    joints = theirs.difference(q[0], q[1])[6 * theirs.floating :]
    turned = float(np.max(np.abs(joints), initial=0.0))
    return (
        StatedEffect("position of a joint", turned, "rad or m"),
        StatedEffect("position of a link", moved, "m"),
    )
