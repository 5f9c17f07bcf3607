"""Recorded motions on the page: one with its reference, or two laid over each other, with a timeline."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from html import escape
from typing import Any, NamedTuple

import numpy as np

from dynx.spatial.scalar import Floats
from dynx.viewer.colours import BLUE, DASHES, SERIES, SKY_BLUE, css
from dynx.viewer.controls import slider_step
from dynx.viewer.drawn_robot import (
    AS_DESCRIBED,
    GHOST_OPACITY,
    GHOST_SIZE,
    THICKNESS,
    ContactArrows,
    DrawnScene,
    Look,
)
from dynx.viewer.following import FollowingCamera
from dynx.viewer.framing import SHARE, box_around, has_ground, points_around
from dynx.viewer.library import uplot
from dynx.viewer.marks import NamedParts, SceneMarks
from dynx.viewer.motion import PARTED, MotionFrames, motion_separation
from dynx.viewer.page import Page
from dynx.viewer.play_control import SPEEDS, PlayControl, speed_factor

UPDATES_PER_SECOND = 40.0
"""Rate at which the page is moved while a motion plays; 30 arrive where the machine is busy."""

SLIDER_UPDATES_PER_SECOND = 10.0
"""Largest rate at which the slider moves while a motion plays: the page lays out its panel anew each time."""


class Timeline(PlayControl):
    """The controls of the time, and the thread that plays."""

    def __init__(
        self, page: Page, end: float, step: float, show: Callable[[float], None], *, play: bool = False
    ) -> None:
        """`show(time)` shows the motion at a time from 0 to `end` [s]; `step` [s] is that of two buttons."""
        self._page, self._end, self._step, self._show = page, max(end, 1e-9), step, show
        self._ended = page.ended
        self._time = 0.0
        super().__init__()
        gui = page.gui
        with gui.add_folder("time"):
            self._slider = gui.add_slider(
                "time [s]", 0.0, self._end, step=slider_step(0.0, self._end), initial_value=0.0
            )
            self.add_play_button(page)
            back, forward = gui.add_button("step back"), gui.add_button("step forward")
            self._speed = gui.add_dropdown("speed", SPEEDS, initial_value="1")
            self._loop = gui.add_checkbox("loop", initial_value=False)
        self._slider.on_update(self._scrubbed)
        back.on_click(lambda _: self._move(-self._step))
        forward.on_click(lambda _: self._move(self._step))
        page.at_end(self._running.set)
        self._thread = threading.Thread(target=self._play, name="dynx timeline", daemon=True)
        self.go_to(0.0)
        self._thread.start()
        if play:
            self.play()

    @property
    def time(self) -> float:
        """The time that is shown [s]."""
        return self._time

    def play(self) -> None:
        """Play on; from the start if the motion is at its end."""
        if self._time >= self._end:
            self.go_to(0.0)
        super().play()

    def pause(self) -> None:
        """Stop playing."""
        super().pause()
        self._slider.value = self._time

    def go_to(self, time: float) -> None:
        """Show the motion at a time [s], moved into its range."""
        self._place(time, slider=True)

    def _place(self, time: float, *, slider: bool) -> None:
        with self._page.lock, self._page.together():
            if self._ended.is_set():
                return
            self._time = min(max(time, 0.0), self._end)
            if slider:
                self._slider.value = self._time
            self._show(self._time)

    def _move(self, by: float) -> None:
        self.pause()
        self.go_to(self._time + by)

    def _scrubbed(self, event: Any) -> None:
        if event.client is None:  # Moved by `go_to`, not in the page.
            return
        with self._page.lock, self._page.together():
            self._time = float(self._slider.value)
            self._show(self._time)

    def _play(self) -> None:
        period = 1.0 / UPDATES_PER_SECOND
        while not self._ended.is_set():
            self._running.wait()
            if self._ended.is_set():
                return
            began, start, speed = time.monotonic(), self._time, self._speed.value
            moved = -math.inf
            while self._running.is_set() and self._speed.value == speed:
                wanted = start + (time.monotonic() - began) * speed_factor(speed)
                if wanted >= self._end:
                    self.go_to(self._end)
                    if self._loop.value:
                        self.go_to(0.0)
                    else:
                        self.pause()
                    break
                now = time.monotonic()
                slider = now - moved >= 1.0 / SLIDER_UPDATES_PER_SECOND
                moved = now if slider else moved
                self._place(wanted, slider=slider)
                # The next multiple of the period, whatever this update took.
                if self._ended.wait(period - (time.monotonic() - began) % period):
                    return
                if self._time != wanted:  # Scrubbed meanwhile: go on from there.
                    break


MAX_POINTS = 400
"""Largest number of points of a curve."""

CURVE_UPDATES_PER_SECOND = 5.0
"""Largest rate at which curves are redrawn while a motion plays."""

VALUES_PER_SECOND = 20_000.0
"""Largest number of values of one plot that are sent a second while a motion plays."""

_SMALL = 0.05
"""Values below which a plot shows a power of ten: the numbers at its axis have three decimals."""
_NOTHING = 1e-12
"""Values below which they count as zero."""

_PADDING = (8, 16, 0, 0)
"""Space above, right of, below and left of a plot for half of a number at the end of an axis [pixels]."""

_LARGEST_LEGEND = 7
"""Number of curves up to which the legend is shown; of more, one can be chosen."""

_ALL = "(all)"


class Curves:
    """Some quantities over time; what comes after the time that is shown is left out.

    The legend of many curves would be higher than the plot, so that one of them is chosen by its name.
    """

    def __init__(
        self,
        page: Page,
        title: str,
        t: Floats,
        values: Floats,
        names: Sequence[str],
        span: tuple[float, float] | None = None,
    ) -> None:
        """`values` (n, m) are those of m quantities `names` at the times t (n,) [s].

        The axis of time covers the times `span` [s]; by default from the first to the last of t.
        """
        picked = np.unique(np.linspace(0, len(t) - 1, min(len(t), MAX_POINTS)).round().astype(int))
        self._t, self._values = np.ascontiguousarray(t[picked]), np.array(values[picked], dtype=np.float64)
        self._span = span or (float(self._t[0]), float(self._t[-1]))
        self._drawn_at = -math.inf
        self._period = max(1.0 / CURVE_UPDATES_PER_SECOND, self._values.size / VALUES_PER_SECOND)
        power = _power(self._values)
        if power:
            self._values *= 10.0**power
            title = f"{title} x 1e-{power}"
        self._page, self._names = page, tuple(names)
        self._picked = range(len(names))
        self._shown = len(self._t)
        if len(names) > _LARGEST_LEGEND:
            choice = page.gui.add_dropdown("curve", (_ALL, *names), initial_value=_ALL)
            choice.on_update(lambda _: self._pick(choice.value))
        self._plot = page.gui.add_uplot(
            self._data(),
            series=self._series(),
            title=title,
            scales=self._scales(),
            legend=self._legend(),
            aspect=1.6,
            padding=_PADDING,
        )

    def put(self, now: float, *, at_once: bool = False) -> None:
        """Draw the curves up to the time `now` [s]; not more often than the page can follow, or `at_once`."""
        clock = time.monotonic()
        if not at_once and clock - self._drawn_at < self._period:
            return
        self._drawn_at = clock
        self._shown = int(np.searchsorted(self._t, now + 1e-9, side="right"))
        self._plot.data = self._data()

    def _pick(self, name: str) -> None:
        """Draw the curve of that name alone, in its colour, or all."""
        k = self._names.index(name) if name != _ALL else None
        self._picked = range(len(self._names)) if k is None else range(k, k + 1)
        with self._page.lock, self._page.together():
            self._plot.data, self._plot.series = self._data(), self._series()
            self._plot.scales, self._plot.legend = self._scales(), self._legend()

    def _data(self) -> tuple[Floats, ...]:
        shown = self._values[:, self._picked]
        shown[self._shown :] = np.nan
        return (self._t, *(np.ascontiguousarray(column) for column in shown.T))

    def _series(self) -> tuple[Any, ...]:
        return (uplot.Series(label="t"), *(_series(k, self._names[k]) for k in self._picked))

    def _scales(self) -> dict[str, Any]:
        """Return the ranges of both axes: those of the whole motion, so that they stay while it plays."""
        values = self._values[:, self._picked]
        finite = values[np.isfinite(values)]
        low, high = (float(finite.min()), float(finite.max())) if finite.size else (0.0, 1.0)
        margin = 0.05 * (high - low) or max(abs(high), 1.0) * 0.05
        return {
            "x": uplot.Scale(time=False, auto=False, range=self._span),
            "y": uplot.Scale(range=(low - margin, high + margin)),
        }

    def _legend(self) -> Any:
        return uplot.Legend(show=len(self._picked) <= _LARGEST_LEGEND)


def _power(values: Floats) -> int:
    """Return the power of ten by which values are multiplied, so that three decimals show them."""
    finite = values[np.isfinite(values)]
    largest = float(np.abs(finite).max(initial=0.0))
    if largest >= _SMALL or largest < _NOTHING:
        return 0
    return 3 * math.ceil(-math.log10(largest) / 3.0)


def _series(k: int, name: str) -> Any:
    """Return the look of the curve with the number k."""
    stroke, (look, dashes) = css(SERIES[k % len(SERIES)]), DASHES[k // len(SERIES) % len(DASHES)]
    if dashes is None:
        return uplot.Series(label=name, stroke=stroke, width=2, pxAlign=False)
    # The legend shows only the colour.
    return uplot.Series(label=f"{name} ({look})", stroke=stroke, width=2, dash=dashes, pxAlign=False)


_NO_PART = "none"

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
        motion: MotionFrames,
        ghost: MotionFrames | None = None,
        *,
        curves: Sequence[Series] = (),
        look: Look = AS_DESCRIBED,
        compare: bool = False,
        play: bool = False,
        collisions: bool = False,
        title: str = "",
        notes: Sequence[str] = (),
    ) -> None:
        """With `compare` the distance between the two motions is drawn below, and a button jumps to where
        they part; otherwise the second is a reference, which can be hidden. `collisions` are shown at
        once."""
        self._page, self.motion, self.ghost = page, motion, ghost
        self.title = title or motion.name
        """Name of what is shown."""
        self._start = float(motion.t[0])
        low, high = box_around(motion.poses, motion.bodies, motion.robots)
        self._size = float(np.linalg.norm(high - low)) or 0.3
        page.lay_ground(self._size, None if has_ground(motion.bodies) else 0.0)
        with page.together():
            self.drawn = DrawnScene(page.scene, "/motion", motion.robots, motion.bodies, look)
            self._ghost_drawn = None if ghost is None else self._draw_ghost(ghost, look)
        self.notes = (*notes, *self.drawn.faults)
        """`notes` of the motions, and shapes that cannot be drawn, one sentence each."""
        largest = max(
            (float(np.linalg.norm(a.forces, axis=1).max(initial=0.0)) for a in motion.contacts), default=0.0
        )
        self._arrows = ContactArrows(
            page.scene, _LONGEST_ARROW * self._size / (largest or 1.0), THICKNESS * self._size
        )
        self.legend = _legend(motion.name, ghost.name) if compare and ghost is not None else ""
        """HTML that says which of two motions is solid; empty without `compare`."""
        self._trace: Any = None
        self._curves: list[Curves] = []
        self._add_switches(compare=compare, collisions_first=collisions)
        step = float(np.median(np.diff(motion.t))) if len(motion.t) > 1 else 1e-3
        self.timeline = Timeline(page, self.duration, step, self._show, play=play)
        self._add_curves(curves, step, compare=compare)
        self.camera = FollowingCamera(page, self.drawn)
        """The camera of the page."""
        self.names = NamedParts(page, self.drawn)
        """The names of the part under the pointer and of that which was clicked."""
        page.look_at(points_around(motion.poses, motion.bodies, motion.robots), SHARE)

    shows_both = False
    """Collision shapes are shown instead of visual ones."""

    @property
    def motions(self) -> tuple[MotionFrames, ...]:
        """The motions that are shown at present."""
        seen = self.ghost is not None and self._ghost_drawn is not None and self._ghost_drawn.visible
        first = replace(self.motion, robots=self.drawn.seen_models)
        return (first, self.ghost) if seen and self.ghost is not None else (first,)

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

    def _draw_ghost(self, ghost: MotionFrames, look: Look) -> DrawnScene:
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

    def _add_switches(self, *, compare: bool, collisions_first: bool) -> None:
        gui = self._page.gui
        with gui.add_folder("show"):
            if self.legend:
                gui.add_html(self.legend)
            collisions = gui.add_checkbox("collision shapes", initial_value=collisions_first)
            ghost = None
            if self.ghost is not None:
                ghost = gui.add_checkbox("second motion" if compare else "reference", initial_value=compare)
            forces = (
                gui.add_checkbox("contact forces", True)
                if any(len(a.points) for a in self.motion.contacts)
                else None
            )
            points = None if forces is None else gui.add_checkbox("contact points", initial_value=False)
            numbers = None if forces is None else gui.add_checkbox("force numbers", initial_value=False)
            self._marks = SceneMarks(self._page, self.drawn)
            marks = self._marks.add_switches()
            trace = gui.add_dropdown(
                "trace of",
                (_NO_PART, *(part for part in self.drawn.listed if part in self.motion.poses)),
                initial_value=_NO_PART,
            )

        def show(_: Any = None) -> None:
            with self._page.lock, self._page.together():
                self.drawn.show(visuals=not collisions.value, collisions=collisions.value)
                if ghost is not None and self._ghost_drawn is not None:
                    self._ghost_drawn.visible = ghost.value
                if forces is not None and points is not None and numbers is not None:
                    self._arrows.shown, self._arrows.points_shown = forces.value, points.value
                    self._arrows.numbers_shown = numbers.value
                self._show(self.timeline.time)

        def draw_trace(_: Any) -> None:
            with self._page.lock, self._page.together():
                if self._trace is not None:
                    self._trace.remove()
                    self._trace = None
                if trace.value != _NO_PART:
                    self._trace = self._line(self.motion.poses[trace.value][:, :3, 3])

        boxes = {
            "collision shapes": collisions,
            "second motion" if compare else "reference": ghost,
            "contact forces": forces,
            "contact points": points,
            "force numbers": numbers,
        }
        self.switches = {name: box for name, box in boxes.items() if box is not None}
        for box in self.switches.values():
            box.on_update(show)
        self.switches |= marks
        trace.on_update(draw_trace)
        if self._ghost_drawn is not None:
            self._ghost_drawn.visible = compare
        self.drawn.show(visuals=not collisions.value, collisions=collisions.value)

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
            if not each.names:
                continue
            with gui.add_folder(each.title, expand_by_default=False):
                self._curves.append(Curves(self._page, each.title, each.t, each.values, each.names, span))


def _legend(solid: str, ghost: str) -> str:
    return (
        "<p style='margin: 0.2em 0.8em; font-size: 0.8em; overflow-wrap: anywhere'>"
        f"solid: {escape(solid)}<br><b style='color: {css(SKY_BLUE)}'>&#9632;</b> see-through: "
        f"{escape(ghost)}</p>"
    )
