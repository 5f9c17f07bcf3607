"""Every quantity of several robots, by each engine: ``python -m benchmarks.every_quantity``.

Each engine that computes the quantity itself is called through dynx, with checked arguments: one sample, and
a batch. The result of `compiled` is compared with that of each engine first. The table gives the least
processor time per sample of `compiled` and of the fastest other engine in nanoseconds, and how many times the
time of `compiled` that engine takes. A ratio below 1 ends the command with 1.

``--record FILE`` adds each row to a file when it is measured. Rows that the file has are not measured again,
so an interrupted run continues where it stopped. ``--markdown`` prints the table of docs/results.md.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.progress import Record, tell
from dynx.backends import Backend, backend, installed_backends
from dynx.backends.derived import native_quantities
from dynx.backends.quantities import QUANTITIES
from dynx.bench.timing import interleaved, once
from dynx.errors import DynxError
from dynx.model import Inertial, Joint, Link, Model, Pose
from dynx.model.loading import load
from dynx.spatial.scalar import Floats

ENGINES = ("pinocchio", "drake", "mujoco", "pybullet")
"""Engines that `compiled` is compared with."""

MAX_RESULT_BYTES = 2**23
"""Largest result of a batch."""

MAX_SAMPLES_OF_A_LOOP = 64
"""Samples that an engine without batches of its own evaluates in one timing."""

HOPELESS = 10.0
"""Ratio to the fastest engine from which on another is not timed further."""

MIN_AGREEMENT = 1e-6
"""Largest difference of two engines, relative to the largest entry."""


@dataclass(frozen=True)
class Row:
    """Times of one quantity of one robot, in seconds per sample."""

    robot: str
    quantity: str
    samples: int
    compiled: float
    others: dict[str, float]

    @property
    def best(self) -> str:
        """Name of the fastest other engine."""
        return min(self.others, key=lambda name: self.others[name])

    @property
    def ratio(self) -> float:
        """Time of the fastest other engine over that of `compiled`."""
        return self.others[self.best] / self.compiled

    def __str__(self) -> str:
        return (
            f"{self.robot:20}{self.quantity:26}{self.samples:8}{1e9 * self.compiled:12,.0f}"
            f"{1e9 * self.others[self.best]:12,.0f}  {self.best:10}{self.ratio:7.2f}"
            f"{'  SLOWER' if self.ratio < 1.0 else ''}"
        )


def serial_arm(n: int) -> Model:
    """Return `n` revolute joints in a row, with axes in turn along y and z."""
    links = [Link(f"link{k}", _inertial(k)) for k in range(n + 1)]
    joints = [_joint(k, f"link{k}", "revolute") for k in range(n)]
    return Model.build(f"{n} joints in series", links, joints)


def tree(n: int, seed: int = 0) -> Model:
    """Return a tree of `n` joints, one in ten prismatic, each on one of the ten links before it."""
    rng = np.random.default_rng(seed)
    links = [Link(f"link{k}", _inertial(k)) for k in range(n + 1)]
    joints = [
        _joint(k, f"link{rng.integers(max(0, k - 9), k + 1)}", "prismatic" if k % 10 == 9 else "revolute")
        for k in range(n)
    ]
    return Model.build(f"tree of {n} joints", links, joints)


def _inertial(k: int) -> Inertial:
    return Inertial(1.0 + 0.1 * (k % 5), Pose((0.1, 0.02, 0.03 * (k % 3))), 0.1, 0.01, 0.0, 0.2, 0.0, 0.15)


def _joint(k: int, parent: str, kind: Any) -> Joint:
    origin = Pose((0.05, 0.0, 0.2), (0.3 * (k % 4), 0.0, 0.1))
    return Joint(f"joint{k}", kind, parent, f"link{k + 1}", origin, (0.0, k % 2, 1.0 - k % 2))


def robots() -> dict[str, Model]:
    """Return the robots of the table by their names."""
    return {
        "ur5": load("ur5"),
        "panda": load("panda"),
        "a1": load("a1", base="floating"),
        "talos": load("talos", base="floating"),
        "serial64": serial_arm(64),
        "tree101": tree(101),
    }


def chosen_robot(name: str) -> Model:
    """Return a robot of the table or of the library; ``NAME:floating`` is one with a floating base."""
    found = robots().get(name)
    library_name, _, base = name.partition(":")
    return load(library_name, base="floating" if base == "floating" else "fixed") if found is None else found


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table; return 1 if another engine was faster than `compiled`, or their results differ."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.every_quantity", description=__doc__)
    of_library = "or of the library: NAME or NAME:floating"
    parser.add_argument(
        "--robot", action="append", help=f"one of {', '.join(robots())} (default: all), {of_library}"
    )
    parser.add_argument("--quantity", action="append", choices=list(QUANTITIES), help="default: all")
    parser.add_argument("--batch", type=int, default=1024, help="samples in a batch (default 1024)")
    parser.add_argument("--repetitions", type=int, default=7)
    parser.add_argument("--record", type=Path, metavar="FILE", help="rows measured so far, one in a line")
    parser.add_argument("--markdown", action="store_true", help="print the table as Markdown at the end")
    chosen = parser.parse_args(arguments)
    record = Record(Row, lambda row: (row.robot, row.quantity, row.samples), chosen.record)
    rows: list[Row] = []
    print(f"{'robot':20}{'quantity':26}{'samples':>8}{'compiled':>12}{'best other':>12}  {'':10}{'ratio':>7}")
    models = {name: chosen_robot(name) for name in chosen.robot or robots()}
    quantities = chosen.quantity or list(QUANTITIES)
    for name, model in models.items():
        for quantity in quantities:
            for samples in (1, batch_size(model, quantity, chosen.batch)):
                tell(
                    f"{len(rows)} of {2 * len(models) * len(quantities)} rows; {name}, {quantity}, {samples}"
                )
                call = partial(measure, name, model, quantity, samples, chosen.repetitions)
                row = record.get((name, quantity, samples), call)
                tell("")
                print(row, flush=True)
                rows.append(row)
    if chosen.markdown:
        print(markdown(rows))
    return 1 if any(row.ratio < 1.0 for row in rows) else 0


def batch_size(model: Model, quantity: str, wanted: int) -> int:
    """Return the samples of a batch, whose result is at most `MAX_RESULT_BYTES` long."""
    result_bytes = 8 * int(np.prod(QUANTITIES[quantity].shape_of(model)))
    return max(2, min(wanted, MAX_RESULT_BYTES // max(1, result_bytes)))


def measure(name: str, model: Model, quantity: str, samples: int, repetitions: int) -> Row:
    """Time one sample or a batch on `compiled` and on every engine that computes the quantity itself."""
    calls = {"compiled": _call(backend("compiled", model, threads=1), quantity, samples)}
    counts = {"compiled": samples}
    expected = calls["compiled"]()
    for engine in ENGINES:
        if engine not in installed_backends():
            continue
        count = min(samples, MAX_SAMPLES_OF_A_LOOP)
        try:
            opened = backend(engine, model)
            if quantity not in native_quantities(opened):
                continue
            call = _call(opened, quantity, count)
            check(expected, call(), f"{name}, {quantity}: {engine}")
        except DynxError as error:
            tell("")
            print(f"{name}, {quantity}: {engine} is left out: {error}", file=sys.stderr)
            continue
        calls[engine], counts[engine] = call, count
    first = {
        engine: min(once(call, time.process_time) for _ in range(3)) / counts[engine]
        for engine, call in calls.items()
    }
    fastest = min(seconds for engine, seconds in first.items() if engine != "compiled")
    timed = [engine for engine in calls if engine == "compiled" or first[engine] < HOPELESS * fastest]
    found = interleaved([calls[engine] for engine in timed], repetitions, time.process_time)
    seconds = {
        engine: min(times.seconds) / counts[engine] for engine, times in zip(timed, found, strict=True)
    }
    return Row(name, quantity, samples, seconds.pop("compiled"), seconds)


def markdown(rows: Sequence[Row]) -> str:
    """Return a table with a line for each quantity and a column for each robot: nanoseconds of `compiled` and
    the ratio, for one sample and in a batch."""
    names = list(dict.fromkeys(row.robot for row in rows))
    lines = ["| | " + " | ".join(names) + " |", "|---" * (len(names) + 1) + "|"]
    for quantity in dict.fromkeys(row.quantity for row in rows):
        cells = []
        for name in names:
            pair = [row for row in rows if (row.robot, row.quantity) == (name, quantity)]
            cells.append(
                ", ".join(f"{1e9 * row.compiled:,.0f} ({float(f'{row.ratio:.3g}'):,g}x)" for row in pair)
            )
        lines.append(f"| `{quantity}` | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def check(own: Floats, other: Floats, what: str) -> None:
    """Raise AssertionError where two results differ; the second may be of fewer samples."""
    own = own[: len(other)] if other.ndim == own.ndim and own.ndim and len(other) < len(own) else own
    scale = max(1.0, float(np.max(np.abs(own), initial=0.0)))
    error = float(np.max(np.abs(own - other), initial=0.0)) / scale
    assert error < MIN_AGREEMENT, f"{what} differs by {error:.2g}"


def _call(engine: Backend, quantity: str, samples: int) -> Any:
    """Return a function that evaluates a quantity; a batch of one sample has no batch axis."""
    model, rng = engine.model, np.random.default_rng(0)
    described = QUANTITIES[quantity]
    size = () if samples == 1 else (samples,)
    q = model.random(np.random.default_rng(1), (4096,))[:samples] if samples > 1 else model.random(1)
    values: dict[str, Floats] = {"q": q}
    for argument in described.arguments[1:]:
        values[argument] = rng.uniform(-2.0, 2.0, (4096, model.nv))[:samples].reshape(*size, model.nv)
    frame = (model.frame_names[-1],) if described.of_frame else ()
    method = getattr(engine, quantity)
    arguments = (*values.values(), *frame)
    return lambda: method(*arguments)


if __name__ == "__main__":
    sys.exit(main())
