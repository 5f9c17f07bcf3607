"""A camera that moves with a part, or looks from one, in every open page."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from dynx.errors import ArgumentError, nearest, shown
from dynx.spatial.scalar import Floats
from dynx.viewer.drawn_robot import DrawnParts
from dynx.viewer.library import send_view
from dynx.viewer.page import Page

_FREE, _FOLLOWS, _FIRST_PERSON = "free", "moves with", "looks from"

_NO_PART = "none"

_REMEMBERED = 120
"""Number of views that were sent to a page and by which its answers are known; four seconds of them."""

_ALIKE = 1e-6
"""Difference of a view from one that was sent, as a share of the distance to what it shows, up to which a
page has only repeated it."""

_BEFORE = 0.002
"""Distance by which a camera that looks from a part lies before its surface [m]."""

_CLEAR = 0.01
"""Radius around the line of sight within which the part itself is not seen [m]."""


class _Sent(NamedTuple):
    """A view of a page, and the origin (3,) of the part that it was made for [m]."""

    position: Floats
    target: Floats
    origin: Floats


class _FollowingPage:
    """The view of one page relative to the part: it changes when the user turns, zooms or shifts it.

    A page repeats each view that it is sent, up to seconds later. Any other that it reports is the user's.
    """

    def __init__(self, client: Any, part_when_seen: Floats) -> None:
        """`part_when_seen` (3,) is the origin of the part in the view that the page has now."""
        self.client = client
        position, target = np.array(client.camera.position), np.array(client.camera.look_at)
        self._eye = position - target
        """Vector from what is looked at to the camera (3,) [m]."""
        self._ahead = target - part_when_seen
        """Vector from the part to what is looked at (3,) [m]."""
        self._sent = [_Sent(position, target, part_when_seen)]
        """Views that the page may still show, the oldest first."""
        self.heard: deque[tuple[Floats, Floats]] = deque(maxlen=_REMEMBERED)
        """Positions and targets that the page reported and that were not evaluated yet."""

    def follow(self, origin: Floats) -> None:
        """Send the view of a part at an origin (3,) [m]."""
        while self.heard:
            self._hear(*self.heard.popleft())
        target = origin + self._ahead
        position = target + self._eye
        send_view(self.client, position, target)
        self._sent.append(_Sent(position, target, origin))
        del self._sent[:-_REMEMBERED]

    def _hear(self, position: Floats, target: Floats) -> None:
        """Take over the view that the user has chosen, if it is one."""
        tolerance = _ALIKE * float(np.linalg.norm(position - target)) + 1e-9
        for k, sent in enumerate(self._sent):
            differences = np.abs([sent.position - position, sent.target - target])
            if differences.max() <= tolerance:
                # It has this view now, and will not show those before again.
                del self._sent[:k]
                return
        # Who only turns or zooms looks at the same place as before.
        since = min(self._sent, key=lambda sent: float(np.linalg.norm(sent.target - target)))
        self._eye = position - target
        if np.abs(since.target - target).max() > tolerance:
            self._ahead = target - since.origin
        self._sent.insert(0, _Sent(position, target, since.origin))


class FollowingCamera:
    """The controls of the camera; it moves all open pages alike."""

    def __init__(self, page: Page, drawn: DrawnParts) -> None:
        self._page, self._drawn, self._ended = page, drawn, page.ended
        self._start_poses = {name: drawn.pose(name) for name in drawn.parts}
        self._pages: dict[int, _FollowingPage] = {}
        self._outside = 0.0
        self._chosen = (_FREE, "")
        """The mode and the part with which the camera began last."""
        gui = page.gui
        with gui.add_folder("camera", expand_by_default=False):
            self._mode = gui.add_dropdown("it is", (_FREE, _FOLLOWS, _FIRST_PERSON), initial_value=_FREE)
            # An empty scene has no part.
            self._part = gui.add_dropdown("part", tuple(drawn.parts) or (_NO_PART,))
        self._mode.on_update(lambda _: self._start())
        self._part.on_update(lambda _: self._start())
        drawn.on_placed(self._move)
        page.server.on_client_connect(self._join)

    def watch(self, drawn: DrawnParts) -> None:
        """Follow the parts of another drawing with the same names from now on."""
        self._drawn = drawn
        drawn.on_placed(self._move)

    def follow(self, part: str | None, *, first_person: bool = False) -> None:
        """Follow a part, or a robot by its name; None leaves the camera where it is. Raises ArgumentError for
        an unknown name."""
        if part is not None:
            known = self._drawn.roots | {name: name for name in self._drawn.parts}
            if part not in known:
                raise ArgumentError(f"no part {shown(part)}{nearest(str(part), known)}")
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
            origin = self._drawn.pose(part)[:3, 3]
            clients = self._page.server.get_clients()
            self._pages = {number: _FollowingPage(client, origin) for number, client in clients.items()}
            if mode == _FIRST_PERSON:
                T = self._drawn.pose(part)
                leaves = self._drawn.way_out(T[:3, 3], T[:3, 0], _CLEAR, self._drawn.rigid_with(part))
                self._outside = leaves + _BEFORE if leaves else 0.0
                self._move({part: T})
            elif mode == _FOLLOWS:
                for client in clients.values():
                    client.camera.up_direction = (0.0, 0.0, 1.0)

    def _join(self, client: Any) -> None:
        """Let a page that was opened later follow, too."""
        if self._ended.is_set():
            return
        client.camera.on_update(self._hear)
        with self._page.lock:
            if self._mode.value != _FREE and self._part.value in self._drawn.parts:
                self._move({self._part.value: self._drawn.pose(self._part.value)})

    # Called for each message of a page in the order in which they come, before the next one is read.
    async def _hear(self, camera: Any) -> None:
        following = self._pages.get(camera.client.client_id)
        if following is not None and not self._ended.is_set():
            following.heard.append((np.array(camera.position), np.array(camera.look_at)))

    def _move(self, poses: Mapping[str, Floats]) -> None:
        mode, part = self._mode.value, self._part.value
        T = poses.get(part)
        if mode == _FREE or T is None or self._ended.is_set():
            return
        for number, client in self._page.server.get_clients().items():
            if mode == _FIRST_PERSON:
                ahead = T[:3, :3] @ [1.0, 0.0, 0.0]
                eye = T[:3, 3] + self._outside * ahead
                with client.atomic():
                    client.camera.up_direction = tuple(T[:3, 2].tolist())
                    client.camera.position = eye
                    client.camera.look_at = eye + ahead
                continue
            if number not in self._pages:
                # Its camera saw the scene as it was at the start.
                self._pages[number] = _FollowingPage(client, self._start_poses[part][:3, 3])
            self._pages[number].follow(np.array(T[:3, 3]))
