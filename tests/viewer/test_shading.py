"""Shadows on the ground of pages."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import dynx
from dynx.spatial.scalar import Floats
from dynx.viewer import Viewer
from dynx.world.scenery import KEY_DIRECTION
from tests.viewer.conftest import PATIENCE, OpenPage, connected, pixel_of, until

SIDE, COLOUR = 0.3, 0.5

SHADED, CLEAR = 122.0, 126.0
"""Brightness of the ground, below the first in the shadow, above the second in the light."""

LIFT = f"""<robot name="lift"><link name="base"/>
<link name="box"><visual><geometry><box size="{SIDE} {SIDE} {SIDE}"/></geometry>
<material name="grey"><color rgba="{COLOUR} {COLOUR} {COLOUR} 1"/></material></visual></link>
<joint name="slide" type="prismatic"><parent link="base"/><child link="box"/><axis xyz="0 0 1"/>
<limit lower="0" upper="2" effort="1" velocity="1"/></joint></robot>"""


def shadow_of(height: float) -> Floats:
    """Return the point (3,) [m] at which the key light casts the shadow of a point above the origin."""
    return np.asarray(np.array([0.0, 0.0, height]) - height / KEY_DIRECTION[2] * KEY_DIRECTION)


@pytest.mark.parametrize("software", [True, False])
def test_the_shadow_of_a_part_lies_where_the_key_light_casts_it(open_page: OpenPage, software: bool) -> None:
    size = (600, 400)
    with dynx.load(LIFT).view(q=np.array([1.0]), whole_meshes=not software) as viewer:
        page = open_page(viewer.url)
        (client,) = connected(viewer)
        bright = brightness(viewer, client, size)
        until(lambda: bright(shadow_of(1.0)) < SHADED, "a shadow")
        assert bright(shadow_of(1.0) - [2.0 * SIDE, 0.0, 0.0]) > CLEAR
        viewer.update([1.5])
        until(lambda: bright(shadow_of(1.5)) < SHADED, "the shadow at the next pose")
        assert bright(shadow_of(1.0)) > CLEAR
        viewer.set_visible("box", False)
        until(lambda: bright(shadow_of(1.5)) > CLEAR, "no shadow of a hidden part")
        assert page.errors == []


def brightness(viewer: Viewer, client: Any, size: tuple[int, int]) -> Callable[[Floats], float]:
    """Return a function of a point (3,) of the world that returns the brightness of the picture there, from 0
    to 255."""

    def seen(point: Floats) -> float:
        picture = viewer.screenshot(size, timeout=PATIENCE)
        camera = client.camera
        # A picture of another shape has the same height, about the same middle.
        scale = size[1] / camera.image_height
        x, y = np.rint(scale * pixel_of(client, point)).astype(int)
        x += round(0.5 * (size[0] - scale * camera.image_width))
        return float(np.median(picture[y - 3 : y + 4, x - 3 : x + 4]))

    return seen
