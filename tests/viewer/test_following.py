"""A camera that follows a part keeps its place relative to it, and takes over what the user changes."""

from __future__ import annotations

import io
import math
import time
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import dynx
from dynx.errors import ArgumentError
from dynx.model.geometry import Box
from dynx.spatial.scalar import Floats
from dynx.spatial.so3 import rotation_from_rpy
from dynx.viewer import Viewer
from dynx.viewer.following import _BEFORE
from dynx.world import World
from dynx.world.scene import Material, Scene, SceneBody, SceneRobot, ground
from tests.viewer.conftest import PICTURE, OpenPage, connected, until

START = np.array([2.0, -1.5, 1.2]), np.array([0.1, 0.2, 0.3])
"""Position and target of the camera at the start [m]."""


class DelayedCamera:
    """The camera of a page as viser's server has it: the page draws what it is sent `there` updates later,
    and what it reports arrives `back` updates after that."""

    def __init__(self, there: int, back: int) -> None:
        self.client, self.client_id, self.camera = self, 0, self
        self._websock_connection = self
        self._state = SimpleNamespace(position=START[0], look_at=START[1])
        self.shown = START
        self.up_direction = (0.0, 0.0, 1.0)
        self._to_page: deque[Any] = deque([()] * there)
        self._to_server: deque[Any] = deque([()] * back)
        self._sent: list[tuple[str, Floats]] = []
        self._heard: list[Any] = []

    @contextmanager
    def atomic(self) -> Iterator[None]:
        yield

    def queue_message(self, message: Any) -> None:
        position = getattr(message, "position", None)
        self._sent.append(("look_at", message.look_at) if position is None else ("position", position))

    def on_update(self, callback: Any) -> None:
        self._heard.append(callback)

    @property
    def position(self) -> Floats:
        return np.asarray(self._state.position)

    @position.setter
    def position(self, wanted: Floats) -> None:
        self._state.position = wanted

    @property
    def look_at(self) -> Floats:
        return np.asarray(self._state.look_at)

    @look_at.setter
    def look_at(self, wanted: Floats) -> None:
        self._state.look_at = wanted

    def update(self, turn: Floats | None = None, zoom: float = 1.0, pan: Floats | None = None) -> None:
        """Take the messages that arrive now; the user turns (3, 3), zooms or shifts (3,) the view before."""
        self._to_page.append(tuple(self._sent))
        self._sent.clear()
        position, target = self.shown
        eye = zoom * (np.eye(3) if turn is None else turn) @ (position - target)
        target = target + (np.zeros(3) if pan is None else pan)
        position = target + eye
        reports = [] if np.array_equal(position, self.shown[0]) else [(position, target)]
        for name, value in (messages := self._to_page.popleft()):
            position, target = (
                (np.array(value), target) if name == "position" else (position, np.array(value))
            )
        if messages:
            reports.append((position, target))
        self.shown = (position, target)
        self._to_server.append(tuple(reports))
        for view in self._to_server.popleft():
            self._state = SimpleNamespace(position=view[0], look_at=view[1])
            for callback in self._heard:
                # It waits for nothing; a loop of events may run already, where a browser is open.
                with suppress(StopIteration):
                    callback(self).send(None)


ORANGE = Material(rgba=(1.0, 0.4, 0.0, 1.0))

BODY = SceneBody("cube", (Box((0.4, 0.4, 0.4)),), mass=1.0, material=ORANGE)
SCENE = Scene("yard", bodies=(ground(), BODY))


@pytest.fixture(scope="module")
def viewer() -> Iterator[Viewer]:
    with World(SCENE) as world, world.view(steps=False) as opened:
        yield opened


def place(viewer: Viewer, origin: Floats) -> None:
    T = np.eye(4)
    T[:3, 3] = origin
    viewer.view.drawn.place({"cube": T})


def following(viewer: Viewer, camera: DelayedCamera, origin: Floats) -> None:
    """Let the only page of a viewer, whose camera is given, follow the cube."""
    viewer.page.server.get_clients = lambda: {0: camera}
    viewer.follow(None)
    place(viewer, origin)
    viewer.view.camera._join(camera)
    viewer.follow("cube")


DELAYS = st.integers(0, 8)
STEPS = st.lists(st.tuples(*[st.floats(-0.3, 0.3)] * 3), min_size=1, max_size=40)


@given(DELAYS, DELAYS, STEPS)
def test_however_late_a_page_answers_the_view_stays_where_it_was(
    viewer: Viewer, there: int, back: int, steps: list[tuple[float, float, float]]
) -> None:
    camera, origin = DelayedCamera(there, back), np.array([0.5, -0.2, 0.3])
    following(viewer, camera, origin)
    start = origin.copy()
    for step in steps:
        origin = origin + step
        place(viewer, origin)
        camera.update()
    for _ in range(there + back + 2):
        camera.update()
    for now, before in zip(camera.shown, START, strict=True):
        assert np.allclose(now - origin, before - start, atol=1e-9)


@given(DELAYS, DELAYS, STEPS, st.floats(-1.0, 1.0), st.floats(0.5, 2.0), st.floats(-0.5, 0.5))
def test_what_the_user_changes_is_kept(
    viewer: Viewer,
    there: int,
    back: int,
    steps: list[tuple[float, float, float]],
    angle: float,
    zoom: float,
    pan: float,
) -> None:
    camera, origin = DelayedCamera(there, back), np.zeros(3)
    following(viewer, camera, origin)
    turn = rotation_from_rpy(np.array([0.0, 0.0, angle]))
    eye = zoom * turn @ (START[0] - START[1])
    for k, step in enumerate(steps):
        origin = origin + step
        place(viewer, origin)
        if k == len(steps) // 2:
            camera.update(turn, zoom)
        else:
            camera.update()
    for _ in range(there + back + 2):
        place(viewer, origin)
        camera.update()
    shift = np.array([0.0, pan, 0.0])
    camera.update(pan=shift)
    for _ in range(back + 2):
        camera.update()
    place(viewer, origin + 1.0)
    for _ in range(there + 2):
        camera.update()
    position, target = camera.shown
    assert np.allclose(position - target, eye, atol=1e-9)
    assert np.allclose(target - (origin + 1.0), START[1] + shift, atol=1e-5)


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


def test_first_person_looks_out_of_what_is_fixed_to_the_link(viewer: Viewer) -> None:
    camera = DelayedCamera(0, 0)
    following(viewer, camera, np.array([1.0, 0.0, 0.0]))
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


def alike(one: Floats, other: Floats) -> bool:
    return bool(np.abs(one - other).max() < 0.01)


def test_the_subject_stays_where_it_is_in_the_picture(open_page: OpenPage) -> None:
    with World(SCENE) as world, world.view(steps=False) as viewer:
        page = open_page(viewer.url, (700, 425))
        connected(viewer)
        viewer.follow("cube")
        start, origin = silhouette(page.page), np.zeros(3)
        for leg in range(3):
            for _ in range(20):
                origin = origin + np.array([math.cos(2.0 * leg), math.sin(2.0 * leg), 0.0]) / 30.0
                place(viewer, origin)
                time.sleep(1.0 / 30.0)
            # The last update is drawn when both of its messages have come.
            until(lambda: alike(silhouette(page.page), start), "the view of the start")
        page.page.mouse.move(20, 20)
        page.page.mouse.wheel(0.0, -300.0)
        until(lambda: silhouette(page.page)[2] > 1.05 * start[2], "the zoom")
        page.page.wait_for_timeout(PICTURE)
        nearer = silhouette(page.page)
        for _ in range(10):
            origin = origin + np.array([0.05, 0.05, 0.0])
            place(viewer, origin)
            time.sleep(1.0 / 30.0)
        until(lambda: alike(silhouette(page.page), nearer), "the view that the user chose")
        assert not page.errors
