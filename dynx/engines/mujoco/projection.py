"""Mass matrix and torques projected from MuJoCo's kinematics, because those of MuJoCo lose digits.

MuJoCo refers the inertia of every body to the centre of mass of the whole robot. For a finger of mass m at a
distance d from there, m d^2 is added to an inertia that may be a thousand times smaller, and later subtracted
(`mj_crb`, `mj_rne`). On robots with hands the entries of its mass matrix have errors of 1e-12 relative to
sqrt(M_ii M_jj) (MuJoCo 4.0), and the torque about an axis through a point mass, which should be zero, is a
rounding error of the largest torque. Here M is the sum of m Jp' Jp + Jr' I Jr over the bodies (Siciliano et
al., Robotics, eq. 7.32) and the torque the sum of Jp' m (a - g) + Jr' (I dw + w x I w) (Newton and Euler,
projected as in Kane's method), with lever arms from joint to body, not from a distant point.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from dynx.engines.mujoco.library import mujoco
from dynx.spatial.scalar import Floats


class ProjectedDynamics:
    """Mass matrix and torques of one model, from its bodies with inertia.

    Coordinates are MuJoCo's, except that the velocity of a floating base is in base axes.
    """

    def __init__(self, engine: Any, *, floating: bool) -> None:
        self._base = 6 if floating else 0
        self._first = int(floating)
        has_inertia = (engine.body_mass != 0.0) | engine.body_inertia.any(axis=1)
        self._bodies = np.flatnonzero(has_inertia & (engine.body_weldid != 0))
        self._roots = engine.body_rootid[self._bodies]
        self._mass: Floats = np.array(engine.body_mass[self._bodies])
        self._moments: Floats = np.array(engine.body_inertia[self._bodies])
        self._hinges = engine.jnt_type[self._first :] == int(mujoco.mjtJoint.mjJNT_HINGE)
        self._moves: Floats = np.zeros((len(self._bodies), engine.nv))
        for row, body in enumerate(self._bodies):
            while body:
                first, n = engine.body_dofadr[body], engine.body_dofnum[body]
                self._moves[row, first : first + n] = 1.0
                body = engine.body_parentid[body]

    def mass_matrix(self, data: Any, R_root: Floats, p_root: Floats) -> Floats:
        """Return the mass matrix (nv, nv), after `mj_kinematics` on `data`; (R, p) is the root's pose."""
        Jp, Jr = self._jacobians(data, R_root, p_root)
        M: Floats = _gramian(Jp, np.repeat(self._mass, 3)) + _gramian(Jr, self._moments.ravel())
        return np.asarray(0.5 * (M + M.T))

    def torque(self, data: Any, R_root: Floats, p_root: Floats) -> Floats:
        """Return the torque (nv,), after `mj_rnePostConstraint` (accelerations without gravity) on `data`."""
        bodies = self._bodies
        # MuJoCo's velocities and spatial accelerations are about the robot's centre of mass, in world axes,
        # angular part first; here they are converted to classical ones of the body's centre of mass.
        lever = data.xipos[bodies] - data.subtree_com[self._roots]
        w, dw = data.cvel[bodies, :3], data.cacc[bodies, :3]
        v = data.cvel[bodies, 3:] + np.cross(w, lever)
        a = data.cacc[bodies, 3:] + np.cross(dw, lever) + np.cross(w, v)
        axes = np.swapaxes(data.ximat[bodies].reshape(-1, 3, 3), 1, 2)
        w, dw = ((axes @ each[:, :, None])[:, :, 0] for each in (w, dw))
        force = self._mass[:, None] * a
        moment = self._moments * dw + np.cross(w, self._moments * w)
        Jp, Jr = self._jacobians(data, R_root, p_root)
        return np.asarray(np.einsum("bij,bi->j", Jp, force) + np.einsum("bij,bi->j", Jr, moment))

    def _jacobians(self, data: Any, R_root: Floats, p_root: Floats) -> tuple[Floats, Floats]:
        """Return Jacobians (n, 3, nv) of all bodies: velocity of the centre of mass in world axes, and
        angular velocity in principal axes."""
        axes, anchors = data.xaxis[self._first :], data.xanchor[self._first :]
        linear = np.where(self._hinges[:, None], 0.0, axes)
        angular = np.where(self._hinges[:, None], axes, 0.0)
        if self._base:
            zero = np.zeros((3, 3))
            linear = np.concatenate([R_root.T, zero, linear])
            angular = np.concatenate([zero, R_root.T, angular])
            anchors = np.concatenate([np.tile(p_root, (6, 1)), anchors])
        lever = data.xipos[self._bodies][:, None, :] - anchors
        moves = self._moves[:, None, :]
        Jp = np.swapaxes(linear + np.cross(angular, lever), 1, 2) * moves
        Jr = (np.swapaxes(data.ximat[self._bodies].reshape(-1, 3, 3), 1, 2) @ angular.T) * moves
        return Jp, Jr


def _gramian(J: Floats, weights: Floats) -> Floats:
    """Return the sum of w J' J over the rows of all bodies."""
    rows = J.reshape(len(weights), J.shape[-1])
    return np.asarray(rows.T @ (weights[:, None] * rows))
