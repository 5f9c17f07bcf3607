"""Land on the moon: the task of Gymnasium's ``LunarLander-v3``, in a world.

The scene is `craft`, the engines are `thrust`. The random numbers of an episode are drawn in Gymnasium's
order, so that a seed gives the same ground, initial push, dispersion of the engines and wind.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from dynx.envs.library import Space, spaces
from dynx.envs.task import Episode, WorldTask, camera_at
from dynx.envs.tasks.lunar_lander.craft import (
    BODY,
    CENTER,
    EDGES,
    HEIGHT,
    HOLD_TORQUE,
    LANDER,
    LEG_DOWN,
    LEG_LIMITS,
    LEG_MOTOR,
    LEG_MOTORS,
    LEGS,
    NO_FORCE,
    SCALE,
    WIDTH,
    added,
    clearance,
    force_at_center,
    ground_heights,
    gust,
    lander_scene,
    main_thrust,
    side_thrust,
    velocity_after_push,
)
from dynx.errors import ArgumentError, shown
from dynx.model.numbers import MAX_MAGNITUDE, is_real
from dynx.world import Scene

if TYPE_CHECKING:
    from dynx.steppers.camera import Camera

FPS = 50
"""Control steps a second."""
PUSH = 1000.0
"""Largest force [N] along x and z in the first step."""
SLEEP_SPEED, SLEEP_RATE, SLEEP_TIME = 0.01, math.radians(2.0), 0.5
"""Speed [m/s] and rates [rad/s] below which the lander is at rest, and the time [s] after which it sleeps,
those of Box2D."""
SLEEP_STEPS = round(SLEEP_TIME * FPS)
PARTS = {f"{LANDER}/{BODY}": "body", **{f"{LANDER}/{leg}_leg": leg for leg in LEGS}}
LEG_SET = frozenset(LEGS)
NOTHING = frozenset[str]()
FREE_HEIGHT, CONTACT_HEIGHT = 0.4, 0.05
"""Clearances [m] beyond which the legs need no motors, and beyond which there are no contacts."""
VIEW_DISTANCE = 30.0
VIEW_ANGLE = 2.0 * math.atan(HEIGHT / (2.0 * VIEW_DISTANCE))
"""Distance [m] of the camera, and its field of view [rad], in which the picture is as high as Gymnasium's."""
SPREAD_TOLERANCE = 0.01
"""Angle [rad] from its limit up to which a leg counts as spread."""


@dataclass(frozen=True)
class LunarLander(WorldTask):
    """Land between the flags by a main engine and two side engines.

    Actions: 0 nothing, 1 the left engine, 2 the main engine, 3 the right engine; if `continuous`, two numbers
    from -1 to 1: the main engine (above 0, from half to full power) and the side engines (beyond -0.5 and
    0.5). Observation (8,): x and z from the pad, their velocities, the angle, its rate, and 1 for each leg
    that touches the ground, in the units of Gymnasium. Reward: progress of a potential of distance, speed and
    angle, 10 for each leg that touches, less 0.3 for a step of the main engine and 0.03 of a side engine; in
    the last step 100 for a lander at rest, -100 for one whose body touched the ground or that left the
    picture.
    """

    continuous: bool = False
    gravity: float = -10.0
    """Gravity along z [m/s^2], between -12 and 0."""
    enable_wind: bool = False
    wind_power: float = 15.0
    """Largest force of the wind [N]."""
    turbulence_power: float = 1.5
    """Largest moment of the wind [N m]."""

    control_dt = 1.0 / FPS
    max_episode_steps = 1000
    reward_threshold = 200.0

    def __post_init__(self) -> None:
        for name in ("continuous", "enable_wind"):
            if not isinstance(getattr(self, name), bool):
                raise ArgumentError(f"{name} is {shown(getattr(self, name))}; wanted a bool")
        if not is_real(self.gravity) or not -12.0 < self.gravity < 0.0:
            raise ArgumentError(
                f"gravity is {shown(self.gravity)}; wanted a number between -12 and 0 [m/s^2]"
            )
        for name, unit in (("wind_power", "N"), ("turbulence_power", "N m")):
            power = getattr(self, name)
            if not is_real(power) or not 0.0 <= power < MAX_MAGNITUDE:
                raise ArgumentError(f"{name} is {shown(power)}; wanted a number of at least 0 [{unit}]")

    @cached_property
    def observation_space(self) -> spaces.Box:
        """The bounds of Gymnasium, which episodes do not reach."""
        high = np.array([2.5, 2.5, 10.0, 10.0, 2.0 * math.pi, 10.0, 1.0, 1.0], dtype=np.float32)
        low = np.array([*(-high[:6]), 0.0, 0.0], dtype=np.float32)
        return spaces.Box(low, high, dtype=np.float32)

    @property
    def observation_names(self) -> tuple[str, ...]:
        """Names of the entries of the observation."""
        motion = ("x", "z", "velocity x", "velocity z", "angle", "rate")
        return (*motion, *(f"contact of the {leg} leg" for leg in LEGS))

    @cached_property
    def action_space(self) -> Space[Any]:
        """One of four, or two throttles."""
        if self.continuous:
            return spaces.Box(-1.0, 1.0, (2,), dtype=np.float32)
        return spaces.Discrete(4)

    def scene(self) -> Scene:
        """Return the lander above a flat ground."""
        return lander_scene(ground_heights(np.full(EDGES + 2, HEIGHT / 4)), self.gravity)

    def scene_of_episode(self, rng: np.random.Generator, memory: SimpleNamespace) -> Scene:
        """Return the lander above a random ground, after a random push."""
        memory.heights = ground_heights(rng.uniform(0.0, HEIGHT / 2, size=EDGES + 2))
        fx, fz = rng.uniform(-PUSH, PUSH, 2).tolist()
        return lander_scene(memory.heights, self.gravity, velocity_after_push(fx, fz, self.control_dt))

    def start(self, episode: Episode) -> None:
        """Take the first step, without engines."""
        memory, rng = episode.memory, episode.rng
        if self.enable_wind:
            memory.wind, memory.turbulence = int(rng.integers(-9999, 9999)), int(rng.integers(-9999, 9999))
        memory.touching = NOTHING
        memory.resting = 0
        memory.shaping = None
        self._measure(memory, episode.world.state.robots[LANDER].q.tolist())
        idle = np.zeros(2, dtype=np.float32) if self.continuous else 0
        episode.world.step(**self.loads(episode, idle))
        self.settle(episode, idle)

    def loads(self, episode: Episode, action: Any) -> Mapping[str, Any]:
        """Return the generalised force of engines and wind, and the motor of the legs."""
        memory = episode.memory
        angle = memory.angle
        force = NO_FORCE
        # Gymnasium's uniform(-1, 1), one after the other.
        first, second = episode.rng.random(2).tolist()
        dispersion = ((2.0 * first - 1.0) / SCALE, (2.0 * second - 1.0) / SCALE)
        memory.power = main, side = self.powers(action)
        if main:
            force = main_thrust(angle, main, dispersion, self.control_dt)
        if side:
            force = added(force, side_thrust(angle, side, dispersion, self.control_dt))
        if self.enable_wind and not memory.touching & LEG_SET:
            wind = force_at_center(angle, gust(memory.wind, self.wind_power), 0.0)
            force = added(force, wind, (0.0, 0.0, gust(memory.turbulence, self.turbulence_power)))
            memory.wind += 1
            memory.turbulence += 1
        if memory.clearance > FREE_HEIGHT and memory.spread:
            return {"torques": {LANDER: np.array((*force, -HOLD_TORQUE, HOLD_TORQUE))}}
        motor = LEG_MOTORS.get(episode.world.engine, LEG_MOTOR)
        return {"torques": {LANDER: np.array((*force, 0.0, 0.0))}, "motors": {LANDER: motor}}

    def _measure(self, memory: SimpleNamespace, q: list[float]) -> None:
        """Note the angle, how far the ground is, and whether the legs are spread."""
        memory.angle = q[2]
        memory.clearance = clearance(memory.heights, q, FREE_HEIGHT)
        memory.spread = max(abs(q[3]), abs(q[4])) < LEG_LIMITS[0] + SPREAD_TOLERANCE

    def powers(self, action: Any) -> tuple[float, float]:
        """Return the power of the main engine (0, or 0.5 to 1) and of the side engines (left is negative)."""
        if not self.continuous:
            return float(action == 2), float(action - 2 if action in (1, 3) else 0)
        main, side = (float(each) for each in action)
        return (0.5 * (main + 1.0) if main > 0.0 else 0.0), (side if abs(side) > 0.5 else 0.0)

    def settle(self, episode: Episode, action: Any) -> None:
        """Note what touches the ground, for how long the lander has been at rest, and the potential."""
        memory = episode.memory
        q, v = (numbers.tolist() for numbers in episode.world.state.robots[LANDER])
        self._measure(memory, q)
        memory.touching = touching_parts(episode) if memory.clearance < CONTACT_HEIGHT else NOTHING
        vx, vz = center_velocity(q, v)
        slow = math.hypot(vx, vz) < SLEEP_SPEED and max(map(abs, v[2:])) < SLEEP_RATE
        memory.resting = memory.resting + 1 if slow else 0
        memory.observation = state = [
            q[0] / (WIDTH / 2),
            (q[1] - LEG_DOWN) / (HEIGHT / 2),
            vx * (WIDTH / 2) / FPS,
            vz * (HEIGHT / 2) / FPS,
            q[2],
            20.0 * v[2] / FPS,
            *(1.0 if leg in memory.touching else 0.0 for leg in LEGS),
        ]
        before = memory.shaping
        memory.shaping = (
            -100.0 * math.hypot(state[0], state[1])
            - 100.0 * math.hypot(state[2], state[3])
            - 100.0 * abs(state[4])
            + 10.0 * (state[6] + state[7])
        )
        memory.progress = 0.0 if before is None else memory.shaping - before

    def observation(self, episode: Episode) -> NDArray[np.float32]:
        """Return position, velocity, angle, rate and the contacts of the legs."""
        return np.array(episode.memory.observation, dtype=np.float32)

    def reward(self, episode: Episode, action: Any) -> float:
        """Return progress less fuel, or 100 for a landing and -100 for a crash."""
        memory = episode.memory
        if memory.resting >= SLEEP_STEPS:
            return 100.0
        if self.crashed(episode):
            return -100.0
        main, side = memory.power
        return float(memory.progress - 0.30 * main - 0.03 * abs(side))

    def reward_terms(self, episode: Episode, action: Any) -> Mapping[str, float]:
        """Return the terms of progress and of both kinds of engines, or that of the end."""
        memory = episode.memory
        if self.terminated(episode):
            return {"landing or crash": self.reward(episode, action)}
        main, side = memory.power
        return {"progress": memory.progress, "main engine": -0.30 * main, "side engines": -0.03 * abs(side)}

    def crashed(self, episode: Episode) -> bool:
        """Check whether the body touches the ground, or the lander left the picture."""
        return "body" in episode.memory.touching or abs(episode.memory.observation[0]) >= 1.0

    def terminated(self, episode: Episode) -> bool:
        """Check whether the lander crashed or is at rest."""
        return episode.memory.resting >= SLEEP_STEPS or self.crashed(episode)

    @cached_property
    def camera(self) -> Camera:
        """A camera that sees what Gymnasium's picture shows."""
        middle = HEIGHT / 4
        return camera_at(
            (0.0, -30.0, middle), (0.0, 0.0, middle), field_of_view=2.0 * math.atan(HEIGHT / 60.0)
        )


def touching_parts(episode: Episode) -> frozenset[str]:
    """Return what of ``body``, ``left`` and ``right`` touches the ground."""
    return frozenset(PARTS[part] for part, _ in episode.world.touching_pairs())


def center_velocity(q: list[float], v: list[float]) -> tuple[float, float]:
    """Return the velocity of the centre of mass of the body [m/s]."""
    return v[0] - CENTER * v[2] * math.cos(q[2]), v[1] - CENTER * v[2] * math.sin(q[2])
