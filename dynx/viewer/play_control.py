"""The button and the key of the page that play or pause what it shows, and how fast that goes."""

from __future__ import annotations

import threading
from typing import Any

from dynx.viewer.page import Page

SPEEDS = ("1/10", "1/4", "1/2", "1", "2", "4")
"""Choices of the speed, relative to the clock."""


def speed_factor(speed: str) -> float:
    """Return one of the `SPEEDS` as a number."""
    above, _, below = speed.partition("/")
    return float(above) / float(below or 1.0)


class PlayControl:
    """What a page plays and pauses: a thread that plays waits for `_running`."""

    _button: Any

    def __init__(self) -> None:
        self._running = threading.Event()

    def add_play_button(self, page: Page, *, visible: bool = True) -> None:
        """Add the button to the controls, at their present end, and the key."""
        self._button = page.gui.add_button("pause" if self.playing else "play", visible=visible)
        self._button.on_click(lambda _: self.play_or_pause())
        if visible:
            page.on_own_key("P", "play or pause", self.play_or_pause)

    @property
    def playing(self) -> bool:
        """True while it plays."""
        return self._running.is_set()

    def play(self) -> None:
        """Play on."""
        self._button.label = "pause"
        self._running.set()

    def pause(self) -> None:
        """Stop playing."""
        self._running.clear()
        self._button.label = "play"

    def play_or_pause(self) -> None:
        """Pause what plays, and play what does not."""
        if self.playing:
            self.pause()
        else:
            self.play()
