"""The interface that an engine implements to move a scene.

An implementation is given checked numbers only (`dynx.steppers.layout`): finite, in SI units and world axes,
and robots in the coordinates of their models (`dynx.Model`), mimic joints and floating bases included. Names,
frames, motors, the time and the check of every argument are those of `dynx.world.World`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from enum import Enum
from typing import Any, ClassVar, NamedTuple

from dynx.spatial.scalar import Floats
from dynx.steppers.forces import NO_FORCES, EngineCommand, Forces
from dynx.steppers.layout import Layout
from dynx.steppers.materials import EffectiveCoefficient
from dynx.steppers.settings import Setting
from dynx.steppers.state import BodyState, RobotState


class Feature(Enum):
    """Something that a stepper may have of its own; each value names it in messages."""

    CONTACTS = "contacts"
    """Contacts between the colliders that may touch."""
    LIMITS = "joint limits"
    """Joints that stop at `RobotLayout.lower` and `upper`."""
    DAMPING = "joint damping"
    DRY_FRICTION = "joint dry friction"
    ARMATURE = "joint armature"
    SPRINGS = "joint springs"
    MIMICS = "mimic joints"
    CONSTRAINTS = "welds and point-to-point constraints"
    """`Layout.constraints`."""


class TouchingPoint(NamedTuple):
    """A contact between two colliders, by their numbers, as `dynx.world.Contact` describes it."""

    a: int
    b: int
    point_a: Floats
    point_b: Floats
    normal: Floats
    """Unit vector (3,) from b to a."""
    distance: float
    normal_force: float = 0.0
    friction_force: Floats | None = None
    """Force (3,) on a [N]; None in a query of distances."""


class SlidingFace(NamedTuple):
    """A body that slides on a surface which carries its weight."""

    mass: float
    """Mass of the body [kg]."""
    gravity: float
    """Acceleration of gravity towards the surface [m/s^2], above 0."""
    friction: float
    """Coefficient of friction of the two."""
    slip: float
    """Speed of the slide [m/s]."""
    size: tuple[float, float, float]
    """Extents of the body along the slide, across it, and along the normal [m]."""
    load: float
    """Place of the load: from 0, below the centre of mass, to 1, at the front end, where bodies tip."""
    flat: bool
    """True if the body touches with a face: all its shapes are boxes or cylinders."""


class Stepper(ABC):
    """A scene inside an engine, which advances in steps of `dt` [s].

    A subclass has this constructor. A package offers it by an entry point in the group ``dynx.steppers``.
    Where a method fails it raises `EngineError`; the engine's own exceptions do not reach the caller.
    """

    name: ClassVar[str]
    """Name by which users choose the engine."""

    settings: ClassVar[Mapping[str, Setting]] = {}
    """Settings of the engine's solver and contacts that users may change, with their defaults."""

    commands: ClassVar[tuple[type[EngineCommand], ...]] = ()
    """Classes of the commands that the engine's own motors take (`Forces.commands`)."""

    takes_ball_joints: ClassVar[bool] = False
    """True for an engine that moves robots with ball joints; others refuse these by name."""

    inexact: ClassVar[Mapping[Feature, str]] = {}
    """Damping, dry friction and armature of joints that the engine has with an error, each with the kind of
    the error as a clause. Of a robot that neither contacts nor constraints can reach,
    `dynx.world.World` computes these joint dynamics outside of the engine, where they are exact; otherwise
    its notes name them."""

    replaced_shapes: ClassVar[Mapping[type, str]] = {}
    """Classes of shapes that the engine collides as others, each with the other and its deviation as a noun
    phrase; the notes of a world name them."""

    contact_law: ClassVar[str] = "contacts of its own"
    """Laws of contacts and joint limits of the engine, as a noun phrase."""

    beyond_limits: ClassVar[str] = "so that it is pushed back in the first steps"
    """Motion of a joint that begins beyond its limits, as a clause."""

    native_queries: ClassVar[str] = ""
    """Class of the engine's own queries (`dynx.steppers.native_queries`), as "package.module:Class"; imported
    when it is used."""

    def __init__(self, layout: Layout, dt: float, settings: Mapping[str, Any]) -> None:
        """Build the world at the start that `layout` describes; `settings` has a value for every name in
        `settings`."""
        self.layout = layout
        self.dt = dt

    @classmethod
    def require_engine(cls) -> None:
        """Raise NotInstalledError where the engine is not installed."""
        return

    @classmethod
    @abstractmethod
    def provides(cls, layout: Layout) -> frozenset[Feature]:
        """Return what the engine has for this scene.

        The constructor gets a layout without damping, dry friction, armature and springs of joints that the
        engine does not have: `dynx.world.World` computes them outside of it. It refuses a scene that needs
        any other feature which is missing.
        """

    @classmethod
    def settings_in_effect(cls, settings: Mapping[str, Any], dt: float) -> Mapping[str, Any]:
        """Return the values in effect of those settings that the engine changes in steps of `dt` [s]."""
        return {}

    def effective_materials(self) -> Mapping[str, EffectiveCoefficient]:
        """Return, by name, the coefficients of contact that the engine does not have for every pair of
        materials as `dynx.steppers.material.geometric_means` gives them."""
        return {}

    def sliding_fault(self, slide: SlidingFace) -> str | None:
        """Return what the engine does wrong with a slide in steps of this length, as a clause that begins
        with a verb; None for a slide that it has right."""
        return None

    # -- motion -------------------------------------------------------------------------------

    @abstractmethod
    def step(self, n: int, forces: Forces = NO_FORCES) -> None:
        """Take `n` steps of `dt`, in which these forces act, and no others."""

    def damps_at_end(self, robot: int) -> bool:
        """Check whether the engine's damping of the joints is that of the velocity at the end of a step, not
        at its beginning."""
        return True

    @property
    def solves_motors(self) -> bool:
        """True for an engine that takes motors whose law holds at the end of a step (`Forces.motors`), and
        solves for it together with everything else that acts in the step."""
        return False

    def motor_torque(self, robot: int) -> Floats | None:
        """Return the torque (nv,) of the engine's own motors in the last step, for a robot with a command or
        with motors at the end of a step; NaN for joints of which the engine does not report it. None for an
        engine without such motors."""
        return None

    # -- state --------------------------------------------------------------------------------

    @abstractmethod
    def robot_state(self, robot: int) -> RobotState:
        """Return new arrays q (nq,), v (nv,); NaN or infinity where the engine has diverged."""

    def joint_state(self, robot: int) -> RobotState:
        """Return new arrays of the positions and velocities (n,) of the joints of `robot_state`, which motors
        read before every step: that of a base may take longer than the joints'."""
        q, v = self.robot_state(robot)
        floating = self.layout.robots[robot].model.floating
        return RobotState(q[7:], v[6:]) if floating else RobotState(q, v)

    @abstractmethod
    def body_state(self, body: int) -> BodyState:
        """Return new arrays, as `robot_state` does."""

    @abstractmethod
    def set_robot_state(self, robot: int, q: Floats, v: Floats) -> None:
        """Set the state of a robot; from then on there are no contacts and forces of a last step."""

    @abstractmethod
    def set_body_state(self, body: int, T: Floats, twist: Floats) -> None:
        """Set the pose (4, 4) and twist (6,) of a body that moves."""

    @abstractmethod
    def dump(self) -> bytes:
        """Return everything that determines the later steps, forces excepted.

        A world that continues and one that was restored take the same steps, bit for bit, also in another
        process.
        """

    @abstractmethod
    def load(self, data: bytes) -> None:
        """Continue from what `dump` returned for the same layout, `dt` and settings in this version of the
        engine. The caller has checked that the bytes are those."""

    # -- queries ------------------------------------------------------------------------------

    @abstractmethod
    def contacts(self) -> Sequence[TouchingPoint]:
        """Return the contacts of the last step with their forces; after a change of the state, those of the
        new state without forces. Pairs that do not collide are left out."""

    def touching_pairs(self) -> Iterable[tuple[int, int]]:
        """Return the pairs of colliders that have a contact in `contacts`, in any order, also repeated."""
        return [(point.a, point.b) for point in self.contacts()]

    def notes(self) -> Sequence[str]:
        """Return a sentence for each kind of fault in the steps so far that the engine knows of."""
        return ()

    # -- end ----------------------------------------------------------------------------------

    @property
    @abstractmethod
    def version(self) -> str:
        """Version of the engine, which a saved state records."""

    @abstractmethod
    def close(self) -> None:
        """Release what the engine holds; closing twice is harmless."""
