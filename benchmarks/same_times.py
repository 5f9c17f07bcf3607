"""Processor time of ``dynx same``: a robot against itself, a rewritten copy, and a copy with two differences.

    python -m benchmarks.same_times [ROBOT ...]

In a rewritten copy the frame of every link is turned and moved. The differences are the mass of a link and
the place of a joint. ``call`` is the time of `dynx.same_robot` on models, ``command`` that of the whole
command ``dynx same A B --quiet`` on files, with the start of Python, in s of one processor.
"""

from __future__ import annotations

import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

import dynx
from dynx.model.elements import Pose
from tests.same.rewrites import rebuilt, with_moved_frames

REPETITIONS = 5


def with_two_differences(model: dynx.Model) -> dynx.Model:
    """Return the model with another mass of its fourth heavy link and another place of its sixth joint."""
    links, joints = list(model.links), list(model.joints)
    k = [k for k, link in enumerate(links) if link.inertial is not None and link.inertial.mass > 0.0][3]
    inertial = links[k].inertial
    assert inertial is not None
    links[k] = replace(links[k], inertial=replace(inertial, mass=1.1 * inertial.mass))
    k = [k for k, joint in enumerate(joints) if joint.moves][5]
    T = joints[k].origin.matrix.copy()
    T[0, 3] += 0.01
    joints[k] = replace(joints[k], origin=Pose.from_matrix(T))
    return rebuilt(model, links, joints)


def command_time(first: dynx.Model, second: dynx.Model) -> float:
    """Return the processor time [s] of the command on two files."""
    with tempfile.TemporaryDirectory() as folder:
        paths = [Path(folder) / f"{name}.urdf" for name in "ab"]
        for path, model in zip(paths, (first, second), strict=True):
            path.write_text(model.to_urdf(), encoding="utf-8")
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        command = [sys.executable, "-m", "dynx", "same", *map(str, paths), "--quiet", "--base", first.base]
        subprocess.run(command, check=False)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def main(names: Sequence[str]) -> None:
    """Print the least times of some repetitions."""
    for name in names:
        for base in ("fixed", "floating"):
            model = dynx.load(name, base=base)
            copy = with_moved_frames(model, np.random.default_rng(3))
            other = with_moved_frames(with_two_differences(model), np.random.default_rng(3))
            for what, second in (("itself", model), ("rewritten", copy), ("two differences", other)):
                calls = []
                for _ in range(REPETITIONS):
                    start = time.process_time()
                    report = dynx.same_robot(model, second)
                    calls.append(time.process_time() - start)
                whole = min(command_time(model, second) for _ in range(REPETITIONS))
                found = len(report.differences)
                print(
                    f"{name}, {base}, {what}: call {min(calls):.2f}, command {whole:.2f}, {found} elements",
                    flush=True,
                )


if __name__ == "__main__":
    main(sys.argv[1:] or ["g1", "talos"])
