"""Write the tables of docs/results.md: how fast dynx and other libraries are, measured on this machine.

    python -m docs.write_results                    # every table, which takes about a quarter of an hour
    python -m docs.write_results simulation calls   # these tables

Each table has the command that measured it, the day, the processor, its load and the versions beside it. A
table whose command fails, or needs a library that is not installed, is left as it stands; the exit code is
then 1. The text between the tables is kept.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from docs.page_parts import LIBRARIES, conditions, replaced, table, two_digits
from dynx.bench.machine import load

PAGE = Path(__file__).with_name("results.md")
PEERS = (*LIBRARIES, "casadi", "adam-robotics", "frax", "jax")
BATCHES = ("--batch", "65536", "--threads", "1")
SIZES = (1, 8, 1000, 65536)

Render = Callable[[Sequence[str]], str]


def text_blocks(outputs: Sequence[str]) -> str:
    """Return outputs of commands as they are printed, each as a block."""
    return "\n".join(f"```text\n{output.rstrip()}\n```\n" for output in outputs)


def printed_tables(outputs: Sequence[str]) -> str:
    """Return the tables in Markdown that commands print, without the lines around them."""
    lines = [line for output in outputs for line in output.splitlines()]
    kept = [line if line.startswith("|") else "" for line in lines]
    return (
        "".join(
            f"{line}\n" for line, before in zip(kept, ["", *kept], strict=False) if line or before
        ).rstrip("\n")
        + "\n"
    )


def calls_table(outputs: Sequence[str]) -> str:
    """Return the table of `benchmarks.call_overhead`: a row for each quantity, a column for each engine."""
    times: dict[str, dict[str, str]] = {}
    for line in outputs[0].splitlines()[1:]:
        engine, *words, binding, _, more, _ = line.removesuffix("OVER").split()
        sign = "-" if more.startswith("-") else "+"
        times.setdefault(" ".join(words), {})[engine] = f"{binding} {sign} {more.lstrip('-')}"
    engines = list(dict.fromkeys(engine for row in times.values() for engine in row))
    rows = [(f"`{name}`", *(row.get(each, "") for each in engines)) for name, row in times.items()]
    return table(("[ns]", *engines), rows)


def batches_table(outputs: Sequence[str]) -> str:
    """Return the table of large batches: a row for each robot and quantity."""
    rows = []
    peers = ("pinocchio C++ batch", "pinocchio binding", "pinocchio C++ call")
    for document in map(json.loads, outputs):
        for result in document["results"]:
            ways = {way["way"]: way for way in result["ways"]}
            own = ways["compiled"]
            roof = own["roofline"]
            shares = f"{roof['memory_share']:.0%} / {roof['arithmetic_share']:.0%}" if roof else ""
            cells = (peer_cell(ways.get(name), own["ns"]) for name in peers)
            name = result["quantity"].replace("_", " ")
            rows.append((document["robot"], name, f"{own['ns']:.0f}", *cells, shares))
    heads = ("Pinocchio's C++ batch", "Pinocchio's binding in a loop", "C++ part of a call")
    return table(("robot", "quantity", "`compiled` [ns]", *heads, "bandwidth / arithmetic"), rows)


def peer_cell(way: dict[str, Any] | None, own: float) -> str:
    """Return the time of a peer [ns], and how many times the time of `compiled` it is."""
    if way is None or way["ns"] is None:
        return ""
    return f"{way['ns']:.0f} ({way['ns'] / own:.0f}x)"


def backend_tables(outputs: Sequence[str]) -> str:
    """Return the tables of backends: time over that of `compiled`, and microseconds by batch size."""
    document = json.loads(outputs[0])
    found = {
        (result["quantity"], result["batch"], way["way"]): way["ns"]
        for result in document["results"]
        for way in result["ways"]
        if way["role"] == "backend" and way["ns"] is not None
    }
    names = list(dict.fromkeys(name for *_, name in found))
    names.sort(key=lambda name: name != "compiled")
    quantities = list(dict.fromkeys(quantity for quantity, *_ in found))
    largest = max(SIZES)
    ratios = [
        (
            quantity.replace("_", " "),
            *(
                ratio_cell(found, (quantity, largest, name), found[quantity, largest, "compiled"])
                for name in names[1:]
            ),
        )
        for quantity in quantities
    ]
    sizes = [
        (f"{size:,}", *(ratio_cell(found, ("inverse_dynamics", size, name), 1e3) for name in names))
        for size in SIZES
    ]
    heads = [f"`{name}`" for name in names]
    return (
        f"Time divided by the time of `compiled`, {largest:,} samples:\n\n"
        + table(("", *heads[1:]), ratios)
        + "\nInverse dynamics, microseconds per sample:\n\n"
        + table(("samples in a call", *heads), sizes)
    )


def ratio_cell(found: dict[tuple[str, int, str], float], key: tuple[str, int, str], unit: float) -> str:
    """Return a time over another one in two significant digits; empty where it was not measured."""
    return two_digits(found[key] / unit) if key in found else ""


def longest_compile_times(outputs: Sequence[str]) -> str:
    """Return the head and the summary of `benchmarks.compile_times`, which lists the longest times."""
    head, *lines = outputs[0].splitlines()
    start = next(k for k, line in enumerate(lines) if " rows, " in line)
    return text_blocks(["\n".join([lines[start], head, *lines[start + 1 :]])])


@dataclass(frozen=True)
class Part:
    """A part of the page: the commands that measure it, and the function that makes text of their outputs."""

    commands: tuple[tuple[str, ...], ...]
    """Arguments of Python: a module and its options."""
    render: Render = text_blocks
    libraries: Sequence[str] = LIBRARIES
    """Distributions whose versions the part names."""
    json: bool = False
    """Whether the commands write a document to the standard output, if asked by ``--json``."""


def bench(robot: str, *options: str) -> tuple[str, ...]:
    """Return a command of ``dynx bench``."""
    return ("dynx", "bench", robot, *options)


PARTS = {
    "calls": Part((("benchmarks.call_overhead",),), calls_table),
    "batches": Part(
        tuple(bench(robot, "--engine", "compiled", *BATCHES) for robot in ("ur5", "panda", "talos")),
        batches_table,
        json=True,
    ),
    "sizes": Part((("benchmarks.batch_sizes",),)),
    "backends": Part(
        (bench("ur5", *(text for size in SIZES for text in ("--batch", str(size))), "--threads", "1"),),
        backend_tables,
        json=True,
    ),
    "quantities": Part((("benchmarks.every_quantity", "--markdown"),), printed_tables),
    "peers": Part(
        (
            ("benchmarks.compare", "ur5", "--threads", "1", "--repetitions", "5"),
            ("benchmarks.compare", "panda", "--threads", "1", "--repetitions", "5"),
        ),
        libraries=PEERS,
    ),
    "inverse_kinematics": Part(
        (("benchmarks.inverse_kinematics",),), libraries=(*LIBRARIES, "roboticstoolbox-python")
    ),
    "closed_form": Part(
        (("benchmarks.closed_form",),), printed_tables, libraries=(*LIBRARIES, "EAIK", "ssik")
    ),
    "tracking": Part((("benchmarks.kinematics.tracking", "--paths", "20"),), printed_tables),
    "simulation": Part((("benchmarks.simulation",),), printed_tables),
    "dry_friction": Part((("benchmarks.dry_friction", "--batch"),)),
    "integrators": Part((("benchmarks.integrators",),)),
    "environments": Part(
        (("benchmarks.environments", "--repetitions", "3"),),
        printed_tables,
        libraries=(*LIBRARIES, "gymnasium", "envpool"),
    ),
    "compile_times": Part(
        (("benchmarks.compile_times", "--robots", "tiago_dual", "tiago", "--bases", "floating"),),
        longest_compile_times,
    ),
    "many_joints": Part((("benchmarks.many_joints",),)),
}


class CommandFailedError(Exception):
    """A command that measured nothing."""


def measured(part: Part) -> str:
    """Return the text of a part: its commands, the conditions and the results."""
    before, began = load(), time.monotonic()
    outputs = [output_of((*command, "--json", "-") if part.json else command) for command in part.commands]
    text = part.render(outputs)
    commands = "".join(f"    {shown(command)}\n" for command in part.commands)
    return f"{commands}\n{conditions(time.monotonic() - began, before, part.libraries)}\n{text}"


def shown(command: Sequence[str]) -> str:
    """Return a command as a user types it."""
    return " ".join(command if command[0] == "dynx" else ("python", "-m", *command))


def output_of(command: Sequence[str]) -> str:
    """Return what a command prints. An exit code of 1 is a result: a bound of the benchmark is not met."""
    call = [sys.executable, "-m", *command]
    done = subprocess.run(call, check=False, capture_output=True, text=True)
    if done.returncode not in (0, 1) or not done.stdout.strip() or "Traceback" in done.stderr:
        last = done.stderr.strip().splitlines()
        raise CommandFailedError(f"{shown(command)}: {last[-1] if last else 'no output'}")
    return done.stdout


def main(arguments: Sequence[str]) -> int:
    """Measure the parts that are named, or all; return the exit code."""
    parser = argparse.ArgumentParser(prog="python -m docs.write_results", description=__doc__)
    parser.add_argument("parts", nargs="*", metavar="PART", help=f"one of {', '.join(PARTS)}; default: all")
    names = parser.parse_args(arguments).parts
    unknown = [name for name in names if name not in PARTS]
    if unknown:
        parser.error(f"no part {', '.join(unknown)}; known are {', '.join(PARTS)}")
    failed = False
    for name in names or PARTS:
        print(f"{name} ...", file=sys.stderr, flush=True)
        try:
            part = measured(PARTS[name])
        except CommandFailedError as error:
            print(f"{name} is left as it stands: {error}", file=sys.stderr)
            failed = True
            continue
        PAGE.write_text(replaced(PAGE, PAGE.read_text(encoding="utf-8"), name, part), encoding="utf-8")
    return int(failed)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
