"""Selection of the parameters of a robot that are arguments, and their place in the mechanism."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from dynx.errors import ArgumentError, UnknownNameError, nearest, shown
from dynx.model import Mechanism, Model
from dynx.model.mechanism import ROOT, build_mechanism
from dynx.rbd.regressor import PARAMETERS, inertia_from_parameters, link_inertia, parameters_from_inertia
from dynx.spatial.inertia import RigidInertia
from dynx.spatial.scalar import Array, Floats
from dynx.spatial.so3 import skew

POINT = ("mass", "cx", "cy", "cz")
"""Parameters of a point payload: mass [kg] and centre of mass [m] in the axes of its frame."""

JOINT = ("damping", "friction", "armature")
"""Parameters of a joint: [N m s] or [N s/m], [N m] or [N], [kg m^2] or [kg]."""


@dataclass(frozen=True, eq=False)
class Parameters:
    """The parameters of a robot that are arguments.

    `names` are for example ``forearm.m``, ``tool0.payload.mcx``, ``tool0.point.mass`` and ``elbow.damping``;
    `defaults` (n,) are the model's own, zeros for a payload.
    """

    names: tuple[str, ...]
    defaults: Floats

    def index(self, name: str) -> int:
        """Return the index of a parameter on the last axis; raises UnknownNameError."""
        try:
            return self.names.index(name)
        except ValueError:
            raise UnknownNameError(f"no parameter {shown(name)}{nearest(str(name), self.names)}") from None


@dataclass(frozen=True)
class ParameterValues:
    """Bodies to add to the mechanism, by the number of the frame to which they are fixed, and damping,
    friction and armature of the joints (n, 3)."""

    bodies: tuple[tuple[int, RigidInertia], ...]
    joints: Array | None

    def added_to(self, mechanism: Mechanism) -> Mechanism:
        """Return the mechanism with these bodies rigidly connected to it."""
        inertia = {ROOT: mechanism.root, **{k: body.inertia for k, body in enumerate(mechanism.bodies)}}
        for number, added in self.bodies:
            frame = mechanism.frames[number]
            inertia[frame.body] = inertia[frame.body] + added.transform(frame.R, frame.p)
        bodies = tuple(replace(body, inertia=inertia[k]) for k, body in enumerate(mechanism.bodies))
        return replace(mechanism, root=inertia[ROOT], bodies=bodies)


@dataclass(frozen=True)
class Selection:
    """Parameters of `model` that are arguments; checked when it is constructed."""

    model: Model
    links: tuple[str, ...]
    payload: str | None
    point_payload: str | None
    joint_dynamics: bool

    def __post_init__(self) -> None:
        for link in self.links:
            self.model.link(link)
            if self.links.count(link) > 1:
                raise ArgumentError(f"link {shown(link)} is named twice")
        for frame in (self.payload, self.point_payload):
            if frame is not None:
                self.model.frame_index(frame)

    @property
    def choices(self) -> tuple[object, ...]:
        """All fields except the model."""
        return self.links, self.payload, self.point_payload, self.joint_dynamics

    def parameters(self) -> Parameters:
        """Return the names and defaults of the parameters."""
        names: list[str] = []
        defaults: list[Floats] = []
        for link in self.links:
            names += [f"{link}.{name}" for name in PARAMETERS]
            defaults.append(parameters_from_inertia(link_inertia(self.model, link)))
        if self.payload is not None:
            names += [f"{self.payload}.payload.{name}" for name in PARAMETERS]
            defaults.append(np.zeros(len(PARAMETERS)))
        if self.point_payload is not None:
            names += [f"{self.point_payload}.point.{name}" for name in POINT]
            defaults.append(np.zeros(len(POINT)))
        if self.joint_dynamics:
            for joint in self.model.joints:
                if joint.moves:
                    own = joint.dynamics
                    names += [f"{joint.name}.{name}" for name in JOINT]
                    defaults.append(np.array([own.damping, own.friction, own.armature]))
        whole = np.concatenate(defaults) if defaults else np.zeros(0)
        whole.setflags(write=False)
        return Parameters(tuple(names), whole)

    def remainder(self) -> Mechanism:
        """Return the mechanism without the links whose inertia is an argument."""
        links = [
            replace(link, inertial=None) if link.name in self.links else link for link in self.model.links
        ]
        return build_mechanism(replace(self.model, links=tuple(links)))

    def read(self, parameters: Array) -> ParameterValues:
        """Return the values in an array (n,) of parameters."""
        values = iter(parameters)
        bodies = [
            (self.model.frame_index(link), inertia_from_parameters(_next(values, 10))) for link in self.links
        ]
        if self.payload is not None:
            bodies.append((self.model.frame_index(self.payload), inertia_from_parameters(_next(values, 10))))
        if self.point_payload is not None:
            mass, *center = _next(values, len(POINT))
            bodies.append((self.model.frame_index(self.point_payload), point_mass(mass, np.array(center))))
        if not self.joint_dynamics:
            return ParameterValues(tuple(bodies), None)
        moving = sum(joint.moves for joint in self.model.joints)
        return ParameterValues(tuple(bodies), _next(values, len(JOINT) * moving).reshape(moving, len(JOINT)))


def _next(values: Iterator[object], count: int) -> Array:
    return np.array([next(values) for _ in range(count)], dtype=object)


def point_mass(mass: object, center: Array) -> RigidInertia:
    """Return the inertia of a mass [kg] at a place (3,) [m] about the origin, for any scalar."""
    C = skew(center)
    return RigidInertia(np.asarray(mass), center * mass, -(C @ C) * mass)
