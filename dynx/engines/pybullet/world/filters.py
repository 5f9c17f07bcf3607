"""Materials and collision filters of a scene in Bullet."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from dynx.engines.pybullet.world.client import WorldClient
from dynx.engines.pybullet.world.materials import BulletMaterials
from dynx.model.geometry import Mesh
from dynx.steppers.layout import Layout

Place = tuple[int, int]
"""Bullet's numbers of a body and of its link."""


def set_filters(
    client: WorldClient,
    layout: Layout,
    places: Sequence[Sequence[Place]],
    materials: BulletMaterials,
    settings: Mapping[str, Any],
    dt: float,
) -> None:
    """Set the materials of all colliders, and which pairs of them may touch."""
    engine = client.engine
    for number, (collider, found) in enumerate(zip(layout.colliders, places, strict=True)):
        options = materials.options(number, settings, dt)
        if any(isinstance(each.shape, Mesh) for each in collider.shapes):
            options["collisionMargin"] = settings["mesh_margin"]
        for body, link in found:
            client.call(engine.changeDynamics, body, link, **options)
    for i, first in enumerate(places):
        for j in range(i):
            for body_a, link_a in first:
                for body_b, link_b in places[j]:
                    client.call(
                        engine.setCollisionFilterPair,
                        body_a,
                        body_b,
                        link_a,
                        link_b,
                        int(layout.collides[i, j]),
                    )
