"""Conversion between the generalized coordinates of Drake and of dynx.

A floating base has in Drake the position (quaternion wxyz, origin in the world) and the velocity V =
(angular, linear), both in world axes; in dynx (origin, quaternion xyzw) and (linear, angular) in base axes.
With R = R_world_base, V = (R w, R u) for the dynx velocity (u, w), so dV/dt = (R dw, R (du + w x u)), and
the transpose converts forces back (virtual work). Joint coordinates only change their order.

Source: Drake's documentation of `QuaternionFloatingJoint`; Featherstone, Rigid Body Dynamics Algorithms,
section 2.10, for the two time derivatives.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from dynx.spatial.scalar import Array, Floats

_QUATERNION_THEN_ORIGIN = (6, 3, 4, 5, 0, 1, 2)
_ANGULAR_THEN_LINEAR = (3, 4, 5, 0, 1, 2)


class DrakeCoordinates:
    """The map between the tree coordinates of dynx and those of a plant, one sample at a time.

    `q_index` and `v_index` are the plant's indices of the joints of dynx, in tree order. `n_q` and `n_v` are
    the sizes of the plant's q and v, in which entries that dynx does not have are zero. `base` is the index
    of the floating base in both, or None for a fixed base. The argument R of methods is the result of
    `attitude` at the configuration.
    """

    def __init__(
        self,
        q_index: Sequence[int],
        v_index: Sequence[int],
        n_q: int,
        n_v: int,
        base: tuple[int, int] | None = None,
    ) -> None:
        self._floating = base is not None
        at_q, at_v = base or (0, 0)
        base_q = [at_q + _QUATERNION_THEN_ORIGIN.index(k) for k in range(7)] if base else []
        base_v = [at_v + _ANGULAR_THEN_LINEAR.index(k) for k in range(6)] if base else []
        self._from_q, self._pad_q = _gather([*base_q, *q_index], n_q)
        self._from_v, self._pad_v = _gather([*base_v, *v_index], n_v)
        self._columns = np.array([*base_v, *v_index], dtype=int)
        # No conversion is needed where the coordinates are the same.
        self._same = base is None and list(q_index) == list(range(n_q)) and list(v_index) == list(range(n_v))

    def attitude(self, q: Floats) -> Floats:
        """Return R_world_base (3, 3); an unused empty array for a fixed base."""
        if not self._floating:
            return _EMPTY
        # Written in plain Python, because NumPy takes ten times as long for such small arrays.
        x, y, z, w = q[3:7].tolist()
        xx, yy, zz, xy, xz, yz = x * x, y * y, z * z, x * y, x * z, y * z
        wx, wy, wz = w * x, w * y, w * z
        return np.array(
            (
                (1 - 2 * (yy + zz), 2 * (xy - wz), 2 * (xz + wy)),
                (2 * (xy + wz), 1 - 2 * (xx + zz), 2 * (yz - wx)),
                (2 * (xz - wy), 2 * (yz + wx), 1 - 2 * (xx + yy)),
            )
        )

    def positions(self, q: Floats) -> Floats:
        """Return the plant's q at the configuration `q` of dynx."""
        if self._same:
            return q
        return (np.append(q, 0.0) if self._pad_q else q)[self._from_q]

    def velocities(self, R: Floats, v: Floats) -> Floats:
        """Return the plant's v at the velocity `v` of dynx."""
        return v if self._same else self._to_plant(R, v)

    def accelerations(self, R: Floats, v: Floats, a: Floats) -> Floats:
        """Return the plant's dv/dt at the velocity `v` and the acceleration `a` of dynx."""
        if self._same:
            return a
        if self._floating:
            a = a.copy()
            a[:3] += _cross_product(v)
        return self._to_plant(R, a)

    def accelerations_back(self, R: Floats, v: Floats, vdot: Floats) -> Floats:
        """Return the acceleration of dynx at the plant's dv/dt."""
        a = self.forces_back(R, vdot)
        if self._floating:
            a[:3] -= _cross_product(v)
        return a

    def forces(self, R: Floats, tau: Floats) -> Floats:
        """Return the plant's generalized force for the torque `tau` of dynx."""
        return tau if self._same else self._to_plant(R, tau)

    def forces_back(self, R: Floats, force: Floats) -> Floats:
        """Return the torque of dynx for the plant's generalized force, or for rows of a matrix (..., n_v)."""
        if self._same:
            return force
        out: Floats = force[..., self._columns]
        if self._floating:
            # Rows of three in world axes, times R, are rows in base axes.
            pairs = out[..., :6].reshape(*out.shape[:-1], 2, 3) @ R
            out[..., :6] = pairs.reshape(*out.shape[:-1], 6)
        return out

    def matrix_back(self, R: Floats, M: Floats) -> Floats:
        """Return the mass matrix of dynx for the plant's."""
        if self._same:
            return M
        return self.forces_back(R, self.forces_back(R, M).T)

    def _to_plant(self, R: Floats, x: Floats) -> Floats:
        if self._floating:
            x = np.concatenate([(x[:6].reshape(2, 3) @ R.T).ravel(), x[6:]])
        return (np.append(x, 0.0) if self._pad_v else x)[self._from_v]


def _gather(indices: Sequence[int], length: int) -> tuple[Array, bool]:
    """Return, for each entry of the plant, the index of the entry of dynx (one past the end if there is
    none), and whether some entries have none."""
    source = np.full(length, len(indices))
    source[list(indices)] = range(len(indices))
    return source, len(indices) != length


def _cross_product(v: Floats) -> tuple[float, float, float]:
    """Return w x u for a base velocity (u, w)."""
    a, b, c, x, y, z = v[:6].tolist()
    return (y * c - z * b, z * a - x * c, x * b - y * a)


_EMPTY: Floats = np.zeros((0, 0))
