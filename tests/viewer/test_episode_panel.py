"""The page that shows episodes of a policy: numbers, actions as bars, pause, steps, seeds; two engines."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynx.viewer.episode_panel import ActionEntry, Standing, action_entries, numbers_html
from tests.viewer.conftest import OpenPage, until

pytest.importorskip("gymnasium", reason="needs the extra envs")

from dynx.envs.environment import TaskEnvironment
from dynx.envs.library import Env, spaces
from dynx.envs.registration import TASKS, task_class
from dynx.envs.watching import Ended, EpisodePage
from dynx.errors import ArgumentError
from dynx.steppers.registry import installed_worlds
from dynx.world.camera import part_poses
from tests.envs.hail import Hail


class Lamp(Env[Any, Any]):
    """An environment of somebody else's, with pictures and terms of its reward in ``info``."""

    metadata = {"render_modes": ["rgb_array"], "render_fps": 50}  # noqa: RUF012
    observation_space = spaces.Box(0.0, 1.0, (1,))
    action_space = spaces.Box(-2.0, 2.0, (2,))

    def __init__(self, render_mode: str | None = "rgb_array") -> None:
        self.render_mode = render_mode
        self._steps = 0

    def reset(self, *, seed: int | None = None, options: Any = None) -> tuple[Any, dict[str, Any]]:
        super().reset(seed=seed)
        self._steps = 0
        return np.zeros(1, np.float32), {}

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        self._steps += 1
        terms = {"reward_light": 2.0, "reward_current": -0.5}
        return np.zeros(1, np.float32), 1.5, False, self._steps == 400, terms

    def render(self) -> Any:
        return np.tile(np.array([200, 30, 30], np.uint8), (60, 80, 1))


@contextmanager
def running(page: EpisodePage, *arguments: Any) -> Iterator[EpisodePage]:
    """Run the episodes of a page in a thread until the end of the block."""
    thread = threading.Thread(target=page.run, args=arguments, daemon=True)
    with page:
        thread.start()
        yield page
    thread.join(30.0)
    assert not thread.is_alive()


def constant(action: Any) -> Callable[[Any], Any]:
    return lambda seen: np.tile(np.asarray(action), (len(seen), *[1] * np.ndim(action)))


def test_two_engines_play_step_and_begin_again_in_the_page(open_page: OpenPage) -> None:
    task = task_class(TASKS["Pendulum-v0"])
    envs = [TaskEnvironment(task(), engine) for engine in ("reference", "pinocchio")]
    page = EpisodePage(constant([0.5]), envs, ["reference", "pinocchio"], title="Pendulum", seed=3)
    with running(page):
        opened = open_page(page.url)
        until(lambda: page.standings[0].step > 0, "a step")
        panel = opened.page.locator(".mantine-Paper-root", has_text="episode").first
        for name in ("reference", "pinocchio"):
            panel.get_by_text(name).first.wait_for()
        for words in ("return", "step", "reward", "+ torque", "action 0"):
            panel.get_by_text(words, exact=True).first.wait_for()
        opened.page.get_by_role("button", name="pause").click()
        until(lambda: not page.panel.playing, "the pause")
        before = page.standings[0].step
        opened.page.get_by_role("button", name="one step").click()
        until(lambda: page.standings[0].step == before + 1, "one step")
        for standing in page.standings:
            assert standing.action == [ActionEntry("action 0", 0.5, -1.0, 1.0)]
            assert sum(standing.terms.values()) == pytest.approx(standing.reward, rel=1e-12)
        # The same start and actions: the engines agree, and the drawings lie over each other.
        assert page.standings[0].total == pytest.approx(page.standings[1].total, rel=1e-9)
        panel.get_by_text(f"{page.standings[0].total:.5g}").first.wait_for()
        # The bar reaches from zero, in the middle, to half of the upper half, on both engines.
        bars = panel.locator("[title='0.5'] > span")
        assert bars.count() == 2
        for k in range(2):
            box, around = bars.nth(k).bounding_box(), bars.nth(k).locator("..").bounding_box()
            assert (box["x"] - around["x"]) / around["width"] == pytest.approx(0.5, abs=0.02)
            assert box["width"] / around["width"] == pytest.approx(0.25, abs=0.02)
        opened.page.get_by_label("speed", exact=True).click()
        opened.page.get_by_role("option", name="4", exact=True).click()
        until(lambda: page.panel.speed == 4.0, "the speed")
        opened.page.get_by_role("textbox", name="seed").fill("11")
        opened.page.get_by_role("button", name="begin with this seed").click()
        until(lambda: page._seed == 11 and page.standings[0].step == 0, "the episode with the seed")
        env = TaskEnvironment(task(), "reference")
        assert np.array_equal(page._runs[1].observation, env.reset(seed=11)[0])
        opened.page.get_by_role("button", name="next episode").click()
        until(lambda: page._seed == 12 and page.standings[0].step == 0, "the next episode")
        opened.page.get_by_label("side by side").check()
        until(lambda: page._drawn[1]._root.position[0] > 0.0, "the second beside the first")
        opened.page.mouse.click(40, 350)
        opened.page.keyboard.press("n")
        until(lambda: page._seed == 13 and page.standings[0].step == 0, "the episode after it")
        assert not opened.errors


def test_pictures_of_an_environment_of_another_library_are_shown(open_page: OpenPage) -> None:
    page = EpisodePage(constant([1.0, -1.5]), [Lamp()])
    with running(page):
        opened = open_page(page.url)
        until(lambda: page.standings[0].step > 0, "a step")
        assert page.standings[0].terms == {"light": 2.0, "current": -0.5}
        opened.page.get_by_text("+ light", exact=True).wait_for()

        def red() -> bool:
            (client,) = page.page.server.get_clients().values()
            picture = client.camera.get_render(height=60, width=80, transport_format="png")
            return bool(np.abs(picture[30, 40, :3].astype(int) - (200, 30, 30)).max() < 12)

        until(red, "the picture of the environment")
        assert not opened.errors


def test_episodes_follow_each_other_with_the_next_seeds() -> None:
    ended: list[Ended] = []
    task = task_class(TASKS["CartPole-v0"])
    with EpisodePage(constant(1), [TaskEnvironment(task(), "reference")], seed=7) as page:
        page.panel._speed.value = "4"
        page.run(2, ended.append)
    assert [each.seed for each in ended] == [7, 8]
    for each in ended:
        env = TaskEnvironment(task(), "reference")
        env.reset(seed=each.seed)
        length = 1
        while not env.step(1)[2]:
            length += 1
        assert (each.steps, each.totals) == ((length,), (float(length),))


def test_worlds_whose_scene_changes_with_each_episode_are_drawn_anew() -> None:
    envs = [TaskEnvironment(Hail(), engine) for engine in installed_worlds()[:2]]
    with EpisodePage(constant(np.zeros(3)), envs, installed_worlds()[:2]) as page:
        scenes = []
        for seed in (0, 1):
            page._begin(seed)
            page._step()
            page._draw()
            scenes.append(page._scenes)
            for drawn, run in zip(page._drawn, page._runs, strict=True):
                found = run.scene_and_state()
                assert found is not None
                for name, T in part_poses(*found):
                    assert name not in drawn.parts or np.allclose(drawn.pose(name), T)
        assert scenes[0][0].bodies != scenes[1][0].bodies
    for env in envs:
        env.close()


def test_wrong_environments_are_refused() -> None:
    with pytest.raises(ArgumentError, match="0 environments are given; a page shows one or two"):
        EpisodePage(constant(0), [])
    with pytest.raises(ArgumentError, match="make it with render_mode='rgb_array'"):
        EpisodePage(constant(0), [Lamp(None)])


@given(st.lists(st.tuples(st.floats(-3.0, 3.0), st.floats(0.0, 5.0), st.floats(-5.0, 0.0)), max_size=4))
def test_bars_lie_within_their_range_and_names_are_no_html(numbers: list[tuple[float, float, float]]) -> None:
    values, high, low = np.array(numbers, dtype=np.float64).reshape(-1, 3).T
    entries = action_entries([f"<b>{k}" for k in range(len(values))], values, low, high)
    for each in entries:
        assert each.low <= each.value <= each.high
        assert each.low < each.high
        assert each.low <= 0.0 <= each.high
    html = numbers_html(["<i>"], 0, [Standing(1, 0.1, 2.0, 1.0, {"<u>": 1.0}, entries)])
    assert not any(tag in html for tag in ("<b>", "<i>", "<u>"))
    assert html.count("position: absolute") == len(entries)


@pytest.mark.parametrize("name", [each for each in TASKS if each not in ("Acrobot-v0", "CartPole-v0")])
def test_terms_add_up_to_the_reward(name: str) -> None:
    task = task_class(TASKS[name])()
    env = TaskEnvironment(task)
    try:
        env.reset(seed=2)
        env.action_space.seed(2)
        for _ in range(3):
            _, reward, terminated, _, _ = env.step(env.action_space.sample())
            terms = env.reward_terms
            assert terms == env.episodes.reward_terms()
            assert len(terms) > 1
            assert sum(terms.values()) == pytest.approx(reward, rel=1e-6, abs=1e-9)
            assert not terminated
    finally:
        env.close()
