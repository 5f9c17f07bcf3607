"""Materials: friction, restitution and colour of what touches."""

from __future__ import annotations

from dataclasses import dataclass, fields

from dynx.errors import ArgumentError, shown
from dynx.model.configuration import MAX_MAGNITUDE, is_real
from dynx.model.geometry.sizes import colour


@dataclass(frozen=True)
class Material:
    """Coefficients of contact of a surface, and the colour of a body.

    `friction` is Coulomb's coefficient; `torsional_friction` [m] opposes spinning about the normal and
    `rolling_friction` [m] opposes rolling, each as a moment per normal force; `restitution` is the ratio of
    the normal speeds after and before an impact. The engine combines those of the two surfaces in contact.
    """

    friction: float = 0.5
    torsional_friction: float = 0.0
    rolling_friction: float = 0.0
    restitution: float = 0.0
    rgba: tuple[float, float, float, float] = (0.7, 0.7, 0.7, 1.0)

    def __post_init__(self) -> None:
        for each in fields(self)[:4]:
            value = getattr(self, each.name)
            most = 1.0 if each.name == "restitution" else MAX_MAGNITUDE
            if not is_real(value) or not 0.0 <= value <= most:
                limit = "from 0 to 1" if most == 1.0 else "of at least 0"
                raise ArgumentError(f"{each.name} is {shown(value)}; wanted a finite number {limit}")
            object.__setattr__(self, each.name, float(value))
        object.__setattr__(self, "rgba", colour("rgba of a material", self.rgba))


DEFAULT_MATERIAL = Material()


def checked_material(name: str, material: object) -> Material:
    """Return a material; raise ArgumentError for anything else."""
    if not isinstance(material, Material):
        raise ArgumentError(f"{name} is {shown(material)}; wanted a Material")
    return material
