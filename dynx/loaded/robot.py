"""Interface of a robot that an engine has loaded from its file: its description, quantities and calls."""

from __future__ import annotations

import os
from abc import ABC, abstractmethod
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import ClassVar, TypeVar

import numpy as np

from dynx.errors import DescriptionError, EngineError, UnusableEngineError, shown
from dynx.model import Model
from dynx.model.document_format import Format, format_of_root
from dynx.model.xml.source import XmlSource
from dynx.spatial.scalar import Floats

Bounds = tuple[float, float]


@dataclass(frozen=True, eq=False)
class LoadedInertial:
    """The inertia that an engine holds for a link, including links that are merged into it.

    `mass` is in kg, and `center` (3,) [m] is the centre of mass in the link frame. `inertia` (3, 3) [kg m^2]
    is the tensor about the centre of mass, in the axes of the link frame. `merged` names the other links
    whose inertia is included, because the engine merges links that fixed joints connect.
    """

    mass: float
    center: Floats
    inertia: Floats
    merged: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class LoadedJoint:
    """The properties that an engine holds for a joint that moves; None where it reports none.

    `placement` (4, 4) is the pose of the joint frame at value 0 in the frame of the URDF parent link. `axis`
    (3,) is the engine's axis in the joint frame; its length need not be 1.
    """

    type: str
    placement: Floats | None = None
    axis: Floats | None = None
    limits: Bounds | None = None
    velocity: float | None = None
    effort: float | None = None
    damping: float | None = None
    friction: float | None = None
    armature: float | None = None


@dataclass(frozen=True, eq=False)
class LoadedModel:
    """The whole model as the engine reports it.

    `links` has an entry for each link that still exists in the engine, `joints` for each joint that
    moves there. `base_frame` (4, 4) is the pose of the root link in the world at the neutral
    configuration, `gravity` (3,) [m/s^2] the engine's default.
    """

    engine: str
    links: Mapping[str, LoadedInertial]
    joints: Mapping[str, LoadedJoint]
    base_frame: Floats
    gravity: Floats
    missing_links: tuple[str, ...] = ()
    remarks: tuple[str, ...] = field(default=())


@dataclass(frozen=True, eq=False)
class EngineBase:
    """Position of the coordinates of a floating base in the q and v of an engine."""

    q: tuple[int, ...]
    """Indices in the engine's q of position x, y, z, then quaternion x, y, z, w."""
    v: tuple[int, ...]
    """Indices in the engine's v of the linear, then the angular velocity."""
    linear_in_world: bool
    """True if the linear velocity is in axes of the world, False in those of the base."""
    angular_in_world: bool
    """True if the angular velocity is in axes of the world, False in those of the base."""
    T_base_frame: Floats = field(default_factory=lambda: np.eye(4))
    """Pose (4, 4) of the engine's base frame, to which these entries refer, in dynx's base frame."""


@dataclass(frozen=True, eq=False)
class EngineCoordinates:
    """Where an engine has the joints of a model in its q and v."""

    neutral: Floats
    """The q of the engine with all joints at 0."""
    n_velocities: int
    """Length of the v of the engine."""
    joints_q: tuple[int, ...]
    """Index in q of each position of the joints, in the order of `Model.position_names`: one of a joint, and
    four of a ball joint."""
    joints_v: tuple[int, ...]
    """Index in v of each coordinate of the joints, in the order of `Model.coordinate_names`."""
    circles: tuple[bool, ...]
    """True for each position of the joints whose angle q states by cosine and sine."""
    base: EngineBase | None = None


Self = TypeVar("Self", bound="LoadedRobot")


class LoadedRobot(ABC):
    """A file as one engine loads it, with results in the coordinates of dynx.

    `model` defines the coordinates: its base, its gravity, its links and its moving joints (mimic joints have
    to be set free in it). It gives only names and order, and does not correct what the engine loaded.
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

    takes_ball_joints: ClassVar[bool] = False
    """True for an engine whose coordinates of ball joints are known; others refuse such robots."""

    FORMATS: ClassVar[tuple[Format, ...]] = ("urdf",)
    """Formats of the files that the engine, as it is installed, loads by itself."""

    CALLS: ClassVar[Mapping[str, str]] = {}
    """Engine settings that are remedies at run time: id -> the line of code a user would write."""

    STEP_DEFAULTS: ClassVar[Mapping[str, str]] = {}
    """Effects that a step of the engine adds although no file states them: effect -> the line of code that
    switches it off. No result of this class includes them."""

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
    def load_call(cls, floating: bool, root: str | None = None, form: Format = "urdf") -> str:
        """Return the documented call that loads a file, as the line or lines of code that users write.

        `root` is the name of the root link, on which the call may depend, `form` the format of the file: MJCF
        and SDF state themselves whether the base floats.
        """

    @abstractmethod
    def describe(self) -> LoadedModel:
        """Return the model that the engine holds."""

    def coordinates(self) -> EngineCoordinates:
        """Return where the engine has the joints of the model; EngineError where it does not say."""
        raise UnusableEngineError(f"{self.name} does not say in which order it has its coordinates")

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
        """Return tau (nv,) as the engine computes it, including joint damping if the engine adds it."""

    @abstractmethod
    def forward_dynamics(self, q: Floats, v: Floats, tau: Floats) -> Floats:
        """Return a (nv,)."""

    def contacts(self, q: Floats) -> Mapping[tuple[str, str], float]:
        """Return the pairs of shapes whose contact adds forces, each with the depth [m] of the penetration.

        A shape is identified by its name in the document. A shape without a name is identified by the link in
        which the engine has it, which may be a link that others are merged into. Empty in an engine whose
        equations of motion have no contacts.
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
    if not os.path.isfile(path):
        raise EngineError(f"no regular file to load: {shown(path, 300)}")


_NAMES = {"urdf": "URDF", "mjcf": "MJCF", "sdf": "SDF"}


def format_name(form: Format) -> str:
    """Return the name of a format, as sentences have it."""
    return _NAMES[form]


def checked_format(kind: type[LoadedRobot], path: Path) -> Format:
    """Return the format of a file.

    Raises EngineError for no file or no XML, UnusableEngineError for a format that the engine does not load.
    """
    require_file(path)
    if path.suffix.lower() == ".urdf":
        return "urdf"
    try:
        form = format_of_root(XmlSource(path.read_bytes(), str(path)).root.tag)
    except DescriptionError as error:
        raise EngineError(f"{kind.name} cannot load a file that is not XML: {error}") from error
    if form not in kind.FORMATS:
        raise UnusableEngineError(f"{kind.name}, as it is installed, loads no {format_name(form)}")
    return form


def lacking_joints(engine: str, model: Model, instead: Mapping[str, str]) -> UnusableEngineError:
    """Return the error of an engine in which joints of `model` do not have one degree of freedom.

    `instead` maps the name of each to its type in the engine.
    """
    listed = ", ".join(f"{shown(name)} ({kind})" for name, kind in list(instead.items())[:5])
    return UnusableEngineError(f"{engine} lacks joints of {model.name} with one degree of freedom: {listed}")


def call_on_joint(call: str, joint: str) -> str:
    """Return the address of a call on one joint."""
    return f"{call}@{joint}"


def called_joints(calls: Collection[str], call: str, joints: Collection[str]) -> Iterator[str]:
    """Yield those of the `joints` on which `call` is made: all of them by a call on the whole robot."""
    return (joint for joint in joints if call in calls or call_on_joint(call, joint) in calls)
