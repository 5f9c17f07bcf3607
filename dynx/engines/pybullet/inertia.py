"""Rigid-body inertia in Bullet's form: mass, centre of mass, principal moments and axes.

Bullet's own diagonalisation stops at a relative 1e-6, and its checks fail because of rounding. So inertias
are merged and diagonalised here, in NumPy's long double, and Bullet receives moments and axes.

Bullet also refuses some inertias that a description may contain: a negative principal moment, a rod or a
point that meets a triangle inequality with equality, a mass that is not positive on a floating root (which it
then fixes to the world), a first moment without a mass. Inverse dynamics f and the mass matrix are affine in
the inertia of every body, so such a body gets *ballast*, an additional inertia s, once and twice: f(I) = 2
f(I + s) - f(I + 2 s).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from dynx.model.mechanism import Mechanism
from dynx.spatial.extended import FLOAT64_EPS, jacobi_eigen, longdouble
from dynx.spatial.inertia import RigidInertia
from dynx.spatial.scalar import Array, Floats
from dynx.spatial.so3 import skew


@dataclass(frozen=True)
class PrincipalInertia:
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


def principal_inertia(inertia: RigidInertia, *, about_center: bool = False) -> PrincipalInertia:
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
    return PrincipalInertia(mass, center, axes[:, order], moments[order], accepted=bool(orders))


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
