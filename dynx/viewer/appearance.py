"""Parts that are hidden or seen through, and views that are kept, with their controls in the page."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Protocol

import numpy as np

from dynx.errors import ArgumentError, nearest, shown
from dynx.model.numbers import is_real
from dynx.steppers.camera import Camera
from dynx.viewer.browser import opacities_element
from dynx.viewer.drawn_robot import DrawnParts
from dynx.viewer.page import Page

_ALL = "all"
_NO_VIEW = "none"


class DrawnSubject(Protocol):
    """A view of robots or of a scene."""

    @property
    def drawn(self) -> DrawnParts:
        """The nodes of the parts, which may be others when a world is replaced."""


class PartVisibility:
    """Visibility and opacity of the parts of a drawing."""

    def __init__(self, page: Page, view: DrawnSubject) -> None:
        self._page, self._view = page, view
        drawn = view.drawn
        self._opacity: dict[str, float] = {}
        gui = page.gui
        with gui.add_folder("parts", expand_by_default=False):
            self._part = gui.add_dropdown("part", (_ALL, *drawn.choices), initial_value=_ALL)
            self._visible = gui.add_checkbox("visible", initial_value=True)
            self._slider = gui.add_slider("opacity", 0.0, 1.0, step=0.01, initial_value=1.0)
        self._element = gui.add_html(opacities_element({}), order=math.inf)
        self._part.on_update(lambda _: self._show_values())
        self._visible.on_update(lambda event: self._changed(event, self.set_visible, self._visible))
        self._slider.on_update(lambda event: self._changed(event, self.set_opacity, self._slider))

    def _changed(self, event: Any, change: Callable[[str | None, Any], None], control: Any) -> None:
        """Take over a value that a page has given a control."""
        if event.client is not None:
            change(self._chosen, control.value)

    @property
    def _drawn(self) -> DrawnParts:
        return self._view.drawn

    @property
    def _chosen(self) -> str | None:
        return None if self._part.value == _ALL else self._part.value

    def set_visible(self, part: str | None, visible: bool) -> None:
        """Show or hide a part, or a robot by its name; None for all. Raises ArgumentError for another."""
        if not isinstance(visible, bool):
            raise ArgumentError(f"visible is {shown(visible)}; wanted True or False")
        with self._page.lock, self._page.together():
            for name in self._named(part):
                self._drawn.set_visible(name, visible)
            self._show_values()

    def set_opacity(self, part: str | None, opacity: float) -> None:
        """Let a part, or a robot by its name, be seen through: 1 is opaque, 0 is not seen; None for all but
        the ground.

        Raises ArgumentError for another name, and for an opacity that is not from 0 to 1."""
        if not is_real(opacity) or not 0.0 <= opacity <= 1.0:
            raise ArgumentError(f"opacity is {shown(opacity)}; wanted 0 to 1")
        with self._page.lock, self._page.together():
            kept = self._drawn.grounds if part is None else ()
            for name in self._named(part):
                if name not in kept:
                    self._opacity[name] = float(opacity)
            paths = self._drawn.fade(self._opacity)
            self._element.content = self._page.elements["opacities"] = opacities_element(paths)
            self._show_values()

    @property
    def opacities(self) -> dict[str, float]:
        """Factor of the opacity of each part that is changed: 0 for one that is hidden."""
        return self._opacity | dict.fromkeys(self._drawn.hidden, 0.0)

    def _named(self, part: str | None) -> list[str]:
        return list(self._drawn.parts) if part is None else self._drawn.named(part)

    def _show_values(self) -> None:
        """Let the controls show the values of the part that is chosen."""
        named = self._named(self._chosen)
        self._visible.value = all(name not in self._drawn.hidden for name in named)
        kept = self._drawn.grounds if self._chosen is None else ()
        opacities = [self._opacity.get(name, 1.0) for name in named if name not in kept]
        self._slider.value = max(opacities, default=1.0)


def camera_of(client: Any) -> Camera:
    """Return the camera of a page, with the size of its picture."""
    camera = client.camera
    return Camera.look_at(
        np.array(camera.position),
        np.array(camera.look_at),
        np.array(camera.up_direction),
        field_of_view=float(camera.fov),
        size=(int(camera.image_width), int(camera.image_height)),
    )


def look_from(client: Any, camera: Camera) -> None:
    """Give a page the view of a camera in the world; it turns about a point as far away as before."""
    T = camera.pose.matrix
    distance = float(np.linalg.norm(np.subtract(client.camera.position, client.camera.look_at))) or 1.0
    with client.atomic():
        client.camera.up_direction = tuple((-T[:3, 1]).tolist())
        client.camera.position = tuple(T[:3, 3].tolist())
        client.camera.look_at = tuple((T[:3, 3] + distance * T[:3, 2]).tolist())
        client.camera.fov = camera.field_of_view


class SavedViews:
    """Views by name, which stay when something else is shown on the page."""

    def __init__(self) -> None:
        self.cameras: dict[str, Camera] = {}
        """The cameras of the views, in the world."""
        self._dropdown: Any = None

    def add_controls(self, page: Page) -> None:
        """Add a button that saves the view of its page, and a choice of one that is saved."""
        gui = page.gui
        with gui.add_folder("views", expand_by_default=False):
            save = gui.add_button("save this view")
            self._dropdown = gui.add_dropdown("view", (_NO_VIEW, *self.cameras), initial_value=_NO_VIEW)
        save.on_click(lambda event: self.save(self._new_name(), camera_of(event.client)))

        def choose(event: Any) -> None:
            if event.client is not None and self._dropdown.value in self.cameras:
                look_from(event.client, self.cameras[self._dropdown.value])

        self._dropdown.on_update(choose)

    def save(self, name: str, camera: Camera) -> None:
        """Keep a view under a name, instead of one that has it already."""
        self.cameras[name] = camera
        self._dropdown.options = (_NO_VIEW, *self.cameras)

    def find(self, name: str) -> Camera:
        """Return a view. Raises ArgumentError for an unknown name."""
        if name not in self.cameras:
            known = nearest(name, self.cameras) if self.cameras else "; there is none, `save_view` keeps one"
            raise ArgumentError(f"no view {shown(name)}{known}")
        return self.cameras[name]

    def _new_name(self) -> str:
        number = len(self.cameras) + 1
        while f"view {number}" in self.cameras:
            number += 1
        return f"view {number}"
