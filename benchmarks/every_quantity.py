"""Every quantity of several robots, by each engine: ``python -m benchmarks.every_quantity``.

Each engine is called through dynx, with checked arguments: one sample, and a batch. The result of `compiled`
is compared with that of each engine first. The table gives nanoseconds per sample of `compiled`, the fastest
other engine, and how many times its time that engine takes. A ratio below 1 ends the command with 1.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from benchmarks.progress import tell
from dynx.backends import Backend, backend, installed_backends
from dynx.backends.quantities import QUANTITIES
from dynx.bench.timing import interleaved
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
    """Return the robots by the names of the option ``--robot``."""
    return {
        "ur5": load("ur5"),
        "panda": load("panda"),
        "a1": load("a1", base="floating"),
        "talos": load("talos", base="floating"),
        "serial64": serial_arm(64),
        "tree101": tree(101),
    }


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the table; return 1 if another engine was faster than `compiled`, or their results differ."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.every_quantity", description=__doc__)
    parser.add_argument("--robot", action="append", choices=list(robots()), help="default: all")
    parser.add_argument("--quantity", action="append", choices=list(QUANTITIES), help="default: all")
    parser.add_argument("--batch", type=int, default=4096, help="samples in a batch (default 4096)")
    parser.add_argument("--repetitions", type=int, default=7)
    chosen = parser.parse_args(arguments)
    slower = False
    print(f"{'robot':10}{'quantity':26}{'samples':>8}{'compiled':>12}{'best other':>12}  {'':10}{'ratio':>7}")
    for name, model in robots().items():
        if chosen.robot and name not in chosen.robot:
            continue
        for quantity in chosen.quantity or QUANTITIES:
            for row in measure(name, model, quantity, chosen.batch, chosen.repetitions):
                slower |= row.ratio < 1.0
                print(
                    f"{name:10}{quantity:26}{row.samples:8}{1e9 * row.compiled:12,.0f}"
                    f"{1e9 * row.others[row.best]:12,.0f}  {row.best:10}{row.ratio:7.2f}"
                    f"{'  SLOWER' if row.ratio < 1.0 else ''}",
                    flush=True,
                )
    return 1 if slower else 0


def measure(name: str, model: Model, quantity: str, batch: int, repetitions: int) -> Iterator[Row]:
    """Yield the times of one sample and of a batch."""
    result_bytes = 8 * int(np.prod(QUANTITIES[quantity].shape_of(model)))
    for samples in (1, max(1, min(batch, MAX_RESULT_BYTES // result_bytes))):
        tell(f"{name}, {quantity}, {samples} samples")
        engines = {"compiled": _call(backend("compiled", model, threads=1), quantity, samples)}
        counts = {"compiled": samples}
        for engine in ENGINES:
            if engine not in installed_backends():
                continue
            counts[engine] = min(samples, MAX_SAMPLES_OF_A_LOOP)
            try:
                engines[engine] = _call(backend(engine, model), quantity, counts[engine])
                check(engines["compiled"](), engines[engine](), f"{name}, {quantity}: {engine}")
            except DynxError as error:
                engines.pop(engine, None)
                tell(f"{name}, {quantity}: {engine} is left out: {error}")
        found = interleaved(list(engines.values()), repetitions)
        seconds = {
            engine: min(times.seconds) / counts[engine] for engine, times in zip(engines, found, strict=True)
        }
        tell("")
        yield Row(name, quantity, samples, seconds.pop("compiled"), seconds)


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
