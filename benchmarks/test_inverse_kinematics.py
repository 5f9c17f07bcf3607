"""Inverse kinematics of four arms: how many targets are reached, and how long one takes.

``pytest benchmarks/test_inverse_kinematics.py`` solves 1,000 random poses that are reachable within
limits, to 1e-6 m and 1e-6 rad, without a starting guess. Every solution is verified by the other
engine before anything is timed. Beside dynx stands the C++ solver ``ik_LM`` of roboticstoolbox-python
(the extra ``benchmark``), which is handed the same chain of transforms, limits and targets.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache
from itertools import cycle
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from dynx.backends import backend, installed_backends
from dynx.model import Model
from dynx.model.loading import load
from dynx.spatial.scalar import Floats
from dynx.spatial.se3 import pose_error

TARGETS, TARGETS_UNTIMED = 1000, 50
TOLERANCE = 1e-6  # [m], [rad]
LEAST_SOLVED = {"compiled": 1.0, "pinocchio": 0.999, "pybullet": 0.995}

Solve = Callable[[Floats], Floats]
"""From a pose (4, 4) to a configuration; NaN where none was found."""


@dataclass(frozen=True)
class Arm:
    """A robot of the library or a file of pybullet_data, the frame to place, and joints to lock."""

    source: str
    frame: str
    lock: tuple[str, ...] = ()


ARMS = {
    "ur5": Arm("ur5", "ee_link"),
    "panda": Arm("panda", "panda_hand", ("panda_finger_joint1", "panda_finger_joint2")),
    "kuka_iiwa": Arm("kuka_iiwa/model.urdf", "lbr_iiwa_link_7"),
    "talos_left_arm": Arm("talos_arm", "gripper_left_base_link", ("gripper_left_joint",)),
}


@cache
def model_of(arm: str) -> Model:
    """The arm with its gripper locked."""
    source: str | Path = ARMS[arm].source
    if "/" in ARMS[arm].source:
        data = pytest.importorskip("pybullet_data", reason="the file comes with PyBullet")
        source = Path(data.getDataPath()) / source
    return load(source, lock=dict.fromkeys(ARMS[arm].lock, 0.0))


@cache
def targets_of(arm: str) -> Floats:
    """Poses (TARGETS, 4, 4) taken by random configurations within limits."""
    model = model_of(arm)
    with backend("pinocchio", model) as engine:
        return engine.forward_kinematics(model.random(0, TARGETS), ARMS[arm].frame)


@pytest.fixture(params=["compiled", "pinocchio", "pybullet", "ik_LM"])
def solver(request: pytest.FixtureRequest, arm: str) -> Iterator[tuple[str, Solve]]:
    """The name of a solver, and the solver."""
    if request.param == "ik_LM":
        yield "ik_LM", toolbox_solver(model_of(arm), ARMS[arm].frame)
        return
    if request.param not in installed_backends():
        pytest.skip(f"{request.param} is not installed")
    with backend(request.param, model_of(arm)) as engine:

        def solve(target: Floats) -> Floats:
            result = engine.inverse_kinematics(target, ARMS[arm].frame)
            return result.q if result.success else np.full_like(result.q, np.nan)

        yield request.param, solve


@pytest.mark.parametrize("arm", ARMS)
def test_inverse_kinematics(
    arm: str,
    solver: tuple[str, Solve],
    benchmark: BenchmarkFixture,
    capsys: pytest.CaptureFixture[str],
) -> None:
    name, solve = solver
    targets = targets_of(arm)[: TARGETS_UNTIMED if benchmark.disabled else TARGETS]
    solutions, seconds = [], []
    for target in targets:
        begin = time.perf_counter()
        solutions.append(solve(target))
        seconds.append(time.perf_counter() - begin)
    solved = verified_share(arm, name, targets, np.array(solutions))
    median, mean = (1e6 * float(f(seconds)) for f in (np.median, np.mean))
    with capsys.disabled():
        print(f"\n{arm:15}{name:10} solved {solved:8.2%}   median {median:5.0f}   mean {mean:5.0f} us")
    assert solved >= LEAST_SOLVED.get(name, 0.0)

    benchmark.group = f"inverse kinematics of {arm}"
    benchmark.extra_info.update(solved=solved, median_us=median, mean_us=mean)
    next_target = cycle(targets)
    # Every round is one target, and each is had once: their difficulty is part of what is measured.
    repeat: Any = benchmark.pedantic
    repeat(solve, setup=lambda: ((next(next_target),), {}), rounds=len(targets))


def verified_share(arm: str, name: str, targets: Floats, q: Floats) -> float:
    """The part of the targets that is reached, as the other engine says, within limits."""
    model = model_of(arm)
    found = np.isfinite(q).all(axis=-1)
    # Counted as not solved where the solver itself says so; wrong where it says otherwise.
    other = "pybullet" if "pybullet" in installed_backends() else "reference"
    with backend(other if name == "pinocchio" else "pinocchio", model) as verifier:
        reached = verifier.forward_kinematics(q[found], ARMS[arm].frame)
    errors = np.stack([np.linalg.norm(e, axis=-1) for e in pose_error(targets[found], reached)])
    right = (errors <= TOLERANCE).all(axis=0) & ((q[found] >= model.lower) & (q[found] <= model.upper)).all(
        axis=-1
    )
    if name in LEAST_SOLVED:
        assert right.all(), f"{name} calls {np.count_nonzero(~right)} wrong answers solutions"
    return np.count_nonzero(right) / len(targets)


def toolbox_solver(model: Model, frame: str) -> Solve:
    """Return the C++ solver of roboticstoolbox-python for the same chain of transforms and limits."""
    toolbox: Any = pytest.importorskip(
        "roboticstoolbox", reason="roboticstoolbox-python is missing: pip install 'dynx[benchmark]'"
    )
    chain = toolbox.ETS()
    by_child = {joint.child: joint for joint in model.joints}
    elements: list[Any] = []
    while frame in by_child:
        joint = by_child[frame]
        if joint.moves:
            # An elementary transform turns about z: go there from the joint's axis, and come back.
            z_to_axis = _turning_z_to(np.array(joint.axis))
            limits = np.array([joint.limits.lower, joint.limits.upper])
            elements += [
                toolbox.ET.SE3(z_to_axis.T),
                toolbox.ET.Rz(qlim=limits),
                toolbox.ET.SE3(z_to_axis),
            ]
        elements.append(toolbox.ET.SE3(joint.origin.matrix))
        frame = joint.parent
    for element in reversed(elements):
        chain *= element

    def solve(target: Floats) -> Floats:
        # tol bounds half the squared error.
        answer = chain.ik_LM(target, tol=0.5e-12, joint_limits=True, method="chan")
        return np.asarray(answer.q) if answer.success else np.full(chain.n, np.nan)

    return solve


def _turning_z_to(axis: Floats) -> Floats:
    """A rotation, as (4, 4), that takes z to `axis`."""
    T = np.eye(4)
    aside = np.eye(3)[int(np.argmin(np.abs(axis)))]
    x = np.cross(aside, axis)
    T[:3, 0] = x / np.linalg.norm(x)
    T[:3, 1] = np.cross(axis, T[:3, 0])
    T[:3, 2] = axis
    return T
