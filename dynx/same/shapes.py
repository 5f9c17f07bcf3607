"""Shapes of two bodies that are equal, wherever in their links they are."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import PurePath
from typing import Literal, get_args

import numpy as np

from dynx.errors import DescriptionError
from dynx.model.geometry.links import Collision, ShapeNumber, Visual
from dynx.model.geometry.mesh import Mesh
from dynx.model.numbers import is_real
from dynx.same.decimals import rounded
from dynx.same.skeleton import Skeleton
from dynx.same.text import vector_text
from dynx.spatial.scalar import Array, Floats
from dynx.spatial.se3 import inverse

ShapeKind = Literal["collision shapes", "visual shapes"]

SHAPE_KINDS: tuple[ShapeKind, ...] = get_args(ShapeKind)

DIGITS = 12
"""Significant digits in which the sizes of shapes are written."""

NEGLIGIBLE = 1e-12
"""Distance [m] or angle [rad] below which two frames are the same."""


ROUNDED = 1e-6
"""Relative difference of the sizes of two shapes that may be rounding of a file."""


@dataclass(frozen=True)
class ShapeOfBody:
    """A shape with its pose T (4, 4) in the frame of our body: what is equal or not, and what is as large;
    `number` is its own, None for a fault."""

    number: ShapeNumber | None
    kind: tuple[object, ...]
    sizes: Floats
    T: Floats
    words: str

    def is_as_large(self, other: ShapeOfBody, tolerance: float) -> bool:
        """Check whether two shapes are of one kind, with sizes that differ by at most `tolerance` of them."""
        if self.kind != other.kind or self.sizes.shape != other.sizes.shape:
            return False
        return not np.any(np.abs(self.sizes - other.sizes) > tolerance * np.abs(self.sizes))

    def equals(self, other: ShapeOfBody, tolerance: float, length: float) -> bool:
        """Check whether two shapes differ by at most `tolerance` of their sizes, of `length` and of 1 rad."""
        if not self.is_as_large(other, tolerance):
            return False
        apart = np.abs(self.T - other.T)[:3]
        return bool(np.max(apart[:, :3]) <= tolerance and np.max(apart[:, 3]) <= tolerance * length)


@dataclass(frozen=True)
class MatchedShapes:
    """Pairs of equal shapes of a body, those that only the first description has, and those of the second."""

    pairs: list[tuple[ShapeOfBody, ShapeOfBody]]
    first: list[ShapeOfBody]
    second: list[ShapeOfBody]

    def count_misplaced(self) -> int:
        """Count the shapes without an equal that the other description has elsewhere in the body."""
        left = list(self.second)
        for mine in self.first:
            other = next((each for each in left if mine.is_as_large(each, ROUNDED)), None)
            left = [each for each in left if each is not other]
        return len(self.second) - len(left)


def matched_shapes(
    kind: ShapeKind, ours: Skeleton, theirs: Skeleton, a: int, b: int, D: Array, tolerance: float
) -> MatchedShapes:
    """Match the shapes of body a of `ours` and of body b of `theirs`, whose frame has the pose D (4, 4)."""
    mine = _shapes(kind, ours, a, np.eye(4))
    left = _shapes(kind, theirs, b, rounded(D))
    limit = max(tolerance, NEGLIGIBLE)
    pairs, alone = [], []
    for shape in mine:
        same = next((other for other in left if shape.equals(other, limit, ours.reach)), None)
        if same is None:
            alone.append(shape)
        else:
            pairs.append((shape, same))
            left = [other for other in left if other is not same]
    return MatchedShapes(pairs, alone, left)


def frames_of_shapes(
    kind: ShapeKind, ours: Skeleton, theirs: Skeleton, a: int, b: int, link: str | None = None
) -> Iterator[Floats]:
    """Yield the poses (4, 4) that the frame of body b has in that of body a where the first shape of a link
    stands where the first one of its namesake does, if both are alike: of each link, or of one `link`."""
    firsts = [
        {each.number[0]: each for each in reversed(_shapes(kind, skeleton, body, np.eye(4))) if each.number}
        for skeleton, body in ((ours, a), (theirs, b))
    ]
    for name, mine in firsts[0].items():
        other = firsts[1].get(name)
        if link in (None, name) and other is not None and mine.is_as_large(other, ROUNDED):
            yield mine.T @ inverse(other.T)


def _shapes(kind: ShapeKind, skeleton: Skeleton, body: int, D: Floats) -> list[ShapeOfBody]:
    """Return the shapes of a body with their poses in the frame in which its own has the pose D (4, 4)."""
    shapes = []
    geometry = skeleton.model.geometry
    for number in skeleton.links[body]:
        name = skeleton.model.links[number].name
        try:
            placed: tuple[Visual | Collision, ...] = (
                geometry.collisions(name) if kind == "collision shapes" else geometry.visuals(name)
            )
        except DescriptionError as error:
            words = f"a fault ({error.message})"
            shapes.append(ShapeOfBody(None, (words,), np.zeros(0), np.eye(4), words))
            continue
        if not placed:
            continue
        T = D @ rounded(skeleton.link_pose(number))
        shapes += [
            _shape_of_body((name, k), shape, T @ shape.origin.matrix) for k, shape in enumerate(placed)
        ]
    return shapes


def _shape_of_body(own: ShapeNumber, placed: Visual | Collision, T: Floats) -> ShapeOfBody:
    """Take a shape apart; a mesh is its file's name and its scale."""
    shape = placed.shape
    if isinstance(shape, Mesh):
        scale = "" if shape.scale == (1.0, 1.0, 1.0) else f" scaled by {vector_text(shape.scale, DIGITS)}"
        name = PurePath(shape.name).name
        return ShapeOfBody(own, ("mesh", name), np.array(shape.scale), T, f"mesh {name}{scale}")
    kind: list[object] = [type(shape).__name__.lower()]
    sizes: list[float] = []
    words = []
    for name, value in vars(shape).items():
        numbers = value if isinstance(value, tuple) else (value,)
        if len(numbers) > 3 or not all(is_real(number) for number in numbers):
            kind += [name, value]
            continue
        sizes += [float(number) for number in numbers]
        words.append(f"{name} {vector_text(map(float, numbers), DIGITS)}")
    text = " ".join([str(kind[0]), ", ".join(words)]).strip()
    return ShapeOfBody(own, tuple(kind), np.array(sizes), T, text)
