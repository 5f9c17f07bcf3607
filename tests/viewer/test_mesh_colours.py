"""Colours of meshes in the camera of a world, exported pictures and the page are those that another reader of
the same files finds, and light keeps their hue."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from benchmarks.mesh_colours import (
    BALLS,
    MATTE,
    SHARE,
    SUBJECTS,
    by_camera,
    by_export,
    by_page,
    lit_ball,
    pixels_off_edges,
    share_close,
    unlit_page,
    without_edges,
)
from dynx.model import Link, Model
from dynx.model.geometry import Appearance, Geometry, LinkGeometry, Sphere, Visual
from dynx.steppers.camera import Camera, DrawnShape
from dynx.viewer import Viewer
from dynx.world.camera import cast_rays
from dynx.world.scenery import DARK, LIGHT
from tests.conftest import needs_examples
from tests.viewer.conftest import OpenPage, connected, until

SAMPLES = 120
"""Number of random pixels that are compared."""

NEEDS = {"panda": ("collada",), "gltf": (), "plane": ("pybullet_data",)}
"""Packages that a subject needs beside trimesh; others need those of the last."""


def subject_of(name: str) -> Any:
    for package in ("trimesh", *NEEDS.get(name, NEEDS["plane"])):
        pytest.importorskip(package)
    return SUBJECTS[name]()


@pytest.mark.long_cases
@needs_examples
@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("name", SUBJECTS)
def test_pictures_without_light_have_the_colours_of_the_files(name: str) -> None:
    subject = subject_of(name)
    pixels, expected = without_edges(subject, pixels_off_edges(subject, SAMPLES))
    assert len(pixels) > SAMPLES / 2
    assert share_close(by_camera(subject).rgb, pixels, expected) >= SHARE
    assert share_close(by_export(subject), pixels, expected) >= SHARE


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize(
    ("name", "accelerated"), [("duck", False), ("r2d2", False), ("gltf", False), ("r2d2", True)]
)
def test_the_page_without_light_has_the_colours_of_the_files(
    open_page: OpenPage, name: str, accelerated: bool
) -> None:
    subject = subject_of(name)
    pixels, expected = without_edges(subject, pixels_off_edges(subject, SAMPLES))
    with subject.model.view(whole_meshes=accelerated) as viewer:
        unlit_page(viewer)
        page = open_page(viewer.url, accelerated=accelerated)
        page.page.evaluate(MATTE)
        connected(viewer)
        shown = lambda: share_close(by_page(viewer, subject.camera), pixels, expected) >= SHARE  # noqa: E731
        until(shown, "the colours of the files")
        assert not page.errors


@pytest.mark.parametrize("scenery", [LIGHT, DARK])
@pytest.mark.parametrize("rgb", BALLS)
def test_a_matte_ball_keeps_its_hue_in_light(rgb: tuple[float, float, float], scenery: Any) -> None:
    hue, clipped = lit_ball(rgb, scenery)
    assert hue <= 5.0
    assert clipped <= 0.02


@pytest.mark.parametrize("dark", [False, True])
def test_the_page_is_lit_as_pictures_are(open_page: OpenPage, dark: bool) -> None:
    rgba = (0.2, 0.5, 0.8, 1.0)
    ball = Visual(Sphere(0.5), material=Appearance("blue", rgba))
    model = Model.build("ball", [Link("ball")], [], geometry=Geometry({"ball": LinkGeometry((ball,))}))
    camera = Camera.look_at((1.0, -1.2, 0.9), (0.0, 0.0, 0.0), size=(160, 120))
    drawn = DrawnShape(0, Sphere(0.5), rgba, np.eye(4))
    picture = cast_rays([drawn], camera.pose.matrix, camera, DARK if dark else LIGHT)
    seen = picture.number == 0
    with Viewer(model, dark=dark) as viewer:
        viewer.page.scene.remove_by_name("/ground")
        open_page(viewer.url)
        connected(viewer)

        def far() -> float:
            found = by_page(viewer, camera).reshape(-1, 3).astype(np.float64)
            return float(np.quantile(np.abs(found - picture.rgb)[seen].max(axis=1), 0.9))

        # The page has 32 sides for a ball, and its material some gloss.
        until(lambda: far() <= 12.0, "the light of pictures")
