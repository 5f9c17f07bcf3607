"""Robots of the batch benchmarks, a tree of a hundred joints among them, and the implementations compared.

The implementations are those of ``dynx bench`` (the compiled backend, Pinocchio's C++ batches, a loop over
its binding), and what the extra ``benchmark`` installs: MuJoCo, adam on JAX and on CasADi, frax. The C++
within a call of the binding is a difference of two times, which pytest-benchmark cannot show; `dynx bench`
does.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, partial

import numpy as np

from benchmarks.libraries.casadi_peers import CasadiCode, CasadiMap
from benchmarks.libraries.compiling_peer import CompilingPeer
from benchmarks.libraries.jax_peers import AdamJax, Frax
from benchmarks.libraries.mujoco_peers import MujocoInverse, MujocoRollout
from dynx.bench.cases import BENCHMARK_QUANTITIES, Batch, BenchmarkCase, draw_batch
from dynx.bench.implementations import Implementation, PreparedCall, backend_implementation
from dynx.bench.measurement import Preparation
from dynx.bench.pinocchio_implementations import BATCH, LOOP, PinocchioBatch, PinocchioLoop
from dynx.model import Inertial, Joint, Link, Model, Pose
from dynx.model.loading import load

FRAMES = {"ur5": "tool0", "panda": "panda_hand", "talos_reduced": "gripper_left_base_link"}
"""The robots that are timed, and the frame of each."""

COMPILED = "compiled"
COMPILING_PEERS: tuple[type[CompilingPeer], ...] = (AdamJax, Frax, CasadiMap, CasadiCode)
"""Peers that take batches, once they have compiled."""

SUPPORTED: dict[str, tuple[str, ...]] = {
    COMPILED: tuple(BENCHMARK_QUANTITIES),
    BATCH: ("inverse_dynamics", "forward_dynamics"),
    LOOP: tuple(BENCHMARK_QUANTITIES),
    MujocoInverse.name: ("inverse_dynamics",),
    MujocoRollout.name: ("forward_dynamics",),
    **{peer.name: tuple(BENCHMARK_QUANTITIES) for peer in COMPILING_PEERS},
}
"""Names of the implementations, and the quantities that each supports."""

TAKE_SECONDS = frozenset({MujocoRollout.name, *(peer.name for peer in COMPILING_PEERS)})
"""Peers for large batches: getting ready takes seconds to minutes, handing over arrays much of a call."""
HAVE_THREADS = frozenset({COMPILED, BATCH, *TAKE_SECONDS})
ONLY_BATCHES = frozenset({BATCH, *TAKE_SECONDS})


@cache
def model_of(robot: str) -> Model:
    """The robot as its file has it."""
    return load(robot)


@cache
def batch_of(robot: str, count: int) -> Batch:
    """So many random samples of it."""
    return draw_batch(model_of(robot), FRAMES[robot], count)


@cache
def implementation_of(robot: str, name: str, threads: int) -> Implementation:
    """The implementation of that name for a robot; an error of `dynx.errors` says why there is none."""
    return make_implementation(model_of(robot), name, threads)


def make_implementation(model: Model, name: str, threads: int) -> Implementation:
    """The implementation of that name, on so many threads where it has any of its own."""
    makers: dict[str, Callable[[], Implementation]] = {
        BATCH: lambda: PinocchioBatch(model, threads),
        LOOP: lambda: PinocchioLoop(model),
        MujocoInverse.name: lambda: MujocoInverse(model),
        MujocoRollout.name: lambda: MujocoRollout(model, threads),
    }
    for peer in COMPILING_PEERS:
        makers[peer.name] = partial(peer, model, threads)
    return makers[name]() if name in makers else backend_implementation(model, name, threads)


def checked_call(
    implementation: Implementation, case: BenchmarkCase, batch: Batch
) -> tuple[PreparedCall, int]:
    """The implementation prepared and its results checked, and the number of samples in a call."""
    found, ready = Preparation(case).prepare(implementation, batch)
    assert ready is not None, f"{implementation.name}: {found.problem}"
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
