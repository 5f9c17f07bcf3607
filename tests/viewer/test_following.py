"""A camera that follows a part keeps its place relative to it, and takes over what the user changes."""

from __future__ import annotations

import io
import math
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest

import dynx
from dynx.errors import ArgumentError
from dynx.model.geometry import Box
from dynx.spatial.scalar import Floats
from dynx.spatial.so3 import rotation_from_rpy
from dynx.viewer import Viewer
from dynx.viewer.following import _BEFORE
from dynx.world import Material, Scene, SceneBody, SceneRobot, World, ground
from tests.viewer.conftest import PICTURE, OpenPage, connected, until, wait_for_rest

ORANGE = Material(rgba=(1.0, 0.4, 0.0, 1.0))

BODY = SceneBody("cube", (Box((0.4, 0.4, 0.4)),), mass=1.0, material=ORANGE)
SCENE = Scene("yard", bodies=(ground(), BODY))


def place(viewer: Viewer, origin: Floats) -> None:
    T = np.eye(4)
    T[:3, 3] = origin
    viewer.view.drawn.place({"cube": T})


def test_a_robot_is_followed_by_its_name() -> None:
    robot = dynx.load("six_axis_arm", base="floating")
    with robot.view() as viewer:
        viewer.follow(robot.name)
        assert viewer.view.camera._part.value == robot.root
    scene = Scene("two", robots=(SceneRobot("r2d2", robot),), bodies=(ground(),))
    with World(scene) as world, world.view(steps=False) as viewer:
        viewer.follow("r2d2")
        assert viewer.view.camera._part.value == f"r2d2/{robot.root}"
        with pytest.raises(ArgumentError, match="no part 'r2d3'; did you mean 'r2d2'"):
            viewer.follow("r2d3")


class Looking:
    """The camera of a page, as a program sets it."""

    def __init__(self) -> None:
        self.camera, self.up_direction = self, (0.0, 0.0, 1.0)
        self.position = self.look_at = np.zeros(3)

    @contextmanager
    def atomic(self) -> Iterator[None]:
        yield


def test_first_person_looks_out_of_what_is_fixed_to_the_link() -> None:
    camera = Looking()
    with World(SCENE) as world, world.view(steps=False) as viewer:
        viewer.page.server.get_clients = lambda: {0: camera}
        place(viewer, np.array([1.0, 0.0, 0.0]))
        viewer.follow("cube", first_person=True)
        assert np.allclose(camera.position, [1.0 + 0.2 + _BEFORE, 0.0, 0.0], atol=1e-6)
        T = np.eye(4)
        T[:3, :3] = rotation_from_rpy(np.array([0.2, -0.3, 0.5]))
        viewer.view.drawn.place({"cube": T})
        assert np.allclose(camera.position, (0.2 + _BEFORE) * T[:3, 0], atol=1e-6)
        assert np.allclose(camera.look_at - camera.position, T[:3, 0], atol=1e-9)
        assert np.allclose(camera.up_direction, T[:3, 2])
        viewer.follow("cube")
        assert np.allclose(camera.up_direction, [0.0, 0.0, 1.0])


def silhouette(page: Any) -> Floats:
    """Return the middle (2,) and the size (2,) of the orange cube in a picture, as shares of its width; zeros
    where it is not seen."""
    pillow = pytest.importorskip("PIL.Image")
    rgb = np.asarray(pillow.open(io.BytesIO(page.screenshot())).convert("RGB"), dtype=np.int16)
    rows, columns = np.nonzero((rgb[..., 0] > 100) & (rgb[..., 0] - rgb[..., 2] > 80))
    if not len(rows):
        return np.zeros(4)
    low, high = (np.array([f(columns), f(rows)]) for f in (np.min, np.max))
    return np.asarray(np.concatenate([0.5 * (low + high), high - low]) / rgb.shape[1], dtype=np.float64)


def alike(one: Floats, other: Floats, within: float = 0.01) -> bool:
    return bool(np.abs(one - other).max() < within)


BOUND = 0.03
"""Largest change of the silhouette in any picture, as a share of its width."""


def test_the_subject_stays_where_it_is_in_each_picture(open_page: OpenPage) -> None:
    """Also while it moves, in a page that is opened later, and after the user has zoomed."""
    with World(SCENE) as world, world.view(steps=False) as viewer:
        page = open_page(viewer.url, (700, 425))
        connected(viewer)
        wait_for_rest(page, viewer)
        start, origin, ended = silhouette(page.page), np.zeros(3), threading.Event()
        assert start[2] > 0.05

        def drive() -> None:
            step = 0
            while not ended.wait(1.0 / 30.0):
                leg, step = step // 20, step + 1
                # Straight, in another direction, and at rest.
                ahead = np.array([math.cos(2.0 * leg), math.sin(2.0 * leg), 0.0]) * (leg % 3 > 0)
                origin[:] += ahead / 30.0
                place(viewer, origin.copy())

        viewer.follow("cube")
        driver = threading.Thread(target=drive)
        driver.start()
        try:
            for _ in range(10):
                assert alike(silhouette(page.page), start, BOUND)
            later = open_page(viewer.url, (700, 425))
            connected(viewer, 2)
            until(lambda: alike(silhouette(later.page), start, BOUND), "the view of the start")
            assert alike(silhouette(later.page), start, BOUND)
            # A page takes over the view of the start late, and again with its button.
            later.page.evaluate("__viserMutable.resetCameraPose(false)")
            later.page.wait_for_timeout(PICTURE)
            assert alike(silhouette(later.page), start, BOUND)
            page.page.mouse.move(20, 20)
            page.page.mouse.wheel(0.0, -300.0)
            page.page.wait_for_timeout(2.0 * PICTURE)
            nearer = silhouette(page.page)
            assert nearer[2] > 1.05 * start[2]
            for _ in range(5):
                assert alike(silhouette(page.page), nearer, BOUND)
        finally:
            ended.set()
            driver.join()
        assert np.linalg.norm(origin) > 0.5
        viewer.follow(None)
        wait_for_rest(page)
        place(viewer, origin + np.array([0.5, 0.0, 0.0]))
        until(lambda: not alike(silhouette(page.page), nearer, BOUND), "the camera to stay")
        assert not page.errors
        assert not later.errors


def test_a_page_follows_a_robot_by_its_name(open_page: OpenPage) -> None:
    robot = dynx.load(
        "<robot name='droid'><link name='base'><visual><geometry><box size='0.4 0.4 0.4'/></geometry>"
        "<material name='m'><color rgba='1 0.4 0 1'/></material></visual><inertial><mass value='1'/>"
        "<inertia ixx='1' iyy='1' izz='1' ixy='0' ixz='0' iyz='0'/></inertial></link></robot>",
        base="floating",
    )
    scene = Scene("two", robots=(SceneRobot("r2d2", robot),), bodies=(ground(),))
    with World(scene) as world, world.view(steps=False) as viewer:
        page = open_page(viewer.url, (700, 425))
        connected(viewer)
        T = np.eye(4)
        T[2, 3] = 0.5
        viewer.view.drawn.place({"r2d2/base": T})
        wait_for_rest(page, viewer)
        until(lambda: silhouette(page.page)[2] > 0.05, "the robot")
        start = silhouette(page.page)

        def move(name: str | None) -> None:
            viewer.follow(name)
            wait_for_rest(page)
            T = viewer.view.drawn.pose("r2d2/base")
            T[:3, 3] += [0.5, 0.4, 0.0]
            viewer.view.drawn.place({"r2d2/base": T})
            wait_for_rest(page)

        move("r2d2")
        until(lambda: alike(silhouette(page.page), start, BOUND), "the view of the start")
        move(None)
        until(lambda: not alike(silhouette(page.page), start, BOUND), "another view")
        wait_for_rest(page)
        assert not alike(silhouette(page.page), start, BOUND)
        assert not page.errors
