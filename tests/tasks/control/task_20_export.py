"""A description for MuJoCo."""

from pathlib import Path

import mujoco
import numpy as np
import pinocchio as pin

from tests.tasks.robots import fixed, pinocchio_model, revolute, robot, rod
from tests.tasks.task import Task, Wrong, existing, numbers, require, require_close

DAMPING = {"waist": 0.7, "shoulder": 0.5, "elbow": 0.2}
FRICTION = {"waist": 0.0, "shoulder": 0.3, "elbow": 0.1}
LIMITS = {"waist": (-3.0, 3.0), "shoulder": (-1.5, 2.0), "elbow": (-2.4, 0.1)}


def description() -> str:
    """Return an arm with damping, friction and limits."""
    parts = {
        "waist": ("base", "column", "0 0 0", "0 0 1"),
        "shoulder": ("column", "upper_arm", "0 0 0.3", "0 1 0"),
        "elbow": ("upper_arm", "forearm", "0 0 0.4", "0 0.6 0.8"),
    }
    joints = []
    for name, (parent, child, xyz, axis) in parts.items():
        dynamics = f'\n    <dynamics damping="{DAMPING[name]}" friction="{FRICTION[name]}"/>'
        low, high = LIMITS[name]
        text = revolute(name, parent, child, xyz, dynamics, axis)
        joints.append(text.replace('lower="-20" upper="20"', f'lower="{low}" upper="{high}"'))
    return robot(
        "small_arm",
        '  <link name="base"/>\n',
        rod("column", 3.0, 0.3),
        rod("upper_arm", 1.8, 0.4),
        rod("forearm", 0.9, 0.35, "x"),
        rod("gripper", 0.3, 0.12, "x"),
        *joints,
        fixed("gripper_mount", "forearm", "gripper", "0.35 0 0"),
    )


def check(folder: Path) -> None:
    """Load the file in MuJoCo and compare its quantities with Pinocchio's of the URDF text."""
    path = existing(folder, "answer.xml")
    require("<mujoco" in path.read_text(), "answer.xml is not MJCF")
    try:
        engine = mujoco.MjModel.from_xml_path(str(path))
    except ValueError as error:
        raise Wrong(f"MuJoCo does not load answer.xml: {error}") from None
    state = mujoco.MjData(engine)
    model = pinocchio_model(description())
    data = model.createData()
    require(engine.nv == 3 and engine.nq == 3, f"the model has {engine.nv} degrees of freedom, not 3")
    names = [mujoco.mj_id2name(engine, mujoco.mjtObj.mjOBJ_JOINT, index) for index in range(3)]
    require(names == list(LIMITS), f"the joints are {names}")
    require_close("gravity", numbers("gravity", engine.opt.gravity, 3), np.array([0, 0, -9.81]), 1e-9)
    require_close("damping", np.ravel(engine.dof_damping), np.array(list(DAMPING.values())), 1e-9)
    require_close("friction", np.ravel(engine.dof_frictionloss), np.array(list(FRICTION.values())), 1e-9)
    require(bool(np.all(engine.jnt_limited)), "a joint has no limits")
    require_close("limits", np.array(engine.jnt_range), np.array(list(LIMITS.values())), 1e-6)
    random = np.random.default_rng(20)
    for _ in range(5):
        q, v = random.uniform(-1, 0.1, 3), random.uniform(-2, 2, 3)
        state.qpos[:], state.qvel[:] = q, v
        mujoco.mj_forward(engine, state)
        mass = np.column_stack([product(engine, state, column) for column in np.eye(3)])
        upper = np.triu(pin.crba(model, data, q))
        require_close("mass matrix", mass, upper + np.triu(upper, 1).T, 1e-5)
        bias = np.array(pin.nonLinearEffects(model, data, q, v))
        require_close("bias torque", np.array(state.qfrc_bias), bias, 1e-5)


def product(engine: mujoco.MjModel, state: mujoco.MjData, vector: np.ndarray) -> np.ndarray:
    """Return MuJoCo's mass matrix times a vector."""
    result = np.zeros_like(vector)
    mujoco.mj_mulM(engine, state, result, vector)
    return result


TASK = Task(
    "Give the robot to a MuJoCo user",
    """
A colleague works with MuJoCo. Convert arm.urdf to MJCF: with the same joint names, joint limits, damping and
dry friction, the same masses and inertias, and gravity -9.81 m/s2 along z. MuJoCo alone must load the
file and
get the same mass matrix and bias torques as from the URDF description.

Write answer.xml (with any further files beside it that it needs).
""",
    check,
    {"arm.urdf": description},
)
