"""The model difference: what an engine holds after loading that the file does not say.

The file is represented by a `Model`, whose numbers are those of the document. Where an engine fuses
links that fixed joints hold together, lump is compared with lump. Ways of writing the same thing are
no deviation: no limit as infinity, as 1e8 or as nothing; a revolute joint without limits as a
continuous one.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from dynx.loaded.description import LoadedInertial, LoadedJoint, LoadedModel
from dynx.loaded.lumps import Lump, lumped, welds
from dynx.model import Joint, Model
from dynx.model.model import STANDARD_GRAVITY
from dynx.spatial.scalar import Floats
from dynx.spatial.so3 import rpy_from_rotation

ROUNDING = 1e-12
"""Relative size of a difference that is rounding: composing rotations and lumping bodies takes some
hundred roundings of 1.1e-16, and what lies below does not show in an answer that is judged at 1e-12."""

NO_LIMIT = 1e8
"""Size from which a limit is none: the largest double in some files, 1e9 or 1e10 in some engines."""


@dataclass(frozen=True)
class Deviation:
    """Something an engine holds that the file does not say. Values are numbers, lists, words or None."""

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


Row = tuple[str, str, str, Any, Any]


def model_difference(model: Model, loaded: Iterable[LoadedModel]) -> tuple[Deviation, ...]:
    """Every deviation of the engines from `model`, engine by engine, links before joints.

    The inertia of the root link of a fixed base is left out: it moves nothing, and some engines drop
    it. `model` has the base with which the engines loaded the file.
    """
    return tuple(Deviation(each.engine, *row) for each in loaded for row in _rows(model, each))


def _rows(model: Model, engine: LoadedModel) -> Iterator[Row]:
    reach = _reach(model)
    yield from _links(model, engine, reach)
    for joint in model.joints:
        if not joint.moves:
            continue
        held = engine.joints.get(joint.name)
        if held is None:
            yield "joint", joint.name, "existence", joint.type, None
        else:
            for property, file, value in _joint(joint, held, reach):
                yield "joint", joint.name, property, file, value
    for name in engine.joints:
        if name not in {joint.name for joint in model.joints if joint.moves}:
            yield "joint", name, "existence", None, engine.joints[name].type
    for property, file, value in _pose(np.eye(4), engine.base_frame, reach):
        yield "base", model.root, property, file, value
    if _differ(np.array(STANDARD_GRAVITY), engine.gravity):
        yield "gravity", "gravity", "default", list(STANDARD_GRAVITY), engine.gravity.tolist()


# -- links --------------------------------------------------------------------------------------


def _links(model: Model, engine: LoadedModel, reach: float) -> Iterator[Row]:
    fused = {name for inertial in engine.links.values() for name in inertial.fused}
    places = welds(model)
    for link in model.links:
        held = engine.links.get(link.name)
        still = not model.floating and places[link.name][0] == model.root
        if held is None:
            if not still and link.name not in fused:
                yield "link", link.name, "existence", True, False
        elif not (still and link.name == model.root):
            for property, file, value in _inertial(model, places, link.name, engine.links, reach):
                yield "link", link.name, property, file, value
    known = {link.name for link in model.links}
    for name in engine.links:
        if name not in known:
            yield "link", name, "existence", False, True


def _inertial(
    model: Model,
    places: Mapping[str, tuple[str, Floats]],
    link: str,
    held: Mapping[str, LoadedInertial],
    reach: float,
) -> Iterator[tuple[str, Any, Any]]:
    own = held[link]
    # A fused link that the engine also holds by itself is judged there, not once more here.
    wanted = lumped(model, places, link, own.fused, {name: held[name] for name in own.fused if name in held})
    if _differ(wanted.mass, own.mass):
        yield "mass", float(wanted.mass), own.mass
    if wanted.mass and own.mass and _differ(wanted.center, own.center, reach):
        yield "center", _plain(wanted.center), own.center.tolist()
    if _differ(wanted.inertia, own.inertia, _turning(wanted) if own.fused else 0.0):
        yield "inertia", _plain(wanted.inertia), own.inertia.tolist()


def _turning(lump: Lump) -> float:
    """The moment of inertia about the link's origin that a lump has by its place alone."""
    return float(lump.mass * np.sum(lump.center**2))


# -- joints -------------------------------------------------------------------------------------


def _joint(joint: Joint, held: LoadedJoint, reach: float) -> Iterator[tuple[str, Any, Any]]:
    if (joint.type == "prismatic") != (held.type == "prismatic") or held.type not in _KINDS:
        yield "type", joint.type, held.type
    if held.placement is not None:
        yield from _pose(joint.origin.matrix, held.placement, reach)
    if held.axis is not None and _differ(np.array(joint.axis), held.axis):
        yield "axis", list(joint.axis), held.axis.tolist()
    if held.limits is not None:
        yield from _ends(joint, held.limits)
    for property in ("velocity", "effort"):
        file, value = getattr(joint.limits, property), getattr(held, property)
        # Engines write a bound that the file does not give as none, or as 0.
        free = abs(file) >= NO_LIMIT and value is not None and (value == 0.0 or abs(value) >= NO_LIMIT)
        if value is not None and not free and _differ(file, value):
            yield property, _number(file), _number(value)
    for property in ("damping", "friction", "armature"):
        file, value = getattr(joint.dynamics, property), getattr(held, property)
        if value is not None and _differ(file, value):
            yield property, file, value


_KINDS = ("revolute", "continuous", "prismatic")


def _ends(joint: Joint, held: tuple[float, float]) -> Iterator[tuple[str, Any, Any]]:
    file = (joint.limits.lower, joint.limits.upper)
    if joint.type == "continuous" and held[0] >= held[1]:
        return
    size = max([abs(end) for end in (*file, *held) if abs(end) < NO_LIMIT], default=0.0)
    for property, wanted, value in zip(("lower", "upper"), file, held, strict=True):
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
    """Whether two numbers or arrays differ by more than rounding of the larger, or of `size`."""
    wanted, held = np.asarray(wanted, dtype=np.float64), np.asarray(held, dtype=np.float64)
    if np.array_equal(wanted, held):
        return False
    if not (np.isfinite(wanted).all() and np.isfinite(held).all()):
        return True
    largest = max(size, float(np.max(np.abs(wanted))), float(np.max(np.abs(held))))
    return bool(np.max(np.abs(wanted - held)) > ROUNDING * largest)


def _reach(model: Model) -> float:
    """The largest offset in the file [m]: positions are rounded in proportion to it."""
    offsets = [joint.origin.xyz for joint in model.joints]
    offsets += [link.inertial.origin.xyz for link in model.links if link.inertial is not None]
    return max((abs(x) for offset in offsets for x in offset), default=0.0)


def _number(value: float) -> float | None:
    """None for no limit: JSON has no infinity."""
    return float(value) if abs(value) < NO_LIMIT else None


def _plain(array: Any) -> Any:
    return np.asarray(array, dtype=np.float64).tolist()
