"""A right answer to each task, made without dynx and, where possible, by another way than its check."""

import json
import re
import sys
import xml.etree.ElementTree as ElementTree
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import imageio.v3 as imageio
import mujoco
import numpy as np
import numpy.typing as npt
import pinocchio as pin
import pybullet
from PIL import Image
from pybullet_utils.bullet_client import BulletClient  # type: ignore[import-untyped]
from scipy.optimize import brentq

from tests.tasks import bullet
from tests.tasks.control import (
    task_11_torques_differ,
    task_12_mend_file,
    task_14_tracking_error,
    task_15_force_sensor,
    task_16_four_bar,
    task_17_friction,
    task_18_quadruped,
    task_19_convert_script,
    task_20_export,
)
from tests.tasks.learning import (
    policies,
    task_22_other_engine,
    task_23_vectorised,
    task_24_reward_terms,
    task_25_random_masses,
    task_26_film,
    task_27_first_cause,
    task_28_environment,
    task_29_latency,
    task_30_data_set,
)
from tests.tasks.motion import cart_pole_derivative
from tests.tasks.robots import ball, cart_pole, example_robot, pinocchio_model, two_link_arm
from tests.tasks.student import (
    task_01_panda_pose,
    task_03_singularities,
    task_04_payload_gravity,
    task_05_double_pendulum,
    task_06_picture,
    task_07_trajectory_torques,
    task_08_centre_of_mass,
    task_09_distance,
    task_10_straight_line,
)
from tests.tasks.task import Array, table

Answer = Callable[[Path], None]


def write(folder: Path, **values: Any) -> None:
    """Write `answer.json`."""
    plain = {key: value.tolist() if isinstance(value, np.ndarray) else value for key, value in values.items()}
    (folder / "answer.json").write_text(json.dumps(plain))


# Kinematics from the text of a description, by NumPy.


def rotation(axis: Array, angle: float) -> Array:
    """Return the matrix of a rotation by Rodrigues' formula."""
    x, y, z = np.asarray(axis) / np.linalg.norm(axis)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.array(np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross)


def vector(element: Any, name: str, default: str) -> Array:
    """Return an attribute of three numbers."""
    text = default if element is None else element.get(name, default)
    return np.array([float(number) for number in text.split()])


def origin(element: Any) -> Array:
    """Return the transform of an element's origin."""
    place = element.find("origin")
    r, p, y = vector(place, "rpy", "0 0 0")
    transform = np.eye(4)
    transform[:3, :3] = (
        rotation(np.array([0, 0, 1]), y) @ rotation(np.array([0, 1, 0]), p) @ rotation(np.array([1, 0, 0]), r)
    )
    transform[:3, 3] = vector(place, "xyz", "0 0 0")
    return transform


@cache
def parsed(text: str) -> ElementTree.Element:
    """Return the root element of a description."""
    return ElementTree.fromstring(text)


def poses(text: str, angles: dict[str, float]) -> dict[str, Array]:
    """Return the pose of each link in the root's frame; joints that are not named are at zero."""
    robot = parsed(text)
    parents = {joint.find("child").get("link"): joint for joint in robot.findall("joint")}  # type: ignore[union-attr]

    def pose(link: str) -> Array:
        if link not in parents:
            return np.eye(4)
        joint: Any = parents[link]
        motion, value = np.eye(4), angles.get(joint.get("name"), 0.0)
        axis = vector(joint.find("axis"), "xyz", "1 0 0")
        if joint.get("type") in ("revolute", "continuous"):
            motion[:3, :3] = rotation(axis, value)
        elif joint.get("type") == "prismatic":
            motion[:3, 3] = value * axis
        return np.array(pose(joint.find("parent").get("link")) @ origin(joint) @ motion)

    return {str(link.get("name")): pose(str(link.get("name"))) for link in robot.findall("link")}


UR5 = example_robot("ur5_robot.urdf").read_text()
UR5_JOINTS = (
    "shoulder_pan_joint",
    "shoulder_lift_joint",
    "elbow_joint",
    "wrist_1_joint",
    "wrist_2_joint",
    "wrist_3_joint",
)


def ur5_pose(q: Array) -> Array:
    """Return the pose of the UR5's flange."""
    return poses(UR5, dict(zip(UR5_JOINTS, q, strict=True)))["tool0"]


def twist(before: Array, after: Array) -> Array:
    """Return the small motion between two poses: linear, then angular, in the axes of the root."""
    turn = after[:3, :3] @ before[:3, :3].T
    angular = np.array([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]]) / 2
    return np.concatenate([after[:3, 3] - before[:3, 3], angular])


def ur5_jacobian(q: Array) -> Array:
    """Return the Jacobian by central differences."""
    steps = 1e-5 * np.eye(6)
    return np.column_stack([twist(ur5_pose(q - step), ur5_pose(q + step)) / 2e-5 for step in steps])


# Physics by MuJoCo and by hand.


def without_shapes(text: str) -> str:
    """Return a description without shapes and transmissions."""
    for name in ("visual", "collision", "transmission", "gazebo"):
        text = re.sub(rf"<{name}\b.*?</{name}>", "", text, flags=re.DOTALL)
    return text


def mujoco_model(text: str, dt: float = 1e-3) -> tuple[Any, Any]:
    """Return MuJoCo's model, with its Runge-Kutta method, and state."""
    model = mujoco.MjModel.from_xml_string(without_shapes(text))
    model.opt.timestep = dt
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_RK4
    return model, mujoco.MjData(model)


def euler(states: Array, forces: Array, pole_mass: Array | float = 0.2) -> Array:
    """Return cart-pole states after 20 ms, by a semi-implicit Euler method of 0.5 ms."""
    derivative = cart_pole_derivative(forces, pole_mass)
    for _ in range(40):
        rate = derivative(states)
        velocity = states[..., 2:] + 5e-4 * rate[..., 2:]
        states = np.concatenate([states[..., :2] + 5e-4 * velocity, velocity], axis=-1)
    return states


def bullet_camera(
    client: Any, eye: Array, target: Array, field_deg: float, width: int, height: int
) -> npt.NDArray[np.uint8]:
    """Return PyBullet's picture."""
    view = client.computeViewMatrix(list(eye), list(target), [0, 0, 1])
    lens = client.computeProjectionMatrixFOV(field_deg, width / height, 0.1, 20)
    picture = client.getCameraImage(width, height, view, lens, shadow=0, renderer=pybullet.ER_TINY_RENDERER)
    return np.asarray(picture[2], dtype=np.uint8).reshape(height, width, 4)[..., :3]


# The student's tasks.


def answer_01(folder: Path) -> None:
    names = [f"panda_joint{index}" for index in range(1, 8)]
    text = example_robot("panda.urdf").read_text()
    pose = poses(text, dict(zip(names, task_01_panda_pose.ANGLES, strict=True)))["panda_hand_tcp"]
    quaternion = np.empty(4)
    mujoco.mju_mat2Quat(quaternion, pose[:3, :3].flatten())
    write(folder, position=pose[:3, 3], quat_xyzw=np.roll(quaternion, -1))


def answer_02(folder: Path) -> None:
    solutions = [
        [0.30889999, 0.17270707, -2.00879897, 1.83609190, 1.87969632, -0.92729522],
        [0.30889999, -1.71022086, 2.00879897, -0.29857811, 1.87969632, -0.92729522],
        [-2.16720122, 2.43481330, 2.29634744, -1.58956808, 0.59640489, 2.21429744],
        [-2.16720122, -1.43137180, -2.00879897, -2.84301455, -0.59640489, -0.92729522],
        [0.30889999, 0.70677936, -2.29634744, -1.55202457, -1.87969632, 2.21429744],
        [-2.16720122, 2.96888559, 2.00879897, 1.30550075, -0.59640489, -0.92729522],
        [-2.16720122, -1.72976935, -2.29634744, 0.88452414, 0.59640489, 2.21429744],
        [0.30889999, -1.41182330, 2.29634744, 2.25706852, -1.87969632, 2.21429744],
    ]
    write(folder, solutions=solutions)


def answer_03(folder: Path) -> None:
    jacobians = [ur5_jacobian(np.array(q)) for q in task_03_singularities.CONFIGURATIONS]
    smallest = [float(np.linalg.svd(jacobian)[1][-1]) for jacobian in jacobians]
    lost = np.linalg.eigh(jacobians[2] @ jacobians[2].T)[1][:, 0]
    write(folder, smallest=smallest, singular=[1, 2], lost_twist=lost)


def answer_04(folder: Path) -> None:
    x, y, z = task_04_payload_gravity.OFFSET
    payload = f"""<link name="payload"><inertial><mass value="{task_04_payload_gravity.MASS}"/>
      <inertia ixx="1e-5" iyy="1e-5" izz="1e-5" ixy="0" ixz="0" iyz="0"/></inertial></link>
      <joint name="grip" type="fixed"><parent link="panda_hand"/><child link="payload"/>
      <origin xyz="{x} {y} {z}"/></joint></robot>"""
    text = example_robot("panda.urdf").read_text().replace("</robot>", payload)
    model, data = mujoco_model(text)
    data.qpos[:7] = task_04_payload_gravity.ANGLES
    mujoco.mj_forward(model, data)
    write(folder, torques=data.qfrc_bias[:7].copy())


def answer_05(folder: Path) -> None:
    model, data = mujoco_model(task_05_double_pendulum.description())
    data.qpos[:] = task_05_double_pendulum.START
    rows = []
    for index in range(101):
        rows.append([0.02 * index, *data.qpos])
        mujoco.mj_step(model, data, 20)
    (folder / "answer.csv").write_text(table(task_05_double_pendulum.COLUMNS, np.array(rows)))


def answer_06(folder: Path) -> None:
    task = task_06_picture
    with bullet.loaded(task.description()) as (client, body):
        for joint, angle in enumerate(task.ANGLES):
            client.resetJointState(body, joint, angle)
        picture = bullet_camera(
            client, np.array(task.EYE), np.array(task.TARGET), task.FIELD, task.WIDTH, task.HEIGHT
        )
    Image.fromarray(picture).save(folder / "answer.png")


def answer_07(folder: Path) -> None:
    times, q, v, a = task_07_trajectory_torques.motion()
    (folder / "answer.csv").write_text(table(task_07_trajectory_torques.COLUMNS, np.column_stack([times, q])))
    model, data = mujoco_model(example_robot("xarm7.urdf").read_text())
    model.dof_damping[:] = model.dof_frictionloss[:] = model.dof_armature[:] = 0
    model.opt.disableflags = mujoco.mjtDisableBit.mjDSBL_LIMIT
    torques = []
    for row in zip(q, v, a, strict=True):
        data.qpos[:], data.qvel[:], data.qacc[:] = row
        mujoco.mj_inverse(model, data)
        torques.append(data.qfrc_inverse.copy())
    write(folder, peak_torques=np.abs(torques).max(axis=0))


def answer_08(folder: Path) -> None:
    text = example_robot("solo12.urdf").read_text()
    names = [f"{leg}_{joint}" for leg in ("FL", "FR", "HL", "HR") for joint in task_08_centre_of_mass.LEG]
    places = poses(text, {name: task_08_centre_of_mass.LEG[name.split("_")[1]] for name in names})
    mass, moment = 0.0, np.zeros(3)
    for link in ElementTree.fromstring(text).findall("link"):
        inertial: Any = link.find("inertial")
        if inertial is not None:
            part = float(inertial.find("mass").get("value"))
            mass += part
            moment += part * (places[str(link.get("name"))] @ origin(inertial))[:3, 3]
    write(folder, mass=mass, centre_of_mass=moment / mass, foot=places["HL_FOOT"][:3, 3])


def answer_09(folder: Path) -> None:
    task = task_09_distance
    with bullet.loaded(task.TASK.files["arm.urdf"]()) as (client, body):
        shape = client.createCollisionShape(pybullet.GEOM_BOX, halfExtents=[side / 2 for side in task.SIDES])
        box = client.createMultiBody(0, shape, basePosition=task.CENTRE)

        def distance(time: float) -> float:
            for joint in range(2):
                angle = task.START[joint] + time / 2 * (task.END[joint] - task.START[joint])
                client.resetJointState(body, joint, angle)
            return float(min(point[8] for point in client.getClosestPoints(body, box, 2.0)))

        times = np.linspace(0, 2, 401)
        index = next(index for index, time in enumerate(times) if distance(float(time)) < 0)
        contact = float(brentq(distance, times[index - 1], times[index], xtol=1e-5))
        write(folder, distance=distance(1.0), time=contact)


def answer_10(folder: Path) -> None:
    q = np.array(task_10_straight_line.START)
    start, rows = ur5_pose(q), []
    for index in range(51):
        wanted = start.copy()
        wanted[:3, 3] += np.array(task_10_straight_line.STEP) * index / 50
        jacobian = ur5_jacobian(q)
        for _ in range(3):
            q = q + np.linalg.solve(jacobian, twist(ur5_pose(q), wanted))
        rows.append(q)
    (folder / "answer.csv").write_text(table(task_10_straight_line.COLUMNS, np.array(rows)))


# The control engineer's tasks.


def answer_11(folder: Path) -> None:
    text = task_11_torques_differ.description()
    heavy = text.replace(
        '<link name="force_sensor">',
        '<link name="force_sensor"><inertial><mass value="1"/>'
        '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>',
    )
    torques = []
    for description in (text, heavy):
        model, data = mujoco_model(description)
        data.qpos[:] = task_11_torques_differ.ANGLES
        mujoco.mj_forward(model, data)
        torques.append(data.qfrc_bias.copy())
    line = text[: text.index('<link name="force_sensor">')].count("\n") + 1
    write(folder, difference=torques[1] - torques[0], link="force_sensor", line=line)


NO_MASS = """<inertial><mass value="0"/>
      <inertia ixx="0" iyy="0" izz="0" ixy="0" ixz="0" iyz="0"/></inertial>"""


def answer_12(folder: Path) -> None:
    text = task_12_mend_file.description().replace('izz="0.16"', 'izz="0.00016"')
    text = text.replace('<link name="adapter"/>', f'<link name="adapter">{NO_MASS}</link>')
    (folder / "answer.urdf").write_text(text)


CHECKER = """\
import sys
import xml.etree.ElementTree as ElementTree

import numpy as np

robot = ElementTree.parse(sys.argv[1]).getroot()
links = {link.get("name") for link in robot.findall("link")}
children = {joint.find("child").get("link") for joint in robot.findall("joint")}
for joint in robot.findall("joint"):
    for end in ("parent", "child"):
        assert joint.find(end).get("link") in links
for link in robot.findall("link"):
    inertial = link.find("inertial")
    assert inertial is not None or link.get("name") not in children
    if inertial is not None:
        assert float(inertial.find("mass").get("value")) >= 0
        xx, yy, zz, xy, xz, yz = (
            float(inertial.find("inertia").get(name)) for name in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
        )
        moments = np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        assert moments[0] >= 0 and moments[2] <= moments[0] + moments[1]
"""


def answer_13(folder: Path) -> None:
    (folder / "checker.py").write_text(CHECKER)
    (folder / "check.sh").write_text(f'"{sys.executable}" "$(dirname "$0")/checker.py" "$1"\n')


def answer_14(folder: Path) -> None:
    task, results = task_14_tracking_error, {}
    for name in ("pd", "computed_torque"):
        known, guess = mujoco_model(task.known())
        plant, state = mujoco_model(task.real())
        state.qpos[:], state.qvel[:], _ = task.reference(0.0)
        errors = []
        for index in range(5001):
            q, v, a = task.reference(index * 1e-3)
            error, rate = q - state.qpos, v - state.qvel
            errors.append(error)
            if name == "pd":
                state.qfrc_applied[:] = np.array([400, 200]) * error + np.array([40, 20]) * rate
            else:
                guess.qpos[:], guess.qvel[:], guess.qacc[:] = (
                    state.qpos,
                    state.qvel,
                    a + 100 * error + 20 * rate,
                )
                mujoco.mj_inverse(known, guess)
                state.qfrc_applied[:] = guess.qfrc_inverse
            mujoco.mj_step(plant, state)
        results[name] = np.sqrt(np.mean(np.square(errors), axis=0))
    write(folder, **results)


def answer_15(folder: Path) -> None:
    task, results = task_15_force_sensor, {}
    flange = ur5_pose(np.array(task.ANGLES))
    for name, scale in (("at_rest", 0.0), ("moving", 1.0)):
        v, a, dt = scale * np.array(task.VELOCITIES), scale * np.array(task.ACCELERATIONS), 1e-3
        path = [
            ur5_pose(np.array(task.ANGLES) + v * t + a * t**2 / 2) for t in (-2 * dt, -dt, 0.0, dt, 2 * dt)
        ]
        centres = [(pose @ [*task.OFFSET, 1])[:3] for pose in path]
        linear = (centres[1] - 2 * centres[2] + centres[3]) / dt**2
        force = task.MASS * (linear + np.array([0, 0, 9.81]))
        momenta = []
        for index in (1, 3):
            omega = twist(path[index - 1], path[index + 1])[3:] / (2 * dt)
            turn = path[index][:3, :3]
            momenta.append(turn @ np.diag(task.MOMENTS) @ turn.T @ omega)
        moment = (momenta[1] - momenta[0]) / (2 * dt) + np.cross(centres[2] - flange[:3, 3], force)
        results[name] = np.concatenate([flange[:3, :3].T @ force, flange[:3, :3].T @ moment])
    write(folder, **results)


def answer_16(folder: Path) -> None:
    model = pinocchio_model(task_16_four_bar.description())
    data = model.createData()
    crank, coupler, rocker = task_16_four_bar.directions(task_16_four_bar.START)
    q, v, rows, dt = np.array([crank, coupler - crank, rocker]), np.zeros(3), [], 2e-4

    def gap(q: Array) -> Array:
        a, b, c = task_16_four_bar.LENGTHS
        x = a * np.cos(q[0]) + b * np.cos(q[0] + q[1]) - task_16_four_bar.GROUND - c * np.cos(q[2])
        return np.array([x, a * np.sin(q[0]) + b * np.sin(q[0] + q[1]) - c * np.sin(q[2])])

    def slope(q: Array) -> Array:
        return np.column_stack([(gap(q + step) - gap(q - step)) / 2e-6 for step in 1e-6 * np.eye(3)])

    for index in range(2501):
        if index % 100 == 0:
            rows.append([index * dt, *q])
        jacobian, bias = slope(q), np.array(pin.nonLinearEffects(model, data, q, v))
        upper = np.triu(pin.crba(model, data, q))
        mass = upper + np.triu(upper, 1).T
        drift = (slope(q + 1e-6 * v) - jacobian) / 1e-6 @ v + 20 * jacobian @ v + 100 * gap(q)
        matrix = np.block([[mass, jacobian.T], [jacobian, np.zeros((2, 2))]])
        v = v + dt * np.linalg.solve(matrix, np.concatenate([-bias, -drift]))[:3]
        q = q + dt * v
    (folder / "answer.csv").write_text(table(task_16_four_bar.COLUMNS, np.array(rows)))


def answer_17(folder: Path) -> None:
    log = task_17_friction.log()
    q, v, a, torques = log[:, 1:3], log[:, 3:5], log[:, 5:7], log[:, 7:9]
    bare, loaded = (
        mujoco_model(two_link_arm(tip=tip))
        for tip in ('  <link name="tip"/>\n', ball("tip", 1.0, 1e-3, "1 0 0 1"))
    )
    rigid = []
    for model, data in (bare, loaded):
        for row in zip(q, v, a, strict=True):
            data.qpos[:], data.qvel[:], data.qacc[:] = row
            mujoco.mj_inverse(model, data)
            rigid.append(data.qfrc_inverse.copy())
    without, with_load = np.array(rigid).reshape(2, -1, 2)
    columns = np.zeros((len(log), 2, 5))
    for joint in range(2):
        columns[:, joint, joint] = v[:, joint]
        columns[:, joint, 2 + joint] = np.sign(v[:, joint])
    columns[..., 4] = with_load - without
    found = np.linalg.lstsq(columns.reshape(-1, 5), (torques - without).ravel())[0]
    write(folder, viscous=found[:2], coulomb=found[2:4], payload=found[4])


def answer_18(folder: Path) -> None:
    task = task_18_quadruped
    text = re.sub(r"<visual\b.*?</visual>", "", example_robot("a1.urdf").read_text(), flags=re.DOTALL)
    text = re.sub(r"<collision>(?:(?!</collision>).)*<mesh.*?</collision>", "", text, flags=re.DOTALL)
    text = re.sub(r'<link name="base">.*?</link>', "", text, flags=re.DOTALL)
    text = re.sub(r'<joint name="floating_base".*?</joint>', "", text, flags=re.DOTALL)
    client = BulletClient(connection_mode=pybullet.DIRECT)
    client.setGravity(0, 0, -9.81)
    client.setTimeStep(1e-3)
    path = folder / "robot.urdf"
    path.write_text(text)
    plane = client.createMultiBody(0, client.createCollisionShape(pybullet.GEOM_PLANE))
    client.changeDynamics(plane, -1, lateralFriction=1)
    body = client.loadURDF(str(path), [0, 0, 0.30], flags=pybullet.URDF_USE_INERTIA_FROM_FILE)
    information = [client.getJointInfo(body, joint) for joint in range(client.getNumJoints(body))]
    joints = {entry[1].decode(): entry[0] for entry in information}
    links = {entry[12].decode(): entry[0] for entry in information}
    for name, index in links.items():
        client.changeDynamics(body, index, lateralFriction=1, linearDamping=0, angularDamping=0)
        if re.search(r"<link name=\"" + name + r"\">(?:(?!</link>).)*<inertial>", text, re.DOTALL) is None:
            client.changeDynamics(body, index, mass=0, localInertiaDiagonal=[0, 0, 0])
    driven = [joints[f"{leg}_{joint}_joint"] for leg in task.LEGS for joint in task.JOINTS]
    stance = np.tile(task.STANCE, 4)
    for joint, angle in zip(driven, stance, strict=True):
        client.resetJointState(body, joint, angle)
    client.setJointMotorControlArray(body, driven, pybullet.VELOCITY_CONTROL, forces=[0] * 12)
    for _ in range(3000):
        states = client.getJointStates(body, driven)
        q, v = (np.array([state[index] for state in states]) for index in (0, 1))
        torque = task.STIFFNESS * (stance - q) - task.DAMPING * v
        client.setJointMotorControlArray(body, driven, pybullet.TORQUE_CONTROL, forces=list(torque))
        client.stepSimulation()
    forces = [
        sum(point[9] for point in client.getContactPoints(body, plane, links[f"{leg}_foot"]))
        for leg in task.LEGS
    ]
    centre, _ = client.getBasePositionAndOrientation(body)
    offset = client.getDynamicsInfo(body, -1)[3]
    client.disconnect()
    write(folder, height=centre[2] - offset[2], joint_angles=q, foot_forces=forces)


PROGRAM = """\
import math
import mujoco

model = mujoco.MjModel.from_xml_path("arm.urdf")
model.opt.timestep = 0.001
model.dof_damping[:] = 0.4
data = mujoco.MjData(model)
data.qpos[:] = [2.8, -0.4]
with open("answer.csv", "w") as file:
    print("t,shoulder,elbow", file=file)
    for step in range(2001):
        if step % 100 == 0:
            print(f"{step * 0.001:.1f},{data.qpos[0]:.6f},{data.qpos[1]:.6f}", file=file)
        data.qfrc_applied[:] = [3 * math.sin(3 * step * 0.001), -0.5]
        mujoco.mj_step(model, data)
"""


def answer_19(folder: Path) -> None:
    (folder / "program.py").write_text(PROGRAM)


def script_of_task_19() -> Array:
    """Return what PyBullet itself computes in the script that task 19 gives."""
    task = task_19_convert_script
    rows: list[str] = []
    with bullet.loaded(task.description()) as (client, body):
        script = task.SCRIPT.replace("import pybullet as p\n", "").replace("p.connect(p.DIRECT)\n", "")
        script = re.sub(r"arm = p.loadURDF\(.*\)\n", "", script)
        exec(script, {"p": client, "arm": body, "print": rows.append})
    return np.array([[float(cell) for cell in row.split(",")] for row in rows[1:]])


def answer_20(folder: Path) -> None:
    model = mujoco.MjModel.from_xml_string(without_shapes(task_20_export.description()))
    mujoco.mj_saveLastXML(str(folder / "answer.xml"), model)


# The researcher's tasks.

POLICY = """\
def act(observation):
    return -observation @ [-1.0, -28.0, -2.5, -7.5]
"""


def answer_21(folder: Path) -> None:
    (folder / "policy.py").write_text(POLICY)


def answer_22(folder: Path) -> None:
    text = cart_pole(f'  <link name="top">{NO_MASS}</link>\n')
    results: dict[str, list[list[float]]] = {"pybullet": [], "mujoco": []}
    for start in task_22_other_engine.STARTS:
        model, data = mujoco_model(cart_pole())
        data.qpos[:], data.qvel[:] = start[:2], start[2:]
        with bullet.loaded(text) as (client, body):
            client.setTimeStep(5e-4)
            client.setJointMotorControlArray(body, [0, 1], pybullet.VELOCITY_CONTROL, forces=[0, 0])
            for joint in range(2):
                client.resetJointState(body, joint, start[joint], start[2 + joint])
                client.changeDynamics(body, joint, linearDamping=0, angularDamping=0, jointDamping=0)

            def state() -> Array:
                pairs = client.getJointStates(body, [0, 1])
                return np.array([pairs[0][0], pairs[1][0], pairs[0][1], pairs[1][1]])

            for _ in range(task_22_other_engine.STEPS):
                data.qfrc_applied[0] = policies.given_policy(np.concatenate([data.qpos, data.qvel]))
                mujoco.mj_step(model, data, 20)
                force = float(policies.given_policy(state()))
                for _ in range(40):
                    client.setJointMotorControl2(body, 0, pybullet.TORQUE_CONTROL, force=force)
                    client.stepSimulation()
            results["pybullet"].append(state().tolist())
        results["mujoco"].append([*data.qpos, *data.qvel])
    write(folder, **results)


def answer_23(folder: Path) -> None:
    states, forces = task_23_vectorised.draws()
    for index in range(task_23_vectorised.STEPS):
        states = euler(states, forces[:, index])
    np.save(folder / "answer.npy", states)


def answer_24(folder: Path) -> None:
    task = task_24_reward_terms
    model, data = mujoco_model(task.description())
    data.qpos[:] = task.START
    distance = effort = close = 0.0
    for action in task.actions():
        data.qfrc_applied[:] = action
        mujoco.mj_step(model, data, 20)
        angles = {"shoulder": data.qpos[0], "elbow": data.qpos[1]}
        gap = np.linalg.norm(poses(task.description(), angles)["tip"][:3, 3] - task.TARGET)
        distance, effort, close = distance - gap, effort - 0.01 * action @ action, close + (gap < 0.15)
    write(folder, distance=float(distance), effort=float(effort), close=int(close))


def answer_25(folder: Path) -> None:
    masses = np.random.default_rng(1).uniform(0.1, 2.0, 2000)
    states = np.tile(task_25_random_masses.START, (2000, 1))
    alive = np.ones(2000, dtype=bool)
    for _ in range(250):
        states[alive] = euler(states[alive], policies.given_policy(states[alive]), masses[alive])
        alive &= np.abs(states[:, 1]) < task_25_random_masses.ANGLE
    write(folder, survival=alive.mean(), heaviest=masses[alive].max())


def answer_26(folder: Path) -> None:
    task = task_26_film
    state, frames = np.array(task.START), []
    with bullet.loaded(task.description()) as (client, body):
        for _ in range(task.FRAMES):
            for joint in range(2):
                client.resetJointState(body, joint, state[joint])
            frames.append(
                bullet_camera(
                    client, np.array(task.EYE), np.array(task.TARGET), task.FIELD, task.WIDTH, task.HEIGHT
                )
            )
            for _ in range(2):
                state = euler(state, policies.given_policy(state))
    imageio.imwrite(folder / "answer.mp4", np.array(frames), fps=25)


def answer_27(folder: Path) -> None:
    task = task_27_first_cause
    apart = np.abs(task.rollout(task.SHOULDER, task.ELBOW) - task.rollout(task.SHOULDER, 0.0))[:, 1:3] > 0.01
    model, data = mujoco_model(task.description())
    model.dof_damping[:] = [0, task.ELBOW]
    data.qpos[:], data.qfrc_applied[:] = task.START, task.TORQUES
    mujoco.mj_step(model, data, 1500)
    time = 0.01 * int(np.argmax(apart.any(axis=1)))
    write(folder, time=time, cause=task.CAUSE, final=np.concatenate([data.qpos, data.qvel]))


ENVIRONMENT = """\
from pathlib import Path

import gymnasium
import mujoco
import numpy as np


class Arm(gymnasium.Env):
    action_space = gymnasium.spaces.Box(-1, 1, (2,), np.float32)
    observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (8,), np.float64)

    def __init__(self):
        self.model = mujoco.MjModel.from_xml_path(str(Path(__file__).with_name("arm.urdf")))
        self.model.opt.timestep = 0.001
        self.model.opt.disableflags = mujoco.mjtDisableBit.mjDSBL_CONTACT
        self.data = mujoco.MjData(self.model)

    def observation(self):
        q = self.data.qpos
        return np.concatenate([np.cos(q), np.sin(q), self.data.qvel, self.target])

    def reset(self, seed=None, options=None):
        super().reset(seed=seed)
        mujoco.mj_resetData(self.model, self.data)
        self.data.qpos[:] = self.np_random.uniform(-0.5, 0.5, 2)
        self.target = self.np_random.uniform([0.2, -0.2], [0.5, 0.4])
        self.count = 0
        return self.observation(), {}

    def step(self, action):
        self.data.qfrc_applied[:] = np.array([10, 3]) * action
        mujoco.mj_step(self.model, self.data, 20)
        self.count += 1
        q = self.data.qpos
        tip = 0.4 * np.array([np.sin(q[0]), np.cos(q[0])])
        tip += 0.3 * np.array([np.sin(q.sum()), np.cos(q.sum())])
        reward = -np.linalg.norm(tip - self.target) - 0.01 * float(action @ action)
        return self.observation(), float(reward), False, self.count == 100, {}


def make_env():
    return Arm()
"""


def answer_28(folder: Path) -> None:
    (folder / "env.py").write_text(ENVIRONMENT)
    (folder / "arm.urdf").write_text(task_28_environment.description())


def answer_29(folder: Path) -> None:
    peaks = []
    for delay in task_29_latency.DELAYS:
        state, waiting, peak = np.array(task_29_latency.START), [0.0] * delay, 0.0
        for _ in range(250):
            waiting.append(float(policies.given_policy(state)))
            state = euler(state, np.array(waiting.pop(0)))
            peak = max(peak, abs(float(state[1])))
            if peak > 3:
                break
        peaks.append(peak)
    largest = next(index for index, peak in enumerate(peaks) if peak > task_29_latency.ANGLE) - 1
    write(folder, largest_delay_ms=20 * largest, peak_angles=[peaks[2], peaks[4], peaks[6]])


def answer_30(folder: Path) -> None:
    task = task_30_data_set
    random = np.random.default_rng(5)
    state = random.uniform(-0.2, 0.2, (task.EPISODES, 4))
    data: dict[str, list[Array]] = {name: [] for name in task.NAMES}
    for _ in range(task.STEPS):
        force = np.clip(policies.given_policy(state) + random.normal(size=task.EPISODES), -10, 10)
        after = euler(state, force)
        reward = 1 - after[:, 1] ** 2 - 0.001 * force**2
        for name, value in zip(task.NAMES, (state, force, reward, after), strict=True):
            data[name].append(value)
        state = after
    np.savez(folder / "answer.npz", **{name: np.stack(rows, axis=1) for name, rows in data.items()})  # type: ignore[arg-type]


ANSWERS: dict[int, Answer] = {
    number: globals()[f"answer_{number:02}"] for number in range(1, 31) if f"answer_{number:02}" in globals()
}
