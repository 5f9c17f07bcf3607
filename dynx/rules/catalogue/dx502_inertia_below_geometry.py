"""DX502 inertia-below-geometry: The inertia is that of a body a hundred times smaller than the link's shape.

A uniform body has a radius of gyration k = sqrt(I / m) of a fifth to a half of its size (a rod l/3.5, a ball
d/3.2). Where even the largest k is below a hundredth of the diagonal of the link's own shape, the mass would
have to be concentrated in a speck. Usual causes: the tensor is in kg m^2 times 1e-6 or 1e-9 (wrong units in
the CAD program), it was written with too few digits (``1e-06`` everywhere), or it was set to zero because an
importer required the element.

All engines that load such a tensor use it. Torques come out too small, forward dynamics is badly conditioned,
and simulators with a fixed step may oscillate or diverge at such joints.

The file does not contain the true tensor, so no edit removes the cause.
"""

import math
from collections.abc import Iterable

import numpy as np

from dynx.rules import Case, Detection, Rule
from dynx.rules.geometry import link_extent

_SPECK = 0.01
"""Ratio to the shape's diagonal; all but 1 % of the mass is then within a tenth of it (Chebyshev)."""


class InertiaBelowGeometry(Rule):
    kind = "practice"
    advice = "Export the tensor again, in kg m^2 and with enough digits."

    def occurrences(self, case: Case) -> Iterable[Detection]:
        """Yield the links with mass whose largest radius of gyration is below 1 % of their own shape."""
        for link in case.model.links:
            if link.inertial is None or link.inertial.mass == 0.0:
                continue
            extent = link_extent(case.links[link.name], case.source.source)
            if extent is None or extent.empty:
                continue
            largest = max(float(np.linalg.eigvalsh(link.inertial.tensor)[-1]), 0.0)
            gyration, size = math.sqrt(largest / link.inertial.mass), extent.diagonal()
            if gyration < _SPECK * size:
                message = (
                    f"the largest radius of gyration is {gyration:.2g} m in a shape of {size:.2g} m across"
                )
                yield Detection(link.name, None, link.inertial.line, message)
