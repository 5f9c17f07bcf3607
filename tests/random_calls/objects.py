"""Objects with public methods, and arguments that a call can use, by name and by annotation."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable, Mapping
from functools import cache, partial
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

import dynx
from dynx import (
    agreement,
    backends,
    bench,
    contacts,
    control,
    distance,
    envs,
    ik,
    loaded,
    rules,
    trajectory,
    world,
)
from dynx.envs.tasks.reach import Reach
from dynx.model import geometry
from dynx.rules.registry import trap_case

MODELS = Path(__file__).parents[2] / "models"

arm = cache(lambda: dynx.load(MODELS / "planar_3r.urdf"))
six_axis_arm = cache(lambda: dynx.load(MODELS / "six_axis_arm.urdf"))
floating = cache(lambda: dynx.load(MODELS / "double_pendulum.urdf", base="floating"))


def tip() -> str:
    """Return the last frame of the arm."""
    return arm().frame_names[-1]


@cache
def engine(name: str = "reference") -> dynx.Backend:
    """Return a backend of the arm."""
    return dynx.backend(name, arm())


@cache
def scene() -> dynx.Scene:
    """Return the arm above the ground, with a box and a ball."""
    return dynx.Scene(
        robots=(world.SceneRobot("arm", arm()),),
        bodies=(
            world.ground(pose=dynx.Pose((0.0, 0.0, -3.0))),
            world.box("box", (0.1, 0.1, 0.1), pose=dynx.Pose((0.0, 2.0, -2.9)), mass=1.0),
            world.sphere("ball", 0.1, pose=dynx.Pose((0.0, -2.0, -2.9)), mass=1.0),
        ),
    )


@cache
def motion() -> trajectory.Trajectory:
    """Return a motion of the arm."""
    return trajectory.quintic(np.zeros(3), np.full(3, 0.1), 0.05, model=arm())


@cache
def pd() -> Any:
    """Return a PD controller of the arm."""
    return control.PD(arm(), kp=10.0, kd=1.0)


@cache
def scenario() -> dynx.Scenario:
    """Return a short simulation of the arm."""
    return dynx.Scenario(arm(), pd(), motion(), plant="reference", duration=0.02, control_dt=0.005)


rollout = cache(lambda: dynx.simulate(scenario()))
batch = cache(
    lambda: dynx.simulate_batch(arm(), pd(), motion(), duration=0.02, control_dt=0.005, q0=np.zeros((3, 3)))
)


@cache
def surroundings() -> Any:
    """Return what was around the robot in a short simulation of a scene."""
    plant = dynx.ScenePlant(scene(), engine="mujoco")
    return dynx.simulate(arm(), pd(), motion(), plant=plant, duration=0.02, control_dt=0.005).surroundings


def open_world(engine: str = "mujoco") -> dynx.World:
    """Return a new world of `scene`."""
    return dynx.World(scene(), engine=engine)


def viewer() -> Any:
    """Return an open page of the arm, which no browser shows."""
    if not _viewers or _viewers[-1].page.closed:
        os.environ["BROWSER"] = "true"
        _viewers.append(arm().view())
    return _viewers[-1]


_viewers: list[Any] = []


@cache
def session() -> Any:
    """Return a session of benchmarks of the arm."""
    return bench.Session(bench.Plan(arm(), tip(), bench.benchmark_cases(["mass_matrix"], [1], [1])))


def line_target() -> Any:
    """Return a pose of the tip near the start of a line."""
    T = engine().forward_kinematics(np.full(3, 0.3), tip())
    T[0, 3] -= 1e-3
    return T


def recorded() -> Any:
    """Return the record of a short run of a world."""
    return rollout().record()


def environment() -> Any:
    """Return an environment after its reset."""
    from dynx.envs import make_environment

    made = make_environment("dynx.envs.tasks.pendulum:Pendulum", engine="reference")
    made.reset(seed=0)
    return made


@cache
def conformance() -> Any:
    """Return what one engine does in one case of contact."""
    return contacts.conform(["mujoco"], cases=contacts.case_names()[:1], steps=(1e-3,))


def closed_solutions() -> Any:
    """Return the solutions of a closed form."""
    robot = six_axis_arm()
    form = ik.closed_form(robot, robot.frame_names[-1])
    target = dynx.backend("reference", robot).forward_kinematics(np.full(6, 0.3), robot.frame_names[-1])
    return form.solve(target)


SENSORS: Mapping[str, Callable[[], Any]] = {
    "IMU": lambda: world.Imu("imu", tip()),
    "force-torque": lambda: world.ForceTorqueSensor("wrist", arm().joint_names[-1]),
    "joint torque": lambda: world.JointTorqueSensor("torque", arm().joint_names[0]),
    "encoder": lambda: world.Encoder("angle", arm().joint_names[0]),
    "contact": lambda: world.ContactSensor("touch", "box"),
    "ray": lambda: world.RaySensor("eye", "box"),
}
"""Makers of sensors."""

TRAINING = find_spec("torch") is not None and find_spec("stable_baselines3") is not None
"""True where policies can be trained."""


def small_run() -> Any:
    """Return a training of a moment."""
    from tests.training.runs import small_run as run

    return run(32)


@cache
def policy() -> Any:
    """Return a policy, hardly trained."""
    from dynx.training import Schedule, load_policy, train

    folder = tempfile.mkdtemp()
    train(small_run(), folder, schedule=Schedule(episodes=1), final_episodes=1)
    return load_policy(Path(folder) / "final.zip")


def training_objects() -> Mapping[str, Callable[[], Any]]:
    """Return makers of the objects of `dynx.training`."""
    from dynx import training

    return {
        "policy": policy,
        "schedule": training.Schedule,
        "task of a training": lambda: training.TaskSpec("CartPole-v1"),
        "training": small_run,
    }


OBJECTS: Mapping[str, Callable[[], Any]] = {
    "model": arm,
    "floating model": floating,
    "pose": lambda: dynx.Pose((0.1, 0.2, 0.3)),
    "scene": scene,
    "world": open_world,
    "bullet world": lambda: open_world("pybullet"),
    "record": recorded,
    "snapshot": lambda: open_world().save(),
    "body": lambda: scene().bodies[1],
    "scene robot": lambda: scene().robots[0],
    "material": world.Material,
    "trajectory": motion,
    "line": lambda: trajectory.line(arm(), tip(), np.full(3, 0.3), line_target(), 1.0),
    "scenario": scenario,
    "simulation": lambda: dynx.Simulation(scenario()),
    "rollout": rollout,
    "batch": batch,
    "noise": lambda: dynx.Noise(0.1, 0.1),
    "parametric": lambda: dynx.parametric(arm(), links=[arm().links[1].name]),
    "derivatives": lambda: dynx.Derivatives(arm()),
    "closed form": lambda: ik.closed_form(six_axis_arm(), six_axis_arm().frame_names[-1]),
    "ik result": lambda: engine().inverse_kinematics(np.array([1.0, 0.5, 0.0]), tip(), free="rotation"),
    "agreement": lambda: dynx.agree(arm(), ["reference", "pinocchio"], samples=1, referee_samples=1),
    "doctor report": lambda: dynx.diagnose(MODELS / "planar_3r.urdf", engines=["pinocchio"], samples=1),
    "identifiability": lambda: trajectory.Identifiability(arm(), samples=5),
    "environment": environment,
    "PD": pd,
    "computed torque": lambda: control.ComputedTorque(arm(), natural_frequency=10.0),
    "impedance": lambda: control.Impedance(arm(), tip(), stiffness=10.0, damping=1.0),
    "PD motor": lambda: dynx.PDMotor(0.1, 10.0, 1.0),
    "torque motor": lambda: dynx.TorqueMotor(0.1),
    "box": lambda: geometry.Box((0.1, 0.2, 0.3)),
    "geometry": lambda: arm().geometry,
    "surroundings": surroundings,
    "PID": lambda: control.PID(arm(), kp=1.0, ki=1.0, kd=1.0, control_dt=0.005),
    "velocity law": lambda: control.Velocity(arm(), kd=1.0),
    "feed-forward": lambda: control.FeedForward(arm(), backend="reference"),
    "gravity-compensated PD": lambda: control.GravityCompensatedPD(
        arm(), kp=1.0, kd=1.0, backend="reference"
    ),
    "discrete computed torque": lambda: control.DiscreteComputedTorque(
        arm(), control_dt=0.005, backend="reference"
    ),
    "operational space": lambda: control.OperationalSpace(
        arm(), tip(), natural_frequency=10.0, backend="reference"
    ),
    "open loop": lambda: control.OpenLoop(arm(), np.zeros((4, 3)), control_dt=0.005),
    "encoders": lambda: control.Encoders(pd(), resolution=0.01, control_dt=0.005),
    "motor lag": lambda: control.MotorLag(pd(), control_dt=0.005, time_constant=0.01),
    "friction compensation": lambda: control.FrictionCompensation(pd()),
    "saturated": lambda: control.Saturated(pd()),
    "joint friction": lambda: control.JointFriction(arm()),
    "Bullet PD motor": lambda: control.BulletPDMotor(arm(), kp=1.0, kd=1.0),
    "Bullet position motor": lambda: control.BulletPositionMotor(arm()),
    "Bullet velocity motor": lambda: control.BulletVelocityMotor(arm()),
    "Bullet torque motor": lambda: control.BulletTorqueMotor(pd()),
    "position motor": lambda: dynx.PositionMotor(0.1, 1.0, 1.0),
    "velocity motor": lambda: dynx.VelocityMotor(0.1, 1.0),
    "momentum observer": lambda: control.MomentumObserver(arm(), time_constant=0.1, backend="reference"),
    "tool": lambda: control.Tool(1.0, np.zeros(3), None, np.zeros(6), 1.0, 0.0),
    "sensor motion": lambda: control.SensorMotion(np.ones((4, 3)), np.ones((4, 3)), np.ones((4, 3))),
    "scene plant": lambda: dynx.ScenePlant(scene(), engine="mujoco"),
    "derived backend": lambda: backends.DerivedBackend(engine()),
    "distance": lambda: distance.distance(
        geometry.Box((0.1, 0.2, 0.3)), np.eye(4), geometry.Box((0.1, 0.2, 0.3)), np.eye(4)
    ),
    "rule": lambda: rules.all_rules()[0],
    "case": lambda: trap_case(rules.all_rules()[0]),
    "task": Reach,
    "measurement": lambda: control.Measurement(0.0, np.zeros(3), np.zeros(3)),
    "external force": lambda: dynx.ExternalForce("hand", np.zeros(6)),
    "referee": lambda: agreement.Referee(arm()),
    "conformance": conformance,
    "contact case": lambda: contacts.find_case(contacts.case_names()[0]),
    "randomization": lambda: envs.Randomization(mass_scale=(0.9, 1.1)),
    "frame target": lambda: ik.FrameTarget(tip(), np.eye(4)),
    "ik options": ik.Options,
    "IK solutions": closed_solutions,
    "mechanism": lambda: arm().mechanism,
    "loaded robot": lambda: loaded.load_as(loaded.installed_engines()[0], MODELS / "planar_3r.urdf", arm()),
    "summary": lambda: rollout().summary(),
    "camera": lambda: world.Camera(size=(8, 8)),
    "picture": lambda: open_world().camera(world.Camera(size=(8, 8))),
    "contact table": lambda: surroundings().contacts,
    "separation": lambda: world.separation(recorded(), recorded()),
    "sensor errors": lambda: world.SensorErrors(noise=0.1),
    "readings": lambda: rollout().read_sensors([world.Imu("imu", tip())])["imu"],
    **{f"sensor {name}": make for name, make in SENSORS.items()},
    **(training_objects() if TRAINING else {}),
    **({"viewer": viewer} if find_spec("viser") is not None else {}),
    "bench session": session,
    **{f"backend {name}": partial(engine, name) for name in dynx.installed_backends()},
}
"""Makers of the objects whose public methods are called."""


def by_annotation() -> dict[str, Callable[[], Any]]:
    """Return makers of valid arguments by words of annotations, the most specific first."""
    return {
        **({"TrainingSpec": small_run, "TaskSpec": lambda: small_run().task} if TRAINING else {}),
        **({"Policy": policy} if TRAINING else {}),
        "Sensor": SENSORS["IMU"],
        "ContactCase": lambda: contacts.find_case(contacts.case_names()[0]),
        "Options": ik.Options,
        "Randomization": envs.Randomization,
        "VelocityTask": lambda: ik_velocity_task(),
        "FrameTarget": lambda: ik.FrameTarget(tip(), np.eye(4)),
        "ScenePlant": lambda: "reference",
        "SceneRobot": lambda: scene().robots[0],
        "SceneBody": lambda: scene().bodies[1],
        "Scenario": scenario,
        "Scene": scene,
        "Material": world.Material,
        "Camera": lambda: world.Camera(size=(8, 8)),
        "Model": arm,
        "Backend": engine,
        "Controller": pd,
        "Trajectory": motion,
        "Measurement": lambda: control.Measurement(0.0, np.zeros(3), np.zeros(3)),
        "Setpoint": lambda: trajectory.Setpoint(np.zeros(3), np.zeros(3), np.zeros(3)),
        "BatchRollouts": batch,
        "Rollout": rollout,
        "Record": recorded,
        "Snapshot": lambda: open_world().save(),
        "Pose": dynx.Pose,
        "Payload": lambda: dynx.Payload(tip(), 1.0),
        "ExternalForce": lambda: dynx.ExternalForce("box", np.zeros(6)),
        "Collision": lambda: geometry.Collision(geometry.Box((0.1, 0.2, 0.3))),
        "ConvexShape": lambda: geometry.Box((0.1, 0.2, 0.3)),
        "Motor": lambda: dynx.PDMotor(0.1, 10.0, 1.0),
        "Generator": lambda: 0,
        "bool": lambda: True,
        "float": lambda: 0.1,
        "int": lambda: 1,
    }


def ik_velocity_task() -> Any:
    """Return a task of velocity_ik."""
    from dynx.ik.velocity import VelocityTask

    return VelocityTask(tip(), np.eye(4))


BY_NAME: Mapping[str, Callable[[], Any]] = {
    **dict.fromkeys(
        ("q", "v", "a", "tau", "q0", "q1", "v0", "v1", "nearest", "posture"), lambda: np.zeros(3)
    ),
    **dict.fromkeys(("frame", "on", "from_frame"), tip),
    **dict.fromkeys(("kp", "kd", "ki", "gain", "stiffness", "damping"), lambda: 1.0),
    **dict.fromkeys(("T_a", "T_b", "T", "target", "T_world_target", "pose", "base_pose"), lambda: np.eye(4)),
    **dict.fromkeys(
        ("rpy", "xyz", "normal", "direction", "gravity", "size", "center"), lambda: (0.0, 0.1, 1.0)
    ),
    **dict.fromkeys(("origins", "directions", "lower", "upper", "point"), lambda: (0.0, 0.1, 1.0)),
    "quat_xyzw": lambda: (0.0, 0.0, 0.0, 1.0),
    "R": lambda: np.eye(3),
    "wrench": lambda: np.zeros(6),
    "targets": lambda: np.tile(np.eye(4), (3, 1, 1)),
    "duration": lambda: 0.01,
    "until": lambda: 0.01,
    "dt": lambda: 0.001,
    "control_dt": lambda: 0.005,
    "joint": lambda: arm().joint_names[0],
    "link": lambda: arm().links[-1].name,
    "part": lambda: "box",
    "robot": lambda: "arm",
    "engine": lambda: "mujoco",
    "backend": lambda: "reference",
    "reference": lambda: "local",
    "base": lambda: "fixed",
    "name": lambda: "box",
    "path": lambda: "file.npz",
    "samples": lambda: 1,
    "referee_samples": lambda: 1,
    "radius": lambda: 0.1,
    "length": lambda: 0.1,
    "host": lambda: "127.0.0.1",
    "port": lambda: 0,
    "mass": lambda: 1.0,
}
"""Makers of valid arguments by the names of parameters."""
