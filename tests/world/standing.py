"""Quadrupeds that stand under PD motors: ``python -m tests.world.standing`` prints how, after 10 s.

The forces of their feet, how much these vary in 20 ms, and the height of their base.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

import dynx
from dynx import Model
from dynx.spatial.scalar import Floats
from dynx.world import PDMotor, Scene, SceneRobot, World, ground

_STANCE = (0.0, 0.8, -1.6) * 4


class Stand(NamedTuple):
    """Joint positions of a stance [rad], and the gains that hold it, for which its swings die away."""

    joints: tuple[float, ...]
    kp: float
    kd: float


STANDS = {
    "a1": Stand(_STANCE, 100.0, 2.0),
    "laikago": Stand(_STANCE, 200.0, 5.0),
    "solo12": Stand(_STANCE, 10.0, 0.2),
    "anymal_c": Stand((0.0, 0.7, -1.0) * 2 + (0.0, -0.7, 1.0) * 2, 300.0, 10.0),
}


SWINGING = (150.0, 1.0)
"""kp and kd under which ANYmal C swings for seconds."""


class Standing(NamedTuple):
    """Forces of the feet in multiples of the weight, heights of the base [m], and the parts that touch."""

    forces: Floats
    heights: Floats
    touching: frozenset[str]
    speed: float
    """Largest velocity of a coordinate at the end [m/s or rad/s]."""


def quadruped(name: str) -> tuple[Model, Floats]:
    """Return a quadruped, and a configuration in which it stands with its feet on the plane z = 0."""
    model = dynx.load(name, base="floating")
    q = np.zeros(model.nq)
    q[6], q[7:] = 1.0, STANDS[name].joints
    with World(Scene("s", robots=(SceneRobot("dog", model, q=tuple(q)),))) as world:
        q[2] = -world.aabb("dog")[0][2]
    return model, q


def measure(
    name: str, engine: str, duration: float, steps: int, gains: tuple[float, float] | None = None
) -> Standing:
    """Return how a quadruped stands in each of `steps` steps after `duration` [s], under its gains or others
    (kp, kd)."""
    model, q = quadruped(name)
    scene = Scene("standing", robots=(SceneRobot("dog", model, q=tuple(q)),), bodies=(ground(),))
    kp, kd = STANDS[name][1:] if gains is None else gains
    motor = PDMotor(q[7:], kp, kd)
    weight = model.total_mass * 9.81
    forces, heights = [], []
    with World(scene, engine) as world:
        world.run(duration, motors={"dog": motor})
        for _ in range(steps):
            world.step(motors={"dog": motor})
            forces.append(sum(c.force[2] for c in world.contacts()) / weight)
            heights.append(world.state.robots["dog"].q[2])
        touching = frozenset(c.a for c in world.contacts())
        speed = float(np.abs(world.state.robots["dog"].v).max())
    return Standing(np.array(forces), np.array(heights), touching, speed)


def main() -> None:
    """Print a row for each robot and engine."""
    print(f"{'robot':10}{'kp':>6}{'kd':>6}{'s':>6} {'engine':10}{'force / weight':>18}{'height [m]':>12}")
    cases = [(name, stand.kp, stand.kd, 10.0) for name, stand in STANDS.items()]
    for name, kp, kd, end in [*cases, *(("anymal_c", *SWINGING, end) for end in (1.5, 10.0))]:
        for engine in ("pybullet", "mujoco"):
            found = measure(name, engine, end - 0.02, 20, (kp, kd))
            force = f"{found.forces.mean():.4f} +- {np.ptp(found.forces) / 2:.4f}"
            row = f"{name:10}{kp:6g}{kd:6g}{end:6g} {engine:10}{force:>18}{found.heights.mean():12.4f}"
            print(row, flush=True)


if __name__ == "__main__":
    main()
