"""A slider for each joint of a robot, within its limits, in degrees or radians."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from dynx.model import Model
from dynx.model.configuration import sampling_range
from dynx.spatial.scalar import Floats
from dynx.viewer.controls import slider_step

_DEFAULT_RANGE = {"rad": math.pi, "m": 1.0}
"""Half the range of a joint without limits."""

_BASE_RANGE = (-2.0, 2.0)
"""Range of the position of a floating base [m]."""

BASE = ("base x", "base y", "base z")
"""Sliders of a floating base: its position [m]."""


class JointSliders:
    """The sliders of a robot, and its configuration.

    A floating base has three more, for its position; its rotation is changed by dragging a frame.
    """

    def __init__(self, gui: Any, model: Model, q: Floats, changed: Callable[[Floats], None]) -> None:
        """`changed(q)` is called when a slider was moved in the page."""
        self._gui, self._model, self._changed = gui, model, changed
        self._q = q.copy()
        self._degrees = True
        self._handles: list[Any] = []
        self._unit = gui.add_dropdown("angles in", ("degrees", "radians"), initial_value="degrees")
        self._unit.on_update(lambda _: self._change_unit())
        self._folder = gui.add_folder("joints")
        self._add()

    @property
    def q(self) -> Floats:
        """The configuration (nq,)."""
        return np.array(self._q)

    def put(self, q: Floats) -> None:
        """Move the sliders to a configuration (nq,), without calling `changed`."""
        self._q = q.copy()
        for handle, value, factor in zip(self._handles, self._values(), self._factors(), strict=True):
            handle.value = _shown(value * factor, handle.min, handle.max)

    def _values(self) -> list[float]:
        base = self._q[:3].tolist() if self._model.floating else []
        return [*base, *self._q[self._offset :].tolist()]

    @property
    def _offset(self) -> int:
        return 7 if self._model.floating else 0

    def _factors(self) -> list[float]:
        turn = 180.0 / math.pi if self._degrees else 1.0
        joints = [turn if joint.unit == "rad" else 1.0 for joint in self._model.coordinate_joints]
        return [*([1.0] * 3 if self._model.floating else []), *joints]

    def _ranges(self) -> list[tuple[float, float]]:
        lower, upper = self._model.lower[self._offset :], self._model.upper[self._offset :]
        joints = [
            sampling_range(float(low), float(high), _DEFAULT_RANGE[joint.unit])
            for low, high, joint in zip(lower, upper, self._model.coordinate_joints, strict=True)
        ]
        return [*([_BASE_RANGE] * 3 if self._model.floating else []), *joints]

    def _add(self) -> None:
        names = [*(BASE if self._model.floating else ()), *self._model.joint_names]
        units = [
            *(["m"] * 3 if self._model.floating else []),
            *(j.unit for j in self._model.coordinate_joints),
        ]
        rows = zip(names, units, self._values(), self._factors(), self._ranges(), strict=True)
        with self._folder:
            for k, (name, unit, value, factor, (low, high)) in enumerate(rows):
                low, high = _rounded_inward(low * factor, high * factor)
                shown = "deg" if unit == "rad" and self._degrees else unit
                self._handles.append(
                    self._gui.add_slider(
                        name,
                        min=low,
                        max=high,
                        # A joint whose limits are equal has a slider that does not move.
                        step=slider_step(low, high) if high > low else 1.0,
                        initial_value=_shown(value * factor, low, high),
                        hint=f"{name}: {low:.4g} to {high:.4g} {shown}",
                        disabled=high <= low,
                    )
                )
                self._handles[-1].on_update(lambda event, k=k: self._moved(k, event))

    def _moved(self, k: int, event: Any) -> None:
        if event.client is None:  # Set by `put`, not in the page.
            return
        base = 3 if self._model.floating else 0
        at = k if k < base else self._offset + k - base
        self._q[at] = float(self._handles[k].value) / self._factors()[k]
        self._changed(self.q)

    def _change_unit(self) -> None:
        self._degrees = self._unit.value == "degrees"
        for handle in self._handles:
            handle.remove()
        self._handles.clear()
        self._add()


def _shown(value: float, low: float, high: float) -> float:
    """Return a value with the digits that its slider has, within its range."""
    if high > low:
        value = round(value, max(0, -round(math.log10(slider_step(low, high)))))
    return min(max(value, low), high)


def _rounded_inward(low: float, high: float) -> tuple[float, float]:
    """Return a range with few digits, for the page, that lies within the range given."""
    unit = 10.0 ** math.floor(math.log10(high - low) - 3.0) if high > low else 1.0
    rounded = math.ceil(low / unit - 1e-6) * unit, math.floor(high / unit + 1e-6) * unit
    digits = max(0, round(-math.log10(unit)))
    inner = round(rounded[0], digits), round(rounded[1], digits)
    return inner if low <= inner[0] < inner[1] <= high else (low, high)
