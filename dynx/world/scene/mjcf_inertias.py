"""Inertias of robots and bodies as elements of MJCF, MuJoCo's format of models.

MuJoCo refuses negative masses and moments, principal moments of which one exceeds the sum of the others, and
bodies that move without a mass and three moments of their own or of a body fixed to them.
"""

from __future__ import annotations

from dataclasses import dataclass
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from dynx.errors import UnsupportedFeatureError, shown
from dynx.model.elements import Inertial
from dynx.model.geometry.mjcf import quat_text, text
from dynx.spatial.extended import FLOAT64_EPS, jacobi_eigen, longdouble
from dynx.spatial.inertia import RigidInertia
from dynx.spatial.scalar import Array, Floats
from dynx.spatial.so3 import rotation_from_rpy, skew
from dynx.world.scene.filters import merged_links
from dynx.world.scene.robots import SceneRobot

LEAST_INERTIA = 1e-15
"""Mass [kg] and principal moment [kg m^2] that MuJoCo requires of bodies that move (mjMINVAL)."""

ROUNDING = 1e-9
"""Excess of the largest principal moment over the sum of the others, relative to it, that counts as
rounding."""


@dataclass(frozen=True, eq=False)
class PrincipalInertia:
    """A mass, its centre (3,) and principal moments (3,), whose axes are the columns of `axes` (3, 3)."""

    mass: float
    center: Floats
    moments: Floats
    axes: Array

    @classmethod
    def of(cls, mass: float, center: Array, tensor: Array, R: Array) -> PrincipalInertia:
        """Return the inertia with this tensor (3, 3) about the centre of mass, in axes R (3, 3)."""
        principal, axes = jacobi_eigen(longdouble(tensor))
        moments = np.asarray(principal, dtype=np.float64)
        scale = float(np.max(np.abs(moments)))
        moments[np.abs(moments) <= 4.0 * FLOAT64_EPS * scale] = 0.0
        largest = int(np.argmax(moments))
        others = float(np.delete(moments, largest).sum())
        if others < moments[largest] <= others + ROUNDING * scale:
            moments[largest] = others
        return cls(float(mass), np.asarray(center, dtype=np.float64), moments, R @ axes)

    @property
    def fault(self) -> str | None:
        """Reason for which MuJoCo refuses the inertia, also of a body that is fixed."""
        if self.mass < 0.0 or self.moments.min() < 0.0:
            return f"has the mass {self.mass:.4g} kg and the least moment {self.moments.min():.4g} kg m^2"
        if 2.0 * self.moments.max() > self.moments.sum() * (1.0 + FLOAT64_EPS):
            numbers = ", ".join(f"{moment:.4g}" for moment in self.moments)
            return f"has the principal moments {numbers} kg m^2, of which one exceeds the others' sum"
        return None

    @property
    def suffices_to_move(self) -> bool:
        """True if MuJoCo lets a body with this inertia move."""
        return bool(self.mass >= LEAST_INERTIA and self.moments.min() >= LEAST_INERTIA)

    def add_to(self, body: Element) -> None:
        """Add the inertia to a body."""
        given = {"pos": text(self.center), "quat": quat_text(self.axes)}
        SubElement(body, "inertial", given, mass=repr(self.mass), diaginertia=text(self.moments))


def add_inertial(body: Element, inertial: Inertial, name: str, source: str) -> None:
    """Add the inertia of a body that moves; raise UnsupportedFeatureError for one that MuJoCo refuses."""
    _add_moving(body, _of_link(inertial), name, source, inertial.line)


def add_inertias(robot: SceneRobot, bodies: dict[str, Element]) -> None:
    """Add the inertias of the links of a robot to its bodies.

    Where MuJoCo refuses those of links that fixed joints connect, the first of these links gets their merged
    inertia, which moves alike. In a fixed base, which does not move, refused ones are left out. Raises
    UnsupportedFeatureError where MuJoCo refuses the merged inertia too.
    """
    model = robot.model
    heads = merged_links(model)
    moving = {joint.joint: joint.inertia for joint in model.mechanism.bodies}
    merged = {joint.child: moving[joint.name] for joint in model.joints if joint.moves}
    if model.floating:
        merged[model.root] = model.mechanism.root
    groups: dict[str, dict[str, PrincipalInertia]] = {head: {} for head in heads.values()}
    for link in model.links:
        if link.inertial is not None and link.inertial != Inertial():
            groups[heads[link.name]][link.name] = _of_link(link.inertial)
    for head, group in groups.items():
        sound = {name: inertia for name, inertia in group.items() if inertia.fault is None}
        suffices = len(sound) == len(group) and any(each.suffices_to_move for each in group.values())
        if head in merged and not suffices:
            name, line = f"{robot.name}/{head}", model.link(head).line
            _add_moving(bodies[head], _of_rigid(merged[head]), name, model.source, line)
            continue
        for name, inertia in sound.items():
            inertia.add_to(bodies[name])


def _of_link(inertial: Inertial) -> PrincipalInertia:
    R = rotation_from_rpy(longdouble(inertial.origin.rpy))
    return PrincipalInertia.of(inertial.mass, np.array(inertial.origin.xyz), inertial.tensor, R)


def _of_rigid(inertia: RigidInertia) -> PrincipalInertia:
    mass = longdouble(inertia.mass)
    center = longdouble(inertia.first_moment) / mass if mass else longdouble(np.zeros(3))
    arm = skew(center)
    tensor = longdouble(inertia.rotational_inertia) + mass * (arm @ arm)
    return PrincipalInertia.of(float(mass), center, tensor, np.eye(3))


def _add_moving(body: Element, inertia: PrincipalInertia, name: str, source: str, line: int | None) -> None:
    fault = inertia.fault
    if fault is None and not inertia.suffices_to_move:
        moments = ", ".join(f"{moment:.4g}" for moment in inertia.moments)
        fault = (
            f"moves with a mass of {inertia.mass:.4g} kg and the principal moments {moments} kg m^2, links "
            "fixed to it included"
        )
    if fault is not None:
        raise UnsupportedFeatureError(
            f"{shown(name)} {fault}; MuJoCo refuses that: wanted a positive mass and three positive moments, "
            "none above the sum of the others",
            source=source,
            line=line,
        )
    inertia.add_to(body)
