"""A camera that moves with a part, or looks from one, in every open page."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from dynx.errors import ArgumentError, nearest, shown
from dynx.spatial.scalar import Floats
from dynx.viewer.browser import followed_element
from dynx.viewer.drawn_robot import DrawnParts
from dynx.viewer.page import Page

_FREE, _FOLLOWS, _FIRST_PERSON = "free", "moves with", "looks from"

_NO_PART = "none"

_BEFORE = 0.002
"""Distance by which a camera that looks from a part lies before its surface [m]."""

_CLEAR = 0.01
"""Radius around the line of sight within which the part itself is not seen [m]."""


class FollowingCamera:
    """The controls of the camera; it moves all open pages alike.

    A page that follows a part shifts its own camera with it, so that its user turns and zooms as always.
    """

    def __init__(self, page: Page, drawn: DrawnParts) -> None:
        self._page, self._drawn, self._ended = page, drawn, page.ended
        self._start_poses = {name: drawn.pose(name) for name in drawn.parts}
        self._outside = 0.0
        self._chosen = (_FREE, "")
        """The mode and the part with which the camera began last."""
        self._changes = 0
        gui = page.gui
        with gui.add_folder("camera", expand_by_default=False):
            self._mode = gui.add_dropdown("it is", (_FREE, _FOLLOWS, _FIRST_PERSON), initial_value=_FREE)
            # An empty scene has no part.
            self._part = gui.add_dropdown("part", drawn.listed or (_NO_PART,))
        # Outside of the folder, which may be closed.
        self._element = gui.add_html(self._followed(0, _NO_PART), order=math.inf)
        self._mode.on_update(lambda _: self._start())
        self._part.on_update(lambda _: self._start())
        drawn.on_placed(self._look_from)
        page.server.on_client_connect(self._join)

    def watch(self, drawn: DrawnParts) -> None:
        """Follow the parts of another drawing with the same names from now on."""
        self._drawn = drawn
        drawn.on_placed(self._look_from)

    def follow(self, part: str | None, *, first_person: bool = False) -> None:
        """Follow a part, or a robot by its name; None leaves the camera where it is. Raises ArgumentError for
        an unknown name."""
        if part is not None:
            known = self._drawn.roots | {name: name for name in self._drawn.parts}
            if part not in known:
                raise ArgumentError(f"no part {shown(part)}{nearest(part, known)}")
            if known[part] not in self._part.options:
                self._part.options = (*self._part.options, known[part])
            self._part.value = known[part]
        self._mode.value = _FREE if part is None else _FIRST_PERSON if first_person else _FOLLOWS
        self._start()

    def _start(self) -> None:
        """Begin from the views that the pages have, unless the same part is followed in this way already."""
        with self._page.lock:
            mode, part = chosen = self._mode.value, self._part.value
            if chosen == self._chosen or part not in self._drawn.parts:
                return
            self._chosen = chosen
            self._changes += 1
            self._element.content = self._followed(self._changes if mode == _FOLLOWS else 0, part)
            if mode == _FIRST_PERSON:
                T = self._drawn.pose(part)
                leaves = self._drawn.way_out(T[:3, 3], T[:3, 0], _CLEAR, self._drawn.rigid_with(part))
                self._outside = leaves + _BEFORE if leaves else 0.0
                self._look_from({part: T})
            elif mode == _FOLLOWS:
                for client in self._page.server.get_clients().values():
                    client.camera.up_direction = (0.0, 0.0, 1.0)

    def _followed(self, number: int, part: str) -> str:
        if not number:
            return followed_element(0, "", (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
        origin, start = self._drawn.pose(part)[:3, 3], self._start_poses[part][:3, 3]
        return followed_element(number, self._drawn.path_of(part), origin.tolist(), start.tolist())

    def _join(self, _: Any) -> None:
        """Let a page that was opened later look from the part, too."""
        with self._page.lock:
            if not self._ended.is_set() and self._part.value in self._drawn.parts:
                self._look_from({self._part.value: self._drawn.pose(self._part.value)})

    def _look_from(self, poses: Mapping[str, Floats]) -> None:
        T = poses.get(self._part.value)
        if self._mode.value != _FIRST_PERSON or T is None or self._ended.is_set():
            return
        ahead = T[:3, :3] @ [1.0, 0.0, 0.0]
        eye = np.asarray(T[:3, 3] + self._outside * ahead)
        for client in self._page.server.get_clients().values():
            with client.atomic():
                client.camera.up_direction = tuple(T[:3, 2].tolist())
                client.camera.position = eye
                client.camera.look_at = eye + ahead
