"""The canonical URDF that Bullet loads instead of the user's file.

It has the moving bodies only, with fixed joints merged, generated ASCII names (`b`, then `l0`, `j0`, ...),
unit axes and short lines, and no shapes, limits, damping or meshes. Principal moments are written as zero and
set after loading (`BulletClient`), because Bullet replaces moments that fail its checks.

The root link's frame is the root's inertial frame (centre of mass, principal axes), because Bullet expresses
inverse dynamics, mass matrix and Jacobian in that frame only. With a fixed base the root has no inertia and
the frame is the base frame.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from decimal import Decimal

import numpy as np

from dynx.engines.pybullet.inertia import Ballast, PrincipalInertia, principal_inertia
from dynx.model.mechanism import ROOT, Mechanism
from dynx.spatial.extended import longdouble
from dynx.spatial.inertia import RigidInertia
from dynx.spatial.scalar import Array
from dynx.spatial.so3 import rotate_back, rpy_from_rotation

NOTHING = RigidInertia(longdouble(0.0), longdouble(np.zeros(3)), longdouble(np.zeros((3, 3))))


@dataclass(frozen=True)
class BulletLink:
    """A moving body as Bullet holds it; (R, p) places the joint frame in the parent's link frame."""

    parent: int
    revolute: bool
    R: Array
    p: Array
    axis: Array
    inertia: PrincipalInertia


@dataclass(frozen=True)
class BulletTree:
    """A mechanism in Bullet's conventions: the root's inertial frame, and links placed relative to it.

    Masses and moments are those of the mechanism divided by `unit`, a power of two [kg]. Bullet's checks use
    absolute tolerances of about 1e-15, and refuse a physical body of 10 kg that rotates about an axis 1 m
    away. They accept it in units in which no moment exceeds 1. Forces are scaled by the same factor.
    """

    floating: bool
    root: PrincipalInertia
    links: tuple[BulletLink, ...]
    unit: float


def bullet_tree(
    mechanism: Mechanism, ballast: tuple[Ballast, ...], times: int, *, unit: float | None = None
) -> BulletTree:
    """Return the tree that Bullet loads for a long-double `mechanism`, with `times` copies of the ballast.

    `unit` [kg] is computed if it is None. Objects that touch must have the same.
    """
    root = principal_inertia(NOTHING)
    largest_moments = [0.0]
    if mechanism.floating:
        loaded = ballast[0].add_to(mechanism.root, times)
        root = principal_inertia(loaded, about_center=True)
        largest_moments.append(float(np.max(root.moments)))
    bodies = list(zip(mechanism.bodies, ballast[1:], strict=True))
    inertias = [load.add_to(body.inertia, times) for body, load in bodies]
    largest_moments += [float(np.max(np.abs(inertia.rotational_inertia))) for inertia in inertias]
    if unit is None:
        unit = 2.0 ** max(0, int(np.frexp(max(largest_moments))[1]))
    links = []
    for body, merged in zip(mechanism.bodies, inertias, strict=True):
        R, p = body.R, body.p
        if body.parent == ROOT:
            R, p = root.axes.T @ R, rotate_back(root.axes, p - root.center)
        axis = body.axis / np.sqrt(body.axis @ body.axis)
        inertia = _in_units(principal_inertia(merged), unit)
        links.append(BulletLink(body.parent, body.revolute, R, p, axis, inertia))
    return BulletTree(mechanism.floating, _in_units(root, unit), tuple(links), unit)


@dataclass(frozen=True)
class Attachments:
    """Parts of a canonical URDF besides the mechanism: shapes, and limits of joints."""

    first: tuple[str, ...] = ()
    """Elements that precede every link but the root."""
    shapes: Mapping[int, Sequence[str]] = field(default_factory=dict)
    """``<collision>`` elements of the moving bodies and of the root, in the frames of their links."""
    limits: Mapping[int, tuple[float, float]] = field(default_factory=dict)
    """Lower and upper limit of the joints that have them."""


def write_bullet_urdf(tree: BulletTree, attachments: Attachments = Attachments()) -> str:
    """Return the tree as URDF text, in ASCII."""
    shapes, limits = attachments.shapes, attachments.limits
    lines = ['<robot name="r">', *_link("b", tree.root.mass, np.zeros(3), np.eye(3), shapes.get(ROOT, ()))]
    lines += attachments.first
    for k, link in enumerate(tree.links):
        inertia = link.inertia
        lines += _link(f"l{k}", inertia.mass, inertia.center, inertia.axes, shapes.get(k, ()))
        # Bullet requires limits of a prismatic joint; a lower limit above the upper one means unlimited.
        lower, upper = limits.get(k, (1.0, -1.0))
        kind = "prismatic" if not link.revolute else "revolute" if k in limits else "continuous"
        lines += [
            f'<joint name="j{k}" type="{kind}">',
            f'<parent link="{body_name(link.parent)}"/>',
            f'<child link="l{k}"/>',
            _origin(link.p, link.R),
            f'<axis xyz="{_vector(link.axis)}"/>',
            f'<limit lower="{locale_free(lower)}" upper="{locale_free(upper)}" effort="0" velocity="0"/>',
            "</joint>",
        ]
    return "\n".join([*lines, "</robot>", ""])


def body_name(body: int) -> str:
    """Return the name of the link of a moving body, or of the root."""
    return "b" if body == ROOT else f"l{body}"


def fixed_link(name: str, parent: str, shapes: Sequence[str]) -> list[str]:
    """Return a link without mass, fixed to the frame of the link `parent`, as URDF text."""
    return [
        *_link(name, 0.0, np.zeros(3), np.eye(3), shapes),
        f'<joint name="f{name}" type="fixed"><parent link="{parent}"/><child link="{name}"/></joint>',
    ]


def pose_element(T: Array) -> str:
    """Return the ``<origin>`` element of a pose (4, 4)."""
    return _origin(T[:3, 3], T[:3, :3])


def locale_free(number: float) -> str:
    """Return the shortest decimal that reads back as `number`, without a decimal point.

    Bullet reads numbers in the C locale in force, in which a point may end the number.
    """
    sign, digits, exponent = Decimal(repr(float(number))).as_tuple()
    return f"{'-' if sign else ''}{''.join(map(str, digits))}e{exponent}"


def _in_units(inertia: PrincipalInertia, unit: float) -> PrincipalInertia:
    return replace(inertia, mass=inertia.mass / unit, moments=inertia.moments / unit)


def _link(name: str, mass: float, center: Array, axes: Array, shapes: Sequence[str] = ()) -> list[str]:
    return [
        f'<link name="{name}"><inertial>',
        _origin(center, axes),
        f'<mass value="{locale_free(mass)}"/>',
        '<inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/>',
        "</inertial>",
        *shapes,
        "</link>",
    ]


def _origin(p: Array, R: Array) -> str:
    return f'<origin xyz="{_vector(p)}" rpy="{_vector(rpy_from_rotation(R))}"/>'


def _vector(numbers: Array) -> str:
    return " ".join(locale_free(float(number)) for number in numbers)
