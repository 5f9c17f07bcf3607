"""Contacts of MuJoCo with the geometric mean of the coefficients of two materials.

Every pair of geoms that may touch is an explicit pair with coefficients of its own. It takes some nanoseconds
in every step, so in scenes of very many geoms moving bodies touch one another by MuJoCo's own rule: it takes
the coefficients of the geom with the higher priority (`dynx.steppers.mean_coefficients`).

Only explicit pairs have a damping of slip apart from that of the normal direction. MuJoCo's friction pushes
bodies apart in proportion to the damping times the sliding speed, so that bodies hop where it is as large as
that of a contact that does not rebound; geoms without an explicit pair are damped critically at most.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dynx.engines.mujoco.world.options import contact_reference, contact_restitution, slip_reference
from dynx.spatial.scalar import Floats
from dynx.steppers.layout import Layout
from dynx.steppers.material import geometric_means, material_numbers
from dynx.steppers.materials import EffectiveCoefficient, coefficients
from dynx.steppers.mean_coefficients import contact_directions, contact_priorities

MAX_PAIRS = 2000
"""Largest number of explicit pairs of geoms, beside those without which a contact had other coefficients."""

TOLERANCE = 0.02
"""Error of the height of a rebound, relative to that of the fall, that counts as none."""

REASON = "in steps this long a damped spring rebounds at least so much; in shorter ones it can rebound less"


class ContactMaterials:
    """Options of the geoms of every collider, and of explicit pairs."""

    def __init__(self, layout: Layout, settings: Mapping[str, Any], dt: float) -> None:
        self._restitution = coefficients(layout, "restitution")
        self._settings, self._dt = settings, dt
        materials, numbers = material_numbers(each.material for each in layout.colliders)
        means = geometric_means(materials)
        rows, inverse = np.unique(means.reshape(-1, 4), axis=0, return_inverse=True)
        combination = inverse.reshape(means.shape[:2])
        found = contact_priorities(numbers, combination, layout.collides)
        self._explicit = _explicit_pairs(layout)
        for i, j in found.pairs:
            self._explicit[i, j] = self._explicit[j, i] = True
        self.complete = bool((self._explicit == layout.collides).all())
        """True if every pair of colliders that may touch is an explicit one."""
        self._geoms = [self._geom_options(row) for row in rows.tolist()]
        self._combination, self._priority = found.combination, found.priority
        of_pair = [self._pair_options(row) for row in rows.tolist()]
        self.pairs = [
            (i, j, of_pair[combination[numbers[i], numbers[j]]])
            for i, j in np.argwhere(np.triu(self._explicit)).tolist()
        ]
        """Numbers of two colliders, and the options of their pairs of geoms."""

    def geom(self, collider: int) -> dict[str, Any]:
        """Return the options of the geoms of a collider."""
        return {**self._geoms[self._combination[collider]], "priority": int(self._priority[collider])}

    def _geom_options(self, row: list[float]) -> dict[str, Any]:
        *friction, restitution = row
        return {
            "condim": contact_directions(*friction),
            "friction": friction,
            "solref": contact_reference(self._settings, restitution, self._dt, slips=True),
            "solimp": self._settings["impedance"],
            "margin": self._settings["margin"],
        }

    def _pair_options(self, row: list[float]) -> dict[str, Any]:
        sliding, torsional, rolling, restitution = row
        return self._geom_options(row) | {
            "friction": [sliding, sliding, torsional, rolling, rolling],
            "solref": contact_reference(self._settings, restitution, self._dt),
            "solreffriction": slip_reference(self._settings, self._dt),
        }

    def effective(self) -> Mapping[str, EffectiveCoefficient]:
        """Return the coefficients in effect."""

        def restitution(i: int, j: NDArray[np.intp]) -> Floats:
            found = np.sqrt(self._restitution[i] * self._restitution[j])
            slips = ~self._explicit[i, j]
            for wanted in np.unique(found).tolist():
                for alone in (True, False):
                    actual = contact_restitution(self._settings, wanted, self._dt, slips=alone)
                    if abs(actual**2 - wanted**2) > TOLERANCE:
                        found[(found == wanted) & (slips == alone)] = actual
            return np.asarray(found)

        return {"restitution": EffectiveCoefficient(restitution, REASON)}


def _explicit_pairs(layout: Layout) -> NDArray[np.bool_]:
    """Return which colliders (n, n) are explicit pairs: all that may touch, or those of which one is fixed,
    or none, whichever first are at most `MAX_PAIRS` pairs of geoms."""
    shapes = np.array([len(collider.shapes) for collider in layout.colliders], dtype=np.intp)
    fixed = np.array([layout.is_fixed(collider.owner) for collider in layout.colliders], dtype=bool)
    for touch in (layout.collides, layout.collides & (fixed[:, None] | fixed)):
        if (
            sum(int(shapes[row].sum()) * int(n) for row, n in zip(touch, shapes, strict=True))
            <= 2 * MAX_PAIRS
        ):
            return np.asarray(touch.copy())
    return np.zeros_like(layout.collides)
