"""Panes of the page that show what a camera in the scene sees: colours, depth, or parts."""

from __future__ import annotations

import colorsys
import threading
from collections.abc import Callable
from html import escape

import numpy as np
from numpy.typing import NDArray

from dynx.errors import ArgumentError, DynxError, nearest, shown
from dynx.spatial.scalar import Floats
from dynx.steppers.camera import Camera
from dynx.viewer.colours import css
from dynx.viewer.motion import MotionFrames
from dynx.viewer.page import Page
from dynx.world import Scene, SceneRobot
from dynx.world.camera import Picture, draw_frames

KINDS = ("colours", "depth", "parts")
"""What a pane shows."""

PICTURES_PER_SECOND = 8.0
"""Largest rate at which a pane is drawn."""

_NOTHING = (20, 20, 20)
"""Colour of pixels in which nothing is seen."""

_HUE_STEP = 0.618033988749895
"""Step from the hue of one part to that of the next, after which no two are near each other for long."""

_STYLE = "margin: 0.2em 0.8em; font-size: 0.8em; overflow-wrap: anywhere"


def part_colour(number: int) -> tuple[int, int, int]:
    """Return the colour of the part with a number, unlike those of the numbers beside it."""
    # Every other one is darker, so that neighbours also differ for readers who see no hues.
    value, saturation = ((0.95, 0.55), (0.62, 0.85))[number % 2]
    r, g, b = colorsys.hsv_to_rgb((0.58 + _HUE_STEP * number) % 1.0, saturation, value)
    return round(255 * r), round(255 * g), round(255 * b)


def part_colours(picture: Picture) -> NDArray[np.uint8]:
    """Return the colours (height, width, 3) of a picture that tell its parts apart."""
    table = np.array([_NOTHING, *map(part_colour, range(len(picture.names)))], dtype=np.uint8)
    return np.asarray(table[picture.segmentation + 1])


def depth_shades(depth: Floats) -> NDArray[np.uint8]:
    """Return greys (height, width, 3) for depths [m]: the nearest is white, and half of its light is at twice
    its distance, so that far away ground leaves shades for what is near; black where nothing is."""
    nearest_depth = float(depth.min(initial=np.inf))
    if not np.isfinite(nearest_depth):
        return np.zeros((*depth.shape, 3), dtype=np.uint8)
    grey = np.rint(255.0 * nearest_depth / depth).astype(np.uint8)
    return np.repeat(grey[..., None], 3, axis=2)


def shown_picture(motion: MotionFrames, time: float, camera: Camera) -> Picture:
    """Return what a camera sees of a motion at a time [s]. Raises UnknownNameError for an unknown part that
    carries the camera."""
    robots = tuple(SceneRobot(name, model) for name, model in motion.robots.items())
    scene = Scene(motion.name, robots=robots, bodies=motion.bodies)
    frames = {body.name: body.pose.matrix for body in motion.bodies}
    return draw_frames(scene, frames | motion.at(motion.frame_at(time)), camera)


class CameraPane:
    """A picture of a camera in the panel of the page, which follows what the page shows."""

    def __init__(
        self,
        page: Page,
        motion_now: Callable[[], tuple[MotionFrames, float]],
        camera: Camera,
        name: str,
        shows: str,
    ) -> None:
        """`motion_now()` returns what is shown and its time [s]."""
        if not isinstance(camera, Camera):
            raise ArgumentError(f"camera is of type {type(camera).__name__}; wanted a Camera")
        if shows not in KINDS:
            raise ArgumentError(f"shows is {shown(shows)}{nearest(shows, KINDS)}")
        self._page, self._motion_now, self._camera = page, motion_now, camera
        self._ended = threading.Event()
        self._changed = threading.Event()
        self.picture = self._draw()
        """The picture that is shown."""
        gui = page.gui
        self._folder = gui.add_folder(name)
        with self._folder:
            self._shows = gui.add_dropdown("shows", KINDS, initial_value=shows)
            self._image = gui.add_image(self.image, format="png")
            self._caption = gui.add_html(self._html())
        self._shows.on_update(lambda _: self._put())
        page.at_end(self._end)
        threading.Thread(target=self._run, name="dynx pane", daemon=True).start()

    @property
    def shows(self) -> str:
        """One of `KINDS`; assigning changes it."""
        return str(self._shows.value)

    @shows.setter
    def shows(self, kind: str) -> None:
        if kind not in KINDS:
            raise ArgumentError(f"shows is {shown(kind)}{nearest(kind, KINDS)}")
        self._shows.value = kind

    @property
    def image(self) -> NDArray[np.uint8]:
        """The colours (height, width, 3) that are shown."""
        kind = self._shows.value
        if kind == "parts":
            return part_colours(self.picture)
        return depth_shades(self.picture.depth) if kind == "depth" else self.picture.rgb

    def changed(self) -> None:
        """Draw anew, soon: what the page shows has changed."""
        self._changed.set()

    def remove(self) -> None:
        """Remove the pane from the page."""
        self._end()
        self._folder.remove()

    def _end(self) -> None:
        self._ended.set()
        self._changed.set()

    def _draw(self) -> Picture:
        with self._page.lock:
            motion, time = self._motion_now()
        return shown_picture(motion, time, self._camera)

    def _run(self) -> None:
        while not self._ended.wait(1.0 / PICTURES_PER_SECOND):
            self._changed.wait()
            self._changed.clear()
            if self._ended.is_set():
                return
            try:
                self.picture = self._draw()
            except DynxError:  # a world that diverged or was closed says so itself
                continue
            self._put()

    def _put(self) -> None:
        with self._page.lock:
            if not self._ended.is_set() and not self._page.closed:
                self._image.image = self.image
                self._caption.content = self._html()

    def _html(self) -> str:
        """Return what the shades or the colours mean."""
        kind, picture = self._shows.value, self.picture
        if kind == "depth":
            finite = picture.depth[np.isfinite(picture.depth)]
            text = "nothing is seen"
            if len(finite):
                text = f"white: {finite.min():.3g} m; darker is farther, up to {finite.max():.3g} m"
        elif kind == "parts":
            seen = [k for k in np.unique(picture.segmentation).tolist() if k >= 0]
            text = ", ".join(
                f"<b style='color: {css(part_colour(k))}'>&#9632;</b> {escape(picture.names[k])}"
                for k in seen
            )
        else:
            width, height = self._camera.size
            text = f"{width} x {height} pixels"
        return f"<p style='{_STYLE}'>{text}</p>"
