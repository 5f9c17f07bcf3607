"""A robot on the page: what is shown of it, sliders, a handle for inverse kinematics, its configuration."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from dynx.errors import ArgumentError, DynxError
from dynx.model import Model
from dynx.model.configuration import checked_q
from dynx.model.geometry import Sphere
from dynx.model.topology import longest_chain_end
from dynx.rbd.link_poses import frame_poses, link_poses
from dynx.registry import DEFAULT_ENGINE
from dynx.spatial.scalar import Floats
from dynx.viewer.browser.client import CopyButton
from dynx.viewer.colours import BLUE, VERMILION
from dynx.viewer.drawn_parts import wxyz
from dynx.viewer.drawn_robot import AS_DESCRIBED, DrawnRobot, Look, size_of
from dynx.viewer.following_camera import FollowingCamera
from dynx.viewer.framing import box_around
from dynx.viewer.marks import Marks, NamedParts
from dynx.viewer.page import Page
from dynx.viewer.robot_controls import FrameHandle, JointSliders
from dynx.viewer.triangles import triangles_of

if TYPE_CHECKING:
    from dynx.backends import Backend
    from dynx.viewer.motion import Motion

_LONGEST = 0.25
"""Length of the longest bar and of the longest half axis, as a share of the robot's size."""


class GravityTorques:
    """A bar along the axis of each joint: its gravity torque, relative to the effort limit.

    Joints without a limit are relative to the largest gravity torque of these. A bar points along the axis
    for a positive torque.
    """

    def __init__(self, scene: Any, model: Model, engine: Callable[[], Backend]) -> None:
        self._model, self._engine, self._scene = model, engine, scene
        self._size = size_of(model)
        self._bars: Any = None
        self.shown = False
        """True while the bars are shown."""

    def move(self, q: Floats) -> None:
        """Show the torques at a configuration (nq,), if they are shown."""
        if self._bars is not None:
            self._bars.visible = self.shown
        if not self.shown:
            return
        points = self._points(q).astype(np.float32)
        if self._bars is None:
            thin = 0.012 * self._size
            self._bars = self._scene.add_arrows(
                "/gravity_torques",
                points,
                VERMILION,
                shaft_radius=thin,
                head_radius=2.0 * thin,
                head_length=3.0 * thin,
            )
        else:
            self._bars.points = points

    def _points(self, q: Floats) -> Floats:
        model = self._model
        tau = self._engine().gravity_torque(q)[model.nv - len(model.joint_names) :]
        limit = model.effort_limit[model.nv - len(model.joint_names) :]
        unlimited = ~(np.isfinite(limit) & (limit > 0.0))
        largest = float(np.abs(tau[unlimited]).max(initial=0.0)) or 1.0
        share = np.clip(tau / np.where(unlimited, largest, np.where(limit > 0.0, limit, 1.0)), -1.0, 1.0)
        poses = dict(link_poses(model, q))
        points = []
        for k, joint in enumerate(model.coordinate_joints):
            T = poses[joint.child]
            axis = np.asarray(joint.axis, dtype=np.float64)
            along = T[:3, :3] @ (axis / np.linalg.norm(axis))
            points.append([T[:3, 3], T[:3, 3] + _LONGEST * self._size * share[k] * along])
        return np.array(points, dtype=np.float64).reshape(-1, 2, 3)


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
        J = self._engine().jacobian(q, frame)[:3, self._model.nv - len(self._model.joint_names) :]
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


_SHARE = 0.7
"""Share of the picture that the robot takes at the start: its joints will move it."""

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
        self.notes = self.robot.notes
        """Shapes that cannot be drawn, one sentence each."""
        self._marks = Marks(page, self.robot)
        self._torques = GravityTorques(page.scene, model, lambda: self._engine)
        self._ellipsoid = Manipulability(page.scene, model, lambda: self._engine)
        size = size_of(model)
        tip = longest_chain_end(model.links, model.joints)
        self._handle = FrameHandle(page.scene, model, lambda: self._engine, tip, 0.25 * size, self._dragged)
        self._add_switches(collisions=collisions)
        self._add_frame_controls()
        self._sliders = JointSliders(page.gui, model, start, self._slid)
        self._add_configuration()
        self.camera = FollowingCamera(page, self.robot)
        """The camera of the page."""
        self.names = NamedParts(page, self.robot.links, self.robot.visuals)
        """The names of the part under the pointer and of that which was clicked."""
        self._handle.put(start)
        self._show(start)
        places = {f"{model.name}/{link}": self.robot.pose(link)[None] for link in self.robot.links}
        low, high = box_around(places, robots={model.name: model})
        # A humanoid whose base is its pelvis stands above the ground, too.
        page.add_ground(float(np.linalg.norm(high - low)) or size, min(float(low[2]), 0.0))
        page.look_at(low, high, _SHARE)

    @property
    def title(self) -> str:
        """Name of the robot."""
        return self.model.name

    @property
    def visuals(self) -> Mapping[str, Sequence[Any]]:
        """The nodes of the visual shapes of each link."""
        return self.robot.visuals

    @property
    def motions(self) -> tuple[Motion, ...]:
        """The robot as it stands."""
        from dynx.viewer.motion import motion_of_robot

        return (motion_of_robot(self.model, self.q),)

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
        with gui.add_folder("show"):
            visual = gui.add_checkbox("visual shapes", initial_value=not collisions)
            colliding = gui.add_checkbox("collision shapes", initial_value=collisions)
            for kind in Marks.kinds:
                box = gui.add_checkbox(kind, initial_value=False)
                box.on_update(lambda _, kind=kind, box=box: self._mark(kind, box))
            torques = gui.add_checkbox("gravity torques", initial_value=False)
            ellipsoid = gui.add_checkbox("manipulability", initial_value=False)

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
