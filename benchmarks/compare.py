"""The compiled backend beside its peers, as a table: ``python -m benchmarks.compare ur5 --threads 1``.

Every way answers first and is checked against the backend `reference`; then each repetition calls all of
them in turn. Peers take the batch as a user has it, row-major doubles of NumPy. The time that a peer takes to
compile is a column of its own.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Sequence

from benchmarks.compiling_peer import CompilingPeer
from benchmarks.jax_peers import JaxPeer, OnDevice
from benchmarks.peers import COMPILED, FRAMES, WAYS, make_way
from dynx.bench.cases import ARGUMENTS, Work, draw_batch
from dynx.bench.implementations import Way
from dynx.bench.measurement import Measurement, measure
from dynx.errors import DynxError
from dynx.model import Model
from dynx.model.loading import load

LOCKED = {"panda": {"panda_finger_joint1": 0.02, "panda_finger_joint2": 0.02}}
"""Joints that are locked for all ways alike, since one follows the other, which some do not know [m]."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Print a table for each quantity; 1 where a peer is faster than dynx."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("robot", choices=FRAMES)
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--batch", type=int, default=65536)
    parser.add_argument("--repetitions", type=int, default=20)
    parser.add_argument("--quantity", action="append", choices=list(ARGUMENTS))
    parser.add_argument("--without", action="append", default=[], choices=list(WAYS), help="leave out a peer")
    asked = parser.parse_args(arguments)
    model = load(asked.robot, lock=LOCKED.get(asked.robot))
    batch = draw_batch(model, FRAMES[asked.robot], asked.batch)
    beaten = []
    ways, absent = ways_of(model, asked.threads, asked.without)
    for reason in absent:
        print(reason)
    for quantity in asked.quantity or ARGUMENTS:
        work = Work(quantity, asked.batch, asked.threads)
        able = [way for way in ways if way.does(work) and quantity in WAYS.get(way.name, ARGUMENTS)]
        found = measure(work, able, batch, asked.repetitions)
        print(f"\n{quantity}, {asked.robot}, threads {asked.threads}\n")
        print(*table(found, able), sep="\n", flush=True)
        left_out = [way.name for way in ways if way not in able]
        print(*(f"- does not do this: {name}" for name in left_out), sep="\n", flush=True)
        beaten += faster_than_dynx(found)
    print(*(f"faster than dynx: {each.way}, {each.work.quantity}" for each in beaten), sep="\n")
    return 1 if beaten else 0


def ways_of(model: Model, threads: int, without: Sequence[str] = ()) -> tuple[list[Way], list[str]]:
    """All ways that can be made, dynx first, and why the others cannot."""
    ways: list[Way] = []
    absent = []
    for name in WAYS:
        if name in without:
            continue
        try:
            way = make_way(model, name, threads)
        except DynxError as reason:
            absent.append(f"{name}: {reason}")
            continue
        ways.append(way)
        if isinstance(way, JaxPeer):
            ways.append(OnDevice(way))
    return ways, absent


def table(found: Sequence[Measurement], ways: Sequence[Way]) -> Iterator[str]:
    """Lines of Markdown, the fastest way first."""
    compiling = {way.name: way.compile_seconds for way in ways if isinstance(way, CompilingPeer)}
    dynx = next((each.times.median for each in found if each.way == COMPILED and each.times), float("nan"))
    yield "| way | threads | samples | ns a sample | times dynx | compiling [s] |"
    yield "|---|---|---|---|---|---|"
    for each in sorted(found, key=lambda one: one.times.median if one.times else float("inf")):
        if each.times is None:
            yield f"| {each.way} | {each.threads} | | {each.problem} | | |"
            continue
        ns, ratio = 1e9 * each.times.median, each.times.median / dynx
        seconds = f"{compiling[each.way]:.1f}" if each.way in compiling else ""
        yield f"| {each.way} | {each.threads} | {each.samples} | {ns:.0f} | {ratio:.3g} | {seconds} |"


def faster_than_dynx(found: Sequence[Measurement]) -> list[Measurement]:
    """The peers that took less time than the compiled backend."""
    times = {each.way: each.times.median for each in found if each.times is not None}
    return [each for each in found if times.get(each.way, float("inf")) < times.get(COMPILED, float("inf"))]


if __name__ == "__main__":
    sys.exit(main())
