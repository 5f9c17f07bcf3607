"""Named configurations of two robots, such as keyframes of MJCF, as positions of the first one."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from dynx.model import Model
from dynx.model.elements import Pose
from dynx.model.stated_parts import NamedConfiguration
from dynx.same.attributes import Attribute, Kind, listed, number_text
from dynx.same.decimals import rounded
from dynx.same.fit import Fit
from dynx.same.skeleton import kind_of
from dynx.same.stated import counterparts
from dynx.same.stated_poses import ball_rotation, base_pose, poses_differ, rotations_differ
from dynx.same.text import pose_text, vector_text
from dynx.spatial.scalar import Floats
from dynx.spatial.se3 import inverse
from dynx.spatial.so3 import quat_from_rotation


class _Configuration(NamedTuple):
    """A configuration: positions of our joints, rotations (3, 3) of ball joints, and the pose (4, 4) of our
    base if it floats. `others` has the positions, in words, of joints whose counterparts are of another
    type."""

    name: str
    positions: dict[str, float]
    rotations: dict[str, Floats]
    others: dict[str, str]
    T_world_base: Floats | None
    line: int | None


def configuration_differences(
    ours: Model, theirs: Model, found: Fit, tolerance: float
) -> Iterator[Attribute]:
    """Yield the named configurations that differ, that one description has alone, or that have other names;
    nothing where a description leaves them open. Joints without counterpart are not compared. A position of a
    joint differs from that of a joint of another type.
    """
    rules = _CommonCoordinates(ours, theirs, found, tolerance)
    for one, two, equal in rules.pairs():
        at, by_base = list[str](), False
        if one is not None and two is not None:
            at, by_base = rules.changed(one, two), rules.base_differs(one, two)
        labels = [None if each is None else each.name for each in (one, two)]
        texts = ["none" if each is None else _text(each, at, by_base) for each in (one, two)]
        lines = [None if each is None else each.line for each in (one, two)]
        if not equal:
            kind: Kind = "configuration"
        elif labels[0] != labels[1]:
            kind, texts = "name", [each or "" for each in labels]
        else:
            continue
        yield Attribute(kind, "configuration", labels[0], labels[1], texts[0], texts[1], lines[0], lines[1])


class ConfigurationPair(NamedTuple):
    """Configurations that correspond, by their names or because they are equal; None for one alone.

    `joints` are our names of the joints whose positions differ, and `base` tells whether the bases do.
    """

    mine: NamedConfiguration | None
    other: NamedConfiguration | None
    equal: bool
    joints: frozenset[str] = frozenset()
    base: bool = False


def configuration_pairs(
    ours: Model, theirs: Model, found: Fit, tolerance: float
) -> Iterator[ConfigurationPair]:
    """Yield the configurations of two robots, in pairs."""
    mine, other = (
        {each.name: each for each in model.stated_configurations or ()} for model in (ours, theirs)
    )
    rules = _CommonCoordinates(ours, theirs, found, tolerance)
    for one, two, equal in rules.pairs():
        if one is None or two is None:
            yield ConfigurationPair(
                None if one is None else mine[one.name], None if two is None else other[two.name], equal
            )
            continue
        joints = frozenset(rules.changed(one, two))
        yield ConfigurationPair(mine[one.name], other[two.name], equal, joints, rules.base_differs(one, two))


def joints_of_other_kinds(ours: Model, theirs: Model, found: Fit) -> dict[str, str | None]:
    """Return the joints of `theirs` that are of another type than their counterparts in `ours`, with the
    names of these; None for a fixed one."""
    names: dict[str, str | None] = {}
    for each in found.bodies[1:]:
        one, two = found.ours.joints[each.ours].name, found.theirs.joints[each.theirs].name
        if kind_of(ours.joint(one)) != kind_of(theirs.joint(two)):
            names[two] = one
    # One that is to be fixed has no body of its own.
    fixed = (name for name in theirs.joint_names if not found.theirs.model.joint(name).moves)
    return names | dict.fromkeys(fixed)


class _CommonCoordinates:
    """The named configurations of two robots, in the coordinates of the first."""

    def __init__(self, ours: Model, theirs: Model, found: Fit, tolerance: float) -> None:
        self._ours, self._tolerance = ours, tolerance
        self._reach = max(found.ours.reach, 1.0)
        self.mine: list[_Configuration] = []
        self.other: list[_Configuration] = []
        if ours.stated_configurations is None or theirs.stated_configurations is None:
            return
        joints = [
            (each, found.ours.joints[each.ours].name, found.theirs.joints[each.theirs].name)
            for each in found.bodies[1:]
        ]
        other_kinds = joints_of_other_kinds(ours, theirs, found)
        joints = [row for row in joints if row[1] in ours.joint_names and row[2] in theirs.joint_names]
        joints = [row for row in joints if row[2] not in other_kinds]
        balls = [row for row in joints if row[0].before is not None]
        joints = [row for row in joints if row[0].before is None]
        D = rounded(found.bodies[0].D)
        self.mine = [
            _Configuration(
                each.name,
                {one: float(q[ours.position_index(one)]) for _, one, _ in joints},
                {one: ball_rotation(ours, q, one) for _, one, _ in balls},
                {one or two: _position_text(ours, q, one) for two, one in other_kinds.items()},
                base_pose(q) if ours.floating else None,
                each.line,
            )
            for each in ours.stated_configurations
            for q in [ours.configurations[each.name]]
        ]
        self.other = [
            _Configuration(
                each.name,
                {one: fit.sign * float(q[theirs.position_index(two)]) for fit, one, two in joints},
                {one: fit.turns[0] @ ball_rotation(theirs, q, two) @ fit.turns[1] for fit, one, two in balls},
                {one or two: _position_text(theirs, q, two) for two, one in other_kinds.items()},
                base_pose(q) @ inverse(D) if theirs.floating else None,
                each.line,
            )
            for each in theirs.stated_configurations
            for q in [theirs.configurations[each.name]]
        ]

    def pairs(self) -> Iterator[tuple[_Configuration | None, _Configuration | None, bool]]:
        """Yield the configurations that correspond, each pair with whether they are equal."""
        return counterparts(self.mine, self.other, self._are_equal, lambda _: None)

    def changed(self, a: _Configuration, b: _Configuration) -> list[str]:
        """Return the names of the joints whose positions differ."""
        tolerance, joint = self._tolerance, self._ours.joint
        return (
            [
                name
                for name, x in a.positions.items()
                if abs(x - b.positions[name]) > tolerance * (self._reach if joint(name).unit == "m" else 1.0)
            ]
            + [name for name, R in a.rotations.items() if rotations_differ(R, b.rotations[name], tolerance)]
            + list(a.others)
        )

    def base_differs(self, a: _Configuration, b: _Configuration) -> bool:
        """Check whether the poses of floating bases differ."""
        if a.T_world_base is None or b.T_world_base is None:
            return False
        return poses_differ(a.T_world_base, b.T_world_base, self._tolerance, self._reach)

    def _are_equal(self, a: _Configuration, b: _Configuration) -> bool:
        return not self.changed(a, b) and not self.base_differs(a, b)


def _position_text(model: Model, q: Floats, name: str | None) -> str:
    """Write the position of a joint with its unit, or that it has none."""
    if name is None or name not in model.joint_names:
        return "fixed" if name is None or not model.joint(name).moves else "follows another joint"
    joint = model.joint(name)
    if joint.type == "ball":
        return vector_text(quat_from_rotation(ball_rotation(model, q, name)), 9)
    return f"{number_text(float(q[model.position_index(name)]))} {joint.unit}"


def _text(configuration: _Configuration, joints: list[str], base: bool) -> str:
    """Write the positions that differ, in the coordinates of our robot."""
    positions, rotations = configuration.positions, configuration.rotations
    texts = {name: number_text(x) for name, x in positions.items()}
    texts |= {name: vector_text(quat_from_rotation(R), 9) for name, R in rotations.items()}
    texts |= configuration.others
    words = [f"{name} {texts[name]}" for name in joints]
    if base and configuration.T_world_base is not None:
        words.insert(0, f"base {pose_text(Pose.from_matrix(configuration.T_world_base))}")
    return listed(words) if words else "stated"
