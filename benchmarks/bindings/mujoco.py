"""Calls of MuJoCo's own binding, each with the work and the outputs of one method of a backend."""

from __future__ import annotations

import mujoco
import numpy as np

from benchmarks.bindings.sample import FRAME, Call, Sample
from benchmarks.bindings.urdf_text import spelled_out
from dynx.model import Model
from dynx.spatial.scalar import Floats

KEEP_FIXED_LINKS = '<mujoco><compiler fusestatic="false"/></mujoco>'


def binding_calls(model: Model, sample: Sample) -> dict[str, Call]:
    """Return the calls of MuJoCo's binding on a model that its own parser reads.

    Only the stages of MuJoCo's pipeline that the quantity needs are run.
    """
    text = spelled_out(model)
    engine = mujoco.MjModel.from_xml_string(text.replace("</robot>", f"{KEEP_FIXED_LINKS}</robot>"))
    flags = mujoco.mjtDisableBit
    engine.opt.disableflags |= flags.mjDSBL_CONSTRAINT | flags.mjDSBL_CONTACT
    data, nv = mujoco.MjData(engine), engine.nv
    q, v, a, tau = sample.q, sample.v, sample.a, sample.tau
    numbers = [engine.body(name).id for name in model.frame_names]
    body, kind = engine.body(FRAME).id, mujoco.mjtObj.mjOBJ_XBODY
    whole, mass = 0, float(engine.body_subtreemass[0])
    gravity = np.array(engine.opt.gravity)

    def positions() -> None:
        data.qpos[:] = q
        mujoco.mj_kinematics(engine, data)

    def motion() -> None:
        positions()
        data.qvel[:] = v
        mujoco.mj_comPos(engine, data)
        mujoco.mj_comVel(engine, data)

    def forward_kinematics() -> Floats:
        positions()
        T = np.eye(4)
        T[:3, :3], T[:3, 3] = data.xmat[body].reshape(3, 3), data.xpos[body]
        return T

    def all_frames() -> Floats:
        positions()
        T = np.zeros((len(numbers), 4, 4))
        T[:, :3, :3], T[:, :3, 3], T[:, 3, 3] = data.xmat[numbers].reshape(-1, 3, 3), data.xpos[numbers], 1.0
        return T

    def jacobian() -> Floats:
        positions()
        mujoco.mj_comPos(engine, data)
        J = np.empty((6, nv))
        mujoco.mj_jac(engine, data, J[:3], J[3:], data.xpos[body], body)
        return J

    def jacobian_derivative() -> Floats:
        motion()
        dJ = np.empty((6, nv))
        mujoco.mj_jacDot(engine, data, dJ[:3], dJ[3:], data.xpos[body], body)
        return dJ

    def frame_velocity() -> Floats:
        motion()
        twist = np.empty(6)
        mujoco.mj_objectVelocity(engine, data, kind, body, twist, 0)
        return np.concatenate([twist[3:], twist[:3]])

    def frame_acceleration() -> Floats:
        motion()
        data.qacc[:] = a
        mujoco.mj_rnePostConstraint(engine, data)
        acceleration = np.empty(6)
        mujoco.mj_objectAcceleration(engine, data, kind, body, acceleration, 0)
        return np.concatenate([acceleration[3:] + gravity, acceleration[:3]])

    def inverse_dynamics() -> Floats:
        motion()
        data.qacc[:] = a
        torque = np.empty(nv)
        mujoco.mj_rne(engine, data, 1, torque)
        return torque

    def forward_dynamics() -> Floats:
        data.qpos[:], data.qvel[:], data.qfrc_applied[:] = q, v, tau
        mujoco.mj_forward(engine, data)
        return np.array(data.qacc)

    def mass_matrix() -> Floats:
        positions()
        mujoco.mj_comPos(engine, data)
        mujoco.mj_makeM(engine, data)
        M = np.empty((nv, nv))
        mujoco.mj_fullM(engine, data, M)
        return M

    def bias_torque() -> Floats:
        motion()
        torque = np.empty(nv)
        mujoco.mj_rne(engine, data, 0, torque)
        return torque

    def gravity_torque() -> Floats:
        positions()
        data.qvel[:] = 0.0
        mujoco.mj_comPos(engine, data)
        mujoco.mj_comVel(engine, data)
        torque = np.empty(nv)
        mujoco.mj_rne(engine, data, 0, torque)
        return torque

    def center_of_mass() -> Floats:
        positions()
        mujoco.mj_comPos(engine, data)
        return np.array(data.subtree_com[whole])

    def center_of_mass_jacobian() -> Floats:
        positions()
        mujoco.mj_comPos(engine, data)
        J = np.empty((3, nv))
        mujoco.mj_jacSubtreeCom(engine, data, J, whole)
        return J

    def centroidal_momentum() -> Floats:
        motion()
        mujoco.mj_subtreeVel(engine, data)
        return np.concatenate([mass * data.subtree_linvel[whole], data.subtree_angmom[whole]])

    def kinetic_energy() -> Floats:
        motion()
        mujoco.mj_makeM(engine, data)
        mujoco.mj_energyVel(engine, data)
        return np.array(data.energy[1])

    def potential_energy() -> Floats:
        positions()
        mujoco.mj_energyPos(engine, data)
        return np.array(data.energy[0])

    return {
        "forward_kinematics": forward_kinematics,
        "all frames": all_frames,
        "jacobian": jacobian,
        "jacobian_derivative": jacobian_derivative,
        "frame_velocity": frame_velocity,
        "frame_acceleration": frame_acceleration,
        "inverse_dynamics": inverse_dynamics,
        "forward_dynamics": forward_dynamics,
        "mass_matrix": mass_matrix,
        "bias_torque": bias_torque,
        "gravity_torque": gravity_torque,
        "center_of_mass": center_of_mass,
        "center_of_mass_jacobian": center_of_mass_jacobian,
        "centroidal_momentum": centroidal_momentum,
        "kinetic_energy": kinetic_energy,
        "potential_energy": potential_energy,
    }
