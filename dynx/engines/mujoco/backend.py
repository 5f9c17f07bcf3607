"""The backend `mujoco`: MuJoCo's kinematics, Jacobians, accelerations and LDL' solver.

The engine's model is built from the links and joints of the `Model` (`build`), independently of
`dynx.model.mechanism`; it has no limits, contacts, damping or actuators, so MuJoCo's constraint solver is
idle. Mass matrix and torques are computed from MuJoCo's poses, axes, accelerations and inertias, because
`mj_crb` and `mj_rne` lose digits (`ProjectedDynamics`). Tree coordinates are MuJoCo's own with two
exceptions: quaternions are (w, x, y, z), and the linear velocity of a floating base is in world axes.

Several threads may use it: each has its own workspace of the engine (`MjData`), made on its first call.
MuJoCo releases the GIL in its calls.

**Projection.** MuJoCo refers the inertia of every body to the centre of mass of the whole robot. For a finger
of mass m at a distance d from there, m d^2 is added to an inertia that may be a thousand times smaller, and
later subtracted (`mj_crb`, `mj_rne`). On robots with hands the entries of its mass matrix have errors of
1e-12 relative to sqrt(M_ii M_jj) (MuJoCo 4.0), and the torque about an axis through a point mass, which
should be zero, is a rounding error of the largest torque. Here M is the sum of m Jp' Jp + Jr' I Jr over the
bodies (Siciliano et al., Robotics, eq. 7.32) and the torque the sum of Jp' m (a - g) + Jr' (I dw + w x I w)
(Newton and Euler, projected as in Kane's method), with lever arms from joint to body, not from a distant
point. The wrench at a joint is the sum of the same forces and moments over the links that it carries, instead
of MuJoCo's `cfrc_int`, which is about that distant point.

Arrays are of all bodies and coordinates at once, and cross products are products with skew matrices, because
a call of NumPy takes longer than its arithmetic here.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property
from threading import local
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from dynx.backends.base import Backend
from dynx.backends.engine_errors import engine_errors
from dynx.engines.mujoco.build import ROOT_BODY, build_tree, refuse_large
from dynx.engines.mujoco.library import mujoco, silent_data
from dynx.errors import DynxError, EngineError, nonblank_lines
from dynx.model import Model
from dynx.rbd.jacobians import LOCAL_WORLD_ALIGNED, Reference
from dynx.spatial.scalar import Floats
from dynx.spatial.so3 import cross, skew

_TO_SKEW: Floats = np.stack([skew(unit).ravel() for unit in np.eye(3)])
"""Matrix (3, 9) from a vector b to the entries of [b]. A row a' times [b] is the row (a x b)'."""


class ProjectedDynamics:
    """Mass matrix and torques of one model, from its bodies with inertia.

    Coordinates are MuJoCo's, except that the velocity of a floating base is in base axes.
    """

    def __init__(self, engine: Any, *, floating: bool) -> None:
        self._floating = floating
        # For each coordinate, MuJoCo's joint; of the three of a ball joint, the axis of its body.
        self._joints: NDArray[np.intp] = np.asarray(engine.dof_jntid, dtype=np.intp)
        kinds = engine.jnt_type[self._joints]
        balls = np.flatnonzero(kinds == mujoco.mjtJoint.mjJNT_BALL)
        axis = balls - engine.jnt_dofadr[self._joints[balls]]
        self._balls = (balls, engine.jnt_bodyid[self._joints[balls]], axis) if balls.size else None
        self._bodies = np.flatnonzero(_has_inertia(engine) & (engine.body_weldid != 0))
        self._inertia = _moments_and_masses(engine, self._bodies)
        mass, moments = engine.body_mass[self._bodies], engine.body_inertia[self._bodies]
        self._weights: Floats = np.concatenate([np.repeat(mass, 3), moments.ravel()])
        self._revolute: Floats = np.array(
            [0.0] * 3 * floating
            + [1.0] * 3 * floating
            + [float(kind != mujoco.mjtJoint.mjJNT_SLIDE) for kind in kinds[6 * floating :]]
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
        load = _loads(data, self._bodies, self._inertia)
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
        if self._balls is not None:
            axes, anchors = axes[self._joints], anchors[self._joints]
            dofs, bodies, columns = self._balls
            axes[dofs] = data.xmat.reshape(-1, 3, 3)[bodies, :, columns]
            if self._floating:
                axes[:3] = axes[3:6] = R_root.T
                anchors[:6] = p_root
        elif self._floating:
            axes = np.concatenate((R_root.T, R_root.T, axes[1:]))
            anchors = np.concatenate((p_root[None].repeat(6, 0), anchors[1:]))
        return axes, data.xipos.take(self._bodies, 0, None, "clip") - anchors[:, None]


class ProjectedWrenches:
    """Wrenches on the links of one model and on all that is beyond them, from its bodies with inertia."""

    def __init__(self, engine: Any, links: Sequence[int]) -> None:
        """`links` are MuJoCo's bodies of the links."""
        self._links = np.array(links)
        self._bodies = np.flatnonzero(_has_inertia(engine))
        self._inertia = _moments_and_masses(engine, self._bodies)
        # For each link, the bodies that it carries.
        number = {body: row for row, body in enumerate(links)}
        self._carries: Floats = np.zeros((len(links), len(self._bodies)))
        for column, body in enumerate(self._bodies):
            while body:
                self._carries[number[int(body)], column] = 1.0
                body = engine.body_parentid[body]

    def __call__(self, data: Any, rows: slice) -> Floats:
        """Return the wrenches (n, 6) at the origins of some links in their axes, force first, after
        `mj_rnePostConstraint` (accelerations without gravity) on `data`."""
        load = _loads(data, self._bodies, self._inertia)
        links, carries = self._links[rows], self._carries[rows]
        lever = data.xipos[self._bodies] - data.xpos[links][:, None]
        moments = load[:, 0] + np.cross(lever, load[:, 1])
        wrenches = np.stack([carries.dot(load[:, 1]), (carries[:, :, None] * moments).sum(1)], axis=1)
        return np.asarray(np.matmul(wrenches, data.xmat[links].reshape(-1, 3, 3)).reshape(-1, 6))


def _has_inertia(engine: Any) -> NDArray[np.bool_]:
    return np.asarray((engine.body_mass != 0.0) | engine.body_inertia.any(axis=1))


def _moments_and_masses(engine: Any, bodies: NDArray[np.intp]) -> Floats:
    """Return the factors (n, 2, 3) of angular and linear accelerations in principal axes."""
    mass = np.repeat(engine.body_mass[bodies][:, None], 3, axis=1)
    return np.stack([engine.body_inertia[bodies], mass], axis=1)


def _loads(data: Any, bodies: NDArray[np.intp], inertia: Floats) -> Floats:
    """Return the moment and the force (n, 2, 3) that move each body, about its centre of mass in world axes,
    after `mj_rnePostConstraint` (accelerations without gravity)."""
    # MuJoCo's velocities and spatial accelerations (w, v, dw, a) are about the robot's centre of mass, in
    # world axes; here they are converted to those of the body's centre of mass, in principal axes.
    both = np.concatenate((data.cvel, data.cacc), 1).take(bodies, 0, None, "clip").reshape(-1, 4, 3)
    from_center = data.xipos.take(bodies, 0, None, "clip") - data.subtree_com[ROOT_BODY]
    both[:, 1::2] += np.matmul(both[:, 0::2], _skew(from_center))
    to_principal = data.ximat.take(bodies, 0, None, "clip").reshape(-1, 3, 3)
    both = np.matmul(both, to_principal)
    # Moment and force of each body, from the classical acceleration a + w x v.
    load = inertia * both[:, 2:]
    load -= np.matmul(inertia * both[:, :2], _skew(both[:, 0]))
    return np.asarray(np.matmul(load, to_principal.transpose(0, 2, 1)))


def _skew(vectors: Floats) -> Floats:
    """Return the skew matrices (n, 3, 3) of vectors (n, 3)."""
    return np.asarray(vectors.dot(_TO_SKEW).reshape(-1, 3, 3))


ORIGIN = np.zeros(3)
XBODY = mujoco.mjtObj.mjOBJ_XBODY
ALMOST_SINGULAR = int(mujoco.mjtWarning.mjWARN_INERTIA)


def _message(error: BaseException) -> str:
    return f"{type(error).__name__}: {(nonblank_lines(error) or ['no message'])[0]}"


class _Workspace(local):
    """The engine's `MjData` and views into it, for one thread."""

    def __init__(self, engine: Any) -> None:
        self.data = data = silent_data(engine)
        self.q, self.v, self.a = data.qpos, data.qvel, data.qacc
        self.tau = data.qfrc_applied
        self.p, self.R = data.xpos, data.xmat.reshape(-1, 3, 3)
        self.almost_singular = data.warning[ALMOST_SINGULAR]
        self.M = data.M


def _places_of_triangle(engine: Any) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the places of the entries of MuJoCo's sparse mass matrix, which is its lower triangle, in a
    matrix (nv, nv) by rows, and in its transpose."""
    rows, columns = np.repeat(np.arange(engine.nv), engine.M_rownnz), engine.M_colind
    return rows * engine.nv + columns, columns * engine.nv + rows


@engine_errors(_message)
class MujocoBackend(Backend):
    """MuJoCo behind the interface of `Backend`.

    A batch is a Python loop over the engine's calls. For batches the backend ``compiled`` gives the same
    numbers, to rounding, about 200 times as fast in forward dynamics, which is MuJoCo's own, and 8,000 times
    in inverse dynamics, which is composed in Python (UR5, one thread, to one significant figure:
    ``dynx bench ur5 --batch 65536 --threads 1``, which measures the other quantities too).
    """

    name: ClassVar[str] = "mujoco"
    takes_ball_joints: ClassVar[bool] = True

    def __init__(self, model: Model, *, validate: bool = True) -> None:
        """Raises EngineLimitError for a model that is too large for the engine."""
        refuse_large(model)
        super().__init__(model, validate=validate)
        try:
            tree = build_tree(model)
            self._engine, self._bodies = tree.model, tree.frames
            self._workspace = _Workspace(self._engine)
        except DynxError:
            raise
        except Exception as error:
            raise EngineError(f"mujoco cannot represent {model.name}: {_message(error)}") from error
        self._nv = self._mechanism.nv
        self._floating = model.floating
        # Entries of q in MuJoCo's order of quaternions.
        self._order: NDArray[np.intp] | None = None
        if model.ball_joints:
            order = np.arange(model.nq)
            for first in model.quaternions:
                order[first : first + 4] = first + 3, first, first + 1, first + 2
            self._order = order
        self._dynamics = ProjectedDynamics(self._engine, floating=model.floating)
        self._masses_add = tree.masses_add
        self._total_mass = float(self._engine.body_subtreemass[ROOT_BODY])
        self._lower, self._upper = _places_of_triangle(self._engine)

    @property
    def engine_version(self) -> str:
        """``mujoco`` and the version of the library."""
        return f"mujoco {mujoco.__version__}"

    def _release(self) -> None:
        # Calls in progress in other threads keep their own reference until they return.
        del self._workspace, self._engine

    # -- kinematics ---------------------------------------------------------------------------

    def _frame_placements(self, q: Floats) -> Floats:
        work = self._set_positions(q)
        T = np.zeros((len(self._bodies), 4, 4))
        bodies = list(self._bodies)
        T[:, :3, :3], T[:, :3, 3], T[:, 3, 3] = work.R[bodies], work.p[bodies], 1.0
        return T

    def _frame_placement(self, q: Floats, frame: int) -> Floats:
        work, body = self._set_positions(q), self._bodies[frame]
        T = np.zeros((4, 4))
        T[:3, :3], T[:3, 3], T[3, 3] = work.R[body], work.p[body], 1.0
        return T

    def _jacobian(self, q: Floats, frame: int, reference: Reference) -> Floats:
        work, body = self._set_positions(q), self._bodies[frame]
        mujoco.mj_comPos(self._engine, work.data)
        return self._jacobian_at(work, body, reference)

    def _jacobian_derivative(self, q: Floats, v: Floats, frame: int, reference: Reference) -> Floats:
        work, body = self._set_state(q, v), self._bodies[frame]
        return self._jacobian_derivative_at(work, v, body, reference)

    def _frame_acceleration(
        self, q: Floats, v: Floats, a: Floats, frame: int, reference: Reference
    ) -> Floats:
        # MuJoCo's own accelerations lose digits.
        work, body = self._set_state(q, v), self._bodies[frame]
        found = self._jacobian_at(work, body, reference).dot(a)
        found += self._jacobian_derivative_at(work, v, body, reference).dot(v)
        return np.asarray(found)

    def _jacobian_at(self, work: _Workspace, body: int, reference: Reference) -> Floats:
        """Return the Jacobian (6, nv) of a body's frame at the positions of the workspace."""
        J = self._columns(work, mujoco.mj_jac, ORIGIN if reference == "world" else work.p[body], body)
        if reference == "local":
            return np.concatenate([work.R[body].T @ J[:3], work.R[body].T @ J[3:]])
        return J

    def _jacobian_derivative_at(self, work: _Workspace, v: Floats, body: int, reference: Reference) -> Floats:
        """Return dJ/dt (6, nv) of a body's frame in the state of the workspace, whose velocity is `v`."""
        p, R = work.p[body], work.R[body]
        dJ = self._columns(work, mujoco.mj_jacDot, p, body)
        if self._floating:
            # The base's linear columns are its axes, which rotate with it.
            dJ[:3, :3] = work.R[ROOT_BODY] @ skew(v[3:6])
        if reference == LOCAL_WORLD_ALIGNED:
            return dJ
        J = self._columns(work, mujoco.mj_jac, p, body)
        velocity, omega = J[:3] @ v, J[3:] @ v
        if reference == "local":
            spin = skew(omega)
            return np.concatenate([R.T @ (dJ[:3] - spin @ J[:3]), R.T @ (dJ[3:] - spin @ J[3:])])
        return np.concatenate([dJ[:3] + skew(velocity) @ J[3:] + skew(np.array(p)) @ dJ[3:], dJ[3:]])

    def _frame_velocity(self, q: Floats, v: Floats, frame: int, reference: Reference) -> Floats:
        work, body = self._set_state(q, v), self._bodies[frame]
        twist = np.empty(6)
        mujoco.mj_objectVelocity(self._engine, work.data, XBODY, body, twist, reference == "local")
        return _linear_first(twist, work.p[body] if reference == "world" else None)

    # -- dynamics -----------------------------------------------------------------------------

    def _inverse_dynamics(self, q: Floats, v: Floats, a: Floats) -> Floats:
        work = self._set_state(q, v)
        self._set_acceleration(work, v, a)
        return self._dynamics.torque(work.data, work.R[ROOT_BODY], work.p[ROOT_BODY])

    def _joint_wrenches(self, q: Floats, v: Floats, a: Floats) -> Floats:
        work = self._set_state(q, v)
        self._set_acceleration(work, v, a)
        return self._wrenches_of_links(work.data, slice(1, None))

    def _base_wrench(self, q: Floats, v: Floats, a: Floats) -> Floats:
        work = self._set_state(q, v)
        self._set_acceleration(work, v, a)
        return np.asarray(self._wrenches_of_links(work.data, slice(1))[0])

    @cached_property
    def _wrenches_of_links(self) -> ProjectedWrenches:
        return ProjectedWrenches(self._engine, self._bodies[: len(self.model.links)])

    def _forward_dynamics(self, q: Floats, v: Floats, tau: Floats) -> Floats:
        work = self._workspace
        if self._floating:
            self._set_positions(q)
            work.v[:], work.tau[:] = v, tau
            work.v[:3], work.tau[:3] = work.R[ROOT_BODY] @ v[:3], work.R[ROOT_BODY] @ tau[:3]
        else:
            work.q[:] = q if self._order is None else q[self._order]
            work.v[:], work.tau[:] = v, tau
        before = work.almost_singular.number
        mujoco.mj_forward(self._engine, work.data)
        if work.almost_singular.number != before:
            # A pivot below 1e-15 was replaced by it, because of small units or a mass matrix that is not
            # positive definite.
            return super()._forward_dynamics(q, v, tau)
        a: Floats = work.a.copy()
        if self._floating:
            a[:3] = work.R[ROOT_BODY].T @ a[:3] - cross(v[3:6], v[:3])
        return a

    def _mass_matrix(self, q: Floats) -> Floats:
        work = self._set_positions(q)
        return self._dynamics.mass_matrix(work.data, work.R[ROOT_BODY], work.p[ROOT_BODY])

    def _gravity_torque(self, q: Floats) -> Floats:
        work = self._set_positions(q)
        return self._dynamics.gravity_torque(work.data, work.R[ROOT_BODY], work.p[ROOT_BODY])

    def _kinetic_energy(self, q: Floats, v: Floats) -> Floats:
        work = self._set_positions(q)
        return self._dynamics.kinetic_energy(work.data, work.R[ROOT_BODY], work.p[ROOT_BODY], v)

    def _mass_matrix_and_bias(self, q: Floats, v: Floats) -> tuple[Floats, Floats]:
        """Return M (nv, nv) and C v + g (nv,) as MuJoCo's own forward dynamics has them."""
        work, engine, n = self._set_state(q, v), self._engine, self._nv
        warned = work.data.warning[ALMOST_SINGULAR]
        before = warned.number
        mujoco.mj_makeM(engine, work.data)
        mujoco.mj_factorM(engine, work.data)
        if warned.number != before:
            return super()._mass_matrix_and_bias(q, v)
        bias, entries = np.empty(n), np.zeros(n * n)
        mujoco.mj_rne(engine, work.data, 0, bias)
        entries[self._lower] = entries[self._upper] = work.M
        M = entries.reshape(n, n)
        if self._floating:
            R = work.R[ROOT_BODY]
            bias += M[:, :3] @ (R @ cross(v[3:6], v[:3]))
            bias[:3] = bias[:3] @ R
            M[:3] = R.T @ M[:3]
            M[:, :3] = M[:, :3] @ R
        return M, bias

    # -- the whole body -----------------------------------------------------------------------

    def _center_of_mass(self, q: Floats) -> Floats:
        if not self._masses_add:
            return self._derive("center_of_mass", q)
        work = self._set_positions(q)
        mujoco.mj_comPos(self._engine, work.data)
        return np.array(work.data.subtree_com[ROOT_BODY])

    def _center_of_mass_jacobian(self, q: Floats) -> Floats:
        if not self._masses_add:
            return self._derive("center_of_mass_jacobian", q)
        work = self._set_positions(q)
        mujoco.mj_comPos(self._engine, work.data)
        J = np.zeros((3, self._nv))
        mujoco.mj_jacSubtreeCom(self._engine, work.data, J, ROOT_BODY)
        if self._floating:
            J[:, :3] = J[:, :3] @ work.R[ROOT_BODY]
        return J

    def _centroidal_momentum(self, q: Floats, v: Floats) -> Floats:
        if not self._masses_add:
            return self._derive("centroidal_momentum", q, v)
        data = self._set_state(q, v).data
        mujoco.mj_subtreeVel(self._engine, data)
        linear = self._total_mass * data.subtree_linvel[ROOT_BODY]
        return np.concatenate([linear, data.subtree_angmom[ROOT_BODY]])

    def _potential_energy(self, q: Floats) -> Floats:
        data = self._set_positions(q).data
        mujoco.mj_energyPos(self._engine, data)
        return np.array(data.energy[0])

    # -- the engine's state -------------------------------------------------------------------

    def _set_positions(self, q: Floats) -> _Workspace:
        """Compute the poses of all bodies at `q` in this thread's workspace, which is returned."""
        work = self._workspace
        if self._order is not None:
            work.q[:] = q[self._order]
        else:
            work.q[:] = q
            if self._floating:
                work.q[3], work.q[4:7] = q[6], q[3:6]
        mujoco.mj_kinematics(self._engine, work.data)
        return work

    def _set_state(self, q: Floats, v: Floats) -> _Workspace:
        """Compute the poses and velocities of all bodies in this thread's workspace, which is returned."""
        work = self._set_positions(q)
        work.v[:] = v
        if self._floating:
            work.v[:3] = work.R[ROOT_BODY] @ v[:3]
        mujoco.mj_comPos(self._engine, work.data)
        mujoco.mj_comVel(self._engine, work.data)
        return work

    def _set_acceleration(self, work: _Workspace, v: Floats, a: Floats) -> None:
        """Compute the accelerations of all bodies, after `_set_state`."""
        work.a[:] = a
        if self._floating:
            work.a[:3] = work.R[ROOT_BODY] @ (a[:3] + cross(v[3:6], v[:3]))
        mujoco.mj_rnePostConstraint(self._engine, work.data)

    def _columns(self, work: _Workspace, function: Callable[..., None], point: Floats, body: int) -> Floats:
        """Return a Jacobian (6, nv) by MuJoCo, with the base's velocity in base axes."""
        J = np.zeros((6, self._nv))
        function(self._engine, work.data, J[:3], J[3:], point, body)
        if self._floating:
            J[:3, :3] = J[:3, :3] @ work.R[ROOT_BODY]
        return J


def _linear_first(spatial: Floats, p: Floats | None = None) -> Floats:
    """Reorder an (angular, linear) vector (6,) of MuJoCo; with `p`, from there to the world's origin."""
    angular, linear = spatial[:3], spatial[3:]
    return np.concatenate([linear if p is None else linear + cross(p, angular), angular])
