"""Coefficients that give Bullet's contacts the geometric mean of those of two materials.

Bullet multiplies the coefficients of friction and of restitution of two surfaces: given the square roots, it
has the geometric mean. Of torsional and rolling friction it adds that of each surface times the sliding
coefficient of the other, r_a f_b + r_b f_a: with r = y f the sum of y_a and y_b times f_a f_b.

Bullet gives an approach speed v over a gap d the rebound e v - d / dt, and removes in the same step a share
of a penetration. So the contacts of surfaces that rebound are processed once they touch, and their
penetration is removed slowly; then the rebound is e v.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dynx.spatial.scalar import Floats
from dynx.steppers.layout import Layout
from dynx.steppers.material import COEFFICIENTS, geometric_means, material_numbers
from dynx.steppers.materials import EffectiveCoefficient, coefficients
from dynx.steppers.mean_coefficients import pair_terms

MAX_FRICTION = 10.0
"""Largest coefficient of a contact in Bullet, of each kind of friction."""

ADDED = "Bullet adds the coefficients of two surfaces, each times the other's sliding friction"
LIMITED = f"Bullet limits the friction of two surfaces to {MAX_FRICTION:g}"


STIFFNESS = 1e20
"""Stiffness [N/m] of contacts that rebound; from it and the damping Bullet derives the share of a penetration
that it removes in a step."""

REBOUND_GAP = 0.1
"""Gap below which a contact that rebounds is processed, so that bodies at rest keep their contacts in spite
of rounding. Its unit is the distance covered in a step at the least speed that rebounds."""


@dataclass(frozen=True, eq=False)
class BulletMaterials:
    """Bullet's coefficients (n,) of every collider."""

    friction: Floats
    spinning: Floats
    rolling: Floats
    restitution: Floats
    rebounds: NDArray[np.bool_]
    """True for colliders (n,) that rebound from any that they may touch."""

    def options(self, number: int, settings: Mapping[str, Any], dt: float) -> dict[str, float]:
        """Return the options of `changeDynamics` for a collider."""
        found = {
            "lateralFriction": float(self.friction[number]),
            "spinningFriction": float(self.spinning[number]),
            "rollingFriction": float(self.rolling[number]),
            "restitution": float(self.restitution[number]),
        }
        if self.rebounds[number]:
            found["contactProcessingThreshold"] = REBOUND_GAP * settings["restitution_speed"] * dt
            found["contactStiffness"] = STIFFNESS
            # Of two surfaces Bullet adds the damping and halves the stiffness.
            found["contactDamping"] = 0.25 * STIFFNESS * settings["rebound_time_constant"]
        return found

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
        rebounding(layout),
    )


def rebounding(layout: Layout) -> NDArray[np.bool_]:
    """Return for every collider (n,) whether it rebounds from any that it may touch."""
    bouncy = coefficients(layout, "restitution") > 0.0
    return np.asarray(bouncy & layout.collides[:, bouncy].any(axis=1))


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
