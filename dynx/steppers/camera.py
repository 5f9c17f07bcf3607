"""`Camera`: where a camera is, where it looks, and how large its picture is."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dynx.errors import ArgumentError, shown
from dynx.model import Pose
from dynx.model.elements import IDENTITY, checked_pose
from dynx.model.geometry.solids import Shape
from dynx.model.numbers import checked_vector, is_real, positive_number, whole_number
from dynx.spatial.scalar import Floats
from dynx.spatial.se3 import homogeneous

MAX_SIDE = 8192
"""Largest width and height of a picture [pixels]."""


@dataclass(frozen=True)
class Camera:
    """A pinhole camera.

    - `part`: the body or ``robot/link`` that carries the camera. Without it the camera stands in the world
    - `pose`: the pose of the camera in the frame of `part`, or in the world. The x axis of the camera points
      to the right of the picture, y points down, and z is the optical axis
    - `field_of_view`: the vertical angle [rad] between the upper and the lower edge of the picture
    - `size`: width and height of the picture in pixels, which are square
    - `near`, `far`: the camera sees only what is between these distances [m] along the optical axis
    """

    pose: Pose = IDENTITY
    field_of_view: float = math.pi / 3.0
    size: tuple[int, int] = (320, 240)
    part: str | None = None
    near: float = 0.01
    far: float = 1000.0

    def __post_init__(self) -> None:
        put = object.__setattr__
        put(self, "pose", checked_pose("pose of a camera", self.pose))
        angle = self.field_of_view
        if not is_real(angle):
            raise ArgumentError(f"field_of_view is {shown(angle)}; wanted 0 to pi [rad]")
        if not 0.0 < angle < math.pi:
            meant = f"; {angle:g} degrees are {math.radians(angle):.4g}" if math.pi <= angle < 180.0 else ""
            raise ArgumentError(f"field_of_view is {angle:g}; wanted 0 to pi [rad]{meant}")
        if not isinstance(self.size, tuple | list) or len(self.size) != 2:
            raise ArgumentError(f"size is {shown(self.size)}; wanted width and height")
        sides = tuple(whole_number(f"size[{k}]", side, 1) for k, side in enumerate(self.size))
        if max(sides) > MAX_SIDE:
            raise ArgumentError(f"size is {shown(self.size)}; at most {MAX_SIDE} pixels each way are drawn")
        put(self, "size", sides)
        put(self, "near", positive_number("near", self.near))
        put(self, "far", positive_number("far", self.far))
        if self.near >= self.far:
            raise ArgumentError(f"near is {self.near}; wanted less than far, {self.far}")

    @classmethod
    def look_at(
        cls, eye: ArrayLike, target: ArrayLike, up: ArrayLike = (0.0, 0.0, 1.0), **options: Any
    ) -> Camera:
        """Return the camera at `eye` (3,) that sees `target` (3,) in the middle, with `up` (3,) upwards.

        `options` are the other fields. Raises ArgumentError for equal points, or for `up` along the view.
        """
        start, end, above = (
            checked_vector("eye", eye),
            checked_vector("target", target),
            checked_vector("up", up),
        )
        forward = end - start
        distance = float(np.linalg.norm(forward))
        if distance == 0.0:
            raise ArgumentError(f"eye and target are both {start.tolist()}; wanted different points")
        forward = forward / distance
        right = np.cross(forward, above)
        length = float(np.linalg.norm(right))
        if length <= 1e-9 * float(np.linalg.norm(above)):
            across = np.eye(3)[int(np.argmin(np.abs(forward)))].tolist()
            raise ArgumentError(
                f"up is {above.tolist()}, along the view from eye to target; wanted another direction as "
                f"the upper edge of the picture, such as up={across}"
            )
        right = right / length
        R = np.stack([right, np.cross(forward, right), forward], axis=1)
        return cls(Pose.from_matrix(homogeneous(R, start), "the view"), **options)

    @property
    def focal_length(self) -> float:
        """Distance from the pinhole to the picture [pixels]."""
        return 0.5 * self.size[1] / math.tan(0.5 * self.field_of_view)

    @property
    def intrinsics(self) -> Floats:
        """Matrix (3, 3) that takes a point in the axes of the camera to its column and row, times its depth.

        The centre of the pixel in the first column and the first row is at (0, 0), as OpenCV and ROS have it.
        """
        width, height = self.size
        f = self.focal_length
        return np.array([[f, 0.0, 0.5 * (width - 1)], [0.0, f, 0.5 * (height - 1)], [0.0, 0.0, 1.0]])

    def rays(self) -> tuple[Floats, Floats]:
        """Return x of the rays through the centres of the columns, and y of those of the rows, at z = 1."""
        width, height = self.size
        columns = (np.arange(width) + 0.5 - 0.5 * width) / self.focal_length
        rows = (np.arange(height) + 0.5 - 0.5 * height) / self.focal_length
        return np.asarray(columns, np.float64), np.asarray(rows, np.float64)


class DrawnTriangles(NamedTuple):
    """A surface that is only drawn, such as an arrow: it casts no shadow."""

    vertices: Floats
    """Corners (n, 3) [m]."""
    faces: NDArray[np.intp]
    """Numbers of the corners of each triangle (m, 3)."""


class DrawnShape(NamedTuple):
    """A shape, its colour, its pose in the world (4, 4), and the number of its part."""

    part: int
    shape: Shape | DrawnTriangles
    rgba: tuple[float, float, float, float]
    T: Floats
    painted: bool = True
    """Whether a mesh is drawn with its image and the colours of its corners, not in one colour alone."""


class Drawing(NamedTuple):
    """The sight in each of the n pixels, by rows: colour (n, 3), depth (n,) [m], and the number (n,) of
    the shape, -1 for none, whose depth is infinite."""

    rgb: NDArray[np.uint8]
    depth: Floats
    number: NDArray[np.intp]


Draw = Callable[[Sequence[DrawnShape], Floats, Camera], Drawing]
"""A renderer: it draws shapes as a camera at a pose (4, 4) in the world sees them."""
