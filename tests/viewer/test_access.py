"""The page answers its own address alone, takes valid values alone, and runs its own scripts alone."""

from __future__ import annotations

import contextlib
import http.client
import http.server
import socket
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import msgspec
import numpy as np
import pytest
import viser
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect

import dynx
from dynx.viewer import Viewer
from dynx.viewer.browser import Access, alike, fits, is_loopback
from tests.viewer.conftest import Opened, connected, until

VERSION: Any = f"viser-v{viser.__version__}"


@pytest.fixture
def viewer() -> Iterator[Viewer]:
    """Return a viewer of a robot, with a slider of the program."""
    with dynx.load("double_pendulum").view() as opened:
        yield opened


def answer(url: str, **headers: str) -> tuple[int, dict[str, str]]:
    """Return the status and the headers of the answer to a request."""
    where = urlsplit(url)
    connection = http.client.HTTPConnection(str(where.hostname), where.port, timeout=30.0)
    connection.putrequest("GET", where.path or "/", skip_host="Host" in headers)
    for name, value in headers.items():
        connection.putheader(name, value)
    connection.endheaders()
    response = connection.getresponse()
    response.read()
    connection.close()
    return response.status, dict(response.getheaders())


def socket_of(url: str, origin: Any = None, **headers: str) -> Any:
    """Open the socket of a page, as its own script does."""
    address = url.replace("http", "ws").rstrip("/")
    return connect(
        address, subprotocols=[VERSION], origin=origin, additional_headers=headers, max_size=None, proxy=None
    )


def test_a_request_needs_the_token(viewer: Viewer) -> None:
    status, headers = answer(viewer.url)
    assert status == 200
    assert "default-src 'none'" in headers["Content-Security-Policy"]
    token = urlsplit(viewer.url).path.strip("/")
    assert len(token) >= 22
    root = viewer.url.removesuffix(f"{token}/")
    for path in (
        "",
        token[:-1],
        f"{token}x",
        f"x/{token}/",
        f"?{token}",
        f"index.html?{token}",
        token.swapcase(),
    ):
        assert answer(f"{root}{path}")[0] == 403
        with pytest.raises(InvalidStatus), socket_of(f"{root}{path}"):
            pass
    with socket_of(viewer.url, root.rstrip("/")), socket_of(viewer.url):
        pass
    with dynx.load("double_pendulum").view() as other:
        assert urlsplit(other.url).path != urlsplit(viewer.url).path


def test_a_request_names_this_machine_and_comes_from_the_page(viewer: Viewer) -> None:
    own = urlsplit(viewer.url).netloc
    port = own.rpartition(":")[2]
    for host in (own, f"localhost:{port}", "localhost:9999", f"[::1]:{port}", "LOCALHOST"):
        assert answer(viewer.url, Host=host)[0] == 200
        assert answer(viewer.url, Host=host, Origin=f"http://{host}")[0] == 200
    for host in (
        "evil.test",
        f"evil.test:{port}",
        f"127.0.0.1.evil.test:{port}",
        "localhost.evil.test",
        "",
        "[",
        "a@b",
    ):
        assert answer(viewer.url, Host=host)[0] == 403
    for origin in (
        "http://evil.test",
        f"http://localhost:{port}",
        f"http://{own}.evil.test",
        "null",
        "file://",
        "[",
    ):
        assert answer(viewer.url, Origin=origin)[0] in (403, 500)
        with pytest.raises(InvalidStatus), socket_of(viewer.url, origin):
            pass


@pytest.mark.parametrize(
    ("host", "known", "unknown"),
    [
        ("127.0.0.1", ("127.0.0.1:80", "127.0.0.2", "localhost"), ("10.0.0.1", "evil.test", "8.8.8.8:80")),
        (
            "0.0.0.0",
            ("10.0.0.1:80", socket.gethostname(), "[fe80::1]:8080"),
            ("evil.test", "10.0.0.1.evil.test"),
        ),
        ("robot.local", ("robot.local:8080", "10.0.0.1"), ("evil.test", "evil.robot.local")),
    ],
)
def test_hosts_of_an_address(host: str, known: tuple[str, ...], unknown: tuple[str, ...]) -> None:
    access = Access(host)
    assert all(access.is_ours([each], []) for each in known)
    assert not any(access.is_ours([each], []) for each in unknown)
    assert not access.is_ours([], [])
    assert not any(access.is_ours([f"{each}{known[0]}"], []) for each in ("evil.test@", "evil.test#", "x, "))
    assert not access.is_ours([known[0]], [f"https://{known[0]}"])
    assert not access.is_ours([known[0]], [f"http://{known[0]}@evil.test"])
    assert not access.is_ours([known[0]] * 2, [])
    assert not access.is_ours([known[0]], [f"http://{known[0]}"] * 2)


def test_a_host_beyond_this_machine_is_noted() -> None:
    with dynx.load("double_pendulum").view(host="0.0.0.0") as viewer:
        assert "0.0.0.0, beyond this machine, without encryption" in viewer.notes[0]
    with dynx.load("double_pendulum").view() as viewer:
        assert not any("encryption" in note for note in viewer.notes)
    assert [is_loopback(each) for each in ("127.0.0.9", "::1", "::", "host")] == [True, True, False, False]


def camera(**changes: Any) -> dict[str, Any]:
    """Return the message by which a page tells its camera."""
    return {
        "type": "ViewerCameraMessage",
        "wxyz": [1.0, 0.0, 0.0, 0.0],
        "position": [1.0, 1.0, 1.0],
        "fov": 1.0,
        "near": 0.1,
        "far": 100.0,
        "image_height": 400,
        "image_width": 900,
        "look_at": [0.0, 0.0, 0.0],
        "up_direction": [0.0, 0.0, 1.0],
        **changes,
    }


def test_messages_of_another_type_change_nothing(viewer: Viewer) -> None:
    slider = viewer.slider("gain", 0.0, 10.0, 5.0)
    gui = viewer.page.gui
    controls = dict(gui._gui_input_handle_from_uuid)
    before = {uuid: handle.value for uuid, handle in controls.items()}
    own = slider._handle._impl.uuid
    nan, inf = float("nan"), float("inf")
    bad: list[Any] = [nan, inf, -inf, 1e300, None, "5", "", b"5", [], [1.0], {}, {"a": 1}, [[1, [2]]], 2**63]
    with socket_of(viewer.url) as page:

        def send(message: object) -> None:
            page.send(msgspec.msgpack.encode(message))

        send(camera())
        connected(viewer)
        for uuid, handle in controls.items():
            values = [*bad, 1, 0.5] if isinstance(handle.value, str) else bad
            values = [*values, True] if not isinstance(handle.value, bool) else [*values, 1, 0.0]
            for value in values:
                if isinstance(value, str) and isinstance(handle.value, str):
                    continue
                send({"type": "GuiUpdateMessage", "uuid": uuid, "updates": {"value": value}})
            for name in (
                "update_cb",
                "removed",
                "props",
                "uuid",
                "sync_cb",
                "is_button",
                "no_such",
                "__class__",
            ):
                send({"type": "GuiUpdateMessage", "uuid": uuid, "updates": {name: 3}})
                send({"type": "GuiUpdateMessage", "uuid": uuid, "updates": {"value": handle.value, name: 3}})
        messages: list[Any] = [
            {"type": "GuiUpdateMessage", "uuid": own, "updates": [1]},
            {"type": "GuiUpdateMessage", "uuid": [own], "updates": {"value": 1.0}},
            {"type": "NoSuchMessage"},
            {"type": 3},
            {},
            [],
            "text",
            {"type": "ShareUrlRequest"},
            camera(position=[nan, 0.0, 0.0]),
            camera(position=[0.0]),
            camera(wxyz=[0.0, 0.0, 0.0, 0.0]),
            camera(wxyz="1000"),
            camera(fov=None),
            camera(image_height="x"),
            {
                "type": "TransformControlsUpdateMessage",
                "name": "/handle",
                "wxyz": [nan] * 4,
                "position": [0, 0, 0],
            },
            {
                "type": "TransformControlsUpdateMessage",
                "name": "/handle",
                "wxyz": [1, 0, 0, 0],
                "position": "abc",
            },
            {"type": "SceneNodeClickMessage", "name": "/handle", "instance_index": "x"},
        ]
        for message in messages:
            send(message)
        page.send(b"\xc1")
        page.send(b"")
        send({"type": "GuiUpdateMessage", "uuid": own, "updates": {"value": 7}})
        until(lambda: slider.value == 7.0, "the slider")
        send({"type": "GuiUpdateMessage", "uuid": own, "updates": {"value": 1e9}})
        until(lambda: slider.value == 10.0, "the clamped slider")
        (client,) = connected(viewer)
        np.testing.assert_array_equal(client.camera.position, [1.0, 1.0, 1.0])
        private = client.gui.add_slider("of one page", 0.0, 1.0, 0.1, 0.0)
        send({"type": "GuiUpdateMessage", "uuid": private._impl.uuid, "updates": {"value": 0.5}})
        until(lambda: private.value == 0.5, "the slider of one page")
    before[own] = 10.0
    assert {uuid: handle.value for uuid, handle in controls.items()} == before
    assert all(callable(each) for handle in controls.values() for each in handle._impl.update_cb)


def test_types_of_values() -> None:
    assert fits((1, 2.5), tuple[float, float])
    assert not fits((1, 2.5, 3), tuple[float, float])
    assert not fits((1, True), tuple[float, ...])
    assert fits(None, float | None)
    assert not fits("x", float | None)
    assert alike((1, 2), (0.0, 0.0))
    assert not alike((1, "2"), (0.0, 0.0))
    assert not alike("a" * 10**6, "a")


@pytest.fixture
def foreign() -> Iterator[Callable[[str], str]]:
    """Serve a page of somebody else on another port, and return its address."""
    servers: list[http.server.HTTPServer] = []

    def serve(text: str) -> str:
        class Handler(http.server.BaseHTTPRequestHandler):
            def do_GET(self) -> None:
                self.send_response(200)
                self.send_header("Content-Type", "text/html")
                self.end_headers()
                self.wfile.write(text.encode())

            def log_message(self, *_: object) -> None:
                pass

        server = http.server.HTTPServer(("127.0.0.1", 0), Handler)
        servers.append(server)
        threading.Thread(target=server.serve_forever, daemon=True).start()
        return f"http://127.0.0.1:{server.server_port}/"

    yield serve
    for each in servers:
        each.shutdown()
        each.server_close()


def test_a_foreign_page_opens_no_socket(viewer: Viewer, browser: Any, foreign: Callable[[str], str]) -> None:
    address = viewer.url.replace("http", "ws").rstrip("/")
    open_socket = f"""(address) => new Promise((done) => {{
        const opened = new WebSocket(address, "{VERSION}");
        opened.onopen = () => done("open");
        opened.onerror = () => done("refused");
    }})"""
    page = browser.new_page()
    page.goto(foreign("<p>a page of somebody else</p>"))
    assert page.evaluate(open_socket, address) == "refused"
    assert page.evaluate(open_socket, address.rpartition("/")[0]) == "refused"
    page.goto(viewer.url)
    assert page.evaluate(open_socket, address) == "open"
    page.close()


INJECTED = """() => new Promise((done) => {
    const place = document.createElement("div");
    place.innerHTML = '<img src="x" onerror="window.executed = 1">'
        + '<p onclick="window.executed = 1" id="p">p</p>'
        + '<iframe srcdoc="<script>parent.executed = 1</script>"></iframe>';
    document.body.append(place);
    document.getElementById("p").click();
    fetch("https://evil.test/").then(() => { window.executed = 1; }, () => {});
    setTimeout(() => done(window.executed ?? 0), 500);
})"""
"""Injects HTML with scripts into a page, as a name that is not escaped would, and returns whether one ran."""


def test_the_page_runs_its_own_scripts_alone(
    viewer: Viewer, open_page: Callable[..., Opened], tmp_path: Path
) -> None:
    path = tmp_path / "page.html"
    viewer.export(path)
    for address in (viewer.url, path.as_uri()):
        page = open_page(address)
        assert page.errors == []
        assert page.page.evaluate(INJECTED) == 0
        assert any("Content Security Policy" in error for error in page.errors)


def test_the_button_that_copies_is_allowed(viewer: Viewer, open_page: Callable[..., Opened]) -> None:
    page = open_page(viewer.url)
    button = page.page.locator("button[data-text]").first
    button.scroll_into_view_if_needed()
    button.click()
    until(lambda: button.inner_text() == "copied", "the button")
    assert page.errors == []


def test_what_strangers_send_is_not_written_to_the_terminal(capfd: pytest.CaptureFixture[str]) -> None:
    with dynx.load("double_pendulum").view(open_browser=False) as viewer:
        where = urlsplit(viewer.url)
        for line in (b"\x1b]0;owned\x07 / HTTP/1.1", b"POST / HTTP/1.1", b"GET / HTTP/0.9", b"\x16\x03\x01"):
            with socket.create_connection((str(where.hostname), int(where.port or 0)), 10.0) as opened:
                opened.sendall(line + b"\r\nHost: evil.test\r\n\r\n")
                opened.settimeout(5.0)
                with contextlib.suppress(OSError):
                    opened.recv(4096)
    written = "".join(capfd.readouterr())
    assert "Traceback" not in written
    assert "owned" not in written
