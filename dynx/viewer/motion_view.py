"""Recorded motions on the page: one with its reference, or two laid over each other, with a timeline."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape
from typing import Any, NamedTuple

import numpy as np

from dynx.spatial.scalar import Floats
from dynx.viewer.colours import BLUE, SKY_BLUE, css
from dynx.viewer.drawn_robot import AS_DESCRIBED, GHOST_OPACITY, GHOST_SIZE, Look
from dynx.viewer.drawn_scene import ContactArrows, DrawnScene
from dynx.viewer.following_camera import FollowingCamera
from dynx.viewer.framing import box_around, has_ground
from dynx.viewer.marks import NamedParts
from dynx.viewer.motion import PARTED, Motion, motion_separation
from dynx.viewer.page import Page
from dynx.viewer.timeline import Curves, Timeline

_NO_PART = "none"

_SHARE = 0.8
"""Share of the picture that the motion takes at the start."""

_LONGEST_ARROW = 0.3
"""Length of the largest contact force, as a share of the size of the motion."""


class Series(NamedTuple):
    """Values (n, m) of m quantities over times (n,) [s], for a plot."""

    title: str
    t: Floats
    values: Floats
    names: Sequence[str]


class MotionView:
    """A motion, solid, and possibly a second one, see-through in one colour, on one timeline."""

    def __init__(
        self,
        page: Page,
        motion: Motion,
        ghost: Motion | None = None,
        *,
        curves: Sequence[Series] = (),
        look: Look = AS_DESCRIBED,
        compare: bool = False,
        play: bool = False,
        title: str = "",
        notes: Sequence[str] = (),
    ) -> None:
        """With `compare` the distance between the two motions is drawn below, and a button jumps to where
        they part; otherwise the second is a reference, which can be hidden."""
        self._page, self.motion, self.ghost = page, motion, ghost
        self.title = title or motion.name
        """Name of what is shown."""
        self._start = float(motion.t[0])
        low, high = box_around(motion.poses, motion.bodies, motion.robots)
        self._size = float(np.linalg.norm(high - low)) or 0.3
        if not has_ground(motion.bodies):
            page.add_ground(self._size)
        with page.together():
            self.drawn = DrawnScene(page.scene, "/motion", motion.robots, motion.bodies, look)
            self._ghost_drawn = None if ghost is None else self._draw_ghost(ghost, look)
        self.notes = (*notes, *self.drawn.faults)
        """`notes` of the motions, and shapes that cannot be drawn, one sentence each."""
        largest = max(
            (float(np.linalg.norm(a.forces, axis=1).max(initial=0.0)) for a in motion.contacts), default=0.0
        )
        self._arrows = ContactArrows(
            page.scene, _LONGEST_ARROW * self._size / (largest or 1.0), 0.006 * self._size
        )
        self.legend = _legend(motion.name, ghost.name) if compare and ghost is not None else ""
        """HTML that says which of two motions is solid; empty without `compare`."""
        self._trace: Any = None
        self._curves: list[Curves] = []
        self._add_switches(compare=compare)
        step = float(np.median(np.diff(motion.t))) if len(motion.t) > 1 else 1e-3
        self.timeline = Timeline(page, self.duration, step, self._show, play=play)
        self._add_curves(curves, step, compare=compare)
        self.camera = FollowingCamera(page, self.drawn)
        """The camera of the page."""
        self.names = NamedParts(page, self.drawn.parts, self.drawn.visuals)
        """The names of the part under the pointer and of that which was clicked."""
        page.look_at(low, high, _SHARE)

    @property
    def motions(self) -> tuple[Motion, ...]:
        """The motions that are shown at present."""
        seen = self.ghost is not None and self._ghost_drawn is not None and self._ghost_drawn.visible
        return (self.motion, self.ghost) if seen and self.ghost is not None else (self.motion,)

    @property
    def visuals(self) -> Mapping[str, Sequence[Any]]:
        """The nodes of the visual shapes of each part of the first motion."""
        return self.drawn.visuals

    @property
    def time(self) -> float:
        """The time of the motions that is shown [s]."""
        return self._start + self.timeline.time

    @property
    def duration(self) -> float:
        """Length of the longer motion [s]; the other one stays where it ends."""
        both = [self.motion] if self.ghost is None else [self.motion, self.ghost]
        return max(float(each.t[-1]) for each in both) - self._start

    def go_to(self, time: float) -> None:
        """Show the motions at a time after their start [s]."""
        self.timeline.go_to(time)

    def _draw_ghost(self, ghost: Motion, look: Look) -> DrawnScene:
        # What never moves is the same in both.
        moving = [body for body in ghost.bodies if body.name in ghost.poses]
        seen_through = look._replace(colour=SKY_BLUE, opacity=GHOST_OPACITY, size=GHOST_SIZE)
        return DrawnScene(self._page.scene, "/second", ghost.robots, moving, seen_through)

    def _show(self, time: float) -> None:
        now = time + self._start
        k = self.motion.frame_at(now)
        self.drawn.place(self.motion.at(k))
        if self.ghost is not None and self._ghost_drawn is not None and self._ghost_drawn.visible:
            moved = self.ghost.at(self.ghost.frame_at(now))
            self._ghost_drawn.place({n: T for n, T in moved.items() if n in self._ghost_drawn.parts})
        if self.motion.contacts:
            self._arrows.put(*self.motion.contacts[k])
        for curves in self._curves:
            curves.put(now, at_once=not self.timeline.playing)

    # -- controls -----------------------------------------------------------------------------

    def _add_switches(self, *, compare: bool) -> None:
        gui = self._page.gui
        with gui.add_folder("show"):
            if self.legend:
                gui.add_html(self.legend)
            collisions = gui.add_checkbox("collision shapes", initial_value=False)
            ghost = None
            if self.ghost is not None:
                ghost = gui.add_checkbox("second motion" if compare else "reference", initial_value=compare)
            forces = (
                gui.add_checkbox("contact forces", True)
                if any(len(a.points) for a in self.motion.contacts)
                else None
            )
            trace = gui.add_dropdown("trace of", (_NO_PART, *self.motion.poses), initial_value=_NO_PART)

        def show(_: Any = None) -> None:
            with self._page.lock, self._page.together():
                self.drawn.show(visuals=not collisions.value, collisions=collisions.value)
                if ghost is not None and self._ghost_drawn is not None:
                    self._ghost_drawn.visible = ghost.value
                if forces is not None:
                    self._arrows.shown = forces.value
                self._show(self.timeline.time)

        def draw_trace(_: Any) -> None:
            with self._page.lock, self._page.together():
                if self._trace is not None:
                    self._trace.remove()
                    self._trace = None
                if trace.value != _NO_PART:
                    self._trace = self._line(self.motion.poses[trace.value][:, :3, 3])

        for box in (collisions, ghost, forces):
            if box is not None:
                box.on_update(show)
        trace.on_update(draw_trace)
        if self._ghost_drawn is not None:
            self._ghost_drawn.visible = compare

    def _line(self, points: Floats) -> Any:
        return self._page.scene.add_line_segments(
            "/trace",
            np.stack([points[:-1], points[1:]], axis=1).astype(np.float32),
            BLUE,
            thickness=0.006 * self._size,
        )

    def _jump_to(self, time: float) -> None:
        self.timeline.pause()
        self.timeline.go_to(time)

    def _add_curves(self, curves: Sequence[Series], step: float, *, compare: bool) -> None:
        gui = self._page.gui
        if compare and self.ghost is not None:
            apart = motion_separation(self.motion, self.ghost)
            parted = apart.first_beyond(PARTED)
            with gui.add_folder("difference"):
                text = "never more than"
                if parted is not None:
                    time, part = parted
                    text = f"from {time:.4g} s, {part} by more than"
                    jump = gui.add_button("jump to where they part")
                    jump.on_click(lambda _: self._jump_to(time - self._start))
                gui.add_text("they part", f"{text} {1e3 * PARTED:g} mm", multiline=True, disabled=True)
                ends = {each.name: float(each.t[-1]) for each in (self.motion, self.ghost)}
                shorter = min(ends, key=lambda name: ends[name])
                if ends[shorter] < max(ends.values()) - step:
                    gui.add_text(
                        "compared", f"until {ends[shorter]:.4g} s, where {shorter} ends", disabled=True
                    )
                self._curves.append(
                    Curves(
                        self._page,
                        "distance [m]",
                        apart.times,
                        apart.distance[:, None],
                        ["largest distance"],
                        (float(self.motion.t[0]), float(self.motion.t[-1])),
                    )
                )
        # There is one torque fewer than there are states; the axes of all curves are alike.
        span = (self._start, self._start + self.duration)
        for each in curves:
            with gui.add_folder(each.title, expand_by_default=False):
                self._curves.append(Curves(self._page, each.title, each.t, each.values, each.names, span))


def _legend(solid: str, ghost: str) -> str:
    return (
        "<p style='margin: 0.2em 0.8em; font-size: 0.8em; overflow-wrap: anywhere'>"
        f"solid: {escape(solid)}<br><b style='color: {css(SKY_BLUE)}'>&#9632;</b> see-through: "
        f"{escape(ghost)}</p>"
    )
