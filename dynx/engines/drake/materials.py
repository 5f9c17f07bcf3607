"""Settings of Drake's contacts, and contacts with the mean friction of two materials.

Hydroelastic contact (Elandt et al., A pressure field model for fast, robust approximation of net contact
force and moment, 2019) integrates a pressure over the surface where two shapes overlap: shapes that are fixed
in the world are rigid, others have a modulus. Point contact is one point with a spring and a damper for each
pair of shapes, on which a box that slides or is stacked rattles. Spheres and capsules always touch at a
point, because their approximation by triangles would not roll well, and meshes, because surfaces between
hulls of thousands of triangles take minutes for a second of simulated time.

Drake has no restitution, torsional or rolling friction. Drake has the harmonic mean of the friction of two
surfaces: it adds reciprocals of the coefficients, and as many pairs as possible get theirs by `pair_terms`.
The shapes of each other pair are registered once more with the friction of the pair, and touch one another
only as these copies; every two shapes touch once.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dynx.engines.drake.library import (
    ContactModel,
    CoulombFriction,
    DiscreteContactApproximation,
    geometry,
)
from dynx.model.geometry import Box, Cylinder, HeightField, Plane, Shape
from dynx.spatial.scalar import Floats
from dynx.steppers.layout import Layout
from dynx.steppers.material import geometric_means, material_numbers
from dynx.steppers.materials import STRICT_MATERIALS, EffectiveCoefficient
from dynx.steppers.mean_coefficients import CLOSE, pair_terms
from dynx.steppers.settings import Setting

_HYDROELASTIC = ("contact_model", ("hydroelastic",))

SETTINGS: Mapping[str, Setting] = {
    "contact_approximation": Setting(
        "lagged",
        "Drake's approximation of discrete contact: 'lagged', 'similar' or 'sap'; with 'sap' a sliding body "
        "glides above the ground",
        choices=("sap", "lagged", "similar"),
    ),
    "contact_model": Setting(
        "hydroelastic",
        "'hydroelastic': pressure over the surface of contact; 'point': force at one point",
        choices=("hydroelastic", "point"),
    ),
    "modulus": Setting(3e6, "hydroelastic modulus of shapes that move [Pa]", 1e-3, needs=_HYDROELASTIC),
    "resolution": Setting(
        0.1,
        "length of the edges of the mesh that approximates a cylinder, relative to its radius",
        0.02,
        2.0,
        needs=_HYDROELASTIC,
    ),
    "stiffness": Setting(1e6, "stiffness of every shape in point contact [N/m]", 1e-3),
    "relaxation_time": Setting(
        0.01,
        "with `contact_approximation` 'sap': relaxation time [s], which sets the damping of contacts",
        needs=("contact_approximation", ("sap",)),
    ),
    "dissipation": Setting(
        10.0,
        "with `contact_approximation` 'lagged' or 'similar': damping of contacts [s/m] by the law of Hunt "
        "and Crossley",
        needs=("contact_approximation", ("lagged", "similar")),
    ),
    "stiction_tolerance": Setting(1e-4, "sliding speed below which shapes count as sticking [m/s]", 1e-9),
    "strict_materials": STRICT_MATERIALS,
}
"""Settings by name; the defaults are dynx's canonical ones."""

APPROXIMATIONS: Mapping[str, Any] = {
    "sap": DiscreteContactApproximation.kSap,
    "lagged": DiscreteContactApproximation.kLagged,
    "similar": DiscreteContactApproximation.kSimilar,
}


HYDROELASTIC = (Box, Cylinder, Plane, HeightField)
"""Shapes that touch over surfaces."""

MODELS: Mapping[str, Any] = {
    "hydroelastic": ContactModel.kHydroelasticWithFallback,
    "point": ContactModel.kPoint,
}


def proximity_properties(shape: Shape, friction: float, settings: Mapping[str, Any], fixed: bool) -> Any:
    """Return Drake's properties of a shape, which is rigid if `fixed` in the world."""
    properties = geometry.ProximityProperties()
    geometry.AddContactMaterial(
        properties=properties,
        dissipation=settings["dissipation"],
        point_stiffness=settings["stiffness"],
        friction=CoulombFriction(friction, friction),
    )
    properties.AddProperty("material", "relaxation_time", settings["relaxation_time"])
    if settings["contact_model"] == "hydroelastic" and isinstance(shape, HYDROELASTIC):
        edge = settings["resolution"] * (shape.radius if isinstance(shape, Cylinder) else 1.0)
        if fixed:
            geometry.AddRigidHydroelasticProperties(edge, properties)
        else:
            geometry.AddCompliantHydroelasticProperties(edge, settings["modulus"], properties)
    return properties


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
