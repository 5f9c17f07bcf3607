"""The server of the page: where it listens, its theme, its camera, and its end."""

from __future__ import annotations

import io
import math
import socket
import threading
from collections.abc import Callable
from contextlib import AbstractContextManager, redirect_stdout
from html import escape
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dynx.errors import ArgumentError, shown
from dynx.model.configuration import whole_number
from dynx.viewer.library import viser

DEFAULT_HOST = "127.0.0.1"
DEFAULT_PORT = 8080

VIEW_DIRECTION = np.array([1.0, -1.0, 0.7]) / math.sqrt(2.49)
"""Unit vector (3,) from what is seen to the camera."""

_AMBIENT = 1.5
"""Intensity of the light from all sides, where there is no light from surroundings."""

NARROW = 600
"""Width of a page below which viser lays the panel over the lower part of the picture [pixels]."""
_COVERED = 0.6
"""Share of the height of a narrow page that the panel covers."""
_FARTHER = 1.25
"""Factor of the camera's distance on a narrow page."""


class Page:
    """A page in the browser, served until `close`.

    It listens on the loopback interface unless `host` names another; with the port 0 a free one is chosen.
    """

    def __init__(
        self,
        host: str = DEFAULT_HOST,
        port: int = DEFAULT_PORT,
        *,
        title: str = "dynx",
        dark: bool = False,
        plain_light: bool = False,
    ) -> None:
        """`plain_light` is what software draws fastest: two lamps and no shadows, instead of the surroundings
        of viser, whose reflections take most of the time of a picture.

        Raises ArgumentError for a port that is taken and a host that is not of this machine."""
        if not isinstance(host, str) or not host:
            raise ArgumentError(f"host is {shown(host)}; wanted an address of this machine")
        wanted = whole_number("port", port, 0)
        if wanted > 65535:
            raise ArgumentError(f"port is {wanted}; wanted 0 to 65535")
        self.host, self.port = host, _free_port(host, wanted)
        # viser prints its addresses and its end, also when it is told not to.
        with redirect_stdout(io.StringIO()):
            self._server = viser.ViserServer(self.host, self.port, label=title, verbose=False)
        self._server.gui.configure_theme(
            dark_mode=dark, show_logo=False, show_share_button=False, control_width="medium"
        )
        # Beside the picture, not over it.
        self._server.gui.main_panel.dock_right()
        self._server.scene.set_up_direction("+z")
        if plain_light:
            self._server.scene.configure_environment_map(None)
            self._server.scene.configure_default_lights(cast_shadow=False)
            self._server.scene.add_light_ambient("/ambient_light", intensity=_AMBIENT)
        self._server.on_client_connect(_make_room_on_narrow)
        self.lock = threading.RLock()
        """Held by whoever changes what the page shows."""
        self._ended = threading.Event()
        self._at_end: list[Callable[[], None]] = []

    @property
    def url(self) -> str:
        """The address of the page."""
        host = "127.0.0.1" if self.host in ("", "0.0.0.0") else self.host
        return f"http://{f'[{host}]' if ':' in host else host}:{self.port}"

    @property
    def server(self) -> Any:
        """The viser server, for what dynx does not offer itself."""
        return self._server

    @property
    def scene(self) -> Any:
        """The nodes of viser."""
        return self._server.scene

    @property
    def gui(self) -> Any:
        """The controls of viser."""
        return self._server.gui

    def together(self) -> AbstractContextManager[Any]:
        """Send the changes made in a ``with`` block in one piece."""
        context: AbstractContextManager[Any] = self._server.atomic()
        return context

    def look_at(self, target: ArrayLike, distance: float) -> None:
        """Begin with a camera that sees `target` (3,) from a distance [m]."""
        point = np.asarray(target, dtype=np.float64)
        eye = point + distance * VIEW_DIRECTION
        self._server.initial_camera.position = tuple(eye.tolist())
        self._server.initial_camera.look_at = tuple(point.tolist())

    def at_end(self, action: Callable[[], None]) -> None:
        """Call `action` when the page is closed."""
        self._at_end.append(action)

    @property
    def closed(self) -> bool:
        """True after `close`."""
        return self._ended.is_set()

    def wait(self, seconds: float | None = None) -> bool:
        """Wait until the page is closed, or for `seconds`; return True once it is."""
        return self._ended.wait(seconds)

    def close(self) -> None:
        """End the server. Closing twice is harmless."""
        if self._ended.is_set():
            return
        self._ended.set()
        for action in self._at_end:
            action()
        # Whoever draws has ended then, or sees that the page is closed.
        with self.lock, redirect_stdout(io.StringIO()):
            self._server.stop()

    def __enter__(self) -> Page:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"<Page at {self.url}{', closed' if self.closed else ''}>"

    def _repr_html_(self) -> str:
        return (
            f'<iframe src="{escape(self.url, quote=True)}" width="100%" height="500" '
            'style="border: 0"></iframe>'
        )


def _make_room_on_narrow(client: Any) -> None:
    """Move what a narrow page shows above its panel, which viser lays over the picture there."""
    camera = client.camera
    if camera.image_width >= NARROW:
        return
    target, eye = np.array(camera.look_at), np.array(camera.position)
    away = _FARTHER * (eye - target)
    up = np.array(camera.up_direction, dtype=np.float64)
    up -= (up @ away) / (away @ away) * away
    height = 2.0 * float(np.linalg.norm(away)) * math.tan(0.5 * camera.fov)
    target = target - _COVERED * 0.5 * height * up / np.linalg.norm(up)
    with client.atomic():
        camera.position = tuple((target + away).tolist())
        camera.look_at = tuple(target.tolist())


def _free_port(host: str, port: int) -> int:
    """Return the port, or a free one for 0. Raises ArgumentError for one that cannot be listened on."""
    try:
        family = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0][0]
        with socket.socket(family, socket.SOCK_STREAM) as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            probe.bind((host, port))
            return int(probe.getsockname()[1])
    except (OSError, UnicodeError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise ArgumentError(
            f"port {port} of {shown(host)} cannot be listened on: {reason}; choose another port, or 0 for "
            "any that is free"
        ) from None
