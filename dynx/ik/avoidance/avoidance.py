"""`Avoidance`: the bodies that are to stay apart, and how near they are at a configuration."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from threading import Lock
from typing import Any, NamedTuple, Protocol, runtime_checkable

import numpy as np

from dynx.errors import ArgumentError, shown
from dynx.ik.avoidance.parts import Pair, Part, Separation, adapted_pairs, place, separation_of
from dynx.ik.coordinates import FrameCoordinates
from dynx.ik.tasks import Kinematics
from dynx.model import Model
from dynx.model.numbers import is_real
from dynx.spatial.scalar import Floats

MAX_MARGIN = 10.0
"""Largest margin [m]."""


MAX_NAMES = 3
"""Largest number of links that a note names."""


class NearPair(NamedTuple):
    """A pair of bodies that are near one another, and their distance."""

    pair: Pair
    separation: Separation

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
        parts: Sequence[Part],
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

    def near(self, kinematics: Kinematics, q: Floats, beyond: float = 0.0) -> list[NearPair]:
        """Return the pairs at q (nq,) whose distance may be below the margin plus `beyond` [m]."""
        poses: dict[Any, Floats] = {
            frame: kinematics.forward_kinematics(q, frame) for frame in self._frames if frame is not None
        }
        # The prepared shapes hold the pose at which they are.
        with self._lock:
            placed = [
                self._obstacles[k] if part.frame is None else place(self._solids[k], poses[part.frame])
                for k, part in enumerate(self.parts)
            ]
            found = []
            for pair in self.pairs:
                separation = separation_of(placed[pair.a], placed[pair.b], pair.margin + beyond)
                if separation is not None:
                    found.append(NearPair(pair, separation))
        return found

    def fixed_pairs(self, coordinates: FrameCoordinates) -> frozenset[Pair]:
        """Return the pairs whose distance these coordinates do not change."""
        moving = [coordinates.moving(part.frame) for part in self.parts]
        return frozenset(pair for pair in self.pairs if moving[pair.a] == moving[pair.b])

    def pairs_of_target(self, coordinates: FrameCoordinates, frame: str) -> frozenset[Pair]:
        """Return the pairs whose distance follows from the pose of a frame alone: of a body that is fixed to
        the frame, and of one that these coordinates do not move."""
        moving = [coordinates.moving(part.frame) for part in self.parts]
        wanted = {coordinates.moving(frame), frozenset[int]()}
        return frozenset(pair for pair in self.pairs if {moving[pair.a], moving[pair.b]} == wanted)

    def violated(self, kinematics: Kinematics, q: Floats) -> list[NearPair]:
        """Return the pairs that are not proved to keep their margin at q (nq,)."""
        return [each for each in self.near(kinematics, q) if not each.is_clear]

    def is_clear(self, kinematics: Kinematics, q: Floats) -> bool:
        """Return whether all pairs are proved to keep their margins at q (nq,)."""
        return not self.violated(kinematics, q)

    def gradients(self, kinematics: Kinematics, q: Floats, near: Sequence[NearPair]) -> Floats:
        """Return the derivatives (n, nv) of the distances of pairs at q."""
        rows = np.zeros((len(near), kinematics.model.nv))
        for row, (pair, found) in zip(rows, near, strict=True):
            for number, point, sign in ((pair.a, found.point_a, 1.0), (pair.b, found.point_b, -1.0)):
                frame = self.parts[number].frame
                if frame is not None:
                    T = kinematics.forward_kinematics(q, frame)
                    local = T[:3, :3].T @ (point - T[:3, 3])
                    row += sign * (found.normal @ kinematics.jacobian(q, frame, point=local)[:3])
        return rows

    def __getstate__(self) -> dict[str, Any]:
        state = self.__dict__.copy()
        del state["_lock"]
        return state

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state, _lock=Lock())

    def __repr__(self) -> str:
        return f"<Avoidance of {self.model.name}: {len(self.parts)} bodies, {len(self.pairs)} pairs>"


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
