"""The backend `mujoco`: MuJoCo's kinematics, Jacobians, accelerations and LDL' solver.

The engine's model is built from the links and joints of the `Model` (`tree`), independently of
`dynx.model.mechanism`; it has no limits, contacts, damping or actuators, so MuJoCo's constraint solver is
idle. Mass matrix and torques are computed from MuJoCo's poses, axes, accelerations and inertias, because
`mj_crb` and `mj_rne` lose digits (`projection`). Tree coordinates are MuJoCo's own except for a floating
base: its quaternion is (w, x, y, z), and its linear velocity is in world axes.

Several threads may use it: each has its own workspace of the engine (`MjData`), made on its first call.
MuJoCo releases the GIL in its calls.
"""

from __future__ import annotations

from collections.abc import Callable
from threading import local
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from dynx.backends.base import Backend
from dynx.backends.engine_errors import engine_errors
from dynx.engines.mujoco.library import mujoco, silent_data
from dynx.engines.mujoco.projection import ProjectedDynamics
from dynx.engines.mujoco.tree import ROOT, build_tree
from dynx.errors import DynxError, EngineError, nonblank_lines
from dynx.model import Model
from dynx.rbd.jacobians import LOCAL_WORLD_ALIGNED, Reference
from dynx.spatial.scalar import Floats
from dynx.spatial.so3 import cross, skew

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
    ``dynx bench ur5 --batch 65536 --threads 1``; other quantities are in docs/bench.md).
    """

    name: ClassVar[str] = "mujoco"

    def __init__(self, model: Model, *, validate: bool = True) -> None:
        """Raises EngineLimitError for a model that is too large for the engine."""
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
        self._dynamics = ProjectedDynamics(self._engine, floating=model.floating)
        self._masses_add = tree.masses_add
        self._total_mass = float(self._engine.body_subtreemass[ROOT])
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
            dJ[:3, :3] = work.R[ROOT] @ skew(v[3:6])
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
        return self._dynamics.torque(work.data, work.R[ROOT], work.p[ROOT])

    def _forward_dynamics(self, q: Floats, v: Floats, tau: Floats) -> Floats:
        work = self._workspace
        if self._floating:
            self._set_positions(q)
            work.v[:], work.tau[:] = v, tau
            work.v[:3], work.tau[:3] = work.R[ROOT] @ v[:3], work.R[ROOT] @ tau[:3]
        else:
            work.q[:], work.v[:], work.tau[:] = q, v, tau
        before = work.almost_singular.number
        mujoco.mj_forward(self._engine, work.data)
        if work.almost_singular.number != before:
            # A pivot below 1e-15 was replaced by it, because of small units or a mass matrix that is not
            # positive definite.
            return super()._forward_dynamics(q, v, tau)
        a: Floats = work.a.copy()
        if self._floating:
            a[:3] = work.R[ROOT].T @ a[:3] - cross(v[3:6], v[:3])
        return a

    def _mass_matrix(self, q: Floats) -> Floats:
        work = self._set_positions(q)
        return self._dynamics.mass_matrix(work.data, work.R[ROOT], work.p[ROOT])

    def _gravity_torque(self, q: Floats) -> Floats:
        work = self._set_positions(q)
        return self._dynamics.gravity_torque(work.data, work.R[ROOT], work.p[ROOT])

    def _kinetic_energy(self, q: Floats, v: Floats) -> Floats:
        work = self._set_positions(q)
        return self._dynamics.kinetic_energy(work.data, work.R[ROOT], work.p[ROOT], v)

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
            R = work.R[ROOT]
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
        return np.array(work.data.subtree_com[ROOT])

    def _center_of_mass_jacobian(self, q: Floats) -> Floats:
        if not self._masses_add:
            return self._derive("center_of_mass_jacobian", q)
        work = self._set_positions(q)
        mujoco.mj_comPos(self._engine, work.data)
        J = np.zeros((3, self._nv))
        mujoco.mj_jacSubtreeCom(self._engine, work.data, J, ROOT)
        if self._floating:
            J[:, :3] = J[:, :3] @ work.R[ROOT]
        return J

    def _centroidal_momentum(self, q: Floats, v: Floats) -> Floats:
        if not self._masses_add:
            return self._derive("centroidal_momentum", q, v)
        data = self._set_state(q, v).data
        mujoco.mj_subtreeVel(self._engine, data)
        linear = self._total_mass * data.subtree_linvel[ROOT]
        return np.concatenate([linear, data.subtree_angmom[ROOT]])

    def _potential_energy(self, q: Floats) -> Floats:
        data = self._set_positions(q).data
        mujoco.mj_energyPos(self._engine, data)
        return np.array(data.energy[0])

    # -- the engine's state -------------------------------------------------------------------

    def _set_positions(self, q: Floats) -> _Workspace:
        """Compute the poses of all bodies at `q` in this thread's workspace, which is returned."""
        work = self._workspace
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
            work.v[:3] = work.R[ROOT] @ v[:3]
        mujoco.mj_comPos(self._engine, work.data)
        mujoco.mj_comVel(self._engine, work.data)
        return work

    def _set_acceleration(self, work: _Workspace, v: Floats, a: Floats) -> None:
        """Compute the accelerations of all bodies, after `_set_state`."""
        work.a[:] = a
        if self._floating:
            work.a[:3] = work.R[ROOT] @ (a[:3] + cross(v[3:6], v[:3]))
        mujoco.mj_rnePostConstraint(self._engine, work.data)

    def _columns(self, work: _Workspace, function: Callable[..., None], point: Floats, body: int) -> Floats:
        """Return a Jacobian (6, nv) by MuJoCo, with the base's velocity in base axes."""
        J = np.zeros((6, self._nv))
        function(self._engine, work.data, J[:3], J[3:], point, body)
        if self._floating:
            J[:3, :3] = J[:3, :3] @ work.R[ROOT]
        return J


def _linear_first(spatial: Floats, p: Floats | None = None) -> Floats:
    """Reorder an (angular, linear) vector (6,) of MuJoCo; with `p`, from there to the world's origin."""
    angular, linear = spatial[:3], spatial[3:]
    return np.concatenate([linear if p is None else linear + cross(p, angular), angular])
