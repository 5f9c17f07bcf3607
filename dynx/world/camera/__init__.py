"""Cameras of a world: pictures by rays through the shapes of its scene, the same for every engine."""

from dynx.steppers.camera import Camera
from dynx.world.camera.drawing import cast_rays, draw_picture
from dynx.world.camera.picture import Picture

__all__ = ["Camera", "Picture", "cast_rays", "draw_picture"]
