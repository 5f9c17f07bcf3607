"""A URDF file as MuJoCo loads it.

Quantities are those of the calls that users make, `mj_inverse` and `mj_forward`, with all forces that MuJoCo
adds to rigid bodies. Joint damping, dry friction, violated limits, `<mimic>` (an equality constraint) and
shapes that touch add forces to both; each of `CALLS` removes one kind.

With a fixed base MuJoCo merges the root link, and all links on fixed joints, into their parents
(`fusestatic`, the default for URDF), so these links have no frame.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import replace
from pathlib import Path
from typing import ClassVar

import numpy as np

from dynx.engines.mujoco.file_loading import CALLS, load_file, loading_lines
from dynx.engines.mujoco.library import mujoco, silence_warnings
from dynx.engines.mujoco.loaded_description import WORLD, describe_model
from dynx.loaded.description import LoadedModel
from dynx.loaded.robot import LoadedRobot, lacking_joints
from dynx.model import Model
from dynx.spatial.scalar import Floats


class LoadedMujoco(LoadedRobot):
    """A robot as `mujoco.MjModel.from_xml_path` loads it; see `LoadedRobot`."""

    name: ClassVar[str] = "mujoco"
    CALLS: ClassVar[Mapping[str, str]] = CALLS
    refuses_without: ClassVar[tuple[str, ...]] = ("collision",)

    def __init__(self, path: Path, model: Model, calls: Collection[str] = ()) -> None:
        self._model = model
        self._loaded = loaded = load_file(Path(path), model, self.load_call(model.floating), calls)
        self._gravity: Floats = np.array(loaded.opt.gravity)
        loaded.opt.gravity[:] = model.gravity
        self._bodies = [self._body(link.name) for link in model.links]
        joints = [self._joint(name) for name in model.joint_names]
        base = 6 if model.floating else 0
        # Indices of dynx's coordinates among MuJoCo's; the free joint comes first in both.
        self._q = [int(loaded.jnt_qposadr[joint]) for joint in joints]
        self._v = [*range(base), *(int(loaded.jnt_dofadr[joint]) for joint in joints)]
        self._data = mujoco.MjData(loaded)

    @classmethod
    def engine_version(cls) -> str:
        """Return the version of MuJoCo."""
        return str(mujoco.__version__)

    @classmethod
    def load_call(cls, floating: bool) -> str:
        """Return the call: one line for a fixed base, three for a floating one."""
        return loading_lines(floating=floating)

    def describe(self) -> LoadedModel:
        """Describe MuJoCo's model."""
        return replace(describe_model(self._loaded, self._model, self._gravity), engine=self.name)

    def link_poses(self, q: Floats) -> Floats:
        """Return T_world_link (n_links, 4, 4); NaN for links that MuJoCo merged into others."""
        self._place(q)
        mujoco.mj_kinematics(self._loaded, self._data)
        T = np.full((len(self._bodies), 4, 4), np.nan)
        for index, body in enumerate(self._bodies):
            if body is not None:
                T[index] = np.eye(4)
                T[index, :3, :3] = self._data.xmat[body].reshape(3, 3)
                T[index, :3, 3] = self._data.xpos[body]
        return T

    def jacobian(self, q: Floats, link: str) -> Floats:
        """Return the Jacobian (6, nv) of a link frame by `mj_jacBody`."""
        body = self._bodies[self._model.frame_index(link)]
        if body is None:
            return np.full((6, len(self._v)), np.nan)
        self._place(q)
        mujoco.mj_kinematics(self._loaded, self._data)
        mujoco.mj_comPos(self._loaded, self._data)
        J = np.zeros((6, self._loaded.nv))
        mujoco.mj_jacBody(self._loaded, self._data, J[:3], J[3:], body)
        J = J[:, self._v]
        if self._model.floating:
            J[:, :3] = J[:, :3] @ self._base_rotation()
        return J

    def mass_matrix(self, q: Floats) -> Floats:
        """Return the mass matrix (nv, nv) by `mj_fullM`."""
        self._place(q)
        mujoco.mj_forward(self._loaded, self._data)
        M = np.zeros((self._loaded.nv, self._loaded.nv))
        # Since MuJoCo 4.0 the argument is the data, before that its field qM.
        if hasattr(self._data, "qM"):
            mujoco.mj_fullM(self._loaded, M, self._data.qM)
        else:
            mujoco.mj_fullM(self._loaded, self._data, M)
        M = M[np.ix_(self._v, self._v)]
        if self._model.floating:
            R = self._base_rotation()
            M[:3] = R.T @ M[:3]
            M[:, :3] = M[:, :3] @ R
        return M

    def inverse_dynamics(self, q: Floats, v: Floats, a: Floats) -> Floats:
        """Return the torque (nv,) of `mj_inverse`, which subtracts damping and constraint forces."""
        self._place(q, v)
        self._data.qacc[self._v] = a
        if self._model.floating:
            self._data.qacc[:3] = self._base_rotation() @ (a[:3] + np.cross(v[3:6], v[:3]))
        mujoco.mj_inverse(self._loaded, self._data)
        tau = np.array(self._data.qfrc_inverse[self._v])
        if self._model.floating:
            tau[:3] = self._base_rotation().T @ tau[:3]
        return tau

    def forward_dynamics(self, q: Floats, v: Floats, tau: Floats) -> Floats:
        """Return the acceleration (nv,) of `mj_forward` with `tau` in `qfrc_applied`."""
        self._place(q, v)
        self._data.qfrc_applied[self._v] = tau
        if self._model.floating:
            self._data.qfrc_applied[:3] = self._base_rotation() @ tau[:3]
        mujoco.mj_forward(self._loaded, self._data)
        a = np.array(self._data.qacc[self._v])
        if self._model.floating:
            a[:3] = self._base_rotation().T @ a[:3] - np.cross(v[3:6], v[:3])
        return a

    def contacts(self, q: Floats) -> Mapping[tuple[str, str], float]:
        """Pairs of `data.contact`, by the links into which MuJoCo merged others; the world is the root."""
        # Contacts depend on the configuration alone, and are asked for at hundreds of them.
        self._set_positions(q)
        mujoco.mj_kinematics(self._loaded, self._data)
        mujoco.mj_collision(self._loaded, self._data)
        found: dict[tuple[str, str], float] = {}
        # The list of contacts takes 0.1 ms to make, also where it is empty.
        for contact in self._data.contact[: self._data.ncon] if self._data.ncon else ():
            bodies = self._loaded.geom_bodyid[[contact.geom1, contact.geom2]]
            names = (self._loaded.body(body).name if body > WORLD else self._model.root for body in bodies)
            one, other = sorted(names)
            found[one, other] = max(found.get((one, other), 0.0), -float(contact.dist))
        return found

    def close(self) -> None:
        """Release MuJoCo's model and data."""
        vars(self).pop("_data", None)
        vars(self).pop("_loaded", None)

    # -- from dynx to MuJoCo ------------------------------------------------------------------

    def _place(self, q: Floats, v: Floats | None = None) -> None:
        """Reset the data to the state after loading, and set the configuration and the velocity."""
        data = self._data
        mujoco.mj_resetData(self._loaded, data)
        silence_warnings(data)
        self._set_positions(q)
        if v is not None:
            data.qvel[self._v] = v
            if self._model.floating:
                mujoco.mj_kinematics(self._loaded, data)
                data.qvel[:3] = self._base_rotation() @ v[:3]

    def _set_positions(self, q: Floats) -> None:
        """Set the configuration; coordinates that the model lacks stay at zero."""
        qpos, base = self._data.qpos, 7 if self._model.floating else 0
        qpos[self._q] = q[base:]
        if base:
            x, y, z, w = q[3:7]
            qpos[:7] = [*q[:3], w, x, y, z]

    def _base_rotation(self) -> Floats:
        """Return R of the base; MuJoCo has the base's linear velocity in world axes."""
        R: Floats = self._data.xmat[self._loaded.jnt_bodyid[0]].reshape(3, 3)
        return R

    def _body(self, link: str) -> int | None:
        """Return MuJoCo's body for a link; the world for a fixed root named ``world``."""
        if not link:
            return None
        number = int(mujoco.mj_name2id(self._loaded, mujoco.mjtObj.mjOBJ_BODY, link))
        is_world = number == WORLD and link == self._model.root and not self._model.floating
        return number if number > WORLD or is_world else None

    def _joint(self, name: str) -> int:
        number = int(mujoco.mj_name2id(self._loaded, mujoco.mjtObj.mjOBJ_JOINT, name))
        single = (mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE)
        if number < 0 or self._loaded.jnt_type[number] not in [int(kind) for kind in single]:
            instead = "not there" if number < 0 else "of several degrees of freedom"
            raise lacking_joints(self.name, self._model, {name: instead})
        return number


class BalancedMujoco(LoadedMujoco):
    """A robot as MuJoCo loads it with `balanceinertia`, by which it accepts impossible inertias.

    Moments of which one exceeds the sum of the others are replaced by their mean.
    """

    name: ClassVar[str] = "mujoco:balanceinertia"

    @classmethod
    def load_call(cls, floating: bool) -> str:
        """Return the call: three lines for a fixed base, four for a floating one."""
        return loading_lines(floating=floating, options="spec.compiler.balanceinertia = True")
