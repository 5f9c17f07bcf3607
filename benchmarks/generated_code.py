"""Batches beside Pinocchio's generated code: ``python -m benchmarks.generated_code ur5 a1:floating``.

Pinocchio evaluates a quantity on the scalars of CppADCodeGen, which writes it as C; gcc compiles it with
``-Ofast -march=native``, and a loop in C calls it for every sample. It is the fastest form in which users of
Pinocchio evaluate one robot. It computes the upper triangle of a mass matrix, dynx the whole.

The command needs g++ and the packages cmeel-cppadcodegen, cmeel-cppad and cmeel-eigen beside `pin`, whose
folder ``--prefix`` names (``.../site-packages/cmeel.prefix``). Building the generator takes some minutes and
4 GB of memory; ``--folder`` keeps it and the generated code. Results are compared before anything is timed.
Times are processor times of one thread for a sample, as medians of rounds in which both run in turn.
"""

from __future__ import annotations

import argparse
import ctypes
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from dynx.backends import backend
from dynx.engines.pinocchio.library import pin
from dynx.model import Model
from dynx.model.loading import load
from dynx.spatial.scalar import Floats

QUANTITIES = ("inverse_dynamics", "mass_matrix")
SAMPLES = 4096
ROUNDS = 30
TOLERANCE = 1e-9
"""Largest difference, relative to the largest entry."""
SOURCE = Path(__file__).parent / "libraries" / "generated_code.cpp"


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
    y = np.zeros((SAMPLES, nv * (nv + 1) // 2 if quantity == "mass_matrix" else nv))
    addresses = [ctypes.c_void_p(array.ctypes.data) for array in (x, y)]

    def theirs(_alive: object = (x, y)) -> None:
        library.all(ctypes.c_long(SAMPLES), *addresses)

    robot = backend("compiled", model, threads=1)
    arguments: tuple[Floats, ...] = (q,) if quantity == "mass_matrix" else (q, v, last)
    out = np.zeros((SAMPLES, nv, nv) if quantity == "mass_matrix" else (SAMPLES, nv))
    function = getattr(robot, quantity)

    def ours() -> None:
        function(*arguments, out=out)

    theirs()
    ours()
    upper = (slice(None), *np.triu_indices(nv))
    found = out[upper] if quantity == "mass_matrix" else out
    difference = float(np.abs(found - y).max() / np.abs(y).max())
    if not difference <= TOLERANCE:
        raise SystemExit(f"{quantity}: results differ by {difference:.1e} of the largest entry")
    return {"generated C": theirs, "dynx": ours}


def main(arguments: Sequence[str] | None = None) -> int:
    """Print a line for each robot and quantity."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.generated_code", description=__doc__)
    parser.add_argument("robots", nargs="+", metavar="ROBOT[:floating]")
    parser.add_argument("--prefix", type=Path, default=Path(pin.__file__).parents[4], help="cmeel.prefix")
    parser.add_argument("--folder", type=Path, help="of what is built (default: a temporary folder)")
    parser.add_argument("--quantity", choices=QUANTITIES, action="append", help="default: all")
    options = parser.parse_args(arguments)
    if not (options.prefix / "include" / "cppad" / "cg.hpp").exists():
        print(f"{options.prefix} lacks CppADCodeGen: pip install cmeel-cppadcodegen cmeel-cppad cmeel-eigen")
        return 2
    with tempfile.TemporaryDirectory() as temporary:
        folder = options.folder or Path(temporary)
        program = build_generator(folder, options.prefix)
        for name in options.robots:
            robot, _, base = name.partition(":")
            model = load(robot, base="floating" if base == "floating" else "fixed")
            for quantity in options.quantity or QUANTITIES:
                both = calls(generated(folder, program, name, model, quantity), model, quantity)
                spent: dict[str, list[float]] = {each: [] for each in both}
                for _ in range(ROUNDS):
                    for each, call in both.items():
                        start = time.thread_time()
                        call()
                        spent[each].append(1e9 * (time.thread_time() - start) / SAMPLES)
                theirs, ours = (float(np.median(spent[each])) for each in both)
                print(
                    f"{name} {quantity}: generated C {theirs:.0f} ns, dynx {ours:.0f} ns, "
                    f"ratio {theirs / ours:.1f}",
                    flush=True,
                )
    return 0


if __name__ == "__main__":
    sys.exit(main())
