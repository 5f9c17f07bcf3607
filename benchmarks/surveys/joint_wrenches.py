"""Joint wrenches against what dynx does not compute: ``python -m benchmarks.surveys.joint_wrenches``.

Every robot moves at random, with a fixed and with a floating base, under two external wrenches. The wrenches
of all its joints by each backend are compared with

- the sub-tree beyond each joint loaded alone, as a robot with a floating base, in Pinocchio's `rnea`;
- MuJoCo's force and torque sensors at the origins of the links, after `mj_inverse`;
- Drake's reaction forces of all joints, at the acceleration that Drake finds for the torques;
- Bullet's joint sensors after a short step from rest without external forces, at the acceleration of that
  step. (In motion they leave out terms of the velocity: 0.2 N of 30 N on a robot of seven links at 2 rad/s.)

The engines' models are built here from links and joints, one body for each link. An error is divided by the
largest force or moment of the robot. Exits with 1 if one exceeds its bar.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from importlib import import_module
from typing import Any

import numpy as np

from dynx.backends import Backend, backend, installed_backends
from dynx.model import Inertial, Joint, Model, Pose
from dynx.model.loading import load
from dynx.spatial.scalar import Floats
from dynx.spatial.se3 import homogeneous
from dynx.spatial.so3 import quat_from_rotation, rotation_from_quat, rotation_from_rpy

BAR = 1e-10
"""Largest error relative to the largest force or moment."""

BULLET_BAR = 1e-7
"""The same for Bullet's sensors: its acceleration is a difference of velocities over `BULLET_STEP`."""

BULLET_STEP = 1e-7
"""Length of a step of Bullet [s]."""

MAX_BULLET_JOINTS = 128
"""Largest number of joints of `createMultiBody`."""

# fmt: off
ROBOTS = (
    "a1", "alexander", "allegro_right_hand", "anymal_c", "anymal_kinova", "b1_z1", "baxter", "bolt",
    "borinot", "double_pendulum", "finger_edu", "g1", "g1_with_hands", "go2", "hyq", "icub_reduced",
    "kinova", "laikago", "panda", "pr2", "romeo_small", "simple_humanoid", "so101", "solo12", "talos",
    "tiago_dual", "tiago_pro", "ur5_gripper", "xarm7", "z1",
)
# fmt: on


@dataclass(frozen=True)
class Moving:
    """A robot in motion, and wrenches (6,) that act on frames of links, in axes of the world."""

    model: Model
    q: Floats
    v: Floats
    a: Floats
    forces: dict[str, Floats]

    @classmethod
    def draw(cls, model: Model, seed: int) -> Moving:
        """Return a random motion, with wrenches on the last link and on one in the middle."""
        rng = np.random.default_rng(seed)
        links = [link.name for link in model.links]
        forces = {links[-1]: rng.uniform(-20.0, 20.0, 6), links[len(links) // 2]: rng.uniform(-20.0, 20.0, 6)}
        v, a = rng.uniform(-2.0, 2.0, (2, model.nv))
        return cls(model, model.random(rng), v, a, forces)

    def wrenches(self, engine: Backend) -> Floats:
        """Return the wrenches (n_joints, 6) of all joints by a backend."""
        return engine.joint_wrenches(self.q, self.v, self.a, external_forces=self.forces)

    @property
    def tree(self) -> tuple[Floats, Floats, Floats]:
        """q, v and a with one coordinate for every moving joint."""
        coupling = self.model.mechanism.coupling
        if coupling is None:
            return self.q, self.v, self.a
        S = coupling.matrix()
        return coupling.expand_q(self.q), S @ self.v, S @ self.a


def without_mimics(model: Model) -> Model:
    """Return the model in which every moving joint has a coordinate of its own."""
    joints = [replace(joint, mimic=None) for joint in model.joints]
    return Model.build(model.name, model.links, joints, base=model.base, gravity=model.gravity)


def subtrees_alone(case: Moving) -> Floats:
    """Return what the sub-tree beyond each joint needs to move as it does, by Pinocchio."""
    model = without_mimics(case.model)
    q, v, a = case.tree
    engine, found = backend("reference", model), []
    base = 6 if model.floating else 0
    for joint in model.joints:
        links, joints = [joint.child], list[Joint]()
        for each in model.joints:
            if each.parent in links:
                joints.append(each)
                links.append(each.child)
        bodies = [model.link(name) for name in links]
        part = Model.build("part", bodies, joints, base="floating", gravity=model.gravity)
        columns = [model.coordinate_index(name) - base for name in part.joint_names]
        T = engine.forward_kinematics(q, joint.child)
        pose = [*T[:3, 3], *quat_from_rotation(T[:3, :3])]
        twist = engine.frame_velocity(q, v, joint.child, reference="local")
        rate = engine.frame_acceleration(q, v, a, joint.child, reference="local")
        state = [
            np.concatenate([first, rest[len(rest) - model.nv + base :][columns]])
            for first, rest in ((pose, q), (twist, v), (rate, a))
        ]
        forces = {frame: wrench for frame, wrench in case.forces.items() if frame in links}
        with backend("pinocchio", part) as alone:
            found.append(alone.inverse_dynamics(*state, external_forces=forces)[:6])
    return np.array(found)


def principal(inertial: Inertial) -> tuple[Floats, Floats, Floats]:
    """Return the centre of mass, the rotation to the principal axes, and the principal moments."""
    moments, axes = np.linalg.eigh(inertial.tensor)
    axes = axes * np.linalg.det(axes)
    R = np.asarray(rotation_from_rpy(np.array(inertial.origin.rpy)), dtype=float)
    return np.array(inertial.origin.xyz), R @ axes, moments


def _wxyz(R: Floats) -> Floats:
    x, y, z, w = quat_from_rotation(R)
    return np.array([w, x, y, z])


def _rotation(pose: Pose) -> Floats:
    return np.asarray(rotation_from_rpy(np.array(pose.rpy)), dtype=float)


class MujocoRobot:
    """A robot in MuJoCo alone, built from its links and joints, with sensors at sites of its links."""

    def __init__(self, model: Model, sites: Mapping[str, tuple[str, Pose]], kinds: Sequence[str]) -> None:
        """`sites` are links and poses in them by names; each has sensors of all `kinds`, such as ``force``,
        in this order."""
        import mujoco

        self._model = model
        spec = mujoco.MjSpec()
        spec.compiler.degree, spec.compiler.fusestatic = False, False
        spec.compiler.inertiafromgeom = mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_FALSE
        spec.option.gravity = np.array(model.gravity)
        spec.option.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)

        # A link may have a name that MuJoCo keeps for itself.
        names = {link.name: str(k) for k, link in enumerate(model.links)}

        def add(parent: Any, link: str, origin: Pose) -> Any:
            body = parent.add_body(name=names[link], pos=np.array(origin.xyz), quat=_wxyz(_rotation(origin)))
            body.explicitinertial, body.mass, body.inertia = True, 1.0, np.ones(3)
            # In other axes than the frame's: else the compiler would take the body's frame for the inertia's.
            body.ipos, body.iquat = np.array([0.1, 0.2, 0.3]), np.array([0.5, 0.5, 0.5, 0.5])
            return body

        bodies = {model.root: add(spec.worldbody, model.root, model.base_pose)}
        if model.floating:
            bodies[model.root].add_freejoint(align=False)
        for joint in model.joints:
            bodies[joint.child] = body = add(bodies[joint.parent], joint.child, joint.origin)
            if joint.moves:
                types = mujoco.mjtJoint
                kind = types.mjJNT_SLIDE if joint.type == "prismatic" else types.mjJNT_HINGE
                body.add_joint(type=kind, axis=np.array(joint.axis))
        for number, (part, pose) in enumerate(sites.values()):
            at = {"pos": np.array(pose.xyz), "quat": _wxyz(_rotation(pose))}
            bodies[part].add_site(name=f"{number}", **at)
            for each in kinds:
                what = getattr(mujoco.mjtSensor, f"mjSENS_{each.upper()}")
                spec.add_sensor(type=what, objtype=mujoco.mjtObj.mjOBJ_SITE, objname=f"{number}")
        compiled = spec.compile()
        self._numbers = {link.name: compiled.body(names[link.name]).id for link in model.links}
        for link in model.links:
            k, inertial = self._numbers[link.name], link.inertial or Inertial()
            center, R, moments = principal(inertial)
            compiled.body_mass[k], compiled.body_inertia[k] = inertial.mass, moments
            compiled.body_ipos[k], compiled.body_iquat[k] = center, _wxyz(R)
        compiled.body_sameframe[:] = mujoco.mjtSameFrame.mjSAMEFRAME_NONE
        compiled.body_subtreemass[:] = compiled.body_mass
        for k in reversed(range(1, compiled.nbody)):
            compiled.body_subtreemass[compiled.body_parentid[k]] += compiled.body_subtreemass[k]
        self._compiled, self._data = compiled, mujoco.MjData(compiled)

    def readings(self, q: Floats, v: Floats, a: Floats, forces: Mapping[str, Floats]) -> Floats:
        """Return what the sensors read in a state with one coordinate for every moving joint.

        `forces` are wrenches (6,) on links, at their origins in the axes of the world.
        """
        import mujoco

        model, data, numbers = self._model, self._data, self._numbers
        q, v, a = (array.copy() for array in (q, v, a))
        if model.floating:
            q[3:7] = q[[6, 3, 4, 5]]
        data.qpos[:] = q
        mujoco.mj_fwdPosition(self._compiled, data)
        if model.floating:
            R = data.xmat[numbers[model.root]].reshape(3, 3)
            a[:3] = R @ (a[:3] + np.cross(v[3:6], v[:3]))
            v[:3] = R @ v[:3]
        data.qvel[:], data.qacc[:] = v, a
        data.xfrc_applied[:] = 0.0
        for name, wrench in forces.items():
            k = numbers[name]
            lever = data.xipos[k] - data.xpos[k]
            data.xfrc_applied[k] += [*wrench[:3], *(wrench[3:] - np.cross(lever, wrench[:3]))]
        mujoco.mj_inverse(self._compiled, data)
        return np.array(data.sensordata)


def mujoco_sensors(case: Moving) -> Floats:
    """Return what MuJoCo's sensors read at the origin of the child of every joint."""
    sites = {joint.name: (joint.child, Pose()) for joint in case.model.joints}
    robot = MujocoRobot(case.model, sites, ("force", "torque"))
    return robot.readings(*case.tree, case.forces).reshape(len(sites), 6)


def drake_reactions(case: Moving) -> tuple[Moving, Floats]:
    """Return Drake's reaction forces at the frames of the children of all joints, under the torques that a
    case needs, and the case with the acceleration that Drake finds for them."""
    spatial: Any = import_module("pydrake.math")
    multibody: Any = import_module("pydrake.multibody.tree")
    plants: Any = import_module("pydrake.multibody.plant")
    algebra: Any = import_module("pydrake.multibody.math")

    def transform(pose: Pose) -> Any:
        return spatial.RigidTransform(spatial.RotationMatrix(_rotation(pose)), np.array(pose.xyz))

    model = without_mimics(case.model)
    plant = plants.MultibodyPlant(0.0)
    plant.mutable_gravity_field().set_gravity_vector(np.array(model.gravity))
    bodies = {}
    for number, link in enumerate(model.links):
        inertial = link.inertial or Inertial()
        R, c = _rotation(inertial.origin), np.array(inertial.origin.xyz)
        mass = inertial.mass
        about_origin = R @ inertial.tensor @ R.T + mass * ((c @ c) * np.eye(3) - np.outer(c, c))
        G = about_origin / (mass or 1.0)
        unit = multibody.UnitInertia(G[0, 0], G[1, 1], G[2, 2], G[0, 1], G[0, 2], G[1, 2])
        inertia = multibody.SpatialInertia(mass, c, unit, skip_validity_check=True)
        bodies[link.name] = plant.AddRigidBody(f"{number}", inertia)
    root = bodies[model.root]
    if not model.floating:
        plant.WeldFrames(plant.world_frame(), root.body_frame(), transform(model.base_pose))
    joints, moving = [], []
    for number, joint in enumerate(model.joints):
        parent, child = bodies[joint.parent].body_frame(), bodies[joint.child].body_frame()
        if joint.moves:
            at = plant.AddFrame(multibody.FixedOffsetFrame(f"f{number}", parent, transform(joint.origin)))
            kind = multibody.PrismaticJoint if joint.type == "prismatic" else multibody.RevoluteJoint
            joints.append(plant.AddJoint(kind(f"j{number}", at, child, np.array(joint.axis))))
            moving.append(joints[-1])
        else:
            weld = multibody.WeldJoint(f"j{number}", parent, child, transform(joint.origin))
            joints.append(plant.AddJoint(weld))
    plant.Finalize()
    context = plant.CreateDefaultContext()
    q, v, a = case.tree
    positions, velocities = np.zeros(plant.num_positions()), np.zeros(plant.num_velocities())
    # Columns of Drake's velocity, and the map from axes of the base to those of the world.
    columns, turn = [each.velocity_start() for each in moving], np.eye(model.nv)
    positions[[each.position_start() for each in moving]] = q[len(q) - len(moving) :]
    engine = backend("reference", model)
    tau = engine.inverse_dynamics(q, v, a, external_forces=case.forces)
    spin = np.zeros(model.nv)
    if model.floating:
        start, first = root.floating_positions_start(), root.floating_velocities_start_in_v()
        positions[start : start + 7] = q[[6, 3, 4, 5, 0, 1, 2]]
        columns = [*range(first + 3, first + 6), *range(first, first + 3), *columns]
        turn[:3, :3] = turn[3:6, 3:6] = engine.forward_kinematics(q, model.root)[:3, :3]
        spin[:3] = np.cross(v[3:6], v[:3])
    velocities[columns] = turn @ v
    plant.SetPositions(context, positions)
    plant.SetVelocities(context, velocities)
    torque = np.zeros(plant.num_velocities())
    torque[columns] = turn @ tau
    plant.get_applied_generalized_force_input_port().FixValue(context, torque)
    applied = []
    for name, wrench in case.forces.items():
        force = plants.ExternallyAppliedSpatialForce()
        force.body_index, force.p_BoBq_B = bodies[name].index(), np.zeros(3)
        force.F_Bq_W = algebra.SpatialForce(wrench[3:], wrench[:3])
        applied.append(force)
    plant.get_applied_spatial_force_input_port().FixValue(context, applied)
    reactions = plant.get_reaction_forces_output_port().Eval(context)
    readings = [reactions[int(each.index())].get_coeffs() for each in joints]
    vdot = plant.get_generalized_acceleration_output_port().Eval(context)
    moved = Moving(model, q, v, turn.T @ vdot[columns] - spin, case.forces)
    return moved, np.array([[*each[3:], *each[:3]] for each in readings])


def bullet_sensors(case: Moving) -> tuple[Moving, Floats]:
    """Return the robot of a case at rest, without external forces, with the acceleration that Bullet finds
    for the torques that the case's needs there; and what Bullet's joint sensors read in that step."""
    pybullet: Any = import_module("pybullet")
    model = case.model
    p = import_module("pybullet_utils.bullet_client").BulletClient(connection_mode=pybullet.DIRECT)
    inertials = {link.name: principal(link.inertial or Inertial()) for link in model.links}
    numbers = {joint.child: k for k, joint in enumerate(model.joints)}
    kinds = {True: pybullet.JOINT_PRISMATIC, False: pybullet.JOINT_REVOLUTE}
    at_rest = without_mimics(model)
    engine = backend("reference", at_rest)
    q, _, a = case.tree
    tau = engine.inverse_dynamics(q, 0.0 * a, a)
    T = model.base_pose.matrix
    if model.floating:
        T = homogeneous(rotation_from_quat(q[3:7]), q[:3])
    center, R, _ = inertials[model.root]
    body = p.createMultiBody(
        baseMass=model.inertial(model.root).mass if model.floating else 0.0,
        baseInertialFramePosition=center,
        baseInertialFrameOrientation=quat_from_rotation(R),
        basePosition=T[:3, 3],
        baseOrientation=quat_from_rotation(T[:3, :3]),
        linkMasses=[model.inertial(joint.child).mass for joint in model.joints],
        linkCollisionShapeIndices=[-1] * len(numbers),
        linkVisualShapeIndices=[-1] * len(numbers),
        linkPositions=[joint.origin.xyz for joint in model.joints],
        linkOrientations=[quat_from_rotation(_rotation(joint.origin)) for joint in model.joints],
        linkInertialFramePositions=[inertials[joint.child][0] for joint in model.joints],
        linkInertialFrameOrientations=[
            quat_from_rotation(inertials[joint.child][1]) for joint in model.joints
        ],
        linkParentIndices=[numbers.get(joint.parent, -1) + 1 for joint in model.joints],
        linkJointTypes=[
            kinds[joint.type == "prismatic"] if joint.moves else pybullet.JOINT_FIXED
            for joint in model.joints
        ],
        linkJointAxis=[joint.axis for joint in model.joints],
    )
    p.setGravity(*model.gravity)
    p.setPhysicsEngineParameter(fixedTimeStep=BULLET_STEP, numSubSteps=1, jointFeedbackMode=0)
    names = [model.root, *numbers]
    for k, name in enumerate(names, -1):
        p.changeDynamics(
            body,
            k,
            localInertiaDiagonal=inertials[name][2],
            linearDamping=0,
            angularDamping=0,
            jointDamping=0,
        )
    first = 7 if model.floating else 0
    moving = [k for k, joint in enumerate(model.joints) if joint.moves]
    base = 6 if model.floating else 0
    for k, x, effort in zip(moving, q[first:], tau[base:], strict=True):
        p.resetJointState(body, k, float(x), 0.0)
        p.setJointMotorControl2(body, k, p.VELOCITY_CONTROL, force=0)
        p.setJointMotorControl2(body, k, p.TORQUE_CONTROL, force=float(effort))
    for k in numbers.values():
        p.enableJointForceTorqueSensor(body, k, True)
    p.stepSimulation()
    a = np.zeros(at_rest.nv)
    a[base:] = [p.getJointState(body, k)[1] / BULLET_STEP for k in moving]
    if model.floating:
        linear, angular = (np.array(rate) / BULLET_STEP for rate in p.getBaseVelocity(body))
        # Of the centre of mass of the root, in axes of the world.
        a[3:6] = T[:3, :3].T @ angular
        a[:3] = T[:3, :3].T @ linear - np.cross(a[3:6], center)
    found = []
    for joint in model.joints:
        reading = np.array(p.getJointState(body, numbers[joint.child])[2])
        center, R, _ = inertials[joint.child]
        # Bullet's link frame: the centre of mass and the principal axes.
        force = R @ reading[:3]
        found.append(np.concatenate([force, R @ reading[3:] + np.cross(center, force)]))
    p.disconnect()
    return Moving(at_rest, q, np.zeros(at_rest.nv), a, {}), np.array(found)


def error(found: Floats, wanted: Floats) -> float:
    """Return the largest error of forces and of moments, each relative to the robot's largest one."""
    largest = np.abs(wanted).reshape(-1, 2, 3).max(axis=(0, 2))
    errors = np.abs(found - wanted).reshape(-1, 2, 3).max(axis=(0, 2))
    return float((errors / largest).max())


def errors(case: Moving, backends: Sequence[str]) -> dict[str, float]:
    """Return the error of every comparison that an engine can make, by name."""
    wanted = subtrees_alone(case)
    found = {name: error(_by_backend(case, name), wanted) for name in backends}
    reference = _by_backend(case, "reference")
    found["sensors of MuJoCo"] = error(reference, mujoco_sensors(case))
    joints, links = case.model.joints, case.model.links
    unmoved = [each.name for each in joints if each.moves and not moved_mass(case.model, each.child)]
    if unmoved:
        print(f"{case.model.name}: Drake and Bullet do not move {unmoved[0]}, beyond which nothing has mass")
        return found
    # These engines find the acceleration themselves, which may differ where it is ill-determined.
    measures = {"reactions of Drake": drake_reactions, "sensors of Bullet": bullet_sensors}
    inertials = {each.name: each.inertial for each in links if each.inertial is not None}
    rotors = [name for name, each in inertials.items() if not each.mass and each.tensor.any()]
    if rotors:
        print(f"{case.model.name}: Drake does not represent {rotors[0]}, which has inertia without mass")
        del measures["reactions of Drake"]
    if len(joints) > MAX_BULLET_JOINTS:
        print(f"{case.model.name}: Bullet creates robots of at most {MAX_BULLET_JOINTS} joints")
        del measures["sensors of Bullet"]
    for name, measure in measures.items():
        moved, readings = measure(case)
        found[name] = error(_by_backend(moved, "reference"), readings)
    return found


def _by_backend(case: Moving, name: str) -> Floats:
    with backend(name, case.model) as engine:
        return case.wrenches(engine)


def moved_mass(model: Model, link: str) -> float:
    """Return the mass of a link and of all links beyond it."""
    beyond = (moved_mass(model, joint.child) for joint in model.joints if joint.parent == link)
    return model.inertial(link).mass + sum(beyond)


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("robots", nargs="*", default=ROBOTS, help="names of robots; default: 30")
    chosen = parser.parse_args(arguments)
    worst: dict[str, tuple[float, str]] = {}
    for number, name in enumerate(chosen.robots):
        for base in ("fixed", "floating"):
            found = errors(Moving.draw(load(name, base=base), number), installed_backends())
            print(f"{name:20}{base:10}", "  ".join(f"{way} {size:.1e}" for way, size in found.items()))
            for way, size in found.items():
                worst[way] = max(worst.get(way, (0.0, "")), (size, f"{name}, {base} base"))
    print(f"{len(chosen.robots)} robots, both bases: largest error relative to the largest force or moment")
    for way, (size, where) in worst.items():
        print(f"{way:24}{size:10.1e}  {where}")
    bars = {"sensors of Bullet": BULLET_BAR}
    return int(any(size > bars.get(way, BAR) for way, (size, _) in worst.items()))


if __name__ == "__main__":
    sys.exit(main())
