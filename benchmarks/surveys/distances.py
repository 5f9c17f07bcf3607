"""Errors of engines' distances over random pairs: ``python -m benchmarks.surveys.distances --pairs 10000``.

Pairs of each two kinds of shapes are separated, touching or overlapping in turn. The table has the worst and
the median error of each engine against `dynx.distance`, as the engine comes, and the worst one after the
settings have changed that it is attributed to (`benchmarks/surveys/distance_engines.py`). Not run in CI.
"""

from __future__ import annotations

import argparse
import time
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from itertools import combinations_with_replacement
from typing import NamedTuple

import numpy as np

from benchmarks.surveys.distance_engines import CHANGES, ENGINES, Measure, Placed
from dynx.distance import Distance, distance
from tests.distance.shapes import KINDS, random_pose, random_shape

PLACEMENTS = ("separated", "touching", "overlapping")
CASES = [(*kinds, place) for kinds in combinations_with_replacement(KINDS, 2) for place in PLACEMENTS]
BLOCK = 45


class Row(NamedTuple):
    """One pair: its case, the difference of the bounds, and the errors of every engine."""

    case: tuple[str, str, str]
    difference: float
    """Gap of the bounds, relative to the distance where separated, otherwise in metres."""
    seconds: float
    """Time of the certified distance [s]."""
    errors: dict[str, tuple[float, float]]


def random_pair(rng: np.random.Generator, case: tuple[str, str, str]) -> tuple[Placed, Placed]:
    """Return two shapes of 0.1 to 1 m at random poses, separated, touching or overlapping."""
    first, second, place = case
    while True:
        reach = 0.3 if place == "overlapping" else 1.5
        a = random_shape(rng, first), random_pose(rng, reach)
        b = random_shape(rng, second), random_pose(rng, reach)
        found = distance(*a, *b)
        if (found.lower > 0.0) == (place == "overlapping"):
            continue
        if place == "touching":
            a[1][:3, 3] -= found.lower * found.normal
        return a, b


def measure_block(engines: Sequence[str], seed: int) -> list[Row]:
    """Return the rows of one pair of every case."""
    rng = np.random.default_rng(seed)
    measures = {name: ENGINES[name]() for name in engines}
    return [measure(measures, rng, case) for case in CASES]


def measure(measures: Mapping[str, Measure], rng: np.random.Generator, case: tuple[str, str, str]) -> Row:
    """Return the row of a random pair."""
    a, b = random_pair(rng, case)
    began = time.process_time()
    exact = distance(*a, *b)
    seconds = time.process_time() - began
    errors = {name: errors_of(run, a, b, exact) for name, run in measures.items()}
    difference = exact.max_error / exact.distance if case[2] == "separated" else exact.max_error
    return Row(case, difference, seconds, errors)


def errors_of(run: Measure, a: Placed, b: Placed, exact: Distance) -> tuple[float, float]:
    """Return the differences of both distances of an engine from the exact one, infinite where it failed."""
    try:
        found = run(a, b)
    except Exception:
        return np.inf, np.inf
    first, second = (abs(each - exact.distance) if np.isfinite(each) else np.inf for each in found)
    return first, second


def table(rows: Sequence[Row], engines: Sequence[str]) -> Iterator[str]:
    """Yield the lines of the tables in Markdown, errors in metres."""
    by_case = defaultdict(list)
    for row in rows:
        by_case[row.case].append(row)
    for place in PLACEMENTS:
        yield f"\n**{place.capitalize()}**\n"
        header = [cell for name in engines for cell in (name, CHANGES.get(name)) if cell]
        yield "| pair | bounds | " + " | ".join(header) + " |"
        yield "|---|" + "---|" * (1 + len(header))
        for case, found in by_case.items():
            if case[2] != place:
                continue
            cells = [f"{max(row.difference for row in found):.0e}"]
            for name in engines:
                errors = np.array([row.errors[name] for row in found])
                columns = errors.T if name in CHANGES else errors.T[:1]
                cells += [f"{shown(column.max())} ({shown(np.median(column))})" for column in columns]
            yield f"| {case[0]}, {case[1]} | " + " | ".join(cells) + " |"


def shown(error: float) -> str:
    """Return an error [m] in one digit; engines that fail raise, or return an infinite or huge number."""
    return f"{error:.0e}" if error < 1e100 else "fails"


def times(rows: Sequence[Row]) -> str:
    """Return the median time of the certified distance for each placement."""
    medians = [
        1e6 * float(np.median([row.seconds for row in rows if row.case[2] == place])) for place in PLACEMENTS
    ]
    return ", ".join(f"{place} {median:.0f} us" for place, median in zip(PLACEMENTS, medians, strict=True))


def main() -> None:
    """Run the survey and print its tables."""
    parser = argparse.ArgumentParser(description="Errors of engines' distances over random pairs of shapes")
    parser.add_argument(
        "--pairs", type=int, default=900, help="number of pairs, rounded up to whole rounds of 45"
    )
    parser.add_argument(
        "--engines", default=",".join(ENGINES), help="engines to compare, separated by commas"
    )
    parser.add_argument("--seed", type=int, default=0, help="seed of the first round")
    parser.add_argument("--workers", type=int, default=2, help="number of processes")
    given = parser.parse_args()
    engines = given.engines.split(",")
    seeds = range(given.seed, given.seed + -(-given.pairs // BLOCK))
    with ProcessPoolExecutor(given.workers) as pool:
        rows = [row for block in pool.map(partial(measure_block, engines), seeds) for row in block]
    print("\n".join(table(rows, engines)))
    print(f"\n{len(rows)} pairs; a certified distance takes, in the median: {times(rows)}")


if __name__ == "__main__":
    main()
