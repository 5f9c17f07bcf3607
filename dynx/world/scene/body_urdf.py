"""A body of a scene as URDF text."""

from __future__ import annotations

from dynx.model import Link, Model
from dynx.model.geometry import Appearance, Geometry, LinkGeometry, Visual
from dynx.world.scene.bodies import SceneBody


def body_to_urdf(body: SceneBody) -> str:
    """Return a body of a scene as URDF text of one link, whose frame is that of the body.

    `dynx.load(text, base="floating")` of it has the same inertia and shapes, in the colour of the body. URDF
    has neither the pose, the twist nor the coefficients of contact. Raises DescriptionError for a height
    field, which URDF cannot express.
    """
    colour = Appearance(f"{body.name}_colour", body.material.rgba)
    visuals = tuple(Visual(each.shape, each.origin, colour) for each in body.shapes)
    geometry = Geometry({body.name: LinkGeometry(visuals, body.shapes)})
    link = Link(body.name, None if body.fixed else body.inertial)
    return Model.build(body.name, [link], [], geometry=geometry).to_urdf(geometry=True)
