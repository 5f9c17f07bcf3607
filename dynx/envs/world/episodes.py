"""Episodes of a task in a world of one engine."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dynx.envs.randomization import Parameter, Randomization
from dynx.envs.task import Episodes, Outcome
from dynx.envs.world.scene_task import Episode, SceneTask
from dynx.envs.world.varied_scene import VariedScene
from dynx.world import Scene, Snapshot, World


class WorldEpisodes(Episodes):
    """Episodes of a task in a world, which is opened once, or anew for an episode with a scene of its own."""

    def __init__(self, task: SceneTask, engine: str) -> None:
        self._task, self._engine = task, engine
        self._options = {"dt": task.control_dt, "substeps": task.substeps, **task.settings.get(engine, {})}
        self._varied: VariedScene | None = None
        self._values: NDArray[np.float64] = np.zeros(0)
        self._waiting: deque[Any] = deque()
        self._world = self._open(task.scene())
        self._start: Snapshot | None = None
        self._viewer: Any = None
        self._episode: Episode | None = None

    @property
    def world(self) -> World:
        """The world of the present episode."""
        return self._world

    @property
    def episode(self) -> Episode:
        """The present episode, of which the first `start` begins one."""
        assert self._episode is not None, "no episode was started"
        return self._episode

    def vary(self, randomization: Randomization) -> tuple[Parameter, ...]:
        """Return the parameters of the scene that episodes draw, and the delay.

        Raises the error of the engine for what it does not have, such as dry friction of joints in Drake.
        """
        varied = self._varied = VariedScene(self._task.scene(), randomization, self._task.control_dt)
        if varied.joint_friction:
            self._options["joint_friction"] = True
        if varied.changes_scene:
            greatest = np.array([each.distribution.bounds[1] for each in varied.parameters])
            self._open(varied.scene(self._task.scene(), greatest)).close()
        return varied.parameters

    def set_parameters(self, values: NDArray[np.float64]) -> None:
        """Give the scene of the next episode the values (k,) of the parameters that `vary` returned."""
        self._values = values

    def start(self, rng: np.random.Generator, options: Mapping[str, Any]) -> tuple[Any, dict[str, Any]]:
        task = self._task
        task.require_start_options(options)
        memory = SimpleNamespace()
        scene = self._scene_of_episode(rng, memory)
        if scene is None:
            self._return_to_start()
        else:
            world = self._open(scene)
            self._world.close()
            self._world = world
        self._episode = episode = Episode(self._world, rng, memory)
        task.start(episode, **options)
        return task.observation(episode), task.info(episode)

    def step(self, action: Any) -> Outcome:
        task, episode = self._task, self.episode
        if self._waiting.maxlen:
            if not self._waiting:
                # Before the first action there was none; it acts from the beginning.
                self._waiting.extend([action] * self._waiting.maxlen)
            acting = self._waiting.popleft()
            self._waiting.append(action)
            action = acting
        self._world.step(**task.loads(episode, action))
        task.settle(episode, action)
        terminated = bool(task.terminated(episode))
        return Outcome(
            task.observation(episode), float(task.reward(episode, action)), terminated, task.info(episode)
        )

    def picture(self, width: int, height: int) -> NDArray[np.uint8]:
        """Draw the world by the task's camera."""
        return self._world.camera(replace(self._task.camera, size=(width, height))).rgb

    def view(self) -> None:
        """Show the world in the browser, on one page for all worlds of these episodes."""
        if self._viewer is None:
            self._viewer = self._world.view(steps=False)
            print(f"{type(self._task).__name__} is shown at {self._viewer.url}", flush=True)
        elif self._viewer.view.world is not self._world and not self._viewer.view.replace(self._world):
            self._viewer.show(self._world, steps=False)
        self._viewer.view.draw()

    def close(self) -> None:
        self._world.close()
        if self._viewer is not None:
            self._viewer.close()
            self._viewer = None

    def _open(self, scene: Scene) -> World:
        return World(scene, self._engine, **self._options)

    def _scene_of_episode(self, rng: np.random.Generator, memory: SimpleNamespace) -> Scene | None:
        """Return the scene of the next episode with the drawn parameters, or None for that of the task."""
        task, varied = self._task, self._varied
        scene = task.scene_of_episode(rng, memory)
        if varied is None:
            return scene
        self._waiting = deque(maxlen=varied.delayed_actions(self._values, task.control_dt))
        if not varied.changes_scene:
            return scene
        return varied.scene(task.scene() if scene is None else scene, self._values)

    def _return_to_start(self) -> None:
        """Return the world to the start of its scene, from where it takes the same steps, bit for bit."""
        if self._start is None:
            self._start = self._world.save()
        else:
            self._world.restore(self._start)
