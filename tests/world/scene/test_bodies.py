"""Bodies of a scene as URDF, which `dynx.load` reads back."""

from __future__ import annotations

import pytest

import dynx
from dynx import Pose
from dynx.errors import DescriptionError
from dynx.model.geometry import Box, Collision, Cylinder, HeightField, Plane
from dynx.world import Material, SceneBody, body_to_urdf

COLOUR = (0.1, 0.2, 0.3, 1.0)


def test_a_body_is_loaded_from_its_urdf() -> None:
    placed = (
        Collision(Box((1, 2, 3)), Pose((0.1, 0, 0))),
        Collision(Cylinder(0.2, 1.0), Pose((0, 1, 0), (0.3, 0, 0))),
    )
    body = SceneBody('a "<b>"', placed, mass=3.0, material=Material(rgba=COLOUR))
    model = dynx.load(body_to_urdf(body), base="floating")
    assert model.root == body.name
    assert model.links[0].inertial == body.inertial
    assert model.geometry.collisions(body.name) == body.shapes
    visual = model.geometry.visuals(body.name)[0]
    assert visual.material is not None
    assert visual.material.rgba == body.material.rgba
    fixed = dynx.load(body_to_urdf(SceneBody("floor", Plane())))
    assert fixed.links[0].inertial is None
    hills = SceneBody("hills", HeightField(((0, 0), (0, 0)), (1, 1)))
    with pytest.raises(DescriptionError, match="HeightField of link 'hills'"):
        body_to_urdf(hills)
