"""Survey of public MJCF files: which dynx reads, and whether MuJoCo moves the same robot.

    python -m benchmarks.surveys.mjcf_files list SNAPSHOTS > benchmarks/surveys/mjcf_files.tsv
    python -m benchmarks.surveys.mjcf_files run SNAPSHOTS FOLDER [--part develop] [--jobs N] [--seconds LIMIT]

SNAPSHOTS holds a Git directory ``OWNER+NAME`` of each repository of `FILES`. ``list`` takes their files
``.xml`` with a ``<mujoco>``, without MuJoCo's tests of its own parts, and one copy of each text up to white
space. Half of them, by the SHA-256 of repository and path, are to develop on, the other half to measure.

``run`` extracts the files with what they include, checks their SHA-256, and reads each by dynx. MuJoCo, by
itself, compiles it as well, and both evaluate mass matrix, inverse dynamics and the poses of bodies and
sites at a random state. A file counts where MuJoCo compiles it and it has coordinates. One of several robots
is read where `dynx.world.read_scene` reads it.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

import dynx
from benchmarks.surveys.format_files import FormatFiles, Outcome, is_odd, run
from dynx.engines.silence import silence
from dynx.errors import DynxError
from tests.model.mjcf.models import compute
from tests.world.scene.mjcf_scenes import differences as scene_differences

EXACT = 1e-12
"""Largest difference from MuJoCo, relative to the largest entry."""

SINGLE = 1e-6
"""Largest difference where masses follow from meshes, which MuJoCo holds in single precision."""

FILES = FormatFiles(
    Path(__file__).parent / "mjcf_files.tsv",
    (
        "Farama-Foundation/Gymnasium-Robotics",
        "google-deepmind/dm_control",
        "google-deepmind/mujoco",
        "google-deepmind/mujoco_mpc",
        "isaac-sim/mjcf-importer-extension",
        "kevinzakka/mink",
        "mujocolab/mjlab",
        "robfiras/loco-mujoco",
        "steadymingha/mujoco_menagerie",
        "unitreerobotics/unitree_mujoco",
    ),
    (".xml",),
    re.compile(r"<mujoco\b"),
    (".xml", ".stl", ".obj", ".msh", ".png", ".hfield", ".skn", ".bin"),
    lambda repository, path: not is_odd(f"{repository.replace('/', '+')}/{path}"),
    re.compile("^google-deepmind/mujoco/(test|mjx|python|unity)/"),
)


def examine(path: str) -> Outcome:
    """Read a file by dynx and by MuJoCo, and compare."""
    import mujoco

    compiled, message = None, ""
    try:
        with silence():
            compiled = mujoco.MjModel.from_xml_path(path)
    except ValueError as error:
        message = str(error).partition("\n")[0][:300]
    try:
        model = dynx.load(Path(path))
    except DynxError as error:
        if compiled is None or compiled.nv == 0:
            return Outcome(path, "refused, and no robot in MuJoCo", str(error))
        if "read_scene" in str(error):
            return _scene(path, str(error), compiled)
        return Outcome(path, "refused", str(error))
    if compiled is None:
        return Outcome(path, "read, not by MuJoCo", message)
    if compiled.nv != model.nv:
        return Outcome(path, "different", f"MuJoCo has {compiled.nv} coordinates, dynx {model.nv}", 1.0)
    if any(note.message.startswith("align") for note in model.notes):
        return Outcome(path, "read, not compared", "MuJoCo moves the frame of the body")
    difference, quantity = compare(model, compiled)
    if difference <= (SINGLE if compiled.nmesh else EXACT):
        return Outcome(path, "alike", quantity, difference)
    return Outcome(path, "different", quantity, difference)


def _scene(path: str, reason: str, compiled: Any) -> Outcome:
    """Read several robots as a scene, and compare it at its start and at a random state."""
    import mujoco

    from dynx.world import read_scene

    try:
        scene = read_scene(path)
    except DynxError as error:
        return Outcome(path, "refused", f"{reason}; as a scene: {error}")
    differences = scene_differences(mujoco, compiled, scene)
    worst = max(differences, key=differences.__getitem__)
    if differences[worst] <= (SINGLE if compiled.nmesh else EXACT):
        words = f"{len(scene.robots)} robots, {len(scene.bodies)} bodies, {worst}"
        return Outcome(path, "alike as a scene", words, differences[worst])
    return Outcome(path, "different", f"as a scene: {worst}", differences[worst])


def compare(model: dynx.Model, compiled: Any) -> tuple[float, str]:
    """Return the largest relative difference from MuJoCo at a random state, and the quantity."""
    import mujoco

    want = compute(mujoco, compiled, 1, free=model.floating)
    engine = dynx.backend("reference", model)
    pairs = {
        "mass matrix": (engine.mass_matrix(want.q), want.mass_matrix),
        "inverse dynamics": (engine.inverse_dynamics(want.q, want.v, want.a), want.torques),
    }
    mine = dict(zip(model.frame_names, engine.forward_kinematics(want.q), strict=True))
    # A site with the name of a body has another name in dynx, which the body's replaces here.
    for name, theirs in (want.sites | want.bodies).items():
        if name in mine:
            pairs[f"pose of {name}"] = mine[name], theirs
    differences = {
        quantity: float(np.abs(a - b).max(initial=0.0)) / max(float(np.abs(b).max(initial=0.0)), 1e-3)
        for quantity, (a, b) in pairs.items()
    }
    worst = max(differences, key=differences.__getitem__)
    return differences[worst], worst


def counts(outcome: Outcome) -> bool:
    """Check whether MuJoCo compiles a file, with coordinates."""
    return not outcome.word.endswith("MuJoCo")


def main(arguments: Iterable[str] | None = None) -> None:
    """Print the list, or the survey of its files."""
    run(FILES, examine, counts, __doc__ or "", arguments)


if __name__ == "__main__":
    # By its own name, so that worker processes find what they are to run.
    from benchmarks.surveys.mjcf_files import main as run_survey

    run_survey()
