"""Contacts of a robot with itself, at states within its limits in which mimic joints follow."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np

from dynx.doctor.examine.engine_input import temporary_urdf, without_meshes
from dynx.doctor.examine.examination import draw_states, model_without_mimics
from dynx.engines.silence import silence
from dynx.errors import DynxError
from dynx.loaded import loader_class
from dynx.rules.case import Case
from dynx.spatial.scalar import Floats

STATES = 500
"""Number of states at which contacts are looked for, without dynamics: 5 to 15 ms of most robots."""

_MAX_PAIRS = 4
"""Number of pairs that are listed."""


@dataclass
class LinkContact:
    """Number of states in which two links touch, how deep they penetrate each other at most [m], and the
    positions of the joints where they do."""

    states: int = 0
    depth: float = 0.0
    positions: Mapping[str, float] = field(default_factory=dict)


def describe_contacts(case: Case, engine: str, seed: int) -> str:
    """Write which links touch in an engine; empty where the engine cannot tell."""
    try:
        found = links_in_contact(case, engine, seed)
    except DynxError:
        return ""
    if not found:
        return f"none touch in {STATES} states within limits in which mimic joints follow; in others some do"
    deepest = sorted(found.items(), key=lambda item: -item[1].depth)
    listed = [
        f"{one} and {other} touch in {each.states} of {STATES} states, up to {1e3 * each.depth:.3g} mm deep"
        for (one, other), each in deepest[:_MAX_PAIRS]
    ]
    more = len(deepest) - _MAX_PAIRS
    return "; ".join([*listed, *([f"and {more} more pairs"] if more > 0 else [])])


def deepest_contact(case: Case, engines: Iterable[str], seed: int) -> Mapping[str, float] | None:
    """Return the positions of the joints at which two links penetrate each other most deeply, in the first of
    these engines in which any do; None where none touch."""
    for engine in engines:
        try:
            found = links_in_contact(case, engine, seed)
        except DynxError:
            continue
        if found:
            return max(found.values(), key=lambda contact: contact.depth).positions
    return None


def links_in_contact(case: Case, engine: str, seed: int) -> Mapping[tuple[str, str], LinkContact]:
    """Find the pairs of links that touch; raises EngineError where the engine refuses the file."""
    model = model_without_mimics(case.source, case.base)
    base = 7 if model.floating else 0
    found: dict[tuple[str, str], LinkContact] = {}
    with (
        temporary_urdf(without_meshes(case.source)) as path,
        silence(),
        loader_class(engine)(path, model) as robot,
    ):
        for q in following_positions(case, STATES, seed):
            for pair, depth in robot.contacts(q).items():
                contact = found.setdefault(pair, LinkContact())
                contact.states += 1
                if depth > contact.depth:
                    contact.depth = depth
                    contact.positions = dict(zip(model.joint_names, q[base:].tolist(), strict=True))
    return found


def following_positions(case: Case, count: int, seed: int) -> Floats:
    """Draw positions (count, nq) of all moving joints within their limits, in which mimic joints follow."""
    free, model = model_without_mimics(case.source, case.base), case.model
    q = draw_states(model, count, seed).q
    base = 7 if model.floating else 0
    columns = {joint.name: q[:, base + k] for k, joint in enumerate(model.coordinate_joints)}
    for joint in model.joints:
        if joint.mimic is not None and joint.mimic.joint in columns:
            columns[joint.name] = joint.mimic.multiplier * columns[joint.mimic.joint] + joint.mimic.offset
    held = np.zeros(count)
    return np.column_stack([q[:, :base], *(columns.get(name, held) for name in free.joint_names)])
