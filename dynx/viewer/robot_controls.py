"""Controls of a robot: a slider for each joint, and a handle that moves a frame by inverse kinematics."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from dynx.model import Model
from dynx.model.configuration import sampling_range
from dynx.model.rotations import quat_from_rpy, rpy_from_quat
from dynx.rbd.link_poses import frame_poses
from dynx.spatial.scalar import Floats
from dynx.spatial.se3 import homogeneous
from dynx.spatial.so3 import rotation_from_quat
from dynx.viewer.controls import slider_step
from dynx.viewer.drawn_parts import wxyz

if TYPE_CHECKING:
    from dynx.backends import Backend

_DEFAULT_RANGE = {"rad": math.pi, "m": 1.0}
"""Half the range of a joint without limits."""

_BASE_REACH = 2.0
"""Half the range of the position of a floating base, around that at the start [m]."""

_BASE_UNITS = {
    "base x": "m",
    "base y": "m",
    "base z": "m",
    "base roll": "rad",
    "base pitch": "rad",
    "base yaw": "rad",
}
"""Sliders of a floating base: its position, and the angles of R = Rz(yaw) Ry(pitch) Rx(roll)."""

_ANGLE_RANGES = ((-math.pi, math.pi), (-math.pi / 2, math.pi / 2), (-math.pi, math.pi))
"""Ranges of the angles of a floating base, within which each rotation has one triple [rad]."""


class JointSliders:
    """The sliders of a robot, and its configuration.

    A floating base has six more, for its position and its rotation. Where a configuration is beyond the range
    of a slider, the range grows to it: the page shows the configuration as it is.
    """

    def __init__(self, gui: Any, model: Model, q: Floats, changed: Callable[[Floats], None]) -> None:
        """`changed(q)` is called when a slider was moved in the page."""
        self._gui, self._model, self._changed = gui, model, changed
        self._q = q.copy()
        self._base = self._base_of(q)
        self._base_ranges = [(x - _BASE_REACH, x + _BASE_REACH) for x in self._base[:3]] + [*_ANGLE_RANGES]
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
        self._q, self._base = q.copy(), self._base_of(q)
        rows = zip(self._handles, self._values(), self._factors(), self._ranges(), strict=True)
        for handle, value, factor, (low, high) in rows:
            low, high = _range_around(value * factor, low * factor, high * factor)
            # Each assignment is a message to the page.
            if (handle.min, handle.max) != (low, high):
                handle.min, handle.max = low, high
            handle.value = _shown(value * factor, low, high)

    def _base_of(self, q: Floats) -> list[float]:
        """Return the values of the sliders of the base at a configuration: none, or six."""
        return [*q[:3].tolist(), *rpy_from_quat(q[3:7]).tolist()] if self._model.floating else []

    def _values(self) -> list[float]:
        return [*self._base, *self._q[self._offset :].tolist()]

    @property
    def _offset(self) -> int:
        return 7 if self._model.floating else 0

    @property
    def _units(self) -> list[str]:
        base = _BASE_UNITS.values() if self._model.floating else ()
        return [*base, *(joint.unit for joint in self._model.coordinate_joints)]

    def _factors(self) -> list[float]:
        turn = 180.0 / math.pi if self._degrees else 1.0
        return [turn if unit == "rad" else 1.0 for unit in self._units]

    def _ranges(self) -> list[tuple[float, float]]:
        lower, upper = self._model.lower[self._offset :], self._model.upper[self._offset :]
        joints = [
            sampling_range(float(low), float(high), _DEFAULT_RANGE[joint.unit])
            for low, high, joint in zip(lower, upper, self._model.coordinate_joints, strict=True)
        ]
        return [*(self._base_ranges if self._model.floating else []), *joints]

    def _add(self) -> None:
        names = [*(_BASE_UNITS if self._model.floating else ()), *self._model.joint_names]
        rows = zip(names, self._units, self._values(), self._factors(), self._ranges(), strict=True)
        with self._folder:
            for k, (name, unit, value, factor, (low, high)) in enumerate(rows):
                hint = "{:.4g} to {:.4g}".format(*_rounded_inward(low * factor, high * factor))
                low, high = _range_around(value * factor, low * factor, high * factor)
                shown = "deg" if unit == "rad" and self._degrees else unit
                self._handles.append(
                    self._gui.add_slider(
                        name,
                        min=low,
                        max=high,
                        # A joint whose limits are equal has a slider that does not move.
                        step=slider_step(low, high) if high > low else 1.0,
                        initial_value=_shown(value * factor, low, high),
                        hint=f"{name}: {hint} {shown}",
                        disabled=high <= low,
                    )
                )
                self._handles[-1].on_update(lambda event, k=k: self._moved(k, event))

    def _moved(self, k: int, event: Any) -> None:
        if event.client is None:  # Set by `put`, not in the page.
            return
        handle = self._handles[k]
        # While a number is typed, the page sends it also where it is beyond the range.
        value = min(max(float(handle.value), handle.min), handle.max) / self._factors()[k]
        if k >= len(self._base):
            self._q[self._offset + k - len(self._base)] = value
        else:
            # The angles of the sliders are kept: at a pitch of 90 degrees the rotation does not tell them.
            self._base[k] = value
            if k < 3:
                self._q[k] = value
            else:
                self._q[3:7] = quat_from_rpy(self._base[3:])
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


def _range_around(value: float, low: float, high: float) -> tuple[float, float]:
    """Return the range of a slider with few digits, which holds the value also where it is beyond."""
    low, high = _rounded_inward(low, high)
    if high <= low:
        # Neither value nor ends of the slider of a joint that cannot move have more digits than others.
        low = high = float(f"{low:.4g}")
        value = float(f"{value:.4g}")
        return min(low, value), max(high, value)
    within = low - slider_step(low, high) < value < high + slider_step(low, high)
    return (low, high) if within else (min(low, value), max(high, value))


def _rounded_inward(low: float, high: float) -> tuple[float, float]:
    """Return a range with few digits, for the page, that lies within the range given."""
    unit = 10.0 ** math.floor(math.log10(high - low) - 3.0) if high > low else 1.0
    rounded = math.ceil(low / unit - 1e-6) * unit, math.floor(high / unit + 1e-6) * unit
    digits = max(0, round(-math.log10(unit)))
    inner = round(rounded[0], digits), round(rounded[1], digits)
    return inner if low <= inner[0] < inner[1] <= high else (low, high)


_RESTARTS_IN_A_DRAG = 0
"""Restarts of the solver while the handle moves: a restart would let the robot jump."""


class FrameHandle:
    """The handle on one frame; the frame, and what of its pose is kept, can be changed."""

    def __init__(
        self,
        scene: Any,
        model: Model,
        engine: Callable[[], Backend],
        frame: str,
        size: float,
        moved: Callable[[Floats, str], None],
    ) -> None:
        """`moved(q, message)` is called with each configuration that a drag leads to; `engine()` returns the
        backend that solves for it."""
        self._model, self._engine, self._moved = model, engine, moved
        self.frame = frame
        self._free: str | None = None
        self.q = model.neutral()
        """The configuration from which the next drag begins."""
        self._latest: Floats | None = None
        self._guard = threading.Lock()
        self._busy = threading.Lock()
        self._node = scene.add_transform_controls("/handle", scale=size, depth_test=False, visible=False)
        self._node.on_update(self._dragged)

    @property
    def free(self) -> str | None:
        """Free part of the pose: ``"rotation"``, ``"position"``, or None.

        The handle has no rings where rotation is free, and neither arrows nor squares where position is.
        """
        return self._free

    @free.setter
    def free(self, free: str | None) -> None:
        self._free = free
        self._node.disable_rotations = free == "rotation"
        self._node.disable_axes = self._node.disable_sliders = free == "position"

    @property
    def visible(self) -> bool:
        """True while the handle is shown."""
        return bool(self._node.visible)

    @visible.setter
    def visible(self, shown: bool) -> None:
        self._node.visible = shown

    def put(self, q: Floats) -> None:
        """Place the handle on the frame at a configuration (nq,)."""
        self.q = q
        T = dict(frame_poses(self._model, q))[self.frame]
        self._node.wxyz, self._node.position = wxyz(T[:3, :3]), T[:3, 3]

    def _dragged(self, event: Any) -> None:
        w, x, y, z = np.asarray(self._node.wxyz, dtype=np.float64)
        R = rotation_from_quat(np.array([x, y, z, w]))
        with self._guard:
            self._latest = np.asarray(homogeneous(R, np.asarray(self._node.position, dtype=np.float64)))
        if event.phase == "end":
            with self._busy:
                self._solve_latest()
            self.put(self.q)
        elif self._busy.acquire(blocking=False):
            # Updates that come while one is solved replace each other, so that the robot follows the hand.
            try:
                while self._solve_latest():
                    pass
            finally:
                self._busy.release()

    def _solve_latest(self) -> bool:
        with self._guard:
            target, self._latest = self._latest, None
        if target is None:
            return False
        self._solve(target)
        return True

    def _solve(self, target: Floats) -> None:
        found = self._engine().inverse_kinematics(
            target, self.frame, self.q, free=self.free, max_restarts=_RESTARTS_IN_A_DRAG
        )
        self.q = found.q
        self._moved(found.q, found.message)
