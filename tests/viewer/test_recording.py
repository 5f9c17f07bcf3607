"""Films and pictures of what a page shows, from a program and from the page."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import dynx
from dynx.errors import ArgumentError
from dynx.model import Pose
from dynx.viewer.export import MAX_PICTURES, PICTURES_PER_SECOND
from dynx.viewer.recording import LONGEST, FilmRecorder
from dynx.world import Scene, World, box, ground
from tests.viewer.conftest import OpenPage, connected, wait_for_rest

CUBE = box("cube", (0.4, 0.4, 0.4), mass=1.0, pose=Pose((0.0, 0.0, 1.0)))
SCENE = Scene("yard", bodies=(ground(), CUBE))


def test_the_longest_film_has_as_many_pictures_as_one_may_have() -> None:
    assert LONGEST * PICTURES_PER_SECOND == MAX_PICTURES


def test_a_film_of_a_world_has_its_time_and_its_states() -> None:
    with World(SCENE) as world, world.view(steps=False) as viewer:
        recorder = FilmRecorder(viewer.view)
        recorder.start()
        states = {0.0: world.state.bodies["cube"].position.copy()}
        for k in range(60):
            if k == 30:
                world.reset()
            world.step(5)
            viewer.update()
            if k < 30:
                states[world.time] = world.state.bodies["cube"].position.copy()
        motion = recorder.stop()
        assert motion.t[0] == 0.0
        assert (np.diff(motion.t) > 0.0).all()
        # The film goes on where the world begins again.
        assert motion.t[-1] == pytest.approx(300 * world.dt, rel=0.1)
        times = np.array(list(states))
        first = motion.t < 149 * world.dt
        assert first.sum() > 2
        for t, T in zip(motion.t[first], motion.poses["cube"][first], strict=True):
            near = states[float(times[np.abs(times - t).argmin()])]
            assert np.allclose(T[:3, 3], near, atol=1e-6)


def test_a_program_records_a_film_without_a_browser(tmp_path: Path) -> None:
    pillow = pytest.importorskip("PIL.Image")
    path = tmp_path / "world.gif"
    drawn: list[int] = []
    with World(SCENE) as world, world.view(steps=False) as viewer:
        with viewer.record(path, drawn.append):
            for _ in range(12):
                world.step(5)
                viewer.update()
        with pillow.open(path) as film:
            assert film.n_frames == max(drawn) == max(1, round(60 * world.dt * PICTURES_PER_SECOND))
        with pytest.raises(ArgumentError, match="has no suffix of a film"), viewer.record("film.avi"):
            pass
    arm = dynx.load("six_axis_arm")
    with arm.view() as viewer:
        recorder = FilmRecorder(viewer.view)
        recorder.start()
        viewer.update(arm.random(0))
        motion = recorder.stop()
        last = viewer.view.motions[0]
        assert motion.poses.keys() == last.poses.keys()
        for part, T in last.poses.items():
            assert np.allclose(motion.poses[part][-1], T[0])


# imageio-ffmpeg leaves the pipe of a process that has ended to the garbage collector.
@pytest.mark.filterwarnings("ignore::ResourceWarning", "ignore::pytest.PytestUnraisableExceptionWarning")
def test_a_film_of_a_world_plays_in_its_time(tmp_path: Path) -> None:
    pillow = pytest.importorskip("PIL.Image")
    ffmpeg = pytest.importorskip("imageio_ffmpeg", reason="needs the extra film")
    gif, mp4, still = tmp_path / "a.gif", tmp_path / "a.mp4", tmp_path / "still.mp4"
    with World(SCENE) as world, world.view(steps=False) as viewer:
        with viewer.record(gif), viewer.record(mp4):
            for _ in range(20):
                world.step(10)
                viewer.update()
        duration = 200 * world.dt
        with viewer.record(still):
            viewer.update()
    with pillow.open(gif) as film:
        delays = []
        for k in range(film.n_frames):
            film.seek(k)
            delays.append(film.info["duration"])
    assert 1e-3 * sum(delays) == pytest.approx(duration, abs=0.005)
    pictures, seconds = ffmpeg.count_frames_and_secs(str(mp4))
    assert (pictures, seconds) == (len(delays), pytest.approx(duration, abs=0.005))
    assert ffmpeg.count_frames_and_secs(str(still))[0] == 1


# imageio-ffmpeg leaves the pipe of a process that has ended to the garbage collector.
@pytest.mark.filterwarnings("ignore::ResourceWarning", "ignore::pytest.PytestUnraisableExceptionWarning")
def test_the_page_saves_pictures_and_films(open_page: OpenPage, tmp_path: Path) -> None:
    pillow = pytest.importorskip("PIL.Image")
    ffmpeg = pytest.importorskip("imageio_ffmpeg", reason="needs the extra film")
    with World(SCENE) as world, world.view(steps=False) as viewer:
        page = open_page(viewer.url, (700, 400))
        (client,) = connected(viewer)
        wait_for_rest(page, viewer)
        with pytest.raises(ArgumentError, match="is that of the page: save picture"):
            viewer.on_key("c", print)

        def saved(action: Any) -> Any:
            with page.page.expect_download() as download:
                action()
            download.value.save_as(tmp_path / download.value.suggested_filename)
            return pillow.open(io.BytesIO((tmp_path / download.value.suggested_filename).read_bytes()))

        page.page.mouse.click(40, 350)
        picture = saved(lambda: page.page.keyboard.press("c"))
        assert picture.format == "PNG"
        assert picture.size == (client.camera.image_width, client.camera.image_height)
        assert len(np.unique(np.asarray(picture.convert("RGB")).reshape(-1, 3), axis=0)) > 2
        page.page.get_by_text("pictures", exact=True).click()
        page.page.get_by_role("button", name="record film").click()
        page.page.get_by_role("button", name="stop and save").wait_for()
        for _ in range(10):
            world.step(5)
            viewer.update()
        film = saved(lambda: page.page.get_by_role("button", name="stop and save").click())
        assert film.format == "GIF"
        assert film.n_frames == max(1, round(50 * world.dt * PICTURES_PER_SECOND))
        page.page.get_by_label("as", exact=True).click()
        page.page.get_by_role("option", name=".mp4").click()
        page.page.get_by_role("button", name="record film").click()
        page.page.get_by_role("button", name="stop and save").wait_for()
        for _ in range(10):
            world.step(20)
            viewer.update()
        with page.page.expect_download() as download:
            page.page.get_by_role("button", name="stop and save").click()
        assert download.value.suggested_filename == "dynx.mp4"
        download.value.save_as(tmp_path / "page.mp4")
        seconds = 200 * world.dt
        pictures, shown_for = ffmpeg.count_frames_and_secs(str(tmp_path / "page.mp4"))
        assert pictures == max(1, round(seconds * PICTURES_PER_SECOND))
        assert shown_for == pytest.approx(seconds, abs=0.005)
        assert not page.errors
