"""Materials: friction, restitution and colour of what touches."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dynx.argument_types import checks_types
from dynx.errors import ArgumentError, shown
from dynx.model.numbers import MAX_MAGNITUDE, colour, is_real
from dynx.spatial.scalar import Floats

COEFFICIENTS = ("friction", "torsional_friction", "rolling_friction", "restitution")
"""Names of the coefficients of a material, all of at least 0."""


@checks_types
@dataclass(frozen=True)
class Material:
    """Coefficients of contact of a surface, and the colour of a body.

    `friction` is Coulomb's coefficient. `torsional_friction` [m] opposes spinning about the normal and
    `rolling_friction` [m] opposes rolling, each as a moment per normal force. `restitution` is the ratio of
    the normal speeds after and before an impact. Two surfaces in contact have the geometric mean of their
    coefficients (`contact_material`), on every engine.
    """

    friction: float = 0.5
    torsional_friction: float = 0.0
    rolling_friction: float = 0.0
    restitution: float = 0.0
    rgba: tuple[float, float, float, float] = (0.7, 0.7, 0.7, 1.0)

    def __post_init__(self) -> None:
        for name in COEFFICIENTS:
            value = getattr(self, name)
            most = 1.0 if name == "restitution" else MAX_MAGNITUDE
            if not is_real(value) or not 0.0 <= value <= most:
                limit = "from 0 to 1" if most == 1.0 else "of at least 0"
                raise ArgumentError(f"{name} is {shown(value)}; wanted a finite number {limit}")
            object.__setattr__(self, name, float(value))
        object.__setattr__(self, "rgba", colour("rgba of a material", self.rgba))


DEFAULT_MATERIAL = Material()


def checked_material(name: str, material: object) -> Material:
    """Return a material; raise ArgumentError for anything else."""
    if not isinstance(material, Material):
        raise ArgumentError(f"{name} is {shown(material)}; wanted a Material")
    return material


@checks_types
def contact_material(a: Material, b: Material) -> Material:
    """Return the coefficients of the contact of two surfaces: the geometric means of their coefficients."""
    means = [math.sqrt(getattr(a, name) * getattr(b, name)) for name in COEFFICIENTS]
    return Material(means[0], means[1], means[2], means[3])


def material_numbers(materials: Iterable[Material]) -> tuple[Floats, NDArray[np.intp]]:
    """Return the coefficients (m, 4) of the different materials, and the number (n,) of each in them."""
    rows = [[getattr(each, name) for name in COEFFICIENTS] for each in materials]
    found, numbers = np.unique(np.array(rows).reshape(-1, 4), axis=0, return_inverse=True)
    return found, numbers.reshape(-1)


def geometric_means(values: Floats) -> Floats:
    """Return the coefficients (m, m, ...) of the contacts of each two materials, from theirs (m, ...)."""
    return np.asarray(np.sqrt(values[:, None] * values[None]))
