"""Copies of one robot on the page, each at a configuration of its own, which the program moves together."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dynx.errors import ArgumentError
from dynx.model import Model
from dynx.model.configuration import checked_q
from dynx.spatial.scalar import Floats
from dynx.viewer.drawn_robot import AS_DESCRIBED, DrawnScene, Look, size_of
from dynx.viewer.following import FollowingCamera
from dynx.viewer.framing import SHARE, box_around, ground_height, points_around
from dynx.viewer.marks import NamedParts
from dynx.viewer.motion import MotionFrames, motion_of_copies
from dynx.viewer.page import Page


class CopiesView:
    """n robots with one description, at the configurations q (n, nq)."""

    def __init__(
        self,
        page: Page,
        model: Model,
        q: Floats,
        *,
        spacing: float = 0.0,
        look: Look = AS_DESCRIBED,
        collisions: bool = False,
    ) -> None:
        """The robots stand on a square grid with a `spacing` [m], or where q has them; `collisions` are shown
        at once."""
        self._page, self.model, self._spacing = page, model, spacing
        self.q = self._checked(q)
        """The configurations that are shown (n, nq)."""
        motion = self._motion(self.q)
        with page.together():
            self.drawn = DrawnScene(page.scene, "/motion", motion.robots, (), look)
            self.drawn.place(motion.at(0))
        self.notes = self.drawn.faults
        """Shapes that cannot be drawn, one sentence each."""
        with page.gui.add_folder("show"):
            box = page.gui.add_checkbox("collision shapes", initial_value=collisions)
        self.switches = {"collision shapes": box}
        """The boxes that show and hide something, by what they show."""
        box.on_update(lambda _: self._show_shapes())
        self._show_shapes()
        self.camera = FollowingCamera(page, self.drawn)
        """The camera of the page."""
        self.names = NamedParts(page, self.drawn)
        """The names of the part under the pointer and of that which was clicked."""
        low, high = box_around(motion.poses, robots=motion.robots)
        size = float(np.linalg.norm(high - low)) or size_of(model)
        page.lay_ground(size, ground_height(low, motion.robots))
        page.look_at(points_around(motion.poses, robots=motion.robots), SHARE)

    legend = ""
    """Empty: robots that stand need none."""

    shows_both = False
    """Collision shapes are shown instead of visual ones."""

    time = 0.0
    """Zero: the robots stand still."""

    duration: float | None = 0.0
    """Zero: the robots stand still."""

    @property
    def title(self) -> str:
        """Number and name of the robots."""
        return f"{len(self.q)} {self.model.name}"

    @property
    def visuals(self) -> Mapping[str, Sequence[Any]]:
        """The visual shapes of each part."""
        return self.drawn.visuals

    @property
    def motions(self) -> tuple[MotionFrames, ...]:
        """The robots as they stand."""
        return (self._motion(self.q, self.drawn.seen_models),)

    def go_to(self, time: float) -> None:
        """Show the robots as they stand."""

    def put(self, q: ArrayLike) -> None:
        """Show configurations (n, nq) of all robots. Raises ArgumentError for another number of them."""
        checked = self._checked(q)
        if len(checked) != len(self.q):
            raise ArgumentError(f"q has {len(checked)} rows; wanted {len(self.q)}, one for each robot")
        with self._page.lock, self._page.together():
            self.q = checked
            self.drawn.place(self._motion(checked).at(0))

    def _checked(self, q: ArrayLike) -> Floats:
        checked = checked_q(self.model, q, "q")
        if checked.ndim != 2 or not len(checked):
            raise ArgumentError(
                f"q has shape {checked.shape}; wanted (n, {self.model.nq}), a row for each robot"
            )
        return checked

    def _motion(self, q: Floats, robots: Mapping[str, Model] = {}) -> MotionFrames:
        return motion_of_copies(self.model, np.zeros(1), q[:, None], self._spacing, robots)

    def _show_shapes(self) -> None:
        colliding = self.switches["collision shapes"].value
        with self._page.lock, self._page.together():
            self.drawn.show(visuals=not colliding, collisions=colliding)
