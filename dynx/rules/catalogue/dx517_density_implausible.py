"""DX517 density-implausible: A body is denser than any metal, or lighter than air, for the size of its shape.

The mass of rigidly connected links is divided by the volume of the bounding box of their shapes. That box is
larger than the body, so the true density is higher still. Reported are more than 25,000 kg/m^3 (osmium, the
densest metal, has 22,600) and less than 1 kg/m^3 (air has 1.2). For the upper bound each side of the box
counts as at least a hundredth of its diagonal, so that a thin plate is not reported for its drawn thickness.

Of 1,032 such bodies in example-robot-data the median is 510 kg/m^3, 98 in 100 lie between 16 and 21,400, the
least is 2.6 (a drone with an arm), and only the finger knuckles of one hand are beyond a bound: 50 g in cubes
of 2 mm.

Usual causes: a mass in grams or tonnes; a shape in millimetres without ``scale="0.001 0.001 0.001"``; a tiny
placeholder for the shape; a mass that an exporter computed from a mesh in the wrong unit.

All engines use the numbers unchanged. A heavy finger dominates every torque of the arm that carries it.

The file does not say whether the mass or the shape is wrong, so no edit removes the cause.
"""

import math
from collections.abc import Iterable

from dynx.rules import Case, Detection, Rule
from dynx.rules.geometry import body_extents

_LEAST, _GREATEST = 1.0, 25_000.0
"""Bounds of the density [kg/m^3]."""

_THINNEST = 0.01
"""Least side of a box, as a share of its diagonal."""


class DensityImplausible(Rule):
    kind = "practice"
    advice = "Give the mass in kilograms and the shape in metres."

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield the heaviest link of each body whose mass does not fit the size of its shapes."""
        for group, extent in body_extents(case):
            masses = {name: case.model.inertial(name).mass for name in group.links}
            mass, heaviest = math.fsum(masses.values()), max(masses, key=lambda name: masses[name])
            low, high = extent.box()
            sides, least = (high - low).tolist(), _THINNEST * extent.diagonal()
            thick = math.prod(max(side, least) for side in sides)
            volume = math.prod(sides)
            if not (mass > _GREATEST * thick or mass < _LEAST * volume):
                continue
            density = mass / (thick if mass > _GREATEST * thick else volume)
            size = " x ".join(f"{side:.2g}" for side in sides)
            message = f"{mass:.3g} kg in a box of {size} m is {density:.2g} kg/m^3"
            yield Detection(heaviest, None, case.model.inertial(heaviest).line, message)
