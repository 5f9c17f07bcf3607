"""Pages that software draws have fewer pixels and triangles while something moves."""

from __future__ import annotations

import io
import math
import threading
import time
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import dynx
from dynx.steppers.camera import Camera
from dynx.viewer import Viewer
from dynx.viewer.moving_picture import COARSE_WHILE_MOVING, MOVING
from dynx.viewer.moving_picture import TRIANGLES as COARSE
from tests.viewer.conftest import PATIENCE, PICTURE, Opened, OpenPage, connected, until, wait_for_rest

SIZES = """() => {
  const canvas = document.querySelector("canvas[data-engine]"), box = canvas.getBoundingClientRect();
  return canvas.width / box.width;
}"""
"""Pixels of the picture along its width for a pixel of the page."""

TRIANGLES = "window.__viserMutable?.scene?.__r3f?.root?.getState?.().gl.info.render.triangles ?? 0"

SHARP = 0.7
"""Least share of an edge between two pixels; half of it in a picture that is drawn half as large."""

LIFT = """<robot name="lift"><link name="base"/>
<link name="cube"><visual><geometry><box size="0.5 0.5 0.5"/></geometry>
<material name="red"><color rgba="0.9 0.1 0.1 1"/></material></visual></link>
<joint name="slide" type="prismatic"><parent link="base"/><child link="cube"/><axis xyz="0 0 1"/>
<limit lower="0" upper="2" effort="1" velocity="1"/></joint></robot>"""


def sharp(picture: Any) -> float:
    """Return how much of the change of colour at the edge of the red cube lies between two pixels."""
    red = picture[..., 0].astype(np.int16) - picture[..., 1]
    steps = np.abs(np.diff(red, axis=1)).max(axis=1)
    return float(np.median(steps[red.max(axis=1) > 0.5 * red.max()]) / red.max())


def test_a_page_has_fewer_pixels_while_a_part_or_its_camera_moves(open_page: OpenPage) -> None:
    with dynx.load(LIFT).view(whole_meshes=False) as viewer:
        page = open_page(viewer.url)
        (client,) = connected(viewer)
        box = page.page.locator("canvas[data-engine]").bounding_box()
        size = (box["width"], box["height"])

        def ratio() -> float:
            return float(page.page.evaluate(SIZES))

        until(lambda: abs(ratio() - 1.0) < 0.01, "all pixels at rest")
        with Moving(viewer):
            until(lambda: abs(ratio() - MOVING) < 0.01, "fewer pixels while a part moves")
            assert sharp(viewer.screenshot((600, 400), timeout=PATIENCE)) > SHARP
        until(lambda: abs(ratio() - 1.0) < 0.01, "all pixels after the motion")
        wait_for_rest(page)
        page.page.mouse.move(200, 200)
        page.page.mouse.down()

        def turns() -> bool:
            page.page.mouse.move(200.0 + (time.monotonic() * 40.0) % 100.0, 220.0)
            return bool(abs(ratio() - MOVING) < 0.01)

        until(turns, "fewer pixels while the camera moves")
        page.page.mouse.up()
        # Programs place things in the picture by its size, which stays that of the whole one.
        assert (client.camera.image_width, client.camera.image_height) == size
        until(lambda: abs(ratio() - 1.0) < 0.01, "all pixels when the camera rests")
        assert (client.camera.image_width, client.camera.image_height) == size
        assert not page.errors


class Moving:
    """Moves the cube up and down while it is entered."""

    def __init__(self, viewer: Viewer) -> None:
        self._viewer, self._ended = viewer, threading.Event()
        self._thread = threading.Thread(target=self._drive)

    def _drive(self) -> None:
        k = 0
        while not self._ended.wait(0.03):
            k += 1
            self._viewer.update([0.1 + 0.1 * np.sin(0.2 * k)])

    def __enter__(self) -> None:
        self._thread.start()

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        self._thread.join()


def test_a_page_of_a_graphics_processor_keeps_its_pixels(open_page: OpenPage) -> None:
    with dynx.load(LIFT).view(whole_meshes=True) as viewer:
        page = open_page(viewer.url)
        connected(viewer)
        with Moving(viewer):
            for _ in range(5):
                assert page.page.evaluate(SIZES) > 0.7
                page.page.wait_for_timeout(100.0)


def ball(folder: Path, *, smooth: bool, sides: int = 80) -> Path:
    """Return a file that describes a red ball of many triangles that slides along x."""
    lines = [
        f"v {0.3 * math.sin(a) * math.cos(b)} {0.3 * math.sin(a) * math.sin(b)} {0.3 * math.cos(a)}"
        for a in np.linspace(0.0, math.pi, sides)
        for b in np.linspace(0.0, 2.0 * math.pi, sides, endpoint=False)
    ]
    lines.append("s 1" if smooth else "s off")
    for k in range(sides - 1):
        for j in range(sides):
            here, beside = k * sides + j + 1, k * sides + (j + 1) % sides + 1
            lines += [f"f {here} {here + sides} {beside + sides}", f"f {here} {beside + sides} {beside}"]
    (folder / "ball.obj").write_text("\n".join(lines))
    described = LIFT.replace('<box size="0.5 0.5 0.5"/>', '<mesh filename="ball.obj"/>')
    (folder / "ball.urdf").write_text(described.replace('xyz="0 0 1"', 'xyz="1 0 0"'))
    return folder / "ball.urdf"


def area_and_colour(page: Opened) -> tuple[float, float]:
    """Return how much of a picture is red, as a share of it, and the mean light of that, from 0 to 255."""
    pillow = pytest.importorskip("PIL.Image")
    rgb = np.asarray(pillow.open(io.BytesIO(page.page.screenshot())).convert("RGB"), dtype=np.int16)
    red = rgb[..., 0] - rgb[..., 2] > 80
    return float(red.mean()), float(rgb[red, 0].mean())


@pytest.mark.parametrize("smooth", [True, False])
def test_a_page_draws_fewer_triangles_while_a_part_moves(
    open_page: OpenPage, tmp_path: Path, smooth: bool
) -> None:
    with dynx.load(ball(tmp_path, smooth=smooth)).view(whole_meshes=False) as viewer:
        page = open_page(viewer.url)
        connected(viewer)

        def triangles() -> int:
            return int(page.page.evaluate(TRIANGLES))

        whole = sum(len(node.faces) for nodes in viewer.view.visuals.values() for node in nodes)
        assert whole > 10_000
        viewer.look_from(Camera.look_at((2.5, -2.5, 1.0), (0.0, 0.0, 0.0)))
        until(lambda: triangles() >= whole, "the whole ball at rest")
        wait_for_rest(page)
        area, colour = area_and_colour(page)
        assert area > 0.003
        with Moving(viewer):
            until(lambda: 100 < triangles() < 0.5 * whole, "a coarse ball")
            assert area_and_colour(page) == pytest.approx((area, colour), rel=0.2)
        until(lambda: triangles() >= whole, "the whole ball after the motion")
        assert not page.errors


def test_cells_grow_where_many_triangles_move(
    open_page: OpenPage, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    few = COARSE_WHILE_MOVING.replace(f"const TRIANGLES = {COARSE}", "const TRIANGLES = 500")
    assert few != COARSE_WHILE_MOVING
    drawn: list[int] = []
    for script in (COARSE_WHILE_MOVING, few):
        monkeypatch.setattr("dynx.viewer.browser.COARSE_WHILE_MOVING", script)
        with dynx.load(ball(tmp_path, smooth=True)).view(whole_meshes=False) as viewer:
            page = open_page(viewer.url)
            connected(viewer)
            viewer.look_from(Camera.look_at((1.5, -1.5, 0.6), (0.0, 0.0, 0.0)))
            counts: list[int] = []

            def between(low: float, high: float, counts: list[int] = counts, page: Opened = page) -> bool:
                counts.append(int(page.page.evaluate(TRIANGLES)))
                return low < counts[-1] < high

            until(partial(between, 10_000, math.inf), "the whole ball at rest")
            wait_for_rest(page)
            still = area_and_colour(page)
            with Moving(viewer):
                until(partial(between, 100, 10_000), "a coarse ball")
                page.page.wait_for_timeout(PICTURE)
                # A busy machine may hold up the motion, and the page then draws the whole ball between.
                fewest = 0.6 * drawn[0] if drawn else 10_000
                until(partial(between, 100, fewest), "a ball as coarse as its cells are large")
                drawn.append(counts[-1])
                assert area_and_colour(page) == pytest.approx(still, rel=0.2)
            assert not page.errors
