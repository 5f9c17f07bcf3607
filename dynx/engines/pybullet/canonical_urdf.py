"""The canonical URDF that Bullet loads instead of the user's file.

It has the moving bodies only, with fixed joints merged, generated ASCII names (`b`, then `l0`, `j0`, ...),
unit axes and short lines, and no shapes, limits, damping or meshes. Principal moments are written as zero and
set after loading (`BulletClient`), because Bullet replaces moments that fail its checks.

The root link's frame is the root's inertial frame (centre of mass, principal axes), because Bullet expresses
inverse dynamics, mass matrix and Jacobian in that frame only. With a fixed base the root has no inertia and
the frame is the base frame.

**Inertias** are in Bullet's form: mass, centre of mass, principal moments and axes. Bullet's own
diagonalisation stops at a relative 1e-6, and its checks fail because of rounding. So inertias are merged and
diagonalised here, in NumPy's long double, and Bullet receives moments and axes.

Bullet also refuses some inertias that a description may contain: a negative principal moment, a rod or a
point that meets a triangle inequality with equality, a mass that is not positive on a floating root (which it
then fixes to the world), a first moment without a mass. Inverse dynamics f and the mass matrix are affine in
the inertia of every body, so such a body gets *ballast*, an additional inertia s, once and twice: f(I) = 2
f(I + s) - f(I + 2 s).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from decimal import Decimal

import numpy as np

from dynx.model.mechanism import ROOT, Mechanism
from dynx.spatial.inertia import RigidInertia
from dynx.spatial.scalar import FLOAT64_EPS, Array, Floats, jacobi_eigen, longdouble
from dynx.spatial.so3 import rotate_back, rpy_from_rotation, skew


@dataclass(frozen=True)
class PrincipalBody:
    """A rigid body by its centre of mass and principal axes, in long double.

    `axes` (3, 3) has the principal axes as columns, in the axes of the body frame (right-handed); `moments`
    (3,) [kg m^2] belong to them. `accepted` is true if Bullet's inverse dynamics accepts the body with its
    axes in this order.
    """

    mass: float
    center: Array
    axes: Array
    moments: Floats
    accepted: bool


@dataclass(frozen=True)
class Ballast:
    """Additional mass [kg] at the body's origin and rotational inertia [kg m^2], equal about all axes."""

    mass: float = 0.0
    rotational: float = 0.0

    def add_to(self, inertia: RigidInertia, times: int) -> RigidInertia:
        """Return the inertia of the body with `times` copies of this ballast."""
        return RigidInertia(
            np.asarray(inertia.mass + times * longdouble(self.mass)),
            inertia.first_moment,
            inertia.rotational_inertia + times * longdouble(self.rotational) * longdouble(np.eye(3)),
        )


def principal_inertia(inertia: RigidInertia, *, about_center: bool = False) -> PrincipalBody:
    """Return the centre of mass, principal axes and moments of a body; about its origin if it has no mass.

    The axes are in an order that Bullet accepts, where there is one. With `about_center` Bullet has the
    body's frame at the centre of mass (as for the root), not at the joint.
    """
    mass = float(inertia.mass)
    second = longdouble(inertia.rotational_inertia)
    center = longdouble(np.zeros(3))
    if mass != 0.0:
        center = longdouble(inertia.first_moment) / longdouble(inertia.mass)
        arm = skew(center)
        second = second + longdouble(inertia.mass) * (arm @ arm)
    values, axes = jacobi_eigen(second)
    # A point mass has no moments, but merging leaves rounding errors of either sign. Negative moments below
    # the rounding errors of float64 in the moments about the origin are set to zero.
    noise = 4 * FLOAT64_EPS * _size(inertia.rotational_inertia)
    values = np.where((values < 0) & (values >= -noise), 0, values)
    moments = np.asarray(values, dtype=np.float64)
    lever = np.zeros(3) if about_center else np.asarray(axes.T @ center, dtype=np.float64)
    # Cyclic orders keep the axes right-handed; the first one leaves an aligned body unchanged.
    orders = [order for order in _CYCLIC if _accepts(mass, lever[order], moments[order])]
    order = (orders or _CYCLIC)[0]
    return PrincipalBody(mass, center, axes[:, order], moments[order], accepted=bool(orders))


_CYCLIC = ([0, 1, 2], [1, 2, 0], [2, 0, 1])


def _accepts(mass: float, lever: Floats, moments: Floats) -> bool:
    """Check whether Bullet's inverse dynamics accepts a body with these moments about these axes.

    It requires x + y >= z and y + z >= x for the moments about the body's origin, to the last bit; it does
    not check z + x >= y (btInverseDynamics, `isValidInertiaMatrix`, where the second test repeats the first).
    So the result for equality must not depend on Bullet's rounding.
    """
    squares = mass * lever * lever
    # These terms are below the rounding errors of the others.
    squares[squares <= FLOAT64_EPS**2 * np.max(squares)] = 0.0
    x, y, z = moments + (np.sum(squares) - squares)
    # With the centre of mass on one of the axes both sides add the same number.
    exact = np.count_nonzero(squares) <= 1
    margin = 0.0 if exact else 8 * FLOAT64_EPS * max(x, y, z)
    return bool(min(moments) >= 0.0 and x + y >= z + margin and y + z >= x + margin)


def ballast_for(mechanism: Mechanism) -> tuple[Ballast, ...]:
    """Return the ballast that the root and each body need so that Bullet accepts them; most need none."""
    inertias = [body.inertia for body in mechanism.bodies]
    total = sum(abs(float(inertia.mass)) for inertia in [mechanism.root, *inertias])
    unit = total / 16 if total > 0.0 else 1.0
    root = _ballast(mechanism.root, unit, root=True) if mechanism.floating else Ballast()
    return (root, *(_ballast(inertia, unit, root=False) for inertia in inertias))


def _ballast(inertia: RigidInertia, unit: float, *, root: bool) -> Ballast:
    """Return the least ballast that suffices, because subtracting it again loses digits."""
    mass = float(inertia.mass)
    massless = mass == 0.0 and not root and not np.any(inertia.first_moment)
    needed = Ballast() if mass > 0.0 or massless else Ballast(mass=unit - mass)
    body = principal_inertia(needed.add_to(inertia, 1), about_center=root)
    if not body.accepted:
        negative = max(0.0, -float(np.min(body.moments)))
        size = float(_size(inertia.rotational_inertia))
        needed = Ballast(needed.mass, 2.0 * negative + 64 * FLOAT64_EPS * size)
    return needed


def _size(matrix: Array) -> Array:
    return np.asarray(np.max(np.abs(matrix)))


NOTHING = RigidInertia(longdouble(0.0), longdouble(np.zeros(3)), longdouble(np.zeros((3, 3))))


@dataclass(frozen=True)
class BulletLink:
    """A moving body as Bullet holds it; (R, p) places the joint frame in the parent's link frame."""

    parent: int
    revolute: bool
    R: Array
    p: Array
    axis: Array
    inertia: PrincipalBody


@dataclass(frozen=True)
class BulletTree:
    """A mechanism in Bullet's conventions: the root's inertial frame, and links placed relative to it.

    Masses and moments are those of the mechanism divided by `unit`, a power of two [kg]. Bullet's checks use
    absolute tolerances of about 1e-15, and refuse a physical body of 10 kg that rotates about an axis 1 m
    away. They accept it in units in which no moment exceeds 1. Forces are scaled by the same factor.
    """

    floating: bool
    root: PrincipalBody
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


def _in_units(inertia: PrincipalBody, unit: float) -> PrincipalBody:
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
