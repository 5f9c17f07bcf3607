"""The server of the page: where it listens, its theme, its camera, and its end."""

from __future__ import annotations

import atexit
import errno
import math
import socket
import threading
from collections.abc import Callable
from contextlib import AbstractContextManager
from html import escape
from typing import Any, NamedTuple

import numpy as np

from dynx.errors import ArgumentError, shown
from dynx.model.numbers import whole_number
from dynx.spatial.scalar import Floats
from dynx.steppers.camera import Camera
from dynx.viewer.browser import Access, CheckedMessages, Client, is_loopback
from dynx.viewer.framing import fitted_view, round_length
from dynx.viewer.library import serve, silent
from dynx.viewer.surroundings import GROUND, SKY_LIGHT, tiles_element
from dynx.world.scenery import DARK, FILL_DIRECTION, GAMMA, KEY_DIRECTION, LIGHT

DEFAULT_HOST = "127.0.0.1"
DEFAULT_PORT = 8080

_STYLE = """<style>
@media (max-width: %dpx) {
  .mantine-Notifications-root { --notifications-container-width: calc(100vw - 2em) !important; }
  .mantine-Paper-root[style*="position: fixed"] { width: 100%% !important; max-height: %d%% !important; }
  .mantine-Paper-root[style*="position: fixed"] div[style*="width: 20em"] { width: 100%% !important; }
}
</style>"""
"""Style of viser's page: its panel as wide as a narrow page and lower than viser's."""

NARROW = 576
"""Width of a page up to which viser lays the panel over the lower part of the picture [pixels]."""
_COVERED = 0.45
"""Share of the height of a narrow page that the panel covers."""

_NEAREST = 0.05
"""Least distance of the camera at the start [m]; nearer than 0.01 m it sees nothing."""


class _FirstView(NamedTuple):
    """Points that the camera sees at the start."""

    points: Floats
    """Places (n, 3) [m]."""
    tangent: float
    """Tangent of half the angle that they may take."""

    def placed(self, wide: float = 1.0, high: float = 1.0) -> tuple[Floats, Floats]:
        """Return eye and target (3,) [m] of the camera in a picture of which the points may take the width
        and the height given, as shares of the height of the picture."""
        eye, target = fitted_view(self.points, wide * self.tangent, high * self.tangent)
        away = eye - target
        distance = float(np.linalg.norm(away))
        return target + max(distance, _NEAREST) / distance * away, target


class Page:
    """A page in the browser, served until `close`.

    It listens on the loopback interface unless `host` names another. Without a port it listens on 8080, or on
    the next one that is free; with the port 0 the system chooses one.
    Requests need the token of its address, and come from the page itself (`Access`).
    """

    def __init__(
        self,
        host: str = DEFAULT_HOST,
        port: int | None = None,
        *,
        title: str = "dynx",
        dark: bool = False,
        plain: bool = False,
    ) -> None:
        """`plain` is what software draws fastest: one lamp and a sky, without shadows, instead of viser's
        surroundings and four lamps, whose reflections take most of the time of a picture, and no
        antialiasing.

        Raises ArgumentError for a port that is taken and a host that is not of this machine."""
        if not isinstance(host, str) or not host:
            raise ArgumentError(f"host is {shown(host)}; wanted an address of this machine")
        wanted = DEFAULT_PORT if port is None else whole_number("port", port, 0)
        if wanted > 65535:
            raise ArgumentError(f"port is {wanted}; wanted 0 to 65535")
        _check_can_listen(host, 0 if port is None else wanted)
        self.host = host
        self._client = Client(title, antialiasing=not plain)
        self._access = Access(self.host)
        headers = self._client.headers
        self._server = serve(
            self.host,
            wanted,
            title,
            self._client.folder,
            lambda answer: self._access.guard(answer, headers),
            CheckedMessages,
        )
        # viser goes on to the next port from one that is taken.
        self.port: int = self._server.get_port()
        self.plain, self.dark = plain, dark
        """True for a page drawn as software does fastest, and for a dark page."""
        self._furnish()
        self._view: _FirstView | None = None
        self.part_names: dict[str, str | list[str]] = {}
        """The names of parts by the paths of their nodes; of a node that shows many, all their names."""
        self.reserved_keys: dict[str, str] = {}
        """Actions of the keys that the page itself uses, by key."""
        self.elements: dict[str, str] = {}
        """HTML elements that exported pages have as well, by what they tell the page."""
        self._server.on_client_connect(self._watch_narrow)
        self.lock = threading.RLock()
        """Held by whoever changes what the page shows."""
        self._closed = threading.Event()
        self.ended = threading.Event()
        """Set when what is shown now is removed or the page is closed: threads that move it end then."""
        # Before viser's own end of the program, which prints that it ends.
        atexit.register(self.close)
        self._at_end: list[Callable[[], None]] = []

    def _furnish(self) -> None:
        """Set what is the same whatever is shown: theme, style, place of the panel, and light."""
        self._server.gui.configure_theme(
            dark_mode=self.dark, show_logo=False, show_share_button=False, control_width="medium"
        )
        # Beside the picture, not over it.
        self._server.gui.main_panel.dock_right()
        self._server.scene.set_up_direction("+z")
        self._server.gui.add_html(_STYLE % (NARROW, round(100.0 * _COVERED)), order=math.inf)
        self._add_lights()

    def _add_lights(self) -> None:
        """Light what is shown as pictures and films are: a matte surface reflects 1 / pi of a light's
        intensity."""
        scene, scenery = self._server.scene, DARK if self.dark else LIGHT
        scene.configure_environment_map(None)
        scene.configure_default_lights(False)
        below = round(255.0 * (scenery.ground_light / scenery.sky_light) ** (1.0 / GAMMA))
        lights = (("/sun", scenery.key, KEY_DIRECTION), ("/fill", scenery.fill, FILL_DIRECTION))
        for name, amount, towards in lights:
            scene.add_light_directional(name, intensity=math.pi * amount, position=tuple(towards.tolist()))
        scene.add_light_hemisphere(
            SKY_LIGHT,
            ground_color=(below, below, below),
            intensity=math.pi * scenery.sky_light,
            position=(0.0, 0.0, 1.0),
        )

    @property
    def url(self) -> str:
        """The address of the page, with its token: whoever has it sees and moves what the page shows."""
        host = {"0.0.0.0": "127.0.0.1", "::": "::1"}.get(self.host, self.host)
        return f"http://{f'[{host}]' if ':' in host else host}:{self.port}/{self._access.token}/"

    @property
    def notes(self) -> tuple[str, ...]:
        """Who else can reach the page, a sentence where it listens beyond this machine."""
        if is_loopback(self.host):
            return ()
        return (
            f"the page listens on {self.host}, beyond this machine, without encryption: whoever has "
            "or overhears its address sees and moves what it shows",
        )

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

    def has_part(self, name: object) -> bool:
        """Check whether something that is shown has a name."""
        return any(
            name in names if isinstance(names, list) else name == names for names in self.part_names.values()
        )

    def together(self) -> AbstractContextManager[Any]:
        """Send the changes made in a ``with`` block in one piece."""
        context: AbstractContextManager[Any] = self._server.atomic()
        return context

    def lay_ground(self, size: float, height: float | None = 0.0) -> None:
        """Give planes tiles, whose edges have a round length of about half the `size` of what stands on them
        [m], and add a ground at a height [m], unless it is None."""
        self.elements["tiles"] = tiles_element(round_length(0.5 * size))
        self.gui.add_html(self.elements["tiles"], order=math.inf)
        if height is not None:
            self.scene.add_frame(GROUND, show_axes=False, position=(0.0, 0.0, height))

    def look_at(self, points: Floats, share: float) -> None:
        """Begin with a camera for which points (n, 3) [m] take a `share` of the height of the picture, or of
        its width, and no more."""
        tangent = share * math.tan(0.5 * self._server.initial_camera.fov)
        self._view = _FirstView(points, tangent)
        eye, target = self._view.placed()
        self._server.initial_camera.position = tuple(eye.tolist())
        self._server.initial_camera.look_at = tuple(target.tolist())

    def look_from(self, camera: Camera) -> None:
        """Begin with the view of a camera in the world, and turn about a point at the distance of the origin
        of the world."""
        T = camera.pose.matrix
        initial = self._server.initial_camera
        initial.fov = camera.field_of_view
        initial.position = tuple(T[:3, 3].tolist())
        ahead = float(np.linalg.norm(T[:3, 3])) or 1.0
        initial.look_at = tuple((T[:3, 3] + ahead * T[:3, 2]).tolist())

    def _watch_narrow(self, client: Any) -> None:
        # The picture is as wide as the page only until the panel stands beside it.
        if client.camera.image_width > NARROW:
            return
        # The first camera of a page may come after the page is connected, and again with its reset button.
        client.camera.on_update(lambda _: self._make_room_on_narrow(client))
        self._make_room_on_narrow(client)

    def _make_room_on_narrow(self, client: Any) -> None:
        """Move a narrow page that shows what `look_at` says: viser lays its panel over the picture there."""
        camera = client.camera
        if self._view is None:
            return
        eye, target = self._view.placed()
        if not (np.allclose(camera.position, eye) and np.allclose(camera.look_at, target)):
            return
        eye, target = self._view.placed(camera.image_width / camera.image_height, 1.0 - _COVERED)
        away = eye - target
        up = np.array(camera.up_direction, dtype=np.float64)
        up -= (up @ away) / (away @ away) * away
        height = 2.0 * float(np.linalg.norm(away)) * math.tan(0.5 * camera.fov)
        target = target - _COVERED * 0.5 * height * up / np.linalg.norm(up)
        with client.atomic():
            camera.position = tuple((target + away).tolist())
            camera.look_at = tuple(target.tolist())

    def on_own_key(self, key: str, what: str, pressed: Callable[[], None]) -> None:
        """Call `pressed()` when a key is pressed that the page itself uses, for `what`."""
        self.on_own_key_of(key, what, lambda _: pressed())

    def on_own_key_of(self, key: str, what: str, pressed: Callable[[Any], None]) -> None:
        """Call `pressed(client)` with the page in which a key is pressed that the page itself uses."""
        self.reserved_keys[key] = what
        self.gui.add_command(what, hotkey=key).on_trigger(lambda event: pressed(event.client))

    def at_end(self, action: Callable[[], None]) -> None:
        """Call `action` when what is shown at present is removed or the page is closed."""
        self._at_end.append(action)

    def clear(self, title: str) -> None:
        """Remove everything from the page, with all controls, and give it another title; pages that are open
        keep their cameras.

        Raises ArgumentError for a page that is closed.
        """
        with self.lock:
            self.check_open()
            self._end_shown()
            self.ended = threading.Event()
            self.part_names, self.reserved_keys, self.elements = {}, {}, {}
            self._client.entitle(title)
            with self.together():
                self.scene.reset()
                self.gui.reset()
                self.gui.set_panel_label(title)
                self._furnish()

    def _end_shown(self) -> None:
        self.ended.set()
        actions, self._at_end = self._at_end, []
        for action in actions:
            action()

    @property
    def closed(self) -> bool:
        """True after `close`."""
        return self._closed.is_set()

    def check_open(self) -> None:
        """Raise ArgumentError for a page that is closed."""
        if self.closed:
            raise ArgumentError(f"the page at {self.url} is closed")

    def wait(self, seconds: float | None = None) -> bool:
        """Wait until the page is closed, or for `seconds`; return True once it is."""
        return self._closed.wait(seconds)

    def close(self) -> None:
        """End the server. Closing twice is harmless."""
        if self.closed:
            return
        atexit.unregister(self.close)
        self._closed.set()
        self._end_shown()
        # Whoever draws has ended then, or sees that the page is closed.
        with self.lock, silent():
            self._server.stop()
        self._client.remove()

    def __enter__(self) -> Page:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"<Page at {self.url}{', closed' if self.closed else ''}>"

    def _repr_html_(self) -> str:
        if self.closed:
            return f"<code>{escape(repr(self))}</code>"
        return (
            f'<iframe src="{escape(self.url, quote=True)}" width="100%" height="500" '
            'style="border: 0"></iframe>'
        )


def _check_can_listen(host: str, port: int) -> None:
    """Raise ArgumentError for a port that cannot be listened on, 0 for any, and for a host of no machine."""
    try:
        family = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0][0]
    except (OSError, UnicodeError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise ArgumentError(
            f"host {shown(host)} is not found: {reason}; wanted an address of this machine, such as "
            "127.0.0.1, or 0.0.0.0 for all of them"
        ) from None
    try:
        with socket.socket(family, socket.SOCK_STREAM) as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            probe.bind((host, port))
    except OSError as error:
        reason = error.strerror or str(error)
        remedy = (
            "wanted an address of this machine"
            if error.errno == errno.EADDRNOTAVAIL
            else "choose another port, or 0 for any that is free"
        )
        raise ArgumentError(
            f"port {port} of {shown(host)} cannot be listened on: {reason}; {remedy}"
        ) from None
