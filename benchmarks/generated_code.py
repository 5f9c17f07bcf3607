"""Batches beside Pinocchio's generated code: ``python -m benchmarks.generated_code ur5 a1:floating``.

Pinocchio evaluates a quantity on the scalars of CppADCodeGen, which writes it as C; gcc compiles it with
``-Ofast -march=native``, and a loop in C calls it for every sample. It is the fastest form in which users of
Pinocchio evaluate one robot. It computes the upper triangle of a symmetric matrix, dynx the whole.

The command needs g++, gcc and the packages cmeel-cppadcodegen, cmeel-cppad and cmeel-eigen beside `pin`,
whose folder ``--prefix`` names (``.../site-packages/cmeel.prefix``). Building the generator takes some
minutes and 4 GB of memory; ``--folder`` keeps it and the generated code. Results are compared before anything
is timed. Times are processor times of one thread for a sample, as medians of rounds in which both run in
turn. The ratio is the median of the ratios of the rounds. The last line has the time of a mass matrix over
that of inverse dynamics for each robot.
"""

from __future__ import annotations

import argparse
import ctypes
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Literal

import numpy as np

from dynx.backends import backend
from dynx.compiled.derivatives import Derivatives
from dynx.engines.pinocchio.library import pin
from dynx.model import Model
from dynx.model.loading import load
from dynx.spatial.scalar import Floats

QUANTITIES = (
    "inverse_dynamics",
    "forward_dynamics",
    "mass_matrix",
    "inverse_dynamics_derivatives",
    "forward_dynamics_derivatives",
)
SYMMETRIC = ("mass_matrix", "dtau_da", "da_dtau")
"""Results of which the generated code computes the upper triangle."""
ROBOTS = ("ur5", "panda", "a1:floating", "go2:floating", "talos:floating", "g1:floating")
LOCKED = {"panda": {"panda_finger_joint1": 0.02, "panda_finger_joint2": 0.02}}
"""Positions [m] of locked joints, of which one mimics the other."""
SAMPLES = 4096
ROUNDS = 30
TOLERANCE = 1e-9
"""Largest difference, relative to the largest entry of the result."""
SOURCE = Path(__file__).parent / "libraries" / "generated_code.cpp"

PACKAGES = {
    "cmeel-cppadcodegen": "cppad/cg.hpp",
    "cmeel-cppad": "cppad/cppad.hpp",
    "cmeel-eigen": "eigen3/Eigen/Core",
    "pin": "pinocchio/codegen/cppadcg.hpp",
}
"""A header of each package that the generator is built from."""


def missing(prefix: Path) -> str:
    """Return what the command needs and does not find, or an empty text."""
    programs = [program for program in ("g++", "gcc") if shutil.which(program) is None]
    packages = [name for name, header in PACKAGES.items() if not (prefix / "include" / header).exists()]
    found = [f"no {' and no '.join(programs)} in the search path"] if programs else []
    if packages:
        found.append(f"{prefix} lacks headers: pip install {' '.join(packages)}")
    return "; ".join(found)


def robot_named(text: str) -> Model:
    """Return a robot by its name, which may end with ``:floating``. Joints that mimic others are locked,
    since Pinocchio's model has none."""
    name, _, base = text.partition(":")
    kind: Literal["fixed", "floating"] = "floating" if base == "floating" else "fixed"
    return load(name, base=kind, lock=LOCKED.get(name))


def build_generator(folder: Path, prefix: Path) -> Path:
    """Return the program that writes C code, built if it is not there."""
    program = folder / "generate"
    if not program.exists():
        include, lib = prefix / "include", prefix / "lib"
        command = [
            "g++",
            "-O0",
            "-DNDEBUG",
            "-std=c++17",
            f"-I{include}",
            f"-I{include / 'eigen3'}",
            str(SOURCE),
        ]
        command += ["-o", str(program), f"-L{lib}", f"-Wl,-rpath,{lib}", "-lpinocchio_default"]
        subprocess.run([*command, "-lboost_serialization", "-lcppad_lib", "-ldl"], check=True)
    return program


def generated(folder: Path, program: Path, name: str, model: Model, quantity: str) -> ctypes.CDLL:
    """Return the compiled C code of a quantity."""
    stem = folder / f"{name.replace(':', '_')}_{quantity}"
    library = stem.with_suffix(".so")
    if not library.exists():
        parts = vars(backend("pinocchio", model)).values()
        description = stem.with_suffix(".txt")
        next(part for part in parts if isinstance(part, pin.Model)).saveToText(str(description))
        code = stem.with_suffix(".c")
        subprocess.run([str(program), str(description), quantity, str(code)], check=True)
        options = ["-Ofast", "-march=native", "-shared", "-fPIC"]
        subprocess.run(["gcc", *options, str(code), "-o", str(library)], check=True)
    return ctypes.CDLL(str(library))


def calls(library: ctypes.CDLL, model: Model, quantity: str) -> dict[str, Callable[[], object]]:
    """Return a call of each for the same samples, after a comparison of the results."""
    rng, nv = np.random.default_rng(0), model.nv
    q = np.stack([model.random(rng) for _ in range(SAMPLES)])
    v, last = rng.uniform(-1.0, 1.0, (2, SAMPLES, nv))
    x = np.concatenate([q, v, last], axis=1)
    ours = own_call(model, quantity, q, v, last)
    expected = [columns(name, result) for name, result in ours().items()]
    y = np.zeros((SAMPLES, sum(column.shape[1] for column in expected)))
    addresses = [ctypes.c_void_p(array.ctypes.data) for array in (x, y)]

    def theirs(_alive: object = (x, y)) -> None:
        library.all(ctypes.c_long(SAMPLES), *addresses)

    theirs()
    first = 0
    for result in expected:
        end = first + result.shape[1]
        difference = float(np.abs(y[:, first:end] - result).max() / np.abs(result).max())
        if not difference <= TOLERANCE:
            raise SystemExit(f"{quantity}: results differ by {difference:.1e} of the largest entry")
        first = end
    return {"generated C": theirs, "dynx": ours}


def own_call(
    model: Model, quantity: str, q: Floats, v: Floats, last: Floats
) -> Callable[[], dict[str, Floats]]:
    """Return a call of dynx, which returns its results by name."""
    if quantity.endswith("_derivatives"):
        derivatives = getattr(Derivatives(model, threads=1), quantity)
        return lambda: derivatives(q, v, last)._asdict()
    function = getattr(backend("compiled", model, threads=1), quantity)
    arguments = (q,) if quantity == "mass_matrix" else (q, v, last)
    out = np.zeros((SAMPLES, *([model.nv] * (2 if quantity == "mass_matrix" else 1))))
    return lambda: {quantity: function(*arguments, out=out)}


def columns(name: str, result: Floats) -> Floats:
    """Return the entries (samples, n) of a result in the order of the generated code."""
    rows, others = np.triu_indices(result.shape[-1])
    return result[:, rows, others] if name in SYMMETRIC else result.reshape(SAMPLES, -1)


def timed(both: dict[str, Callable[[], object]]) -> Floats:
    """Return the times of the rounds for a sample [ns], a column for each implementation."""
    spent = np.empty((ROUNDS, len(both)))
    for row in spent:
        for k, call in enumerate(both.values()):
            start = time.thread_time()
            call()
            row[k] = 1e9 * (time.thread_time() - start) / SAMPLES
    return spent


def main(arguments: Sequence[str] | None = None) -> int:
    """Print a table with a row for each robot and quantity; return 1 if there is no code for one, and 2 if
    something that the command needs is missing."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.generated_code", description=__doc__)
    parser.add_argument("robots", nargs="*", metavar="ROBOT[:floating]", default=ROBOTS)
    parser.add_argument("--prefix", type=Path, default=Path(pin.__file__).parents[4], help="cmeel.prefix")
    parser.add_argument("--folder", type=Path, help="of what is built (default: a temporary folder)")
    parser.add_argument("--quantity", choices=QUANTITIES, action="append", help="default: all")
    options = parser.parse_args(arguments)
    if lacking := missing(options.prefix):
        print(lacking, file=sys.stderr)
        return 2
    models = {name: robot_named(name) for name in options.robots}
    if coupled := [name for name, model in models.items() if model.mechanism.coupling is not None]:
        print(
            f"joints that mimic others are not in Pinocchio's model of {', '.join(coupled)}", file=sys.stderr
        )
        return 2
    shares, failed = [], False
    print("| robot | quantity | generated C [ns] | dynx [ns] | ratio |\n|---|---|---|---|---|", flush=True)
    with tempfile.TemporaryDirectory() as temporary:
        folder = options.folder or Path(temporary)
        program = build_generator(folder, options.prefix)
        for name, model in models.items():
            own: dict[str, float] = {}
            for quantity in options.quantity or QUANTITIES:
                try:
                    library = generated(folder, program, name, model, quantity)
                except subprocess.CalledProcessError as error:
                    print(f"no code for {quantity} of {name}: {error}", file=sys.stderr)
                    failed = True
                    continue
                spent = timed(calls(library, model, quantity))
                theirs, own[quantity] = np.median(spent, axis=0).tolist()
                ratio = float(np.median(spent[:, 0] / spent[:, 1]))
                row = (name.replace(":", ", "), quantity.replace("_", " "), f"{theirs:,.0f}")
                print(f"| {' | '.join(row)} | {own[quantity]:,.0f} | {ratio:.1f} |", flush=True)
            if {"mass_matrix", "inverse_dynamics"} <= own.keys():
                shares.append(f"{name.partition(':')[0]} {own['mass_matrix'] / own['inverse_dynamics']:.1f}")
    if shares:
        print(f"time of a mass matrix over that of inverse dynamics: {', '.join(shares)}")
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
