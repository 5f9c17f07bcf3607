"""The timeline of a motion: play, pause, step, speed, loop, and a slider to scrub."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable
from typing import Any

from dynx.viewer.controls import slider_step
from dynx.viewer.page import Page

UPDATES_PER_SECOND = 40.0
"""Rate at which the page is moved while a motion plays; 30 arrive where the machine is busy."""

SLIDER_UPDATES_PER_SECOND = 10.0
"""Largest rate at which the slider moves while a motion plays: the page lays out its panel anew each time."""

SPEEDS = ("1/10", "1/4", "1/2", "1", "2", "4")
"""Choices of the speed, relative to the clock."""


class Timeline:
    """The controls of the time, and the thread that plays."""

    def __init__(
        self, page: Page, end: float, step: float, show: Callable[[float], None], *, play: bool = False
    ) -> None:
        """`show(time)` shows the motion at a time from 0 to `end` [s]; `step` [s] is that of two buttons."""
        self._page, self._end, self._step, self._show = page, max(end, 1e-9), step, show
        self._ended = page.ended
        self._time = 0.0
        self._running = threading.Event()
        gui = page.gui
        with gui.add_folder("time"):
            self._slider = gui.add_slider(
                "time [s]", 0.0, self._end, step=slider_step(0.0, self._end), initial_value=0.0
            )
            self._button = gui.add_button("play")
            back, forward = gui.add_button("step back"), gui.add_button("step forward")
            self._speed = gui.add_dropdown("speed", SPEEDS, initial_value="1")
            self._loop = gui.add_checkbox("loop", initial_value=False)
        self._slider.on_update(self._scrubbed)
        self._button.on_click(lambda _: self.play_or_pause())
        back.on_click(lambda _: self._move(-self._step))
        forward.on_click(lambda _: self._move(self._step))
        page.on_own_key("P", "play or pause", self.play_or_pause)
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

    @property
    def playing(self) -> bool:
        """True while the motion plays."""
        return self._running.is_set()

    def play(self) -> None:
        """Play on; from the start if the motion is at its end."""
        if self._time >= self._end:
            self.go_to(0.0)
        self._button.label = "pause"
        self._running.set()

    def play_or_pause(self) -> None:
        """Pause what plays, and play what does not."""
        if self.playing:
            self.pause()
        else:
            self.play()

    def pause(self) -> None:
        """Stop playing."""
        self._running.clear()
        self._slider.value = self._time
        self._button.label = "play"

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
                wanted = start + (time.monotonic() - began) * _number(speed)
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


def _number(speed: str) -> float:
    above, _, below = speed.partition("/")
    return float(above) / float(below or 1.0)
