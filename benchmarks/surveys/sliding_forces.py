"""Spread of the contact forces of bodies that slide, at one step and averaged over intervals::

    python -m benchmarks.surveys.sliding_forces

Bodies of 1 kg slide on level ground, and their normal force is read after every step: that of the last step
(`World.contacts`) and the mean over an interval (`World.mean_contacts`). By mechanics it is the weight. The
table of docs/results.md has the standard deviation of what is read, relative to the weight. For each engine
it has the least and the largest of the bodies.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import numpy as np

from dynx.model.elements import Pose
from dynx.model.geometry import Box, Collision, Mesh, Shape
from dynx.world import Material, Scene, SceneBody, World, ground

SPEED = 5.0
"""Speed at the start [m/s]."""

STARTING, DURATION = 0.4, 0.4
"""Times [s] after which forces are read, and for which, at the end of which all bodies still slide."""

INTERVALS = (0.02, 0.1, 0.3)
"""Intervals [s] over which forces are averaged."""

WEIGHT = 9.81


class Slider(NamedTuple):
    """A body that slides: its edges [m], friction, and the angle [rad] of the slide to an edge."""

    size: tuple[float, float, float]
    friction: float
    heading: float = 0.0
    mesh: bool = False


SLIDERS = (
    Slider((0.4, 0.4, 0.2), 0.5),
    Slider((0.2, 0.2, 0.1), 0.4),
    Slider((0.2, 0.2, 0.2), 0.4),
    Slider((0.3, 0.3, 0.05), 0.5, 0.5),
    Slider((0.3, 0.3, 0.05), 0.5, mesh=True),
)


def sliding_scene(slider: Slider, folder: Path) -> Scene:
    """Return the scene of a slide; a mesh is written into the folder."""
    material = Material(friction=slider.friction)
    shape: Shape = Box(slider.size)
    if slider.mesh:
        x, y, z = (0.5 * edge for edge in slider.size)
        corners = [f"v {a * x} {b * y} {c * z}" for a in (-1, 1) for b in (-1, 1) for c in (-1, 1)]
        faces = ["1 2 4 3", "5 7 8 6", "1 5 6 2", "3 4 8 7", "1 3 7 5", "2 6 8 4"]
        file = folder / "slab.obj"
        file.write_text("\n".join([*corners, *(f"f {face}" for face in faces), ""]), encoding="utf-8")
        shape = Mesh(str(file))
    velocity = (SPEED * math.cos(slider.heading), SPEED * math.sin(slider.heading))
    body = SceneBody(
        "body",
        (Collision(shape),),
        Pose((0.0, 0.0, 0.5 * slider.size[2])),
        1.0,
        twist=(*velocity, 0.0, 0.0, 0.0, 0.0),
        material=material,
    )
    return Scene("slide", bodies=(ground(material=material), body))


def spreads(scene: Scene, engine: str, dt: float) -> list[float]:
    """Return the standard deviations of the normal force of single steps and of the means over `INTERVALS`,
    relative to the weight."""
    found = []
    for interval in (None, *INTERVALS):
        with World(scene, engine, dt, contact_interval=interval) as world:
            world.run(STARTING)
            forces = []
            for _ in range(round(DURATION / dt)):
                world.step()
                contacts = world.contacts("body") if interval is None else world.mean_contacts("body")
                forces.append(sum(each.normal_force for each in contacts))
            found.append(float(np.std(forces)) / WEIGHT)
    return found


def percent(spread: float) -> str:
    """Return a spread in percent; rounding counts as none."""
    return f"{100 * spread:.3g}" if spread > 1e-6 else "0"


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--engine", nargs="*", default=["pybullet", "mujoco", "drake"])
    parser.add_argument("--dt", nargs="*", type=float, default=[1e-3, 4e-3])
    parser.add_argument("--count", type=int, default=len(SLIDERS), help="number of bodies")
    given = parser.parse_args(arguments)
    print("| engine | step | one step |", *(f"{each:g} s |" for each in INTERVALS))
    print("|" + "---|" * (3 + len(INTERVALS)))
    with TemporaryDirectory() as folder:
        scenes = [sliding_scene(slider, Path(folder)) for slider in SLIDERS[: given.count]]
        for engine in given.engine:
            for dt in given.dt:
                rows = np.array([spreads(scene, engine, dt) for scene in scenes])
                cells = (
                    f"{percent(a)} to {percent(b)} % |" for a, b in zip(rows.min(0), rows.max(0), strict=True)
                )
                print(f"| {engine} | {1e3 * dt:g} ms |", *cells, flush=True)


if __name__ == "__main__":
    main()
