"""Peers in JAX, adam and frax: a function of one sample, ``jax.vmap`` over the batch, ``jax.jit``.

JAX computes with doubles (``jax_enable_x64``) on the processor, with the settings that frax recommends
there; they are read when JAX is first imported. So is the number of its threads, which a process keeps.
"""

from __future__ import annotations

import os
import tempfile
import time
import warnings
from abc import abstractmethod
from collections.abc import Callable
from functools import cached_property
from importlib import import_module
from typing import Any, ClassVar

import numpy as np

from benchmarks.bindings.urdf_text import moving_joints, spelled_out
from benchmarks.libraries.compiling_peer import CompilingPeer, place_on_last_link
from dynx.backends.quantities import QUANTITIES
from dynx.bench.cases import Batch, BenchmarkCase
from dynx.bench.implementations import PreparedCall
from dynx.errors import EngineLimitError, NotInstalledError
from dynx.model import Model
from dynx.spatial.scalar import Floats

OfOneSample = Callable[..., Any]

SETTINGS = {
    "JAX_PLATFORMS": "cpu",
    "JAX_ENABLE_X64": "1",
    "XLA_FLAGS": "--xla_cpu_multi_thread_eigen=false",
}


THREADS = "NPROC"
"""The variable in which XLA reads how many threads it starts."""


MOST_JOINTS = 16
"""Largest number of joints of a robot whose dynamics adam evaluates on JAX."""


class JaxPeer(CompilingPeer):
    """Batch evaluation as users of a JAX library write it; subclasses define that of one sample.

    Arguments are NumPy's arrays, and so is the result: what it takes to hand them over is timed. (On a
    processor JAX reads and gives such memory as it is, where it is aligned.)
    """

    most_samples: ClassVar[int] = 16384

    def __init__(self, model: Model, threads: int) -> None:
        super().__init__(model, threads)
        self.jax = started_jax(threads)
        self._compiled: dict[tuple[str, int], tuple[Any, float]] = {}

    @abstractmethod
    def of_one_sample(self, quantity: str, frame: str) -> OfOneSample:
        """The function that is mapped over the batch."""

    def prepare(self, case: BenchmarkCase, batch: Batch, out: Floats) -> PreparedCall:
        """Ready, compiled for this number of samples."""
        arguments = batch.arguments(case.quantity)
        result = self.compiled(case.quantity, batch)
        return PreparedCall(lambda: np.asarray(result(*arguments)))

    def compiled(self, quantity: str, batch: Batch) -> Any:
        """The function of the whole batch; made once."""
        key = quantity, len(batch)
        if key not in self._compiled:
            begin = time.perf_counter()
            mapped = self.jax.jit(self.jax.vmap(self.of_one_sample(quantity, batch.frame)))
            made = mapped.lower(*batch.arguments(quantity)).compile()
            self._compiled[key] = made, time.perf_counter() - begin
        made, self.compile_seconds = self._compiled[key]
        return made


class OnDevice(CompilingPeer):
    """A JAX peer whose arguments are JAX arrays already and whose result stays one."""

    most_samples: ClassVar[int] = JaxPeer.most_samples

    def __init__(self, peer: JaxPeer) -> None:
        self.name = f"{peer.name}, arrays in JAX"
        self.version, self.threads, self.compile_seconds = peer.version, peer.threads, 0.0
        self._peer = peer

    def supports(self, case: BenchmarkCase) -> bool:
        """Whether the peer supports the case."""
        return self._peer.supports(case)

    def prepare(self, case: BenchmarkCase, batch: Batch, out: Floats) -> PreparedCall:
        """Ready."""
        result = self._peer.compiled(case.quantity, batch)
        self.compile_seconds = self._peer.compile_seconds
        held = [self._peer.jax.device_put(each) for each in batch.arguments(case.quantity)]
        return PreparedCall(lambda: result(*held).block_until_ready())


class AdamJax(JaxPeer):
    """adam's `KinDynComputations`: every robot floats, and the six rows of its base are left out here.

    adam has neither inverse dynamics with an acceleration nor forward dynamics of a fixed base. What its
    user writes is M a + h, and the solution of M a = tau - h.
    """

    name = "adam, JAX"

    def __init__(self, model: Model, threads: int) -> None:
        super().__init__(model, threads)
        adam, self.version = imported("adam.jax"), version_of("adam-robotics", "jax")
        gravity = np.array([*model.gravity, 0.0, 0.0, 0.0])
        self._robot = adam.KinDynComputations(spelled_out(model), moving_joints(model), gravity=gravity)

    def supports(self, case: BenchmarkCase) -> bool:
        """Dynamics of large robots takes minutes to compile (165 s for the mass matrix of 32 joints)."""
        return QUANTITIES[case.quantity].of_frame or self._robot.NDoF <= MOST_JOINTS

    def of_one_sample(self, quantity: str, frame: str) -> OfOneSample:
        """By adam's functions of a base at rest in the origin."""
        robot, numpy = self._robot, self.jax.numpy
        base, rest = np.eye(4), np.zeros(6)

        def mass_matrix(q: Any) -> Any:
            return robot.mass_matrix(base, q)[6:, 6:]

        def bias(q: Any, v: Any) -> Any:
            return robot.bias_force(base, q, rest, v)[6:]

        functions: dict[str, OfOneSample] = {
            "forward_kinematics": lambda q: robot.forward_kinematics(frame, base, q),
            "jacobian": lambda q: robot.jacobian(frame, base, q)[:, 6:],
            "inverse_dynamics": lambda q, v, a: mass_matrix(q) @ a + bias(q, v),
            "forward_dynamics": lambda q, v, tau: numpy.linalg.solve(mass_matrix(q), tau - bias(q, v)),
            "mass_matrix": mass_matrix,
        }
        return functions[quantity]


class Frax(JaxPeer):
    """frax's `Robot`, and its `Manipulator` for frames, which it has at the end of a chain only."""

    name = "frax"

    def __init__(self, model: Model, threads: int) -> None:
        super().__init__(model, threads)
        self._frax, self.version = imported("frax"), version_of("frax", "jax")
        self._model, self._chain = model, is_chain(model)

    def supports(self, case: BenchmarkCase) -> bool:
        """Frames of a tree it has for its own humanoids only."""
        return self._chain or not QUANTITIES[case.quantity].of_frame

    def of_one_sample(self, quantity: str, frame: str) -> OfOneSample:
        """By frax's functions; its forward dynamics knows but one gravity, that of dynx's default."""
        if QUANTITIES[quantity].of_frame:
            arm = self._end(frame)
            of_a_frame: dict[str, OfOneSample] = {
                "forward_kinematics": arm.ee_transform,
                "jacobian": arm.ee_jacobian,
            }
            return of_a_frame[quantity]
        robot = self._robot
        upwards = np.array([*np.negative(self._model.gravity), 0.0, 0.0, 0.0])
        functions: dict[str, OfOneSample] = {
            "inverse_dynamics": lambda q, v, a: robot.rnea(q, v, a, upwards, None),
            "forward_dynamics": lambda q, v, tau: robot.forward_dynamics(q, v, tau, None),
            "mass_matrix": robot.crba,
        }
        return functions[quantity]

    @cached_property
    def _robot(self) -> Any:
        return self._read(imported("frax.core.robot").Robot)

    def _end(self, frame: str) -> Any:
        offset = place_on_last_link(self._model, frame)
        return self._read(imported("frax.core.manipulator").Manipulator, ee_offset=offset)

    def _read(self, kind: Any, **options: Any) -> Any:
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, "robot.urdf")
            with open(path, "w", encoding="utf-8") as file:
                file.write(spelled_out(self._model))
            return kind(path, joint_ordering=moving_joints(self._model), **options)


def is_chain(model: Model) -> bool:
    """Whether no link carries two moving joints, near or far."""
    parents = {joint.child: joint for joint in model.joints}
    carriers = []
    for joint in model.joints:
        if joint.moves:
            above = parents.get(joint.parent)
            while above is not None and not above.moves:
                above = parents.get(above.parent)
            carriers.append(None if above is None else above.name)
    return len(set(carriers)) == len(carriers)


def started_jax(threads: int) -> Any:
    """JAX on so many threads; raises EngineLimitError where this process has it on another number."""
    for variable, value in {**SETTINGS, THREADS: str(threads)}.items():
        os.environ.setdefault(variable, value)
    jax = imported("jax")
    if os.environ[THREADS] != str(threads):
        raise EngineLimitError(f"JAX has {os.environ[THREADS]} threads in this process, and keeps them")
    return jax


def imported(name: str) -> Any:
    """A module on top of JAX; raises NotInstalledError where it is not there."""
    with warnings.catch_warnings():
        # Both warn of versions of JAX and of settings while they are imported.
        warnings.simplefilter("ignore")
        try:
            return import_module(name)
        except ImportError as error:
            raise NotInstalledError(f"{error}: pip install 'dynx[benchmark]'") from error


def version_of(*distributions: str) -> str:
    """Names and versions of what is installed."""
    from importlib.metadata import version

    return ", ".join(f"{name} {version(name)}" for name in distributions)
