"""The questions asked of a robot that an engine has loaded from its file."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import ClassVar, TypeVar

import numpy as np

from dynx.errors import EngineError, shown
from dynx.loaded.description import LoadedModel
from dynx.model import Model
from dynx.spatial.scalar import Floats

Self = TypeVar("Self", bound="LoadedRobot")


class LoadedRobot(ABC):
    """A URDF file as one engine loads it, answering in the coordinates of dynx.

    `model` says which coordinates: its base, its gravity, its joints (all that move: give a model
    whose mimic joints were set free) and its links. It is used to name and to order, never to mend
    what the engine loaded. Coordinates of the engine that the model lacks are held at zero.

    One sample at a time: q (nq,), v, a, tau (nv,), float64 and finite. Answers are not checked: an
    engine that answers NaN is reported as doing so.

    Raises EngineError where the engine refuses the file (its own words in the message), where it would
    crash on it (without asking it), or where it lacks a joint of `model`.
    """

    name: ClassVar[str]
    """Of the engine: ``pinocchio``, ``pybullet``, ``mujoco``, ``drake``."""

    CALLS: ClassVar[Mapping[str, str]] = {}
    """Remedies at run time that this engine knows: id -> the line of code a user would write."""

    @abstractmethod
    def __init__(self, path: Path, model: Model, calls: Collection[str] = ()) -> None:
        """Load the file; `calls` are ids of `CALLS` to apply afterwards, others are ignored."""

    @classmethod
    @abstractmethod
    def engine_version(cls) -> str:
        """The version of the engine that is installed, such as ``3.2.7``."""

    @classmethod
    @abstractmethod
    def load_call(cls, floating: bool) -> str:
        """The documented call that loads a file, one line of code or several, as users write it."""

    @abstractmethod
    def describe(self) -> LoadedModel:
        """What the engine holds."""

    @abstractmethod
    def link_poses(self, q: Floats) -> Floats:
        """T_world_link (n_links, 4, 4) in the order of `model.links`; NaN for links it has not."""

    @abstractmethod
    def jacobian(self, q: Floats, link: str) -> Floats:
        """Geometric Jacobian (6, nv) of a link frame, linear rows first, axes of the world; NaN for a
        link it has not."""

    @abstractmethod
    def mass_matrix(self, q: Floats) -> Floats:
        """M (nv, nv)."""

    @abstractmethod
    def inverse_dynamics(self, q: Floats, v: Floats, a: Floats) -> Floats:
        """tau (nv,), as the engine computes it: with joint damping, say, if it adds that."""

    @abstractmethod
    def forward_dynamics(self, q: Floats, v: Floats, tau: Floats) -> Floats:
        """a (nv,)."""

    @abstractmethod
    def close(self) -> None:
        """Release what the engine holds."""

    def _solved_acceleration(self, q: Floats, v: Floats, tau: Floats) -> Floats:
        """a (nv,) from the engine's mass matrix and inverse dynamics; NaN where the matrix is singular.

        For an engine whose own forward dynamics would let a joint move that the model lacks.
        """
        bias = self.inverse_dynamics(q, v, np.zeros_like(v))
        try:
            return np.asarray(np.linalg.solve(self.mass_matrix(q), tau - bias))
        except np.linalg.LinAlgError:
            return np.full(len(tau), np.nan)

    def __enter__(self: Self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def lacking_joints(engine: str, model: Model, instead: Mapping[str, str]) -> EngineError:
    """The error of an engine in which joints of `model` do not have one degree of freedom.

    `instead` says what each of them is there, by name.
    """
    listed = ", ".join(f"{shown(name)} ({kind})" for name, kind in list(instead.items())[:5])
    return EngineError(f"{engine} lacks joints of {model.name} with one degree of freedom: {listed}")
