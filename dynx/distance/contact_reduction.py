"""Choice of the few contact points that bear a load like all of them.

Of many points between two faces those of the largest quadrilateral remain, and the deepest. K. Erleben,
"Methodology for assessing mesh-based contact point methods", ACM Transactions on Graphics 37 (2018), compares
such choices.
"""

from __future__ import annotations

from itertools import combinations
from typing import NamedTuple

from dynx.spatial.plain import Vector3

TIE = 1e-9
"""Difference of depths, relative to the size of the shapes, that is none: at rest all corners are alike."""

AREA_TIE = 1e-6
"""Relative difference of areas that is none, so that rounding does not exchange points."""

SAME_PLACE = 1e-3
"""Distance of two points, relative to the size of the shapes, within which one is enough."""


class ContactCandidate(NamedTuple):
    """A possible contact point: coordinates across the normal, gap, points and feature."""

    u: float
    v: float
    gap: float
    point_a: Vector3
    point_b: Vector3
    feature: tuple[int, int]


def reduced(candidates: list[ContactCandidate], limit: int, size: float) -> list[ContactCandidate]:
    """Return at most `limit` candidates at different places, as `largest` chooses them."""
    return divided(candidates, limit, size)[0]


def divided(
    candidates: list[ContactCandidate], limit: int, size: float
) -> tuple[list[ContactCandidate], list[ContactCandidate]]:
    """Return at most `limit` candidates at different places, as `largest` chooses them, and those left
    over."""
    if len(candidates) < 2:
        return candidates, []
    distinct = _distinct(candidates, size)
    if len(distinct) <= limit:
        return distinct, []
    chosen = largest(distinct, limit, size)
    features = {each.feature for each in chosen}
    return chosen, [each for each in distinct if each.feature not in features]


def largest(candidates: list[ContactCandidate], limit: int, size: float) -> list[ContactCandidate]:
    """Return at most `limit` candidates, of the largest area and with the deepest one, in their order."""
    count = len(candidates)
    if count <= limit:
        return candidates
    deepest = min(each.gap for each in candidates) + TIE * size
    deep = [k for k in range(count) if candidates[k].gap <= deepest]
    if limit == 1:
        return [candidates[deep[0]]]
    if limit == 2:
        chosen = _farthest_pair(candidates, deep)
    elif limit == 3:
        chosen = _triangle(candidates, deep)
    else:
        chosen = _quadrilateral(candidates, deep)
    # Points on one line have no area, and more points than four are those far from the others.
    while len(chosen) < limit:
        chosen.append(_farthest_from(candidates, chosen))
    return [candidates[k] for k in sorted(chosen)]


def _distinct(candidates: list[ContactCandidate], size: float) -> list[ContactCandidate]:
    """Return the candidates without those beside a former one; the deeper of both remains."""
    near = (SAME_PLACE * size) ** 2
    kept: list[ContactCandidate] = []
    for each in candidates:
        for k, old in enumerate(kept):
            if (each.u - old.u) ** 2 + (each.v - old.v) ** 2 <= near:
                if each.gap < old.gap - TIE * size:
                    kept[k] = each
                break
        else:
            kept.append(each)
    return kept


def _square(a: ContactCandidate, b: ContactCandidate) -> float:
    return (a.u - b.u) ** 2 + (a.v - b.v) ** 2


def _farthest_pair(candidates: list[ContactCandidate], deep: list[int]) -> list[int]:
    best, chosen = 0.0, deep[:1]
    for i in deep:
        for k, other in enumerate(candidates):
            square = _square(candidates[i], other)
            if square > best * (1.0 + AREA_TIE):
                best, chosen = square, [i, k]
    return chosen


def _farthest_from(candidates: list[ContactCandidate], chosen: list[int]) -> int:
    best, found = -1.0, 0
    for k, each in enumerate(candidates):
        if k not in chosen:
            square = min(_square(each, candidates[i]) for i in chosen)
            if square > best * (1.0 + AREA_TIE) or best < 0.0:
                best, found = square, k
    return found


def _triangle(candidates: list[ContactCandidate], deep: list[int]) -> list[int]:
    best, chosen = 0.0, _farthest_pair(candidates, deep)
    for i in deep:
        a = candidates[i]
        for j, k in combinations(range(len(candidates)), 2):
            b, c = candidates[j], candidates[k]
            area = abs((b.u - a.u) * (c.v - a.v) - (c.u - a.u) * (b.v - a.v))
            if area > best * (1.0 + AREA_TIE):
                best, chosen = area, [i, j, k]
    return chosen


def _quadrilateral(candidates: list[ContactCandidate], deep: list[int]) -> list[int]:
    """Return the quadrilateral of the largest area that has one of the deep points as a corner.

    Each quadrilateral with that corner has a diagonal from it; the farthest points on both sides of a
    diagonal give the largest area.
    """
    best, chosen = 0.0, _farthest_pair(candidates, deep)
    places = [(each.u, each.v) for each in candidates]
    for i in deep:
        ui, vi = places[i]
        for k, (uk, vk) in enumerate(places):
            du, dv = uk - ui, vk - vi
            left = right = 0.0
            at_left = at_right = -1
            for m, (u, v) in enumerate(places):
                side = du * (v - vi) - dv * (u - ui)
                if side > left:
                    if side > left * (1.0 + AREA_TIE):
                        left, at_left = side, m
                elif side < right * (1.0 + AREA_TIE):
                    right, at_right = side, m
            if left - right > best * (1.0 + AREA_TIE):
                best = left - right
                chosen = [i, k, *(m for m in (at_left, at_right) if m >= 0)]
    return chosen
