"""Rigid bodies that are to stay apart, and the pairs of them, with the margins that can be kept."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from dynx.distance.solids import Solid, distance_of_solids
from dynx.model import Model
from dynx.model.geometry import Shape
from dynx.rbd.kinematics import body_poses
from dynx.spatial.scalar import Floats
from dynx.spatial.se3 import homogeneous

SAMPLES = 50
"""Random configurations that tell whether two links touch by the way that they are modelled."""

ALWAYS, MOSTLY = 0.9, 0.5
"""Shares of these configurations: links that overlap always are not kept apart, and a distance that is
mostly smaller is no margin."""

ROUNDING = 1e-6
"""Length [m] that a margin of links by their neutral configuration is less than their distance there, because
depths are known within bounds only."""

_IDENTITY: Floats = np.eye(4)

PlacedSolid = tuple[Solid, Floats, list[float]]
"""A solid, its pose (4, 4), and the centre and radius of a ball around it."""


@dataclass(frozen=True, eq=False)
class Part:
    """A rigid body: a link of the robot, a body that it carries, or an obstacle."""

    name: str
    frame: str | None
    """Frame of the robot that moves the body; None for an obstacle, which does not move."""
    shapes: tuple[tuple[Shape, Floats], ...]
    """Shapes with their poses (4, 4) in the frame, or in the world."""

    def solids(self) -> list[Solid]:
        """Prepare the shapes for distances. Raises the errors of `Mesh.hull`."""
        return [Solid(shape, T) for shape, T in self.shapes]


@dataclass(frozen=True)
class Pair:
    """Two bodies, by their numbers, that are to be at least `margin` [m] apart."""

    a: int
    b: int
    margin: float


@dataclass(frozen=True)
class Separation:
    """Distance of two bodies between its bounds, with the solids that are nearest."""

    lower: float
    """Certified lower bound of the signed distance [m]."""
    upper: float
    """Certified upper bound of the signed distance [m]."""
    distance: float
    """Signed distance [m]: negative where the bodies overlap."""
    point_a: Floats
    """Nearest point (3,) of a in the world [m]."""
    point_b: Floats
    normal: Floats
    """Unit vector (3,) from b to a."""


def separation_of(a: Sequence[PlacedSolid], b: Sequence[PlacedSolid], limit: float) -> Separation | None:
    """Return the distance of two bodies, or None if it is certainly larger than `limit` [m]."""
    best, lower = None, math.inf
    for solid_a, T_a, ball_a in a:
        for solid_b, T_b, ball_b in b:
            if math.dist(ball_a[:3], ball_b[:3]) - ball_a[3] - ball_b[3] > limit:
                continue
            found = distance_of_solids(solid_a, T_a, solid_b, T_b, limit)
            if found is None:
                continue
            lower = min(lower, found.lower)
            if best is None or found.distance < best.distance:
                best, limit = found, min(limit, found.distance)
    if best is None:
        return None
    return Separation(lower, best.upper, best.distance, best.point_a, best.point_b, best.normal)


def place(solids: Iterable[Solid], T: Floats | None) -> list[PlacedSolid]:
    """Return the solids of a body whose frame is at T (4, 4), or of an obstacle."""
    return [solid.place(_IDENTITY if T is None else T) for solid in solids]


def adapted_pairs(
    model: Model, parts: Sequence[Part], solids: Sequence[list[Solid]], pairs: Iterable[Pair]
) -> tuple[tuple[Pair, ...], dict[tuple[str, str], str]]:
    """Return the pairs with margins that the robot can keep, and a sentence for each that differs.

    Links whose shapes are closer than the margin at the neutral configuration are so by the way that they
    are built or modelled (hulls of hollow parts, closed fingers). They keep that distance instead, or do not
    overlap if they are closer in most configurations. Links that overlap in nearly all are not kept apart. A
    link that is closer to an obstacle in all configurations, as the first one above a table, stays so close.
    """
    kept: list[Pair] = []
    reasons: dict[tuple[str, str], str] = {}
    placed = _placed(model, parts, solids, model.clip(model.neutral()))
    draws: list[dict[int, list[PlacedSolid]]] = []
    for pair in pairs:
        names = parts[pair.a].name, parts[pair.b].name
        found = separation_of(placed[pair.a], placed[pair.b], pair.margin)
        if found is None or found.lower >= pair.margin:
            kept.append(pair)
            continue
        if not draws:
            draws = [_placed(model, parts, solids, model.random(k)) for k in range(SAMPLES)]
        drawn = [separation_of(each[pair.a], each[pair.b], pair.margin) for each in draws]
        distances = [math.inf if each is None else each.lower for each in drawn]
        is_link = parts[pair.a].frame is not None and parts[pair.b].frame is not None
        rule = _between_links if is_link else _from_obstacle
        margin, reason = rule(pair.margin, found.lower, distances)
        if margin is not None:
            kept.append(replace(pair, margin=margin))
        if reason:
            reasons[names] = reason
    return tuple(kept), reasons


def _between_links(margin: float, neutral: float, distances: Sequence[float]) -> tuple[float | None, str]:
    """Return the margin of two links that are too close at the neutral configuration, and why."""
    bound = max(neutral, 0.0)
    close = sum(distance <= bound for distance in distances)
    if neutral > 0.0 and close > MOSTLY * SAMPLES:
        return 0.0, (
            f"{neutral:.3g} m apart at the neutral configuration and closer in {close} of {SAMPLES} others: "
            "kept from overlapping"
        )
    if neutral > 0.0:
        return neutral - ROUNDING, f"{neutral:.3g} m apart at the neutral configuration: their margin"
    if close < ALWAYS * SAMPLES:
        return neutral - ROUNDING, f"overlap by {-neutral:.3g} m at the neutral configuration, and may do so"
    return None, f"overlap in {close} of {SAMPLES} configurations: not kept apart"


def _from_obstacle(margin: float, neutral: float, distances: Sequence[float]) -> tuple[float | None, str]:
    """Return the margin of a link and an obstacle, which differs only if no configuration keeps it."""
    least, most = min([neutral, *distances]), max([neutral, *distances])
    if most >= margin:
        return margin, ""
    if least > 0.0:
        return least - ROUNDING, f"{least:.3g} to {most:.3g} m apart in all configurations: kept so"
    if most > 0.0:
        return 0.0, f"at most {most:.3g} m apart in any configuration: kept from overlapping"
    return None, "overlap in all configurations: not kept apart"


def _placed(
    model: Model, parts: Sequence[Part], solids: Sequence[list[Solid]], q: Floats
) -> dict[int, list[PlacedSolid]]:
    """Return the solids of the parts at a configuration (nq,)."""
    poses = frame_poses(model, q)
    return {
        k: place(solids[k], None if part.frame is None else poses[part.frame]) for k, part in enumerate(parts)
    }


def frame_poses(model: Model, q: Floats) -> Mapping[str, Floats]:
    """Return the poses (4, 4) in the world of all frames of the mechanism, at q (nq,)."""
    mechanism = model.mechanism
    bodies = body_poses(mechanism, mechanism.tree_q(q))
    return {
        frame.name: np.asarray(homogeneous(*bodies[frame.body]) @ homogeneous(frame.R, frame.p), dtype=float)
        for frame in mechanism.frames
    }
