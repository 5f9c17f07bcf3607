"""Pictures, films and pages of what the viewer shows, without a browser and without a display."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from html import escape
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dynx.errors import ArgumentError, shown
from dynx.files.films import write_pictures
from dynx.files.reading import checked_path
from dynx.files.writing import write_bytes
from dynx.model import Model
from dynx.model.geometry import Cylinder, Plane, Shape
from dynx.model.geometry.drawn_shapes import link_shapes
from dynx.model.geometry.links import Colour
from dynx.spatial.scalar import Floats
from dynx.spatial.se3 import homogeneous
from dynx.spatial.so3 import rotation_from_rpy
from dynx.steppers.camera import Camera, DrawnShape
from dynx.viewer.browser import standalone
from dynx.viewer.colours import ORANGE, SKY_BLUE
from dynx.viewer.drawn_robot import GHOST_OPACITY, size_of
from dynx.viewer.framing import (
    SHARE,
    VIEW_DIRECTION,
    box_around,
    fitted_view,
    ground_height,
    has_ground,
    points_around,
    tile_for,
)
from dynx.viewer.lettering import length_text, write_caption, write_words
from dynx.viewer.motion import MotionFrames
from dynx.viewer.node_shapes import NodeShapes
from dynx.viewer.page import Page
from dynx.world.camera import cast_rays_smoothly, png_bytes
from dynx.world.scenery import DARK, LIGHT, SUBTILES, TILE, Scenery

PICTURES_PER_SECOND = 12.5
"""Rate of the pictures of a film, nearly: the motion is a whole number of them."""

MAX_PICTURES = 500
"""Largest number of pictures of a film; a longer motion has fewer a second."""

SIZE = (480, 360)
"""Width and height of a picture of a film [pixels]."""

_OPAQUE_ORANGE: Colour = (ORANGE[0] / 255.0, ORANGE[1] / 255.0, ORANGE[2] / 255.0, 1.0)

_STICK_RADIUS = 0.015
"""Radius of the sticks of a robot without shapes, as a share of its size."""

Progress = Callable[[int], object]
"""Called with the number of pictures that are drawn."""

CLEAR_SKY_BLUE: Colour = (SKY_BLUE[0] / 255.0, SKY_BLUE[1] / 255.0, SKY_BLUE[2] / 255.0, GHOST_OPACITY)

NodesAt = Callable[[float, Camera], NodeShapes]
"""Function of a time [s] after the start and a camera, which returns the marks and texts that it sees."""


def _no_nodes(time: float, camera: Camera) -> NodeShapes:
    return NodeShapes()


class Stage(NamedTuple):
    """The camera of a picture, and what is around its motions."""

    camera: Camera
    scenery: Scenery = LIGHT
    tile: float = TILE
    """Edge of the tiles of the ground [m]."""
    floor: float | None = None
    """Height [m] of a ground that is added; None for motions with a ground of their own."""
    caption: str = ""
    """Text in the corner."""
    opacities: Mapping[str, float] = {}
    """Factors of the opacity of the parts of the first motion; 0 for one that is hidden."""


def stage_for(
    motion: MotionFrames,
    size: tuple[int, int] = SIZE,
    *,
    dark: bool = False,
    camera: Camera | None = None,
    direction: Floats = VIEW_DIRECTION,
    time: float | None = None,
    ghost: MotionFrames | None = None,
) -> Stage:
    """Return a stage whose camera sees a motion from a direction (3,), by default that in which the page
    begins, or a stage for the `camera` given.

    With a `time` [s] it sees only what moves at that time, in the motion and in a second one, the `ghost`,
    which the caption names."""
    whole_low, _ = box_around(motion.poses, motion.bodies, motion.robots)
    low, high = box_around(_seen(motion, time), motion.bodies, motion.robots)
    if camera is None:
        motions = [motion] if ghost is None or time is None else [motion, ghost]
        points = np.concatenate(
            [points_around(_seen(each, time), each.bodies, each.robots) for each in motions]
        )
        upward = SHARE * math.tan(0.5 * Camera.field_of_view)
        eye, target = fitted_view(points, upward * size[0] / size[1], upward, direction)
        camera = Camera.look_at(eye, target, size=size)
    floor = None if has_ground(motion.bodies) else ground_height(whole_low, motion.robots)
    tile = tile_for(low, high)
    caption = f"tiles: {length_text(tile)} and {length_text(tile / SUBTILES)}"
    if ghost is not None:
        caption = f"solid: {motion.name}, blue: {ghost.name}; {caption}"
    return Stage(camera, DARK if dark else LIGHT, tile, floor, caption)


def _seen(motion: MotionFrames, time: float | None) -> Mapping[str, Floats]:
    """Return the poses (n, 4, 4) of the parts of a motion, or those (1, 4, 4) at a time [s]."""
    if time is None:
        return motion.poses
    return {name: T[None] for name, T in motion.at(motion.frame_at(time)).items()}


def picture_of(
    motions: tuple[MotionFrames, ...], time: float, stage: Stage, beside: NodeShapes | None = None
) -> NDArray[np.uint8]:
    """Return colours (height, width, 3) of motions at a time [s], with what is seen `beside` their parts; all
    but the first motion are see-through, sky blue, and without a shadow."""
    solid: list[DrawnShape] = []
    clear: list[DrawnShape] = []
    ghosts: list[DrawnShape] = []
    for number, motion in enumerate(motions):
        poses = motion.at(motion.frame_at(time))
        for part, shape, rgba, T in shapes_of(motion):
            if number > 0 and part not in poses:
                continue
            rgba = stage.scenery.own_colour(shape, rgba)
            opacity = rgba[3] * stage.opacities.get(part, 1.0)
            seen = (rgba[0], rgba[1], rgba[2], opacity) if number == 0 else CLEAR_SKY_BLUE
            if opacity > 0.0:
                drawn = DrawnShape(0, shape, seen, poses.get(part, np.eye(4)) @ T, painted=number == 0)
                (ghosts if number > 0 else solid if seen[3] >= 1.0 else clear).append(drawn)
    if stage.floor is not None:
        T_floor = homogeneous(np.eye(3), np.array([0.0, 0.0, stage.floor]))
        solid.append(DrawnShape(0, Plane(), (*stage.scenery.ground, 1.0), np.asarray(T_floor)))
    camera, beside = stage.camera, beside or NodeShapes()
    ghosts += beside.shapes
    drawing = cast_rays_smoothly(
        solid,
        camera.pose.matrix,
        camera,
        stage.scenery,
        stage.tile,
        ghosts=ghosts,
        veils=clear,
        seen_through=beside.axes,
    )
    rgb = drawing.rgb.reshape(camera.size[1], camera.size[0], 3)
    rgb = write_words(rgb, beside.words, camera)
    return write_caption(rgb, "; ".join([stage.caption, *beside.legends])) if stage.caption else rgb


def write_picture(path: str | os.PathLike[str], rgb: NDArray[np.uint8]) -> None:
    """Write colours (height, width, 3) as a PNG file."""
    write_bytes(path, png_bytes(rgb))


def film_length(motions: tuple[MotionFrames, ...], fps: float | None = None) -> int:
    """Return the number of pictures of the film of motions that begin together, with about `fps` pictures a
    second, or at most `MAX_PICTURES` for None."""
    if fps is not None:
        return max(1, round(_duration(motions) * fps))
    return min(MAX_PICTURES, max(1, round(_duration(motions) * PICTURES_PER_SECOND)))


def write_film(
    path: str | os.PathLike[str],
    motions: tuple[MotionFrames, ...],
    progress: Progress = lambda _: None,
    *,
    dark: bool = False,
    stage: Stage | None = None,
    nodes_at: NodesAt = _no_nodes,
    fps: float | None = None,
) -> None:
    """Write motions as a film that lasts as long as the longest, by the suffix of the file (`.gif`, which
    begins again, or `.mp4`), with the pictures of `film_length`. Raises the errors of `write_pictures`."""
    first, count = motions[0], film_length(motions, fps)
    stage = stage or stage_for(first, dark=dark)
    # A film of next to no time is one picture, which has to be seen.
    period = max(_duration(motions) / count, 0.5 / PICTURES_PER_SECOND)

    def pictures() -> Iterator[NDArray[np.uint8]]:
        for k in range(count):
            yield picture_of(
                motions, float(first.t[0]) + k * period, stage, nodes_at(k * period, stage.camera)
            )
            progress(k + 1)

    write_pictures(path, pictures(), period)


def _duration(motions: tuple[MotionFrames, ...]) -> float:
    return float(max(each.t[-1] for each in motions) - motions[0].t[0])


def shapes_of(motion: MotionFrames) -> Iterator[tuple[str, Shape, Colour, Floats]]:
    """Yield the shapes of every part with the name of the part; those of a fixed body in the world."""
    for robot, model in motion.robots.items():
        shapes = [
            (link.name, shape, rgba, T)
            for link in model.links
            for shape, rgba, T in link_shapes(model.geometry, link.name)
        ]
        for link, shape, rgba, T in shapes or _sticks(model):
            yield f"{robot}/{link}", shape, rgba, T
    for body in motion.bodies:
        pose = np.eye(4) if body.name in motion.poses else body.pose.matrix
        for shape, rgba, T in body.drawn_shapes():
            yield body.name, shape, rgba, pose @ T


def _sticks(model: Model) -> Iterator[tuple[str, Shape, Colour, Floats]]:
    """Yield the sticks of a robot without shapes, by link: one to the frame of each of its children."""
    for joint in model.joints:
        end = joint.origin.matrix[:3, 3]
        length = float(np.linalg.norm(end))
        if length > 0.0:
            # The z axis of the stick is turned to the child.
            rpy = np.array([0.0, math.acos(end[2] / length), math.atan2(end[1], end[0])])
            T = np.asarray(homogeneous(rotation_from_rpy(rpy), 0.5 * end))
            yield joint.parent, Cylinder(_STICK_RADIUS * size_of(model), length), _OPAQUE_ORANGE, T


UPDATES_PER_SECOND = 30.0
"""Rate at which the recorded page moves."""

MAX_EMBEDDED = 5_000_000
"""Largest size of a page in a notebook [bytes]: files of notebooks are read and stored as a whole."""

LEAST_UPDATES_PER_SECOND = 7.0
"""Rate below which a motion in a notebook would be seen as single pictures."""


def recording_html(
    page: Page,
    show: Callable[[float], None],
    duration: float,
    *,
    title: str,
    legend: str = "",
    rate: float = UPDATES_PER_SECOND,
) -> str:
    """Return HTML in which the scene of the page plays as `show(time)` places it, for `duration` [s], with
    `rate` updates a second.

    A duration of 0 gives a still scene; `legend` is HTML over the corner of the picture.
    """
    with page.lock:
        show(0.0)
        recorder = page.server.get_scene_serializer()
        count = round(duration * rate)
        for k in range(1, count + 1):
            recorder.insert_sleep(duration / count)
            show(duration * k / count)
        # The last picture stays for a moment before the recording begins again.
        recorder.insert_sleep(1.0 if count else 0.0)
        text = recorder.as_html(page.dark)
    added = "".join(page.elements.values())
    return standalone(text, title, page.part_names, legend=legend, software=page.plain, elements=added)


def write_recording(
    path: str | os.PathLike[str],
    page: Page,
    show: Callable[[float], None],
    duration: float,
    *,
    title: str,
    legend: str = "",
) -> None:
    """Write the HTML of `recording_html` to a file.

    Raises ArgumentError for a file that cannot be written."""
    if not checked_path(path).lower().endswith((".html", ".htm")):
        wanted = "wanted .html (a page), .gif, .webp or .mp4 (a film) or .png (a picture)"
        raise ArgumentError(f"{shown(os.path.basename(path))} has no suffix of a page; {wanted}")
    write_bytes(path, recording_html(page, show, duration, title=title, legend=legend).encode())


@dataclass(frozen=True, repr=False)
class EmbeddedPage:
    """A page without a server, that a notebook stores, and shows where dynx is not installed."""

    title: str
    html: str
    """Text of the page."""
    height: int
    """Height in the notebook [pixels]."""

    def __repr__(self) -> str:
        return f"<EmbeddedPage of {self.title}, {len(self.html.encode()) / 1e6:.1f} MB>"

    def _repr_html_(self) -> str:
        # The text of the page is an attribute: hosts of notebooks serve no other file.
        return (
            f'<iframe srcdoc="{escape(self.html, quote=True)}" width="100%" height="{self.height}" '
            f'title="{escape(self.title, quote=True)}" style="border: 0"></iframe>'
        )


def embedded_page(
    page: Page,
    show: Callable[[float], None],
    duration: float,
    *,
    title: str,
    legend: str = "",
    height: int,
) -> EmbeddedPage:
    """Return the page of `recording_html` for a notebook, with fewer updates a second where it would be
    larger than `MAX_EMBEDDED`.

    Raises ArgumentError for a page that is larger even so.
    """
    rate = UPDATES_PER_SECOND
    while True:
        html = recording_html(page, show, duration, title=title, legend=legend, rate=rate)
        made = EmbeddedPage(title, html, height)
        size = len(made._repr_html_().encode())
        if size <= MAX_EMBEDDED:
            return made
        rate *= 0.5
        if duration == 0.0 or rate < LEAST_UPDATES_PER_SECOND:
            remedy = "" if page.plain else "whole_meshes=False makes meshes smaller; "
            raise ArgumentError(
                f"the page has {size / 1e6:.1f} MB; a notebook takes at most {MAX_EMBEDDED / 1e6:g} MB: "
                f"{remedy}show a part of the motion, or export it to a file"
            )
