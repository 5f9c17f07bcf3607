"""Cameras of a world: pictures by rays through the shapes of its scene, the same for every engine."""

from dynx.world.camera.drawing import cast_rays, draw_picture
from dynx.world.camera.picture import Picture
from dynx.world.camera.view import Camera

__all__ = ["Camera", "Picture", "cast_rays", "draw_picture"]
