"""`Viewer`: a robot, a rollout, or a world in the browser, and what a program adds to the page."""

from __future__ import annotations

import os
import webbrowser
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dynx.errors import ArgumentError, nearest, shown
from dynx.files.reading import checked_path
from dynx.model import Model
from dynx.model.configuration import whole_number
from dynx.model.loading import load
from dynx.sim import Rollout
from dynx.spatial.scalar import Floats
from dynx.viewer.controls import Controls
from dynx.viewer.drawn_robot import Look
from dynx.viewer.drawn_scene import DrawnScene
from dynx.viewer.film import camera_for, picture_of, write_film, write_picture
from dynx.viewer.motion import (
    motion_of_reference,
    motion_of_robot,
    motion_of_rollout,
    motion_of_run,
    motion_of_state,
)
from dynx.viewer.motion_view import MotionView, Series
from dynx.viewer.page import DEFAULT_HOST, DEFAULT_PORT, Page
from dynx.viewer.recording import write_recording
from dynx.viewer.robot_view import RobotView
from dynx.viewer.triangles import TRIANGLE_BUDGET, has_graphics_processor
from dynx.viewer.world_view import WorldView
from dynx.world import Scene, World
from dynx.world.comparison import WorldComparison

PICTURE_SIZE = (960, 720)
"""Width and height of an exported picture [pixels]."""


class Viewer(Controls):
    """A page in the browser that shows one robot, motion or world.

        viewer = dynx.viewer.Viewer("panda")
        stiffness = viewer.slider("stiffness", 0.0, 500.0)
        viewer.wait()

    `shown` is a `Model` or what `dynx.load` takes, a `Rollout`, two rollouts of one robot or scene, a
    `WorldComparison`, a `World`, or a `Scene`, which is opened in PyBullet or the first engine installed.
    The `options` are those of its view: `q`, `engine` and `collisions` of a robot (`RobotView`), `play` of a
    motion and `names` of two (`MotionView`), `loads`, `play` and `steps` of a world (`WorldView`).
    """

    def __init__(
        self,
        shown: object,
        *,
        host: str = DEFAULT_HOST,
        port: int = DEFAULT_PORT,
        dark: bool = False,
        whole_meshes: bool | None = None,
        open_browser: bool = False,
        **options: Any,
    ) -> None:
        """The page listens on `host` and `port`; with port 0 a free one is chosen.

        `whole_meshes` draws every triangle; by default heavy meshes are reduced where this machine has no
        graphics processor. Raises the errors of what is shown, ArgumentError for a port that is taken, and
        NotInstalledError without the extra ``viewer``.
        """
        whole = has_graphics_processor() if whole_meshes is None else whole_meshes
        look = Look(triangles=None if whole else TRIANGLE_BUDGET)
        opened = _opened(shown)
        self._dark = dark
        self.page = Page(host, port, title=f"dynx: {_title(opened)}", dark=dark)
        try:
            super().__init__(self.page)
            self.view: Any = _view(self.page, opened, look, options)
            """A `RobotView`, `MotionView` or `WorldView`: what is shown, to be moved by the program."""
        except BaseException:
            self.page.close()
            raise
        if isinstance(opened, World) and opened is not shown:
            self.page.at_end(opened.close)
        if open_browser:
            webbrowser.open(self.url)

    @property
    def url(self) -> str:
        """The address of the page."""
        return self.page.url

    @property
    def notes(self) -> tuple[str, ...]:
        """What cannot be drawn, and what is notable at the start of a world, one sentence each."""
        notes: tuple[str, ...] = self.view.notes
        return notes

    def on_part_clicked(self, clicked: Any) -> None:
        """Call `clicked(part, origin, direction)` when a part is clicked: its name, and the ray (3,), (3,)
        from the camera through the pointer, in world axes."""
        self.on_click(_clickable(self.view), clicked)

    def screenshot(self, size: tuple[int, int] = (1280, 800), timeout: float = 60.0) -> Floats:
        """Return what the first open page shows, as colours (height, width, 3) from 0 to 255.

        Raises ArgumentError where no page is open: `World.camera` draws without a browser.
        """
        clients = self.page.server.get_clients()
        if not clients:
            raise ArgumentError(f"no page is open at {self.url}; World.camera draws pictures without one")
        client = clients[min(clients)]
        if not isinstance(size, tuple | list) or len(size) != 2:
            raise ArgumentError(f"size is {shown(size)}; wanted width and height")
        width, height = (whole_number(f"size[{k}]", side, 1) for k, side in enumerate(size))
        try:
            picture = client.camera.get_render(
                height=height, width=width, transport_format="png", timeout=timeout
            )
        except (TimeoutError, RuntimeError) as error:
            raise ArgumentError(f"the page at {self.url} sent no picture: {error}") from error
        # Nothing is seen where the picture is transparent.
        opacity = picture[..., 3:] / 255.0
        return np.asarray(np.rint(picture[..., :3] * opacity + 255.0 * (1.0 - opacity)), dtype=np.uint8)

    def export(
        self, path: str | os.PathLike[str], progress: Callable[[int], object] = lambda _: None
    ) -> None:
        """Write what is shown to a file, by its suffix.

        ``.html`` shows the robot, or plays the motion, without a server and without a network; ``.gif`` is a
        film of a motion, and ``.png`` a picture, both drawn without a browser (`progress` is called with the
        number of pictures drawn). Raises ArgumentError for a live world, whose motion is not known before it
        has happened, for another suffix, and for a file that cannot be written.
        """
        view = self.view
        suffix = os.path.splitext(checked_path(path))[1].lower()
        if suffix == ".png":
            write_picture(path, self._picture())
            return
        if suffix == ".gif":
            if not isinstance(view, MotionView):
                raise ArgumentError("a film is made of a rollout, or of two motions; write a picture as .png")
            write_film(path, view.motions, progress)
            return
        if isinstance(view, WorldView):
            raise ArgumentError("a live world cannot be exported; simulate it, and export the rollout")
        if isinstance(view, MotionView):
            duration = float(view.motion.t[-1] - view.motion.t[0])
            write_recording(path, self.page, view.timeline.go_to, duration, dark=self._dark)
        else:
            write_recording(path, self.page, lambda _: None, 0.0, dark=self._dark)

    def _picture(self) -> NDArray[np.uint8]:
        view = self.view
        if isinstance(view, MotionView):
            time = float(view.motion.t[0]) + view.timeline.time
            return picture_of(view.motions, time, camera_for(view.motion, PICTURE_SIZE))
        if isinstance(view, WorldView):
            motion = motion_of_state(view.world.scene, view.world.state)
        else:
            motion = motion_of_robot(view.model, view.q)
        return picture_of((motion,), 0.0, camera_for(motion, PICTURE_SIZE))

    def wait(self, seconds: float | None = None) -> bool:
        """Wait until the page is closed, or for `seconds`; return True once it is."""
        return self.page.wait(seconds)

    def close(self) -> None:
        """End the page. Closing twice is harmless."""
        self.page.close()

    def __enter__(self) -> Viewer:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"<Viewer of {_title(self.view)} at {self.url}{', closed' if self.page.closed else ''}>"

    def _repr_html_(self) -> str:
        return self.page._repr_html_()


def view(shown: object, **options: Any) -> Viewer:
    """Return the `Viewer` of a robot, a rollout or a world; in a notebook it is shown inline.

    The port is a free one unless `port` is given.
    """
    return Viewer(shown, **{"port": 0, **options})


def _opened(shown_object: object) -> object:
    if isinstance(shown_object, Model | Rollout | World | WorldComparison):
        return shown_object
    if isinstance(shown_object, Scene):
        from dynx.world.registry import installed_worlds

        return World(shown_object, installed_worlds()[0])
    if isinstance(shown_object, tuple | list):
        if len(shown_object) == 2 and all(isinstance(each, Rollout) for each in shown_object):
            return tuple(shown_object)
        raise ArgumentError(f"shown is {shown(shown_object)}; wanted one object, or two rollouts")
    if isinstance(shown_object, str | os.PathLike | bytes):
        return load(shown_object)
    raise ArgumentError(
        f"shown is of type {type(shown_object).__name__}; wanted a robot, a Rollout, two of them, a "
        "WorldComparison, a World or a Scene"
    )


def _view(
    page: Page, opened: object, look: Look, options: dict[str, Any]
) -> RobotView | MotionView | WorldView:
    if isinstance(opened, Model):
        _check_options("a robot", options, ("q", "engine", "collisions"))
        return RobotView(page, opened, look=look, **options)
    if isinstance(opened, World):
        _check_options("a world", options, ("loads", "play", "steps"))
        return WorldView(page, opened, look=look, **options)
    pair = isinstance(opened, tuple)
    _check_options("two rollouts" if pair else "a motion", options, ("play", "names") if pair else ("play",))
    if isinstance(opened, WorldComparison):
        first, *others = (motion_of_run(opened.scene, run) for run in opened.runs[:2])
        return MotionView(page, first, *others, look=look, compare=bool(others), **options)
    if isinstance(opened, Rollout):
        motion = motion_of_rollout(opened)
        reference = motion_of_reference(opened)
        return MotionView(page, motion, reference, curves=_curves(opened), look=look, **options)
    assert isinstance(opened, tuple)
    names = options.pop("names", ("first", "second"))
    first, second = (motion_of_rollout(each, name) for each, name in zip(opened, names, strict=True))
    return MotionView(page, first, second, look=look, compare=True, **options)


def _check_options(subject: str, options: dict[str, Any], known: tuple[str, ...]) -> None:
    """Raise ArgumentError for an option that the view of `subject` does not have, or of a wrong type."""
    for name, value in options.items():
        if name not in known:
            hint = "; two rollouts are compared by Viewer((a, b))" if name == "compare" else ""
            raise ArgumentError(
                f"no option {shown(name)} of {subject}{nearest(name, known)}; it has {', '.join(known)}{hint}"
            )
        if name in ("collisions", "play", "steps") and not isinstance(value, bool):
            raise ArgumentError(f"{name} is {shown(value)}; wanted True or False")
        if name == "loads" and value is not None and not callable(value):
            raise ArgumentError(f"loads is of type {type(value).__name__}; wanted a function of the world")
        if name == "names" and not (isinstance(value, tuple | list) and len(value) == 2):
            raise ArgumentError(f"names is {shown(value)}; wanted the names of two motions")


def _curves(rollout: Rollout) -> list[Series]:
    names = rollout.summary().coordinates
    curves = []
    if rollout.reference is not None:
        curves.append(Series("tracking error [rad or m]", rollout.t, rollout.error, names))
    if len(rollout):
        curves.append(Series("torque [N m or N]", rollout.t[:-1], rollout.tau, names))
    curves.append(Series("velocity [rad/s or m/s]", rollout.t, rollout.v, names))
    return curves


def _clickable(view: RobotView | MotionView | WorldView) -> dict[str, list[Any]]:
    if isinstance(view, RobotView):
        return view.robot.visuals
    drawn: DrawnScene = view.drawn
    return {
        f"{name}/{link}": nodes
        for name, robot in drawn.robots.items()
        for link, nodes in robot.visuals.items()
    }


def _title(of: object) -> str:
    if isinstance(of, Model):
        return of.name
    if isinstance(of, RobotView):
        return of.model.name
    if isinstance(of, World):
        return of.scene.name
    if isinstance(of, WorldView):
        return of.world.scene.name
    if isinstance(of, MotionView):
        return of.motion.name
    if isinstance(of, Rollout):
        return of.model.name
    return of.scene.name if isinstance(of, WorldComparison) else "two rollouts"
