"""Marks on the links of a robot: frames, joint axes, names, centres of mass and inertia."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from dynx.model import Model
from dynx.model.elements import Inertial
from dynx.model.geometry import Box, Sphere
from dynx.spatial.scalar import Floats
from dynx.spatial.so3 import rotation_from_quat
from dynx.viewer.browser import names_element
from dynx.viewer.colours import BLUE, RGB, SKY_BLUE, VERMILION, YELLOW
from dynx.viewer.drawn_robot import DrawnParts, DrawnRobot, DrawnScene, size_of, wxyz
from dynx.viewer.page import Page
from dynx.viewer.triangles import triangles_of

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
"""Offset from the point to the upper left corner of its label, in widths and heights of the label, by the
corner of the label that lies on the point: with ``top-left`` the label is right of the point and below it."""

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
    no label overlaps one before it; None where there is no room, or a point is not finite. Corners are tried
    in the order of `CORNERS`; rectangles that only touch do not overlap."""
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


INERTIA_OPACITY = 0.6


class EquivalentSolid(NamedTuple):
    """A solid of uniform density with the mass and the inertia of a link."""

    lengths: Floats
    """Edges of a box or diameters of an ellipsoid (3,) [m], along the principal axes."""
    R: Floats
    """Principal axes (3, 3) as columns, in the frame of the link."""
    possible: bool
    """False where no body has these moments: one exceeds the sum of the other two, or is negative."""


def equivalent_solid(inertial: Inertial, moment_factor: float) -> EquivalentSolid:
    """Return the uniform box or ellipsoid with the mass, above 0, and the principal moments of a link.

    Each moment is ``mass (a^2 + b^2) / moment_factor``, with a and b the lengths along the other two
    principal axes. The factor is 12 for the edges of a box, and 20 for the diameters of an ellipsoid. Axes
    are in the order of ascending moments, so that the longest length is first. Where the moments are
    impossible, the square of a length would be negative: that length is 0, and `possible` False.
    """
    moments, axes = np.linalg.eigh(inertial.tensor)
    if np.linalg.det(axes) < 0.0:
        axes[:, 0] *= -1.0
    # From m (b^2 + c^2) = f I1 and its permutations follows 2 m a^2 = f (I2 + I3 - I1).
    squares = 0.5 * moment_factor * (moments.sum() - 2.0 * moments) / inertial.mass
    possible = bool((squares >= -1e-9 * np.abs(squares).max(initial=0.0)).all())
    R = inertial.origin.matrix[:3, :3] @ axes
    return EquivalentSolid(np.sqrt(np.maximum(squares, 0.0)), R, possible)


class Marks:
    """The marks of one robot; each kind is added when it is first shown."""

    kinds = ("frames", "joint axes", "names", "centres of mass", "inertia boxes", "inertia ellipsoids")
    """What can be shown."""

    def __init__(self, page: Page, robot: DrawnRobot) -> None:
        self._page, self._scene, self._robot = page, page.scene, robot
        self._size = size_of(robot.model)
        self._nodes: dict[str, list[Any]] = {}

    def show(self, kind: str, shown: bool) -> None:
        """Show or hide the marks of one kind."""
        if kind not in self._nodes:
            if not shown:
                return
            makers: dict[str, Callable[[], Iterator[Any]]] = {
                "frames": self._frames,
                "joint axes": self._joint_axes,
                "names": self._names,
                "centres of mass": self._centers,
                "inertia boxes": lambda: self._solids(12.0),
                "inertia ellipsoids": lambda: self._solids(20.0),
            }
            self._nodes[kind] = list(makers[kind]())
        for node in self._nodes[kind]:
            node.visible = shown

    @property
    def _model(self) -> Model:
        return self._robot.model

    def _frames(self) -> Iterator[Any]:
        for node in self._robot.links.values():
            length = 0.1 * self._size
            yield self._scene.add_frame(f"{node.name}/axes", axes_length=length, axes_radius=0.07 * length)

    def _joint_axes(self) -> Iterator[Any]:
        half = 0.1 * self._size
        for joint in self._model.joints:
            if not joint.moves:
                continue
            axis = np.asarray(joint.axis, dtype=np.float64)
            axis = half * axis / np.linalg.norm(axis)
            yield self._scene.add_arrows(
                f"{self._robot.links[joint.child].name}/joint_axis",
                np.stack([-axis, axis])[None].astype(np.float32),
                SKY_BLUE,
                shaft_radius=0.03 * half,
                head_radius=0.1 * half,
                head_length=0.25 * half,
            )

    def _names(self) -> Iterator[Any]:
        yield NameLabels(self._page, self._robot)

    def _centers(self) -> Iterator[Any]:
        for name, inertial in self._with_mass():
            yield self._scene.add_icosphere(
                f"{self._robot.links[name].name}/center",
                radius=0.015 * self._size,
                color=YELLOW,
                position=inertial.origin.matrix[:3, 3],
            )

    def _solids(self, moment_factor: float) -> Iterator[Any]:
        kind = "box" if moment_factor == 12.0 else "ellipsoid"
        unit = triangles_of(Box((1.0, 1.0, 1.0)) if kind == "box" else Sphere(0.5))
        for name, inertial in self._with_mass():
            solid = equivalent_solid(inertial, moment_factor)
            # A body without extent along an axis still shows.
            lengths = np.maximum(solid.lengths, 1e-3 * self._size)
            colour: RGB = BLUE if solid.possible else VERMILION
            yield self._scene.add_mesh_simple(
                f"{self._robot.links[name].name}/inertia_{kind}",
                unit.vertices * lengths.astype(np.float32),
                unit.faces,
                color=colour,
                opacity=INERTIA_OPACITY,
                cast_shadow=False,
                receive_shadow=False,
                wxyz=wxyz(solid.R),
                position=inertial.origin.matrix[:3, 3],
            )

    def _with_mass(self) -> Iterator[tuple[str, Inertial]]:
        for link in self._model.links:
            inertial = self._model.inertial(link.name)
            if inertial.mass > 0.0:
                yield link.name, inertial


class SceneMarks:
    """Marks of all robots of a scene, which are switched together; names would lie over each other."""

    kinds = tuple(kind for kind in Marks.kinds if kind != "names")
    """What can be shown."""

    def __init__(self, page: Page, drawn: DrawnScene) -> None:
        self._page, self._shown = page, dict.fromkeys(self.kinds, False)
        self._marks = [Marks(page, robot) for robot in drawn.robots.values()]

    def add_switches(self) -> dict[str, Any]:
        """Add a box for each kind, where there is a robot, and return them by kind."""
        boxes = {}
        for kind in self.kinds if self._marks else ():
            box = boxes[kind] = self._page.gui.add_checkbox(kind, initial_value=False)
            box.on_update(lambda _, kind=kind, box=box: self.show(kind, box.value))
        return boxes

    def show(self, kind: str, shown: bool) -> None:
        """Show or hide the marks of one kind."""
        with self._page.lock, self._page.together():
            self._shown[kind] = shown
            for marks in self._marks:
                marks.show(kind, shown)

    def watch(self, drawn: DrawnScene) -> None:
        """Mark the robots of another drawing, whose marks before went with it."""
        self._marks = [Marks(self._page, robot) for robot in drawn.robots.values()]
        for kind, shown in self._shown.items():
            self.show(kind, shown)


class NamedParts:
    """The names of parts: that under the pointer, and that of at most one part that was clicked, which stays
    on it and moves with it."""

    def __init__(self, page: Page, drawn: DrawnParts) -> None:
        """The visual shapes of what is drawn are clicked."""
        self._page, self._drawn = page, drawn
        self._label: Any = None
        self.shown: str | None = None
        """The part whose name stays."""
        page.part_names = drawn.names_by_path
        self._names = page.gui.add_html(names_element(page.part_names), order=math.inf)
        for name, nodes in drawn.visuals.items():
            for node in nodes:
                node.on_click(lambda _, name=name: self.show(None if name == self.shown else name))

    def show(self, part: str | None) -> None:
        """Show the name of a part; with None no name is shown."""
        with self._page.lock:
            if self._label is not None:
                self._label.remove()
                self._label = None
            self.shown = part
            if part is not None:
                place = centre_of(self._drawn.visuals[part])
                path = f"{self._drawn.path_of(part)}/name"
                self._label = self._page.scene.add_label(path, part, position=place)

    def remove(self) -> None:
        """Remove the names from the page."""
        self.show(None)
        self._names.remove()
