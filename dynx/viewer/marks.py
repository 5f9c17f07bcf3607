"""Marks on the links of a robot: frames, joint axes, names, centres of mass and inertia."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from dynx.model import Model
from dynx.model.elements import Inertial
from dynx.model.geometry import Box, Sphere
from dynx.spatial.scalar import Floats
from dynx.viewer.browser.client import names_element
from dynx.viewer.colours import BLUE, RGB, SKY_BLUE, VERMILION, YELLOW
from dynx.viewer.drawn_parts import wxyz
from dynx.viewer.drawn_robot import DrawnRobot, size_of
from dynx.viewer.name_labels import NameLabels, centre_of
from dynx.viewer.page import Page
from dynx.viewer.surfaces.triangles import triangles_of

INERTIA_OPACITY = 0.45


class EquivalentSolid(NamedTuple):
    """A solid of uniform density with the mass and the inertia of a link."""

    lengths: Floats
    """Edges of a box or diameters of an ellipsoid (3,) [m], along the principal axes."""
    R: Floats
    """Principal axes (3, 3) as columns, in the frame of the link."""
    possible: bool
    """False where no body has these moments: one exceeds the sum of the other two, or is negative."""


def equivalent_solid(inertial: Inertial, moment_factor: float) -> EquivalentSolid:
    """Return the solid whose moment about each axis is ``mass (a^2 + b^2) / moment_factor``.

    The factor is 12 for the edges a, b of a box, and 20 for the diameters of an ellipsoid. A negative square
    counts as zero.
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
            length = 0.08 * self._size
            yield self._scene.add_frame(f"{node.name}/axes", axes_length=length, axes_radius=0.05 * length)

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


class NamedParts:
    """The names of parts: that under the pointer, and that of at most one part that was clicked, which stays
    on it and moves with it."""

    def __init__(self, page: Page, parts: Mapping[str, Any], visuals: Mapping[str, Sequence[Any]]) -> None:
        """`parts` are the nodes of parts, below which all their shapes lie, and `visuals` those of the shapes
        that are clicked."""
        self._page, self._parts, self._visuals = page, parts, visuals
        self._label: Any = None
        self.shown: str | None = None
        """The part whose name stays."""
        page.part_names = {node.name: name for name, node in parts.items()}
        self._names = page.gui.add_html(names_element(page.part_names), order=math.inf)
        for name, nodes in visuals.items():
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
                place = centre_of(self._visuals[part])
                self._label = self._page.scene.add_label(
                    f"{self._parts[part].name}/name", part, position=place
                )

    def remove(self) -> None:
        """Remove the names from the page."""
        self.show(None)
        self._names.remove()
