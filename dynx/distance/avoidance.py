"""Bodies that are to stay apart: which pairs of them, how far, how near they are, and sentences on that.

A scene makes an `Avoidance` (`dynx.world.Scene.avoidance`); this module knows no scene. `dynx.ik` finds
configurations that keep the margins.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from threading import Lock
from typing import Any, NamedTuple, Protocol, overload, runtime_checkable

import numpy as np

from dynx.distance.solids import Solid, distance_of_solids
from dynx.errors import ArgumentError, shown
from dynx.model.geometry import Shape
from dynx.model.model import Model
from dynx.model.numbers import is_real
from dynx.rbd.kinematics import body_poses
from dynx.spatial.scalar import Floats
from dynx.spatial.se3 import homogeneous
from dynx.time_limit import UNLIMITED, TimeLimit

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
class AvoidingPart:
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
class BodyDistance:
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


def separation_of(a: Sequence[PlacedSolid], b: Sequence[PlacedSolid], limit: float) -> BodyDistance | None:
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
    return BodyDistance(lower, best.upper, best.distance, best.point_a, best.point_b, best.normal)


def place(solids: Iterable[Solid], T: Floats | None) -> list[PlacedSolid]:
    """Return the solids of a body whose frame is at T (4, 4), or of an obstacle."""
    return [solid.place(_IDENTITY if T is None else T) for solid in solids]


def adapted_pairs(
    model: Model, parts: Sequence[AvoidingPart], solids: Sequence[list[Solid]], pairs: Iterable[Pair]
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
        return (
            neutral - ROUNDING,
            f"overlap by {-neutral:.3g} m at the neutral configuration, which is allowed",
        )
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
    model: Model, parts: Sequence[AvoidingPart], solids: Sequence[list[Solid]], q: Floats
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


MAX_MARGIN = 10.0
"""Largest margin [m]."""


MAX_NAMES = 3
"""Largest number of links that a note names."""


class NearPair(NamedTuple):
    """A pair of bodies that are near one another, and their distance."""

    pair: Pair
    separation: BodyDistance

    @property
    def is_clear(self) -> bool:
        """Whether the certified lower bound of the distance is at least the margin."""
        return self.separation.lower >= self.pair.margin


class Avoidance:
    """The shapes of a robot and its surroundings, and the pairs of them that are to stay apart.

    `Scene.avoidance` makes one. Obstacles stay where they are; a mesh stands for its convex hull. Distances
    are those of `dynx.distance`, between two bounds: a configuration keeps a margin if the lower bound does.
    Safe to use from several threads.
    """

    def __init__(
        self,
        model: Model,
        parts: Sequence[AvoidingPart],
        pairs: Iterable[tuple[int, int, float]],
        without_shapes: Sequence[str] = (),
    ) -> None:
        """`pairs` are two numbers in `parts` and the margin [m] of each pair; `without_shapes` are the moving
        links that lack a collision shape. Raises ArgumentError for a margin, and the errors of `Mesh.hull`.
        """
        self.model = model
        self.parts = tuple(parts)
        self._solids = [part.solids() for part in self.parts]
        wanted = [Pair(a, b, checked_distance("margin", margin)) for a, b, margin in pairs]
        self.pairs, self.exceptions = adapted_pairs(model, self.parts, self._solids, wanted)
        self._obstacles = {
            k: place(self._solids[k], None) for k, part in enumerate(self.parts) if part.frame is None
        }
        self._frames = {part.frame for part in self.parts} - {None}
        self._lock = Lock()
        self.note = "; ".join(_notes(without_shapes, self.pairs))
        """Sentence on links that are kept from nothing because they have no collision shape; empty if there
        are none. Results of inverse kinematics repeat it."""

    pairs: tuple[Pair, ...]
    """The pairs that stay apart, with the margin of each."""
    exceptions: Mapping[tuple[str, str], str]
    """Pairs of links that cannot keep the margin by the way they are modelled, and what holds instead."""

    def avoidance_for(self, model: Model) -> Avoidance:
        """Return this object, if it was made for a robot like `model`; raise ArgumentError otherwise."""
        own = self.model
        if own is model or same_kinematics(own, model):
            return self
        fixed = not (own.floating or model.floating)
        if fixed and same_kinematics(own, model.with_base_pose(own.base_pose)):
            raise ArgumentError(
                f"the scene has robot {shown(own.name)} at another base pose than the model of the backend; "
                "make the backend from the model of the scene's robot"
            )
        raise ArgumentError(
            f"avoid is for robot {shown(own.name)}, whose joints or links are not those of the backend's "
            f"{shown(model.name)}; make the backend from the model of the scene's robot"
        )

    def names(self, pair: Pair) -> tuple[str, str]:
        """Return the names of the bodies of a pair."""
        return self.parts[pair.a].name, self.parts[pair.b].name

    @overload
    def near(self, backend: FrameKinematics, q: Floats, beyond: float = 0.0) -> list[NearPair]: ...

    @overload
    def near(
        self, backend: FrameKinematics, q: Floats, beyond: float = 0.0, *, time_limit: TimeLimit
    ) -> list[NearPair] | None: ...

    def near(
        self, backend: FrameKinematics, q: Floats, beyond: float = 0.0, *, time_limit: TimeLimit = UNLIMITED
    ) -> list[NearPair] | None:
        """Return the pairs at q (nq,) whose distance may be below the margin plus `beyond` [m]; None if the
        time was over before every pair was examined."""
        poses: dict[Any, Floats] = {
            frame: backend.forward_kinematics(q, frame) for frame in self._frames if frame is not None
        }
        # The prepared shapes hold the pose at which they are.
        with self._lock:
            placed = [
                self._obstacles[k] if part.frame is None else place(self._solids[k], poses[part.frame])
                for k, part in enumerate(self.parts)
            ]
            found = []
            for pair in self.pairs:
                if time_limit.is_over():
                    return None
                separation = separation_of(placed[pair.a], placed[pair.b], pair.margin + beyond)
                if separation is not None:
                    found.append(NearPair(pair, separation))
        return found

    @overload
    def violated(self, backend: FrameKinematics, q: Floats) -> list[NearPair]: ...

    @overload
    def violated(
        self, backend: FrameKinematics, q: Floats, *, time_limit: TimeLimit
    ) -> list[NearPair] | None: ...

    def violated(
        self, backend: FrameKinematics, q: Floats, *, time_limit: TimeLimit = UNLIMITED
    ) -> list[NearPair] | None:
        """Return the pairs that are not proved to keep their margin at q (nq,); None if the time was over
        before every pair was examined."""
        near = self.near(backend, q, time_limit=time_limit)
        return None if near is None else [each for each in near if not each.is_clear]

    def is_clear(self, backend: FrameKinematics, q: Floats, time_limit: TimeLimit = UNLIMITED) -> bool:
        """Return whether all pairs are proved to keep their margins at q (nq,), before the time is over."""
        return self.violated(backend, q, time_limit=time_limit) == []

    def gradients(self, backend: FrameKinematics, q: Floats, near: Sequence[NearPair]) -> Floats:
        """Return the derivatives (n, nv) of the distances of pairs at q."""
        rows = np.zeros((len(near), backend.model.nv))
        for row, (pair, found) in zip(rows, near, strict=True):
            for number, point, sign in ((pair.a, found.point_a, 1.0), (pair.b, found.point_b, -1.0)):
                frame = self.parts[number].frame
                if frame is not None:
                    T = backend.forward_kinematics(q, frame)
                    local = T[:3, :3].T @ (point - T[:3, 3])
                    row += sign * (found.normal @ backend.jacobian(q, frame, point=local)[:3])
        return rows

    def __getstate__(self) -> dict[str, Any]:
        state = self.__dict__.copy()
        del state["_lock"]
        return state

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state, _lock=Lock())

    def __repr__(self) -> str:
        return f"<Avoidance of {self.model.name}: {len(self.parts)} bodies, {len(self.pairs)} pairs>"


class FrameKinematics(Protocol):
    """Poses and Jacobians of the frames of a robot: a `dynx.Backend`, which lies above this module."""

    @property
    def model(self) -> Model:
        """The robot."""

    def forward_kinematics(self, q: Floats, frame: str) -> Floats:
        """Return T_world_frame (4, 4)."""

    def jacobian(self, q: Floats, frame: str, *, point: Floats | None = None) -> Floats:
        """Return J (6, nv), linear rows first, at the frame (or a point of it) in world axes."""


@runtime_checkable
class AvoidanceSource(Protocol):
    """A scene, or an `Avoidance` itself."""

    def avoidance_for(self, model: Model, /) -> Avoidance:
        """Return what the robot `model` is to avoid."""


def _notes(without_shapes: Sequence[str], pairs: Sequence[Pair]) -> Iterator[str]:
    if without_shapes:
        names = [shown(name) for name in without_shapes[:MAX_NAMES]]
        if len(without_shapes) > MAX_NAMES:
            names.append(f"{len(without_shapes) - MAX_NAMES} more")
        listed = " and ".join([", ".join(names[:-1]), names[-1]] if len(names) > 1 else names)
        have, them = ("has", "it") if len(without_shapes) == 1 else ("have", "them")
        yield f"{listed} {have} no collision shape, so that avoid keeps nothing from {them}"
    if not pairs:
        yield "avoid keeps no bodies apart: the scene has no pair of them that may collide"


def same_kinematics(one: Model, other: Model) -> bool:
    """Return whether two models have the same links and joints at the same base pose."""
    return (
        one.joints == other.joints
        and [link.name for link in one.links] == [link.name for link in other.links]
        and one.floating == other.floating
        and one.base_pose == other.base_pose
    )


def checked_distance(name: str, value: object) -> float:
    """Return a distance [m] as a float. Raises ArgumentError."""
    if not (is_real(value) and 0.0 <= value <= MAX_MARGIN):
        raise ArgumentError(f"{name} is {shown(value)}; wanted a number from 0 to {MAX_MARGIN:g} [m]")
    return float(value)


def collision_sentence(
    avoidance: Avoidance,
    blockers: Sequence[NearPair],
    pairs: Counter[tuple[int, int]],
    count: int,
    *,
    complete: bool,
) -> str:
    """Return which pairs are too close in the best of `count` solutions, and which in most of them."""
    worst = max(blockers, key=lambda each: each.pair.margin - each.separation.lower)
    kind = "solutions of the closed form" if complete else "solutions found"
    start = f"each of the {count} {kind}" if count > 1 else "the only solution found"
    sentence = f"{start} is too close to something; in the best one {pair_sentence(avoidance, worst)}"
    (a, b), most = max(pairs.items(), key=lambda each: (each[1], each[0]))
    if count > 1 and ((a, b) != (worst.pair.a, worst.pair.b) or most == count):
        names = avoidance.parts[a].name, avoidance.parts[b].name
        share = "all of them" if most == count else f"{most} of them"
        sentence += f"; {names[0]} and {names[1]} are too close in {share}"
    return sentence


FIXED = "the joints that move the frame do not change that"
OF_TARGET = "so it is in every configuration that reaches the target"
"""Why a pair is too close in every solution."""


def inevitable_sentence(avoidance: Avoidance, blockers: Sequence[NearPair], reason: str) -> str:
    """Return that a pair is too close in every solution, and the reason."""
    return f"{closest_sentence(avoidance, blockers)}; {reason}"


def closest_sentence(avoidance: Avoidance, near: Sequence[NearPair]) -> str:
    """Return how close the pair is that lacks most of its margin; empty without pairs that are too close."""
    if not near:
        return ""
    return pair_sentence(avoidance, max(near, key=lambda each: each.pair.margin - each.separation.lower))


def pair_sentence(avoidance: Avoidance, near: NearPair) -> str:
    """Return how close two bodies are, and their margin."""
    a, b = avoidance.names(near.pair)
    found, margin = near.separation.lower, near.pair.margin
    if found < 0.0:
        return f"{a} and {b} overlap by {-found:.3g} m, with a margin of {margin:.3g} m"
    return f"{a} and {b} are {found:.3g} m apart, with a margin of {margin:.3g} m"
