"""What the batches are timed on and against: robots, a tree of a hundred joints, and ways to do a work.

The ways are those of ``dynx bench`` (the compiled backend, Pinocchio's C++ batches, a loop over its
binding), and MuJoCo's ``mj_inverse`` in a loop where MuJoCo is installed. The C++ within a call of the
binding is a difference of two times, which pytest-benchmark cannot show: `dynx bench` does.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest

from dynx.bench.backend_ways import backend_way
from dynx.bench.measurement import Preparation
from dynx.bench.pinocchio_ways import BATCH, LOOP, PinocchioBatch, PinocchioLoop
from dynx.bench.ways import Prepared, Role, Way
from dynx.bench.work import ARGUMENTS, Batch, Work, draw_batch
from dynx.model import Inertial, Joint, Link, Model, Pose
from dynx.model.loading import load
from dynx.spatial.scalar import Floats

FRAMES = {"ur5": "tool0", "panda": "panda_hand", "talos_reduced": "gripper_left_base_link"}
"""The robots that are timed, and the frame of each."""

MUJOCO = "mujoco mj_inverse"
COMPILED = "compiled"
WAYS: dict[str, tuple[str, ...]] = {
    COMPILED: tuple(ARGUMENTS),
    BATCH: ("inverse_dynamics", "forward_dynamics"),
    LOOP: tuple(ARGUMENTS),
    MUJOCO: ("inverse_dynamics",),
}
"""Each way, and the quantities that it does."""

HAVE_THREADS = frozenset({COMPILED, BATCH})
ONLY_BATCHES = frozenset({BATCH})


class MujocoInverse(Way):
    """`mj_inverse` called once for each sample, as MuJoCo's users do; answers go to one array."""

    name = MUJOCO
    role: Role = "peer"
    threads = 1
    whole = False

    def __init__(self, model: Model) -> None:
        tree = pytest.importorskip("dynx.backends.mujoco_tree", reason="mujoco is not installed")
        from dynx.engines.mujoco import mujoco

        self.version = f"mujoco {mujoco.__version__}"
        if model.mechanism.coupling is not None:
            pytest.skip("MuJoCo has mimic joints as constraints: another work")
        self._engine: Any = tree.build_tree(model).model
        self._inverse, self._data = mujoco.mj_inverse, mujoco.MjData(self._engine)

    def does(self, work: Work) -> bool:
        """It is inverse dynamics."""
        return work.quantity == "inverse_dynamics"

    def prepare(self, work: Work, batch: Batch, out: Floats) -> Prepared:
        """Ready."""
        rows = list(zip(batch.q, batch.v, batch.a, strict=True))
        engine, data, inverse = self._engine, self._data, self._inverse

        def call() -> Floats:
            for k, (q, v, a) in enumerate(rows):
                data.qpos[:], data.qvel[:], data.qacc[:] = q, v, a
                inverse(engine, data)
                out[k] = data.qfrc_inverse
            return out

        return Prepared(call)


@cache
def model_of(robot: str) -> Model:
    """The robot as its file has it."""
    return load(robot)


@cache
def batch_of(robot: str, count: int) -> Batch:
    """So many random samples of it."""
    return draw_batch(model_of(robot), FRAMES[robot], count)


@cache
def way_of(robot: str, name: str, threads: int) -> Way:
    """The way of that name for a robot."""
    model = model_of(robot)
    if name == BATCH:
        return PinocchioBatch(model, threads)
    if name == LOOP:
        return PinocchioLoop(model)
    return MujocoInverse(model) if name == MUJOCO else backend_way(model, name, threads)


def checked_call(way: Way, work: Work, batch: Batch) -> tuple[Prepared, int]:
    """The way made ready and its answers checked, and the number of samples in a call."""
    found, ready = Preparation(work).of(way, batch)
    assert ready is not None, f"{way.name}: {found.problem}"
    return ready, found.samples


def tree_of_joints(count: int) -> Model:
    """A binary tree of links of which every one but the root turns on its parent."""
    rng = np.random.default_rng(0)
    body = Inertial(1.0, Pose((0.01, 0.02, 0.1)), ixx=0.01, iyy=0.012, izz=0.005)
    links = [Link(f"link{k}", body) for k in range(count + 1)]
    joints = []
    for k in range(1, count + 1):
        axis = rng.standard_normal(3)
        x, y, z = (axis / np.linalg.norm(axis)).tolist()
        origin = Pose((0.0, 0.1, 0.3), (0.1, -0.2, 0.3))
        parent, child = links[(k - 1) // 2].name, links[k].name
        joints.append(Joint(f"joint{k}", "revolute", parent, child, origin, (x, y, z)))
    return Model.build(f"tree of {count}", links, joints)
