"""Imports of viser (the page), rich (its prints) and fast-simplification (meshes), and the start of viser's
server."""

from __future__ import annotations

import io
import logging
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, redirect_stdout
from pathlib import Path
from typing import Any

import rich

from dynx.errors import NotInstalledError, importing

with importing("the viewer needs viser: pip install 'dynx[viewer]' ({error})"):
    import viser
    from fast_simplification import __version__ as SIMPLIFY_VERSION
    from fast_simplification import simplify
    from viser import uplot

__all__ = [
    "CLIENT",
    "HOTKEYS",
    "SIMPLIFY_VERSION",
    "nodes_by_path",
    "put_pose",
    "send_values",
    "serve",
    "silent",
    "simplify",
    "uplot",
]

CLIENT = Path(viser.__file__).parent / "client" / "build" / "index.html"
"""The page of viser."""

_starting = threading.Lock()

HOTKEYS = (
    *(chr(code) for code in range(ord("A"), ord("Z") + 1)),
    *(str(digit) for digit in range(10)),
    *("space", "enter", "escape", "tab", "backspace", "delete", "insert", "home", "end"),
    *("pageup", "pagedown", "arrowup", "arrowdown", "arrowleft", "arrowright"),
)
"""Keys of which viser's page tells."""


@contextmanager
def silent() -> Iterator[None]:
    """Suppress what viser prints, which is its addresses and its end, also when it is told not to.

    In a notebook rich displays it instead of printing it.
    """
    console = rich.get_console()
    before = console.quiet
    console.quiet = True
    try:
        with redirect_stdout(io.StringIO()):
            yield
    finally:
        console.quiet = before


def _is_not_of_a_stranger(record: logging.LogRecord) -> bool:
    """Leave out what websockets logs of a request that is none, whose traceback has the stranger's own text,
    and of a message that is text, which viser asserts that it is not."""
    error = record.exc_info[0] if record.exc_info else None
    is_text = record.getMessage() == "connection handler failed" and error is AssertionError
    return not is_text and record.getMessage() != "opening handshake failed"


def nodes_by_path(server: Any) -> dict[str, Any]:
    """Return the nodes of the scene of a server by their paths, those above before those below."""
    return dict(sorted(server.scene._handle_from_node_name.items()))


def send_values(node: Any, values: Mapping[str, Any]) -> None:
    """Send values of a node by name that viser does not know; the script of the page reads them. A page that
    is opened later gets the last values of each set of names."""
    scene = node._impl.api
    scene._queue_scene_message(viser._messages.SceneNodeUpdateMessage(node.name, dict(values)))


def put_pose(node: Any, position: Any, wxyz: Any) -> None:
    """Set the pose that a node has here, without a message to the page."""
    node._impl.position[:], node._impl.wxyz[:] = position, wxyz


def serve(
    host: str,
    port: int,
    title: str,
    folder: Path,
    guard: Callable[[Any], Any],
    checked: Callable[[Any, Callable[[str], Any]], Any],
) -> Any:
    """Start a server of viser, with the page in a folder instead of its own.

    `guard` takes the function that answers requests and returns the one that does so instead; `checked` takes
    the class that reads messages, with a function that returns the state of a control, and returns the reader
    that is used instead. viser takes none of these, so the class that serves the page and the function that
    listens are replaced while the server starts. Raises NotInstalledError for a version of viser that serves
    in another way.
    """
    infra: Any = viser.infra
    logging.getLogger("websockets.server").addFilter(_is_not_of_a_stranger)
    with _starting, silent():
        server_class, listening = infra.WebsockServer, infra._infra.websockets.asyncio.server
        listen, guarded = listening.serve, threading.Event()
        started: list[Any] = []

        def control(uuid: str) -> Any:
            for server in started:
                for owner in (server, *server.get_clients().values()):
                    handle = owner.gui._gui_input_handle_from_uuid.get(uuid)
                    if handle is not None:
                        return handle._impl
            return None

        def from_folder(*arguments: Any, **given: Any) -> Any:
            given["http_server_root"] = folder
            given["message_class"] = checked(given["message_class"], control)
            return server_class(*arguments, **given)

        def listen_guarded(handler: Any, *arguments: Any, **given: Any) -> Any:
            if handler.__module__ == infra._infra.__name__:
                given["process_request"] = guard(given["process_request"])
                guarded.set()
            return listen(handler, *arguments, **given)

        infra.WebsockServer, listening.serve = from_folder, listen_guarded
        try:
            server = viser.ViserServer(host, port, label=title, verbose=False)
        finally:
            infra.WebsockServer, listening.serve = server_class, listen
        if not guarded.is_set():
            server.stop()
            raise NotInstalledError(
                f"viser {viser.__version__} cannot be guarded; the viewer needs viser 1.1"
            )
        started.append(server)
        return server
