"""Controls of a program's own on the page: sliders, buttons, text, lines, keys and clicks."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dynx.errors import ArgumentError, shown
from dynx.model.numbers import checked_array, checked_vector, is_real
from dynx.spatial.scalar import Floats
from dynx.viewer.colours import BLUE, RGB
from dynx.viewer.library import HOTKEYS
from dynx.viewer.page import Page


def slider_step(lower: float, upper: float) -> float:
    """Return a power of ten that is at most a thousandth of the range: the page shows as many digits of the
    value as the step has."""
    return float(10.0 ** math.floor(math.log10((upper - lower) / 1000.0)))


class Slider:
    """A slider on the page."""

    def __init__(self, handle: Any) -> None:
        self._handle = handle

    @property
    def value(self) -> float:
        """The number that it stands at; assigning moves it."""
        return float(self._handle.value)

    @value.setter
    def value(self, number: float) -> None:
        if not is_real(number) or not np.isfinite(number):
            raise ArgumentError(f"value of a slider is {shown(number)}; wanted a finite number")
        self._handle.value = min(max(float(number), self._handle.min), self._handle.max)

    def remove(self) -> None:
        """Remove the slider from the page."""
        self._handle.remove()


class Mark:
    """Text or lines in the scene."""

    def __init__(self, node: Any) -> None:
        self._node = node

    def remove(self) -> None:
        """Remove it from the page."""
        self._node.remove()


class Controls:
    """What a program adds to its page."""

    def __init__(self, page: Page) -> None:
        self._page = page
        self._count = 0

    @property
    def _open_page(self) -> Page:
        self._page.check_open()
        return self._page

    def slider(
        self,
        name: str,
        lower: float,
        upper: float,
        value: float | None = None,
        *,
        changed: Callable[[float], object] | None = None,
    ) -> Slider:
        """Add a slider from `lower` to `upper`, at `value` or in the middle; `changed(value)` is called when
        it is moved in the page."""
        _checked_label("name of a slider", name)
        for what, number in (("lower", lower), ("upper", upper), ("value", value)):
            if number is not None and not (is_real(number) and np.isfinite(number)):
                raise ArgumentError(
                    f"{what} of slider {shown(name)} is {shown(number)}; wanted a finite number"
                )
        if not lower < upper:
            raise ArgumentError(f"slider {shown(name)} is from {lower} to {upper}; wanted an ascending range")
        start = 0.5 * (lower + upper) if value is None else value
        if not lower <= start <= upper:
            raise ArgumentError(f"value of slider {shown(name)} is {value}; wanted {lower} to {upper}")
        handle = self._open_page.gui.add_slider(
            name, float(lower), float(upper), step=slider_step(lower, upper), initial_value=float(start)
        )
        if changed is not None:
            call = _checked_function("changed", changed)
            handle.on_update(
                lambda event: None if event.client is None else self._called(call, float(handle.value))
            )
        return Slider(handle)

    def button(self, name: str, pressed: Callable[[], object]) -> None:
        """Add a button; `pressed()` is called when it is pressed."""
        call = _checked_function("pressed", pressed)
        handle = self._open_page.gui.add_button(_checked_label("name of a button", name))
        handle.on_click(lambda _: self._called(call))

    def on_key(self, key: str, pressed: Callable[[], object]) -> None:
        """Call `pressed()` when a key is pressed in the page: such as ``"r"`` or ``"arrowup"``.

        The keys stand in the list of commands of the page, too. Raises ArgumentError for a key that the page
        uses itself, as P where it plays.
        """
        call = _checked_function("pressed", pressed)
        wanted = _checked_label("key", key)
        known = {each.lower(): each for each in HOTKEYS}
        if wanted.lower() not in known:
            raise ArgumentError(
                f"key is {shown(key)}; wanted a letter, a digit, or one of "
                f"{', '.join(each for each in HOTKEYS if len(each) > 1)}"
            )
        taken = self._open_page.reserved_keys.get(known[wanted.lower()])
        if taken is not None:
            raise ArgumentError(f"key {shown(key)} is that of the page: {taken}; choose another")
        command = self._open_page.gui.add_command(f"key {wanted}", hotkey=known[wanted.lower()])
        command.on_trigger(lambda _: self._called(call))

    def text(self, text: str, position: ArrayLike) -> Mark:
        """Write text at a position (3,) [m] in the world."""
        label = _checked_label("text", text)
        point = checked_vector("position", position)
        return Mark(self._open_page.scene.add_label(self._path("text"), label, position=point))

    def line(self, points: ArrayLike, colour: RGB = BLUE, thickness: float = 0.005) -> Mark:
        """Draw the line through points (n, 3) [m] of the world, with a thickness [m]."""
        array = checked_array("points", points, 3)
        if array.ndim != 2 or len(array) < 2:
            raise ArgumentError(f"points has shape {array.shape}; wanted (n, 3) with at least 2 points")
        segments = np.stack([array[:-1], array[1:]], axis=1).astype(np.float32)
        return Mark(
            self._open_page.scene.add_line_segments(
                self._path("line"), segments, _checked_colour(colour), thickness=float(thickness)
            )
        )

    def on_click(
        self, parts: Mapping[str, Iterable[Any]], clicked: Callable[[str, Floats, Floats], object]
    ) -> None:
        """Call `clicked(part, origin, direction)` with the part that is clicked and the ray (3,), (3,) from
        the camera through the pointer, in world axes.

        `parts` are the nodes of shapes by the name of their part.
        """
        call = _checked_function("clicked", clicked)
        for name, nodes in parts.items():
            for node in nodes:
                node.on_click(lambda event, name=name: self._called(call, name, *_ray(event)))

    def _called(self, function: Callable[..., object], *arguments: object) -> None:
        """Call a function of the program; its error is raised, and shown in the page."""
        try:
            function(*arguments)
        except Exception as error:
            for client in self._open_page.server.get_clients().values():
                client.add_notification(f"error: {type(error).__name__}", str(error), color="red")
            raise

    def _path(self, kind: str) -> str:
        self._count += 1
        return f"/{kind}{self._count}"


def _ray(event: Any) -> tuple[Floats, Floats]:
    return np.array(event.ray_origin, dtype=np.float64), np.array(event.ray_direction, dtype=np.float64)


def _checked_label(what: str, text: object) -> str:
    if not isinstance(text, str) or not text:
        raise ArgumentError(f"{what} is {shown(text)}; wanted a str that is not empty")
    return text


def _checked_function(what: str, function: Any) -> Any:
    if not callable(function):
        raise ArgumentError(f"{what} is of type {type(function).__name__}; wanted a function")
    return function


def _checked_colour(colour: RGB) -> RGB:
    if not (
        isinstance(colour, tuple | list)
        and len(colour) == 3
        and all(isinstance(x, int) and 0 <= x <= 255 for x in colour)
    ):
        raise ArgumentError(f"colour is {shown(colour)}; wanted three whole numbers from 0 to 255")
    return (colour[0], colour[1], colour[2])
