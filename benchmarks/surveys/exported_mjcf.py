"""``python -m benchmarks.surveys.exported_mjcf --count 50``: exported worlds replayed in MuJoCo alone.

Every scene of dynx, and many random ones, are stepped for a second in MuJoCo with random torques of their
joints, and written to MJCF. MuJoCo alone reads each file and takes the same steps under the recorded forces.
Prints for each scene the largest difference of the states and the fields of both models that differ. The exit
code is 1 if a difference is above 1e-9 or a field differs. A scene that no world can run, or no document can
hold, is printed and counted.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

from dynx.errors import DynxError
from dynx.world import Scene, read_scene, scene_names
from tests.world.random_scenes.drawing import scene_of
from tests.world.replay import examine

BOUND = 1e-9
"""Largest difference of states [m, rad, m/s, rad/s]."""


def scenes(first: int, count: int) -> Iterator[tuple[str, Scene]]:
    """Yield the scenes of dynx, then random ones, by name or number."""
    yield from ((name, read_scene(name)) for name in scene_names())
    yield from ((str(number), scene_of(number)) for number in range(first, first + count))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=50, help="number of random scenes")
    parser.add_argument("--first", type=int, default=0, help="number of the first random scene")
    parser.add_argument("--steps", type=int, default=1000, help="steps of 1 ms")
    given = parser.parse_args()
    failed, refused, largest, n = 0, 0, 0.0, 0
    with tempfile.TemporaryDirectory() as folder:
        for name, scene in scenes(given.first, given.count):
            n += 1
            try:
                found, differing = examine(scene, Path(folder, "scene.xml"), given.steps, seed=n)
            except DynxError as error:
                refused += 1
                print(f"{name:10} {type(error).__name__}: {error}", flush=True)
                continue
            largest = max(largest, found)
            failed += bool(differing) or not found <= BOUND
            print(f"{name:10} {found:.2g} {', '.join(differing)}", flush=True)
    print(f"{n} scenes: largest difference {largest:.2g}; {failed} failed, {refused} refused")
    sys.exit(failed > 0)


if __name__ == "__main__":
    main()
