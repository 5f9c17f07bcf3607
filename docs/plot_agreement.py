"""Draw docs/agreement.svg: how far Pinocchio and PyBullet are apart, loaded directly and through dynx.

    python docs/plot_agreement.py          (needs matplotlib beside dynx)

For every URDF file of example-robot-data, fixed base: the larger of the relative differences of
inverse dynamics and of the mass matrix over random states. "Directly" means each engine reads the
file itself, with the base fixed and the inertias of the file, joints matched by name.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np

import dynx

SAMPLES = 5
FLOOR = 1e-17


def directly(path: str) -> float:
    """Relative difference of the two engines when each loads the file itself."""
    import pinocchio as pin
    import pybullet as p

    pin_model = pin.buildModelFromUrdf(path)
    data = pin_model.createData()
    client = p.connect(p.DIRECT)
    p.setGravity(0, 0, -9.81, physicsClientId=client)
    body = p.loadURDF(path, useFixedBase=True, flags=p.URDF_USE_INERTIA_FROM_FILE, physicsClientId=client)
    names = []
    for index in range(p.getNumJoints(body, physicsClientId=client)):
        info = p.getJointInfo(body, index, physicsClientId=client)
        if info[2] in (p.JOINT_REVOLUTE, p.JOINT_PRISMATIC):
            names.append(info[1].decode())
    ids = [pin_model.getJointId(name) for name in names]
    columns = [pin_model.joints[i].idx_v for i in ids]
    rng = np.random.default_rng(0)
    worst = 0.0
    for _ in range(SAMPLES):
        x, v, a = rng.uniform(-1, 1, (3, len(names)))
        q = pin.neutral(pin_model)
        for value, i in zip(x, ids, strict=True):
            joint = pin_model.joints[i]
            if joint.nq == 1:
                q[joint.idx_q] = value
            else:
                q[joint.idx_q : joint.idx_q + 2] = math.cos(value), math.sin(value)
        pin_v, pin_a = np.zeros(pin_model.nv), np.zeros(pin_model.nv)
        pin_v[columns], pin_a[columns] = v, a
        tau = pin.rnea(pin_model, data, q, pin_v, pin_a)[columns]
        M = pin.crba(pin_model, data, q)
        M = (np.triu(M) + np.triu(M, 1).T)[np.ix_(columns, columns)]
        lists = [list(map(float, each)) for each in (x, v, a)]
        other_tau = np.array(p.calculateInverseDynamics(body, *lists, physicsClientId=client))
        other_M = np.array(p.calculateMassMatrix(body, lists[0], physicsClientId=client))
        worst = max(worst, relative(tau, other_tau), relative(M, other_M))
    p.disconnect(client)
    return worst


def through_dynx(path: str) -> float:
    """Relative difference of the two engines behind dynx."""
    model = dynx.load(path)
    rng = np.random.default_rng(0)
    q = rng.uniform(-1, 1, (SAMPLES, model.nq))
    v, a = rng.uniform(-1, 1, (2, SAMPLES, model.nv))
    with dynx.backend("pinocchio", model) as one, dynx.backend("pybullet", model) as other:
        return max(
            max(map(relative, one.inverse_dynamics(q, v, a), other.inverse_dynamics(q, v, a))),
            max(map(relative, one.mass_matrix(q), other.mass_matrix(q))),
        )


def relative(a: np.ndarray, b: np.ndarray) -> float:
    """max |a - b| / max |a|."""
    return float(np.max(np.abs(a - b)) / max(float(np.max(np.abs(a))), np.finfo(float).tiny))


def both(path: str) -> tuple[str, float, float]:
    """The two differences of one file; nan where an engine cannot answer."""
    devnull = os.open(os.devnull, os.O_WRONLY)
    os.dup2(devnull, 1)
    os.dup2(devnull, 2)
    os.close(devnull)
    return path, measured(directly, path), measured(through_dynx, path)


def measured(measure: Callable[[str], float], path: str) -> float:
    """Return the result of `measure`, or nan (a gap in the picture) if an engine raises an error."""
    try:
        return max(measure(path), FLOOR)
    except Exception:
        return math.nan


def main() -> None:
    """Measure every robot, draw the picture, print the summary that the README quotes."""
    import matplotlib.pyplot as plt

    paths = sorted(str(robot.path) for robot in dynx.robots() if robot.source == "example-robot-data")
    with ProcessPoolExecutor(2, max_tasks_per_child=1) as pool:
        rows = [row for row in pool.map(both, paths) if not math.isnan(row[2])]
    rows.sort(key=lambda row: -1.0 if math.isnan(row[1]) else row[1])
    figure, axes = plt.subplots(figsize=(9, 4.2))
    x = np.arange(len(rows))
    axes.scatter(x, [row[1] for row in rows], s=22, color="#c0392b", label="each engine loads the file")
    axes.scatter(x, [row[2] for row in rows], s=22, color="#1f6f8b", label="through dynx")
    axes.set_yscale("log")
    axes.set_ylim(FLOOR / 3, 1e2)
    axes.axhline(1e-12, color="#888888", linewidth=0.8, linestyle="--")
    axes.text(0, 1.6e-12, "1e-12", color="#666666", fontsize=8)
    axes.set_ylabel("relative difference of torques and mass matrix")
    axes.set_xlabel(f"{len(rows)} robots of example-robot-data, fixed base")
    axes.set_xticks([])
    axes.set_title("Pinocchio against PyBullet on the same URDF file", loc="left", fontsize=11)
    axes.legend(frameon=False, loc="upper left", bbox_to_anchor=(0, 0.92))
    axes.spines[["top", "right"]].set_visible(False)
    figure.tight_layout()
    figure.savefig(Path(__file__).with_name("agreement.svg"))
    raw = np.array([row[1] for row in rows if not math.isnan(row[1])])
    ours = np.array([row[2] for row in rows])
    print(f"directly: {len(raw)} robots, {np.sum(raw > 1e-6)} above 1e-6, worst {raw.max():.1e}")
    print(f"through dynx: {len(ours)} robots, worst {ours.max():.1e}")


if __name__ == "__main__":
    main()
