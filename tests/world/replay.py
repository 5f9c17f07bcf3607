"""Replay of a world's torques in MuJoCo alone, which reads the exported document from a file."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from dynx.spatial.scalar import Floats
from dynx.spatial.so3 import rotation_from_quat
from dynx.world import Scene, World

STEPS_OF_TORQUE = 20
"""Steps in which the random torques of a world stay the same."""


def record_forces(world: World, steps: int, rng: np.random.Generator) -> Floats:
    """Step a world with random torques of joints, or by the motors of its scene.

    Returns the generalised forces (steps, nv) that act in MuJoCo in each step: torques, those of motors and
    those that couple mimic joints.
    """
    driven = [robot for robot in world.scene.robots if not robot.motors]
    forces = []
    for k in range(steps):
        if k % STEPS_OF_TORQUE == 0:
            torques = {robot.name: rng.normal(size=robot.model.nv) for robot in driven}
            for robot in driven:
                torques[robot.name][: 6 * robot.model.floating] = 0.0
        world.step(torques=torques)
        forces.append(_engine(world).data.qfrc_applied.copy())
    return np.array(forces)


def _engine(world: World) -> Any:
    return world._motion.engine


def replay(path: Path, scene: Scene, forces: Floats) -> Any:
    """Return MuJoCo's data after steps from the start of a document under recorded forces (steps, nv).

    Motors of the document apply those of robots without mimic joints.
    """
    import mujoco

    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    if model.nkey:
        mujoco.mj_resetDataKeyframe(model, data, model.key("start").id)
    dofs = model.jnt_dofadr[model.actuator_trnid[:, 0]]
    coupled = np.zeros(model.nv, dtype=bool)
    for robot in scene.robots:
        if robot.model.mechanism.coupling is not None:
            coupled |= model.body_rootid[model.dof_bodyid] == model.body(robot.name).rootid
    for row in forces:
        data.ctrl[:] = np.where(coupled[dofs], 0.0, row[dofs])
        data.qfrc_applied[:] = np.where(coupled, row, 0.0)
        mujoco.mj_step(model, data)
    return data


def distance(world: World, data: Any) -> float:
    """Return the largest difference between the states of a world and of MuJoCo, by the names of the
    document: poses [m, 1] and twists [m/s, rad/s] of floating bases and bodies, positions and velocities of
    joints."""
    import mujoco

    for compute in (mujoco.mj_kinematics, mujoco.mj_comPos, mujoco.mj_comVel):
        compute(data.model, data)
    state = world.state
    found = [0.0]
    for robot in world.scene.robots:
        q, v = state.robots[robot.name]
        names = robot.model.joint_names
        joints = [data.joint(f"{robot.name}/{name}") for name in names]
        found += [abs(joint.qpos[0] - at) for joint, at in zip(joints, q[len(q) - len(names) :], strict=True)]
        found += [abs(joint.qvel[0] - at) for joint, at in zip(joints, v[len(v) - len(names) :], strict=True)]
        if robot.model.floating:
            T = np.eye(4)
            T[:3, :3], T[:3, 3] = rotation_from_quat(q[3:7]), q[:3]
            root = f"{robot.name}/{robot.model.root}"
            found.append(_distance_of_body(data, root, T, np.kron(np.eye(2), T[:3, :3]) @ v[:6]))
    for body in world.scene.bodies:
        found.append(_distance_of_body(data, body.name, *state.bodies[body.name]))
    return float(max(found))


def _distance_of_body(data: Any, name: str, T: Floats, twist: Floats) -> float:
    """Return the largest difference of the pose (4, 4) and the twist (6,) in world axes of a body."""
    import mujoco

    body, found = data.body(name), np.zeros(6)
    kind = mujoco.mjtObj.mjOBJ_XBODY
    mujoco.mj_objectVelocity(data.model, data, kind, body.id, found, 0)
    differences = (
        body.xpos - T[:3, 3],
        body.xmat.reshape(3, 3) - T[:3, :3],
        found[3:] - twist[:3],
        found[:3] - twist[3:],
    )
    return float(max(abs(each).max() for each in differences))


def differing_fields(a: Any, b: Any) -> list[str]:
    """Return the names of the arrays and numbers of two of MuJoCo's models that are not equal bit for bit."""
    return [
        name
        for x, y in ((a, b), (a.opt, b.opt), (a.vis.global_, b.vis.global_), (a.stat, b.stat))
        for name in dir(x)
        if not name.startswith("_")
        and isinstance(getattr(x, name), np.ndarray | int | float | bytes)
        and np.asarray(getattr(x, name)).tobytes() != np.asarray(getattr(y, name)).tobytes()
    ]


def examine(scene: Scene, path: Path, steps: int, seed: int, **options: Any) -> tuple[float, list[str]]:
    """Write a world to a file; return the distance after a replay of its forces, and the fields of MuJoCo's
    model of the file that are not those of the world's.

    Scenes whose document names dry friction that the world computes outside of MuJoCo have none here.
    """
    import mujoco

    with World(scene, "mujoco", **options) as world:
        if "computes it outside of MuJoCo" in world.to_mjcf():
            options["joint_friction"] = False
    with World(scene, "mujoco", **options) as world:
        path.write_text(world.to_mjcf(), encoding="utf-8")
        model = mujoco.MjModel.from_xml_path(str(path))
        forces = record_forces(world, steps, np.random.default_rng(seed))
        return distance(world, replay(path, scene, forces)), differing_fields(_engine(world).model, model)
