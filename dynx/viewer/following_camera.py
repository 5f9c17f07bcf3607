"""Camera of the page: free, moving with a part, or looking from a part."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from dynx.errors import ArgumentError, nearest, shown
from dynx.spatial.scalar import Floats
from dynx.viewer.drawn_parts import DrawnParts
from dynx.viewer.page import Page

_NO_PART = "none"

_FREE, _FOLLOWS, _FIRST_PERSON = "free", "moves with", "looks from"


class FollowingCamera:
    """The controls of the camera; it moves all open pages alike."""

    def __init__(self, page: Page, drawn: DrawnParts) -> None:
        self._page, self._drawn = page, drawn
        self._before: Floats | None = None
        gui = page.gui
        with gui.add_folder("camera", expand_by_default=False):
            self._mode = gui.add_dropdown("it is", (_FREE, _FOLLOWS, _FIRST_PERSON), initial_value=_FREE)
            # An empty scene has no part.
            self._part = gui.add_dropdown("part", tuple(drawn.parts) or (_NO_PART,))
        self._mode.on_update(lambda _: self._start())
        self._part.on_update(lambda _: self._start())
        drawn.on_placed(self._move)

    def watch(self, drawn: DrawnParts) -> None:
        """Follow the parts of another drawing with the same names from now on."""
        self._drawn, self._before = drawn, None
        drawn.on_placed(self._move)

    def follow(self, part: str | None, *, first_person: bool = False) -> None:
        """Follow a part; None leaves the camera where it is. Raises ArgumentError for an unknown part."""
        if part is not None:
            if part not in self._drawn.parts:
                raise ArgumentError(f"no part {shown(part)}{nearest(str(part), self._drawn.parts)}")
            self._part.value = part
        self._mode.value = _FREE if part is None else _FIRST_PERSON if first_person else _FOLLOWS
        self._start()

    def _start(self) -> None:
        with self._page.lock:
            self._before = None
            part = self._part.value
            self._move({part: self._drawn.pose(part)} if part in self._drawn.parts else {})

    def _move(self, poses: Mapping[str, Floats]) -> None:
        mode = self._mode.value
        T = poses.get(self._part.value)
        if mode == _FREE or T is None:
            return
        origin = np.array(T[:3, 3])
        shift = None if self._before is None else origin - self._before
        self._before = origin
        for client in self._page.server.get_clients().values():
            camera = client.camera
            if mode == _FIRST_PERSON:
                with client.atomic():
                    camera.up_direction = tuple(T[:3, 2].tolist())
                    camera.position = tuple(origin.tolist())
                    camera.look_at = tuple((origin + T[:3, 0]).tolist())
            elif shift is not None:
                # viser moves what the camera looks at along with it.
                camera.position = tuple((np.array(camera.position) + shift).tolist())
