"""Names on the links of a robot, as many as have room in the picture."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from dynx.spatial.scalar import Floats
from dynx.spatial.so3 import rotation_from_quat
from dynx.viewer.drawn_robot import DrawnRobot
from dynx.viewer.page import Page

_EM = 12.0
"""Size of the letters of viser's labels [pixels]."""
_WIDTH, _HEIGHT, _BORDER = 0.65 * _EM, 1.25 * _EM, 0.3 * _EM
"""Width of a letter, above the mean of most words; height of a line; both borders together [pixels]."""

CORNERS = {
    "top-left": (0.0, 0.0),
    "bottom-left": (0.0, -1.0),
    "top-right": (-1.0, 0.0),
    "bottom-right": (-1.0, -1.0),
}
"""Corner of a label that lies on its point -> its upper left corner from there, in its widths and heights."""

Rectangle = tuple[float, float, float, float]
"""Left, top, right and bottom [pixels], downward."""


def rectangle(point: Sequence[float], text: str, corner: str) -> Rectangle:
    """Return where a label lies, a corner of which lies on a point (2,) [pixels]."""
    width, height = _WIDTH * len(text) + _BORDER, _HEIGHT + _BORDER
    along, down = CORNERS[corner]
    left, top = point[0] + along * width, point[1] + down * height
    return left, top, left + width, top + height


def overlap(a: Rectangle, b: Rectangle) -> bool:
    """Check whether two rectangles overlap."""
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]


def arranged(points: Floats, texts: Sequence[str]) -> list[str | None]:
    """Return for the label at each of the points (n, 2) [pixels] the corner that lies on the point, such that
    no label overlaps one before it; None where there is no room, or a point is not finite."""
    taken: list[Rectangle] = []
    found: list[str | None] = []
    for point, text in zip(points.tolist(), texts, strict=True):
        found.append(None)
        if not all(map(math.isfinite, point)):
            continue
        for corner in CORNERS:
            wanted = rectangle(point, text, corner)
            if not any(overlap(wanted, other) for other in taken):
                taken.append(wanted)
                found[-1] = corner
                break
    return found


def seen_by(camera: Any, points: Floats) -> Floats:
    """Return where a camera of viser sees points (n, 3) [m]: (n, 2) [pixels], NaN for one behind it."""
    eye = np.array(camera.position)
    ahead = np.array(camera.look_at) - eye
    ahead /= np.linalg.norm(ahead)
    right = np.cross(ahead, np.array(camera.up_direction))
    right /= np.linalg.norm(right)
    x, y, z = np.stack([right, np.cross(ahead, right), ahead]) @ (points - eye).T
    height, width = camera.image_height, camera.image_width
    scale = 0.5 * height / math.tan(0.5 * camera.fov) / np.where(z > 0.0, z, np.nan)
    return np.stack([0.5 * width + scale * x, 0.5 * height + scale * y], axis=-1)


def centre_of(shapes: Sequence[Any]) -> tuple[float, ...]:
    """Return the centre (3,) [m], in the frame of their part, of the box around the nodes of its shapes; the
    origin without shapes. The frames of links that are connected often have the same origin, where names
    would lie over each other."""
    corners = []
    for node in shapes:
        w, *xyz = node.wxyz
        points = np.asarray(node.vertices) @ rotation_from_quat(np.array([*xyz, w])).T + node.position
        corners += [points.min(axis=0), points.max(axis=0)]
    if not corners:
        return (0.0, 0.0, 0.0)
    centre = 0.5 * (np.min(corners, axis=0) + np.max(corners, axis=0))
    return tuple(np.asarray(centre, dtype=np.float64).tolist())


class NameLabels:
    """The names of all links of a robot. None overlaps another in the picture of the page whose camera moved
    last: a name without room is hidden until the camera comes nearer."""

    def __init__(self, page: Page, robot: DrawnRobot) -> None:
        self._page, self._robot, self._ended = page, robot, page.ended
        # Links that are seen have their names first.
        self._names = sorted(robot.links, key=lambda name: not robot.visuals[name])
        self._places = np.array([centre_of(robot.visuals[name]) for name in self._names])
        self._labels = [
            page.scene.add_label(f"{robot.links[name].name}/label", name, position=tuple(place.tolist()))
            for name, place in zip(self._names, self._places, strict=True)
        ]
        self._camera: Any = None
        self._visible = True
        robot.on_placed(lambda _: self._arrange())
        page.server.on_client_connect(lambda client: self._follow(client.camera))
        for client in page.server.get_clients().values():
            self._follow(client.camera)

    @property
    def visible(self) -> bool:
        """Whether names are shown."""
        return self._visible

    @visible.setter
    def visible(self, shown: bool) -> None:
        self._visible = shown
        self._arrange()

    def _follow(self, camera: Any) -> None:
        camera.on_update(self._moved)
        self._moved(camera)

    def _moved(self, camera: Any) -> None:
        with self._page.lock:
            self._camera = camera
            self._arrange()

    def _arrange(self) -> None:
        if self._ended.is_set():
            return
        if not self._visible or self._camera is None:
            for label in self._labels:
                _set_visible(label, self._visible)
            return
        corners = arranged(seen_by(self._camera, self._points()), self._names)
        for label, corner in zip(self._labels, corners, strict=True):
            if corner is not None and corner != label.anchor:
                label.anchor = corner
            _set_visible(label, corner is not None)

    def _points(self) -> Floats:
        """Return the points (n, 3) in the world on which the names lie."""
        poses = np.stack([self._robot.pose(name) for name in self._names])
        return np.asarray((poses[:, :3, :3] @ self._places[..., None])[..., 0] + poses[:, :3, 3])


def _set_visible(label: Any, visible: bool) -> None:
    # Each assignment is a message to the page.
    if label.visible != visible:
        label.visible = visible
