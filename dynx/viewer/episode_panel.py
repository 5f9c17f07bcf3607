"""Controls and numbers of the page that shows episodes of a policy: what it earns, and how it acts."""

from __future__ import annotations

import threading
from collections.abc import Mapping, Sequence
from html import escape
from typing import Any, NamedTuple

import numpy as np

from dynx.spatial.scalar import Floats
from dynx.viewer.colours import BLUE, RGB, SKY_BLUE, css
from dynx.viewer.page import Page
from dynx.viewer.play_control import SPEEDS, PlayControl, speed_factor

_ROW = "display: flex; gap: 0.5em; align-items: center; overflow-wrap: anywhere"
_NUMBER = "flex: 1; text-align: right; font-variant-numeric: tabular-nums"


class ActionEntry(NamedTuple):
    """One number of an action and its bounds, or one choice of a discrete action, which is 1 where taken."""

    name: str
    value: float
    low: float
    high: float


class Standing(NamedTuple):
    """Where an episode stands after a step."""

    step: int
    time: float
    """Time since the start of the episode [s]."""
    total: float
    """Return: the sum of all rewards."""
    reward: float
    terms: Mapping[str, float]
    """The terms whose sum is the reward, by name; empty for a task that does not name them."""
    action: Sequence[ActionEntry]
    end: str = ""
    """Why the episode ended; empty while it goes on."""


class EpisodePanel(PlayControl):
    """Play, pause, one step, speed, seed and next episode, and the numbers of one episode or two side by
    side.

    The loop that takes the steps reads `playing`, `speed`, `take_step` and `take_seed`.
    """

    def __init__(self, page: Page, names: Sequence[str], seed: int) -> None:
        """`names` are those of the engines or environments, one or two."""
        self._page, self._names = page, tuple(names)
        self.changed = threading.Event()
        """Set when a control was used."""
        super().__init__()
        self._running.set()
        self._steps, self._seed = 0, seed
        self._wanted: int | None = None
        gui = page.gui
        with gui.add_folder("episode"):
            self._numbers = gui.add_html("")
            self.add_play_button(page)
            once = gui.add_button("one step")
            self._speed = gui.add_dropdown("speed", SPEEDS, initial_value="1")
            self._chosen = gui.add_number("seed", seed, min=0, step=1)
            again = gui.add_button("begin with this seed")
            following = gui.add_button("next episode")
        once.on_click(lambda _: self._request_step())
        again.on_click(lambda _: self._request(int(self._chosen.value)))
        following.on_click(lambda _: self._request(self._seed + 1))
        page.on_own_key("N", "next episode", lambda: self._request(self._seed + 1))

    @property
    def speed(self) -> float:
        """Wanted speed, relative to the clock."""
        return speed_factor(self._speed.value)

    def play(self) -> None:
        """Take one step after the other."""
        super().play()
        self.changed.set()

    def pause(self) -> None:
        """Take steps only when they are asked for."""
        super().pause()
        self.changed.set()

    def take_step(self) -> bool:
        """Return True once for each single step that was asked for."""
        if self._steps == 0:
            return False
        self._steps -= 1
        return True

    def take_seed(self) -> int | None:
        """Return once the seed of the episode that was asked for; None where none was."""
        wanted, self._wanted = self._wanted, None
        return wanted

    def begin(self, seed: int) -> None:
        """Show that an episode with this seed begins."""
        self._seed = seed
        self._chosen.value = seed

    def show(self, standings: Sequence[Standing]) -> None:
        """Show the numbers of each episode."""
        self._numbers.content = numbers_html(self._names, self._seed, standings)

    def _request_step(self) -> None:
        if self.playing:
            self.pause()
        self._steps += 1
        self.changed.set()

    def _request(self, seed: int) -> None:
        self._wanted = seed
        self.changed.set()


def numbers_html(names: Sequence[str], seed: int, standings: Sequence[Standing]) -> str:
    """Return the numbers of episodes in columns, and their actions as bars, as HTML."""
    rows = []
    if any(names):
        rows.append(_row("engine", names, (BLUE, SKY_BLUE)))
    rows += [
        _row("seed", [str(seed)] * len(standings)),
        _row("return", [f"{each.total:.5g}" for each in standings]),
        _row("step", [str(each.step) for each in standings]),
        _row("time", [f"{each.time:.2f} s" for each in standings]),
        _row("reward", [f"{each.reward:.4g}" for each in standings]),
    ]
    terms = list(dict.fromkeys(name for each in standings for name in each.terms))
    rows += [
        _row(f"+ {name}", [f"{each.terms.get(name, 0.0) + 0.0:.4g}" for each in standings]) for name in terms
    ]
    if any(each.end for each in standings):
        rows.append(_row("end", [each.end for each in standings]))
    for entries in zip(*(each.action for each in standings), strict=False):
        rows.append(_bars(entries))
    return f'<div style="margin: 0.4em 0.8em; font-size: 0.85em; line-height: 1.6">{"".join(rows)}</div>'


def _row(label: str, values: Sequence[str], colours: Sequence[RGB] = ()) -> str:
    """Return a row of the table; each value with a square of its colour where there are several of them."""
    marks = [f"<b style='color: {css(each)}'>&#9632;</b> " for each in colours if len(values) > 1]
    cells = "".join(
        f'<span style="{_NUMBER}">{mark}{escape(value)}</span>'
        for mark, value in zip(marks or [""] * len(values), values, strict=True)
    )
    return f'<div style="{_ROW}"><span style="flex: 1.3">{escape(label)}</span>{cells}</div>'


def _bars(entries: Sequence[ActionEntry]) -> str:
    """Return the bars of one entry of the actions, one of each episode."""
    bars = "".join(_bar(each, colour) for each, colour in zip(entries, (BLUE, SKY_BLUE), strict=False))
    return (
        f'<div style="{_ROW}"><span style="flex: 1.3">{escape(entries[0].name)}</span>'
        f'<span style="flex: 2">{bars}</span></div>'
    )


def _bar(entry: ActionEntry, colour: RGB) -> str:
    """Return a bar from zero, or from the bound next to it, to the value, on the range of the entry."""
    width = entry.high - entry.low
    zero, end = (100.0 * (min(max(x, entry.low), entry.high) - entry.low) / width for x in (0.0, entry.value))
    left, length = min(zero, end), max(abs(end - zero), 1.0)
    return (
        f'<span title="{entry.value:.4g}" style="display: block; position: relative; height: 0.6em; '
        'margin: 0.15em 0; border-radius: 2px; overflow: hidden; background: rgba(128, 128, 128, 0.25)">'
        f'<span style="position: absolute; left: {left:.1f}%; width: {length:.1f}%; height: 100%; '
        f'background: {css(colour)}"></span></span>'
    )


def action_entries(names: Sequence[str], action: Any, low: Floats, high: Floats) -> list[ActionEntry]:
    """Return the entries of an action of numbers between `low` and `high`, all (n,).

    Where a bound is not finite, the range reaches to the value.
    """
    numbers = np.ravel(np.asarray(action, dtype=np.float64)).tolist()
    found = []
    for name, value, least, most in zip(names, numbers, low.tolist(), high.tolist(), strict=True):
        bounds = [each for each in (least, most) if np.isfinite(each)] or [-1.0, 1.0]
        found.append(ActionEntry(name, value, min(value, *bounds, 0.0), max(value, *bounds, 0.0) or 1.0))
    return found
