"""Mass matrix and torques projected from MuJoCo's kinematics, because those of MuJoCo lose digits.

MuJoCo refers the inertia of every body to the centre of mass of the whole robot. For a finger of mass m at a
distance d from there, m d^2 is added to an inertia that may be a thousand times smaller, and later subtracted
(`mj_crb`, `mj_rne`). On robots with hands the entries of its mass matrix have errors of 1e-12 relative to
sqrt(M_ii M_jj) (MuJoCo 4.0), and the torque about an axis through a point mass, which should be zero, is a
rounding error of the largest torque. Here M is the sum of m Jp' Jp + Jr' I Jr over the bodies (Siciliano et
al., Robotics, eq. 7.32) and the torque the sum of Jp' m (a - g) + Jr' (I dw + w x I w) (Newton and Euler,
projected as in Kane's method), with lever arms from joint to body, not from a distant point.

Arrays are of all bodies and coordinates at once, and cross products are products with skew matrices, because
a call of NumPy takes longer than its arithmetic here.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from dynx.engines.mujoco.library import mujoco
from dynx.engines.mujoco.tree import ROOT
from dynx.spatial.scalar import Floats
from dynx.spatial.so3 import skew

_TO_SKEW: Floats = np.stack([skew(unit).ravel() for unit in np.eye(3)])
"""Matrix (3, 9) from a vector b to the entries of [b]. A row a' times [b] is the row (a x b)'."""


class ProjectedDynamics:
    """Mass matrix and torques of one model, from its bodies with inertia.

    Coordinates are MuJoCo's, except that the velocity of a floating base is in base axes.
    """

    def __init__(self, engine: Any, *, floating: bool) -> None:
        self._floating = floating
        has_inertia = (engine.body_mass != 0.0) | engine.body_inertia.any(axis=1)
        self._bodies = np.flatnonzero(has_inertia & (engine.body_weldid != 0))
        mass, moments = engine.body_mass[self._bodies], engine.body_inertia[self._bodies]
        self._inertia: Floats = np.stack([moments, np.repeat(mass[:, None], 3, axis=1)], axis=1)
        self._weights: Floats = np.concatenate([np.repeat(mass, 3), moments.ravel()])
        self._revolute: Floats = np.array(
            [0.0] * 3 * floating
            + [1.0] * 3 * floating
            + [float(kind == mujoco.mjtJoint.mjJNT_HINGE) for kind in engine.jnt_type[int(floating) :]]
        )[:, None]
        self._translations = np.flatnonzero(self._revolute == 0.0)
        # For each coordinate, the bodies that it moves.
        self._moves: Floats = np.zeros((engine.nv, len(self._bodies)))
        for column, body in enumerate(self._bodies):
            while body:
                first, n = engine.body_dofadr[body], engine.body_dofnum[body]
                self._moves[first : first + n, column] = 1.0
                body = engine.body_parentid[body]
        self._moves_vector: Floats = np.repeat(self._moves, 3, axis=1)
        self._moved_masses: Floats = self._moves * mass
        self._gravity: Floats = np.array(engine.opt.gravity)
        self._gravity_cross: Floats = skew(self._gravity).T

    def mass_matrix(self, data: Any, R_root: Floats, p_root: Floats) -> Floats:
        """Return the mass matrix (nv, nv), after `mj_kinematics` on `data`; (R, p) is the root's pose."""
        J = self._velocities(data, R_root, p_root)
        M = (J * self._weights).dot(J.T)
        return np.asarray(0.5 * (M + M.T))

    def kinetic_energy(self, data: Any, R_root: Floats, p_root: Floats, v: Floats) -> Floats:
        """Return the kinetic energy () at the velocity `v` (nv,), after `mj_kinematics` on `data`."""
        velocity = v.dot(self._velocities(data, R_root, p_root))
        return np.asarray(0.5 * (velocity * self._weights).dot(velocity))

    def _velocities(self, data: Any, R_root: Floats, p_root: Floats) -> Floats:
        """Return the velocities of all bodies (nv, 6 n) for unit velocities of each coordinate: those of the
        centres of mass in world axes, then angular velocities in principal axes."""
        axes, lever = self._axes(data, R_root, p_root)
        n, count = self._moves_vector.shape
        angular = axes * self._revolute
        J = np.empty((n, 2 * count))
        Jp, Jr = J[:, :count], J[:, count:]
        np.multiply(np.matmul(lever, _skew(-angular)).reshape(n, count), self._moves_vector, Jp)
        for row in self._translations:
            np.multiply.outer(self._moves[row], axes[row], out=Jp[row].reshape(-1, 3))
        to_principal = data.ximat.take(self._bodies, 0, None, "clip").reshape(-1, 3, 3).transpose(1, 0, 2)
        np.multiply(angular.dot(to_principal.reshape(3, count)), self._moves_vector, Jr)
        return J

    def gravity_torque(self, data: Any, R_root: Floats, p_root: Floats) -> Floats:
        """Return the torque (nv,) at rest, after `mj_kinematics` on `data`: the moment of all weights that a
        coordinate moves about its axis, or their sum along it."""
        axes, lever = self._axes(data, R_root, p_root)
        # A weight has the moment m (c - p) x g; its product with the axis is that of m (c - p) and g x axis.
        moments = np.matmul(self._moved_masses[:, None], lever)[:, 0]
        about_axis = (moments * axes.dot(self._gravity_cross)).sum(1)
        if not self._translations.size:
            return np.asarray(-about_axis)
        along_axis = self._moved_masses.sum(1) * axes.dot(self._gravity)
        return np.asarray(-np.where(self._revolute[:, 0], about_axis, along_axis))

    def torque(self, data: Any, R_root: Floats, p_root: Floats) -> Floats:
        """Return the torque (nv,), after `mj_rnePostConstraint` (accelerations without gravity) on `data`."""
        bodies = self._bodies
        # MuJoCo's velocities and spatial accelerations (w, v, dw, a) are about the robot's centre of mass, in
        # world axes; here they are converted to those of the body's centre of mass, in principal axes.
        both = np.concatenate((data.cvel, data.cacc), 1).take(bodies, 0, None, "clip").reshape(-1, 4, 3)
        from_center = data.xipos.take(bodies, 0, None, "clip") - data.subtree_com[ROOT]
        both[:, 1::2] += np.matmul(both[:, 0::2], _skew(from_center))
        to_principal = data.ximat.take(bodies, 0, None, "clip").reshape(-1, 3, 3)
        both = np.matmul(both, to_principal)
        # Moment and force of each body, from the classical acceleration a + w x v.
        load = self._inertia * both[:, 2:]
        load -= np.matmul(self._inertia * both[:, :2], _skew(both[:, 0]))
        load = np.matmul(load, to_principal.transpose(0, 2, 1))
        axes, lever = self._axes(data, R_root, p_root)
        n, count = self._moves_vector.shape
        moment_and_force = self._moves.dot(load.reshape(-1, 6))
        levers = lever.reshape(n, count)
        levers *= self._moves_vector
        about_axis = moment_and_force[:, :3] + levers.dot(_skew(load[:, 1]).reshape(count, 3))
        along_axis = np.where(self._revolute, about_axis, moment_and_force[:, 3:])
        return np.asarray((axes * along_axis).sum(1))

    def _axes(self, data: Any, R_root: Floats, p_root: Floats) -> tuple[Floats, Floats]:
        """Return the axis (nv, 3) of every coordinate in world axes, and the levers (nv, n, 3) from there to
        the centres of mass of all bodies."""
        axes, anchors = data.xaxis, data.xanchor
        if self._floating:
            axes = np.concatenate((R_root.T, R_root.T, axes[1:]))
            anchors = np.concatenate((p_root[None].repeat(6, 0), anchors[1:]))
        return axes, data.xipos.take(self._bodies, 0, None, "clip") - anchors[:, None]


def _skew(vectors: Floats) -> Floats:
    """Return the skew matrices (n, 3, 3) of vectors (n, 3)."""
    return np.asarray(vectors.dot(_TO_SKEW).reshape(-1, 3, 3))
