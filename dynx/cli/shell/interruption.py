"""Ctrl-C and SIGTERM as requests to finish with the results so far."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType


class Interruption:
    """Request to end the run.

    `code` is None until a signal arrives; then it is the exit code, 128 + signal. Set `finishing` to have
    later signals ignored while the results are written.
    """

    def __init__(self) -> None:
        self.code: int | None = None
        self.finishing = False

    def handle(self, number: int, frame: FrameType | None) -> None:
        """Handle a signal: the first ends the work, later ones are ignored so that no results are lost."""
        if self.finishing or self.code is not None:
            return
        self.code = 128 + number
        raise KeyboardInterrupt


@contextmanager
def interruptible() -> Iterator[Interruption]:
    """Raise KeyboardInterrupt in the block at the first SIGINT or SIGTERM, unless `finishing` is set."""
    interruption = Interruption()
    if threading.current_thread() is not threading.main_thread():
        yield interruption  # only the main thread can set handlers and receives signals
        return
    numbers = (signal.SIGINT, signal.SIGTERM)
    before = [signal.signal(number, interruption.handle) for number in numbers]
    try:
        yield interruption
    finally:
        for number, handler in zip(numbers, before, strict=True):
            signal.signal(number, handler)
