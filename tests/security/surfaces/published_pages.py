"""Attacks on pages and their socket, of the kinds that were published against other viewers and servers."""

from __future__ import annotations

import contextlib
import io
import json
import socket as sockets
import struct
import time
import zlib
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import numpy as np

from tests.security.attack import SECRET, Box, Deed, archive_of, attacks_on
from tests.security.surfaces import arrays, page
from tests.security.surfaces.page import MARK, harmless
from tests.security.surfaces.socket import answer, messages, open_socket, packed, refused, sent, status

attack = attacks_on("page")

NAMES = {
    "names of the prototype": "__proto__",
    "constructor": f"constructor.constructor('{MARK}()')()",
    "script in other letters": f"</ScRiPt\t/x><sCrIpT/x>{MARK}()</sCrIpT>",
    "drawing with a handler": f"<svg/onload={MARK}()><animate onbegin={MARK}() attributeName=x>",
    "formula with an element that changes its kind": f"<math><mtext><table><mglyph><style>"
    f"<img onerror={MARK}()>",
    "address that is a program": f"java\tscript:{MARK}()",
    "separators of lines": f"a\u2028{MARK}()\u2029//",
    "end of a marked section": f"]]><{MARK}/><![CDATA[",
    "template of another page": f"#{{{MARK}}}<%= {MARK} %>{{!{MARK}!}}[[{MARK}]]",
    "base and refresh": f"<base href=//{MARK}><meta http-equiv=refresh content='0;{MARK}'>",
}


def _robot(text: str) -> Any:
    def prepare(box: Box) -> Deed:
        made = page.robot(box, text)
        # A separator of lines is refused in a name.
        return Deed(made.words, ends=(0, 2), check=_if_written(box.here / "out.html"))

    return prepare


def _if_written(path: Path) -> Any:
    return lambda output: harmless(path)(output) if path.exists() else None


for _name, _text in NAMES.items():
    attack("html", _name)(_robot(_text))


@attack("html", "names in a recording")
def _(box: Box) -> Deed:
    document = json.loads(str(np.load(io.BytesIO(arrays.members()["robot.npy"]))))
    text = json.dumps(document).replace("joint", page.IMAGE.replace('"', "").replace("\\", ""))
    content = archive_of({**arrays.members(), "robot.npy": arrays.npy(np.array(text))})
    words = ("view", box.file("r.npz", content), "--export", "out.html")
    return Deed(words, ends=(0, 2), check=_if_written(box.here / "out.html"))


@attack("html", "names in the picture of a plot")
def _(box: Box) -> Deed:
    name = f"<script>{MARK}()</script><a href={MARK}>"
    body = {"name": name.replace("/", ""), "mass": 1.0, "shape": {"box": [0.1, 0.1, 0.1]}}
    document = {"schema": "dynx.scene/1", "bodies": [body]}
    words = ("world", box.file("s.json", json.dumps(document)), "--duration", "0.01", "--plot", "out.svg")

    def check(_: str) -> str | None:
        path = box.here / "out.svg"
        found = page._Page()
        found.feed(path.read_text(encoding="utf-8") if path.exists() else "")
        return f"the attacker's word is {found.wrong[0]}" if found.wrong else None

    return Deed(words, ends=(0, 1, 2), check=check)


@attack("html", "name of the robot in a notebook")
def _(box: Box) -> Deed:
    document = json.loads(str(np.load(io.BytesIO(arrays.members()["robot.npy"]))))
    text = json.dumps(document).replace("pendulum", f"<img src=x onerror={MARK}()>")
    content = archive_of({**arrays.members(), "robot.npy": arrays.npy(np.array(text))})

    def check(output: str) -> str | None:
        found = page._Page()
        found.feed(output)
        return f"the attacker's word is {found.wrong[0]}" if found.wrong else None

    return Deed((box.file("r.npz", content),), "rollout", (0, 2), check)


@attack("network", "page that asks another machine")
def _(box: Box) -> Deed:
    made = page.robot(box, "http://192.0.2.1/a.png")

    def check(output: str) -> str | None:
        text = (box.here / "out.html").read_text(encoding="utf-8")
        policies = [each for each in ("default-src 'none'", "connect-src") if each in text]
        return harmless(box.here / "out.html")(output) or (None if policies else "no policy on addresses")

    return Deed(
        made.words,
        ends=(0, 2),
        check=lambda output: check(output) if (box.here / "out.html").exists() else None,
    )


@attack("bomb", "name of a million characters")
def _(box: Box) -> Deed:
    return Deed(page.robot(box, "<" * 10**6).words, ends=(2,))


# -- the socket -----------------------------------------------------------------------------------


def raw(viewer: Any, *contents: bytes, wait: float = 0.3) -> bytes:
    """Send bytes to the port of a page; return the beginning of the answer."""
    where = urlsplit(viewer.url)
    with sockets.create_connection((str(where.hostname), int(where.port or 0)), 10.0) as opened:
        opened.settimeout(wait)
        try:
            for content in contents:
                opened.sendall(content)
            return opened.recv(65536)
        except OSError:
            return b""


@sent("access", "names and numbers of this machine in other forms")
def _(viewer: Any) -> None:
    port = urlsplit(viewer.url).port
    for host in (
        f"127.0.0.1.nip.test:{port}",
        f"localhost.evil.test:{port}",
        f"evil.test@127.0.0.1:{port}",
        f"127.0.0.1:{port}@evil.test",
        f"evil.test#127.0.0.1:{port}",
        f"evil.test\\@127.0.0.1:{port}",
        f"[::1%25evil]:{port}",
        f"evil.test:{port}, 127.0.0.1",
    ):
        assert status(viewer.url, Host=host) in (0, 400, 403), host


@sent("access", "origins that only begin or end like the page's own")
def _(viewer: Any) -> None:
    where = urlsplit(viewer.url)
    own = f"http://{where.netloc}"
    for origin in (
        f"{own}.evil.test",
        f"{own}@evil.test",
        f"http://evil.test/{own}",
        f"https://{where.netloc}",
        f"http://{where.hostname}:{int(where.port or 0) + 1}",
        f"{own}, http://evil.test",
        "chrome-extension://x",
    ):
        refused(viewer.url, origin=origin)


@sent("access", "addresses of another site in the first line")
def _(viewer: Any) -> None:
    where = urlsplit(viewer.url)
    for line in (
        "GET http://evil.test/ HTTP/1.1",
        f"GET http://evil.test{where.path} HTTP/1.1",
        "CONNECT evil.test:80 HTTP/1.1",
        f"GET //{where.path} HTTP/0.9",
        "PRI * HTTP/2.0",
    ):
        found = raw(viewer, f"{line}\r\nHost: evil.test\r\n\r\n".encode())
        assert b" 200 " not in found[:32], line


@sent("access", "two requests in one")
def _(viewer: Any) -> None:
    where = urlsplit(viewer.url)
    head = (
        f"POST / HTTP/1.1\r\nHost: {where.netloc}\r\nContent-Length: 6\r\n"
        "Transfer-Encoding: chunked\r\n\r\n0\r\n\r\n"
    )
    found = raw(viewer, head.encode() + b"GET / HTTP/1.1\r\nHost: evil.test\r\n\r\n")
    assert b" 200 " not in found


@sent("access", "frames and scripts of other sites")
def _(viewer: Any) -> None:
    import http.client

    where = urlsplit(viewer.url)
    connection = http.client.HTTPConnection(str(where.hostname), where.port, timeout=10.0)
    connection.request("GET", where.path)
    headers = {name.lower(): value.lower() for name, value in connection.getresponse().getheaders()}
    policy = headers.get("content-security-policy", "")
    assert "frame-ancestors" in policy or "x-frame-options" in headers, (
        "another site may show the page in a frame"
    )
    assert headers.get("access-control-allow-origin") is None, "another site may read the page"
    assert "no-referrer" in headers.get("referrer-policy", ""), "the token is told to other sites"


@sent("access", "methods other than GET")
def _(viewer: Any) -> None:
    where = urlsplit(viewer.url)
    for method in ("POST", "PUT", "DELETE", "TRACE", "OPTIONS", "PATCH", "X" * 1000):
        found = raw(viewer, f"{method} {where.path} HTTP/1.1\r\nHost: {where.netloc}\r\n\r\n".encode())
        assert b"access-control-allow" not in found.lower(), method


@sent("path", "paths that are encoded twice, and too long")
def _(viewer: Any) -> None:
    token = urlsplit(viewer.url).path
    secret = Path.cwd().parent / "outside" / "secret.txt"
    for path in (
        f"{token}{'%252e%252e%252f' * 12}{secret}",
        f"{token}{'%c0%ae%c0%ae/' * 12}{secret}",
        f"{token}{'%u002e%u002e/' * 12}{secret}",
        f"{token}{'..%5c' * 12}{secret}",
        f"{token}file://{secret}",
        f"{token}{'a/' * 30_000}",
        f"{token}index.html%00.png",
        f"{token}%",
    ):
        code, content = answer(viewer.url, path)
        assert SECRET.encode() not in content, path
        assert code in (0, 400, 403, 404, 414, 500) or b"<html" in content.lower(), (path, code)


@sent("bomb", "compressed message that grows a thousandfold")
def _(viewer: Any) -> None:
    where = urlsplit(viewer.url)
    import viser

    request = (
        f"GET {where.path} HTTP/1.1\r\nHost: {where.netloc}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
        f"Sec-WebSocket-Protocol: viser-v{viser.__version__}\r\n"
        "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n"
        "Sec-WebSocket-Extensions: permessage-deflate\r\n\r\n"
    )
    packer = zlib.compressobj(9, zlib.DEFLATED, -15)
    data = b"".join(packer.compress(bytes(10**7)) for _ in range(300)) + packer.flush(zlib.Z_SYNC_FLUSH)
    frame = b"\xc2\xff" + struct.pack(">Q", len(data)) + bytes(4) + data
    raw(viewer, request.encode(), frame, wait=3.0)


@sent("bomb", "pieces of a message without end")
def _(viewer: Any) -> None:
    from websockets.exceptions import ConnectionClosed

    with open_socket(viewer.url) as opened, contextlib.suppress(ConnectionClosed):
        opened.send(bytes(10**5) for _ in range(3000))


@sent("bomb", "hundred thousand pings and small messages")
def _(viewer: Any) -> None:
    ping = b"\x89\x80" + bytes(4)
    where = urlsplit(viewer.url)
    import viser

    request = (
        f"GET {where.path} HTTP/1.1\r\nHost: {where.netloc}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
        f"Sec-WebSocket-Protocol: viser-v{viser.__version__}\r\n"
        "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n\r\n"
    )
    raw(viewer, request.encode(), ping * 10**5, (b"\x82\x81" + bytes(4) + b"\x90") * 10**5, wait=2.0)


@sent("bomb", "sockets that are opened and left")
def _(viewer: Any) -> None:
    opened = [open_socket(viewer.url) for _ in range(30)]
    for each in opened:
        each.socket.close()
    assert status(viewer.url) == 200


@sent("type", "extensions and keys of msgpack that are none")
def _(viewer: Any) -> None:
    messages(
        viewer,
        b"\x91\xd7\xff" + b"\xff" * 8,
        b"\x91\xc7\x0c\xff" + b"\xff" * 12,
        b"\x92\x81\xc0\x01\xc0",
        b"\x91\x82\xcb\x7f\xf8\0\0\0\0\0\0\x01\xa1a\xc3",
        b"\x91\x81\xa4type\xa1\xff",
        b"\xc1" * 100,
    )


@sent("type", "cameras, pointers and uploads that are no numbers")
def _(viewer: Any) -> None:
    import viser._messages as known

    wrong: tuple[Any, ...] = (float("nan"), 1e308, -1, 2**63, None, "x", [], {}, [float("inf")] * 4)
    names: tuple[str, ...] = (
        "ViewerCameraMessage",
        "ScenePointerMessage",
        "SceneNodeClickMessage",
        "TransformControlsUpdateMessage",
    )
    names += (
        "FileTransferStartUpload",
        "FileTransferPart",
        "FileTransferPartAck",
        "GetRenderResponseMessage",
    )
    contents = []
    for name in names:
        kind = getattr(known, name, None)
        for value in wrong:
            fields = getattr(kind, "__dataclass_fields__", {"value": None})
            contents.append(packed({"type": name, **dict.fromkeys(fields, value)}))
    messages(viewer, *contents)


@sent("html", "script that a client sends to other clients")
def _(viewer: Any) -> None:
    import msgspec
    from websockets.exceptions import ConnectionClosed

    with open_socket(viewer.url) as other:
        messages(
            viewer,
            packed({"type": "RunJavascriptMessage", "source": MARK}),
            packed({"type": "NotificationShowMessage", "uuid": "x", "props": {"title": MARK, "body": MARK}}),
            packed(
                {"type": "GuiHtmlMessage", "uuid": "x", "container_uuid": "root", "props": {"content": MARK}}
            ),
        )
        end = time.monotonic() + 1.0
        try:
            while time.monotonic() < end:
                content = other.recv(timeout=0.3)
                assert MARK.encode() not in (content if isinstance(content, bytes) else content.encode())
        except (TimeoutError, ConnectionClosed, msgspec.DecodeError):
            pass


@sent("terminal", "escape sequences in headers and names of protocols")
def _(viewer: Any) -> None:
    where = urlsplit(viewer.url)
    head = f"GET {where.path} HTTP/1.1\r\nHost: {where.netloc}\r\nOrigin: \x1b[2J\x9b\r\n"
    rest = (
        b"Upgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Key: \x1b[2J\r\n"
        b"Sec-WebSocket-Version: \x07\r\nSec-WebSocket-Protocol: \x1b]0;owned\x07\r\n\r\n"
    )
    raw(viewer, head.encode("latin-1") + rest)
    raw(viewer, b"\x16\x03\x01\x02\0\x01\0\x01\xfc\x03\x03" + bytes(500))
