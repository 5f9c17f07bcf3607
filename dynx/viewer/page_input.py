"""Keys that are held in the page, and the ray below the pointer, as they change."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from typing import Any, NamedTuple

import numpy as np

from dynx.spatial.scalar import Floats
from dynx.viewer.browser import input_element
from dynx.viewer.library import HOTKEYS
from dynx.viewer.page import Page

KEYS = frozenset(each.lower() for each in HOTKEYS)
"""Names of the keys of which a page tells."""

KeyChanged = Callable[[], object]
PointerMoved = Callable[["str | None", Floats, Floats], object]


class _Told(NamedTuple):
    """What a page told last."""

    held: frozenset[str] | None = None
    """Keys that are held; None where only the pointer moved."""
    ray: tuple[Floats, Floats] | None = None
    """Origin and unit direction (3,) in world axes."""
    part: str | None = None
    """The part under the pointer."""


class PageInput:
    """Keys and pointer of all open pages of what is shown at present."""

    def __init__(self, page: Page, call: Callable[..., None]) -> None:
        """`call` calls a function of the program with its arguments and shows its errors."""
        self._page, self._call, self._ended = page, call, page.ended
        self._held: dict[int, frozenset[str]] = {}
        self._released: dict[str, list[KeyChanged]] = {}
        self._moved: list[PointerMoved] = []
        # viser lets a page change the values of controls alone: this one has what the page tells.
        self._control = page.gui.add_text("", "", visible=False)
        self._element = page.gui.add_html(self._html(), order=math.inf)
        # The program's functions may take long, and are called in the order of the keys.
        self._calls = ThreadPoolExecutor(1, "dynx input")
        page.at_end(lambda: self._calls.shutdown(wait=False, cancel_futures=True))
        self._control.on_update(self._hear)
        page.server.on_client_disconnect(lambda client: self._hold(client.client_id, frozenset()))

    @property
    def held(self) -> frozenset[str]:
        """Names of the keys that are held in any page, in small letters."""
        return frozenset[str]().union(*self._held.values())

    def on_released(self, key: str, released: KeyChanged) -> None:
        """Call `released()` when a key is released."""
        self._released.setdefault(key, []).append(released)

    def on_moved(self, moved: PointerMoved) -> None:
        """Call `moved(part, origin, direction)` when the pointer moves over the picture."""
        self._moved.append(moved)
        self._element.content = self._html()

    def remove(self) -> None:
        """Remove what the program asked for; keys that are held are still told."""
        self._released.clear()
        self._moved.clear()
        self._element.content = self._html()

    def _html(self) -> str:
        return input_element(self._control._impl.uuid, pointer=bool(self._moved))

    # Called in the order in which the messages come; functions that are not coroutines are not.
    async def _hear(self, event: Any) -> None:
        told = _told(event.target.value)
        if told.held is not None:
            self._hold(event.client_id, told.held)
        if told.ray is not None:
            part = told.part if self._page.has_part(told.part) else None
            for moved in self._moved:
                self._submit(moved, part, *told.ray)

    def _hold(self, page: int, held: frozenset[str]) -> None:
        before, self._held[page] = self._held.get(page, frozenset()), held
        for key in sorted(before - held):
            for released in self._released.get(key, ()):
                self._submit(released)

    def _submit(self, function: Callable[..., object], *arguments: object) -> None:
        if not self._page.closed and not self._ended.is_set():
            self._calls.submit(self._call, function, *arguments)


def _told(text: str) -> _Told:
    """Return what a page tells; nothing where the text is not as the page writes it."""
    try:
        data = json.loads(text)
    except ValueError:
        return _Told()
    if not isinstance(data, dict):
        return _Told()
    held, ray, part = data.get("held"), data.get("ray"), data.get("part")
    keys = None
    if isinstance(held, list) and all(isinstance(each, str) for each in held):
        keys = KEYS.intersection(held)
    points = None
    if isinstance(ray, list) and len(ray) == 2:
        try:
            origin, direction = np.array(ray, dtype=np.float64)
        except (TypeError, ValueError):
            return _Told(keys)
        if origin.shape == direction.shape == (3,) and np.isfinite([origin, direction]).all():
            points = origin, direction
    return _Told(keys, points, part if isinstance(part, str) else None)
