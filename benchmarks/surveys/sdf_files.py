"""Survey of public SDF files: which dynx reads, and whether Drake moves the same robot.

    python -m benchmarks.surveys.sdf_files list SNAPSHOTS > benchmarks/surveys/sdf_files.tsv
    python -m benchmarks.surveys.sdf_files run SNAPSHOTS FOLDER [--part develop] [--jobs N] [--seconds LIMIT]

SNAPSHOTS holds a Git directory ``OWNER+NAME`` of each repository of `FILES`. ``list`` takes their
files ``.sdf`` and ``.world`` that have an ``<sdf>`` of version 1.4 to 1.12 with a model or world, and one
copy of each text up to white space. Half of them, by the SHA-256 of repository and path, are to develop on,
the other half to measure.

``run`` extracts the files with all SDF and manifests of their repositories, checks their SHA-256, and reads
each by dynx. Drake, which is a program of its own, reads it as well, and both evaluate mass matrix, bias and
poses of all links at two random states. A file counts where dynx reads it, or where it holds one robot
whose joints are of the kinds `KINDS`; Drake says whether it holds one.
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

_ENDS = (".sdf", ".world")

FILES = FormatFiles(
    Path(__file__).parent / "sdf_files.tsv",
    ("gazebosim/sdformat", "osrf/gazebo_models", "RobotLocomotion/models"),
    _ENDS,
    re.compile(r"""<sdf\b[^>]*\bversion\s*=\s*["']1\.([4-9]|1[0-2])["'].*<(model|world)\b""", re.DOTALL),
    (*_ENDS, ".config", ".xml", ".urdf"),
    lambda repository, path: is_odd(f"{repository}/{path}"),
)

KINDS = frozenset(("fixed", "revolute", "continuous", "prismatic", "universal", "ball"))

EXACT = 1e-12
"""Largest difference from Drake, relative to the largest entry."""

ROUNDED = 1e-7
"""Largest difference that an axis which Drake rounds makes."""

_TYPE = re.compile(r"""<joint\b[^>]*\btype\s*=\s*["']([^"']*)["']""")


def examine(path: str) -> Outcome:
    """Read a file by dynx and by Drake, and compare."""
    from benchmarks.surveys.raw_drake_sdf import DrakeRobot

    text = Path(path).read_text(encoding="utf-8", errors="replace")
    joints = frozenset(_TYPE.findall(text))
    packages: dict[str, Path] = {}
    if "model://" in text:
        root = next((each for each in Path(path).parents if (each / ".git").exists()), Path(path).parent)
        packages = {each.parent.name: each.parent for each in sorted(root.rglob("model.config"))}
    robot, message = None, ""
    try:
        with silence():
            robot = DrakeRobot(Path(path), packages)
    except Exception as error:
        message = f"{type(error).__name__}: {error}"[:300]
    try:
        model = dynx.load(Path(path))
    except DynxError as error:
        one = robot is not None and robot.links and len(robot.free) <= 1
        return Outcome(
            path, "refused" if one else "refused, and no robot in Drake", str(error), joints=joints
        )
    if robot is None:
        return Outcome(path, "read, not by Drake", message, joints=joints)
    try:
        difference, reason = compare(model, robot)
    except (KeyError, ValueError) as error:
        return Outcome(path, "read, not compared", f"{type(error).__name__}: {error}", joints=joints)
    word = "alike"
    if difference > EXACT:
        # Drake replaces an inertia that no body can have; dynx uses the numbers of the file.
        rounded = robot.rounds_an_axis()
        impossible = any("it is used as stated" in note.message for note in model.notes)
        word = "different"
        if impossible:
            word = "different, an inertia of the file is not physical"
        elif rounded and difference < ROUNDED:
            word = "different, Drake rounds an axis"
    return Outcome(path, word, reason, difference, joints)


def compare(model: dynx.Model, robot: Any, states: int = 2) -> tuple[float, str]:
    """Return the largest relative difference from Drake at random states, and the quantity.

    Raises KeyError for a link or joint that Drake has not, ValueError for a base that is another.
    """
    prefix = _prefix(model, robot)
    coordinates = [_in_drake(name, robot, prefix) for name in model.joint_names]
    followers = {
        _in_drake(joint.name, robot, prefix): (
            _in_drake(joint.mimic.joint, robot, prefix),
            joint.mimic.multiplier,
            joint.mimic.offset,
        )
        for joint in model.joints
        if joint.mimic is not None
    }
    if len(coordinates) + len(followers) + (6 if model.floating else 0) != robot.plant.num_velocities():
        raise ValueError(f"Drake has {robot.plant.num_velocities()} coordinates, dynx {model.nv}")
    base = f"{prefix}{model.root}" if model.floating else None
    if base is not None and base not in robot.free:
        raise ValueError(f"the base is {model.root} in dynx, in Drake {sorted(robot.free)}")
    engine = dynx.backend("reference", model)
    random, worst = np.random.default_rng(0), (0.0, "")
    for _ in range(states):
        q = model.random(random)
        v = random.normal(size=model.nv)
        found = robot.evaluate(coordinates, followers, base, q, v, model.gravity)
        mine = dict(zip(model.frame_names, engine.forward_kinematics(q), strict=True))
        poses = {
            name: (mine[name.removeprefix(prefix)], theirs)
            for name, theirs in found.poses.items()
            if name.removeprefix(prefix) in mine
        }
        pairs = {
            "mass matrix": (engine.mass_matrix(q), found.mass_matrix),
            "bias": (engine.bias_torque(q, v), found.bias),
            **{f"pose of {name}": pair for name, pair in poses.items()},
        }
        for quantity, (a, b) in pairs.items():
            scale = max(float(np.abs(b).max(initial=0.0)), 1e-3)
            if quantity == "bias":
                # What cancels in it, such as a weight across an axis, is rounded as the weight is.
                scale = max(scale, 9.81 * float(np.abs(found.mass_matrix).max(initial=0.0)))
            worst = max(worst, (float(np.abs(a - b).max(initial=0.0)) / scale, quantity))
    return worst


def _prefix(model: dynx.Model, robot: Any) -> str:
    """Return what Drake puts before the name of a link: the name of the robot."""
    wanted = f"{model.name}::"
    return wanted if any(name.startswith(wanted) for name in robot.links) else ""


def _in_drake(name: str, robot: Any, prefix: str) -> tuple[str, int]:
    """Return the joint of Drake, and the number of its axis, of a joint of the model."""
    for number, end in ((0, ""), (0, "_axis"), (1, "_axis2")):
        if not name.endswith(end):
            continue
        stated = name.removesuffix(end)
        if f"{prefix}{stated}" in robot.joints:
            return f"{prefix}{stated}", number
        # Drake counts a joint between two models to the model of its child.
        last = stated.rpartition("::")[2]
        alike = [each for each in robot.joints if each.rpartition("::")[2] == last]
        if len(alike) == 1:
            return alike[0], number
    raise KeyError(name)


def counts(outcome: Outcome) -> bool:
    """Check whether dynx reads a file, or it holds one robot whose joints are of the kinds `KINDS`."""
    read = outcome.word.startswith(("alike", "different", "read"))
    return read or (outcome.word == "refused" and outcome.joints <= KINDS)


def main(arguments: Iterable[str] | None = None) -> None:
    """Print the list, or the survey of its files."""
    run(FILES, examine, counts, __doc__ or "", arguments)


if __name__ == "__main__":
    # By its own name, so that worker processes find what they are to run.
    from benchmarks.surveys.sdf_files import main as run_survey

    run_survey()
