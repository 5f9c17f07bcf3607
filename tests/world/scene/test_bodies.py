"""Bodies of a scene as URDF, which `dynx.load` reads back."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import dynx
from dynx import Pose
from dynx.errors import ArgumentError, DescriptionError
from dynx.model.geometry import Appearance, Box, Collision, Cylinder, HeightField, Plane, Sphere, Visual
from dynx.model.geometry.drawn_shapes import link_shapes
from dynx.testing.strategies.geometry import origins
from dynx.world import Material, Scene, SceneBody, body_to_urdf
from dynx.world.camera import drawn_shapes
from dynx.world.scene.documents import scene_document, scene_from_document

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


COLOURS = st.none() | st.tuples(*[st.floats(0.0, 1.0)] * 4).map(lambda rgba: Appearance(rgba=rgba))
SEEN = st.lists(
    st.builds(Visual, st.floats(0.1, 2.0).map(Sphere) | st.just(Box((0.1, 0.2, 0.3))), origins(), COLOURS),
    min_size=1,
    max_size=3,
)


@given(SEEN, origins())
def test_a_body_is_drawn_by_its_visuals_and_collides_by_its_shapes(seen: list[Visual], pose: Pose) -> None:
    plain = SceneBody(
        "body", Box((1.0, 1.0, 1.0)), pose, mass=2.0, material=Material(rgba=(0.1, 0.2, 0.3, 1.0))
    )
    body = replace(plain, visuals=tuple(seen))
    assert body.inertial == plain.inertial
    drawn = list(drawn_shapes(Scene(bodies=(body,)), {"body": pose.matrix}))
    assert [each.shape for each in drawn] == [each.shape for each in seen]
    for each, visual in zip(drawn, seen, strict=True):
        own = visual.material.rgba if visual.material is not None else None
        assert each.rgba == (own or body.material.rgba)
        assert np.allclose(each.T, pose.matrix @ visual.origin.matrix, atol=1e-12)
    read = scene_from_document(scene_document(Scene(bodies=(body,)))).bodies[0]
    assert [shape for shape, _, _ in read.drawn_shapes()] == [each.shape for each in seen]
    model = dynx.load(body_to_urdf(body), base="floating")
    for each, (shape, rgba, _) in zip(drawn, link_shapes(model.geometry, "body"), strict=True):
        assert shape == each.shape
        assert rgba == pytest.approx(each.rgba, abs=1e-12)


def test_a_visual_of_a_wrong_type_is_refused() -> None:
    with pytest.raises(ArgumentError, match=r"visuals of body 'a' is .*wanted a sequence of Visual"):
        SceneBody("a", Box((1.0, 1.0, 1.0)), visuals=[Box((1.0, 1.0, 1.0))])  # type: ignore[list-item]
