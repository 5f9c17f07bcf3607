"""Remedies at run time: settings applied to a robot that Drake has loaded."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from dynx.engines.drake.library import SpatialInertia, UnitInertia
from dynx.loaded.calls import called_joints
from dynx.model import Model
from dynx.model.mechanism import float64, pose_arrays
from dynx.model.xml.source import XmlSource
from dynx.spatial.inertia import inertia_about_origin

CALLS: Mapping[str, str] = {
    "drake.no_damping": (
        "for i in plant.GetJointIndices():  # before plant.Finalize()\n"
        "    joint = plant.get_mutable_joint(i)\n"
        "    joint.set_default_damping_vector(0 * joint.default_damping_vector())"
    ),
    "drake.free_mimics": (
        "for i in plant.GetConstraintIds(): plant.RemoveConstraint(i)  # before plant.Finalize()"
    ),
    "drake.no_rotors": (
        "for i in plant.GetJointActuatorIndices():  # before plant.Finalize()\n"
        "    plant.get_mutable_joint_actuator(i).set_default_rotor_inertia(0)"
    ),
    "drake.set_inertias": (
        "# for each link in Drake's warnings; I is about the link's origin, in its axes;\n"
        "# where the file has no mass, m = 2**-200, because Drake holds an inertia per unit of mass\n"
        "G = UnitInertia(*(I[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]] / m))\n"
        "M = SpatialInertia(m, center_of_mass, G, skip_validity_check=True)\n"
        "plant.GetBodyByName(link).SetSpatialInertiaInBodyFrame(context, M)"
    ),
}

NEGLIGIBLE_MASS = 2.0**-200
"""Mass [kg] of a link for which the file states an inertia and no mass: a power of two, so that dividing
by it is exact, and so small that its weight is below rounding."""


def set_before_finalize(plant: Any, joints: Mapping[str, Any], path: Path, calls: Collection[str]) -> None:
    """Apply those of `calls` that must precede `Finalize`; `joints` are those of the file, by name."""
    for name in called_joints(calls, "drake.no_damping", joints):
        joint = plant.get_mutable_joint(joints[name].index())
        joint.set_default_damping_vector(0.0 * joint.default_damping_vector())
    constraints = plant.GetConstraintIds()
    if "drake.free_mimics" in calls:
        freed = constraints
    else:
        # Drake numbers them in document order and does not name their joints.
        followers = _followers(path) if constraints else []
        known = dict(zip(followers, constraints, strict=False)) if len(followers) == len(constraints) else {}
        freed = [known[name] for name in called_joints(calls, "drake.free_mimics", known)]
    for constraint in freed:
        plant.RemoveConstraint(constraint)
    for index in plant.GetJointActuatorIndices():
        actuator = plant.get_mutable_joint_actuator(index)
        if any(called_joints(calls, "drake.no_rotors", [actuator.joint().name()])):
            actuator.set_default_rotor_inertia(0.0)


def _followers(path: Path) -> list[str]:
    """Name the joints with a ``<mimic>``, in document order."""
    joints = XmlSource(path.read_bytes(), str(path)).root.all("joint")
    return [joint.attributes.get("name", "") for joint in joints if joint.first("mimic") is not None]


def set_in_context(context: Any, bodies: Mapping[str, Any], model: Model, calls: Collection[str]) -> None:
    """Apply those of `calls` that act on a context; the inertias are those of `model`."""
    if "drake.set_inertias" not in calls:
        return
    for link in model.links:
        if link.inertial is None or link.name not in bodies or link.name == "world":
            continue
        R, p = pose_arrays(link.inertial.origin, float64)
        stated = inertia_about_origin(float64(link.inertial.mass), p, R, float64(link.inertial.tensor))
        mass = float(stated.mass) or NEGLIGIBLE_MASS
        G = np.asarray(stated.rotational_inertia / mass)
        unit = UnitInertia(G[0, 0], G[1, 1], G[2, 2], G[0, 1], G[0, 2], G[1, 2])
        inertia = SpatialInertia(mass, p, unit, skip_validity_check=True)
        bodies[link.name].SetSpatialInertiaInBodyFrame(context, inertia)
