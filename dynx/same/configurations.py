"""Named configurations of two robots, such as keyframes of MJCF, as positions of the first one."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from dynx.model import Model
from dynx.model.elements import Pose
from dynx.same.attributes import Attribute, Kind, listed, number_text
from dynx.same.decimals import rounded
from dynx.same.fit import Fit
from dynx.same.stated import counterparts
from dynx.same.text import pose_text
from dynx.spatial.scalar import Floats
from dynx.spatial.se3 import homogeneous, inverse
from dynx.spatial.so3 import rotation_from_quat


class _Configuration(NamedTuple):
    """A configuration: positions of our joints, and the pose (4, 4) of our base if it floats."""

    name: str
    positions: dict[str, float]
    T_world_base: Floats | None
    line: int | None


def configuration_differences(
    ours: Model, theirs: Model, found: Fit, tolerance: float
) -> Iterator[Attribute]:
    """Yield the named configurations that differ, that one description has alone, or that have other names;
    nothing where a description leaves them open. Joints without counterpart are not compared."""
    if ours.stated_configurations is None or theirs.stated_configurations is None:
        return
    joints = [
        (each, found.ours.joints[each.ours].name, found.theirs.joints[each.theirs].name)
        for each in found.bodies[1:]
    ]
    joints = [row for row in joints if row[1] in ours.joint_names and row[2] in theirs.joint_names]
    D = rounded(found.bodies[0].D)
    mine = [
        _Configuration(
            each.name,
            {one: float(q[ours.position_index(one)]) for _, one, _ in joints},
            _base(q) if ours.floating else None,
            each.line,
        )
        for each in ours.stated_configurations
        for q in [ours.configurations[each.name]]
    ]
    other = [
        _Configuration(
            each.name,
            {one: fit.sign * float(q[theirs.position_index(two)]) for fit, one, two in joints},
            _base(q) @ inverse(D) if theirs.floating else None,
            each.line,
        )
        for each in theirs.stated_configurations
        for q in [theirs.configurations[each.name]]
    ]
    reach = max(found.ours.reach, 1.0)

    def changed(a: _Configuration, b: _Configuration) -> list[str]:
        """Return the names of the joints whose positions differ."""
        return [
            name
            for name, x in a.positions.items()
            if abs(x - b.positions[name]) > tolerance * (reach if ours.joint(name).unit == "m" else 1.0)
        ]

    def base_differs(a: _Configuration, b: _Configuration) -> bool:
        if a.T_world_base is None or b.T_world_base is None:
            return False
        size = reach + float(np.abs(a.T_world_base[:3, 3]).max())
        off = np.abs(a.T_world_base - b.T_world_base)
        return bool(off[:3, :3].max() > 4.0 * tolerance or off[:3, 3].max() > tolerance * size)

    def are_equal(a: _Configuration, b: _Configuration) -> bool:
        return not changed(a, b) and not base_differs(a, b)

    for one, two, equal in counterparts(mine, other, are_equal, lambda _: None):
        at, by_base = list[str](), False
        if one is not None and two is not None:
            at, by_base = changed(one, two), base_differs(one, two)
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


def _base(q: Floats) -> Floats:
    return homogeneous(rotation_from_quat(q[3:7]), q[:3])


def _text(configuration: _Configuration, joints: list[str], base: bool) -> str:
    """Write the positions that differ, in the coordinates of our robot."""
    words = [f"{name} {number_text(configuration.positions[name])}" for name in joints]
    if base and configuration.T_world_base is not None:
        words.insert(0, f"base {pose_text(Pose.from_matrix(configuration.T_world_base))}")
    return listed(words) if words else "stated"
