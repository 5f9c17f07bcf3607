"""``python -m benchmarks.surveys.written_sdf [ROBOT]...``: robots written as SDF, parsed by Drake alone.

Each robot of the library, fixed and free, is written by `Model.to_sdf` without its shapes. Drake parses the
text; mass matrix, bias and the poses of all links at random states are compared with those of the robot. An
inertia that no body has, which Drake replaces, is left out of the robot and counted. The exit code is 1 if a
difference is above 1e-12 of the largest entry.
"""

from __future__ import annotations

import re
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import dynx
from benchmarks.surveys.raw_drake_sdf import DrakeRobot
from benchmarks.surveys.sdf_files import EXACT, compare
from dynx.errors import DynxError
from dynx.model import Model
from dynx.model.conversion import without_shapes
from dynx.model.library import robots
from dynx.model.sdf.extension import NAME
from dynx.model.urdf.reader import inertia_fault


def main() -> int:
    """Print a line for each robot and base, and the counts; return 1 if one differs."""
    names = sys.argv[1:] or [entry.name for entry in robots()]
    alike, differing, others, largest = 0, 0, 0, 0.0
    with tempfile.TemporaryDirectory() as folder:
        for name in names:
            try:
                model, replaced = with_possible_inertias(without_shapes(dynx.load(name)))
            except DynxError as error:
                print(f"{name:30} not loaded: {error}"[:150], flush=True)
                continue
            for base in ("fixed", "floating"):
                try:
                    found, what = examine(
                        model.with_base("fixed" if base == "fixed" else "floating"), Path(folder)
                    )
                except (RuntimeError, KeyError, ValueError) as error:
                    others += 1
                    print(f"{name:30} {base:9} not compared: {error}"[:150], flush=True)
                    continue
                alike, differing = alike + (found <= EXACT), differing + (found > EXACT)
                largest = max(largest, found)
                note = f"{replaced} inertias left out" if replaced else ""
                print(f"{name:30} {base:9} {found:8.1e}  {what:20} {note}", flush=True)
    print(f"{alike} alike, {differing} different, {others} not compared; largest difference {largest:.1e}")
    return int(differing > 0)


def with_possible_inertias(model: Model) -> tuple[Model, int]:
    """Return a robot without the inertias that no body has, and their number."""
    faulty = {link.name for link in model.links if link.inertial is not None and inertia_fault(link.inertial)}
    links = tuple(replace(each, inertial=None) if each.name in faulty else each for each in model.links)
    return replace(model, links=links), len(faulty)


def examine(model: Model, folder: Path) -> tuple[float, str]:
    """Return the largest relative difference of Drake from a robot, and the quantity."""
    path = folder / "robot.sdf"
    path.write_text(model.to_sdf(), encoding="utf-8")
    return compare(with_names_of_document(model), DrakeRobot(path))


def with_names_of_document(model: Model) -> Model:
    """Return a robot whose parts have the names that they have in SDF, which Drake reads."""
    text = model.to_sdf()
    return dynx.load(re.sub(f"<{NAME}>.*?</{NAME}>", "", text)) if NAME in text else model


if __name__ == "__main__":
    sys.exit(main())
