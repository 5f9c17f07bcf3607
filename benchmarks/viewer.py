"""The page in headless Chromium: time until a robot is drawn, pose updates and pictures a second.

``python -m benchmarks.viewer`` starts ``dynx view ur5`` and times it until the page has drawn the robot, in a
browser that is open already and has drawn before, and in one that is started to show the page. The time of an
empty page of viser, from when the browser is told to open it, is the lower bound of what follows when the
command has opened its page. Then it plays the rollout of a humanoid and counts, in the page, the
updates of poses that arrive and the pictures that are drawn by software. ``--whole-meshes`` draws every
triangle; ``--robots talos,g1`` names other humanoids. Times on the clock mean little beside other programs,
so the processor time of the server stands beside them, and the best of ``--repeats`` counts.

It needs Chromium and the Python package playwright (extra ``test``).
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing, contextmanager, suppress
from pathlib import Path
from typing import Any, NamedTuple

import dynx
from dynx.viewer.library import CLIENT, serve, silent
from dynx.viewer.page import DEFAULT_HOST
from dynx.viewer.triangles import TRIANGLE_BUDGET
from tests.viewer.conftest import BROWSERS, SOFTWARE

PATIENCE = 120.0
"""Longest wait for the page [s]."""

SIZE = {"width": 1400, "height": 850}
"""Size of the page [pixels]."""

HUMANOIDS = ("talos", "g1", "icub")

COUNTERS = """
(() => {
  const counts = window.counts = {triangles: 0, pictures: 0, updates: 0, drawn: null,
                                   connected: null, shapes: null};
  const turns = {};
  let now = 0;
  const count = (mode, n, copies) => { if (mode === 4) now += n / 3 * copies; };
  const GL = WebGL2RenderingContext.prototype;
  for (const [name, copies] of [["drawElements", 0], ["drawArrays", 0],
                                ["drawElementsInstanced", 4], ["drawArraysInstanced", 3]]) {
    const original = GL[name];
    GL[name] = function (...given) {
      const n = name.startsWith("drawElements") ? given[1] : given[2];
      count(given[0], n, copies ? given[copies] : 1);
      return original.apply(this, given);
    };
  }
  const frame = () => {
    if (now > 0) {
      counts.pictures += 1;
      counts.triangles = now;
      if (counts.drawn === null && window.wanted && now >= window.wanted) counts.drawn = Date.now() / 1e3;
      now = 0;
    }
    requestAnimationFrame(frame);
  };
  requestAnimationFrame(frame);
  const Original = window.Worker;
  window.Worker = class extends Original {
    constructor(...given) {
      super(...given);
      this.addEventListener("message", (event) => {
        if (!event.data || event.data.type !== "message_batch") return;
        counts.connected ??= Date.now() / 1e3;
        if (event.data.messages.some((each) => each.type === "MeshMessage")) counts.shapes = Date.now() / 1e3;
        for (const each of event.data.messages) {
          if (!(each.updates?.dynx_poses || each.type === "SetOrientationMessage")) continue;
          turns[each.name] = (turns[each.name] || 0) + 1;
          counts.updates = Math.max(counts.updates, turns[each.name]);
        }
      });
    }
  };
})();
"""
"""Counters in the page: triangles of the latest picture, pictures drawn, and poses that arrive of what moves
most often."""


class Start(NamedTuple):
    """Times of a start of ``dynx view`` [s]."""

    served: float
    """From the command until it opens the page, which the browser loads while the robot is read."""
    loaded: float
    """From the command until the browser has read viser's page."""
    connected: float
    """From the command until the first message reaches the page."""
    shapes: float
    """From the command until the last shapes reach the page."""
    drawn: float
    """From the command until the page has drawn the robot."""
    processor: float
    """Processor time of the command until then."""


class Rates(NamedTuple):
    """Rates in the page [1/s], and what they cost."""

    updates: float
    pictures: float
    triangles: float
    processor: float
    """Processor time of the server per second."""
    browser: float
    """Processor time of the browser per picture [s]."""


@contextmanager
def served(folder: str, *arguments: str) -> Iterator[tuple[subprocess.Popen[bytes], str, float]]:
    """Run ``dynx view`` with the arguments; yield the process, the address that it opens in the browser, and
    when it was started."""
    opened, browser = Path(folder, "opened"), Path(folder, "browser")
    opened.unlink(missing_ok=True)
    browser.write_text(f'#!/bin/sh\necho "$1" > {opened}.new && mv {opened}.new {opened}\n')
    browser.chmod(0o700)
    began = time.time()
    command = [str(Path(sys.executable).parent / "dynx"), "view", *arguments, "--port", "0"]
    process = subprocess.Popen(
        command, stdout=subprocess.DEVNULL, env={**os.environ, "BROWSER": str(browser)}
    )
    try:
        while not opened.exists():
            if process.poll() is not None or time.time() > began + PATIENCE:
                raise SystemExit(f"{' '.join(command)} opened no page")
            time.sleep(0.01)
        yield process, opened.read_text().strip(), began
    finally:
        process.terminate()
        process.wait()


def processor_time(pid: int) -> float:
    """Return the processor time of a process [s]."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def processor_time_of_browsers() -> float:
    """Return the processor time of all browsers that this program runs [s]."""
    started: dict[int, list[int]] = {}
    for stat in Path("/proc").glob("[0-9]*/stat"):
        # A process may end meanwhile.
        with suppress(OSError):
            fields = stat.read_text().rpartition(")")[2].split()
            started.setdefault(int(fields[1]), []).append(int(stat.parent.name))
    spent, waiting = 0.0, [os.getpid()]
    while waiting:
        for pid in started.get(waiting.pop(), ()):
            waiting.append(pid)
            with suppress(OSError):
                if "chrom" in Path(f"/proc/{pid}/comm").read_text():
                    spent += processor_time(pid)
    return spent


@contextmanager
def page_of(browser: Any, triangles: float) -> Iterator[Any]:
    """Open an empty page with the counters, which notes when it has drawn so many triangles."""
    context = browser.new_context(viewport=SIZE)
    try:
        page = context.new_page()
        page.add_init_script(f"window.wanted = {triangles};" + COUNTERS)
        yield page
    finally:
        context.close()


def until_drawn(page: Any) -> float:
    """Wait until the page has drawn the triangles wanted; return when [s]."""
    page.wait_for_function("window.counts.drawn !== null", timeout=1e3 * PATIENCE, polling=50)
    return float(page.evaluate("window.counts.drawn"))


def triangles_of_robot(name: str) -> int:
    """Return the number of triangles that the page draws of a robot."""
    with dynx.load(name).view(whole_meshes=False) as viewer:
        return sum(len(node.faces) for nodes in viewer.view.robot.visuals.values() for node in nodes)


def empty_page(browser: Any, launch: Callable[[], Any] | None) -> float:
    """Return the time in which a page of viser that shows nothing has drawn [s], with the start of a browser
    where `launch` is given."""
    server = serve(
        DEFAULT_HOST, 0, "empty", CLIENT.parent, lambda answer: answer, lambda messages, _: messages
    )
    try:
        with ExitStack() as ended:
            began = time.time()
            if launch is not None:
                browser = ended.enter_context(closing(launch()))
            page = ended.enter_context(page_of(browser, 1))
            page.goto(f"http://{DEFAULT_HOST}:{server.get_port()}")
            return until_drawn(page) - began
    finally:
        with silent():
            server.stop()


def start(robot: str, folder: str, triangles: int, browser: Any, launch: Callable[[], Any] | None) -> Start:
    """Start ``dynx view ROBOT`` and wait until it is drawn, in a new tab of the browser; in one that is
    started once the command opens its page, where `launch` is given."""
    with ExitStack() as ended:
        if launch is None:
            page = ended.enter_context(page_of(browser, triangles))
        process, address, began = ended.enter_context(served(folder, robot))
        answered = os.stat(Path(folder, "opened")).st_mtime
        if launch is not None:
            page = ended.enter_context(page_of(ended.enter_context(closing(launch())), triangles))
        page.goto(address)
        drawn = until_drawn(page)
        loaded = page.evaluate(
            "(performance.timeOrigin + performance.getEntriesByType('navigation')[0].domInteractive) / 1e3"
        )
        counts = page.evaluate("({...counts})")
        return Start(
            answered - began,
            loaded - began,
            counts["connected"] - began,
            counts["shapes"] - began,
            drawn - began,
            processor_time(process.pid),
        )


def rates(browser: Any, robot: str, folder: str, *, seconds: float, whole: bool) -> Rates:
    """Play the rollout of a robot and count in the page for some seconds."""
    model = dynx.load(robot)
    goal = model.random(0)
    motion = dynx.trajectory.cycloidal(model.clip(model.neutral()), goal, duration=600.0)
    rollout = dynx.simulate(
        model, dynx.control.ComputedTorque(model, kp=100.0, kd=20.0), motion, duration=3.0 * seconds, dt=5e-3
    )
    path = os.path.join(folder, f"{robot}.npz")
    rollout.save(path)
    options = ["--whole-meshes"] if whole else []
    with (
        page_of(browser, 0.5 * TRIANGLE_BUDGET) as page,
        served(folder, path, "--shapes", robot, "--play", *options) as (process, address, _),
    ):
        page.goto(address)
        until_drawn(page)
        time.sleep(2.0)
        before, spent, began = page.evaluate("({...counts})"), processor_time(process.pid), time.time()
        spent_on_pictures = processor_time_of_browsers()
        time.sleep(seconds)
        after, spent_after, ended = page.evaluate("({...counts})"), processor_time(process.pid), time.time()
        spent_on_pictures = processor_time_of_browsers() - spent_on_pictures
        elapsed = ended - began
        return Rates(
            (after["updates"] - before["updates"]) / elapsed,
            (after["pictures"] - before["pictures"]) / elapsed,
            after["triangles"],
            (spent_after - spent) / elapsed,
            spent_on_pictures / max(after["pictures"] - before["pictures"], 1),
        )


def main() -> None:
    """Print the figures."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--repeats", type=int, default=3)
    options.add_argument("--robots", default=",".join(HUMANOIDS), help="humanoids whose rollouts are played")
    options.add_argument("--seconds", type=float, default=6.0, help="time for which pictures are counted")
    options.add_argument("--whole-meshes", action="store_true")
    given = options.parse_args()
    from playwright.sync_api import sync_playwright

    found = next(filter(None, map(shutil.which, BROWSERS)), None)
    if found is None:
        raise SystemExit(f"needs a browser: {' or '.join(BROWSERS)}")
    with sync_playwright() as playwright, tempfile.TemporaryDirectory() as folder:
        browser = playwright.chromium.launch(executable_path=found, args=list(SOFTWARE))
        triangles = triangles_of_robot("ur5")

        def launch() -> Any:
            return playwright.chromium.launch(executable_path=found, args=list(SOFTWARE))

        for which, launched in (("a browser that is open", None), ("a browser that it starts", launch)):
            empty = min(empty_page(browser, launched) for _ in range(given.repeats))
            starts = [start("ur5", folder, triangles, browser, launched) for _ in range(given.repeats)]
            best = min(starts, key=lambda each: each.drawn)
            print(
                f"in {which}: an empty page of viser has drawn after {empty:.2f} s; dynx view ur5 opens the "
                f"page after {best.served:.2f} s; the browser has read it after {best.loaded:.2f} s, is "
                f"connected after {best.connected:.2f} s, has all shapes after {best.shapes:.2f} s, and has "
                f"drawn the robot after {best.drawn:.2f} s (processor time of the command "
                f"{best.processor:.2f} s), best of {given.repeats}, load {os.getloadavg()[0]:.1f}",
                flush=True,
            )
        for robot in filter(None, given.robots.split(",")):
            runs = [
                rates(browser, robot, folder, seconds=given.seconds, whole=given.whole_meshes)
                for _ in range(given.repeats)
            ]
            fastest = max(runs, key=lambda run: run.pictures)
            print(
                f"{robot}: {max(run.updates for run in runs):.1f} pose updates a second, "
                f"{fastest.pictures:.1f} pictures a second of {fastest.triangles:.0f} triangles "
                f"(processor time: the server's {fastest.processor:.2f} s a second, the browser's "
                f"{1e3 * fastest.browser:.0f} ms a picture), best of {given.repeats}, "
                f"load {os.getloadavg()[0]:.1f}",
                flush=True,
            )
        browser.close()


if __name__ == "__main__":
    main()
