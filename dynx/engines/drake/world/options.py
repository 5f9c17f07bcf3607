"""Settings of Drake's contacts.

Hydroelastic contact (Elandt et al., A pressure field model for fast, robust approximation of net contact
force and moment, 2019) integrates a pressure over the surface where two shapes overlap: shapes that are fixed
in the world are rigid, others have a modulus. Point contact is one point with a spring and a damper for each
pair of shapes, on which a box that slides or is stacked rattles. Spheres and capsules always touch at a
point, because their approximation by triangles would not roll well, and meshes, because surfaces between
hulls of thousands of triangles take minutes for a second of simulated time.

Drake has the harmonic mean of the friction of two materials (see `materials`), and no restitution, torsional
or rolling friction.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from dynx.engines.drake.library import (
    ContactModel,
    CoulombFriction,
    DiscreteContactApproximation,
    geometry,
)
from dynx.model.geometry import Box, Cylinder, HeightField, Plane, Shape
from dynx.steppers.materials import STRICT_MATERIALS
from dynx.steppers.settings import Setting

SETTINGS: Mapping[str, Setting] = {
    "contact_approximation": Setting(
        "lagged",
        "Drake's approximation of discrete contact; under 'sap' a sliding body glides above the ground",
        choices=("sap", "lagged", "similar"),
    ),
    "contact_model": Setting(
        "hydroelastic",
        "pressure over the surface of contact, or one point",
        choices=("hydroelastic", "point"),
    ),
    "modulus": Setting(3e6, "hydroelastic modulus of shapes that move [Pa]", 1e-3),
    "resolution": Setting(
        0.1, "length of the edges by which cylinders are approximated, relative to the radius", 0.02, 2.0
    ),
    "stiffness": Setting(1e6, "stiffness of every shape in contact at a point [N/m]", 1e-3),
    "relaxation_time": Setting(0.01, "dissipation of contacts under 'sap': time of relaxation [s]", 0.0),
    "dissipation": Setting(10.0, "dissipation of Hunt and Crossley under 'lagged' and 'similar' [s/m]", 0.0),
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
