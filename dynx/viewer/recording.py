"""Films and pictures of what a page shows while it is moved: by its user, by a live world, by a program."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from dynx.errors import DynxError
from dynx.files.films import WRITERS, film_suffix
from dynx.files.temporary import temporary_folder
from dynx.spatial.scalar import Floats
from dynx.viewer.appearance import camera_of
from dynx.viewer.page import Page

if TYPE_CHECKING:
    from dynx.viewer.motion import MotionFrames

PICTURE_KEY = "C"
"""Key that saves a picture of its page."""

LONGEST = 40.0
"""Longest time that is recorded [s]: that of the pictures that a film may have."""

_LEAST_STEP = 0.04
"""Least time between two states that are kept [s], half of that between two pictures."""


class FilmRecorder:
    """Poses of the parts that a view shows, while they change; a film is drawn of them later.

    Its time is that of a live world, and that of the clock for anything else. A second motion, which is seen
    through, is left out.
    """

    def __init__(self, view: Any) -> None:
        self._view = view
        self._on = False
        self._t: list[float] = []
        self._poses: list[dict[str, Floats]] = []
        self._now = self._clock_before = 0.0
        self._drawn: Any = None

    @property
    def recording(self) -> bool:
        """True between `start` and `stop`."""
        return self._on

    def start(self) -> None:
        """Begin with what is shown now."""
        self._t, self._poses, self._now, self._clock_before = [], [], 0.0, self._clock()
        self._on = True
        self._watch()
        self._keep()

    def stop(self) -> MotionFrames:
        """End, and return what was recorded."""
        if self._on:
            self._advance()
            self._keep(last=True)
        self._on = False
        first: MotionFrames = self._view.motions[0]
        poses = {name: np.array([each[name] for each in self._poses]) for name in self._poses[0]}
        return replace(first, t=np.array(self._t), poses=poses, contacts=())

    def _watch(self) -> None:
        # A world that is replaced is drawn anew.
        if self._drawn is not self._view.drawn:
            self._drawn = self._view.drawn
            self._drawn.on_placed(self._placed)

    def _clock(self) -> float:
        world = getattr(self._view, "world", None)
        return time.monotonic() if world is None else float(world.time)

    def _advance(self) -> None:
        now = self._clock()
        # A world that is reset begins again; the film goes on.
        self._now += max(now - self._clock_before, 0.0)
        self._clock_before = now

    def _placed(self, _: Mapping[str, Floats]) -> None:
        if not self._on:
            return
        self._advance()
        if self._now >= LONGEST:
            self._on = False
        elif self._now - self._t[-1] >= _LEAST_STEP:
            self._keep()

    def _keep(self, *, last: bool = False) -> None:
        if last and self._t and self._now - self._t[-1] < 1e-9:
            self._t.pop()
            self._poses.pop()
        (first, *_) = self._view.motions
        self._t.append(self._now)
        # The parts of a robot that is shown alone are its links.
        names = {each: each for each in self._drawn.parts}
        if not hasattr(self._drawn, "robots"):
            names = {f"{robot}/{link}": link for robot in first.robots for link in names}
        self._poses.append({name: self._drawn.pose(part) for name, part in names.items()})


@contextmanager
def recorded_film(
    page: Page, view: Any, path: str | os.PathLike[str], progress: Callable[[int], object], *, dark: bool
) -> Iterator[None]:
    """Record what is shown in a ``with`` block, and write it as a film. Raises the errors of
    `write_pictures`."""
    # Imported here, because a page begins without drawing films.
    from dynx.viewer.export import write_film

    film_suffix(path)
    recorder = FilmRecorder(view)
    with page.lock:
        recorder.start()
    yield
    with page.lock:
        motion = recorder.stop()
    write_film(path, (motion,), progress, dark=dark)


class RecordingControls:
    """Buttons that save a picture of their page, and a film of what it shows, as files of its browser."""

    def __init__(self, page: Page, view: Any) -> None:
        self._page, self._view = page, view
        self._recorder = FilmRecorder(view)
        gui = page.gui
        with gui.add_folder("pictures", expand_by_default=False):
            picture = gui.add_button(f"save picture ({PICTURE_KEY})")
            self._button = gui.add_button("record film")
            self._suffix = gui.add_dropdown("as", tuple(WRITERS))
            self._state = gui.add_text("film", "", disabled=True, visible=False)
        picture.on_click(lambda event: self._save_picture(event.client))
        self._button.on_click(lambda event: self._record(event.client))
        page.on_own_key_of(PICTURE_KEY, "save picture", self._save_picture)

    def _save_picture(self, client: Any) -> None:
        from dynx.world.camera import png_bytes

        camera = client.camera
        width, height = int(camera.image_width), int(camera.image_height)
        rgba = camera.get_render(height=height, width=width, transport_format="png")
        opacity = rgba[..., 3:] / 255.0
        rgb = np.rint(rgba[..., :3] * opacity + 255.0 * (1.0 - opacity)).astype(np.uint8)
        client.send_file_download("dynx.png", png_bytes(rgb), save_immediately=True)

    def _record(self, client: Any) -> None:
        with self._page.lock:
            if not self._recorder.recording and self._button.label == "record film":
                self._recorder.start()
                self._button.label = "stop and save"
                return
            motion = self._recorder.stop()
            self._button.label, self._button.disabled = "record film", True
            self._state.visible = True
        threading.Thread(target=self._save, args=(client, motion), name="dynx film", daemon=True).start()

    def _save(self, client: Any, motion: MotionFrames) -> None:
        from dynx.viewer.export import SIZE, stage_for, write_film

        name = f"dynx{self._suffix.value}"
        try:
            view = camera_of(client)
            high = max(2, 2 * round(0.5 * SIZE[0] * view.size[1] / view.size[0]))
            stage = stage_for(motion, dark=self._page.dark)._replace(
                camera=replace(view, size=(SIZE[0], high))
            )
            with temporary_folder() as folder:
                path = Path(folder, name)
                write_film(path, (motion,), self._progress, stage=stage)
                client.send_file_download(name, path.read_bytes(), save_immediately=True)
            text = f"{name} is saved"
        except DynxError as error:
            text = str(error)
        with self._page.lock:
            if not self._page.closed:
                self._state.value, self._button.disabled = text, False

    def _progress(self, count: int) -> None:
        self._state.value = f"{count} pictures are drawn"
