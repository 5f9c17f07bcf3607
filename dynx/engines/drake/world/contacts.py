"""Contacts of Drake in the convention of dynx: the normal goes from b to a, the force is that on a."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from dynx.spatial.scalar import Floats
from dynx.steppers.stepper import TouchingPoint


def read_contacts(results: Any, query: Any, collider_of: Mapping[int, int]) -> list[TouchingPoint]:
    """Return the contacts of a step: one for each point, and one at the centre of pressure of each surface.

    A surface has the depth of the pair of shapes as its distance. `query` is that at the beginning of the
    step.
    """
    infos = [results.point_pair_contact_info(k) for k in range(results.num_point_pair_contacts())]
    # Drake's force is that on the second body.
    found = [
        touching_point(info.point_pair(), -np.array(info.contact_force()), collider_of) for info in infos
    ]
    count = results.num_hydroelastic_contacts()
    if count:
        pairs = query.ComputePointPairPenetration()
        depths = {(pair.id_A.get_value(), pair.id_B.get_value()): float(pair.depth) for pair in pairs}
        found += [
            _on_surface(results.hydroelastic_contact_info(k), depths, collider_of) for k in range(count)
        ]
    return found


def touching_point(pair: Any, force: Floats, collider_of: Mapping[int, int]) -> TouchingPoint:
    """Return the contact of a pair of penetrating points, with the force on the first body."""
    normal = np.array(pair.nhat_BA_W)
    return TouchingPoint(
        collider_of[pair.id_A.get_value()],
        collider_of[pair.id_B.get_value()],
        np.array(pair.p_WCa),
        np.array(pair.p_WCb),
        normal,
        -float(pair.depth),
        *parts_of_force(force, normal),
    )


def _on_surface(
    info: Any, depths: Mapping[tuple[int, int], float], collider_of: Mapping[int, int]
) -> TouchingPoint:
    surface = info.contact_surface()
    a, b = surface.id_M().get_value(), surface.id_N().get_value()
    faces = range(surface.num_faces())
    # The normals of the surface go from the second shape into the first.
    normal = np.sum([surface.area(k) * surface.face_normal(k) for k in faces], axis=0)
    normal = normal / np.linalg.norm(normal)
    depth = depths.get((a, b), depths.get((b, a), 0.0))
    wrench = info.F_Ac_W()
    force = np.array(wrench.translational())
    center = _center_of_pressure(surface, normal, force, np.array(wrench.rotational()))
    half = 0.5 * depth * normal
    return TouchingPoint(
        collider_of[a],
        collider_of[b],
        center - half,
        center + half,
        normal,
        -depth,
        *parts_of_force(force, normal),
    )


def _center_of_pressure(surface: Any, normal: Floats, force: Floats, moment: Floats) -> Floats:
    """Return the point of the surface about which the contact force has no moment but one along the normal.

    `moment` is the moment about the centroid, which is returned where the point would be outside of the
    surface.
    """
    centroid = np.array(surface.centroid())
    along = float(force @ normal)
    if along <= 0.0:
        return centroid
    shift = np.cross(normal, moment) / along
    mesh = surface.tri_mesh_W() if surface.is_triangle() else surface.poly_mesh_W()
    corners = np.array([mesh.vertex(k) for k in range(mesh.num_vertices())])
    reach = float(np.max(np.linalg.norm(corners - centroid, axis=1)))
    return centroid + shift if float(np.linalg.norm(shift)) <= reach else centroid


def parts_of_force(force: Floats, normal: Floats) -> tuple[float, Floats]:
    """Return the force along the normal, at least 0, and the rest.

    Friction on the parts of a bent surface is not orthogonal to the mean normal, and may pull along it.
    """
    along = max(0.0, float(force @ normal))
    return along, force - along * normal
