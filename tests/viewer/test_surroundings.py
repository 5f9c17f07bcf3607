"""Sky and ground of pages, which are those of pictures."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import dynx
from benchmarks.mesh_colours import by_page
from dynx.model.elements import Pose
from dynx.steppers.camera import Camera
from dynx.viewer.surroundings import GROUND, SKY_LIGHT, SURROUNDINGS
from dynx.world import Material, Scene, SceneBody, World, box, ground
from tests.viewer.conftest import OpenPage, connected, until
from tests.viewer.test_appearance import colour_at

ALIKE, SHARE = 6.0, 0.95
"""Largest difference of mean colours, of 255, in that share of the squares of two pictures that are alike."""

SQUARE = 10
"""Edge of the squares whose colours are compared [pixels]: distant tiles fade out in the page before they do
in pictures, which are drawn with more pixels."""

VIEW = Camera.look_at((1.6, -2.1, 1.1), (0.0, 0.0, 0.2), size=(240, 160))
"""A view with sky, horizon and ground."""


def alike(viewer: Any, path: Path, camera: Camera = VIEW) -> Callable[[], bool]:
    """Return a function that checks whether the page of a viewer shows its picture."""
    image = pytest.importorskip("PIL.Image")
    viewer.export(path, camera=camera)
    picture = np.asarray(image.open(path).convert("RGB"), dtype=np.float64)

    def is_alike() -> bool:
        # The caption is in pictures alone.
        off = (by_page(viewer, camera).astype(np.float64) - picture)[: camera.size[1] - 3 * SQUARE]
        squares = off.reshape(-1, SQUARE, camera.size[0] // SQUARE, SQUARE, 3).mean(axis=(1, 3))
        return bool(np.mean(np.abs(squares).max(axis=2) <= ALIKE) >= SHARE)

    return is_alike


@pytest.mark.parametrize("dark", [False, True])
def test_the_page_of_a_robot_has_the_sky_and_the_ground_of_its_picture(
    open_page: OpenPage, tmp_path: Path, dark: bool
) -> None:
    text = """<robot name="ball"><link name="ball"><visual><origin xyz="0 0 0.3"/>
    <geometry><sphere radius="0.3"/></geometry></visual></link></robot>"""
    with dynx.load(text).view(dark=dark) as viewer:
        page = open_page(viewer.url)
        connected(viewer)
        until(alike(viewer, tmp_path / "a.png"), "the picture")
        viewer.page.scene.remove_by_name(GROUND)
        viewer.page.scene.remove_by_name(SKY_LIGHT)
        until(lambda: not by_page(viewer, VIEW)[:5].any(), "no sky")
        assert page.errors == []


SLOPE = ground(
    "slope", pose=Pose((0.0, 2.0, 0.0), (0.9, 0.0, 0.4)), material=Material(rgba=(0.7, 0.4, 0.3, 1.0))
)
CUBE = box("cube", (0.4, 0.4, 0.4), pose=Pose((0.0, 0.0, 0.4), (0.0, 0.0, 0.3)), mass=1.0)


@pytest.mark.parametrize("bodies", [(ground(), CUBE), (ground(), SLOPE, CUBE), (SLOPE, CUBE)])
def test_planes_of_a_world_reach_to_the_horizon_as_in_its_picture(
    open_page: OpenPage, tmp_path: Path, bodies: tuple[SceneBody, ...]
) -> None:
    with World(Scene("planes", bodies=bodies)) as world, world.view(steps=False) as viewer:
        page = open_page(viewer.url)
        connected(viewer)
        until(alike(viewer, tmp_path / "a.png"), "the picture")
        below = Camera.look_at((1.6, -2.1, -0.4), (0.0, 0.0, 0.2), size=VIEW.size)
        until(alike(viewer, tmp_path / "b.png", below), "the picture from below")
        viewer.set_visible(bodies[0].name, False)
        until(alike(viewer, tmp_path / "c.png"), "the picture without a plane")
        assert page.errors == []


def test_a_background_of_a_program_is_before_the_sky(open_page: OpenPage) -> None:
    with dynx.load("six_axis_arm").view() as viewer:
        page = open_page(viewer.url)
        connected(viewer)
        until(lambda: colour_at(page.page, (40.0, 20.0))[2] > 200.0, "the sky")
        viewer.page.scene.set_background_image(np.full((4, 4, 3), (250, 10, 10), np.uint8))
        red = np.array([250.0, 10.0, 10.0])
        until(lambda: np.abs(colour_at(page.page, (40.0, 20.0)) - red).max() < 10.0, "the background")
        assert page.errors == []


def test_another_version_of_viser_is_reported_and_draws_without_surroundings(
    open_page: OpenPage, monkeypatch: pytest.MonkeyPatch
) -> None:
    changed = SURROUNDINGS.replace(".backgroundMaterial", ".backgroundMaterialGone")
    monkeypatch.setattr("dynx.viewer.browser.SURROUNDINGS", changed)
    with dynx.load("six_axis_arm").view() as viewer:
        page = open_page(viewer.url)
        connected(viewer)
        until(lambda: by_page(viewer, VIEW).any(), "the robot")
        assert not by_page(viewer, VIEW)[:5].any()
        assert len(page.errors) == 1
