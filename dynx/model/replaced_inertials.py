"""Inertials that a program gives to links of a robot, such as those identified from a log."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from dynx.argument_types import checks_types
from dynx.errors import ArgumentError, ShapeError, shown
from dynx.model.elements import Inertial, Link, Note, Pose
from dynx.model.model import Model, missing_inertial_notes
from dynx.model.numbers import checked_array
from dynx.model.topology import refuse_unbounded_numbers
from dynx.model.urdf.reader import inertia_fault
from dynx.spatial.inertia import RigidInertia, inertia_from_parameters
from dynx.spatial.scalar import Floats
from dynx.spatial.so3 import skew


def central_inertia(inertia: RigidInertia) -> tuple[Floats, Floats]:
    """Return the centre of mass (3,) [m], and the inertia tensor (3, 3) about it [kg m^2].

    Without mass, the centre is the origin.
    """
    mass, moment = float(inertia.mass), np.asarray(inertia.first_moment, dtype=np.float64)
    center = moment / mass if mass else np.zeros(3)
    C = skew(center)
    tensor = np.asarray(inertia.rotational_inertia, dtype=np.float64) + mass * (C @ C)
    return center, 0.5 * (tensor + tensor.T)


def inertial_from_parameters(kind: type[Inertial], parameters: ArrayLike) -> Inertial:
    """Return the inertial with ten inertial parameters (10,); see `Inertial.from_parameters`."""
    ten = checked_array("parameters", parameters, 10)
    if ten.ndim != 1:
        raise ShapeError(f"parameters has shape {ten.shape}; wanted (10,), those of one link")
    if not ten[0] and ten[1:4].any():
        raise ArgumentError(
            "parameters has the mass 0 and first moments that are not 0, which no Inertial has; a fit of the "
            "difference from dynx.inertial_parameters(model) keeps the masses that a log does not determine"
        )
    center, tensor = central_inertia(inertia_from_parameters(ten))
    x, y, z = center.tolist()
    (ixx, ixy, ixz), (_, iyy, iyz), (_, _, izz) = tensor.tolist()
    return kind(float(ten[0]), Pose((x, y, z)), ixx, ixy, ixz, iyy, iyz, izz)


@checks_types
def with_inertials(model: Model, inertials: Mapping[str, Inertial]) -> Model:
    """Return a robot whose links have these inertials, by name; see `Model.with_inertials`."""
    changed = {model.link(name).name: replace(each, line=None) for name, each in inertials.items()}
    links = tuple(replace(link, inertial=changed.get(link.name, link.inertial)) for link in model.links)
    own = (Link(name, each) for name, each in changed.items())
    refuse_unbounded_numbers(own, (), "the argument inertials")
    given = [link for link in model.links if link.name in changed]
    settled = {note.message for note in missing_inertial_notes(given, model.joints)}
    kept = [note for note in model.notes if note.message not in settled]
    return replace(model, links=links, notes=(*kept, *_notes(links, changed)))


def _notes(links: tuple[Link, ...], changed: Mapping[str, Inertial]) -> Iterator[Note]:
    for link in links:
        if link.name in changed:
            mass, fault = changed[link.name].mass, inertia_fault(changed[link.name])
            if mass < 0.0:
                yield Note(f"the mass of link {shown(link.name)} is {mass:.6g} kg, which no body has")
            if fault is not None:
                yield Note(f"the inertia of link {shown(link.name)} {fault}")
