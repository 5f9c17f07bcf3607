"""A world of exact mechanics for a few simple scenes, as an engine that the cases are run in.

Bodies are plates that lie on a plane, and balls, cylinders and hoops that roll on it or fly. Between events
(a touch, the end of a slide) accelerations are constant, so that the motion is exact at any step: flight,
Newton's law of restitution, Coulomb's law for forces and impulses. Nothing here comes from the cases.
Settings plant the faults that a case has to notice.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from dynx.model.geometry import Box, Cylinder, Plane, Sphere
from dynx.spatial.scalar import Floats
from dynx.spatial.so3 import quat_exp, rotation_from_quat
from dynx.steppers.forces import NO_FORCES, Forces
from dynx.steppers.layout import Collider, Layout
from dynx.steppers.settings import Setting
from dynx.steppers.state import BodyState, RobotState
from dynx.steppers.stepper import Feature, Stepper, TouchingPoint

TINY = 1e-9
"""Distance [m], speed [m/s] and time [s] that count as zero."""


@dataclass
class Solid:
    """A body that moves: its distance from the plane at a touch, its material and its state."""

    name: str
    mass: float
    inertia: Floats
    height: float
    rolls: bool
    friction: float
    restitution: float
    R: Floats
    p: Floats
    v: Floats
    w: Floats
    acceleration: Floats
    spin_up: Floats
    pressed: float = 0.0
    """Normal force of the plane [N]."""

    def tensor_inverse(self) -> Floats:
        """Return the inverse of the inertia in world axes."""
        inverse: Floats = np.linalg.inv(self.R @ self.inertia @ self.R.T)
        return inverse


class ExactWorld(Stepper):
    """Exact motion of plates and round bodies, unless a setting falsifies it."""

    name: ClassVar[str] = "exact"
    settings: ClassVar[Mapping[str, Setting]] = {
        "friction_factor": Setting(1.0, "factor of every coefficient of friction"),
        "restitution_factor": Setting(1.0, "factor of every restitution"),
        "inertia_factor": Setting(1.0, "factor of every moment of inertia", 1e-3),
        "weight_factor": Setting(1.0, "factor of the normal forces that are reported"),
        "depth": Setting(0.0, "depth to which bodies sink into the plane [m]"),
        "creep": Setting(0.0, "speed [m/s] of bodies that stick"),
        "leak": Setting(0.0, "share of the momentum that a collision of two balls loses", most=1.0),
        "pyramid": Setting(False, "whether friction is limited along each axis of the plane by itself"),
    }

    @classmethod
    def provides(cls, layout: Layout) -> frozenset[Feature]:
        return frozenset(Feature)

    def __init__(self, layout: Layout, dt: float, settings: Mapping[str, Any]) -> None:
        super().__init__(layout, dt, settings)
        self._settings = settings
        self._solids: dict[int, Solid] = {}
        self._normal: Floats = np.array([0.0, 0.0, 1.0])
        self._offset = -np.inf
        self._ground = -1
        self._ground_friction = self._ground_restitution = 0.0
        for number, collider in enumerate(layout.colliders):
            if isinstance(collider.shapes[0].shape, Plane):
                self._set_ground(number, collider)
        for collider in layout.colliders:
            if not isinstance(collider.shapes[0].shape, Plane):
                self._add(collider)

    def _set_ground(self, number: int, collider: Collider) -> None:
        T = self.layout.bodies[collider.owner.body].T
        self._normal, self._ground = T[:3, 2], number
        self._offset = float(self._normal @ T[:3, 3]) - self._settings["depth"]
        self._ground_friction = collider.material.friction
        self._ground_restitution = collider.material.restitution

    def _add(self, collider: Collider) -> None:
        body, shape = self.layout.bodies[collider.owner.body], collider.shapes[0].shape
        R = body.T[:3, :3] @ collider.shapes[0].T[:3, :3]
        upright = abs(float(R[:, 2] @ self._normal)) > 0.5
        assert isinstance(shape, Box | Sphere | Cylinder)
        if isinstance(shape, Box):
            height, rolls = 0.5 * shape.size[2], False
        elif isinstance(shape, Cylinder) and upright:
            height, rolls = 0.5 * shape.length, False
        else:
            height, rolls = shape.radius, True
        self._solids[collider.owner.body] = Solid(
            body.name,
            body.mass,
            body.inertia * self._settings["inertia_factor"],
            height,
            rolls,
            collider.material.friction,
            collider.material.restitution,
            body.T[:3, :3].copy(),
            body.T[:3, 3].copy(),
            body.twist[:3].copy(),
            body.twist[3:].copy(),
            np.zeros(3),
            np.zeros(3),
        )

    # -- motion -------------------------------------------------------------------------------

    def step(self, n: int, forces: Forces = NO_FORCES) -> None:
        assert forces.wrenches is None
        for _ in range(n):
            left = self.dt
            while left > TINY:
                self._collide()
                ends = [self._set_accelerations(solid) for solid in self._solids.values()]
                h = min(left, *ends, *self._meetings())
                for solid in self._solids.values():
                    _advance(solid, h)
                left -= h
            self._collide()

    def _collide(self) -> None:
        """Apply the impulses of all touches."""
        solids = list(self._solids.values())
        for k, one in enumerate(solids):
            self._hit_ground(one)
            for other in solids[:k]:
                self._hit(one, other)

    def _hit_ground(self, solid: Solid) -> None:
        approach = -float(self._normal @ solid.v)
        if self._gap(solid) > TINY or approach <= 0.0:
            return
        e = self._restitution(solid.restitution, self._ground_restitution)
        # A ball that bounces at less than this rests.
        e = e if approach > 1e-4 else 0.0
        normal = (1.0 + e) * approach * solid.mass
        slip = self._slip(solid)
        if approach > 1e-4 and np.linalg.norm(slip) > TINY:
            along = slip / np.linalg.norm(slip)
            arm = -solid.height * self._normal
            turned = solid.tensor_inverse() @ np.cross(arm, along)
            gained = along / solid.mass + (np.cross(turned, arm) if solid.rolls else 0.0)
            stop = float(np.linalg.norm(slip)) / float(gained @ along)
            impulse = -min(self._friction(solid) * normal, stop) * along
            solid.v = solid.v + impulse / solid.mass
            if solid.rolls:
                solid.w = solid.w + solid.tensor_inverse() @ np.cross(arm, impulse)
        solid.v = solid.v + normal / solid.mass * self._normal

    def _hit(self, one: Solid, other: Solid) -> None:
        apart = one.p - other.p
        distance = float(np.linalg.norm(apart))
        along = apart / distance
        approach = -float(along @ (one.v - other.v))
        if not (one.rolls and other.rolls) or distance > one.height + other.height + TINY or approach <= TINY:
            return
        e = self._restitution(one.restitution, other.restitution)
        impulse = (1.0 + e) * approach / (1.0 / one.mass + 1.0 / other.mass)
        one.v = one.v + (1.0 - self._settings["leak"]) * impulse / one.mass * along
        other.v = other.v - impulse / other.mass * along

    def _set_accelerations(self, solid: Solid) -> float:
        """Set the accelerations of a body and return the time for which they are constant."""
        g, n = self.layout.gravity, self._normal
        solid.acceleration, solid.spin_up, solid.pressed = g, np.zeros(3), 0.0
        falling, gap = float(n @ g), self._gap(solid)
        if gap > TINY or float(n @ solid.v) > TINY or falling >= 0.0:
            return _touch_time(gap, float(n @ solid.v), falling)
        solid.pressed = -solid.mass * falling
        along, most = g - falling * n, -self._friction(solid) * falling
        arm = -solid.height * n
        slip = self._slip(solid)
        size = float(np.linalg.norm(slip))
        if size <= 2.0 * TINY:
            # Friction that keeps the point of contact at rest, if it suffices.
            pull = float(np.linalg.norm(along))
            lever = solid.tensor_inverse() @ np.cross(arm, along / pull) if pull > TINY else np.zeros(3)
            share = solid.mass * float(np.cross(lever, arm) @ along) / max(pull, TINY) if solid.rolls else 0.0
            needed = pull / (1.0 + share)
            if needed <= most:
                solid.acceleration = along * (share / (1.0 + share))
                solid.spin_up = solid.tensor_inverse() @ np.cross(arm, -along / (1.0 + share)) * solid.mass
                if not solid.rolls:
                    solid.spin_up = np.zeros(3)
                    solid.v = self._settings["creep"] * along / max(pull, TINY)
                return float(np.inf)
            slip, size = along, pull
        friction = -most * self._braked(slip)
        solid.acceleration = along + friction
        gained = solid.acceleration
        if solid.rolls:
            solid.spin_up = solid.tensor_inverse() @ np.cross(arm, solid.mass * friction)
            gained = gained + np.cross(solid.spin_up, arm)
        rate = float(gained @ self._slip(solid)) / size
        return size / -rate if rate < -TINY else float(np.inf)

    def _braked(self, slip: Floats) -> Floats:
        """Return the direction of friction, of length 1 on a cone."""
        if self._settings["pyramid"]:
            signs: Floats = np.sign(np.where(abs(slip) > TINY, slip, 0.0))
            return signs
        unit: Floats = slip / np.linalg.norm(slip)
        return unit

    def _slip(self, solid: Solid) -> Floats:
        """Return the velocity (3,) of the point of contact along the plane."""
        v = solid.v + (np.cross(solid.w, -solid.height * self._normal) if solid.rolls else 0.0)
        slip: Floats = v - float(v @ self._normal) * self._normal
        return slip

    def _gap(self, solid: Solid) -> float:
        return float(self._normal @ solid.p) - self._offset - solid.height

    def _friction(self, solid: Solid) -> float:
        return float(self._settings["friction_factor"] * np.sqrt(solid.friction * self._ground_friction))

    def _restitution(self, one: float, other: float) -> float:
        return min(1.0, float(self._settings["restitution_factor"] * np.sqrt(one * other)))

    def _meetings(self) -> list[float]:
        """Return the times until balls that fly meet; their accelerations are the same."""
        balls = [solid for solid in self._solids.values() if solid.rolls and solid.pressed == 0.0]
        times = [np.inf]
        for k, one in enumerate(balls):
            for other in balls[:k]:
                p, v = one.p - other.p, one.v - other.v
                a, b = float(v @ v), float(p @ v)
                c = float(p @ p) - (one.height + other.height) ** 2
                if b < -TINY and b * b > a * c and c > TINY:
                    times.append(max(c / (-b + np.sqrt(b * b - a * c)), TINY))
        return times

    # -- state --------------------------------------------------------------------------------

    def body_state(self, body: int) -> BodyState:
        if body not in self._solids:
            return BodyState(self.layout.bodies[body].T.copy(), np.zeros(6))
        solid = self._solids[body]
        T = np.eye(4)
        T[:3, :3], T[:3, 3] = solid.R, solid.p
        return BodyState(T, np.concatenate([solid.v, solid.w]))

    def contacts(self) -> Sequence[TouchingPoint]:
        found = []
        for number, collider in enumerate(self.layout.colliders):
            solid = self._solids.get(collider.owner.body)
            if solid is not None and solid.pressed > 0.0:
                at = solid.p - solid.height * self._normal
                force = self._settings["weight_factor"] * solid.pressed
                points = number, self._ground, at, at, self._normal
                found.append(TouchingPoint(*points, self._gap(solid), force, np.zeros(3)))
        return found

    def dump(self) -> bytes:
        parts = [(s.R.ravel(), s.p, s.v, s.w, [s.pressed]) for s in self._solids.values()]
        return np.concatenate([np.concatenate(part) for part in parts]).tobytes()

    def load(self, data: bytes) -> None:
        for solid, row in zip(self._solids.values(), np.frombuffer(data).reshape(-1, 19), strict=True):
            R, solid.p, solid.v, solid.w, pressed = np.split(row, [9, 12, 15, 18])
            solid.R, solid.pressed = R.reshape(3, 3), float(pressed[0])

    def set_body_state(self, body: int, T: Floats, twist: Floats) -> None:
        solid = self._solids[body]
        solid.R, solid.p, solid.v, solid.w = T[:3, :3], T[:3, 3], twist[:3], twist[3:]

    def robot_state(self, robot: int) -> RobotState:
        raise NotImplementedError

    def set_robot_state(self, robot: int, q: Floats, v: Floats) -> None:
        raise NotImplementedError

    @property
    def version(self) -> str:
        return "exact 1"

    def close(self) -> None:
        """Release nothing."""


def _advance(solid: Solid, h: float) -> None:
    solid.p = solid.p + h * solid.v + 0.5 * h * h * solid.acceleration
    solid.v = solid.v + h * solid.acceleration
    # The axis of rotation is fixed, and the acceleration is about it.
    turned = rotation_from_quat(quat_exp(h * solid.w + 0.5 * h * h * solid.spin_up)) @ solid.R
    solid.w = solid.w + h * solid.spin_up
    solid.R = turned


def _touch_time(gap: float, speed: float, acceleration: float) -> float:
    """Return the time until a gap closes."""
    if abs(acceleration) < TINY:
        return gap / -speed if speed < -TINY else float(np.inf)
    root = speed * speed - 2.0 * acceleration * gap
    if root < 0.0:
        return float(np.inf)
    time = (-speed - float(np.sqrt(root))) / acceleration
    return max(time, TINY) if time > 0.0 else float(np.inf)
