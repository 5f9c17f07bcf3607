"""Differences between the robot of the plant and the model of the controller: payloads and scaled masses."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from dynx.errors import ArgumentError, shown
from dynx.model import Model
from dynx.model.elements import Inertial, Joint, Link, Pose
from dynx.model.numbers import MAX_MAGNITUDE, checked_array, checked_vector, is_real


@dataclass(frozen=True)
class Payload:
    """A rigid body fixed to a frame of the robot.

    `mass` is in kg, `center` (3,) [m] is the centre of mass in `frame`, and `inertia` (3, 3) [kg m^2] the
    tensor about it in the axes of `frame`. The default is a point mass. Raises ArgumentError for numbers that
    no body has.
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
                raise ArgumentError("the inertia of a payload is not a symmetric matrix (3, 3)")


MassScale = float | Mapping[str, float]
"""One factor for all links, or one for each of some links."""


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
        links.append(Link(name, _inertial(body)))
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


def _inertial(payload: Payload) -> Inertial:
    x, y, z = checked_vector("center", payload.center).tolist()
    tensor = np.zeros((3, 3)) if payload.inertia is None else np.asarray(payload.inertia, dtype=float)
    (ixx, ixy, ixz), (_, iyy, iyz), (_, _, izz) = tensor.tolist()
    return Inertial(payload.mass, Pose((x, y, z)), ixx, ixy, ixz, iyy, iyz, izz)


def _free(name: str, taken: set[str]) -> str:
    while name in taken:
        name += "'"
    return name
