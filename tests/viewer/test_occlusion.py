"""Ambient occlusion in pages that a graphics processor draws is that of pictures."""

from __future__ import annotations

import io
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import dynx
from benchmarks.mesh_colours import by_page
from dynx.spatial.scalar import Floats
from dynx.steppers.camera import Camera
from dynx.viewer import Viewer
from dynx.viewer.drawn_robot import MIN_COPIES
from dynx.viewer.occlusion import OCCLUSION, PATCHED
from tests.viewer.conftest import PICTURE, OpenPage, connected, until, wait_for_rest
from tests.viewer.test_shading import brightness

SHADE = (0.85, 0.985)
"""Share of the colour of a surface that stays where it meets another one."""

ROUNDING = 1.5
"""Largest difference of a value of a colour, of 255, that is none."""

LEAST_SHADE = 1.0
"""Least difference of the brightness of the ground that shade makes, of 255."""

ALIKE = 0.02
"""Difference between the shares that stay in the page and in pictures, in 95 % of the pixels. Pictures also
take away light of the fill lamp, which is at most a tenth of all light."""


def _box(size: str, xyz: str) -> str:
    return (
        f'<visual><origin xyz="{xyz}"/><geometry><box size="{size}"/></geometry>'
        '<material name="sand"><color rgba="0.8 0.7 0.6 1"/></material></visual>'
    )


CORNER = f"""<robot name="corner"><link name="base"/><link name="walls">
{_box("1 1 0.1", "0 0 0.05")}{_box("1 0.1 0.8", "0 0.45 0.4")}{_box("0.1 1 0.8", "-0.45 0 0.4")}
</link><joint name="slide" type="prismatic"><parent link="base"/><child link="walls"/><axis xyz="0 0 1"/>
<limit lower="0" upper="2" effort="1" velocity="1"/></joint></robot>"""
"""A floor and two walls, which slide upwards."""

VIEW = Camera.look_at((1.5, -1.7, 1.3), (0.0, 0.0, 0.3), size=(480, 320))

MEETING = [(x, 0.39, 0.1) for x in (-0.2, 0.0, 0.2)] + [(-0.4, -0.3, 0.11), (-0.4, 0.0, 0.11)]
"""Places [m] beside an edge where the floor and a wall meet."""
OPEN = [(0.3, -0.3, 0.1), (0.1, -0.2, 0.1), (-0.4, -0.2, 0.6), (0.2, 0.4, 0.6)]
"""Places [m] of the floor and of walls, far from where they meet."""


def shown(
    open_page: OpenPage, viewer: Viewer, camera: Camera, *, accelerated: bool, errors: int = 0
) -> Floats:
    """Return the colours (height, width, 3), from 0 to 255, that a page shows, once they do not change."""
    page = open_page(viewer.url, accelerated=accelerated)
    connected(viewer)
    wait_for_rest(page, viewer)
    pictures = [by_page(viewer, camera)]

    def rests() -> bool:
        page.page.wait_for_timeout(0.1 * PICTURE)
        pictures.append(by_page(viewer, camera))
        # Between two of its shapes a page may rest, too.
        last = pictures[-4:]
        return len(last) == 4 and bool(last[0].any()) and all(np.array_equal(last[0], each) for each in last)

    until(rests, "a picture at rest")
    assert len(page.errors) == errors
    page.page.close()
    until(lambda: not viewer.page.server.get_clients(), "the end of the page")
    return pictures[-1].astype(np.float64)


def drawn(viewer: Viewer, camera: Camera, path: Path) -> Floats:
    """Return the colours (height, width, 3), from 0 to 255, of an exported picture."""
    viewer.export(path, camera=camera)
    return np.asarray(pytest.importorskip("PIL.Image").open(path).convert("RGB"), dtype=np.float64)


def at(values: Floats, points: Sequence[Sequence[float]]) -> Floats:
    """Return the values of a picture from `VIEW` at points of the world."""
    T = np.linalg.inv(VIEW.pose.matrix)
    x, y, z = T[:3, :3] @ np.array(points).T + T[:3, 3:]
    column = np.floor(0.5 * VIEW.size[0] + VIEW.focal_length * x / z).astype(int)
    row = np.floor(0.5 * VIEW.size[1] + VIEW.focal_length * y / z).astype(int)
    return np.asarray(values[row, column])


def inside(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return the pixels all of whose neighbours within two pixels belong to a mask as well."""
    steps = [(down, right) for down in range(-2, 3) for right in range(-2, 3)]
    return np.asarray(np.all([np.roll(mask, step, (0, 1)) for step in steps], axis=0))


@pytest.mark.parametrize("copies", [False, True])
def test_surfaces_are_darker_where_they_meet_as_in_pictures(
    open_page: OpenPage, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, copies: bool
) -> None:
    model = dynx.load(CORNER)
    given: dict[str, Any] = {"q": np.zeros((MIN_COPIES, 1)), "spacing": 0.0} if copies else {}
    with model.view(whole_meshes=True, **given) as viewer:
        pages = [shown(open_page, viewer, VIEW, accelerated=each) for each in (False, True)]
        pictures = [drawn(viewer, VIEW, tmp_path / "with.png")]
        monkeypatch.setattr("dynx.world.camera.OCCLUSION_SHARE", 0.0)
        pictures.insert(0, drawn(viewer, VIEW, tmp_path / "without.png"))
    # The sky and the ground are blue.
    sand = inside(pictures[0][..., 0] - pictures[0][..., 2] > 25.0)
    kept = [after / np.maximum(before, 1.0) for before, after in (pages, pictures)]
    for each in kept:
        assert at(each, MEETING).min() > SHADE[0]
        assert at(each, MEETING).max() < SHADE[1]
    assert np.abs(at(pages[1], OPEN) - at(pages[0], OPEN)).max() <= ROUNDING
    assert (pages[1] - pages[0])[sand].max() <= ROUNDING
    assert np.quantile(np.abs(kept[0] - kept[1])[sand], 0.95) <= ALIKE


def rested(value: Callable[[], float]) -> float:
    """Return a value once it is the same four times, one after another."""
    values = [value()]

    def rests() -> bool:
        values.append(value())
        return len(values) > 3 and len(set(values[-4:])) == 1

    until(rests, "a picture at rest")
    return values[-1]


def test_what_moves_takes_its_shade_along(open_page: OpenPage) -> None:
    near, far = np.array([0.23, -0.515, 0.0]), np.array([0.27, -0.73, 0.0])
    with dynx.load(CORNER).view(whole_meshes=True) as viewer:
        page = open_page(viewer.url, accelerated=True)
        (client,) = connected(viewer)
        bright = brightness(viewer, client, VIEW.size)
        shaded, clear = rested(lambda: bright(near)), bright(far)
        viewer.update([1.0])
        until(lambda: bright(near) > shaded + LEAST_SHADE, "the ground without the shade")
        assert bright(far) == pytest.approx(clear, abs=0.5 * LEAST_SHADE)
        viewer.update([0.0])
        until(lambda: abs(bright(near) - shaded) < 0.5 * LEAST_SHADE, "the shade again")
        assert page.errors == []


def test_an_exported_page_has_it_where_a_graphics_processor_draws(
    open_page: OpenPage, tmp_path: Path
) -> None:
    pillow = pytest.importorskip("PIL.Image")
    path = tmp_path / "corner.html"
    with dynx.load(CORNER).view(whole_meshes=False) as viewer:
        viewer.export(path)
    pictures = []
    for accelerated in (False, True):
        page = open_page(path.as_uri(), accelerated=accelerated)
        page.page.wait_for_function("__viserMutable?.nodeRefFromName['/robot/link0/link1/visual0']")
        wait_for_rest(page)
        picture = page.page.locator("canvas[data-engine]").screenshot()
        pictures.append(np.asarray(pillow.open(io.BytesIO(picture)).convert("RGB"), dtype=np.float64))
        assert page.errors == []
    darker = (pictures[0] - pictures[1]).max(axis=2) > 2.0 * ROUNDING
    assert 0.001 < darker.mean() < 0.1
    assert (pictures[1] - pictures[0]).max() <= ROUNDING


@pytest.mark.parametrize("missing", [PATCHED, ".backgroundMaterial", "renderer.shadowMap.render"])
def test_another_version_of_viser_is_reported_and_draws_without_it(
    open_page: OpenPage, monkeypatch: pytest.MonkeyPatch, missing: str
) -> None:
    model = dynx.load(CORNER)
    with model.view(whole_meshes=True) as viewer:
        expected = shown(open_page, viewer, VIEW, accelerated=False)
    assert missing in OCCLUSION
    monkeypatch.setattr("dynx.viewer.browser.OCCLUSION", OCCLUSION.replace(missing, f"{missing}Gone"))
    with model.view(whole_meshes=True) as viewer:
        found = shown(open_page, viewer, VIEW, accelerated=True, errors=1)
    assert np.abs(found - expected).max() <= ROUNDING
