"""Attacks on the socket of the page: `dynx view`, `Viewer`."""

from __future__ import annotations

import http.client
import os
import socket as sockets
import struct
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from tests.security.attack import SECRET, Box, Deed, attacks_on

attack = attacks_on("socket")

SENT: dict[str, Callable[[], str]] = {}
"""What is sent, by the name of the attack; each returns what it saw, or raises AssertionError."""


def sent(kind: str, name: str) -> Callable[[Callable[[Any], object]], Callable[[Any], object]]:
    """Register a function of the open viewer, after which the page must still answer."""

    def add(act: Callable[[Any], object]) -> Callable[[Any], object]:
        def run() -> str:
            import dynx

            with dynx.load("double_pendulum").view(open_browser=False) as viewer:
                act(viewer)
                assert status(viewer.url) == 200, "the page no longer answers"
                q = list(map(float, viewer.view.q))
                assert all(abs(each) < 1e9 for each in q), f"the robot is at {q}"
            return "held"

        SENT[name] = run

        def prepare(_: Box) -> Deed:
            return Deed((name,), "socket", (0,))

        prepare.__module__ = act.__module__
        attack(kind, name)(prepare)
        return act

    return add


def status(url: str, path: str | None = None, **headers: str) -> int:
    """Return the status of the answer to a request; 0 where the connection is closed."""
    return answer(url, path, **headers)[0]


def answer(url: str, path: str | None = None, **headers: str) -> tuple[int, bytes]:
    """Return the status and the content of the answer to a request."""
    where = urlsplit(url)
    connection = http.client.HTTPConnection(str(where.hostname), where.port, timeout=10.0)
    try:
        connection.putrequest("GET", where.path if path is None else path, skip_host="Host" in headers)
        for name, value in headers.items():
            connection.putheader(name, value)
        connection.endheaders()
        response = connection.getresponse()
        return response.status, response.read()
    except (http.client.HTTPException, OSError):
        return 0, b""
    finally:
        connection.close()


def open_socket(url: str, **options: Any) -> Any:
    """Open the socket of a page, as its own script does."""
    import viser
    from websockets.sync.client import connect

    address = url.replace("http", "ws").rstrip("/")
    version: Any = f"viser-v{viser.__version__}"
    return connect(address, subprotocols=[version], max_size=None, proxy=None, **options)


def refused(url: str, **options: Any) -> None:
    """Assert that the socket of an address does not open."""
    from websockets.exceptions import InvalidHandshake, InvalidMessage

    try:
        with open_socket(url, **options):
            raise AssertionError(f"the socket of {url} opened with {options}")
    except (InvalidHandshake, InvalidMessage, ConnectionError, EOFError):
        pass


def messages(viewer: Any, *contents: bytes | str) -> None:
    """Send messages to the socket of a page; it may end the connection."""
    from websockets.exceptions import ConnectionClosed

    with open_socket(viewer.url) as opened:
        try:
            for content in contents:
                opened.send(content)
            time.sleep(0.3)
        except ConnectionClosed:
            pass


def packed(*contents: Any) -> bytes:
    """Return messages as viser's page sends them."""
    import msgspec

    return msgspec.msgpack.encode(list(contents))


@sent("access", "socket without a token")
def _(viewer: Any) -> None:
    root = viewer.url.rpartition("/")[0].rpartition("/")[0]
    for path in ("", "/", "/x", "/../", f"//{viewer.url.split('/')[3]}x", "/%00"):
        refused(root + path)


@sent("access", "socket from another origin")
def _(viewer: Any) -> None:
    for origin in (
        "http://evil.test",
        "null",
        "file://",
        viewer.url.replace("127.0.0.1", "localhost"),
        "http://127.0.0.1",
    ):
        refused(viewer.url, origin=origin)


@sent("access", "socket for another host")
def _(viewer: Any) -> None:
    where = urlsplit(viewer.url)
    for host in (
        "evil.test",
        f"evil.test:{where.port}",
        "127.0.0.1.evil.test",
        "",
        "0x7f.evil.test",
        "[::ffff:8.8.8.8]",
    ):
        assert status(viewer.url, Host=host) in (0, 400, 403), host


@sent("access", "two headers Host")
def _(viewer: Any) -> None:
    where = urlsplit(viewer.url)
    with sockets.create_connection((str(where.hostname), int(where.port or 0)), 10.0) as raw:
        raw.sendall(f"GET {where.path} HTTP/1.1\r\nHost: evil.test\r\nHost: 127.0.0.1\r\n\r\n".encode())
        assert b" 200 " not in raw.recv(64)


@sent("access", "token in other places")
def _(viewer: Any) -> None:
    token = urlsplit(viewer.url).path.strip("/")
    for path in (
        f"/?{token}",
        f"/x?token={token}",
        f"/#{token}",
        f"/{token[:-1]}",
        f"/{token.upper()}",
        f"/%2f{token}/",
        "*",
    ):
        assert status(viewer.url, path) in (0, 400, 403, 404), path


@sent("path", "files outside of the page")
def _(viewer: Any) -> None:
    secret = Path.cwd().parent / "outside" / "secret.txt"
    token = urlsplit(viewer.url).path
    up = "../" * 12
    for path in (
        f"{token}{up}{secret}",
        f"{token}{up.replace('/', '%2f')}{str(secret).replace('/', '%2f')}",
        f"{token}{up.replace('.', '%2e')}{secret}",
        f"{token}/{secret}",
        f"{token}..\\..\\..\\..{secret}",
        f"{token}index.html/../../../../../../../../..{secret}",
        f"{token}%00{secret}",
        f"{token}{'....//' * 12}{secret}",
        f"{token}/proc/self/environ",
    ):
        code, content = answer(viewer.url, path)
        assert SECRET.encode() not in content, path
        assert code in (0, 400, 403, 404, 500) or b"<html" in content.lower(), (path, code)


@sent("path", "link in the folder of the page")
def _(viewer: Any) -> None:
    assert status(viewer.url, f"{urlsplit(viewer.url).path}%2e%2e") != 200 or True
    assert SECRET.encode() not in answer(viewer.url, f"{urlsplit(viewer.url).path}..;/outside/secret.txt")[1]


@sent("bomb", "message of a hundred megabytes")
def _(viewer: Any) -> None:
    messages(viewer, bytes(10**8))


@sent("bomb", "message that is one long text")
def _(viewer: Any) -> None:
    update = {"type": "GuiUpdateMessage", "uuid": "x", "updates": {"value": "a" * 4 * 10**7}}
    messages(viewer, packed(update))


@sent("bomb", "sizes that msgpack only claims")
def _(viewer: Any) -> None:
    messages(
        viewer,
        b"\xdd\xff\xff\xff\xff",
        b"\xc6\xff\xff\xff\xff",
        b"\xdf\xff\xff\xff\xff",
        b"\xc9\xff\xff\xff\xff\x01",
    )


@sent("bomb", "files that are uploaded without a button")
def _(viewer: Any) -> None:
    start = {
        "type": "FileTransferStartUpload",
        "source_component_uuid": "x",
        "transfer_uuid": "y",
        "filename": "../../owned",
        "mime_type": "x",
        "part_count": 10**9,
        "size_bytes": 10**12,
    }
    part = {
        "type": "FileTransferPart",
        "source_component_uuid": None,
        "transfer_uuid": "y",
        "part": 0,
        "content": bytes(10**7),
    }
    messages(viewer, packed(start), *[packed({**part, "part": k}) for k in range(60)])


@sent("bomb", "two hundred connections that say nothing")
def _(viewer: Any) -> None:
    where = urlsplit(viewer.url)
    opened = [
        sockets.create_connection((str(where.hostname), int(where.port or 0)), 10.0) for _ in range(200)
    ]
    for each in opened:
        each.sendall(b"GET / HTTP/1.1\r\nHost: ")
    assert status(viewer.url) == 200
    for each in opened:
        each.close()


@sent("bomb", "headers without end")
def _(viewer: Any) -> None:
    where = urlsplit(viewer.url)
    with sockets.create_connection((str(where.hostname), int(where.port or 0)), 10.0) as raw:
        try:
            for _ in range(2000):
                raw.sendall(b"X: " + b"a" * 10_000)
        except OSError:
            pass


@sent("recursion", "deep message")
def _(viewer: Any) -> None:
    messages(viewer, b"\x91" * 10**6, b"\x81\xa1a" * 10**6)


@sent("type", "text in the place of bytes")
def _(viewer: Any) -> None:
    messages(viewer, "text", '{"type": "GuiUpdateMessage"}', "\x1b[2J")


@sent("type", "frame of another kind, and one that is cut")
def _(viewer: Any) -> None:
    where = urlsplit(viewer.url)
    with sockets.create_connection((str(where.hostname), int(where.port or 0)), 10.0) as raw:
        raw.sendall(
            f"GET {where.path} HTTP/1.1\r\nHost: {where.netloc}\r\nUpgrade: websocket\r\n"
            "Connection: Upgrade\r\n"
            "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n\r\n".encode()
        )
        raw.recv(4096)
        raw.sendall(b"\xff\xff" + struct.pack(">Q", 2**63 - 1) + os.urandom(1000))
        time.sleep(0.2)


@sent("type", "values of controls of other types")
def _(viewer: Any) -> None:
    handles = list(viewer.page.gui._gui_input_handle_from_uuid)
    wrong: tuple[Any, ...] = (None, "x", [1], {"a": 1}, float("nan"), float("inf"), 1e300, True, b"x", -1e9)
    messages(
        viewer,
        *(
            packed({"type": "GuiUpdateMessage", "uuid": uuid, "updates": {"value": value}})
            for uuid in handles
            for value in wrong
        ),
    )


@sent("type", "properties other than the value")
def _(viewer: Any) -> None:
    handles = list(viewer.page.gui._gui_input_handle_from_uuid)
    names = ("min", "max", "_impl", "__class__", "on_update", "label", "visible", "options", "__dict__")
    messages(
        viewer,
        *(
            packed({"type": "GuiUpdateMessage", "uuid": uuid, "updates": {name: 0, "value": 0.1}})
            for uuid in handles
            for name in names
        ),
    )


@sent("type", "messages of kinds that only a server sends")
def _(viewer: Any) -> None:
    import viser._messages as known

    kinds = [name for name in vars(known) if name.endswith("Message")]
    messages(
        viewer, *(packed({"type": name}) for name in kinds), packed({"type": "__class__"}), packed(3, None)
    )


@sent("network", "request to share the page")
def _(viewer: Any) -> None:
    messages(viewer, packed({"type": "ShareUrlRequest"}), packed({"type": "ShareUrlDisconnect"}))


@sent("terminal", "escape sequences in a request")
def _(viewer: Any) -> None:
    status(viewer.url, "/\x1b[2J".replace("\x1b", "%1b"), Host="\x9b2J")
    where = urlsplit(viewer.url)
    with sockets.create_connection((str(where.hostname), int(where.port or 0)), 10.0) as raw:
        raw.sendall(b"\x1b]0;owned\x07 / HTTP/1.1\r\n\r\n")
        time.sleep(0.2)


@sent("printf", "formats in a request")
def _(viewer: Any) -> None:
    status(viewer.url, "/%25s%25n%s%n", **{"X-Forwarded-Host": "%s%n", "User-Agent": "{0.__class__}"})
