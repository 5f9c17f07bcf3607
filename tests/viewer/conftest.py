"""A browser for the tests of the page, where one is installed."""

from __future__ import annotations

import shutil
import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

from dynx.spatial.scalar import Floats
from dynx.spatial.se3 import homogeneous
from dynx.spatial.so3 import rotation_from_quat
from dynx.viewer import Viewer
from dynx.viewer.drawn_robot import DrawnParts
from dynx.viewer.surroundings import GROUND, SKY_LIGHT

BROWSERS = ("chromium", "chromium-browser", "google-chrome")

SOFTWARE = (
    "--no-sandbox",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--ignore-gpu-blocklist",
)
"""Options with which Chromium draws WebGL without a graphics processor."""

AS_IF_ON_A_GRAPHICS_PROCESSOR = """(() => {
  const getParameter = WebGL2RenderingContext.prototype.getParameter, NAME = 0x9246;
  WebGL2RenderingContext.prototype.getParameter = function (name) {
    return name === NAME ? "graphics processor" : getParameter.call(this, name);
  };
})();"""
"""Script by which a page takes the software that draws it for a graphics processor."""

PATIENCE = 180.0
"""Longest wait for the page [s]: software draws slowly beside other tests."""


PICTURE = 2000.0
"""Time in which software draws a picture beside other tests [ms]."""

QUIET = 350.0
"""Time without a new picture after which a page rests [ms]; one at rest draws about once a second."""

FIRST_PLACES = ((-5.0, 0.0, 0.0), (3.0, 3.0, 3.0))
"""Places (3,) [m] of the camera of a page that has not read yet from where the viewer looks: that of
react-three-fiber, and that of viser. On a busy machine a page has each for seconds."""


class Opened:
    """A page of a viewer that is open in the browser, with everything it printed and asked for."""

    def __init__(self, page: Any) -> None:
        self.page = page
        self.errors: list[str] = []
        self.requests: list[str] = []
        self._listeners: dict[str, Callable[[Any], None]] = {
            "console": lambda m: self.errors.append(m.text) if m.type == "error" else None,
            "pageerror": lambda error: self.errors.append(str(error)),
            "request": lambda request: self.requests.append(request.url),
        }
        for event, listener in self._listeners.items():
            page.on(event, listener)

    def go_to(self, url: str) -> None:
        """Open an address and wait until the page draws."""
        self.page.goto(url)
        self.page.wait_for_selector("canvas[data-engine]", timeout=1e3 * PATIENCE)

    def leave(self) -> None:
        """Leave the address, so that the page may be opened at another."""
        self.page.goto("about:blank")
        self.page.context.clear_permissions()
        for event, listener in self._listeners.items():
            self.page.remove_listener(event, listener)


OpenPage = Callable[..., Opened]


@pytest.fixture(scope="session")
def browser() -> Iterator[Any]:
    """Headless Chromium; the test is skipped where there is none."""
    found = next(filter(None, map(shutil.which, BROWSERS)), None)
    if found is None:
        pytest.skip(f"needs a browser: {' or '.join(BROWSERS)} (apt-get install chromium)")
    api = pytest.importorskip("playwright.sync_api")
    with api.sync_playwright() as playwright:
        running = playwright.chromium.launch(executable_path=found, args=list(SOFTWARE))
        yield running
        running.close()


@pytest.fixture(scope="session")
def kept_pages(browser: Any) -> Iterator[list[Any]]:
    """Pages that tests have left: one of them opens an address in two thirds of the time of a new one."""
    kept: list[Any] = []
    yield kept
    for page in kept:
        page.close()


@pytest.fixture
def open_page(
    browser: Any, kept_pages: list[Any], request: pytest.FixtureRequest
) -> Iterator[Callable[..., Opened]]:
    """Open addresses, or empty pages, of a width and a height [pixels], which are left or closed after the
    test; with `accelerated` they do what they do on a graphics processor."""
    closed: list[Opened] = []
    left: list[Opened] = []

    def opened(
        url: str | None = None, size: tuple[int, int] = (900, 450), *, accelerated: bool = False
    ) -> Opened:
        # What a test adds to an empty page stays there, so that page is a new one.
        is_plain = url is not None and not accelerated
        viewport = {"width": size[0], "height": size[1]}
        if is_plain and kept_pages:
            page = kept_pages.pop()
            page.set_viewport_size(viewport)
        else:
            page = browser.new_page(viewport=viewport)
        if accelerated:
            page.add_init_script(AS_IF_ON_A_GRAPHICS_PROCESSOR)
        page.set_default_timeout(1e3 * PATIENCE)
        found = Opened(page)
        (left if is_plain else closed).append(found)
        if url is not None:
            found.go_to(url)
        return found

    failed = request.session.testsfailed
    yield opened
    for each in left:
        if each.page.is_closed() or kept_pages or request.session.testsfailed > failed:
            closed.append(each)
        else:
            each.leave()
            kept_pages.append(each.page)
    for each in closed:
        each.page.close()


AT_REST = """([quiet, longest]) => new Promise((done) => {
  const start = performance.now();
  let drawn, since = start, looks = 0;
  const look = () => {
    const picture = window.__viserMutable?.scene?.__r3f?.root?.getState?.();
    const last = picture?.gl.info.render.frame ?? -1, now = performance.now();
    if (last !== drawn) [drawn, since, looks] = [last, now, 0];
    looks += 1;
    if (now - start > longest || (last > 0 && now - since > quiet && looks > 20)) done();
    else requestAnimationFrame(look);
  };
  look();
})"""
"""Script that waits until the page, which looks 60 times a second for what it has to draw, draws nothing for
`QUIET`. A page that is busy with something else looks less often, so it must also have looked 20 times."""


def wait_for_rest(page: Opened, viewer: Viewer | None = None) -> None:
    """Wait until a page draws nothing anew, but at most for `PICTURE`; with its viewer, first for all shapes,
    without which it may rest, too."""
    if viewer is not None:
        names = [node.name for nodes in viewer.view.visuals.values() for node in nodes]
        page.page.wait_for_function(
            "names => names.every((name) => window.__viserMutable?.nodeRefFromName[name])", arg=names
        )
    page.page.evaluate(AT_REST, [QUIET, PICTURE])


def until(condition: Callable[[], object], what: str) -> None:
    """Wait until a condition holds; fail after `PATIENCE`."""
    end = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < end, f"waited {PATIENCE:g} s for {what}"
        time.sleep(0.05)


def connected(viewer: Viewer, count: int = 1) -> list[Any]:
    """Return the open pages of a viewer once there are `count`, and each has the camera of its view.

    A page may report other places before it takes over that of the viewer (`FIRST_PLACES`).
    """

    def ready() -> bool:
        clients = list(viewer.page.server.get_clients().values())
        places = [each.camera.position for each in clients]
        at_first = any(np.allclose(place, first, atol=1e-9) for place in places for first in FIRST_PLACES)
        return len(clients) >= count and not at_first

    until(ready, f"{count} connected pages")
    clients = viewer.page.server.get_clients()
    return [clients[k] for k in sorted(clients)]


def without_surroundings(viewer: Viewer) -> None:
    """Remove ground and sky from a page: its pictures are transparent where no part is."""
    for path in (GROUND, SKY_LIGHT):
        viewer.page.scene.remove_by_name(path)


def poses_of_nodes(drawn: DrawnParts) -> dict[str, Floats]:
    """Return the pose (4, 4) in the world of each part, as a page computes it from its nodes."""
    poses: dict[str, Floats] = {}
    for path, (name, node) in sorted((node.name, (name, node)) for name, node in drawn.parts.items()):
        w, *xyz = node.wxyz
        T = homogeneous(rotation_from_quat(np.array([*xyz, w])), node.position)
        over = path.rpartition("/")[0]
        above = next((poses[each] for each, n in drawn.parts.items() if n.name == over), np.eye(4))
        poses[name] = above @ T
    return poses


def pixel_of(client: Any, point: Floats) -> Floats:
    """Return where the camera of a page sees a point (3,) of the world (2,) [pixels]."""
    camera = client.camera
    w, x, y, z = camera.wxyz
    T = homogeneous(rotation_from_quat(np.array([x, y, z, w])), camera.position)
    seen = np.linalg.inv(T) @ [*point, 1.0]
    height, width = camera.image_height, camera.image_width
    focal = 0.5 * height / np.tan(0.5 * camera.fov)
    return np.array([0.5 * width + focal * seen[0] / seen[2], 0.5 * height + focal * seen[1] / seen[2]])


def antialiased(page: Opened) -> bool:
    """Return whether the page draws each pixel several times, to smooth edges."""
    context = "document.querySelector('canvas[data-engine]').getContext('webgl2')"
    return bool(page.page.evaluate(f"{context}.getContextAttributes().antialias"))
