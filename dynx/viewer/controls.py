"""Controls of a program's own on the page: sliders, numbers, boxes, choices, buttons, text, lines, keys,
pointer and clicks."""

from __future__ import annotations

import math
import re
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dynx.argument_types import is_listed
from dynx.errors import ArgumentError, nearest, shown
from dynx.model.numbers import checked_array, checked_vector, is_real, positive_number
from dynx.spatial.scalar import Floats
from dynx.viewer.browser import WrittenText, texts_element
from dynx.viewer.colours import BLUE, NAMED, RGB, css
from dynx.viewer.library import HOTKEYS
from dynx.viewer.page import Page
from dynx.viewer.page_input import PageInput

Colour = str | RGB | tuple[float, float, float]

LABEL_SIZE = 12.0
"""Size of the letters of text without a size [pixels]."""


def slider_step(lower: float, upper: float) -> float:
    """Return a power of ten that is at most a thousandth of the range: the page shows as many digits of the
    value as the step has."""
    return float(10.0 ** math.floor(math.log10(max(upper - lower, 1e-300) / 1000.0)))


class Control:
    """A control on the page."""

    def __init__(self, handle: Any) -> None:
        self._handle = handle

    def remove(self) -> None:
        """Remove the control from the page."""
        self._handle.remove()


class Slider(Control):
    """A number between two others: a slider, or a field to type it."""

    @property
    def value(self) -> float:
        """The number that it stands at; assigning moves it."""
        return float(self._handle.value)

    @value.setter
    def value(self, number: float) -> None:
        if not is_real(number) or not np.isfinite(number):
            raise ArgumentError(f"value of a slider is {shown(number)}; wanted a finite number")
        low, high = (getattr(self._handle, side) for side in ("min", "max"))
        lower, upper = (-np.inf if low is None else low), (np.inf if high is None else high)
        self._handle.value = min(max(float(number), lower), upper)


class Checkbox(Control):
    """A box that is checked or not."""

    @property
    def value(self) -> bool:
        """True while it is checked; assigning changes it."""
        return bool(self._handle.value)

    @value.setter
    def value(self, checked: bool) -> None:
        self._handle.value = _checked_switch("value of a checkbox", checked)


class Dropdown(Control):
    """A choice of one of several texts."""

    @property
    def value(self) -> str:
        """The text that is chosen; assigning chooses another."""
        return str(self._handle.value)

    @value.setter
    def value(self, chosen: str) -> None:
        self._handle.value = _checked_choice("value of a dropdown", chosen, self._handle.options)


class Mark:
    """Text or lines in the scene."""

    def __init__(self, node: Any) -> None:
        self._node = node

    def remove(self) -> None:
        """Remove it from the page."""
        self._node.remove()


class _Written:
    """Coloured text among that of a program."""

    def __init__(self, controls: Controls, text: WrittenText) -> None:
        self._controls, self._text = controls, text
        controls._write()

    def remove(self) -> None:
        # Equal text may stand there twice.
        written = self._controls._written
        written[:] = [each for each in written if each is not self._text]
        self._controls._write()


class Controls:
    """What a program adds to its page."""

    def __init__(self, page: Page) -> None:
        self._page = page
        self._count = 0
        self._added: list[Any] = []
        """What can be removed from what is shown at present."""
        self._added_to = page.ended
        self._input: PageInput | None = None
        self._written: list[WrittenText] = []
        self._texts: Any = None
        """The element of the page that has the coloured text."""

    @property
    def _open_page(self) -> Page:
        self._page.check_open()
        if self._added_to is not self._page.ended:
            # What was shown then has gone, with its controls.
            self._added, self._added_to, self._input = [], self._page.ended, None
            self._written, self._texts = [], None
        return self._page

    def remove_all(self) -> None:
        """Remove all controls, keys, text and lines of the program from the page; what it shows stays."""
        page = self._open_page
        with page.lock, page.together():
            for each in self._added:
                # Some may have been removed already, which viser warns of.
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore")
                    each.remove()
            self._added = []
            if self._input is not None:
                self._input.remove()

    def _add(self, handle: Any) -> Any:
        self._added.append(handle)
        return handle

    def _added_control(self, control: Any) -> None:
        """Let `remove_all` remove a control, too."""
        self._open_page.check_open()
        self._added.append(control)

    def _add_control(self, handle: Any, changed: Callable[[Any], object] | None) -> Any:
        if changed is not None:
            call = _checked_function("changed", changed)
            handle.on_update(lambda event: None if event.client is None else self._called(call, handle.value))
        return self._add(handle)

    def _page_input(self) -> PageInput:
        page = self._open_page
        if self._input is None:
            self._input = PageInput(page, self._called)
        return self._input

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
        return Slider(self._add_control(handle, changed))

    def number(
        self,
        name: str,
        value: float,
        *,
        lower: float | None = None,
        upper: float | None = None,
        changed: Callable[[float], object] | None = None,
    ) -> Slider:
        """Add a field to type a number, from `lower` to `upper` where these are given; `changed(value)` is
        called when it is changed in the page."""
        _checked_label("name of a number", name)
        for what, number in (("value", value), ("lower", lower), ("upper", upper)):
            if not (number is None and what != "value") and not (is_real(number) and np.isfinite(number)):
                raise ArgumentError(
                    f"{what} of number {shown(name)} is {shown(number)}; wanted a finite number"
                )
        low, high = (-np.inf if lower is None else lower), (np.inf if upper is None else upper)
        if not low <= value <= high:
            raise ArgumentError(f"value of number {shown(name)} is {value}; wanted {low} to {high}")
        bounds = {k: None if x is None else float(x) for k, x in (("min", lower), ("max", upper))}
        # The page shows and takes as many digits as the step has.
        step = min(1e-3, slider_step(0.0, abs(value) or 1.0))
        handle = self._open_page.gui.add_number(name, float(value), step=step, **bounds)
        return Slider(self._add_control(handle, changed))

    def checkbox(
        self, name: str, value: bool = False, *, changed: Callable[[bool], object] | None = None
    ) -> Checkbox:
        """Add a box that is checked or not; `changed(value)` is called when it is changed in the page."""
        _checked_label("name of a checkbox", name)
        checked = _checked_switch(f"value of checkbox {shown(name)}", value)
        return Checkbox(self._add_control(self._open_page.gui.add_checkbox(name, checked), changed))

    def dropdown(
        self,
        name: str,
        options: Iterable[str],
        value: str | None = None,
        *,
        changed: Callable[[str], object] | None = None,
    ) -> Dropdown:
        """Add a choice of one of the `options`, at first of `value` or the first one; `changed(value)` is
        called when another is chosen in the page."""
        _checked_label("name of a dropdown", name)
        texts = tuple(options) if is_listed(options) else ()
        if not texts or not all(isinstance(each, str) and each for each in texts):
            raise ArgumentError(f"options of dropdown {shown(name)} are {shown(options)}; wanted texts")
        start = texts[0] if value is None else value
        start = _checked_choice(f"value of dropdown {shown(name)}", start, texts)
        return Dropdown(
            self._add_control(self._open_page.gui.add_dropdown(name, texts, initial_value=start), changed)
        )

    def button(self, name: str, pressed: Callable[[], object]) -> Control:
        """Add a button; `pressed()` is called when it is pressed."""
        call = _checked_function("pressed", pressed)
        handle = self._open_page.gui.add_button(_checked_label("name of a button", name))
        handle.on_click(lambda _: self._called(call))
        return Control(self._add(handle))

    @property
    def keys(self) -> frozenset[str]:
        """Names of the keys that are held in any open page at present, in small letters, as ``"arrowup"``.

        A page tells of its keys from the first time that a program reads this, or calls `on_key`.
        """
        return self._page_input().held

    def on_key(
        self, key: str, pressed: Callable[[], object], released: Callable[[], object] | None = None
    ) -> None:
        """Call `pressed()` when a key is pressed in the page, such as ``"r"`` or ``"arrowup"``, and
        `released()` when it is released; `keys` are those that are held.

        The keys stand in the list of commands of the page, too. Raises ArgumentError for a key that the page
        uses itself, as P where it plays.
        """
        end = None if released is None else _checked_function("released", released)
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
        self._add(command)
        given = self._page_input()
        if end is not None:
            given.on_released(wanted.lower(), end)

    def on_pointer_moved(self, moved: Callable[[str | None, Floats, Floats], object]) -> None:
        """Call `moved(part, origin, direction)` when the pointer moves over the picture, at most 30 times a
        second: the part under the pointer, or None, and the ray (3,), (3,) from the camera through the
        pointer, in world axes."""
        self._page_input().on_moved(_checked_function("moved", moved))

    def text(
        self,
        text: str,
        position: ArrayLike,
        *,
        colour: Colour | None = None,
        size: float | None = None,
    ) -> Mark:
        """Write text at a position (3,) [m] in the world, with a colour and a size of the letters [pixels].

        `colour` is that of `line`.
        """
        label = _checked_label("text", text)
        point = checked_vector("position", position)
        if size is not None:
            positive_number("size of text", size)
        scene = self._open_page.scene
        if colour is None:
            scale = 1.0 if size is None else size / LABEL_SIZE
            node = scene.add_label(self._path("text"), label, position=point, font_screen_scale=scale)
            return Mark(self._add(node))
        x, y, z = point.tolist()
        self._written.append(WrittenText(label, (x, y, z), css(_checked_colour(colour)), size or LABEL_SIZE))
        return Mark(self._add(_Written(self, self._written[-1])))

    def _write(self) -> None:
        """Tell the page the coloured text that there is."""
        if self._texts is None:
            self._texts = self._page.gui.add_html(texts_element(self._written), order=math.inf)
        else:
            self._texts.content = texts_element(self._written)
        self._page.elements["texts"] = texts_element(self._written)

    def line(
        self,
        points: ArrayLike,
        colour: Colour = BLUE,
        thickness: float = 0.005,
        *,
        width: float | None = None,
    ) -> Mark:
        """Draw the line through points (n, 3) [m] of the world, with a thickness [m], or with a width
        [pixels] that is the same from any distance.

        `colour` is a name of `dynx.viewer.colours.NAMED`, ``"#rrggbb"``, three numbers from 0 to 1, or three
        whole numbers from 0 to 255.
        """
        array = checked_array("points", points, 3)
        if array.ndim != 2 or len(array) < 2:
            raise ArgumentError(f"points has shape {array.shape}; wanted (n, 3) with at least 2 points")
        segments = np.stack([array[:-1], array[1:]], axis=1).astype(np.float32)
        units = "scene" if width is None else "screen"
        across = positive_number(*(("thickness", thickness) if width is None else ("width", width)))
        return Mark(
            self._add(
                self._open_page.scene.add_line_segments(
                    self._path("line"),
                    segments,
                    _checked_colour(colour),
                    thickness=across,
                    thickness_units=units,
                )
            )
        )

    def on_click(
        self, parts: Mapping[str, Iterable[Any]], clicked: Callable[[str, Floats, Floats], object]
    ) -> None:
        """Call `clicked(part, origin, direction)` with the part that is clicked and the ray (3,), (3,) from
        the camera through the pointer, in world axes.

        `parts` are the nodes of shapes by the name of their part.
        """
        if not isinstance(parts, Mapping):
            raise ArgumentError(
                f"parts is {shown(parts)}; wanted the nodes of shapes by the name of their part"
            )
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


def _checked_switch(what: str, value: object) -> bool:
    if not isinstance(value, bool | np.bool_):
        raise ArgumentError(f"{what} is {shown(value)}; wanted True or False")
    return bool(value)


def _checked_choice(what: str, value: object, options: Sequence[str]) -> str:
    if not isinstance(value, str) or value not in options:
        raise ArgumentError(f"{what} is {shown(value)}{nearest(value, options)}")
    return value


def _checked_colour(colour: Colour) -> RGB:
    if isinstance(colour, str):
        if colour.lower() in NAMED:
            return NAMED[colour.lower()]
        if re.fullmatch("#[0-9a-fA-F]{6}", colour):
            return (int(colour[1:3], 16), int(colour[3:5], 16), int(colour[5:], 16))
        raise ArgumentError(f"colour is {shown(colour)}{nearest(colour, NAMED)}, or '#rrggbb'")
    if isinstance(colour, tuple | list) and len(colour) == 3:
        # (1, 0, 0) is red, as other libraries write it.
        if all(is_real(x) and 0.0 <= x <= 1.0 for x in colour):
            return (round(255 * colour[0]), round(255 * colour[1]), round(255 * colour[2]))
        if all(isinstance(x, int) and 0 <= x <= 255 for x in colour):
            return (int(colour[0]), int(colour[1]), int(colour[2]))
    raise ArgumentError(
        f"colour is {shown(colour)}; wanted a name, '#rrggbb', three numbers from 0 to 1, or three whole "
        "numbers from 0 to 255"
    )
