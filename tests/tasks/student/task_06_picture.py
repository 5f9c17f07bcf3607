"""A picture of an arm from a camera."""

from pathlib import Path

import numpy as np
from PIL import Image

from tests.tasks.robots import ball, two_link_arm
from tests.tasks.task import Array, Task, Wrong, existing, require

ANGLES = (0.7, 0.9)
EYE = (0.3, -2.0, 0.6)
TARGET = (0.2, 0.0, 0.4)
FIELD = 40.0  # vertical [deg]
WIDTH, HEIGHT = 640, 480
RADIUS = 0.06


def description() -> str:
    """Return an arm with a red ball at its tip."""
    return two_link_arm(tip=ball("tip", 0.2, RADIUS, "1 0 0 1"))


def tip(angles: Array) -> Array:
    """Return the position of the tip."""
    inner, outer = angles[0], angles[0] + angles[1]
    return np.array([0.4 * np.sin(inner) + 0.3 * np.sin(outer), 0, 0.4 * np.cos(inner) + 0.3 * np.cos(outer)])


def projection(
    point: Array, eye: Array, target: Array, size: tuple[int, int], field_deg: float
) -> tuple[Array, float]:
    """Return the pixel (column, row) of a point, and the pixels per metre at its depth; z is up."""
    forward = (target - eye) / np.linalg.norm(target - eye)
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    down = np.cross(forward, right)
    depth = forward @ (point - eye)
    scale = size[1] / 2 / np.tan(np.deg2rad(field_deg) / 2) / depth
    centre = np.array([(size[0] - 1) / 2, (size[1] - 1) / 2])
    return centre + scale * np.array([right @ (point - eye), down @ (point - eye)]), float(scale)


def red_pixels(picture: Array) -> Array:
    """Return the (column, row) of each pixel that is clearly red, in any light."""
    red, other = picture[..., 0], picture[..., 1:3].max(axis=-1)
    rows, columns = np.nonzero((red > 40) & (red > 2.0 * other))
    return np.stack([columns, rows], axis=-1).astype(float)


def check(folder: Path) -> None:
    """Compare the place and the size of the ball with a projection by hand."""
    try:
        picture = np.asarray(Image.open(existing(folder, "answer.png")).convert("RGB"), dtype=float)
    except OSError:
        raise Wrong("answer.png cannot be read as a picture") from None
    require(picture.shape == (HEIGHT, WIDTH, 3), f"the picture is {picture.shape[1]} x {picture.shape[0]}")
    pixels = red_pixels(picture)
    pixel, scale = projection(tip(np.array(ANGLES)), np.array(EYE), np.array(TARGET), (WIDTH, HEIGHT), FIELD)
    area = np.pi * (RADIUS * scale) ** 2
    require(len(pixels) > 0.6 * area, f"{len(pixels)} red pixels are too few for the ball")
    require(len(pixels) < 1.3 * area, f"{len(pixels)} red pixels are too many for the ball")
    error = np.linalg.norm(pixels.mean(axis=0) - pixel)
    require(error < 4, f"the ball is {error:.0f} pixels from where the camera sees it")
    nearby = np.abs(picture - np.median(picture.reshape(-1, 3), axis=0)).sum(axis=-1) > 25
    require(nearby.sum() > 1.5 * len(pixels), "the picture shows no arm beside the ball")


TASK = Task(
    "A picture of an arm",
    f"""
The file arm.urdf describes an arm with a red ball at its tip. It stands on the world's origin.
Its joints are at shoulder = {ANGLES[0]} rad, elbow = {ANGLES[1]} rad.
A camera is at {EYE} m, looks at the point {TARGET} m, and its picture's upper side is up (z).
Its vertical field of view is {FIELD:.0f} degrees.

Write answer.png: the colour picture that the camera takes, {WIDTH} x {HEIGHT} pixels.
""",
    check,
    {"arm.urdf": description},
)
