"""`Viewer`: a robot, a rollout, or a world in the browser, and what a program adds to the page."""

from __future__ import annotations

import os
import threading
import webbrowser
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dynx.errors import ArgumentError, shown
from dynx.files.reading import checked_path
from dynx.model.numbers import whole_number
from dynx.spatial.scalar import Floats
from dynx.viewer.controls import Controls
from dynx.viewer.drawn_robot import Look
from dynx.viewer.page import DEFAULT_HOST, DEFAULT_PORT, Page
from dynx.viewer.subjects import check_options, check_switches, is_world, open_subject, title_of, view_of
from dynx.viewer.triangles import TRIANGLE_BUDGET, has_graphics_processor

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
        meshes = {} if whole_meshes is None else {"whole_meshes": whole_meshes}
        check_switches({"dark": dark, "open_browser": open_browser, **meshes})
        whole = has_graphics_processor() if whole_meshes is None else whole_meshes
        self._look = Look(triangles=None if whole else TRIANGLE_BUDGET)
        opened: Any = open_subject(shown)
        check_options(opened, options)
        self.page = Page(host, port, title=f"dynx: {title_of(opened)}", dark=dark, plain=not whole)
        if open_browser:
            # The browser starts and loads the page while the shapes are read.
            threading.Thread(target=webbrowser.open, args=(self.url,), daemon=True).start()
        super().__init__(self.page)
        self.view: Any = self._view_of(opened, shown, options)
        """A `RobotView`, `MotionView` or `WorldView`: what is shown, to be moved by the program."""

    def show(self, shown: object, **options: Any) -> None:
        """Show something else on the same page, with the `options` of its view; what was shown is removed,
        with the controls of the program. Pages that are open keep their cameras.

        Raises the errors of what is shown, after which the page is closed if it was cleared already, and
        ArgumentError for a viewer that is closed.
        """
        opened: Any = open_subject(shown)
        check_options(opened, options)
        self.page.clear(f"dynx: {title_of(opened)}")
        self.view = self._view_of(opened, shown, options)

    def _view_of(self, opened: Any, shown: object, options: dict[str, Any]) -> Any:
        if is_world(opened) and opened is not shown:
            self.page.at_end(opened.close)
        try:
            with self.page.lock:
                return view_of(self.page, opened, self._look, options)
        except BaseException:
            self.page.close()
            raise

    @property
    def url(self) -> str:
        """The address of the page."""
        return self.page.url

    @property
    def notes(self) -> tuple[str, ...]:
        """What cannot be drawn, what is notable at the start of a world, and a host beyond this machine, one
        sentence each."""
        return (*self.page.notes, *self.view.notes)

    def update(self, q: ArrayLike | None = None) -> None:
        """Show the present state, from a loop of the program: the configuration q (nq,) of a robot, or the
        state of a world that the program steps (``steps=False``).

        The page shows as many of these as it can; the last is always among them. Raises ArgumentError for a
        robot without q, a world with one, a recorded motion, which has a timeline, and a viewer that is
        closed.
        """
        self.page.check_open()
        view = self.view
        if view.duration is None:
            if q is not None:
                raise ArgumentError(f"update of the world {shown(view.title)} takes no q: it has a state")
            view.draw()
        elif not hasattr(view, "put"):
            raise ArgumentError(f"{shown(view.title)} is a recorded motion, which the timeline moves")
        elif q is None:
            raise ArgumentError(f"update of the robot {shown(view.title)} needs its configuration q")
        else:
            view.put(q)

    def follow(self, part: str | None, *, first_person: bool = False) -> None:
        """Let the camera of every page move with a part: a link of a robot, or in a motion or a world a body
        or ``robot/link``; with None it stays where it is.

        The page turns around the part as before. With `first_person` it looks from the origin of the part
        along its x axis, with its z axis up. Raises ArgumentError for an unknown part.
        """
        self.page.check_open()
        self.view.camera.follow(part, first_person=first_person)

    def on_part_clicked(self, clicked: Any) -> None:
        """Call `clicked(part, origin, direction)` when a part is clicked: its name, and the ray (3,), (3,)
        from the camera through the pointer, in world axes."""
        self.on_click(self.view.visuals, clicked)

    def screenshot(self, size: tuple[int, int] = (1280, 800), timeout: float = 60.0) -> Floats:
        """Return what the first open page shows, as colours (height, width, 3) from 0 to 255.

        Raises ArgumentError where no page is open: `World.camera` draws without a browser.
        """
        self.page.check_open()
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
        from dynx.viewer.export import camera_for, picture_of, write_film, write_picture, write_recording

        self.page.check_open()
        view = self.view
        suffix = os.path.splitext(checked_path(path))[1].lower()
        if suffix == ".png":
            motions = view.motions
            camera = camera_for(motions[0], PICTURE_SIZE)
            write_picture(path, picture_of(motions, view.time, camera))
        elif suffix == ".gif":
            if not view.duration:
                raise ArgumentError("a film is made of a rollout, or of two motions; write a picture as .png")
            write_film(path, view.motions, progress)
        elif view.duration is None:
            raise ArgumentError("a live world cannot be exported; simulate it, and export the rollout")
        else:
            title = f"dynx: {view.title}"
            write_recording(path, self.page, view.go_to, view.duration, title=title, legend=view.legend)

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
        return f"<Viewer of {self.view.title} at {self.url}{', closed' if self.page.closed else ''}>"

    def _repr_html_(self) -> str:
        return self.page._repr_html_()


def view(shown: object, **options: Any) -> Viewer:
    """Return the `Viewer` of a robot, a rollout or a world; in a notebook it is shown inline.

    The port is a free one unless `port` is given.
    """
    return Viewer(shown, **{"port": 0, **options})
