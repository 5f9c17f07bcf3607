"""Coefficients of the contacts of a scene, and which of them an engine does not have.

Two surfaces in contact have the geometric mean of their coefficients: of friction, sliding, torsional and
rolling, and of restitution. An engine that combines coefficients by another rule is given such ones that its
rule has this result; where it cannot, it says so by `Stepper.effective_materials`.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from dynx.errors import UnsupportedFeatureError, shown
from dynx.spatial.scalar import Floats
from dynx.steppers.layout import Layout
from dynx.steppers.settings import Setting

STRICT_MATERIALS = Setting(
    False, "True: dynx refuses a scene with contact coefficients that the engine cannot represent"
)
"""The setting `strict_materials`, which every engine has."""

TOLERANCE = 1e-6
"""Relative error of a coefficient that counts as none."""


@dataclass(frozen=True)
class InexactMaterial:
    """A coefficient of contact that the engine does not have as the scene states it."""

    quantity: str
    """Name of the coefficient in `Material`."""
    wanted: float
    """Geometric mean of the coefficients of both surfaces."""
    effective: float
    """Coefficient in effect."""
    reason: str
    pairs: tuple[tuple[str, str], ...]
    """Bodies, or links as ``robot/link``, between which it is in effect."""

    def __str__(self) -> str:
        (a, b), more = self.pairs[0], len(self.pairs) - 1
        others = f", and of {more} more pair{'s' * (more > 1)}," if more else ""
        return (
            f"{self.quantity} of {shown(a)} and {shown(b)}{others} is {self.effective:.4g}, "
            f"not {self.wanted:.4g}: {self.reason}"
        )


@dataclass(frozen=True, eq=False)
class EffectiveCoefficient:
    """A coefficient of contact as an engine has it."""

    of: Callable[[int, NDArray[np.intp]], Floats]
    """Function that returns the coefficients in effect between a collider and others, by number."""
    reason: str
    """Why it differs from the wanted one, where it does."""


class MaterialsInEffect(Protocol):
    """A scene in an engine or in a document for one, with its coefficients of contact."""

    layout: Layout

    def effective_materials(self) -> Mapping[str, EffectiveCoefficient]:
        """Return coefficients in effect, by name."""


class EngineWithMaterials(MaterialsInEffect, Protocol):
    """The part of `Stepper` that this module needs."""

    def close(self) -> None:
        """Release what the engine holds."""


Engine = TypeVar("Engine", bound=EngineWithMaterials)


def coefficients(layout: Layout, name: str) -> Floats:
    """Return a coefficient (n,) of the material of each collider."""
    return np.array([getattr(each.material, name) for each in layout.colliders], dtype=np.float64)


def inexact_materials(engine: MaterialsInEffect) -> tuple[InexactMaterial, ...]:
    """Return the coefficients that the engine does not have as the scene states them, for the pairs of
    colliders that may touch."""
    layout, found = engine.layout, []
    for name, effective in engine.effective_materials().items():
        values = coefficients(layout, name)
        groups: dict[tuple[float, float], list[tuple[str, str]]] = defaultdict(list)
        for i, each in enumerate(layout.colliders):
            partners = np.flatnonzero(layout.collides[i, i + 1 :]) + i + 1
            wanted, actual = np.sqrt(values[i] * values[partners]), effective.of(i, partners)
            for k in np.flatnonzero(abs(actual - wanted) > TOLERANCE * wanted).tolist():
                pair = each.name, layout.colliders[partners[k]].name
                groups[float(wanted[k]), float(actual[k])].append(pair)
        found += [InexactMaterial(name, *key, effective.reason, tuple(each)) for key, each in groups.items()]
    return tuple(found)


def open_engine(
    kind: Callable[[Layout, float, Mapping[str, Any]], Engine],
    layout: Layout,
    h: float,
    settings: Mapping[str, Any],
) -> Engine:
    """Return the engine with the scene in it, in steps of `h` [s].

    Raises UnsupportedFeatureError for inexact coefficients of contact where `strict_materials` is set.
    """
    engine = kind(layout, h, settings)
    if not settings.get("strict_materials"):
        return engine
    try:
        inexact = inexact_materials(engine)
    except BaseException:
        engine.close()
        raise
    if inexact:
        engine.close()
        raise UnsupportedFeatureError(f"{inexact[0]}; strict_materials=False takes what the engine has")
    return engine
