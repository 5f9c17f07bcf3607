"""``python -m tests.world.random_scenes --count 300``: the laws of mechanics on many random scenes.

Prints for each engine and law the number of scenes, the quantiles of error / bound, the distances of runs in
another order and at another place, and the scenes that violate a law, by number.
"""

from __future__ import annotations

import argparse
import json
from collections import defaultdict

import numpy as np
from hypothesis import HealthCheck, Phase, given, seed, settings

from dynx.errors import DynxError
from dynx.testing.strategies import scenes
from dynx.world import Scene
from tests.world.engines import WORLDS
from tests.world.random_scenes.examination import (
    MOTION,
    distance,
    examine,
    final_state,
    moved,
    numbers,
    permuted,
)

QUANTILES = (0.5, 0.9, 0.99, 1.0)


def figures(scene: Scene, engine: str) -> dict[str, float]:
    """Return every figure of one scene."""
    found = examine(scene, engine)
    state = final_state(scene, engine)
    found["numbers that differ in a second run"] = float(
        np.sum(numbers(state) != numbers(final_state(scene, engine)))
    )
    found["other order [m]"] = distance(state, final_state(permuted(scene), engine))
    found["other place [m]"] = distance(state, final_state(moved(scene), engine), MOTION.matrix)
    return found


def run(engine: str, count: int, start: int) -> None:
    """Examine `count` scenes and print the figures."""
    columns: dict[str, list[float]] = defaultdict(list)
    failures: list[str] = []
    violations: list[str] = []

    @seed(start)
    @settings(
        max_examples=count,
        database=None,
        deadline=None,
        phases=[Phase.generate],
        suppress_health_check=list(HealthCheck),
    )
    @given(scenes())
    def note(scene: Scene) -> None:
        number = len(columns["energy"]) + len(failures)
        try:
            found = figures(scene, engine)
        except DynxError as error:
            failures.append(f"scene {number}: {error}")
            return
        for name, value in found.items():
            columns[name].append(value)
            if not name.endswith("[m]") and value > 1.0:
                violations.append(f"scene {number}: {name} {value:.3g} {_summary(scene)}")

    note()
    for name, values in columns.items():
        quantiles = ", ".join(f"{np.quantile(values, each):.2g}" for each in QUANTILES)
        print(f"{engine:9} {name:36} {len(values)} scenes, quantiles {QUANTILES}: {quantiles}", flush=True)
    print("\n".join([*violations, *failures]) or f"{engine:9} no violation", flush=True)


def _summary(scene: Scene) -> str:
    shapes = [type(each.shape).__name__ for body in scene.bodies for each in body.shapes]
    return json.dumps([shapes, len(scene.robots), len(scene.constraints)])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=300)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--engine", choices=WORLDS, action="append")
    given_arguments = parser.parse_args()
    for engine in given_arguments.engine or WORLDS:
        run(engine, given_arguments.count, given_arguments.seed)


if __name__ == "__main__":
    main()
