"""Shapes that one node of the page shows many times, and each copy as if it were a node of its own."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Awaitable, Callable
from typing import Any

import numpy as np

from dynx.viewer.triangles import Triangles

Calls = defaultdict[int, list[Callable[[Any], Any]]]
"""Functions by the number of the copy whose events they get."""


class CopiedShape:
    """A shape that one node shows for each of n robots, with its triangles in the frame of the link."""

    def __init__(self, node: Any, triangles: Triangles, count: int, colour: Any) -> None:
        """`colour` is the light that it reflects; None for a file with colours of its own, whose copies
        cannot be seen through one by one."""
        self.node, self.colour = node, colour
        self.vertices, self.faces = triangles
        self.copies = [ShapeCopy(self, k) for k in range(count)]
        """The shape of each robot."""
        self._shown = np.ones(count, dtype=np.float32)
        self._opacities = np.ones(count, dtype=np.float32)
        self._clicked: Calls | None = None
        self._dragged: Calls | None = None

    def is_shown(self, copy: int) -> bool:
        """Check whether a copy is shown."""
        return bool(self._shown[copy])

    def show(self, copy: int, shown: bool) -> None:
        """Show or hide a copy: one that is hidden has no extent."""
        if self._shown[copy] != shown:
            self._shown[copy] = shown
            self.node.batched_scales = self._shown

    def fade(self, opacities: dict[int, float]) -> None:
        """Let copies be seen through, by their numbers."""
        if self.colour is not None:
            for copy, opacity in opacities.items():
                self._opacities[copy] = opacity
            # viser sorts copies that are seen through.
            self.node.batched_opacities = None if (self._opacities == 1.0).all() else self._opacities

    def on_click(self, copy: int, function: Callable[[Any], Any]) -> None:
        """Call a function with each click on a copy."""
        if self._clicked is None:
            calls = self._clicked = defaultdict(list)

            def clicked(event: Any) -> None:
                for each in list(calls.get(event.instance_index, ())):
                    each(event)

            self.node.on_click(clicked)
        self._clicked[copy].append(function)

    def on_drag(self, copy: int, function: Callable[[Any], Awaitable[None]]) -> None:
        """Call an async function while a copy is dragged; viser calls others in any order."""
        if self._dragged is None:
            calls = self._dragged = defaultdict(list)

            async def dragged(event: Any) -> None:
                for each in list(calls.get(event.instance_index, ())):
                    await each(event)

            self.node.on_drag(dragged)
        self._dragged[copy].append(function)


class ShapeCopy:
    """The shape of one robot, with what the viewer uses of a node."""

    wxyz = (1.0, 0.0, 0.0, 0.0)
    position = (0.0, 0.0, 0.0)

    def __init__(self, shape: CopiedShape, number: int) -> None:
        self.shape, self.number = shape, number

    @property
    def name(self) -> str:
        """Path of the node that shows all copies."""
        return str(self.shape.node.name)

    @property
    def vertices(self) -> Any:
        """Vertices (n, 3) in the frame of the link [m]."""
        return self.shape.vertices

    @property
    def faces(self) -> Any:
        """Vertices of each triangle (m, 3)."""
        return self.shape.faces

    @property
    def visible(self) -> bool:
        """Whether the copy is shown."""
        return self.shape.is_shown(self.number)

    @visible.setter
    def visible(self, shown: bool) -> None:
        self.shape.show(self.number, shown)

    def on_click(self, function: Callable[[Any], Any]) -> None:
        """Call a function with each click on the copy."""
        self.shape.on_click(self.number, function)

    def on_drag(self, function: Callable[[Any], Awaitable[None]]) -> None:
        """Call an async function while the copy is dragged."""
        self.shape.on_drag(self.number, function)
