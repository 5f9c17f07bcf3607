"""Numbers in which robots differ: masses of links, payloads, coefficients of joints.

`Parameters` names those of one robot and says where they act, for engines (a `Model`) and for array code (a
`Mechanism`). The inputs of `dynx.parametric`, rows of a batch and draws of the episodes of an environment are
values of them; a scenario's differences between the robot that moves and the controller's model are
`plant_model`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from dynx.argument_types import checks_types
from dynx.errors import ArgumentError, UnknownNameError, nearest, shown
from dynx.model.elements import Inertial, Joint, JointCoefficients, JointDynamics, Link, Pose
from dynx.model.geometry import Geometry
from dynx.model.mechanism import ROOT, Mechanism, build_mechanism, springs_of
from dynx.model.model import Model
from dynx.model.numbers import MAX_MAGNITUDE, checked_array, checked_vector, is_real
from dynx.rbd.regressor import PARAMETERS, link_inertia
from dynx.spatial.inertia import RigidInertia, inertia_from_parameters, parameters_from_inertia
from dynx.spatial.scalar import Array, Floats
from dynx.spatial.so3 import skew

POINT = ("mass", "cx", "cy", "cz")
"""Parameters of a point payload: mass [kg] and centre of mass [m] in the axes of its frame."""

JOINT = ("damping", "friction", "armature")
"""Parameters of a joint: [N m s] or [N s/m], [N m] or [N], [kg m^2] or [kg]."""

SPRING = ("stiffness", "spring_reference")
"""Parameters of a joint's spring: [N m/rad] or [N/m], [rad] or [m]."""


@dataclass(frozen=True)
class Parameters:
    """Parameters of a robot, of which each value of `names` is a number; checked when it is constructed.

    - `links`: all ten inertial parameters of each of these links, which replace those of the model
    - `scaled`: a factor on mass and inertia of each of these links
    - `payload`: ten inertial parameters of a body fixed to this frame, about its origin and in its axes
    - `point_payload`: mass and position of a point mass fixed to this frame, in its axes
    - `joint_dynamics`: damping, dry friction and armature of every moving joint, and their springs in a robot
      that has any

    Raises UnknownNameError for an unknown link or frame, ArgumentError for a link named twice.
    """

    model: Model
    links: tuple[str, ...] = ()
    scaled: tuple[str, ...] = ()
    payload: str | None = None
    point_payload: str | None = None
    joint_dynamics: bool = False

    def __post_init__(self) -> None:
        named = (*self.links, *self.scaled)
        for link in named:
            self.model.link(link)
            if named.count(link) > 1:
                raise ArgumentError(f"link {shown(link)} is named twice")
        for frame in (self.payload, self.point_payload):
            if frame is not None:
                self.model.frame_index(frame)

    @property
    def choices(self) -> tuple[object, ...]:
        """All fields except the model."""
        return self.links, self.scaled, self.payload, self.point_payload, self.joint_dynamics

    @cached_property
    def _entries(self) -> tuple[tuple[str, float], ...]:
        """Names and defaults, in the order of the values."""
        found: list[tuple[str, float]] = []
        for link in self.links:
            own = parameters_from_inertia(link_inertia(self.model, link)).tolist()
            found += [(f"{link}.{name}", x) for name, x in zip(PARAMETERS, own, strict=True)]
        found += [(f"{link}.scale", 1.0) for link in self.scaled]
        if self.payload is not None:
            found += [(f"{self.payload}.payload.{name}", 0.0) for name in PARAMETERS]
        if self.point_payload is not None:
            found += [(f"{self.point_payload}.point.{name}", 0.0) for name in POINT]
        for joint in self._moving if self.joint_dynamics else ():
            found += [(f"{joint.name}.{name}", getattr(joint.dynamics, name)) for name in self.of_joint]
        return tuple(found)

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names, for example ``forearm.m``, ``pole.scale``, ``tool0.payload.mcx``, ``tool0.point.mass`` and
        ``elbow.damping``."""
        return tuple(name for name, _ in self._entries)

    @cached_property
    def defaults(self) -> Floats:
        """The model's own values (n,); 1 for a factor and 0 for a payload."""
        values = np.array([value for _, value in self._entries])
        values.setflags(write=False)
        return values

    def index(self, name: str) -> int:
        """Return the index of a parameter on the last axis; raises UnknownNameError."""
        try:
            return self.names.index(name)
        except ValueError:
            raise UnknownNameError(f"no parameter {shown(name)}{nearest(name, self.names)}") from None

    @property
    def _moving(self) -> tuple[Joint, ...]:
        return tuple(joint for joint in self.model.joints if joint.moves)

    @cached_property
    def of_joint(self) -> tuple[str, ...]:
        """Names of the parameters of a moving joint."""
        return JOINT + SPRING if any(joint.dynamics.stiffness for joint in self._moving) else JOINT

    def remainder(self) -> Mechanism:
        """Return the mechanism without the links whose inertia is a parameter."""
        links = [
            replace(link, inertial=None) if link.name in (*self.links, *self.scaled) else link
            for link in self.model.links
        ]
        return build_mechanism(replace(self.model, links=tuple(links)))

    def mechanism(self, remainder: Mechanism, values: Array) -> Mechanism:
        """Return the mechanism with values (n,) of any scalar, from `remainder` or a simplification of it."""
        given, inertia = self._split(values), self._inertia_of_links
        added = [
            (link, inertia_from_parameters(each))
            for link, each in zip(self.links, given.links.reshape(-1, len(PARAMETERS)), strict=True)
        ]
        if self.payload is not None:
            added.append((self.payload, inertia_from_parameters(given.payload)))
        if self.point_payload is not None:
            added.append((self.point_payload, point_mass(given.point[0], given.point[1:])))
        found = {ROOT: remainder.root, **{k: body.inertia for k, body in enumerate(remainder.bodies)}}
        for link, factor in zip(self.scaled, given.scaled, strict=True):
            frame, own = remainder.frames[self.model.frame_index(link)], inertia[link]
            # The constants of the link are placed in its body before they are scaled: a tenth of the
            # operations that ten parameters as inputs take.
            own = own.transform(frame.R, frame.p)
            found[frame.body] = found[frame.body] + RigidInertia(
                own.mass * factor, own.first_moment * factor, own.rotational_inertia * factor
            )
        for name, body in added:
            frame = remainder.frames[self.model.frame_index(name)]
            found[frame.body] = found[frame.body] + body.transform(frame.R, frame.p)
        bodies = tuple(replace(body, inertia=found[k]) for k, body in enumerate(remainder.bodies))
        return replace(remainder, root=found[ROOT], bodies=bodies)

    @cached_property
    def _inertia_of_links(self) -> dict[str, RigidInertia]:
        return {link: link_inertia(self.model, link) for link in self.scaled}

    def joints(self, values: Array) -> JointCoefficients | None:
        """Return the coefficients of the coordinates for values (..., n); None if they are no parameters."""
        if not self.joint_dynamics:
            return None
        count, n = len(self._moving), len(self.of_joint)
        rows = values[..., values.shape[-1] - n * count :]
        base = np.zeros((*rows.shape[:-1], 6 if self.model.floating else 0))
        # The numbers of a ball joint act about each of its three axes.
        spread = [k for k, joint in enumerate(self._moving) for _ in range(joint.n_rates)]
        columns = [rows[..., k::n][..., spread] for k in range(n)]
        springs, spring = None, columns[len(JOINT) :]
        if spring and (values.dtype == object or spring[0].any()):
            springs = springs_of(self.model.mechanism, *spring)
        damping, friction, armature = (
            np.concatenate([base, each], axis=-1) for each in columns[: len(JOINT)]
        )
        coupling = self.model.mechanism.coupling
        if coupling is not None:
            # Each joint follows at most one coordinate, so S' diag(x) S is diagonal.
            S = coupling.matrix()
            damping, friction, armature = damping @ S**2, friction @ abs(S), armature @ S**2
        return JointCoefficients(damping, friction, armature, springs)

    def model_of(self, values: Floats) -> Model:
        """Return the robot with values (n,), for engines.

        A payload is a link more, fixed to its frame. Raises ArgumentError for a payload or a factor that no
        body has.
        """
        given = self._split(np.asarray(values, dtype=np.float64))
        payloads = []
        if self.payload is not None:
            payloads.append(_payload(self.payload, inertia_from_parameters(given.payload)))
        if self.point_payload is not None:
            mass, *center = given.point.tolist()
            if mass:
                payloads.append(Payload(self.point_payload, mass, tuple(center)))
        whole = plant_model(
            self.model, payloads, dict(zip(self.scaled, given.scaled.tolist(), strict=True)) or 1.0
        )
        # A payload has no shapes.
        geometry = Geometry(self.model.geometry.links).for_links(link.name for link in whole.links)
        rows = zip(self.links, given.links.reshape(-1, len(PARAMETERS)), strict=True)
        own = {link: _payload(link, inertia_from_parameters(each)).inertial for link, each in rows}
        links = tuple(
            replace(link, inertial=own[link.name]) if link.name in own else link for link in whole.links
        )
        if not self.joint_dynamics:
            return replace(whole, links=links, geometry=geometry)
        moving = [joint.name for joint in self._moving]
        laws = dict(zip(moving, given.joints.reshape(-1, len(self.of_joint)).tolist(), strict=True))
        joints = tuple(
            replace(joint, dynamics=JointDynamics(**dict(zip(self.of_joint, laws[joint.name], strict=True))))
            if joint.name in laws
            else joint
            for joint in whole.joints
        )
        return replace(whole, links=links, joints=joints, geometry=geometry)

    def _split(self, values: Array) -> _Split:
        """Return the parts of values (n,)."""
        ten = len(PARAMETERS)
        sizes = (
            ten * len(self.links),
            len(self.scaled),
            0 if self.payload is None else ten,
            0 if self.point_payload is None else len(POINT),
        )
        return _Split(*np.split(values, np.cumsum(sizes)))


class _Split(NamedTuple):
    """Parts of the values of parameters."""

    links: Array
    scaled: Array
    payload: Array
    point: Array
    joints: Array


def point_mass(mass: Any, center: Array) -> RigidInertia:
    """Return the inertia of a mass [kg] at a place (3,) [m] about the origin, for any scalar."""
    C = skew(center)
    return RigidInertia(np.asarray(mass), center * mass, -(C @ C) * mass)


@dataclass(frozen=True)
class Payload:
    """A rigid body fixed to a frame of the robot.

    `mass` is in kg, and `center` (3,) [m] is the centre of mass in `frame`. `inertia` (3, 3) [kg m^2] is the
    tensor about the centre of mass, in the axes of `frame`. Without `inertia` the body is a point mass.
    Raises ArgumentError for a mass or an inertia that no body can have.
    """

    frame: str
    mass: float
    center: ArrayLike = (0.0, 0.0, 0.0)
    inertia: ArrayLike | None = None

    def __post_init__(self) -> None:
        if not isinstance(self.frame, str):
            raise ArgumentError(f"the frame of a payload is {shown(self.frame)}; wanted the name of a frame")
        if not is_real(self.mass) or not 0.0 <= float(self.mass) < MAX_MAGNITUDE:
            raise ArgumentError(
                f"the mass of a payload is {shown(self.mass)}; wanted a number of kilograms, 0 or more"
            )
        object.__setattr__(self, "mass", float(self.mass))
        checked_vector("center", self.center)
        if self.inertia is not None:
            tensor = checked_array("inertia", self.inertia, 3)
            if tensor.shape != (3, 3) or not np.array_equal(tensor, tensor.T):
                raise ArgumentError(
                    f"the inertia of a payload is {shown(self.inertia)}; wanted a symmetric matrix (3, 3)"
                )

    @property
    def inertial(self) -> Inertial:
        """Mass, centre of mass and inertia tensor in the axes of `frame`."""
        x, y, z = checked_vector("center", self.center).tolist()
        tensor = np.zeros((3, 3)) if self.inertia is None else np.asarray(self.inertia, dtype=float)
        (ixx, ixy, ixz), (_, iyy, iyz), (_, _, izz) = tensor.tolist()
        return Inertial(self.mass, Pose((x, y, z)), ixx, ixy, ixz, iyy, iyz, izz)


MassScale = float | Mapping[str, float]
"""One factor for all links, or one for each of some links."""


@checks_types
def plant_model(
    model: Model, payload: Payload | Sequence[Payload] | None = None, mass_scale: MassScale = 1.0
) -> Model:
    """Scale the masses and inertia tensors of `model`, then fix the payloads to their frames.

    Raises UnknownNameError for an unknown frame or link, ArgumentError for an invalid factor or payload.
    """
    payloads = [] if payload is None else [payload] if isinstance(payload, Payload) else list(payload)
    if not payloads and is_real(mass_scale) and mass_scale == 1.0:
        return model
    factors = {name: _factor(name, x) for name, x in _by_link(model, mass_scale).items()}
    links = [
        link if link.inertial is None else replace(link, inertial=_scaled(link.inertial, factors[link.name]))
        for link in model.links
    ]
    joints = list(model.joints)
    for number, body in enumerate(payloads):
        frame = model.frames[model.frame_index(body.frame)]
        name = _free(f"payload {number}", {*model.frame_names, *(joint.name for joint in model.joints)})
        links.append(Link(name, body.inertial))
        joints.append(Joint(name, "fixed", frame.link, name, origin=frame.placement))
    built = Model.build(model.name, links, joints)
    return replace(model, links=built.links, joints=built.joints, notes=(*model.notes, *built.notes))


def _by_link(model: Model, mass_scale: MassScale) -> dict[str, float]:
    if not isinstance(mass_scale, Mapping):
        return dict.fromkeys((link.name for link in model.links), mass_scale)
    for name in mass_scale:
        model.link(name)
    return {link.name: mass_scale.get(link.name, 1.0) for link in model.links}


def _factor(link: str, x: object) -> float:
    if is_real(x) and 0.0 < float(x) < MAX_MAGNITUDE:
        return float(x)
    raise ArgumentError(f"mass_scale of {shown(link)} is {shown(x)}; wanted a positive factor")


def _scaled(inertial: Inertial, factor: float) -> Inertial:
    numbers = {name: factor * getattr(inertial, name) for name in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")}
    return replace(inertial, mass=factor * inertial.mass, **numbers)


def _free(name: str, taken: set[str]) -> str:
    while name in taken:
        name += "'"
    return name


def _payload(frame: str, inertia: RigidInertia) -> Payload:
    """Return a body with an inertia about the origin of a frame."""
    from dynx.model.replaced_inertials import central_inertia  # most robots have no payload of ten parameters

    center, tensor = central_inertia(inertia)
    return Payload(frame, float(inertia.mass), tuple(center.tolist()), tensor)
