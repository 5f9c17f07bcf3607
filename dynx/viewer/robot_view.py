"""A robot on the page: what is shown of it, sliders, a handle for inverse kinematics, its configuration."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from dynx.errors import ArgumentError, DynxError
from dynx.model import Model
from dynx.model.configuration import checked_q, sampling_range
from dynx.model.geometry import Sphere
from dynx.model.rotations import quat_from_rpy, rpy_from_quat
from dynx.model.topology import longest_chain_end
from dynx.rbd.kinematics import frame_poses, link_poses
from dynx.registry import DEFAULT_ENGINE
from dynx.spatial.scalar import Floats
from dynx.spatial.se3 import homogeneous
from dynx.spatial.so3 import quat_exp, quat_log, rotation_from_quat
from dynx.viewer.browser import CopyButton
from dynx.viewer.colours import BLUE, VERMILION
from dynx.viewer.controls import slider_step
from dynx.viewer.drawn_robot import AS_DESCRIBED, DrawnRobot, Look, size_of, wxyz
from dynx.viewer.following import FollowingCamera
from dynx.viewer.framing import SHARE, box_around, points_around
from dynx.viewer.marks import Marks, NamedParts
from dynx.viewer.page import Page
from dynx.viewer.triangles import triangles_of

if TYPE_CHECKING:
    from dynx.backends import Backend
    from dynx.viewer.motion import MotionFrames


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

    A floating base has six more, for its position and its rotation. A ball joint has three, for its rotation
    vector in the axes of the joint, and is turned back where that is beyond its largest angle. Where a
    configuration is beyond the range of a slider, the range grows to it: the page shows the configuration as
    it is.
    """

    def __init__(self, gui: Any, model: Model, q: Floats, changed: Callable[[Floats], None]) -> None:
        """`changed(q)` is called when a slider was moved in the page."""
        self._gui, self._model, self._changed = gui, model, changed
        self._q = q.copy()
        self._base = self._base_of(q)
        joints = [(model.position_index(joint.name), joint) for joint in model.coordinate_joints]
        self._places = [(at, k) for at, joint in joints for k in range(joint.n_rates)]
        """Index in q of the joint of each slider after those of the base, and the axis of a ball joint."""
        self._rotations = self._rotations_of(q)
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
        self._q, self._base, self._rotations = q.copy(), self._base_of(q), self._rotations_of(q)
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

    def _rotations_of(self, q: Floats) -> dict[int, list[float]]:
        """Return the rotation vector of each ball joint, by its index in q."""
        return {first: quat_log(q[first : first + 4]).tolist() for first in self._model.ball_places}

    def _values(self) -> list[float]:
        joints = [
            self._rotations[at][k] if at in self._rotations else float(self._q[at]) for at, k in self._places
        ]
        return [*self._base, *joints]

    @property
    def _units(self) -> list[str]:
        base = _BASE_UNITS.values() if self._model.floating else ()
        joints = self._model.coordinate_joints
        return [*base, *(joint.unit for joint in joints for _ in range(joint.n_rates))]

    def _factors(self) -> list[float]:
        turn = 180.0 / math.pi if self._degrees else 1.0
        return [turn if unit == "rad" else 1.0 for unit in self._units]

    def _ranges(self) -> list[tuple[float, float]]:
        ranges = []
        for joint in self._model.coordinate_joints:
            at = self._model.position_index(joint.name)
            low, high = float(self._model.lower[at]), float(self._model.upper[at])
            if joint.type == "ball":
                high = min(joint.limits.upper, math.pi)
                low = -high
            ranges += [sampling_range(low, high, _DEFAULT_RANGE[joint.unit])] * joint.n_rates
        joints = ranges
        return [*(self._base_ranges if self._model.floating else []), *joints]

    def _add(self) -> None:
        names = [*(_BASE_UNITS if self._model.floating else ()), *self._model.coordinate_names]
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
            at, axis = self._places[k - len(self._base)]
            if at in self._rotations:
                self._rotations[at][axis] = value
                self._q[at : at + 4] = quat_exp(np.array(self._rotations[at]))
                self._q = self._model.clip(self._q)
            else:
                self._q[at] = value
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


_LONGEST = 0.25
"""Length of the longest arrow and of the longest half axis, as a share of the robot's size."""

_THIN, _HEAD = 0.012, 0.036
"""Radius of the shaft of an arrow and length of its head, as shares of the robot's size."""

_LEAST = 2e-3
"""Gravity torque below which a joint has no arrow, as a share of its effort limit."""


class GravityTorques:
    """An arrow along the axis of each joint, with a number: its gravity torque, relative to the effort limit.

    Joints without a limit are relative to the largest gravity torque of these. An arrow points along the axis
    for a positive torque, and its shaft is as long as the share. It begins where the axis leaves the robot; a
    joint without torque has none.
    """

    def __init__(self, scene: Any, robot: DrawnRobot, engine: Callable[[], Backend]) -> None:
        self._robot, self._model, self._engine, self._scene = robot, robot.model, engine, scene
        self._size = size_of(robot.model)
        self._arrows: Any = None
        self._numbers: dict[str, Any] = {}
        self.shown = False
        """True while the arrows are shown."""

    def move(self, q: Floats) -> None:
        """Show the torques at a configuration (nq,), at which the robot stands, if they are shown."""
        arrows = list(self._arrows_at(q)) if self.shown else []
        for label in self._numbers.values():
            label.visible = False
        for name, text, segment in arrows:
            if name not in self._numbers:
                self._numbers[name] = self._scene.add_label(f"/gravity_torque{len(self._numbers)}", text)
            label = self._numbers[name]
            label.text, label.position, label.visible = text, segment[1], True
        if arrows:
            points = np.array([segment for _, _, segment in arrows], dtype=np.float32)
            if self._arrows is None:
                thin = _THIN * self._size
                self._arrows = self._scene.add_arrows(
                    "/gravity_torques",
                    points,
                    VERMILION,
                    shaft_radius=thin,
                    head_radius=2.0 * thin,
                    head_length=_HEAD * self._size,
                )
            self._arrows.points = points
        if self._arrows is not None:
            self._arrows.visible = bool(arrows)

    def _arrows_at(self, q: Floats) -> Iterator[tuple[str, str, Floats]]:
        """Yield the name of each coordinate with a torque, the number, and the ends (2, 3) of its arrow."""
        model = self._model
        tau = self._engine().gravity_torque(q)[6 * model.floating :]
        limit = model.effort_limit[6 * model.floating :]
        unlimited = ~(np.isfinite(limit) & (limit > 0.0))
        largest = float(np.abs(tau[unlimited]).max(initial=0.0)) or 1.0
        share = np.clip(tau / np.where(unlimited, largest, np.where(limit > 0.0, limit, 1.0)), -1.0, 1.0)
        poses = dict(link_poses(model, q))
        # The torque of a ball joint acts about the axes of its child.
        joints = [
            (joint, np.asarray(axis, dtype=np.float64))
            for joint in model.coordinate_joints
            for axis in (np.eye(3) if joint.type == "ball" else [joint.axis])
        ]
        for k, (joint, axis) in enumerate(joints):
            if abs(share[k]) < _LEAST:
                continue
            T = poses[joint.child]
            along = math.copysign(1.0, share[k]) * T[:3, :3] @ (axis / np.linalg.norm(axis))
            leaves = self._robot.way_out(T[:3, 3], along, _THIN * self._size, self._robot.links)
            start = T[:3, 3] + leaves * along
            unit = "N" if joint.type == "prismatic" else "N m"
            end = start + (_HEAD + _LONGEST * abs(share[k])) * self._size * along
            yield model.coordinate_names[k], f"{tau[k]:.3g} {unit}", np.stack([start, end])


class Manipulability:
    """The ellipsoid of the velocities that unit joint speeds give a frame (Yoshikawa 1985), to scale.

    Half its axes are the singular values of the linear rows of the Jacobian; the longest is drawn with the
    same length always, so that the shape tells how far a singular configuration is.
    """

    def __init__(self, scene: Any, model: Model, engine: Callable[[], Backend]) -> None:
        self._model, self._engine, self._scene = model, engine, scene
        self._size = size_of(model)
        self._node: Any = None
        self.shown = False
        """True while the ellipsoid is shown."""

    def move(self, q: Floats, frame: str) -> None:
        """Show the ellipsoid of a frame at a configuration (nq,), if it is shown."""
        if self._node is not None:
            self._node.visible = self.shown
        if not self.shown:
            return
        J = self._engine().jacobian(q, frame)[:3, 6 * self._model.floating :]
        U, values, _ = np.linalg.svd(J)
        half = np.zeros(3)
        half[: len(values)] = values
        longest = float(half.max())
        half = half / longest if longest > 0.0 else half
        if np.linalg.det(U) < 0.0:
            U[:, 2] *= -1.0
        if self._node is None:
            unit = triangles_of(Sphere(1.0))
            self._node = self._scene.add_mesh_simple(
                "/manipulability", unit.vertices, unit.faces, color=BLUE, opacity=0.35, cast_shadow=False
            )
        self._node.scale = tuple((_LONGEST * self._size * np.maximum(half, 0.01)).tolist())
        self._node.wxyz = wxyz(U)
        self._node.position = dict(frame_poses(self._model, q))[frame][:3, 3]


_FREE = {"pose": None, "position": "rotation", "rotation": "position"}
"""What the handle keeps of a frame, and what `inverse_kinematics` then leaves free."""


class RobotView:
    """One robot, which the sliders and the handle of the page move."""

    def __init__(
        self,
        page: Page,
        model: Model,
        q: Floats | None = None,
        *,
        engine: str | None = None,
        look: Look = AS_DESCRIBED,
        collisions: bool = False,
    ) -> None:
        """`engine` computes inverse kinematics, torques and Jacobians; `collisions` are shown at once.

        The default backend is loaded when it first has to compute, so that the robot is seen sooner.
        """
        self.model = model
        self._page = page
        self._engine_name = engine or DEFAULT_ENGINE
        if engine is not None:
            _ = self._engine
        start = model.clip(model.neutral()) if q is None else checked_q(model, q, "q")
        with page.together():
            self.robot = DrawnRobot(page.scene, "/robot", model, look)
            self.robot.move(start)
        self._marks = Marks(page, self.robot)
        self._torques = GravityTorques(page.scene, self.robot, lambda: self._engine)
        self._ellipsoid = Manipulability(page.scene, model, lambda: self._engine)
        size = size_of(model)
        tip = longest_chain_end(model.links, model.joints)
        self._handle = FrameHandle(page.scene, model, lambda: self._engine, tip, 0.25 * size, self._dragged)
        self._add_switches(collisions=collisions)
        self.notes = self.robot.notes
        """Shapes that cannot be drawn, one sentence each."""
        self._add_frame_controls()
        self._sliders = JointSliders(page.gui, model, start, self._slid)
        self._add_configuration()
        self.camera = FollowingCamera(page, self.robot)
        """The camera of the page."""
        self.names = NamedParts(page, self.robot)
        """The names of the part under the pointer and of that which was clicked."""
        self._handle.put(start)
        self._show(start)
        places = {f"{model.name}/{link}": self.robot.pose(link)[None] for link in self.robot.links}
        low, high = box_around(places, robots={model.name: model})
        # A humanoid whose base is its pelvis stands above the ground, too.
        page.lay_ground(float(np.linalg.norm(high - low)) or size, min(float(low[2]), 0.0))
        page.look_at(points_around(places, robots={model.name: model}), SHARE)

    @property
    def title(self) -> str:
        """Name of the robot."""
        return self.model.name

    @property
    def shows_both(self) -> bool:
        """True where collision shapes are shown together with visual ones."""
        return all(self.switches[name].value for name in ("visual shapes", "collision shapes"))

    @property
    def drawn(self) -> DrawnRobot:
        """The nodes of the links."""
        return self.robot

    @property
    def visuals(self) -> Mapping[str, Sequence[Any]]:
        """The nodes of the visual shapes of each link."""
        return self.robot.visuals

    @property
    def motions(self) -> tuple[MotionFrames, ...]:
        """The robot as it stands, with its collision shapes where they alone are shown."""
        from dynx.viewer.motion import motion_of_robot

        return (motion_of_robot(self.robot.seen_model, self.q),)

    @property
    def time(self) -> float:
        """Zero: a robot stands still."""
        return 0.0

    legend = ""
    """Empty: one robot needs none."""

    duration: float | None = 0.0
    """Zero: a robot stands still."""

    def go_to(self, time: float) -> None:
        """Show the robot as it stands."""

    @property
    def q(self) -> Floats:
        """The configuration that is shown (nq,)."""
        return self._sliders.q

    def put(self, q: ArrayLike) -> None:
        """Show a configuration (nq,)."""
        checked = checked_q(self.model, q, "q")
        if checked.ndim != 1:
            raise ArgumentError(f"q has shape {checked.shape}; wanted ({self.model.nq},)")
        with self._page.lock, self._page.together():
            self._sliders.put(checked)
            self._handle.put(checked)
            self._show(checked)

    @cached_property
    def _engine(self) -> Backend:
        from dynx.backends import backend

        engine = backend(self._engine_name, self.model)
        self._page.at_end(engine.close)
        return engine

    def _show(self, q: Floats) -> None:
        self.robot.move(q)
        self._report("")
        try:
            self._torques.move(q)
            self._ellipsoid.move(q, self._handle.frame)
        except DynxError as error:
            self._report(str(error))
        self._code.value = f"q = np.array({q.tolist()})"
        self._copy.put(self._code.value)

    def _slid(self, q: Floats) -> None:
        with self._page.lock, self._page.together():
            self._handle.put(q)
            self._show(q)

    def _dragged(self, q: Floats, message: str) -> None:
        with self._page.lock, self._page.together():
            self._sliders.put(q)
            self._show(q)
            if message:
                self._report(message)

    def _report(self, message: str) -> None:
        """Show what became of the target, or an error; an empty message is hidden."""
        self._message.value, self._message.visible = message, bool(message)

    # -- controls -----------------------------------------------------------------------------

    def _add_switches(self, *, collisions: bool) -> None:
        gui = self._page.gui
        names = ("visual shapes", "collision shapes", *Marks.kinds, "gravity torques", "manipulability")
        begin = {"visual shapes": not collisions, "collision shapes": collisions}
        with gui.add_folder("show"):
            self.switches = {name: gui.add_checkbox(name, begin.get(name, False)) for name in names}
            """The boxes that show and hide something, by what they show."""
        visual, colliding, *marks, torques, ellipsoid = self.switches.values()
        for kind, box in zip(Marks.kinds, marks, strict=True):
            box.on_update(lambda _, kind=kind, box=box: self._mark(kind, box))

        def shapes(_: Any = None) -> None:
            with self._page.lock, self._page.together():
                self.robot.show(visuals=visual.value, collisions=colliding.value)

        def quantities(_: Any) -> None:
            with self._page.lock, self._page.together():
                self._torques.shown, self._ellipsoid.shown = torques.value, ellipsoid.value
                self._show(self.q)

        visual.on_update(shapes)
        colliding.on_update(shapes)
        torques.on_update(quantities)
        ellipsoid.on_update(quantities)
        shapes()

    def _mark(self, kind: str, box: Any) -> None:
        with self._page.lock, self._page.together():
            self._marks.show(kind, box.value)

    def _add_frame_controls(self) -> None:
        gui = self._page.gui
        with gui.add_folder("frame"):
            frame = gui.add_dropdown("frame", self.model.frame_names, initial_value=self._handle.frame)
            drag = gui.add_checkbox("drag it", initial_value=False)
            kept = gui.add_dropdown("target", tuple(_FREE), initial_value="pose")
            self._message = gui.add_text("result", "", multiline=True, disabled=True, visible=False)

        def changed(_: Any) -> None:
            with self._page.lock, self._page.together():
                self._handle.frame, self._handle.free = frame.value, _FREE[kept.value]
                self._handle.visible = drag.value
                self._handle.put(self.q)
                self._show(self.q)

        for control in (frame, drag, kept):
            control.on_update(changed)

    def _add_configuration(self) -> None:
        gui = self._page.gui
        with gui.add_folder("configuration"):
            neutral = gui.add_button("neutral")
            drawn = gui.add_button("random")
            self._code = gui.add_text("as code", "", multiline=True)
            self._copy = CopyButton(gui, "copy")
        rng = np.random.default_rng(0)
        neutral.on_click(lambda _: self.put(self.model.clip(self.model.neutral())))
        drawn.on_click(lambda _: self.put(self.model.random(rng)))
