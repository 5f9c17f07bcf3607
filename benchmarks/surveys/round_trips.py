"""Robots of example-robot-data from URDF to MJCF, SDF and back, compared with the file that they came from.

    python -m benchmarks.surveys.round_trips [--without-shapes] [ROBOT]...

Each robot is converted to MJCF with its meshes, the document is loaded from a folder and converted to SDF,
that is loaded and converted to URDF, and that is loaded. A robot is *equal* if names, joints, inertias,
limits, coefficients and frames are the same to 1e-12, all shapes are there (`dynx.model.conversion`), and
`dynx.same_robot` certifies that both files say one robot in every state. Beside it stand the largest relative
differences of mass matrix, bias and poses at random states, and whether MuJoCo compiles the MJCF and Drake
loads the SDF.
"""

from __future__ import annotations

import logging
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

import dynx
from dynx.errors import DynxError
from dynx.model import Model
from dynx.model.conversion import convert, robot_differences, shape_differences, without_shapes
from dynx.model.library import robots
from dynx.same import same_robot

EMPTY = "ur_description_ur3"
"""A file without links."""

SAMPLES = 3

LOADED = "loaded"
"""Result of an engine that accepts a document."""


def main() -> int:
    """Print a line for each robot and the counts; return 1 if fewer than 64 are equal."""
    shapes = "--without-shapes" not in sys.argv
    names = [each for each in sys.argv[1:] if not each.startswith("-")] or [
        entry.name for entry in robots() if entry.source == "example-robot-data"
    ]
    counts = {"equal": 0, "equal but for shapes": 0, "different": 0, "refused": 0}
    loaded, largest = [0, 0], 0.0
    for name in names:
        if name == EMPTY:
            continue
        with TemporaryDirectory() as folder:
            try:
                verdict, words, error, engines = round_trip(name, Path(folder), shapes=shapes)
            except DynxError as refusal:
                verdict, words, error, engines = "refused", str(refusal), 0.0, ("-", "-")
        counts[verdict] += 1
        loaded = [count + (each == LOADED) for count, each in zip(loaded, engines, strict=True)]
        largest = max(largest, error)
        print(f"{name:32} {verdict:22} {error:8.1e}  {' | '.join(engines):20}  {words}"[:300], flush=True)
    print(", ".join(f"{count} {word}" for word, count in counts.items()))
    print(f"{loaded[0]} compiled by MuJoCo, {loaded[1]} loaded by Drake; ", end="")
    print(f"largest difference at random states {largest:.1e}")
    return 0 if counts["equal"] >= 64 or len(names) < 64 else 1


def round_trip(name: str, folder: Path, *, shapes: bool) -> tuple[str, str, float, tuple[str, str]]:
    """Return the verdict, the first difference, the largest one at random states, and what MuJoCo and Drake
    do."""
    model = dynx.load(name)
    if not shapes:
        model = without_shapes(model)
    first = convert(model, "mjcf", "first")
    first.write(folder / "first.xml")
    second = convert(dynx.load(folder / "first.xml"), "sdf", "second")
    second.write(folder / "second.sdf")
    third = convert(dynx.load(folder / "second.sdf"), "urdf", "third")
    third.write(folder / "third.urdf")
    back = dynx.load(folder / "third.urdf")
    found = [*robot_differences(model, back)]
    certificate = same_robot(model, back)
    if not certificate.same:
        found += [each.message for each in certificate.unmatched]
        found += [each.message for each in certificate.differences]
    of_shapes = [*shape_differences(model, back)]
    verdict = "different" if found else "equal but for shapes" if of_shapes else "equal"
    engines = compile_by_mujoco(folder / "first.xml"), load_by_drake(folder / "second.sdf")
    return verdict, (found or of_shapes or [""])[0], state_difference(model, back), engines


def state_difference(model: Model, back: Model) -> float:
    """Return the largest relative difference of mass matrix, bias and poses."""
    rng = np.random.default_rng(0)
    engines = [dynx.backend("reference", each) for each in (model, back)]
    largest = 0.0
    for _ in range(SAMPLES):
        q, v = model.random(rng), rng.normal(size=model.nv)
        first, second = (
            (each.mass_matrix(q), each.bias_torque(q, v), each.forward_kinematics(q)) for each in engines
        )
        for want, got in zip(first, second, strict=True):
            largest = max(
                largest, float(np.abs(got - want).max(initial=0.0) / np.abs(want).max(initial=1e-9))
            )
    return largest


def compile_by_mujoco(path: Path) -> str:
    """Return whether MuJoCo compiles the document."""
    import mujoco

    try:
        mujoco.MjModel.from_xml_path(str(path))
    except ValueError as error:
        return " ".join(str(error).split())[:80]
    return LOADED


def load_by_drake(path: Path) -> str:
    """Return whether Drake loads the document, with its shapes."""
    from pydrake.geometry import SceneGraph
    from pydrake.multibody.parsing import Parser
    from pydrake.multibody.plant import MultibodyPlant

    plant = MultibodyPlant(0.0)
    # The plant does not keep it alive.
    shapes = SceneGraph()
    plant.RegisterAsSourceForSceneGraph(shapes)
    # It warns of each element of another program.
    logging.getLogger("drake").setLevel(logging.ERROR)
    try:
        Parser(plant).AddModels(path)
        plant.Finalize()
    except RuntimeError as error:
        return " ".join(str(error).split())[:80]
    return LOADED


if __name__ == "__main__":
    sys.exit(main())
