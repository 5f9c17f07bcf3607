"""Laws of contact that dynx's own engine keeps: ``python -m benchmarks.surveys.contact_laws``.

- *slides*: random boxes, cylinders and convex hulls slide on level ground until they rest. By Coulomb's law
  they stop after v^2 / (2 mu g) - v h / 2 in steps of h, do not tilt, and keep their heading. With n whole
  steps and a part f of one until rest, the sum over the steps is mu g h^2 f (1 - f) / 2 more than that.
- *rest*: cubes on slopes below the angle of friction, stacks of five, 1 kg under 1,000 kg and the reverse.
  Their forces sum to the weight, and they do not creep.
- *work*: random scenes with friction and restitution. In each step the work of the impulses of contacts and
  limits, x . (v- + v+) / 2, is at most zero, relative to the kinetic energy. The energy grows by no more than
  the integrator adds to each body without contacts, but where a step takes back an overlap.

Prints the largest error of each law, and exits with 1 if one exceeds its bar. Each case has random numbers
of its own, by the seed and its number. With ``--record FILE`` each case that is done stands in the file: an
interrupted survey continues there, and after Ctrl-C it prints what it has.
"""

from __future__ import annotations

import argparse
import math
import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from benchmarks.progress import Record, tell
from dynx.engines.own import impulses
from dynx.engines.own.impulses import Island, WarmStart
from dynx.engines.own.parts import OwnBody
from dynx.model.elements import Pose
from dynx.model.geometry import Box, Cylinder, Mesh, Shape, solid_properties
from dynx.model.geometry.hulls import convex_hull
from dynx.rbd.constraints import NEGLIGIBLE, ConstraintSets, Solution, rebound, solve
from dynx.spatial.scalar import Floats
from dynx.world import Material, Scene, SceneBody, World, box, cylinder, ground, sphere

ENGINE = "dynx"
G = 9.81

MOST_OF_TIPPING = 0.97
"""Largest friction of a body that slides, relative to the one at which it tips, and to 1."""

BETWEEN_REPORTS = 1.0
"""Simulated time [s] between two lines of progress of a case."""

SLIDE, SCENE = 1, 2
"""Numbers in the seeds of slides and random scenes."""

IMPACT_STEP = 2e-3
"""Step of scenes with impacts [s]."""

BARS = {
    "tilt [rad]": math.radians(1.0),
    "change of heading [rad]": 1e-3,
    "stopping distance, relative error": 1e-3,
    "stopping distance in steps, relative error": 1e-3,
    "sum of forces, relative to the weight": 1e-6,
    "creep [m/s]": 1e-9,
    "sinking [m]": 1e-6,
    "work, relative to the kinetic energy": 1e-12,
    "growth of energy, relative to the kinetic energy": 1e-12,
    "residual of a step [m/s]": 1e-6,
}
"""Largest values that pass."""


Errors = dict[str, float]
"""Largest value of each error of a case, by its name in `BARS`."""


class Case(NamedTuple):
    """A case of the survey, before it is measured."""

    name: str
    """Name that no case with other numbers has."""
    measure: Callable[[], tuple[str, Errors]]
    """Returns what the case is, and its errors."""

    def measured(self) -> MeasuredCase:
        """Measure the case."""
        return MeasuredCase(self.name, *self.measure())


@dataclass(frozen=True)
class MeasuredCase:
    """A case with its errors."""

    name: str
    what: str
    errors: Errors


def run(world: World, duration: float, what: str) -> None:
    """Run a world, and write on the terminal how far it is."""
    end = world.time + duration
    while world.time < end - 0.5 * world.dt:
        tell(f"{what}: {world.time:.0f} of {duration:.0f} s")
        world.run(min(BETWEEN_REPORTS, end - world.time))


# -- slides -----------------------------------------------------------------------------------


class Slider(NamedTuple):
    """A body on the ground, which slides."""

    body: SceneBody
    friction: float
    speed: float
    """Speed at the start [m/s]."""
    heading: float
    """Angle of its velocity about z [rad]."""
    tipping: float
    """Friction at which it tips: half of the width over the height of the centre."""


def frustum(rng: np.random.Generator, folder: Path) -> tuple[Mesh, float]:
    """Return a random convex mesh that stands on 3 to 12 vertices, and the friction at which it tips."""
    while True:
        below, above = int(rng.integers(3, 13)), int(rng.integers(1, 8))
        angles = np.concatenate([rng.uniform(0, 2 * np.pi, n) for n in (below, above)])
        radii = np.repeat([rng.uniform(0.05, 0.25), rng.uniform(0.02, 0.2)], (below, above))
        z = np.repeat([0.0, rng.uniform(0.05, 0.3)], (below, above))
        points = np.stack([radii * np.cos(angles), radii * np.sin(angles), z], axis=1)
        vertices, faces = convex_hull(points)
        name = folder / f"{len(list(folder.iterdir()))}.obj"
        lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in vertices.tolist()]
        lines += [f"f {i} {j} {k}" for i, j, k in (faces + 1).tolist()]
        name.write_text("\n".join(lines) + "\n")
        mesh = Mesh(str(name))
        x, y, height = solid_properties(mesh).center.tolist()
        base = vertices[vertices[:, 2] < 1e-9][:, :2] - (x, y)
        base = base[np.argsort(np.arctan2(base[:, 1], base[:, 0]))]
        edges = np.roll(base, -1, axis=0) - base
        across = base[:, 0] * edges[:, 1] - base[:, 1] * edges[:, 0]
        tipping = float((across / np.linalg.norm(edges, axis=1)).min()) / height
        # The base encloses the point below the centre.
        if len(base) >= 3 and tipping > 0.05:
            return mesh, tipping


def slider(rng: np.random.Generator, folder: Path) -> Slider:
    """Return a random body on the ground. Its friction is below the one at which it tips."""
    width, depth, height = rng.uniform(0.1, 0.5), rng.uniform(0.1, 0.5), rng.uniform(0.05, 0.3)
    kind, z = rng.integers(3), 0.5 * height
    shape: Shape = Box((width, depth, height))
    tipping = min(width, depth) / height
    if kind == 1:
        shape, tipping = Cylinder(0.5 * width, height), width / height
    elif kind == 2:
        (shape, tipping), z = frustum(rng, folder), 0.0
    friction = rng.uniform(0.1, MOST_OF_TIPPING) * min(tipping, 1.0)
    speed, heading = rng.uniform(0.5, 10.0), rng.uniform(-math.pi, math.pi)
    body = SceneBody(
        "body",
        shape,
        Pose((0.0, 0.0, z), (0.0, 0.0, rng.uniform(-math.pi, math.pi))),
        rng.uniform(0.1, 10.0),
        twist=(speed * math.cos(heading), speed * math.sin(heading), 0.0, 0.0, 0.0, 0.0),
        # The contact has the geometric mean of this and the friction of the ground, 1.
        material=Material(friction=friction**2),
    )
    return Slider(body, friction, speed, heading, tipping)


def slides(count: int, seed: int) -> Iterator[Case]:
    """Yield random slides."""
    for k in range(count):

        def measure(k: int = k) -> tuple[str, Errors]:
            rng = np.random.default_rng((seed, SLIDE, k))
            with tempfile.TemporaryDirectory() as folder:
                chosen = slider(rng, Path(folder))
                return _slide(chosen, float(rng.uniform(0.5e-3, 5e-3)))

        yield Case(f"slide {seed}.{k}", measure)


def _slide(chosen: Slider, h: float) -> tuple[str, Errors]:
    body, friction, speed, heading, tipping = chosen
    steps = speed / (friction * G * h)
    what = (
        f"{type(body.shapes[0].shape).__name__}, mu {friction:.3g}, {friction / tipping:.2g} of tipping, "
        f"{speed:.3g} m/s, h {h:.2g} s, {steps:.3g} steps"
    )
    scene = Scene("slide", bodies=(ground(material=Material(friction=1.0)), body))
    with World(scene, ENGINE, h) as world:
        run(world, (steps + 3.0) * h, what)
        T, begin = world.state.bodies[body.name].T_world_body, body.pose.matrix
    moved, turned = T[:3, 3] - begin[:3, 3], begin[:3, :3].T @ T[:3, :3]
    yaw = abs(math.atan2(turned[1, 0], turned[0, 0]))
    drift = abs(math.remainder(math.atan2(moved[1], moved[0]) - heading, 2.0 * math.pi))
    distance = math.hypot(moved[0], moved[1])
    wanted = speed**2 / (2.0 * friction * G) - 0.5 * speed * h
    f = steps % 1.0
    in_steps = wanted + 0.5 * friction * G * h**2 * f * (1.0 - f)
    return what, {
        "tilt [rad]": math.acos(min(1.0, T[2, 2])),
        "change of heading [rad]": max(yaw, drift),
        "stopping distance, relative error": abs(distance - wanted) / wanted,
        "stopping distance in steps, relative error": abs(distance - in_steps) / in_steps,
    }


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


def rests(share: float, h: float) -> Iterator[Case]:
    """Yield bodies at rest in steps of `h` [s]."""
    for what, scene, duration in resting(share) if share > 0.0 else ():

        def measure(what: str = what, scene: Scene = scene, duration: float = duration) -> tuple[str, Errors]:
            return what, _rest(what, scene, duration, h)

        yield Case(f"{what}, {duration:g} s in steps of {h:g} s", measure)


def _rest(what: str, scene: Scene, duration: float, h: float) -> Errors:
    with World(scene, ENGINE, h) as world:
        run(world, duration, what)
        state, force = world.state, sum(c.force for c in world.contacts("ground"))
    weight = sum(body.mass or 0.0 for body in scene.bodies) * np.array(scene.gravity)
    moving = [body for body in scene.bodies if not body.fixed]
    poses = {body.name: state.bodies[body.name].T_world_body[:3, 3] for body in moving}
    return {
        "sum of forces, relative to the weight": float(
            np.linalg.norm(force - weight) / np.linalg.norm(weight)
        ),
        "creep [m/s]": max(float(np.abs(state.bodies[body.name].twist).max()) for body in moving),
        "sinking [m]": max(
            float(np.abs(poses[body.name] - body.pose.matrix[:3, 3]).max()) for body in moving
        ),
    }


# -- work -------------------------------------------------------------------------------------


ROUNDING = 4.0 * float(np.finfo(np.float64).eps)
"""Relative rounding of an energy, which is not growth."""


class Energies(NamedTuple):
    """Masses and energies (n,) of the bodies of an island [J]."""

    masses: Floats
    """Masses (n,) [kg]."""
    kinetic: Floats
    potential: Floats

    @property
    def total(self) -> Floats:
        """Sum of both (n,)."""
        return self.kinetic + self.potential


def energies(island: Island) -> Energies:
    """Return the energies of the bodies of an island, which has no robots."""
    masses, kinetic, potential = [], [], []
    for body in island.parts.values():
        assert isinstance(body, OwnBody)
        body.forget_placements()
        inertial = body.engine.model.links[0].inertial
        assert inertial is not None
        gravity = np.array(body.engine.model.gravity)
        spatial = np.linalg.inv(body.response(np.eye(6)))
        center = body.pose(0) @ np.append(inertial.origin.xyz, 1.0)
        masses.append(inertial.mass)
        kinetic.append(0.5 * float(body.v @ spatial @ body.v))
        potential.append(-inertial.mass * float(gravity @ center[:3]))
    return Energies(np.array(masses), np.array(kinetic), np.array(potential))


class EnergyOfSteps:
    """Measures the energy of each step of an island, and the work of the impulses that its solver returns."""

    def __init__(self) -> None:
        self.work = self.growth = self.residual = 0.0
        self._kinetic = math.inf

    def __enter__(self) -> EnergyOfSteps:
        found = self

        def measured(island: Island, warm: WarmStart) -> Any:
            return found._step(island, warm)

        setattr(Island, "step", measured)  # noqa: B010
        setattr(impulses, "solve", self.solve)  # noqa: B010
        setattr(impulses, "rebound", self.rebound)  # noqa: B010
        return self

    def __exit__(self, *_: object) -> None:
        setattr(Island, "step", _STEP)  # noqa: B010
        setattr(impulses, "solve", solve)  # noqa: B010
        setattr(impulses, "rebound", rebound)  # noqa: B010

    def _step(self, island: Island, warm: WarmStart) -> Any:
        before, parts = energies(island), list(island.parts.values())
        states = [(body.q, body.v) for body in parts]
        for body in parts:
            body.finish()
        free = energies(island)
        for body, (q, v) in zip(parts, states, strict=True):
            body.q, body.v = q, v
            body.forget_placements()
        self._kinetic = float(max(before.kinetic.sum(), free.kinetic.sum()))
        overlaps = any(each.gap < -NEGLIGIBLE for each in island.contacts)
        result = _STEP(island, warm)
        after = energies(island)
        if not overlaps:
            # What takes back an overlap may lift a body, or turn its inertia, with the same velocity.
            # A fall in a step of h takes the energy m (g h)^2 / 2 beside what the integrator adds by the
            # rotation; a support keeps it.
            speed = IMPACT_STEP * float(np.linalg.norm(parts[0].engine.model.gravity))
            falls = 0.5 * before.masses * speed**2
            most = before.total + np.maximum(free.total + falls - before.total, 0.0)
            rounding = ROUNDING * float(np.abs(before.potential).sum())
            growth = float((after.total - most).sum()) - rounding
            self.growth = max(self.growth, growth / self._kinetic)
        return result

    def solve(self, sets: ConstraintSets, G: Floats, c: Floats, limits: Floats, **given: Any) -> Solution:
        """Solve, and measure."""
        return self._measured(c, solve(sets, G, c, limits, **given))

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
        return self._measured(c, rebound(sets, G, c, limits, plastic, restitution))

    def _measured(self, c: Floats, found: Solution) -> Solution:
        # With the gaps in c, x . (c + w) / 2 leaves out what closing a gap returns.
        work = float(found.impulses @ (c + found.velocities)) / 2.0
        self.work = max(self.work, work / self._kinetic)
        self.residual = max(self.residual, float(found.residuals.largest))
        return found


_STEP = Island.step


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


def works(count: int, seed: int) -> Iterator[Case]:
    """Yield random scenes with impacts."""
    for k in range(count):

        def measure(k: int = k) -> tuple[str, Errors]:
            scene = collision(np.random.default_rng((seed, SCENE, k)))
            with EnergyOfSteps() as measured, World(scene, ENGINE, IMPACT_STEP) as world:
                world.step(40)
            return f"scene {seed}.{k}", {
                "work, relative to the kinetic energy": measured.work,
                "growth of energy, relative to the kinetic energy": measured.growth,
                "residual of a step [m/s]": measured.residual,
            }

        yield Case(f"scene {seed}.{k}", measure)


def report(cases: Sequence[MeasuredCase]) -> bool:
    """Print the largest value of each error; return whether one exceeds its bar."""
    failed = False
    for name, bar in BARS.items():
        found = [(each.errors[name], each.what) for each in cases if name in each.errors]
        if found:
            value, what = max(found)
            over = sum(not error <= bar for error, _ in found)
            beyond = f", {over} above {bar:.2g}" if over else ""
            print(f"{name:50s} {value:9.2e} of {len(found)} cases{beyond} ({what})")
            failed = failed or over > 0
    return failed


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure, print the largest errors, and return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--slides", type=int, default=1000, help="number of bodies that slide")
    parser.add_argument("--scenes", type=int, default=10_000, help="number of random scenes with impacts")
    parser.add_argument("--rest", type=float, default=1.0, help="share of 15 s on slopes and 60 s of stacks")
    parser.add_argument("--step", type=float, default=1e-3, help="step of bodies at rest [s]")
    parser.add_argument("--seed", type=int, default=0, help="seed of slides and scenes, which have numbers")
    parser.add_argument("--record", type=Path, help="file of the cases that are done, from which to continue")
    given = parser.parse_args(arguments)
    cases = [
        *slides(given.slides, given.seed),
        *rests(given.rest, given.step),
        *works(given.scenes, given.seed),
    ]
    record: Record[MeasuredCase] = Record(MeasuredCase, lambda each: each.name, given.record)
    found: list[MeasuredCase] = []
    interrupted = False
    try:
        for case in cases:
            tell(f"{len(found)} of {len(cases)} cases: {case.name}")
            found.append(record.get(case.name, case.measured))
    except KeyboardInterrupt:
        interrupted = True
    tell("")
    if interrupted:
        print(f"interrupted after {len(found)} of {len(cases)} cases")
    failed = report(found)
    return 130 if interrupted else int(failed)


if __name__ == "__main__":
    sys.exit(main())
