"""A camera that follows a body, in screenshots of the page in headless Chromium.

``python -m benchmarks.following`` drives a ball for 60 s: straight, along a circle, and stop and go. The page
is updated 30 times a second and drawn by software. In 120 screenshots, one every half second, the silhouette
of the ball should stay where it was: its centre and its size, as shares of the width of the picture. Halfway
through each kind of motion the user zooms, or turns the view; the silhouette of the new view counts from
there. ``--engine`` names the engines, and ``--shots`` how many screenshots each takes.

It needs Chromium and the Python package playwright (extra ``test``).
"""

from __future__ import annotations

import argparse
import io
import math
import os
import shutil
import threading
import time
from typing import Any, NamedTuple

import numpy as np
from PIL import Image

import dynx
from dynx.model import Pose
from dynx.spatial.scalar import Floats
from dynx.viewer import Viewer
from dynx.world import ExternalForce, Material, Scene, World, ground, sphere
from tests.viewer.conftest import BROWSERS, PATIENCE, SOFTWARE

SIZE = {"width": 1400, "height": 850}
"""Size of the page [pixels]."""

UPDATES_PER_SECOND = 30.0
DURATION = 60.0
"""Time for which the ball is driven [s]."""

BOUND = 0.03
"""Largest change of the centre and of the size of the silhouette, as a share of the width of the picture."""

SPEED = 1.0
"""Speed of the ball while it goes [m/s]."""

_GAIN = 5.0
"""Gain of the controller of the velocity [1/s]."""

_SETTLE = 2.5
"""Time after a zoom or a turn in which the page ends its own motion of the camera [s]."""

SCENE = Scene(
    "yard",
    bodies=(
        ground(material=Material(friction=0.0)),
        sphere(
            "ball",
            0.3,
            mass=1.0,
            pose=Pose((0.0, 0.0, 0.3)),
            material=Material(friction=0.0, rgba=(0.9, 0.1, 0.8, 1.0)),
        ),
    ),
)


def wanted_velocity(t: float) -> Floats:
    """Return the velocity (2,) [m/s] of the ball at a time [s]: straight, along a circle of 2 m, and by turns
    for a second each in motion and at rest."""
    if t < DURATION / 3.0:
        return SPEED * np.array([1.0, 0.0])
    if t < 2.0 * DURATION / 3.0:
        angle = (t - DURATION / 3.0) * SPEED / 2.0
        return SPEED * np.array([math.cos(angle), math.sin(angle)])
    return SPEED * (math.floor(t) % 2) * np.array([0.8, 0.6])


class Driver(threading.Thread):
    """Steps the world and updates the page at the rate of the clock."""

    def __init__(self, world: World, viewer: Viewer) -> None:
        super().__init__(daemon=True)
        self.world, self.viewer = world, viewer
        self.updates = 0
        self.moved = 0.0
        """Length of the path so far [m]."""
        self.going, self.ended = threading.Event(), threading.Event()

    def run(self) -> None:
        """Drive until `ended` is set."""
        self.going.wait()
        began = time.monotonic()
        n = max(1, round(1.0 / UPDATES_PER_SECOND / self.world.dt))
        while not self.ended.is_set():
            t = self.updates / UPDATES_PER_SECOND
            before = self.world.state.bodies["ball"]
            force = _GAIN * (wanted_velocity(t) - before.twist[:2])
            for _ in range(n):
                self.world.step(1, forces=[ExternalForce("ball", np.array([*force, 0.0, 0.0, 0.0, 0.0]))])
            self.viewer.update()
            self.updates += 1
            self.moved += float(np.linalg.norm(self.world.state.bodies["ball"].position - before.position))
            self.ended.wait(max(began + self.updates / UPDATES_PER_SECOND - time.monotonic(), 0.0))


def silhouette(page: Any) -> Floats:
    """Return the centre (2,) and the size (2,) of the ball in a screenshot, as shares of its width; NaN where
    it is not seen."""
    rgb = np.asarray(Image.open(io.BytesIO(page.screenshot())).convert("RGB"), dtype=np.int16)
    # Nothing else is magenta; contact forces are orange.
    rows, columns = np.nonzero(np.minimum(rgb[..., 0], rgb[..., 2]) - rgb[..., 1] > 60)
    if not len(rows):
        return np.full(4, np.nan)
    low, high = (np.array([f(columns), f(rows)]) for f in (np.min, np.max))
    return np.asarray(np.concatenate([0.5 * (low + high), high - low]) / rgb.shape[1], dtype=np.float64)


class Shots(NamedTuple):
    """Screenshots of one engine."""

    changes: Floats
    """Changes (n, 4) of the centre (2,) and the size (2,), as shares of the width."""
    updates: float
    """Updates a second."""
    moved: float
    """Length of the path of the ball [m]."""


def follow(browser: Any, engine: str, shots: int) -> Shots:
    """Drive a ball in an engine and take screenshots of the page that follows it."""
    with World(SCENE, engine) as world, world.view(steps=False, whole_meshes=False) as viewer:
        context = browser.new_context(viewport=SIZE)
        page = context.new_page()
        page.set_default_timeout(1e3 * PATIENCE)
        page.goto(viewer.url)
        page.wait_for_selector("canvas[data-engine]")
        while not viewer.page.server.get_clients():
            time.sleep(0.05)
        page.wait_for_timeout(1e3 * _SETTLE)
        viewer.follow("ball")
        driver = Driver(world, viewer)
        driver.start()
        start, changes = silhouette(page), []
        driver.going.set()
        began = time.monotonic()
        user = [(share * DURATION, k) for k, share in enumerate((1.0 / 6.0, 0.5, 5.0 / 6.0))]
        for due in np.arange(1, shots + 1) * DURATION / shots:
            if user and due >= user[0][0]:
                _, k = user.pop(0)
                page.mouse.move(400, 500)
                if k == 1:
                    page.mouse.down()
                    page.mouse.move(500, 480, steps=4)
                    page.mouse.up()
                else:
                    page.mouse.wheel(0.0, (-200.0, 0.0, 200.0)[k])
                page.wait_for_timeout(1e3 * _SETTLE)
                start = silhouette(page)
                began += _SETTLE
            page.wait_for_timeout(1e3 * max(began + float(due) - time.monotonic(), 0.0))
            changes.append(silhouette(page) - start)
        elapsed = time.monotonic() - began
        driver.ended.set()
        driver.join()
        context.close()
        return Shots(np.array(changes), driver.updates / elapsed, driver.moved)


def main() -> None:
    """Print the largest change of each engine; end with an error where one is above the bound."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--engine", default="pybullet,mujoco,drake", help="engines, between commas")
    options.add_argument("--shots", type=int, default=120, help="screenshots of each engine")
    given = options.parse_args()
    from playwright.sync_api import sync_playwright

    found = next(filter(None, map(shutil.which, BROWSERS)), None)
    if found is None:
        raise SystemExit(f"needs a browser: {' or '.join(BROWSERS)}")
    good = True
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=found, args=list(SOFTWARE))
        for engine in given.engine.split(","):
            shots = follow(browser, engine, given.shots)
            size = np.abs(shots.changes).max(axis=1)
            within = size <= BOUND  # False for NaN, where the ball is out of view
            good &= bool(within.all())
            print(
                f"{engine}: {int(within.sum())} of {len(size)} screenshots within {100 * BOUND:g} % of the "
                f"width; largest change {100 * float(np.nan_to_num(size, nan=1.0).max()):.2f} %, median "
                f"{100 * float(np.median(size)):.2f} %; the ball went {shots.moved:.1f} m at "
                f"{shots.updates:.1f} updates a second; load {os.getloadavg()[0]:.1f}, dynx "
                f"{dynx.__version__}",
                flush=True,
            )
        browser.close()
    if not good:
        raise SystemExit(1)


if __name__ == "__main__":
    main()
