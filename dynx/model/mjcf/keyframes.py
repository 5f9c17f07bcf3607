"""Keyframes of MJCF: positions and velocities of the joints by name, in the conventions of dynx.

MuJoCo lists the numbers of `qpos` and `qvel` by its joints, in the order of the bodies. A quaternion is
written w, x, y, z there, and need not be a unit quaternion. Missing numbers at the end are those of `qpos0`,
and 0 in `qvel`, as in MuJoCo 4.0.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from dynx.errors import escaped, shown
from dynx.model.mjcf.document import MjcfText
from dynx.model.stated_parts import NamedConfiguration
from dynx.model.xml.reading import Element
from dynx.model.xml.several_files import free_name
from dynx.spatial.scalar import Floats
from dynx.spatial.se3 import homogeneous
from dynx.spatial.so3 import quat_from_rotation, rotation_from_quat

Numbers = tuple[float, ...]

_SHORTEST = 1e-15
"""Length of a quaternion below which MuJoCo takes the identity instead."""

NOT_OF_A_POSITION = ("time", "qvel", "act", "ctrl", "mpos", "mquat")
"""Attributes of a keyframe besides its name and the positions."""


@dataclass(frozen=True)
class TreeCoordinates:
    """The joints of a tree of bodies in the order of MuJoCo.

    `T_world_free` is the pose (4, 4) in the file of the body that moves freely, None for a tree without such
    a body. `positions` are those of the other joints in the pose of the file, by name: one number, or the
    unit quaternion (x, y, z, w) of a ball joint.
    """

    T_world_free: Floats | None
    positions: tuple[tuple[str, Numbers], ...]

    @cached_property
    def initial(self) -> Numbers:
        """The numbers of `qpos0`."""
        found: list[float] = []
        if self.T_world_free is not None:
            base = position_and_quaternion(self.T_world_free)
            found += [*base[:3], *_as_wxyz(base[3:])]
        for _, position in self.positions:
            found += _as_wxyz(position) if len(position) == 4 else position
        return tuple(found)

    @property
    def n_positions(self) -> int:
        """Number of entries of `qpos`."""
        return len(self.initial)

    @cached_property
    def n_rates(self) -> int:
        """Number of entries of `qvel`."""
        of_joints = sum(3 if len(each) == 4 else 1 for _, each in self.positions)
        return 6 * (self.T_world_free is not None) + of_joints


@dataclass(frozen=True)
class TreeState:
    """State of a tree of bodies.

    `base` is the pose of the body that moves freely, position and unit quaternion (x, y, z, w), and `twist`
    (6,) its velocity, linear before angular in world axes; None and zeros without one. Positions are as in
    `TreeCoordinates`, velocities have one number or, for a ball joint, the angular velocity (3,) in the axes
    of the child.
    """

    base: Numbers | None
    twist: Floats
    positions: dict[str, Numbers]
    speeds: dict[str, Numbers]

    def configuration(self, name: str, line: int | None = None) -> NamedConfiguration:
        """Return the positions as those of a robot."""
        return NamedConfiguration(name, tuple(self.positions.items()), self.base, line)

    @property
    def T_world_free(self) -> Floats | None:
        """Pose (4, 4) of the body that moves freely."""
        if self.base is None:
            return None
        return homogeneous(rotation_from_quat(np.array(self.base[3:])), np.array(self.base[:3]))


def read_keyframes(document: MjcfText) -> dict[str, Element]:
    """Return the keyframes by name; number N of the file, from 0, is ``keyframe_N`` if it has no name.

    Raises DescriptionError for another element among them, and for a name that stands twice.
    """
    reading = document.reading
    elements = list(document.sections("keyframe"))
    taken = {each.attributes.get("name", "") for each in elements}
    found: dict[str, Element] = {}
    for number, element in enumerate(elements):
        if element.tag != "key":
            raise reading.error(element, f"<keyframe> has the element <{escaped(element.tag)}>; wanted <key>")
        name = element.attributes.get("name", "") or free_name(f"keyframe_{number}", taken)
        if name in found:
            raise reading.error(element, f"two keyframes have the name {shown(name)}")
        taken.add(name)
        found[name] = element
    return found


def tree_states(
    document: MjcfText, trees: Sequence[TreeCoordinates], key: Element | None = None, name: str = ""
) -> list[TreeState]:
    """Return the state of each tree at a keyframe; None for `qpos0`, at rest.

    Raises DescriptionError for more numbers than the joints have. Fewer get a note.
    """
    what = f"keyframe {shown(name)}"
    q = np.array([x for tree in trees for x in tree.initial])
    q = _filled(document, key, "qpos", what, q)
    v = _filled(document, key, "qvel", what, np.zeros(sum(tree.n_rates for tree in trees)))
    found, in_q, in_v = [], 0, 0
    for tree in trees:
        of_tree = q[in_q : in_q + tree.n_positions], v[in_v : in_v + tree.n_rates]
        found.append(_state(tree, *of_tree))
        in_q, in_v = in_q + tree.n_positions, in_v + tree.n_rates
    return found


def position_and_quaternion(T: Floats) -> Numbers:
    """Return a pose (4, 4) as position and unit quaternion (x, y, z, w)."""
    return (*T[:3, 3].tolist(), *quat_from_rotation(T[:3, :3]).tolist())


def _filled(document: MjcfText, key: Element | None, attribute: str, what: str, default: Floats) -> Floats:
    """Return an array like `default`, of which the first numbers are those of a keyframe."""
    if key is None or not key.attributes.get(attribute, "").strip():
        return default
    reading = document.reading
    numbers = reading.some_numbers(key, attribute, what, 0, len(default))
    if len(numbers) < len(default):
        reading.note(
            key,
            f"{attribute} of {what} has {len(numbers)} of {len(default)} numbers; the others are those of "
            "the pose of the file, at rest, as in MuJoCo",
        )
    return np.concatenate([numbers, default[len(numbers) :]])


def _state(tree: TreeCoordinates, q: Floats, v: Floats) -> TreeState:
    base, twist = None, np.zeros(6)
    in_q = in_v = 0
    if tree.T_world_free is not None:
        quat_xyzw = _unit_xyzw(q[3:7].tolist())
        base = (*q[:3].tolist(), *quat_xyzw)
        if v[:6].any():
            # MuJoCo expresses the angular velocity in the axes of the body.
            twist = np.concatenate([v[:3], rotation_from_quat(np.array(quat_xyzw)) @ v[3:6]])
        in_q, in_v = 7, 6
    positions: dict[str, Numbers] = {}
    speeds: dict[str, Numbers] = {}
    for name, start in tree.positions:
        is_ball = len(start) == 4
        numbers = q[in_q : in_q + len(start)].tolist()
        positions[name] = _unit_xyzw(numbers) if is_ball else tuple(numbers)
        n_rates = 3 if is_ball else 1
        speeds[name] = tuple(v[in_v : in_v + n_rates].tolist())
        in_q, in_v = in_q + len(start), in_v + n_rates
    return TreeState(base, twist, positions, speeds)


def _as_wxyz(quat_xyzw: Sequence[float]) -> Numbers:
    x, y, z, w = quat_xyzw
    return (w, x, y, z)


def _unit_xyzw(quat_wxyz: Sequence[float]) -> Numbers:
    """Return the unit quaternion (x, y, z, w) of one of MuJoCo, for which the shortest are the identity."""
    w, x, y, z = quat_wxyz
    norm = math.hypot(w, x, y, z)
    return (x / norm, y / norm, z / norm, w / norm) if norm >= _SHORTEST else (0.0, 0.0, 0.0, 1.0)
