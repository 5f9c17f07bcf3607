"""A page in the browser that shows episodes of a policy while they run, on one engine or on two.

from dynx.envs.watching import EpisodePage
with EpisodePage(act, [gymnasium.make("dynx/Walk-v0")]) as page:
    page.run()
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dynx.envs.environment import DIVERGED, Act, TaskEnvironment
from dynx.envs.library import Env, spaces
from dynx.envs.task import Episodes, Task
from dynx.errors import ArgumentError
from dynx.model.numbers import checked_seed
from dynx.spatial.scalar import Floats
from dynx.steppers.camera import Camera
from dynx.steppers.state import WorldState
from dynx.viewer.colours import SKY_BLUE
from dynx.viewer.drawn_robot import GHOST_OPACITY, GHOST_SIZE, DrawnScene, Look
from dynx.viewer.episode_panel import ActionEntry, EpisodePanel, Standing, action_entries
from dynx.viewer.following import FollowingCamera
from dynx.viewer.framing import SHARE, box_around, points_around
from dynx.viewer.page import DEFAULT_HOST, Page
from dynx.viewer.triangles import TRIANGLE_BUDGET, has_graphics_processor
from dynx.world import Scene
from dynx.world.camera import part_poses
from dynx.world.scenery import DARK, LIGHT

DEFAULT_RATE = 25.0
"""Steps a second of an environment that does not name its ``render_fps``."""

PICTURES_PER_SECOND = 30.0
"""Largest rate at which the page is drawn; steps between are taken without a picture."""

PAUSE = 1.0
"""Time for which the end of an episode is shown [s]."""

_BORDER = 128
"""Grey beside a picture whose shape is not that of the page."""

_REWARD_PREFIX = "reward_"
"""Beginning of the keys under which environments of Gymnasium tell the terms of a reward in ``info``."""


class Ended(NamedTuple):
    """An episode that ended."""

    seed: int
    totals: tuple[float, ...]
    """Return on each engine."""
    steps: tuple[int, ...]
    """Length on each engine."""


class _Run:
    """An environment in its present episode."""

    def __init__(self, env: Env[Any, Any], name: str) -> None:
        self.env, self.name = env, name
        unwrapped = env.unwrapped
        self.task: Task | None = None
        self._episodes: Episodes | None = None
        if isinstance(unwrapped, TaskEnvironment):
            self.task, self._episodes = unwrapped.task, unwrapped.episodes
        self.rate = float(env.metadata.get("render_fps") or DEFAULT_RATE)
        self.observation: Any = None
        self.standing = Standing(0, 0.0, 0.0, 0.0, {}, ())

    def begin(self, seed: int) -> None:
        self.observation, _ = self.env.reset(seed=seed)
        self.standing = Standing(0, 0.0, 0.0, 0.0, {}, ())

    def step(self, action: Any) -> None:
        self.observation, reward, terminated, truncated, info = self.env.step(action)
        before = self.standing
        end = "terminated" if terminated else "truncated" if truncated else ""
        self.standing = Standing(
            before.step + 1,
            (before.step + 1) / self.rate,
            before.total + float(reward),
            float(reward),
            self._terms(info),
            _entries(self.env.action_space, action),
            "diverged" if DIVERGED in info else end,
        )

    def _terms(self, info: dict[str, Any]) -> dict[str, float]:
        if self._episodes is not None:
            return dict(self._episodes.reward_terms())
        named = {
            key.removeprefix(_REWARD_PREFIX): value
            for key, value in info.items()
            if key.startswith(_REWARD_PREFIX)
        }
        return {name: float(value) for name, value in named.items() if np.ndim(value) == 0}

    def scene_and_state(self) -> tuple[Scene, WorldState] | None:
        return None if self._episodes is None else self._episodes.scene_and_state()


def _entries(space: Any, action: Any) -> list[ActionEntry]:
    """Return the entries of an action by which bars are drawn."""
    if isinstance(space, spaces.Discrete):
        first = int(space.start)
        return [
            ActionEntry(f"action {k}", float(k == int(action)), 0.0, 1.0)
            for k in range(first, first + int(space.n))
        ]
    if isinstance(space, spaces.Box):
        low, high = (np.ravel(each).astype(np.float64) for each in (space.low, space.high))
        names = [f"action {k}" for k in range(len(low))]
        return action_entries(names, action, low, high)
    return []


class EpisodePage:
    """Episodes of a policy on a page: what moves, return, reward and its terms, step, actions as bars; and
    controls for pause, single steps, speed, seed and the next episode.

    Two environments are shown laid over each other, the second see-through, or side by side. An environment
    that is not one of dynx's tasks is shown by its pictures; it is made with ``render_mode="rgb_array"``.
    """

    def __init__(
        self,
        act: Act,
        envs: Sequence[Env[Any, Any]],
        names: Sequence[str] | None = None,
        *,
        title: str = "episodes",
        seed: int = 0,
        host: str = DEFAULT_HOST,
        port: int = 0,
        dark: bool = False,
    ) -> None:
        """`act(observations)` returns actions, `names` are those of the engines, and the first episode begins
        with `seed`. Raises ArgumentError for other than one environment or two, and for one without pictures.
        """
        if len(envs) not in (1, 2):
            raise ArgumentError(f"{len(envs)} environments are given; a page shows one or two")
        named = [""] * len(envs) if names is None else list(names)
        self._act, self._seed = act, checked_seed("seed", seed)
        self._runs = [_Run(env, name) for env, name in zip(envs, named, strict=True)]
        whole = has_graphics_processor()
        self._look = Look(triangles=None if whole else TRIANGLE_BUDGET, scenery=DARK if dark else LIGHT)
        for run in self._runs:
            run.begin(self._seed)
            if run.scene_and_state() is None and run.env.render_mode != "rgb_array":
                raise ArgumentError(
                    "the environment has no scene of dynx; make it with render_mode='rgb_array'"
                )
        self.page = Page(host, port, title=f"dynx: {title}", dark=dark, plain=not whole)
        """The page."""
        self._scenes: list[Scene] = []
        self._drawn: list[DrawnScene] = []
        self._camera: FollowingCamera | None = None
        self._beside, self._apart = 0.0, np.zeros(3)
        self.panel = EpisodePanel(self.page, named, self._seed)
        """Controls and numbers."""
        if len(envs) == 2 and self._has_scenes:
            beside = self.page.gui.add_checkbox("side by side", initial_value=False)
            beside.on_update(lambda _: self._place_beside(beside.value))
        self._drawn_at = -np.inf
        self._draw()

    @property
    def url(self) -> str:
        """The address of the page."""
        return self.page.url

    @property
    def standings(self) -> list[Standing]:
        """Where each episode stands."""
        return [run.standing for run in self._runs]

    def run(self, episodes: int | None = None, ended: Callable[[Ended], object] = lambda _: None) -> None:
        """Run episodes, with the seed of each one more than that of the one before, until the page is closed
        or there were as many; `ended` is called at the end of each. Controls of the page change the order.
        """
        done = 0
        while not self.page.closed and (episodes is None or done < episodes):
            if self._run_episode():
                done += 1
                ended(Ended(self._seed, *zip(*((s.total, s.step) for s in self.standings), strict=True)))
                if done == episodes:
                    break
                self.panel.changed.clear()
                self.panel.changed.wait(PAUSE)
                wanted = self.panel.take_seed()
                self._begin(self._seed + 1 if wanted is None else wanted)

    def _run_episode(self) -> bool:
        """Take steps until the episode ends; return False where the page was closed before."""
        due = time.perf_counter()
        while not all(each.end for each in self.standings):
            if self.page.closed:
                return False
            wanted = self.panel.take_seed()
            if wanted is not None:
                self._begin(wanted)
            if self.panel.playing or self.panel.take_step():
                self._step()
                now = time.perf_counter()
                # Where the machine is too slow, the episode falls behind instead of being hurried later.
                due = max(due + 1.0 / (self._runs[0].rate * self.panel.speed), now)
                ending = all(each.end for each in self.standings)
                if now - self._drawn_at >= 1.0 / PICTURES_PER_SECOND or not self.panel.playing or ending:
                    self._draw()
                time.sleep(max(due - time.perf_counter(), 0.0))
            else:
                self.panel.changed.wait(0.2)
                self.panel.changed.clear()
                due = time.perf_counter()
        return True

    def _step(self) -> None:
        going = [run for run in self._runs if not run.standing.end]
        actions = self._act(np.stack([np.asarray(run.observation) for run in going]))
        for run, action in zip(going, actions, strict=True):
            run.step(action)

    def _begin(self, seed: int) -> None:
        self._seed = seed
        for run in self._runs:
            run.begin(seed)
        self.panel.begin(seed)
        self._draw()

    # -- drawing ------------------------------------------------------------------------------

    @property
    def _has_scenes(self) -> bool:
        return all(run.scene_and_state() is not None for run in self._runs)

    def _draw(self) -> None:
        self._drawn_at = time.perf_counter()
        seen = [found for run in self._runs if (found := run.scene_and_state()) is not None]
        with self.page.lock, self.page.together():
            if self.page.closed:
                return
            self.panel.show(self.standings)
            if len(seen) < len(self._runs):
                pictures = [np.asarray(run.env.render()) for run in self._runs]
                self._draw_picture(np.concatenate(pictures, axis=1))
                return
            scenes = [scene for scene, _ in seen]
            if list(map(id, scenes)) != list(map(id, self._scenes)):
                self._draw_scenes(scenes, seen[0][1])
            for drawn, (scene, state) in zip(self._drawn, seen, strict=True):
                drawn.place({n: T for n, T in part_poses(scene, state) if n in drawn.parts})

    def _draw_picture(self, picture: NDArray[np.uint8]) -> None:
        """Draw a picture (height, width, 3) behind everything, between borders: viser would stretch it to the
        shape of the page."""
        height, width = picture.shape[:2]
        clients = self.page.server.get_clients().values()
        aspect = next((float(client.camera.aspect) for client in clients), width / height)
        across, upward = (max(round(n), 0) for n in (height * aspect - width, width / aspect - height))
        sides = [(n // 2, n - n // 2) for n in (upward, across)]
        self.page.scene.set_background_image(
            np.pad(picture, (*sides, (0, 0)), constant_values=_BORDER), format="jpeg"
        )

    def _draw_scenes(self, scenes: list[Scene], state: WorldState) -> None:
        """Draw the parts of other scenes than before; the first time also ground and camera."""
        for drawn in self._drawn:
            drawn.remove()
        self._scenes = scenes
        ghost = self._look._replace(colour=SKY_BLUE, opacity=GHOST_OPACITY, size=GHOST_SIZE)
        self._drawn = [
            DrawnScene(
                self.page.scene,
                path,
                {robot.name: robot.model for robot in scene.robots},
                [body for body in scene.bodies if path == "/first" or not body.fixed],
                look,
            )
            for path, scene, look in zip(("/first", "/second"), scenes, (self._look, ghost), strict=False)
        ]
        self._move_second()
        if self._camera is None:
            self._camera = FollowingCamera(self.page, self._drawn[0])
            self._look_at(scenes[0], state)
        else:
            self._camera.watch(self._drawn[0])

    def _look_at(self, scene: Scene, state: WorldState) -> None:
        """Look as the camera of the task does; without one, at the box around everything."""
        robots = {robot.name: robot.model for robot in scene.robots}
        poses: dict[str, Floats] = {name: T[None] for name, T in part_poses(scene, state)}
        low, high = box_around(poses, scene.bodies, robots)
        size = float(np.linalg.norm(high - low)) or 0.5
        self.page.lay_ground(size, None if any(body.fixed for body in scene.bodies) else float(low[2]))
        camera, right = (
            getattr(self._runs[0].task, "camera", None),
            np.array([1.0, 1.0, 0.0]) / math.sqrt(2.0),
        )
        if isinstance(camera, Camera) and camera.part is None:
            self.page.look_from(camera)
            right = camera.pose.matrix[:3, 0]
        else:
            self.page.look_at(points_around(poses, scene.bodies, robots), SHARE)
        self._apart = size * right

    def _place_beside(self, beside: bool) -> None:
        self._beside = float(beside)
        with self.page.lock:
            self._move_second()

    def _move_second(self) -> None:
        for drawn in self._drawn[1:]:
            x, y, z = (self._beside * self._apart).tolist()
            drawn.move_root((x, y, z))

    def close(self) -> None:
        """End the page. Closing twice is harmless."""
        self.page.close()

    def __enter__(self) -> EpisodePage:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
