"""Laws of contact that dynx's own engine keeps: ``python -m benchmarks.surveys.contact_laws``.

- *slides*: random boxes and cylinders slide on level ground until they rest. By Coulomb's law they
  stop after v^2 / (2 mu g) - v h / 2 in steps of h, do not tilt, and keep their heading.
- *rest*: cubes on slopes below the angle of friction, stacks of five, 1 kg under 1,000 kg and the reverse.
  Their forces sum to the weight, and they do not creep.
- *work*: random scenes with friction and restitution. In each step the work of the impulses of contacts and
  limits, x . (v- + v+) / 2, is at most zero, relative to the kinetic energy.

Prints the worst case of each, and exits with 1 if one exceeds its bar.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from dynx.engines.own import impulses
from dynx.model.elements import Pose
from dynx.model.geometry import Box, Collision, Cylinder, Shape
from dynx.rbd.constraints import ConstraintSets, Solution, rebound, solve
from dynx.spatial.scalar import Floats
from dynx.world import Material, Scene, SceneBody, World, box, cylinder, ground, sphere

ENGINE = "dynx"
G = 9.81

BARS = {
    "tilt [rad]": math.radians(1.0),
    "change of heading [rad]": 1e-3,
    "stopping distance, relative error": 1e-3,
    "sum of forces, relative to the weight": 1e-6,
    "creep [m/s]": 1e-9,
    "sinking [m]": 1e-6,
    "work, relative to the kinetic energy": 1e-12,
    "residual of a step [m/s]": 1e-6,
}
"""Largest values that pass."""


class Measured(NamedTuple):
    """A measured value, and the case in which it was found."""

    value: float
    name: str
    case: str


# -- slides -----------------------------------------------------------------------------------


def slider(rng: np.random.Generator) -> tuple[SceneBody, float, float, float]:
    """Return a random body on the ground with its friction, speed [m/s] and heading [rad].

    Friction is below half of the width over the height of the centre, so that no body tips.
    """
    width, depth, height = rng.uniform(0.1, 0.5), rng.uniform(0.1, 0.5), rng.uniform(0.05, 0.3)
    kind = rng.integers(2)
    shape: Shape = Box((width, depth, height))
    if kind == 1:
        shape, depth = Cylinder(0.5 * width, height), width
    most = 0.5 * min(width, depth) / (0.5 * height)
    friction = rng.uniform(0.1, 0.9) * min(most, 1.0)
    speed, heading = rng.uniform(0.5, 10.0), rng.uniform(-math.pi, math.pi)
    mass = rng.uniform(0.1, 10.0)
    moments = (depth**2 + height**2, width**2 + height**2, width**2 + depth**2)
    if kind == 1:
        across = (3.0 * (0.5 * width) ** 2 + height**2) / 12.0
        moments = 12.0 * across, 12.0 * across, 1.5 * width**2
    inertia = np.diag(mass / 12.0 * np.array(moments))
    body = SceneBody(
        "body",
        (Collision(shape),),
        Pose((0.0, 0.0, 0.5 * height), (0.0, 0.0, rng.uniform(-math.pi, math.pi))),
        mass,
        twist=(speed * math.cos(heading), speed * math.sin(heading), 0.0, 0.0, 0.0, 0.0),
        inertia=tuple(map(tuple, inertia.tolist())),
        material=Material(friction=friction),
    )
    return body, friction, speed, heading


def slides(count: int, rng: np.random.Generator) -> Iterator[Measured]:
    """Yield the errors of random slides."""
    for k in range(count):
        body, friction, speed, heading = slider(rng)
        h = float(rng.uniform(0.5e-3, 5e-3))
        kind = type(body.shapes[0].shape).__name__
        case = f"slide {k}: {kind}, mu {friction:.2g}, {speed:.2g} m/s, h {h:.2g} s"
        scene = Scene("slide", bodies=(ground(material=body.material), body))
        begin = body.pose.matrix[:3, :3]
        with World(scene, ENGINE, h) as world:
            world.run(speed / (friction * G) + 3.0 * h)
            T, _ = world.state.bodies["body"]
        turned = begin.T @ T[:3, :3]
        yield Measured(math.acos(min(1.0, T[2, 2])), "tilt [rad]", case)
        yaw = abs(math.atan2(turned[1, 0], turned[0, 0]))
        drift = abs(math.remainder(math.atan2(T[1, 3], T[0, 3]) - heading, 2.0 * math.pi))
        yield Measured(max(yaw, drift), "change of heading [rad]", case)
        wanted = speed**2 / (2.0 * friction * G) - 0.5 * speed * h
        error = abs(math.hypot(T[0, 3], T[1, 3]) - wanted) / wanted
        yield Measured(error, "stopping distance, relative error", case)


# -- rest -------------------------------------------------------------------------------------


def cubes(masses: Sequence[float], material: Material) -> tuple[SceneBody, ...]:
    """Return cubes of 0.2 m on one another, and the ground."""
    return (
        ground(material=material),
        *(
            box(f"cube {k}", (0.2, 0.2, 0.2), mass=mass, pose=Pose((0, 0, 0.1 + 0.2 * k)), material=material)
            for k, mass in enumerate(masses)
        ),
    )


def resting(share: float) -> Iterator[tuple[str, Scene, float]]:
    """Yield name, scene and duration [s] of bodies that stay at rest; `share` of the full durations."""
    material = Material(friction=0.5)
    for part in (0.5, 0.9, 0.99):
        angle = math.atan(0.5 * part)
        gravity = (G * math.sin(angle), 0.0, -G * math.cos(angle))
        yield (
            f"slope of {part:g} mu",
            Scene("s", bodies=cubes([2.0], material), gravity=gravity),
            15.0 * share,
        )
    for masses in ([1.0] * 5, [1.0, 1000.0], [1000.0, 1.0]):
        yield f"stack of {masses} kg", Scene("s", bodies=cubes(masses, material)), 60.0 * share


def rests(share: float, h: float) -> Iterator[Measured]:
    """Yield the errors of bodies at rest in steps of `h` [s]."""
    for case, scene, duration in resting(share) if share > 0.0 else ():
        with World(scene, ENGINE, h) as world:
            world.run(duration)
            state, force = world.state, sum(c.force for c in world.contacts("ground"))
        weight = sum(body.mass or 0.0 for body in scene.bodies) * np.array(scene.gravity)
        off = float(np.linalg.norm(force - weight) / np.linalg.norm(weight))
        yield Measured(off, "sum of forces, relative to the weight", case)
        moving = [body for body in scene.bodies if not body.fixed]
        creep = max(float(np.abs(state.bodies[body.name].twist).max()) for body in moving)
        yield Measured(creep, "creep [m/s]", case)
        sunk = max(
            float(np.abs(state.bodies[body.name].T_world_body[:3, 3] - body.pose.matrix[:3, 3]).max())
            for body in moving
        )
        yield Measured(sunk, "sinking [m]", case)


# -- work -------------------------------------------------------------------------------------


class WorkOfImpulses:
    """Replaces the solver of the stepper, and measures the work of the impulses that it returns."""

    def __init__(self) -> None:
        self.steps = 0
        self.work = self.residual = 0.0

    def __enter__(self) -> WorkOfImpulses:
        setattr(impulses, "solve", self.solve)  # noqa: B010
        setattr(impulses, "rebound", self.rebound)  # noqa: B010
        return self

    def __exit__(self, *_: object) -> None:
        setattr(impulses, "solve", solve)  # noqa: B010
        setattr(impulses, "rebound", rebound)  # noqa: B010

    def solve(self, sets: ConstraintSets, G: Floats, c: Floats, limits: Floats, **given: Any) -> Solution:
        """Solve, and measure."""
        return self._measured(G, c, solve(sets, G, c, limits, **given))

    def rebound(
        self,
        sets: ConstraintSets,
        G: Floats,
        c: Floats,
        limits: Floats,
        plastic: Solution,
        restitution: Floats,
    ) -> Solution:
        """Solve an impact, and measure."""
        return self._measured(G, c, rebound(sets, G, c, limits, plastic, restitution))

    def _measured(self, G: Floats, c: Floats, found: Solution) -> Solution:
        # With the gaps in c, x . (c + w) / 2 leaves out what closing a gap returns. The kinetic energy that
        # contacts can reach is c' G^-1 c / 2, at least that of the impulses.
        work = float(found.impulses @ (c + found.velocities)) / 2.0
        energy = float(found.impulses @ G @ found.impulses) / 2.0 + 1e-12
        self.work = max(self.work, work / energy)
        self.residual = max(self.residual, float(found.residuals.largest))
        self.steps += 1
        return found


def collision(rng: np.random.Generator) -> Scene:
    """Return a random scene of bodies that meet on the ground, with friction and restitution."""
    bodies = []
    for k in range(int(rng.integers(1, 5))):
        material = Material(
            friction=rng.uniform(0.0, 1.2),
            torsional_friction=rng.choice([0.0, 0.01]),
            rolling_friction=rng.choice([0.0, 0.005]),
            restitution=rng.choice([0.0, rng.random()]),
        )
        pose = Pose((0.15 * k, rng.uniform(-0.1, 0.1), rng.uniform(0.1, 0.3)), tuple(rng.uniform(-3, 3, 3)))
        twist = (*rng.uniform(-3.0, 3.0, 3).tolist(), *rng.uniform(-10.0, 10.0, 3).tolist())
        mass = 10.0 ** rng.uniform(-1.0, 1.0)
        made = (
            box(f"b{k}", tuple(rng.uniform(0.05, 0.2, 3)), mass=mass, pose=pose),
            sphere(f"b{k}", rng.uniform(0.03, 0.1), mass=mass, pose=pose),
            cylinder(f"b{k}", rng.uniform(0.03, 0.1), rng.uniform(0.05, 0.2), mass=mass, pose=pose),
        )[int(rng.integers(3))]
        bodies.append(replace(made, material=material, twist=twist))
    return Scene("collision", bodies=(ground(material=Material(0.8, 0.01, 0.005, 0.5)), *bodies))


def works(count: int, rng: np.random.Generator) -> Iterator[Measured]:
    """Yield the work of impulses in some steps of random scenes."""
    for k in range(count):
        with WorkOfImpulses() as measured, World(collision(rng), ENGINE, 2e-3) as world:
            world.step(40)
        yield Measured(measured.work, "work, relative to the kinetic energy", f"collision {k}")
        yield Measured(measured.residual, "residual of a step [m/s]", f"collision {k}")


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, print the worst of each law, and return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--slides", type=int, default=1000, help="number of bodies that slide")
    parser.add_argument("--scenes", type=int, default=10_000, help="number of random scenes with impacts")
    parser.add_argument("--rest", type=float, default=1.0, help="share of 15 s on slopes and 60 s of stacks")
    parser.add_argument("--step", type=float, default=1e-3, help="step of bodies at rest [s]")
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args(arguments)
    rng = np.random.default_rng(given.seed)
    worst: dict[str, Measured] = {}
    over: dict[str, int] = {}
    count: dict[str, int] = {}
    for each in (*slides(given.slides, rng), *rests(given.rest, given.step), *works(given.scenes, rng)):
        worst[each.name] = max(worst.get(each.name, each), each)
        count[each.name] = count.get(each.name, 0) + 1
        over[each.name] = over.get(each.name, 0) + (not each.value <= BARS[each.name])
    for name, found in worst.items():
        beyond = f", {over[name]} above {BARS[name]:.2g}" if over[name] else ""
        print(f"{name:40s} {found.value:9.2e} of {count[name]} cases{beyond} ({found.case})")
    return int(any(over.values()))


if __name__ == "__main__":
    sys.exit(main())
