"""A world on the page, which steps while it is seen: play, pause, step, reset, drag and push."""

from __future__ import annotations

import dataclasses
import math
import threading
import time
from collections.abc import Callable, Coroutine, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from dynx.errors import ArgumentError, ClosedError, DynxError, nearest, shown
from dynx.model.numbers import checked_array
from dynx.rbd.kinematics import link_poses
from dynx.spatial.scalar import Floats
from dynx.viewer.drawn_robot import AS_DESCRIBED, THICKNESS, ContactArrows, DrawnScene, Look
from dynx.viewer.following import FollowingCamera
from dynx.viewer.framing import SHARE, box_around, has_ground, points_around
from dynx.viewer.marks import NamedParts, SceneMarks
from dynx.viewer.motion import MotionFrames, fixed_bodies, motion_of_state
from dynx.viewer.page import Page
from dynx.viewer.play_control import PlayControl
from dynx.world import ExternalForce, World
from dynx.world.camera import part_poses

_FREQUENCY = 2.0 * math.pi * 1.0
"""Angular frequency [rad/s] at which a free body of the part's mass would swing on the spring."""


class Pull(NamedTuple):
    """A part that the pointer drags: where it was taken, and where the pointer is (3,) [m], in the world."""

    part: str
    taken: Floats
    pointer: Floats


class Spring:
    """A critically damped spring between a point of a part and the pointer, or a handle that is shown."""

    def __init__(self, scene: Any, size: float) -> None:
        self._node = scene.add_transform_controls(
            "/spring", scale=size, disable_rotations=True, depth_test=False, visible=False
        )
        self.part: str | None = None
        """The part on the handle."""
        self._pull: Pull | None = None
        self._point = np.zeros(3)
        self._mass = 1.0
        self._before: tuple[float, Floats] | None = None
        """Time [s] of the step before, and the place (3,) [m] of the point that is held."""
        self._held: str | None = None

    @property
    def pulls(self) -> bool:
        """True while the spring acts."""
        return self.part is not None or self._pull is not None

    def hold(self, world: World, part: str | None) -> None:
        """Attach the handle to a part at its place, or remove it for None."""
        self.part = part
        self._node.visible = part is not None
        if part is not None:
            self._node.position = _pose(world, part)[:3, 3]

    def hold_by_pointer(self, visuals: Mapping[str, Sequence[Any]]) -> None:
        """Let the pointer drag parts by the nodes of their shapes."""

        def puller(part: str) -> Callable[[Any], Coroutine[Any, Any, None]]:
            # viser calls functions that are not async in any order.
            async def dragged(event: Any) -> None:
                taken, pointer = np.array(event.start_position), np.array(event.end_position)
                self.pull(None if event.phase == "end" else Pull(part, taken, pointer))

            return dragged

        for name, nodes in visuals.items():
            for node in nodes:
                node.on_drag(puller(name))

    def pull(self, pull: Pull | None) -> None:
        """Pull a part to the pointer from the next step on; None releases it."""
        self._pull = pull

    def forces(self, world: World) -> list[ExternalForce]:
        """Return the force of the spring for the next step of `world.dt`."""
        pull = self._pull
        part = self.part if pull is None else pull.part
        if part is None:
            self._held = None
            return []
        T = _pose(world, part)
        holder = f"{part} {pull is None}"
        if self._held != holder:
            self._held, self._before, self._mass = holder, None, _mass(world, part)
            self._point = np.zeros(3) if pull is None else T[:3, :3].T @ (pull.taken - T[:3, 3])
        place = T[:3, :3] @ self._point + T[:3, 3]
        velocity = self._velocity(world, place)
        goal = np.asarray(self._node.position if pull is None else pull.pointer, dtype=np.float64)
        force = self._mass * _FREQUENCY * (_FREQUENCY * (goal - place) - 2.0 * velocity)
        return [ExternalForce(part, np.concatenate([force, np.zeros(3)]), point=self._point)]

    def _velocity(self, world: World, place: Floats) -> Floats:
        """Return the velocity (3,) [m/s] of the point that is held, from its place in the step before; zero
        where the world is not one step later, as after a reset."""
        before, self._before = self._before, (world.time, place)
        if before is None or not math.isclose(world.time - before[0], world.dt, rel_tol=0.01):
            return np.zeros(3)
        return (place - before[1]) / world.dt


def _pose(world: World, part: str) -> Floats:
    robot, slash, link = part.partition("/")
    state = world.state
    if not slash:
        return np.asarray(state.bodies[part].T_world_body)
    return dict(link_poses(world.scene.robot(robot).model, state.robots[robot].q))[link]


def _mass(world: World, part: str) -> float:
    """Return the mass [kg] that the spring is made for: that of a body, or of the whole robot."""
    robot, slash, _ = part.partition("/")
    if slash:
        return world.scene.robot(robot).model.total_mass or 1.0
    return world.scene.body(part).mass or 1.0


UPDATES_PER_SECOND = 30.0
"""Rate at which the page is moved."""

STANDARD_WEIGHT = 9.81
"""Force [N] on a mass of 1 kg, for the scale of the arrows."""

WEIGHT_ARROW = 0.8
"""Length of the arrow of a force that carries all that moves, as a share of its size: four feet share it."""

_NO_PART = "none"

_NO_PART_CHOSEN = "choose the part that is pushed"

_LOADS = ("forces", "motors", "torques")

LoadsOf = Callable[[World], Mapping[str, Any]]


class WorldView(PlayControl):
    """A world and its controls.

    The page steps the world in a thread of its own, in real time where the machine can. A program that steps
    the world itself passes ``steps=False`` and calls `draw`.
    """

    def __init__(
        self,
        page: Page,
        world: World,
        *,
        loads: LoadsOf | None = None,
        look: Look = AS_DESCRIBED,
        play: bool = False,
        steps: bool = True,
        collisions: bool = False,
    ) -> None:
        """`loads(world)` returns the arguments of `World.step` that act in the next step; `collisions` are
        shown at once."""
        self._page, self.world, self._loads = page, world, loads
        self._ended = page.ended
        scene = world.scene
        self._look = look
        self.drawn = self._draw_scene()
        self.notes = (*world.notes, *self.drawn.faults)
        """Notes on the start, and shapes that cannot be drawn, one sentence each."""
        poses = dict(part_poses(scene, world.state))
        moving = [*(f"{r.name}/{link.name}" for r in scene.robots for link in r.model.links)]
        moving += [body.name for body in scene.bodies if not body.fixed]
        robots = {robot.name: robot.model for robot in scene.robots}
        seen = {name: poses[name][None] for name in moving or poses}
        low, high = box_around(seen, scene.bodies, robots)
        self._size = float(np.linalg.norm(high - low)) or 0.5
        mass = sum(r.model.total_mass for r in scene.robots) + sum(b.mass or 0.0 for b in scene.bodies)
        self._arrows = ContactArrows(
            page.scene, WEIGHT_ARROW * self._size / (STANDARD_WEIGHT * (mass or 1.0)), THICKNESS * self._size
        )
        self._spring = Spring(page.scene, 0.3 * self._size)
        self._pushes: list[ExternalForce] = []
        super().__init__()
        page.lay_ground(self._size, None if has_ground(scene.bodies) else 0.0)
        self._add_controls(moving, steps=steps, collisions_first=collisions)
        self.drawn.show(visuals=not collisions, collisions=collisions)
        self.camera = FollowingCamera(page, self.drawn)
        """The camera of the page."""
        self.names = NamedParts(page, self.drawn)
        """The names of the part under the pointer and of that which was clicked."""
        if steps:
            self._spring.hold_by_pointer({name: self.drawn.visuals[name] for name in moving})
        self.draw()
        page.look_at(points_around(seen, scene.bodies, robots), SHARE)
        page.at_end(self._running.set)
        if steps:
            self._thread = threading.Thread(target=self._run, name="dynx world", daemon=True)
            self._thread.start()
            if play:
                self.play()

    def _draw_scene(self) -> DrawnScene:
        scene = self.world.scene
        robots = {robot.name: robot.model for robot in scene.robots}
        with self._page.together():
            return DrawnScene(self._page.scene, "/world", robots, scene.bodies, self._look)

    def replace(self, world: World) -> bool:
        """Show another world with parts of the same names, on the same controls; return False where the names
        differ and nothing was done.

        Functions that the program calls on clicks are those of the parts before.
        """
        with self._page.lock, self._page.together():
            parts = {f"{r.name}/{link.name}" for r in world.scene.robots for link in r.model.links}
            if parts | {body.name for body in world.scene.bodies} != self.drawn.parts.keys():
                return False
            self.world = world
            self.names.remove()
            self.drawn.remove()
            self.drawn = self._draw_scene()
            colliding = self.switches["collision shapes"].value
            self.drawn.show(visuals=not colliding, collisions=colliding)
            self.camera.watch(self.drawn)
            self._marks.watch(self.drawn)
            self.names = NamedParts(self._page, self.drawn)
            self.draw()
            return True

    legend = ""
    """Empty: one world needs none."""

    @property
    def title(self) -> str:
        """Name of the scene."""
        return self.world.scene.name

    @property
    def visuals(self) -> Mapping[str, Sequence[Any]]:
        """The nodes of the shapes of each part."""
        return self.drawn.visuals

    shows_both = False
    """Collision shapes are shown instead of visual ones."""

    @property
    def motions(self) -> tuple[MotionFrames, ...]:
        """The world in its present state."""
        shown = motion_of_state(self.world.scene, self.world.state)
        return (dataclasses.replace(shown, robots=self.drawn.seen_models),)

    time = 0.0
    """Time of the only frame of `motions`."""

    duration: float | None = None
    """The motion of a world is not known before it has happened."""

    def go_to(self, time: float) -> None:
        """Show the present state."""
        self.draw()

    def draw(self) -> None:
        """Show the present state of the world."""
        with self._page.lock, self._page.together():
            state = self.world.state
            self.drawn.place(dict(part_poses(self.world.scene, state)))
            self._clock.value = f"{state.time:.3f} s"
            if self._arrows.shown or self._arrows.points_shown:
                found, fixed = self.world.contacts(), fixed_bodies(self.world.scene)
                self._arrows.put(
                    np.array([c.point for c in found]).reshape(-1, 3),
                    np.array([-c.force if c.a in fixed else c.force for c in found]).reshape(-1, 3),
                )

    def step(self, n: int = 1) -> None:
        """Take `n` steps under the loads, the spring and a push, and draw. Errors are shown in the page."""
        with self._page.lock:
            if self._ended.is_set():
                return
            try:
                if self._loads is None and not self._spring.pulls and not self._pushes:
                    self.world.step(n)
                    n = 0
                for _ in range(n):
                    given = {} if self._loads is None else dict(self._loads(self.world))
                    for name in sorted(given.keys() - set(_LOADS)):
                        raise ArgumentError(
                            f"loads returned {shown(name)}; wanted {', '.join(sorted(_LOADS))}"
                        )
                    pushes, self._pushes = self._pushes, []
                    forces = [*given.pop("forces", ()), *self._spring.forces(self.world), *pushes]
                    self.world.step(1, forces=forces, **given)
                # The state is read here, where a motion that diverged in these steps is found.
                self.draw()
            except ClosedError:
                self._end()
            # Loads are the user's own code, which may raise anything; the page is where the user looks.
            except Exception as error:
                self.pause()
                kind = "" if isinstance(error, DynxError) else f"{type(error).__name__}: "
                self._report(f"{kind}{error}")
                # After an error the world is at an earlier state.
                self.draw()

    def push(self, part: str, impulse: ArrayLike) -> None:
        """Push a part in the next step with an impulse (3,) [N s], along the axes of the world and at the
        origin of the part.

        Raises ArgumentError for an unknown part and for an impulse that is no three finite numbers.
        """
        if part not in self.drawn.parts:
            raise ArgumentError(f"no part {shown(part)}{nearest(part, self.drawn.parts)}")
        given = checked_array("impulse", impulse, 3)
        if given.ndim != 1:
            raise ArgumentError(f"impulse has shape {given.shape}; wanted (3,)")
        with self._page.lock:
            self._pushes.append(ExternalForce(part, np.concatenate([given / self.world.dt, np.zeros(3)])))

    def _report(self, message: str) -> None:
        """Show an error; an empty one is hidden."""
        self._message.value, self._message.visible = message, bool(message)

    def _end(self) -> None:
        self.pause()
        self._report("the world was closed")

    def reset(self) -> None:
        """Return to the start."""
        with self._page.lock:
            self.world.reset()
            self._pushes.clear()
            self._report("")
            self._spring.hold(self.world, self._held())
            self.draw()

    # -- controls -----------------------------------------------------------------------------

    def _add_controls(self, moving: list[str], *, steps: bool, collisions_first: bool) -> None:
        gui = self._page.gui
        with gui.add_folder("world"):
            # Versions of some engines begin with the name of the engine.
            version = self.world.version.removeprefix(self.world.engine).strip()
            gui.add_text("engine", f"{self.world.engine} {version}", disabled=True)
            self._clock = gui.add_text("time", "", disabled=True)
            self._rate = gui.add_text("speed reached", "", disabled=True, visible=steps)
            self.add_play_button(self._page, visible=steps)
            once = gui.add_button("one step", visible=steps)
            reset = gui.add_button("reset", visible=steps)
            self._factor = gui.add_slider("speed", 0.05, 2.0, step=0.05, initial_value=1.0, visible=steps)
            self._message = gui.add_text("error", "", multiline=True, disabled=True, visible=False)
        with gui.add_folder("show"):
            collisions = gui.add_checkbox("collision shapes", initial_value=collisions_first)
            forces = gui.add_checkbox("contact forces", initial_value=True)
            points = gui.add_checkbox("contact points", initial_value=False)
            numbers = gui.add_checkbox("force numbers", initial_value=False)
            self._marks = SceneMarks(self._page, self.drawn)
            marks = self._marks.add_switches()
        with gui.add_folder("pull and push", visible=steps):
            self._part = gui.add_dropdown("part", (_NO_PART, *moving), initial_value=_NO_PART)
            self._pull = gui.add_checkbox("pull by a spring", initial_value=False)
            impulse = gui.add_vector3("push [N s]", initial_value=(1.0, 0.0, 0.0), step=0.1)
            push = gui.add_button("push")
        once.on_click(lambda _: self._step_once())
        reset.on_click(lambda _: self.reset())

        def show(_: Any) -> None:
            with self._page.lock:
                self.drawn.show(visuals=not collisions.value, collisions=collisions.value)
                self._arrows.shown, self._arrows.points_shown = forces.value, points.value
                self._arrows.numbers_shown = numbers.value
                if not (forces.value or points.value):
                    self._arrows.put(np.zeros((0, 3)), np.zeros((0, 3)))
                self.draw()

        def hold(_: Any) -> None:
            with self._page.lock:
                self._spring.hold(self.world, self._held())
                if self._message.value == _NO_PART_CHOSEN:
                    self._report("")

        def pushed(_: Any) -> None:
            with self._page.lock:
                if self._part.value == _NO_PART:
                    self._report(_NO_PART_CHOSEN)
                    return
                self._report("")
                self.push(self._part.value, impulse.value)

        self.switches = {"collision shapes": collisions, "contact forces": forces, "contact points": points}
        self.switches["force numbers"] = numbers
        for box in self.switches.values():
            box.on_update(show)
        self.switches |= marks
        self._part.on_update(hold)
        self._pull.on_update(hold)
        push.on_click(pushed)

    def _step_once(self) -> None:
        self.pause()
        self.step()

    def _closed(self) -> bool:
        try:
            _ = self.world.state
        except ClosedError:
            return True
        except DynxError:
            pass
        return False

    def _held(self) -> str | None:
        return self._part.value if self._pull.value and self._part.value != _NO_PART else None

    def _run(self) -> None:
        period = 1.0 / UPDATES_PER_SECOND
        while not self._ended.is_set():
            self._running.wait()
            began, start = time.monotonic(), self.world.time
            factor = float(self._factor.value)
            while self._running.is_set() and not self._ended.is_set():
                if self._closed():
                    self._end()
                    break
                if factor != float(self._factor.value):  # The time so far was at the other speed.
                    factor = float(self._factor.value)
                    began, start = time.monotonic(), self.world.time
                behind = start + (time.monotonic() - began) * factor - self.world.time
                n = round(behind / self.world.dt)
                # Where the machine is too slow, the world falls behind instead of the page standing still.
                if n > 3.0 * period * factor / self.world.dt:
                    n = max(1, round(period * factor / self.world.dt))
                    began, start = time.monotonic(), self.world.time
                before, clock = self.world.time, time.monotonic()
                if n > 0:
                    self.step(n)
                if self._ended.wait(max(period - (time.monotonic() - clock), 0.001)):
                    return
                spent = time.monotonic() - clock
                if self._ended.is_set():
                    return
                self._rate.value = f"{(self.world.time - before) / spent:.2f}"
