"""The model difference: properties that differ between an engine's model and the file that it loaded.

A `Model` represents the file, because it has the same numbers. Where an engine merges links that fixed joints
connect, merged inertias are compared. Equivalent forms are not deviations: an absent limit may be infinite,
1e8 or missing, and a revolute joint without limits may be continuous.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from dynx.loaded.robot import LoadedInertial, LoadedJoint, LoadedModel
from dynx.model import Joint, Model
from dynx.model.elements import Inertial, Vector
from dynx.model.tree import STANDARD_GRAVITY
from dynx.spatial.scalar import Floats
from dynx.spatial.se3 import inverse
from dynx.spatial.so3 import rpy_from_rotation

# The inertia of links that fixed joints connect rigidly, in the frame of one of them.


Placements = Mapping[str, tuple[str, Floats]]
"""For each link, the first link of its rigid group, and its pose (4, 4) in that link's frame."""


def rigid_placements(model: Model) -> Placements:
    """Return the placement of each link in its rigid group."""
    placements = {model.root: (model.root, np.eye(4))}
    for joint in model.joints:
        if joint.moves:
            placements[joint.child] = (joint.child, np.eye(4))
        else:
            first, T = placements[joint.parent]
            placements[joint.child] = (first, np.asarray(T @ joint.origin.matrix))
    return placements


def merged_inertial(
    model: Model,
    placements: Placements,
    link: str,
    others: Sequence[str],
    instead: Mapping[str, LoadedInertial],
) -> LoadedInertial:
    """Return the inertia, by the file, of `link` and those of `others` that are rigidly connected to it.

    `placements` is `rigid_placements` of the model. An inertial in `instead` replaces that of the file.
    """
    first, T_first_link = placements[link]
    T_link_first = inverse(T_first_link)
    parts = [_in_frame(model, link, np.eye(4), instead)]
    parts += [
        _in_frame(model, name, T_link_first @ placements[name][1], instead)
        for name in others
        if name in placements and placements[name][0] == first
    ]
    if len(parts) == 1:
        return parts[0]
    mass = sum(part.mass for part in parts)
    center = sum((part.mass * part.center for part in parts), np.zeros(3))
    center = center / mass if mass else center
    # The sum is formed about the common centre of mass, so that no large terms cancel.
    inertia = np.zeros((3, 3))
    for part in parts:
        arm = part.center - center
        inertia += part.inertia + part.mass * ((arm @ arm) * np.eye(3) - np.outer(arm, arm))
    return LoadedInertial(mass, center, inertia)


def _in_frame(model: Model, link: str, T: Floats, instead: Mapping[str, LoadedInertial]) -> LoadedInertial:
    """Return the inertia of one link, where T (4, 4) is its pose in the frame of the result."""
    R, p = T[:3, :3], T[:3, 3]
    if link in instead:
        held = instead[link]
        return LoadedInertial(held.mass, p + R @ held.center, R @ held.inertia @ R.T)
    inertial = model.inertial(link)
    origin = inertial.origin.matrix
    axes = R @ origin[:3, :3]
    return LoadedInertial(inertial.mass, p + R @ origin[:3, 3], axes @ inertial.tensor @ axes.T)


ROUNDING = 1e-12
"""Relative difference up to which two numbers are equal: composing rotations and merging bodies takes about a
hundred roundings of 1.1e-16, and a smaller difference does not show in results that are judged at 1e-12."""

NO_LIMIT = 1e8
"""Magnitude from which a limit counts as absent: files have the largest double, engines 1e9 or 1e10."""


@dataclass(frozen=True)
class Deviation:
    """A property that differs between an engine and the file. Values are numbers, lists, words or None."""

    engine: str
    part: str
    """``link``, ``joint``, ``base`` or ``gravity``."""
    name: str
    property: str
    """``existence``; of a link ``mass``, ``center``, ``inertia``; of a joint ``type``, ``position``,
    ``rotation`` (rpy), ``axis``, ``lower``, ``upper``, ``velocity``, ``effort``, ``damping``,
    ``friction``, ``armature``; of the base ``position``, ``rotation``; ``default``, of gravity."""
    file: Any
    engine_value: Any
    line: int | None = None
    """Line of the part in the file; None where the file does not state it."""


Row = tuple[str, str, str, Any, Any]


def model_difference(
    model: Model, loaded: Iterable[LoadedModel], gravity: Vector = STANDARD_GRAVITY
) -> tuple[Deviation, ...]:
    """Return every deviation of the engines from `model`, engine by engine, links before joints.

    `gravity` [m/s^2] is that of the file: URDF states none, and has the standard one.

    The inertia of the root link of a fixed base is not compared: no result depends on it, and some engines
    drop it. `model` has the base with which the engines loaded the file.
    """
    lines = {("link", link.name): link.line for link in model.links}
    lines |= {("joint", joint.name): joint.line for joint in model.joints}
    return tuple(
        Deviation(each.engine, *row, line=lines.get((row[0], row[1])))
        for each in loaded
        for row in _rows(model, each, gravity)
    )


def _rows(model: Model, engine: LoadedModel, gravity: Vector) -> Iterator[Row]:
    reach = _reach(model)
    added = _added_links(model)
    yield from _links(model, engine, reach, added)
    for joint in model.joints:
        if not joint.moves:
            continue
        held = engine.joints.get(joint.name)
        if held is None:
            yield "joint", joint.name, "existence", joint.type, None
        else:
            if added & {joint.parent, joint.child}:
                # Engines place these joints from the bodies, which the links in between are not.
                held = replace(held, placement=None)
            for property, file, value in _joint(joint, held, reach):
                yield "joint", joint.name, property, file, value
    for name in engine.joints:
        if name not in {joint.name for joint in model.joints if joint.moves}:
            yield "joint", name, "existence", None, engine.joints[name].type
    for property, file, value in _pose(model.base_pose.matrix, engine.base_frame, reach):
        yield "base", model.root, property, file, value
    if _differ(np.array(gravity), engine.gravity):
        yield "gravity", "gravity", "default", list(gravity), engine.gravity.tolist()


def _added_links(model: Model) -> set[str]:
    """Return the links without mass that stand between the joints of one body of MJCF or SDF."""
    own = Inertial()
    return {
        link.name
        for link in model.links
        if link.inertial is not None and link.inertial.line is None and link.inertial == own
    }


# -- links --------------------------------------------------------------------------------------


def _links(model: Model, engine: LoadedModel, reach: float, added: set[str]) -> Iterator[Row]:
    merged = {name for inertial in engine.links.values() for name in inertial.merged}
    placements = rigid_placements(model)
    for link in model.links:
        held = engine.links.get(link.name)
        static = not model.floating and placements[link.name][0] == model.root
        if held is None:
            if not static and link.name not in merged and link.name not in added:
                yield "link", link.name, "existence", True, False
        elif not (static and link.name == model.root):
            for property, file, value in _inertial(model, placements, link.name, engine.links, reach):
                yield "link", link.name, property, file, value
    known = {link.name for link in model.links}
    for name in engine.links:
        held = engine.links[name]
        # Engines add links without mass between the joints of one body.
        if name not in known and (held.mass or held.inertia.any()):
            yield "link", name, "existence", False, True


def _inertial(
    model: Model,
    placements: Placements,
    link: str,
    held: Mapping[str, LoadedInertial],
    reach: float,
) -> Iterator[tuple[str, Any, Any]]:
    own = held[link]
    # A merged link that also has an entry of its own in the engine is compared in that entry only.
    instead = {name: held[name] for name in own.merged if name in held}
    wanted = merged_inertial(model, placements, link, own.merged, instead)
    if _differ(wanted.mass, own.mass):
        yield "mass", float(wanted.mass), own.mass
    if wanted.mass and own.mass and _differ(wanted.center, own.center, reach):
        yield "center", _plain(wanted.center), own.center.tolist()
    if _differ(wanted.inertia, own.inertia, _offset_inertia(wanted) if own.merged else 0.0):
        yield "inertia", _plain(wanted.inertia), own.inertia.tolist()


def _offset_inertia(inertial: LoadedInertial) -> float:
    """Return the part of the moment of inertia about the link's origin that comes from the centre of mass."""
    return float(inertial.mass * np.sum(inertial.center**2))


# -- joints -------------------------------------------------------------------------------------


def _joint(joint: Joint, held: LoadedJoint, reach: float) -> Iterator[tuple[str, Any, Any]]:
    ball = joint.type == "ball"
    if (joint.type == "prismatic") != (held.type == "prismatic") or held.type not in (
        _BALL_KINDS if ball else _KINDS
    ):
        yield "type", joint.type, held.type
    if held.placement is not None:
        yield from _pose(joint.origin.matrix, held.placement, reach)
    # A ball joint has no axis.
    if not ball and held.axis is not None and _differ(np.array(joint.axis), held.axis):
        yield "axis", list(joint.axis), held.axis.tolist()
    if held.limits is not None:
        yield from _ends(joint, held.limits)
    for property in ("velocity", "effort"):
        file, value = getattr(joint.limits, property), getattr(held, property)
        # For a limit that is absent in the file, engines hold a very large number or 0.
        free = abs(file) >= NO_LIMIT and value is not None and (value == 0.0 or abs(value) >= NO_LIMIT)
        if value is not None and not free and _differ(file, value):
            yield property, _number(file), _number(value)
    for property in ("damping", "friction", "armature"):
        file, value = getattr(joint.dynamics, property), getattr(held, property)
        if value is not None and _differ(file, value):
            yield property, file, value


_KINDS = ("revolute", "continuous", "prismatic")
_BALL_KINDS = ("ball", "ball_rpy", "spherical")


def _ends(joint: Joint, held: tuple[float, float]) -> Iterator[tuple[str, Any, Any]]:
    file = (joint.limits.lower, joint.limits.upper)
    if joint.type == "continuous" and held[0] >= held[1]:
        return
    size = max([abs(end) for end in (*file, *held) if abs(end) < NO_LIMIT], default=0.0)
    for property, wanted, value in zip(("lower", "upper"), file, held, strict=True):
        # The limit of a ball joint is its largest angle alone.
        if joint.type == "ball" and property == "lower":
            continue
        both_free = min(abs(wanted), abs(value)) >= NO_LIMIT and wanted * value > 0.0
        if not both_free and _differ(wanted, value, size):
            yield property, _number(wanted), _number(value)


def _pose(wanted: Floats, held: Floats, reach: float) -> Iterator[tuple[str, Any, Any]]:
    if _differ(wanted[:3, 3], held[:3, 3], reach):
        yield "position", wanted[:3, 3].tolist(), held[:3, 3].tolist()
    if _differ(wanted[:3, :3], held[:3, :3]):
        rpy = rpy_from_rotation(np.stack([wanted[:3, :3], held[:3, :3]]))
        yield "rotation", rpy[0].tolist(), rpy[1].tolist()


# -- numbers ------------------------------------------------------------------------------------


def _differ(wanted: Any, held: Any, size: float = 0.0) -> bool:
    """Check whether two numbers or arrays differ by more than rounding of the largest entry, or of `size`."""
    wanted, held = np.asarray(wanted, dtype=np.float64), np.asarray(held, dtype=np.float64)
    if np.array_equal(wanted, held):
        return False
    if not (np.isfinite(wanted).all() and np.isfinite(held).all()):
        return True
    largest = max(size, float(np.max(np.abs(wanted))), float(np.max(np.abs(held))))
    return bool(np.max(np.abs(wanted - held)) > ROUNDING * largest)


def _reach(model: Model) -> float:
    """Return the largest offset in the file [m], in proportion to which positions are rounded."""
    offsets = [joint.origin.xyz for joint in model.joints]
    offsets += [link.inertial.origin.xyz for link in model.links if link.inertial is not None]
    return max((abs(x) for offset in offsets for x in offset), default=0.0)


def _number(value: float) -> float | None:
    """Return the limit, or None where there is none, because JSON has no infinity."""
    return float(value) if abs(value) < NO_LIMIT else None


def _plain(array: Any) -> Any:
    return np.asarray(array, dtype=np.float64).tolist()
