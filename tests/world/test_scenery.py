"""Lights, shadows, tiles and smooth edges of pictures, by closed forms and by hue."""

from __future__ import annotations

import colorsys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dynx.model import Pose
from dynx.spatial.scalar import Floats
from dynx.steppers.camera import Camera
from dynx.steppers.state import BodyState, WorldState
from dynx.world import Material, Scene, box, ground, sphere
from dynx.world.camera import cast_rays, cast_rays_smoothly, draw_picture, drawn_shapes
from dynx.world.scenery import (
    DARK,
    GAMMA,
    KEY_DIRECTION,
    LIGHT,
    SUBTILE_CONTRAST,
    TILE_CONTRAST,
    Scenery,
    tiles,
)

COLOURS = st.tuples(*[st.floats(0.2, 0.9)] * 3).filter(lambda c: max(c) - min(c) > 0.15)


def resting(scene: Scene) -> WorldState:
    return WorldState(0.0, {}, {b.name: BodyState(b.pose.matrix, np.zeros(6)) for b in scene.bodies})


@settings(max_examples=8)
@given(COLOURS, st.sampled_from([LIGHT, DARK]), st.floats(0.0, 6.3))
def test_a_sphere_keeps_its_hue_and_is_nowhere_white_or_black(
    rgb: tuple[float, float, float], scenery: Scenery, azimuth: float
) -> None:
    scene = Scene(bodies=(sphere("ball", 0.5, mass=1.0, material=Material(rgba=(*rgb, 1.0))),))
    eye = 2.0 * np.array([np.cos(azimuth), np.sin(azimuth), 0.5])
    camera = Camera.look_at(eye, np.zeros(3), size=(32, 24))
    shapes = list(drawn_shapes(scene, {"ball": np.eye(4)}))
    drawn = cast_rays(shapes, camera.pose.matrix, camera, scenery)
    pixels = drawn.rgb[drawn.number == 0] / 255.0
    assert len(pixels) > 50
    hue = colorsys.rgb_to_hsv(*rgb)[0]
    for each in pixels:
        if each.max() - each.min() > 0.12:  # of greyer ones rounding changes the hue
            turn = (colorsys.rgb_to_hsv(*each)[0] - hue + 0.5) % 1.0 - 0.5
            assert abs(360.0 * turn) < 5.0
    extreme = (pixels.max(axis=1) < 0.02) | (pixels.min(axis=1) > 0.98)
    assert extreme.mean() <= 0.02


@pytest.mark.parametrize("height", [0.6, 2.0])
def test_the_shadow_of_a_box_lies_where_the_key_light_casts_it(height: float) -> None:
    cube = box("cube", (0.4, 0.4, 0.2), mass=1.0, pose=Pose((0.0, 0.0, height)))
    scene = Scene(bodies=(ground(material=Material(rgba=(0.8, 0.8, 0.8, 1.0))), cube))
    # Where the light through the middle of the box meets the ground.
    shadow = np.array([0.0, 0.0, height]) - height / KEY_DIRECTION[2] * KEY_DIRECTION

    def brightness(point: Floats) -> float:
        camera = Camera.look_at(point + np.array([0.01, 0.4, 0.3]), point, size=(9, 9), field_of_view=0.02)
        return float(draw_picture(scene, resting(scene), camera).rgb[4, 4].mean())

    lit = brightness(shadow + np.array([2.0, 0.0, 0.0]))
    dark = brightness(shadow)
    up = np.array([[0.0, 0.0, 1.0]])
    wanted = LIGHT.light(up, np.zeros(1)) / LIGHT.light(up, np.ones(1))
    # One may be on a light tile, and the other on a dark one.
    tiled = (1.0 + TILE_CONTRAST + SUBTILE_CONTRAST) / (1.0 - TILE_CONTRAST - SUBTILE_CONTRAST) - 1.0
    assert dark / lit == pytest.approx(float(wanted[0]) ** (1.0 / GAMMA), rel=tiled)
    assert dark < 0.85 * lit
    for step in ([0.45, 0.0, 0.0], [-0.45, 0.0, 0.0], [0.0, 0.6, 0.0]):
        assert brightness(shadow + step) > dark + 0.1 * lit


@given(st.floats(0.05, 20.0), st.floats(-50.0, 50.0), st.floats(-50.0, 50.0))
def test_tiles_alternate_by_their_edge_and_fade_to_one_colour(tile: float, x: float, y: float) -> None:
    here = np.array([[x, y]])
    fine = np.full(1, 1e-5 * tile)
    factor = tiles(here, tile, fine)
    assert abs(factor[0] - 1.0) <= TILE_CONTRAST + SUBTILE_CONTRAST + 1e-12
    # Two tiles further everything is the same.
    assert tiles(here + np.array([2.0 * tile, 0.0]), tile, fine) == pytest.approx(factor, abs=0.05)
    middle = (np.floor(here / tile) + 0.5) * tile
    large, other = (
        tiles(each, tile, np.full(1, 0.4 * tile))[0] for each in (middle, middle + np.array([tile, 0.0]))
    )
    assert (large - 1.0) * (other - 1.0) <= 0.0
    assert tiles(here, tile, np.full(1, tile)) == pytest.approx(1.0)


def test_edges_are_smooth_and_everything_else_is_as_before() -> None:
    red = Material(rgba=(0.9, 0.1, 0.1, 1.0))
    scene = Scene(bodies=(box("cube", (0.4, 0.4, 0.4), mass=1.0, material=red),))
    camera = Camera.look_at((1.0, -1.3, 0.9), (0.0, 0.0, 0.0), size=(60, 45))
    shapes = list(drawn_shapes(scene, {"cube": np.eye(4)}))
    hard = cast_rays(shapes, camera.pose.matrix, camera)
    soft = cast_rays_smoothly(shapes, camera.pose.matrix, camera)
    number = hard.number.reshape(45, 60)
    inner = np.ones_like(number, bool)
    for axis in (0, 1):
        for step in (-1, 1):
            inner &= np.roll(number, step, axis) == number
    change = np.abs(hard.rgb.astype(int) - soft.rgb).max(axis=1).reshape(45, 60)
    # Edges between the faces are inside the silhouette, too.
    assert (change[inner] <= 3).mean() > 0.9
    assert (change[~inner] > 10).mean() > 0.2
    assert (soft.number == hard.number).mean() > 0.95
