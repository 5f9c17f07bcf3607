"""Solvers that return all solutions of a pose: dynx, and what else is installed.

EAIK (Ostermeier, Külz and Althoff 2025) and ssik are packages of these names; no extra of dynx installs them.
EAIK is handed the axes of the joints; ssik generates a module from the URDF text of the model.
"""

from __future__ import annotations

import importlib.util
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from dynx.backends import backend
from dynx.ik.closed_forms.chain import chain_to
from dynx.model import Model
from dynx.spatial.scalar import Floats


@dataclass(frozen=True)
class Solver:
    """A solver of one frame of a robot; angles are those of the six joints of its chain."""

    name: str
    solve: Callable[[Floats], Any]
    """Function of a pose (4, 4), as users call it."""
    angles: Callable[[Any], Floats]
    """Function from its result to the solutions (k, 6)."""
    batch: Callable[[Floats], Any] | None = None
    """Function of poses (n, 4, 4) on one thread."""


def dynx_solver(model: Model, frame: str) -> Solver:
    """Return the backend `compiled` on one thread."""
    engine = backend("compiled", model, threads=1)
    columns = list(chain_to(model, frame, {}).columns)

    def solve(T: Floats) -> Any:
        return engine.inverse_kinematics(T, frame, all_solutions=True)

    return Solver("dynx", solve, lambda found: np.asarray(found.q[:, columns]), solve)


def eaik_solver(model: Model, frame: str) -> Solver:
    """Return EAIK's C++ solver, called by its binding."""
    # The package has no annotations.
    EAIK: Any = importlib.import_module("eaik.pybindings.EAIK")
    chain = chain_to(model, frame, {})
    points = np.vstack([np.zeros(3), chain.points, chain.T_zero[:3, 3]]) * chain.length
    offsets = np.diff(points, axis=0)
    robot = EAIK.Robot(chain.axes.T, offsets.T, chain.T_zero[:3, :3], [], True)
    return Solver(
        "EAIK",
        robot.calculate_IK,
        lambda found: np.asarray(found.Q, dtype=np.float64).reshape(-1, 6),
        lambda T: robot.calculate_IK_batched(list(T), 1),
    )


def ssik_solver(model: Model, frame: str) -> Solver:
    """Return the module that ssik generates for an arm, called for one value of each angle."""
    with tempfile.TemporaryDirectory() as folder:
        path, made = Path(folder) / "robot.urdf", Path(folder) / "arm_ik.py"
        path.write_text(model.to_urdf(), encoding="utf-8")
        chosen = ["--base", model.links[0].name, "--ee", frame, "--out", str(made), "--no-validate"]
        subprocess.run(
            [sys.executable, "-m", "ssik.cli", "build", str(path), *chosen], check=True, capture_output=True
        )
        spec = importlib.util.spec_from_file_location("arm_ik", made)
        assert spec is not None
        assert spec.loader is not None
        robot = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(robot)
    return Solver(
        "ssik",
        lambda T: robot.solve(T, enumerate_windings=False),
        lambda found: np.array([each.q for each in found], dtype=np.float64).reshape(-1, 6),
    )


def installed_solvers(model: Model, frame: str) -> list[Solver]:
    """Return the solvers that are installed."""
    makers = {"dynx": dynx_solver, "eaik": eaik_solver, "ssik": ssik_solver}
    return [make(model, frame) for package, make in makers.items() if importlib.util.find_spec(package)]
