"""Ctrl-C and SIGTERM as a request to finish with what there is."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType


class Interruption:
    """Whether the run was asked to end; `code` is then the exit code, 128 and the signal."""

    def __init__(self) -> None:
        self.code: int | None = None
        self.finishing = False

    def arrived(self, number: int, frame: FrameType | None) -> None:
        """The signal handler: the first signal ends the work, later ones must not lose the results."""
        if self.finishing or self.code is not None:
            return
        self.code = 128 + number
        raise KeyboardInterrupt


@contextmanager
def interruptible() -> Iterator[Interruption]:
    """Within the context the first SIGINT or SIGTERM raises KeyboardInterrupt, unless `finishing`."""
    interruption = Interruption()
    if threading.current_thread() is not threading.main_thread():
        yield interruption  # only the main thread may set handlers, and only it gets signals
        return
    numbers = (signal.SIGINT, signal.SIGTERM)
    before = [signal.signal(number, interruption.arrived) for number in numbers]
    try:
        yield interruption
    finally:
        for number, handler in zip(numbers, before, strict=True):
            signal.signal(number, handler)
