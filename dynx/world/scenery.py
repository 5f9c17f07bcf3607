"""`Scenery`: lights, sky and ground, which are the same in pages, pictures, films and cameras of worlds.

One key light from above shines on every scene, beside the light of the sky and of the ground. Light is
neutral, so that a surface keeps its hue. Its amounts are linear; colours are those of files and screens,
whose values grow with the power 1 / `GAMMA` of the light.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from dynx.model.geometry import Plane
from dynx.spatial.scalar import Floats
from dynx.steppers.material import DEFAULT_MATERIAL

GAMMA = 2.2
"""Exponent between the values of a colour and its light."""

KEY_DIRECTION: Floats = np.array([0.2, -0.7, 1.0]) / math.sqrt(1.53)
"""Unit vector (3,) towards the key light, in world axes."""

FILL_DIRECTION: Floats = np.array([0.8, 0.4, 0.3]) / math.sqrt(0.89)
"""Unit vector (3,) towards a weak light without shadows, which shapes what the key light does not reach."""

TILE = 1.0
"""Edge of the tiles of a plane [m], where the size of the scene does not choose another."""

SUBTILES = 5
"""Number of small tiles along a tile."""

TILE_CONTRAST, SUBTILE_CONTRAST = 0.11, 0.022
"""Shares by which tiles are lighter or darker than the colour of their plane."""

ZENITH = 0.45
"""Sine of the elevation from which on the sky has the colour of the zenith."""

HAZE_BELOW, HAZE_SHARE = 0.6, 0.6
"""Sine of the angle below the horizon from which on haze has its darkest colour, and the share of the ground
in that colour."""

HAZE = 0.12
"""Sine of the angle between a ray and a plane below which the plane vanishes in the colour of the horizon."""

_GRAZING = 0.3
"""Share of the light around that a surface mirrors where a ray grazes it."""

ROUGHNESS = 0.5
"""Roughness of the surfaces of pages, as glTF has it, whose highlight is that of pictures."""

_SHARPNESS = 2.0 / ROUGHNESS**4 - 2.0
"""Exponent by which the highlight fades, for the roughness (Walter et al. 2007)."""

_SHINE = 0.01 / ROUGHNESS**4
"""Share of the key light in the middle of its highlight, of a surface that mirrors 0.04 of what meets it."""

OCCLUSION_REACH = 0.12
"""Distance within which surfaces hide the sky from each other, in radii of the ball around the shapes."""

OCCLUSION_STEPS = 14
"""Number of places around a pixel at which surfaces are looked for that hide the sky."""

OCCLUSION_TURNS = 4
"""Number of pixels along each side of the squares in which every pixel looks at other places."""

OCCLUSION_SLOPE = 0.12
"""Sine of the angle above a surface below which another one hides nothing of the sky."""

OCCLUSION_SHARE = 2.2
"""Share of the sky's light that a surface takes away for each unit of the sine above that, in the mean of the
places."""

LEAST_OPENNESS = 0.3
"""Least share of the sky's light that is left where surfaces hide it."""

Colour = tuple[float, float, float]
Rgba = tuple[float, float, float, float]


class Scenery(NamedTuple):
    """Colours from 0 to 1 and amounts of light; a white surface that gets the light 1 is white."""

    zenith: Colour
    horizon: Colour
    ground: Colour
    """Colour of a ground that is added to a scene without one, and of a plane in the default grey."""
    key: float
    """Light of the key light on a surface that faces it."""
    fill: float
    sky_light: float
    """Light on a surface that faces upwards, also in the shadow."""
    ground_light: float
    """Light on a surface that faces downwards."""
    polish: float = 1.0
    """Share of the light that surfaces mirror, and by which surfaces hide the sky from each other; 0 for
    matte ones that hide nothing."""

    def own_colour(self, shape: object, rgba: Rgba) -> Rgba:
        """Return the colour of a shape whose description says `rgba`: a plane in the default grey of bodies
        has that of the ground, so that it is dark where all is dark."""
        is_ground = isinstance(shape, Plane) and rgba == DEFAULT_MATERIAL.rgba
        return (*self.ground, 1.0) if is_ground else rgba

    def light(self, normal: Floats, lit: Floats, openness: Floats | float = 1.0) -> Floats:
        """Return the light (n,) on surfaces with unit normals (n, 3), whose share `lit` (n,) from 0 to 1 is
        not in the shadow of the key light, and from which `openness` of the sky and the ground is seen."""
        upward = 0.5 + 0.5 * normal[:, 2]
        ambient = self.ground_light + (self.sky_light - self.ground_light) * upward
        key, fill = (np.maximum(normal @ towards, 0.0) for towards in (KEY_DIRECTION, FILL_DIRECTION))
        near = (ambient + self.fill * fill) * (1.0 - self.polish * (1.0 - openness))
        return np.asarray(near + self.key * key * lit, dtype=np.float64)

    def gloss(self, normal: Floats, rays: Floats, lit: Floats, openness: Floats | float = 1.0) -> Floats:
        """Return the light (n,) that surfaces mirror to the eye, of the key light and of the sky, by their
        unit normals and the unit rays (n, 3) that meet them; the others are those of `light`.

        It is the same for all colours, strongest where a ray grazes a surface (Schlick 1994), and a wide
        highlight where the key light is mirrored (Blinn 1977).
        """
        facing = -np.einsum("ij,ij->i", normal, rays)
        mirrored = rays + 2.0 * facing[:, None] * normal
        grazing = _GRAZING * (1.0 - np.clip(facing, 0.0, 1.0)) ** 5
        around = self.ground_light + (self.sky_light - self.ground_light) * np.clip(
            0.5 + mirrored[:, 2], 0.0, 1.0
        )
        half = KEY_DIRECTION - rays
        half /= np.maximum(np.linalg.norm(half, axis=1), 1e-9)[:, None]
        shine = np.maximum(np.einsum("ij,ij->i", normal, half), 0.0) ** _SHARPNESS
        shine *= np.maximum(normal @ KEY_DIRECTION, 0.0)
        light = grazing * around * openness + _SHINE * self.key * shine * lit
        return np.asarray(self.polish * light, dtype=np.float64)

    def sky(self, rays: Floats) -> Floats:
        """Return the colours (n, 3) in the directions of unit vectors (n, 3): of the sky above the horizon,
        of haze below it."""
        height = rays[:, 2:]
        horizon, zenith, ground = (np.array(each) for each in (self.horizon, self.zenith, self.ground))
        above = horizon + (zenith - horizon) * np.clip(height / ZENITH, 0.0, 1.0)
        below = horizon + HAZE_SHARE * (ground - horizon) * np.clip(-height / HAZE_BELOW, 0.0, 1.0)
        return np.asarray(np.where(height >= 0.0, above, below), dtype=np.float64)

    def haze(self, colours: Floats, slope: Floats) -> Floats:
        """Return the colours (n, 3) of planes that rays meet at angles with the sines `slope` (n,): far away
        they become that of the horizon."""
        share = np.clip(slope / HAZE, 0.0, 1.0)[:, None]
        return np.asarray(np.array(self.horizon) + share * (colours - np.array(self.horizon)))


LIGHT = Scenery((0.33, 0.56, 0.86), (0.80, 0.88, 0.95), (0.54, 0.61, 0.70), 0.62, 0.10, 0.37, 0.21)
MATTE = LIGHT._replace(polish=0.0)
"""Light of what a camera measures: surfaces have the hue of their own colour."""
DARK = Scenery((0.06, 0.08, 0.11), (0.17, 0.19, 0.22), (0.26, 0.28, 0.31), 0.60, 0.10, 0.34, 0.15)


def tiles(points: Floats, tile: float, pixel: Floats) -> Floats:
    """Return the factor (n,) of the colour of a plane at points (n, 2) [m] in its own axes.

    Light and dark tiles of two sizes alternate. Tiles fade out where they are not much larger than a `pixel`
    (n,), whose extent on the plane is given [m].
    """
    factor = np.ones(len(points))
    for edge, contrast in ((tile, TILE_CONTRAST), (tile / SUBTILES, SUBTILE_CONTRAST)):
        place = points / edge
        within = place % 1.0
        # From -1 to 1, and between them at the edges of tiles, over the width of a pixel.
        waves = np.clip(2.0 * np.minimum(within, 1.0 - within) * (edge / pixel)[:, None], 0.0, 1.0)
        waves *= np.where(place % 2.0 < 1.0, 1.0, -1.0)
        seen = np.clip((edge / pixel - 2.0) / 6.0, 0.0, 1.0)
        factor += contrast * seen * waves[:, 0] * waves[:, 1]
    return factor
