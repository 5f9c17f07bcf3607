"""Robots of the batch benchmarks, and the implementations compared.

The implementations are those of ``dynx bench`` (the compiled backend, Pinocchio's C++ batches, a loop over
its binding), and what the extra ``benchmark`` installs: MuJoCo, adam on JAX and on CasADi, frax.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

from benchmarks.libraries.casadi_peers import CasadiCode, CasadiMap
from benchmarks.libraries.compiling_peer import CompilingPeer
from benchmarks.libraries.jax_peers import AdamJax, Frax
from benchmarks.libraries.mujoco_peers import MujocoInverse, MujocoRollout
from dynx.bench.cases import BENCHMARK_QUANTITIES, Batch, BenchmarkCase
from dynx.bench.implementations import Implementation, PreparedCall, backend_implementation
from dynx.bench.measurement import Preparation
from dynx.bench.pinocchio_implementations import BATCH, LOOP, PinocchioBatch, PinocchioLoop
from dynx.model import Model

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
