"""Coefficients that give Drake's contacts the geometric mean of the friction of two materials.

Drake has the harmonic mean of the friction of two surfaces: it adds reciprocals of the coefficients, and as
many pairs as possible get theirs by `pair_terms`. The shapes of each other pair are registered once more
with the friction of the pair, and touch one another only as these copies; every two shapes touch once.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dynx.spatial.scalar import Floats
from dynx.steppers.layout import Layout
from dynx.steppers.material import geometric_means, material_numbers
from dynx.steppers.materials import EffectiveCoefficient
from dynx.steppers.mean_coefficients import CLOSE, pair_terms


class Copies(NamedTuple):
    """The collider (c,) and the friction (c,) of every copy, and which of them touch (c, c).

    The first copies are those of all colliders in their order.
    """

    collider: NDArray[np.intp]
    friction: Floats
    touch: NDArray[np.bool_]


def copies_of(layout: Layout) -> Copies:
    """Return the copies that give every pair of colliders its friction."""
    materials, numbers = material_numbers(each.material for each in layout.colliders)
    own, n = materials[:, 0][numbers], len(layout.colliders)
    wanted = geometric_means(materials[:, 0])
    sums = np.divide(2.0, wanted, out=np.full_like(wanted, np.nan), where=wanted > 0.0)
    terms = pair_terms(numbers, sums, layout.collides)
    found = np.divide(1.0, terms, out=own.copy(), where=terms > 0.0)
    friction = np.where(abs(found - own) <= CLOSE * own, own, found)
    collider, touch = [np.arange(n)], layout.collides.copy()
    layers = _layers(layout, numbers, wanted, friction)
    extra = sum(len(members) for members, _ in layers.values())
    grown = np.zeros((n + extra, n + extra), dtype=bool)
    frictions, at = [friction], n
    for value, (members, pairs) in layers.items():
        end = at + len(members)
        grown[at:end, at:end] = pairs
        touch[np.ix_(members, members)] &= ~pairs
        collider.append(members)
        frictions.append(np.full(len(members), value))
        at = end
    grown[:n, :n] = touch
    return Copies(np.concatenate(collider), np.concatenate(frictions), grown)


def _layers(
    layout: Layout, numbers: NDArray[np.intp], wanted: Floats, friction: Floats
) -> dict[float, tuple[NDArray[np.intp], NDArray[np.bool_]]]:
    """Return, for each friction that pairs of colliders lack, these colliders and the pairs of them."""
    rows: dict[float, list[tuple[int, NDArray[np.intp]]]] = {}
    for i in range(len(friction)):
        j = np.flatnonzero(layout.collides[i])
        w = wanted[numbers[i], numbers[j]]
        off = abs(_harmonic_mean(friction[i], friction[j]) - w) > CLOSE * w
        for value in np.unique(w[off]).tolist():
            rows.setdefault(value, []).append((i, j[off & (w == value)]))
    layers = {}
    for value, found in rows.items():
        members = np.array([i for i, _ in found], dtype=np.intp)
        pairs = np.zeros((len(members), len(members)), dtype=bool)
        for row, (_, j) in enumerate(found):
            pairs[row, np.searchsorted(members, j)] = True
        layers[value] = members, pairs
    return layers


def _harmonic_mean(a: float, b: Floats) -> Floats:
    return np.divide(2.0 * a * b, a + b, out=np.zeros_like(b), where=a + b > 0.0)


def effective_materials() -> Mapping[str, EffectiveCoefficient]:
    """Return the coefficients in effect: Drake has no others than sliding friction."""
    absent = "Drake has none"
    return {
        name: EffectiveCoefficient(lambda _, j: np.zeros(len(j)), absent)
        for name in ("restitution", "torsional_friction", "rolling_friction")
    }
