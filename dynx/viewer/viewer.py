"""Viewer in the browser: a robot, a rollout or a world, and what a program adds to the page."""

from __future__ import annotations

import math
import os
import threading
import webbrowser
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager, suppress
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dynx.argument_types import checks_types
from dynx.errors import ArgumentError, nearest, shown
from dynx.files.films import WRITERS
from dynx.files.reading import checked_path
from dynx.model import Model
from dynx.model.loading import load
from dynx.model.numbers import checked_vector, is_real, whole_number
from dynx.spatial.scalar import Floats
from dynx.steppers.camera import Camera
from dynx.viewer.appearance import PartVisibility, SavedViews, camera_of, look_from
from dynx.viewer.controls import Controls
from dynx.viewer.drawn_robot import DrawnParts, Look
from dynx.viewer.page import DEFAULT_HOST, Page
from dynx.viewer.recording import RecordingControls
from dynx.viewer.triangles import TRIANGLE_BUDGET, has_graphics_processor
from dynx.world.scenery import DARK, LIGHT

if TYPE_CHECKING:
    from dynx.sim import Rollout
    from dynx.viewer.camera_pane import CameraPane
    from dynx.viewer.export import EmbeddedPage, Stage
    from dynx.viewer.motion import MotionFrames
    from dynx.viewer.motion_view import Series
    from dynx.viewer.node_shapes import NodeShapes


_OPTIONS = {
    "a robot": ("q", "engine", "collisions"),
    "copies of a robot": ("q", "spacing", "collisions"),
    "a motion": ("play", "collisions"),
    "a batch of rollouts": ("play", "spacing", "collisions"),
    "two rollouts": ("play", "names", "collisions"),
    "a world": ("loads", "play", "steps", "collisions"),
}
"""Options of the view of each kind of subject."""

_PAGE_OPTIONS = ("host", "port", "dark", "whole_meshes", "open_browser")
"""Options of `Viewer`, whatever it shows; only named in errors."""


class View(Protocol):
    """What a page shows."""

    notes: tuple[str, ...]
    """What cannot be drawn, and what is notable at the start, one sentence each."""

    @property
    def title(self) -> str:
        """Name of the subject."""

    @property
    def legend(self) -> str:
        """HTML that says which of two motions is solid; empty for one."""

    @property
    def drawn(self) -> DrawnParts:
        """The nodes of the parts."""

    @property
    def switches(self) -> Mapping[str, Any]:
        """The boxes of the panel that show and hide something, by what they show."""

    @property
    def shows_both(self) -> bool:
        """True where collision shapes are shown together with visual ones."""

    @property
    def visuals(self) -> Mapping[str, Sequence[Any]]:
        """The nodes of the visual shapes of each part."""

    @property
    def motions(self) -> tuple[MotionFrames, ...]:
        """The motions that are shown at present; what stands still is a motion of one frame."""

    @property
    def time(self) -> float:
        """The time of these motions that is shown [s]."""

    @property
    def duration(self) -> float | None:
        """Length of the motion [s]; 0 for what stands still, None for what is not known before it happens."""

    def go_to(self, time: float) -> None:
        """Show the motion at a time from 0 to its length [s]."""


def open_subject(shown_object: object) -> object:
    """Return what is shown: a Model, a Rollout, two of them, BatchRollouts, a WorldComparison or a World.

    A Scene is opened as a World in the first engine installed, and what `dynx.load` takes is loaded. Raises
    the errors of loading, and ArgumentError for anything else.
    """
    if isinstance(shown_object, str | os.PathLike | bytes):
        shown_object = load(shown_object)
    if isinstance(shown_object, Model):
        return shown_object
    from dynx.sim import BatchRollouts, Rollout
    from dynx.world import Scene, World
    from dynx.world.comparison import WorldComparison

    if isinstance(shown_object, Rollout | BatchRollouts | World | WorldComparison):
        return shown_object
    if isinstance(shown_object, Scene):
        from dynx.steppers.registry import installed_worlds

        return World(shown_object, installed_worlds()[0])
    if isinstance(shown_object, tuple | list):
        if len(shown_object) == 2 and all(isinstance(each, Rollout) for each in shown_object):
            return tuple(shown_object)
        raise ArgumentError(f"shown is {shown(shown_object)}; wanted one object, or two rollouts")
    raise ArgumentError(
        f"shown is of type {type(shown_object).__name__}; wanted a robot, a Rollout, two of them, "
        "BatchRollouts, a WorldComparison, a World or a Scene"
    )


def is_world(opened: object) -> bool:
    """Check whether a subject is a World, without importing worlds for one that is not."""
    if isinstance(opened, Model | tuple):
        return False
    from dynx.world import World

    return isinstance(opened, World)


def is_batch(opened: object) -> bool:
    """Check whether a subject is a batch of rollouts, without importing simulations for one that is not."""
    if isinstance(opened, Model | tuple):
        return False
    from dynx.sim import BatchRollouts

    return isinstance(opened, BatchRollouts)


def shows_copies(opened: object, options: Mapping[str, Any]) -> bool:
    """Check whether a subject is a robot with a row of q for each of its copies."""
    q: Any = options.get("q")
    # Numbers that are nested unevenly are refused by the view of one robot.
    with suppress(ValueError):
        return isinstance(opened, Model) and q is not None and np.ndim(q) == 2
    return False


def check_options(opened: object, options: Mapping[str, Any]) -> None:
    """Raise ArgumentError for an option that the view of a subject does not have, or of a wrong type."""
    subject = (
        "copies of a robot"
        if shows_copies(opened, options)
        else "a robot"
        if isinstance(opened, Model)
        else "two rollouts"
        if isinstance(opened, tuple)
        else "a world"
        if is_world(opened)
        else "a batch of rollouts"
        if is_batch(opened)
        else "a motion"
    )
    known = _OPTIONS[subject]
    for name, value in options.items():
        if name not in known:
            known += _PAGE_OPTIONS
            hint = "; two rollouts are compared by Viewer((a, b))" if name == "compare" else ""
            # Without a similar name `nearest` lists some, and here all are listed.
            similar = nearest(name, known)
            similar = similar if "did you mean" in similar else ""
            raise ArgumentError(
                f"no option {shown(name)} of {subject}{similar}; it has {', '.join(known)}{hint}"
            )
        if name in ("collisions", "play", "steps"):
            check_switches({name: value})
        if name == "spacing" and not (is_real(value) and 0.0 <= value < math.inf):
            raise ArgumentError(f"spacing is {shown(value)}; wanted 0 or a positive length [m]")
        if name == "loads" and value is not None and not callable(value):
            raise ArgumentError(f"loads is of type {type(value).__name__}; wanted a function of the world")
        if name == "names" and not (isinstance(value, tuple | list) and len(value) == 2):
            raise ArgumentError(f"names is {shown(value)}; wanted the names of two motions")


def check_switches(switches: Mapping[str, object]) -> None:
    """Raise ArgumentError for a switch, by its name, that is neither True nor False."""
    for name, value in switches.items():
        if not isinstance(value, bool):
            raise ArgumentError(f"{name} is {shown(value)}; wanted True or False")


def title_of(opened: Any) -> str:
    """Return the title of the page of a subject."""
    if isinstance(opened, Model):
        return opened.name
    if isinstance(opened, tuple):
        return "two rollouts"
    if is_batch(opened):
        return f"{len(opened)} rollouts of {opened.scenario.model.name}"
    name: str = opened.scene.name if hasattr(opened, "scene") else opened.model.name
    return name


def view_of(page: Page, opened: Any, look: Look, options: dict[str, Any]) -> View:
    """Show a subject of `open_subject` on the page."""
    if shows_copies(opened, options):
        from dynx.viewer.copies_view import CopiesView

        return CopiesView(page, opened, look=look, **options)
    if isinstance(opened, Model):
        from dynx.viewer.robot_view import RobotView

        return RobotView(page, opened, look=look, **options)
    if is_world(opened):
        from dynx.viewer.world_view import WorldView

        return WorldView(page, opened, look=look, **options)
    return _motion_view(page, opened, look, options)


def _motion_view(page: Page, opened: Any, look: Look, options: dict[str, Any]) -> View:
    from dynx.sim import Rollout
    from dynx.viewer.motion import motion_of_batch, motion_of_reference, motion_of_rollout, motion_of_run
    from dynx.viewer.motion_view import MotionView

    if is_batch(opened):
        motion, notes = motion_of_batch(opened, options.pop("spacing", 0.0))
        return MotionView(page, motion, look=look, title=title_of(opened), notes=notes, **options)
    if isinstance(opened, Rollout):
        motion, reference = motion_of_rollout(opened), motion_of_reference(opened)
        return MotionView(page, motion, reference, curves=_curves(opened), look=look, **options)
    if isinstance(opened, tuple):
        names = options.pop("names", ("first", "second"))
        first, second = (motion_of_rollout(each, name) for each, name in zip(opened, names, strict=True))
        return MotionView(page, first, second, look=look, compare=True, title=title_of(opened), **options)
    runs = opened.runs[:2]
    first, *others = (motion_of_run(opened.scene, run) for run in runs)
    notes = [
        f"{run.engine}: {note}"
        for run in runs
        for note in (*run.notes, *([] if run.error is None else [f"the motion ends early: {run.error}"]))
    ]
    options |= {"compare": bool(others), "title": title_of(opened), "notes": notes}
    return MotionView(page, first, *others, look=look, **options)


def _curves(rollout: Rollout) -> list[Series]:
    from dynx.viewer.motion_view import Series

    names = rollout.summary().coordinates
    curves = []
    if rollout.reference is not None:
        curves.append(Series("tracking error [rad or m]", rollout.t, rollout.error, names))
    if len(rollout):
        curves.append(Series("torque [N m or N]", rollout.t[:-1], rollout.tau, names))
    curves.append(Series("velocity [rad/s or m/s]", rollout.t, rollout.v, names))
    return curves


def _checked_camera(camera: object) -> Camera:
    if not isinstance(camera, Camera):
        raise ArgumentError(f"camera is of type {type(camera).__name__}; wanted a Camera")
    if camera.part is not None:
        raise ArgumentError(f"camera is on the part {shown(camera.part)}; wanted one in the world")
    return camera


MAX_FPS = 100.0
"""Largest number of pictures of a film a second: GIF files tell hundredths of a second apart."""


def _checked_fps(fps: float, suffix: str) -> float:
    """Return the pictures a second of a film. Raises ArgumentError for another suffix or number."""
    given = f"{fps:g}" if is_real(fps) else shown(fps)
    if suffix not in WRITERS:
        raise ArgumentError(f"fps is {given}; wanted None: it is of a film, not of {suffix or 'a page'}")
    if not is_real(fps) or not 0.0 < fps <= MAX_FPS:
        raise ArgumentError(f"fps is {given}; wanted pictures a second above 0, at most {MAX_FPS:g}")
    return float(fps)


def _checked_size(size: object) -> tuple[int, int]:
    if not isinstance(size, tuple | list) or len(size) != 2:
        raise ArgumentError(f"size is {shown(size)}; wanted width and height")
    width, height = (whole_number(f"size[{k}]", side, 1) for k, side in enumerate(size))
    return width, height


PICTURE_SIZE = (960, 720)
"""Width and height of an exported picture [pixels]."""

FILM_SIZE = (480, 360)
"""Width and height of an exported film [pixels]."""


class Viewer(Controls):
    """A page in the browser that shows one robot, motion or world.

        viewer = dynx.viewer.Viewer("panda")
        stiffness = viewer.slider("stiffness", 0.0, 500.0)
        viewer.wait()

    `shown` is a `Model` or what `dynx.load` takes, a `Rollout`, two rollouts of one robot or scene,
    `BatchRollouts`, a `WorldComparison`, a `World`, or a `Scene`, which is opened in PyBullet or the first
    engine installed. The `options` are those of its view: `q`, `engine` and `collisions` of a robot
    (`RobotView`); `q` (n, nq) and `spacing` of n copies of a robot (`CopiesView`); `play` of a motion,
    `names` of two and `spacing` of a batch (`MotionView`); `loads`, `play` and `steps` of a world
    (`WorldView`).
    """

    def __init__(
        self,
        shown: object,
        *,
        host: str = DEFAULT_HOST,
        port: int | None = None,
        dark: bool = False,
        whole_meshes: bool | None = None,
        open_browser: bool = False,
        **options: Any,
    ) -> None:
        """The page listens on `host` and `port`, by default on 8080 or the next port that is free; the system
        chooses one for port 0.

        `whole_meshes` draws every triangle; by default heavy meshes are reduced where this machine has no
        graphics processor. Raises the errors of what is shown, ArgumentError for a port that is taken, and
        NotInstalledError without the extra ``viewer``.
        """
        meshes = {} if whole_meshes is None else {"whole_meshes": whole_meshes}
        check_switches({"dark": dark, "open_browser": open_browser, **meshes})
        whole = has_graphics_processor() if whole_meshes is None else whole_meshes
        self._look = Look(triangles=None if whole else TRIANGLE_BUDGET, scenery=DARK if dark else LIGHT)
        opened: Any = open_subject(shown)
        check_options(opened, options)
        self.page = Page(host, port, title=f"dynx: {title_of(opened)}", dark=dark, plain=not whole)
        if open_browser:
            # The browser starts and loads the page while the shapes are read.
            threading.Thread(target=webbrowser.open, args=(self.url,), daemon=True).start()
        super().__init__(self.page)
        self._views = SavedViews()
        self.view: Any = self._view_of(opened, shown, options)
        """A `RobotView`, `CopiesView`, `MotionView` or `WorldView`: what is shown, moved by the program."""

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
                view = view_of(self.page, opened, self._look, options)
                self._views.add_controls(self.page)
                self._appearance = PartVisibility(self.page, view)
                RecordingControls(self.page, view)
                return view
        except BaseException:
            self.page.close()
            raise

    @property
    def url(self) -> str:
        """The address of the page."""
        return self.page.url

    @property
    def notes(self) -> tuple[str, ...]:
        """Sentences on what cannot be drawn, on doubtful input at the start of a world, and on a host that
        other machines can reach."""
        return (*self.page.notes, *self.view.notes)

    def update(self, q: ArrayLike | None = None) -> None:
        """Show the present state, from a loop of the program. It is the configuration q (nq,) of a robot, the
        configurations (n, nq) of its copies, or the state of a world that the program steps
        (``steps=False``).

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

    @checks_types
    def follow(self, part: str | None, *, first_person: bool = False) -> None:
        """Let the camera of every page move with a part: a link of a robot, or in a motion or a world a body
        or ``robot/link``. A robot's name stands for its root link. With None the camera stays where it is.

        The page keeps its view of the part until its user turns, zooms or shifts it. With `first_person` the
        camera looks along the x axis of the part, with its z axis up. It stands where this axis leaves the
        shapes of the part and of the links fixed to it. Raises ArgumentError for an unknown part.
        """
        self.page.check_open()
        self.view.camera.follow(part, first_person=first_person)

    @checks_types
    def set_visible(self, part: str | None, visible: bool = True) -> None:
        """Show or hide a part, named as for `follow`; None for all parts. Raises ArgumentError for an unknown
        part.

        Exported pages, pictures and films show what is shown.
        """
        self.page.check_open()
        self._appearance.set_visible(part, visible)

    @checks_types
    def set_opacity(self, opacity: float, part: str | None = None) -> None:
        """Set the opacity of a part, or of all: 1 is the opacity of its description, 0 is invisible.

        Raises ArgumentError for an unknown part and for an opacity that is not from 0 to 1.
        """
        self.page.check_open()
        self._appearance.set_opacity(part, opacity)

    @property
    def camera(self) -> Camera:
        """The camera of the first open page, in the world, with the size of its picture; its `intrinsics` are
        those of the page.

        Raises ArgumentError where no page is open.
        """
        return camera_of(self._first_page())

    @checks_types
    def look_from(self, camera: Camera) -> None:
        """Give all open pages the view of a camera in the world. Raises ArgumentError for a camera on a
        part."""
        self.page.check_open()
        for client in self.page.server.get_clients().values():
            look_from(client, _checked_camera(camera))

    @checks_types
    def save_view(self, name: str, camera: Camera | None = None) -> None:
        """Save a view under a name, by default the view of the first open page; pages offer the saved views.

        Raises ArgumentError without a camera where no page is open.
        """
        self.page.check_open()
        if not isinstance(name, str) or not name:
            raise ArgumentError(f"name of a view is {shown(name)}; wanted a str that is not empty")
        self._views.save(name, self.camera if camera is None else _checked_camera(camera))

    @checks_types
    def show_view(self, name: str) -> None:
        """Give all open pages a view that was saved. Raises ArgumentError for an unknown name."""
        self.look_from(self._views.find(name))

    @property
    def views(self) -> Mapping[str, Camera]:
        """The cameras of the saved views by name."""
        return dict(self._views.cameras)

    def _first_page(self) -> Any:
        self.page.check_open()
        clients = self.page.server.get_clients()
        if not clients:
            raise ArgumentError(f"no page is open at {self.url}; World.camera draws pictures without one")
        return clients[min(clients)]

    @checks_types
    def camera_pane(self, camera: Camera, name: str = "camera", shows: str = "colours") -> CameraPane:
        """Add a picture of a camera in the scene, which follows what the page shows: its ``"colours"``, its
        ``"depth"``, or its ``"parts"``, each in a different colour.

        It is drawn as `World.camera` draws it, by this machine, at most 8 times a second; small pictures,
        such as 160 x 120 pixels, come sooner. `remove_all` removes it. Raises ArgumentError for another kind,
        and UnknownNameError for an unknown part that carries the camera.
        """
        from dynx.viewer.camera_pane import CameraPane

        self.page.check_open()
        if not isinstance(name, str) or not name:
            raise ArgumentError(f"name of a pane is {shown(name)}; wanted a str that is not empty")
        view = self.view
        pane = CameraPane(self.page, lambda: (view.motions[0], view.time), camera, name, shows)
        view.drawn.on_placed(lambda _: pane.changed())
        self._added_control(pane)
        return pane

    def on_part_clicked(self, clicked: Any) -> None:
        """Call `clicked(part, origin, direction)` when a part is clicked: its name, and the ray (3,), (3,)
        from the camera through the pointer, in world axes."""
        self.on_click(self.view.visuals, clicked)

    def screenshot(self, size: tuple[int, int] = (1280, 800), timeout: float = 60.0) -> Floats:
        """Return what the first open page shows, as colours (height, width, 3) from 0 to 255.

        Raises ArgumentError where no page is open: `World.camera` draws without a browser.
        """
        client = self._first_page()
        width, height = _checked_size(size)
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
        self,
        path: str | os.PathLike[str],
        progress: Callable[[int], object] = lambda _: None,
        *,
        size: tuple[int, int] | None = None,
        camera: Camera | None = None,
        direction: ArrayLike | None = None,
        fps: float | None = None,
    ) -> None:
        """Write what is shown to a file, by its suffix.

        ``.html`` shows the robot, or plays the motion, without a server and without a network. ``.gif``,
        ``.webp`` and ``.mp4`` (extra ``film``) are films of a motion, and ``.png`` is a picture, also of a
        live world. All are drawn without a browser. `progress` is called with the number of pictures drawn.
        Pictures and films have the given `size`, width and height [pixels], and are seen from a `direction`
        (3,) in the world. With a `camera` they have its view and its size. A film has `fps` pictures a
        second, or 12.5 and at most 500 in all for None. Pictures and films show the marks, lines and text of
        the page, hide the parts that it hides, and state the size of the tiles of the ground.

        Raises ArgumentError for a page or a film of a live world, whose motion is not known in advance, for
        another suffix, for a file that cannot be written, for a page whose size, camera or direction is
        given, and for an `fps` of another file than a film or beyond 100;
        NotInstalledError without the package that writes the film.
        """
        from dynx.viewer.export import write_film, write_picture, write_recording

        self.page.check_open()
        view = self.view
        suffix = os.path.splitext(checked_path(path))[1].lower()
        if fps is not None:
            fps = _checked_fps(fps, suffix)
        if suffix == ".png":
            write_picture(path, self._picture(size, camera, direction))
        elif suffix in WRITERS:
            if not view.duration:
                raise ArgumentError("a film is made of a rollout, or of two motions; write a picture as .png")
            before = view.time - float(view.motions[0].t[0])
            stage = self._stage(size, camera, direction, FILM_SIZE)
            write_film(path, view.motions, progress, stage=stage, nodes_at=self._nodes_at, fps=fps)
            view.go_to(before)
        elif size is not None or camera is not None or direction is not None:
            options = {"size": size, "camera": camera, "direction": direction}
            name = next(each for each, value in options.items() if value is not None)
            raise ArgumentError(
                f"{name} is {shown(options[name])}; wanted None: it is of a picture or a film, not of a page"
            )
        elif view.duration is None:
            raise ArgumentError("a live world cannot be exported; simulate it, and export the rollout")
        else:
            title = f"dynx: {view.title}"
            write_recording(path, self.page, view.go_to, view.duration, title=title, legend=view.legend)

    def _stage(
        self,
        size: tuple[int, int] | None,
        camera: Camera | None,
        direction: ArrayLike | None,
        usual: tuple[int, int],
        time: float | None = None,
    ) -> Stage:
        from dynx.viewer.export import stage_for

        given: dict[str, Any] = {}
        if camera is not None:
            if size is not None or direction is not None:
                raise ArgumentError("a camera has a size and a direction of its own: give it alone")
            given["camera"] = _checked_camera(camera)
        if direction is not None:
            towards = checked_vector("direction", direction)
            length = float(np.linalg.norm(towards))
            if not np.hypot(*towards[:2]) > 1e-6 * length:
                raise ArgumentError(
                    f"direction is {towards.tolist()}; wanted one that is not along the z axis of the world"
                )
            given["direction"] = towards / length
        wide, high = _checked_size(usual if size is None else size)
        first, *others = self.view.motions
        given |= {"time": time, "ghost": next(iter(others), None)}
        stage = stage_for(first, (wide, high), dark=self.page.dark, **given)
        # A robot's parts are its links, those of a motion have its name before them.
        opacities = {
            part if part in self.view.motions[0].poses else f"{self.view.title}/{part}": value
            for part, value in self._appearance.opacities.items()
        }
        return stage._replace(opacities=opacities)

    def _picture(
        self, size: tuple[int, int] | None, camera: Camera | None, direction: ArrayLike | None
    ) -> NDArray[np.uint8]:
        """Return what is shown, drawn without a browser, as colours (height, width, 3)."""
        from dynx.viewer.export import picture_of

        stage = self._stage(size, camera, direction, PICTURE_SIZE, self.view.time)
        return picture_of(self.view.motions, self.view.time, stage, self._nodes(stage.camera))

    def _nodes_at(self, time: float, camera: Camera) -> NodeShapes:
        """Return what is seen beside the parts at a time of the motion [s]."""
        self.view.go_to(time)
        return self._nodes(camera)

    def _nodes(self, camera: Camera) -> NodeShapes:
        from dynx.viewer.node_shapes import Words, node_shapes

        with self.page.lock:
            found = node_shapes(self.page, camera, collisions=self.view.shows_both)
            written = tuple(
                Words(each.text, np.array(each.point), each.colour, each.size) for each in self._written
            )
        return found._replace(words=(*found.words, *written))

    def set_shown(self, what: str, visible: bool = True) -> None:
        """Show or hide the item `what` that the panel lists below "show", such as ``"frames"``,
        ``"contact forces"``, ``"inertia ellipsoids"`` or ``"collision shapes"``. Raises ArgumentError for
        what the view does not have."""
        self.page.check_open()
        check_switches({"visible": visible})
        switches = self.view.switches
        if not isinstance(what, str) or what not in switches:
            raise ArgumentError(
                f"what is {shown(what)}, which the panel does not show{nearest(what, switches)}"
            )
        switches[what].value = visible

    def embed(self, height: int = 500) -> EmbeddedPage:
        """Return the robot or the motion as a page without a server, which a notebook shows and stores.

        It needs neither this program nor a network, so that it also plays in a notebook on another machine,
        and in a notebook that is only read. `height` is in pixels. Raises ArgumentError for a live world,
        whose motion is not known before it has happened, and for a page of more than 5 MB.
        """
        from dynx.viewer.export import embedded_page

        self.page.check_open()
        pixels, view = whole_number("height", height, 1), self.view
        if view.duration is None:
            raise ArgumentError("a live world cannot be embedded; simulate it, and embed the rollout")
        title = f"dynx: {view.title}"
        return embedded_page(
            self.page, view.go_to, view.duration, title=title, legend=view.legend, height=pixels
        )

    def record(
        self, path: str | os.PathLike[str], progress: Callable[[int], object] = lambda _: None
    ) -> AbstractContextManager[None]:
        """Record what the page shows in a ``with`` block as a film, which is drawn at its end without a
        browser: ``.gif``, or ``.mp4`` (extra ``film``).

        A film of a live world plays in the time of the world, any other film in the time of the clock. A film
        has about 12.5 pictures a second, and ends after 40 s. Raises ArgumentError for another suffix and for
        a file that cannot be written, and NotInstalledError without the package that writes the film.
        """
        from dynx.viewer.recording import recorded_film

        self.page.check_open()
        return recorded_film(self.page, self.view, path, progress, dark=self.page.dark)

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
    """Return the `Viewer` of a robot, a rollout or a world.

    A notebook shows the viewer inline. By default dynx takes a free `port`.
    """
    return Viewer(shown, **{"port": 0, **options})
