"""A spring to a part of a world: from a handle in the page, or from the pointer that drags the part."""

from __future__ import annotations

import math
from collections.abc import Callable, Coroutine, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from dynx.rbd.link_poses import link_poses
from dynx.spatial.scalar import Floats
from dynx.world import ExternalForce, World

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
