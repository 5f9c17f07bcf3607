"""``python -m benchmarks.surveys.random_scenes --count 300``: the laws of mechanics on many random scenes.

Prints for each engine and law the number of scenes and the quantiles of error / bound, the distances of runs
in another order and at another place, and every violation of a law with the setting that causes it: the scene
is run again with that setting changed, and the law holds. Scene n is the same whatever else is run. The exit
code is 1 if a violation has no cause.
"""

from __future__ import annotations

import argparse
import sys
from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping

import numpy as np

from dynx.errors import DynxError
from dynx.world import Scene
from tests.world.engines import WORLDS
from tests.world.random_scenes.attribution import Examination, cause_of
from tests.world.random_scenes.drawing import resting_scene_of, scene_of
from tests.world.random_scenes.examination import (
    MOTION,
    distance,
    examine,
    final_state,
    moved,
    numbers,
    permuted,
)
from tests.world.random_scenes.rest import rest_excess

QUANTILES = (0.5, 0.9, 0.99, 1.0)

PARTS: Mapping[str, tuple[Callable[[int], Scene], Examination]] = {
    "motion": (scene_of, examine),
    "rest": (resting_scene_of, rest_excess),
}
"""Parts of the examination: where its scenes come from, and its laws."""

LAWS = ("linear momentum", "angular momentum", "energy", "resting force", "resting moment")


def repetition(scene: Scene, engine: str) -> dict[str, float]:
    """Return how a second run, another order and another place change the final state of a scene."""
    state = final_state(scene, engine)
    return {
        "numbers that differ in a second run": float(
            np.sum(numbers(state) != numbers(final_state(scene, engine)))
        ),
        "other order [m]": distance(state, final_state(permuted(scene), engine)),
        "other place [m]": distance(state, final_state(moved(scene), engine), MOTION.matrix),
    }


def run(part: str, engine: str, scene_numbers: Iterable[int], repeat: bool) -> int:
    """Examine scenes, print the figures and the violations, and return how many of these have no cause."""
    draw, examination = PARTS[part]
    columns: dict[str, list[float]] = defaultdict(list)
    found: list[str] = []
    unexplained = 0
    for number in scene_numbers:
        scene = draw(number)
        try:
            excess = dict(examination(scene, engine))
            if repeat:
                excess |= repetition(scene, engine)
        except DynxError as error:
            found.append(f"scene {number}: {type(error).__name__}: {error}")
            unexplained += 1
            continue
        for name, value in excess.items():
            columns[name].append(value)
        for law in LAWS:
            if excess.get(law, 0.0) > 1.0:
                cause = cause_of(scene, engine, law, examination, excess)
                unexplained += cause is None
                told = "UNEXPLAINED" if cause is None else f"setting {cause}: {cause.excess:.3g}"
                found.append(f"scene {number}: {law} {excess[law]:.3g}; {told} {_summary(scene)}")
                print(f"{engine:9} {found[-1]}", flush=True)
    for name, values in columns.items():
        quantiles = ", ".join(f"{np.quantile(values, each):.2g}" for each in QUANTILES)
        print(f"{engine:9} {name:36} {len(values)} scenes, quantiles {QUANTILES}: {quantiles}", flush=True)
    print(f"{engine:9} {part}: {len(found)} findings, {unexplained} without a cause", flush=True)
    return unexplained


def _summary(scene: Scene) -> str:
    shapes = [type(each.shape).__name__ for body in scene.bodies for each in body.shapes]
    return f"({', '.join(shapes)}; {len(scene.robots)} robots, {len(scene.constraints)} constraints)"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=300, help="number of scenes")
    parser.add_argument("--first", type=int, default=0, help="number of the first scene")
    parser.add_argument("--engine", choices=WORLDS, action="append")
    parser.add_argument("--part", choices=PARTS, action="append")
    parser.add_argument(
        "--repeat", action="store_true", help="also run scenes again, in another order and place"
    )
    given = parser.parse_args()
    scene_numbers = range(given.first, given.first + given.count)
    unexplained = 0
    for engine in given.engine or WORLDS:
        for part in given.part or PARTS:
            unexplained += run(part, engine, scene_numbers, given.repeat)
    sys.exit(unexplained > 0)


if __name__ == "__main__":
    main()
