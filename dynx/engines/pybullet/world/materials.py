"""Coefficients that give Bullet's contacts the geometric mean of those of two materials.

Bullet multiplies the coefficients of friction and of restitution of two surfaces: given the square roots, it
has the geometric mean. Of torsional and rolling friction it adds that of each surface times the sliding
coefficient of the other, r_a f_b + r_b f_a: with r = y f the sum of y_a and y_b times f_a f_b.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dynx.spatial.scalar import Floats
from dynx.world.layout import Layout
from dynx.world.materials import EffectiveCoefficient, coefficients
from dynx.world.pair_terms import pair_terms
from dynx.world.scene.material import COEFFICIENTS, geometric_means, material_numbers

MAX_FRICTION = 10.0
"""Largest coefficient of a contact in Bullet, of each kind of friction."""

ADDED = "Bullet adds the coefficients of two surfaces, each times the other's sliding friction"
LIMITED = f"Bullet limits the friction of two surfaces to {MAX_FRICTION:g}"


@dataclass(frozen=True, eq=False)
class BulletMaterials:
    """Bullet's coefficients (n,) of every collider."""

    friction: Floats
    spinning: Floats
    rolling: Floats
    restitution: Floats

    def effective(self) -> Mapping[str, EffectiveCoefficient]:
        """Return the coefficients in effect."""

        def added(terms: Floats) -> Callable[[int, NDArray[np.intp]], Floats]:
            f = self.friction
            return lambda i, j: np.minimum(terms[i] * f[j] + terms[j] * f[i], MAX_FRICTION)

        return {
            "friction": EffectiveCoefficient(
                lambda i, j: np.minimum(self.friction[i] * self.friction[j], MAX_FRICTION), LIMITED
            ),
            "torsional_friction": EffectiveCoefficient(added(self.spinning), ADDED),
            "rolling_friction": EffectiveCoefficient(added(self.rolling), ADDED),
        }


def bullet_materials(layout: Layout) -> BulletMaterials:
    """Return Bullet's coefficients of all colliders."""
    friction = np.sqrt(coefficients(layout, "friction"))
    return BulletMaterials(
        friction,
        _terms(layout, "torsional_friction", friction),
        _terms(layout, "rolling_friction", friction),
        np.sqrt(coefficients(layout, "restitution")),
    )


def _terms(layout: Layout, name: str, f: Floats) -> Floats:
    """Return the torsional or rolling friction (n,) of each collider, beside the sliding friction `f`."""
    if not coefficients(layout, name).any():
        return np.zeros(len(f))
    materials, numbers = material_numbers(each.material for each in layout.colliders)
    wanted = geometric_means(materials[:, COEFFICIENTS.index(name)])
    products = geometric_means(materials[:, COEFFICIENTS.index("friction")])
    sums = np.divide(wanted, products, out=np.full_like(wanted, np.nan), where=products > 0.0)
    terms = pair_terms(numbers, sums, layout.collides) * f
    for k in np.flatnonzero(f == 0.0).tolist():
        partners = np.flatnonzero(layout.collides[k] & (f > 0.0))
        if len(partners):
            terms[k] = wanted[numbers[k], numbers[partners[0]]] / f[partners[0]]
    return terms
