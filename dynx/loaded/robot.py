"""The interface of a robot that an engine has loaded from its file."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import ClassVar, TypeVar

import numpy as np

from dynx.errors import EngineError, UnusableEngineError, shown
from dynx.loaded.description import LoadedModel
from dynx.model import Model
from dynx.spatial.scalar import Floats

Self = TypeVar("Self", bound="LoadedRobot")


class LoadedRobot(ABC):
    """A URDF file as one engine loads it, with results in the coordinates of dynx.

    `model` defines the coordinates: its base, its gravity, its links and its moving joints (mimic joints have
    to be set free in it). It gives names and order only; what the engine loaded is not corrected by it.
    Coordinates that the engine has and the model lacks are held at zero.

    Each method takes one sample: q (nq,), v, a, tau (nv,), float64 and finite. Results are not checked:
    NaN from an engine is returned.

    Raises EngineError if the engine refuses the file (with the engine's message), and UnusableEngineError if
    it would crash on the file (which is then not passed to the engine), if its results are undefined, and if
    it lacks a joint of `model`.
    """

    name: ClassVar[str]
    """Name of the engine: ``pinocchio``, ``pybullet``, ``mujoco``, ``drake``; of a loading variant, another
    documented call of an engine, ``ENGINE:VARIANT``, such as ``pybullet:plain``."""

    CALLS: ClassVar[Mapping[str, str]] = {}
    """Engine settings that are remedies at run time: id -> the line of code a user would write."""

    refuses_without: ClassVar[tuple[str, ...]] = ()
    """The parts of a link, ``visual`` or ``collision``, for whose missing mesh file the engine refuses the
    whole description."""

    searches_above: ClassVar[bool] = False
    """True if the engine searches meshes in the folders above the description (`find_by_bullet`)."""

    loads_meshes: ClassVar[bool] = False
    """True if mesh collision shapes change the dynamics of a link that states its inertia."""

    @abstractmethod
    def __init__(self, path: Path, model: Model, calls: Collection[str] = ()) -> None:
        """Load the file; `calls` are ids of `CALLS` to apply afterwards; unknown ids are ignored."""

    @classmethod
    @abstractmethod
    def engine_version(cls) -> str:
        """Return the version of the engine that is installed, such as ``3.2.7``."""

    @classmethod
    @abstractmethod
    def load_call(cls, floating: bool) -> str:
        """Return the documented call that loads a file, as the line or lines of code that users write."""

    @abstractmethod
    def describe(self) -> LoadedModel:
        """Return the model that the engine holds."""

    @abstractmethod
    def link_poses(self, q: Floats) -> Floats:
        """Return T_world_link (n_links, 4, 4) in the order of `model.links`; NaN for links that it lacks."""

    @abstractmethod
    def jacobian(self, q: Floats, link: str) -> Floats:
        """Return the geometric Jacobian (6, nv) of a link frame, linear rows first, axes of the world; NaN
        for a link that it lacks."""

    @abstractmethod
    def mass_matrix(self, q: Floats) -> Floats:
        """Return M (nv, nv)."""

    @abstractmethod
    def inverse_dynamics(self, q: Floats, v: Floats, a: Floats) -> Floats:
        """Return tau (nv,) as the engine computes it, with joint damping, say, if the engine adds it."""

    @abstractmethod
    def forward_dynamics(self, q: Floats, v: Floats, tau: Floats) -> Floats:
        """Return a (nv,)."""

    def contacts(self, q: Floats) -> Mapping[tuple[str, str], float]:
        """Return the pairs of links whose contact adds forces, each with the depth [m] of the penetration.

        Empty in an engine whose equations of motion have no contacts.
        """
        return {}

    @abstractmethod
    def close(self) -> None:
        """Release the resources of the engine."""

    def _solved_acceleration(self, q: Floats, v: Floats, tau: Floats) -> Floats:
        """Return a (nv,) from the engine's mass matrix and inverse dynamics; NaN where the matrix
        is singular.

        This replaces an engine's own forward dynamics where that would move a joint which the model lacks.
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


def require_file(path: Path) -> None:
    """Raise EngineError for anything but a regular file: engines crash on a folder and hang on a pipe."""
    if not path.is_file():
        raise EngineError(f"no regular file to load: {shown(path, 300)}")


def lacking_joints(engine: str, model: Model, instead: Mapping[str, str]) -> UnusableEngineError:
    """Return the error of an engine in which joints of `model` do not have one degree of freedom.

    `instead` maps the name of each to its type in the engine.
    """
    listed = ", ".join(f"{shown(name)} ({kind})" for name, kind in list(instead.items())[:5])
    return UnusableEngineError(f"{engine} lacks joints of {model.name} with one degree of freedom: {listed}")
