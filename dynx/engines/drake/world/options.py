"""Settings of Drake's contacts.

A contact of Drake is one point with a spring and a damper: two shapes of stiffness k have k / 2 together.
Of two materials Drake takes the harmonic mean of the coefficients of friction. It has no restitution and no
torsional or rolling friction.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from dynx.engines.drake.library import CoulombFriction, DiscreteContactApproximation, geometry
from dynx.errors import UnsupportedFeatureError, shown
from dynx.world.scene import Material
from dynx.world.settings import Setting

SETTINGS: Mapping[str, Setting] = {
    "contact_approximation": Setting(
        "sap", "Drake's approximation of discrete contact", choices=("sap", "lagged", "similar")
    ),
    "stiffness": Setting(1e6, "stiffness of every shape in contact [N/m]", 1e-3),
    "relaxation_time": Setting(0.01, "dissipation of contacts under 'sap': time of relaxation [s]", 0.0),
    "dissipation": Setting(10.0, "dissipation of Hunt and Crossley under 'lagged' and 'similar' [s/m]", 0.0),
    "stiction_tolerance": Setting(1e-4, "sliding speed below which shapes count as sticking [m/s]", 1e-9),
    "simplify_materials": Setting(
        False,
        "whether restitution, torsional and rolling friction, which Drake lacks, are left out, not refused",
    ),
}
"""Settings by name; the defaults are dynx's canonical ones."""

APPROXIMATIONS: Mapping[str, Any] = {
    "sap": DiscreteContactApproximation.kSap,
    "lagged": DiscreteContactApproximation.kLagged,
    "similar": DiscreteContactApproximation.kSimilar,
}


def proximity_properties(name: str, material: Material, settings: Mapping[str, Any]) -> Any:
    """Return Drake's properties of the shapes of a collider.

    Raises UnsupportedFeatureError for coefficients that Drake does not have.
    """
    for each in ("restitution", "torsional_friction", "rolling_friction"):
        if getattr(material, each) and not settings["simplify_materials"]:
            raise UnsupportedFeatureError(
                f"the material of {shown(name)} has {each}, which 'drake' does not have; "
                "simplify_materials=True leaves it out"
            )
    properties = geometry.ProximityProperties()
    geometry.AddContactMaterial(
        properties=properties,
        dissipation=settings["dissipation"],
        point_stiffness=settings["stiffness"],
        friction=CoulombFriction(material.friction, material.friction),
    )
    properties.AddProperty("material", "relaxation_time", settings["relaxation_time"])
    return properties
