"""Sensors against what dynx does not compute: ``python -m benchmarks.surveys.sensors``.

- *motion*: 30 robots with both bases move under two external wrenches, by the steps of MuJoCo, PyBullet,
  Drake and dynx. What sensors without errors read in the record, and in the worlds of the engines, is
  compared with the sensors of MuJoCo on a robot that is built here from links and joints
  (`joint_wrenches.MujocoRobot`).
- *noise*: 1e5 samples of an arm for each random error of a sensor. A mean, a variance or a correlation is
  divided by the standard deviation that it has if the error is as described.
- *errors*: the same for bias, scale, cross-axis error, resolution and delay in closed form.
- *export*: worlds of the robots, and dynx's scenes, as documents that MuJoCo alone reads and steps.
- *observer*: a step of 20 N on every link of the robots, moved by Pinocchio's forward dynamics; the error of
  the momentum observer after 5 time constants, as part of the external torques and of the force.
- *tool*: what is left of the weight of a tool on the link with the most moving joints before it, whose
  readings are those of MuJoCo's sensors, in states in which it was not identified.

An error of a reading is divided by the largest value of its unit that the robot's sensors read at that
instant, at least 1. Exits with 1 if a figure exceeds its bar.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

import dynx
from benchmarks.surveys.joint_wrenches import ROBOTS, MujocoRobot, moved_mass
from dynx.backends import Backend, backend
from dynx.control import MomentumObserver, SensorMotion, identify_tool
from dynx.control.observers.tool import Tool
from dynx.control.observers.wrench_estimate import MIN_RATIO
from dynx.errors import EngineLimitError, UnsupportedFeatureError
from dynx.model import Joint, JointDynamics, Link, Model, Pose
from dynx.model.loading import load
from dynx.model.tree import Base
from dynx.rbd.parameters import Payload
from dynx.spatial.scalar import Floats
from dynx.spatial.so3 import rotation_from_quat
from dynx.world import (
    ContactSensor,
    Encoder,
    ForceTorqueSensor,
    Imu,
    JointTorqueSensor,
    RaySensor,
    Readings,
    Scene,
    SceneRobot,
    Sensor,
    SensorErrors,
    World,
    read_scene,
    scene_names,
)

BARS = {"motion": 1e-9, "noise": 4.0, "errors": 1e-9, "export": 1e-9, "observer": 1e-2, "tool": 1e-3}
"""Largest figure of each part."""

STEPPERS = ("mujoco", "pybullet", "drake", "compiled")
"""Engines that move the robots; the last is dynx's own step."""

WORLDS = STEPPERS[:-1]

BASES: tuple[Base, ...] = ("fixed", "floating")

H = 1e-3
"""Length of a step [s]."""

STEPS = 6
"""Steps in which readings are compared."""

SAMPLES = 100_000

FORCE = 20.0
"""Force on a link that the observer finds [N]."""

TOOL = 1.3
"""Mass of the tool [kg]."""

DIFFERENT = "documents of damped and of mimic joints, which say so"
"""Title of the readings of which the documents say that MuJoCo has others. Printed, not judged."""

Worst = dict[str, tuple[float, str]]
"""Largest figure of each comparison, and where it was found."""


def note(worst: Worst, what: str, figure: float, where: str) -> None:
    """Keep the larger figure; one that is no number counts as infinite."""
    figure = math.inf if math.isnan(figure) else figure
    worst[what] = max(worst.get(what, (0.0, "")), (figure, where))


def skeleton(name: str, base: Base, *, joint_dynamics: bool = False) -> Model:
    """Return a robot without shapes."""
    model = load(name, base=base)
    joints = [each if joint_dynamics else replace(each, dynamics=JointDynamics()) for each in model.joints]
    return Model.build(model.name, model.links, joints, base=model.base, gravity=model.gravity)


def random_pose(rng: np.random.Generator) -> Pose:
    """Return the pose of a sensor in its part."""
    return Pose(tuple(rng.uniform(-0.2, 0.2, 3)), tuple(rng.uniform(-1.5, 1.5, 3)))


def random_sensors(model: Model, rng: np.random.Generator, robot: str = "") -> list[Sensor]:
    """Return sensors on random links and joints, on a fixed joint and a mimic joint too if there is one."""
    links, joints = [link.name for link in model.links], model.joints
    found: list[Sensor] = [
        Imu(f"imu {k}", f"{robot}{link}", pose=random_pose(rng))
        for k, link in enumerate(dict.fromkeys([model.root, *rng.choice(links, 3).tolist()]))
    ]
    kinds = (
        [j for j in joints if j.moves],
        [j for j in joints if not j.moves],
        [j for j in joints if j.mimic],
    )
    for k, some in enumerate(kinds):
        if some:
            joint = some[int(rng.integers(len(some)))]
            sensor = ForceTorqueSensor(f"ft {k}", f"{robot}{joint.name}", pose=random_pose(rng))
            found += [sensor, replace(sensor, name=f"{sensor.name} without weight", weight=False)]
            if joint.moves:
                found += [
                    JointTorqueSensor(f"torque {k}", f"{robot}{joint.name}"),
                    Encoder(f"encoder {k}", f"{robot}{joint.name}"),
                ]
    if not model.floating:
        found.append(ForceTorqueSensor("foundation", f"{robot}{model.root}", pose=random_pose(rng)))
    return found


class RawSensors:
    """What MuJoCo's own sensors read where the sensors of dynx are."""

    KINDS = ("accelerometer", "gyro", "force", "torque")

    def __init__(self, model: Model, sensors: Sequence[Sensor]) -> None:
        self._model, self._sensors = model, sensors
        self._joints = {joint.name: joint for joint in model.joints}
        sites = {each.name: self._site(each) for each in sensors}
        self._robot = MujocoRobot(model, sites, self.KINDS)

    def _part(self, sensor: Sensor) -> str:
        return sensor.on.rpartition("/")[2] if sensor.on not in self._joints else sensor.on

    def _site(self, sensor: Sensor) -> tuple[str, Pose]:
        part, pose = self._part(sensor), getattr(sensor, "pose", Pose())
        on_joint = (
            isinstance(sensor, ForceTorqueSensor | JointTorqueSensor | Encoder) and part in self._joints
        )
        return (self._joints[part].child if on_joint else part), pose

    def read(self, q: Floats, v: Floats, a: Floats, forces: dict[str, Floats]) -> dict[str, Floats]:
        """Return the readings by the names of the sensors, in the coordinates of the robot; `forces` are
        wrenches (6,) on links at their origins in axes of the world."""
        coupling = self._model.mechanism.coupling
        if coupling is not None:
            S = coupling.matrix()
            q, v, a = coupling.expand_q(q), S @ v, S @ a
        shape = (len(self._sensors), len(self.KINDS), 3)
        moving = self._robot.readings(q, v, a, forces).reshape(shape)
        weight = self._robot.readings(q, 0.0 * v, 0.0 * a, {}).reshape(shape)
        found: dict[str, Floats] = {}
        for rows, still, sensor in zip(moving, weight, self._sensors, strict=True):
            if isinstance(sensor, Imu):
                found[sensor.name] = rows[:2].ravel()
            elif isinstance(sensor, ForceTorqueSensor):
                found[sensor.name] = (rows[2:] - (0.0 if sensor.weight else still[2:])).ravel()
            else:
                joint = self._joints[self._part(sensor)]
                number = [each.name for each in self._joints.values() if each.moves].index(joint.name)
                along = rows[2 if joint.type == "prismatic" else 3] @ np.array(joint.axis)
                k = number + (6 if self._model.floating else 0)
                state = np.array([q[k + self._model.floating], v[k]])
                found[sensor.name] = state if isinstance(sensor, Encoder) else np.array([along])
        return found


def compare(found: dict[str, Floats], exact: dict[str, Floats]) -> float:
    """Return the largest error of readings, relative to the largest value of its unit at that instant."""
    largest: dict[tuple[str, int], float] = {}
    kinds = {name: name.split()[0] for name in exact}
    parts = {name: [rows[k : k + 3] for k in range(0, len(rows), 3)] for name, rows in exact.items()}
    for name, rows in parts.items():
        for k, row in enumerate(rows):
            key = kinds[name], k
            largest[key] = max(largest.get(key, 1.0), float(np.abs(row).max()))
    return max(
        float(np.abs(found[name][3 * k : 3 * k + 3] - row).max()) / largest[kinds[name], k]
        for name, rows in parts.items()
        for k, row in enumerate(rows)
    )


def motion(name: str, base: Base, number: int, worst: Worst) -> None:
    """Compare the readings of a robot in motion, in the records of all engines and in their worlds."""
    rng, model = np.random.default_rng(number), skeleton(name, base)
    unmoved = [each.name for each in model.joints if each.moves and not moved_mass(model, each.child)]
    if unmoved:
        # Under no torque nobody can say how it moves: its acceleration has no bound.
        print(f"{name}: nothing has mass beyond {unmoved[0]}, so no engine moves it")
        return
    q, v = model.random(rng), rng.uniform(-1.0, 1.0, model.nv)
    links = [link.name for link in model.links]
    pushes = [
        dynx.ExternalForce(link, rng.uniform(-5.0, 5.0, 6), start=1.5e-3)
        for link in dict.fromkeys([links[-1], links[len(links) // 2]])
    ]
    sensors = random_sensors(model, rng)
    raw = RawSensors(model, sensors)
    start: dict[str, Any] = {"q0": q, "v0": v, "duration": H * STEPS, "pushes": pushes}
    start["joint_limits"] = False
    for engine in STEPPERS:
        own: dict[str, Any] = {} if engine == "compiled" else {"integrator": "engine"}
        try:
            rollout = dynx.simulate(model, None, plant=engine, sensors=sensors, **start, **own)
        except (EngineLimitError, UnsupportedFeatureError) as error:
            print(f"{name}, {base} base, {engine}: {error}")
            continue
        for k in range(len(rollout)):
            exact = raw.read(rollout.q[k], rollout.v[k], rollout.a[k], acting(pushes, rollout.t[k]))
            found = {each.name: rollout.sensors[each.name].values[k] for each in sensors}
            note(worst, f"record of {engine}", compare(found, exact), f"{name}, {base} base")
        if engine in WORLDS:
            placed = [replace(each, on=f"robot/{each.on}") for each in sensors]
            robot = SceneRobot("robot", model, q=tuple(q), v=tuple(v))
            scene = Scene("alone", robots=(robot,), sensors=placed, gravity=model.gravity)
            at = [replace(each, on=f"robot/{each.on}") for each in pushes]
            with World(scene, engine, collisions=False, joint_limits=False) as world:
                for _ in range(STEPS):
                    before, t = world.state.robots["robot"], world.time
                    world.step(forces=at)
                    a = mean_acceleration(model, *before, *world.state.robots["robot"])
                    exact = raw.read(*before, a, acting(pushes, t))
                    readings = {each: reading.values for each, reading in world.read_sensors().items()}
                    note(worst, f"world of {engine}", compare(readings, exact), f"{name}, {base} base")


def acting(pushes: Sequence[dynx.ExternalForce], t: float) -> dict[str, Floats]:
    """Return the wrenches in the step from a time [s], at the origins of their links in world axes."""
    shares = [float(np.clip((t + H - each.start) / H, 0.0, 1.0)) for each in pushes]
    return {each.on: share * np.asarray(each.wrench) for each, share in zip(pushes, shares, strict=True)}


def mean_acceleration(model: Model, q: Floats, v: Floats, q_next: Floats, v_next: Floats) -> Floats:
    """Return the acceleration (nv,) of a step: the rates of the joints' velocities.

    Of a floating base it follows from the rates of the angular velocity and of the velocity of the centre of
    mass of the root, with all that is fixed to it, in axes of the world.
    """
    a: Floats = (v_next - v) / H
    if model.floating:
        mass, moment = fixed_mass(model, model.root, np.eye(4))
        c = moment / (mass or 1.0)
        R, R_next = rotation_from_quat(q[3:7]), rotation_from_quat(q_next[3:7])
        w, w_next = R @ v[3:6], R_next @ v_next[3:6]
        alpha = (w_next - w) / H
        center, center_next = (
            R @ v[:3] + np.cross(w, R @ c),
            R_next @ v_next[:3] + np.cross(w_next, R_next @ c),
        )
        of_center = (center_next - center) / H
        of_origin = of_center - np.cross(alpha, R @ c) - np.cross(w, np.cross(w, R @ c))
        # The coordinates are the rates of v in the axes of the base, which turn.
        a[:3], a[3:6] = R.T @ of_origin - np.cross(v[3:6], v[:3]), R.T @ alpha
    return a


def fixed_mass(model: Model, link: str, T: Floats) -> tuple[float, Floats]:
    """Return mass and first moment (3,) of a link at pose `T` and of all that is fixed to it."""
    inertial = model.inertial(link)
    mass, moment = inertial.mass, inertial.mass * (T[:3, :3] @ np.array(inertial.origin.xyz) + T[:3, 3])
    for joint in model.joints:
        if joint.parent == link and not joint.moves:
            more = fixed_mass(model, joint.child, T @ joint.origin.matrix)
            mass, moment = mass + more[0], moment + more[1]
    return mass, moment


def deviations(errors: Floats, sigma: Floats, what: str, worst: Worst) -> None:
    """Note mean, variance and correlations of errors (n, m) that should be white, with deviations (m,)."""
    n = len(errors)
    white = errors / sigma
    for k in range(white.shape[1]):
        note(worst, f"{what}: mean", abs(white[:, k].mean()) * math.sqrt(n), f"component {k}")
        variance = abs((white[:, k] ** 2).mean() - 1.0) * math.sqrt(n / 2.0)
        note(worst, f"{what}: variance", variance, f"component {k}")
        for lag in (1, 2, 10):
            between = abs((white[lag:, k] * white[:-lag, k]).mean()) * math.sqrt(n - lag)
            note(worst, f"{what}: correlation in time", between, f"component {k}, {lag} samples later")
        for other in range(k):
            between = abs((white[:, k] * white[:, other]).mean()) * math.sqrt(n)
            note(worst, f"{what}: correlation of components", between, f"components {other} and {k}")


class LongMotion:
    """A double pendulum in 1e5 samples of an IMU."""

    RATE = 500.0
    DEVIATIONS = np.array([0.02, 0.5, 3.0, 0.02, 0.5, 3.0])
    """Standard deviations of the components of both channels."""

    def __init__(self, samples: int) -> None:
        self.arm = load("double_pendulum")
        self.q0 = np.full(self.arm.nq, 0.7)
        seconds = samples / self.RATE
        # The limits of this robot leave no range.
        free: dict[str, Any] = {"joint_limits": False, "dt": H, "q0": self.q0}
        self.log = dynx.simulate(self.arm, None, duration=seconds, plant="compiled", **free)
        self.truth = self.read(self.imu()).values
        assert len(self.truth) == samples, len(self.truth)

    def imu(self, name: str = "imu", seed: int = 3, delay: float = 0.0, **errors: Any) -> Imu:
        """Return a sensor at the tip with the same errors of both channels."""
        given, tip = SensorErrors(**errors), self.arm.links[-1].name
        return Imu(name, tip, rate=self.RATE, seed=seed, delay=delay, accelerometer=given, gyroscope=given)

    def read(self, sensor: Imu, log: dynx.Rollout | None = None) -> Readings:
        """Return the readings along the motion, or along another."""
        return (self.log if log is None else log).read_sensors(sensor)[sensor.name]

    def errors(self, sensor: Imu) -> Floats:
        """Return the errors (n, 6) of the readings."""
        return np.asarray(self.read(sensor).values - self.truth)


def noise(worst: Worst, samples: int = SAMPLES) -> None:
    """Compare the statistics of random errors with their description."""
    motion = LongMotion(samples)
    both, n, period = motion.DEVIATIONS, samples, 1.0 / motion.RATE
    sigma = both[:3]
    white = motion.errors(motion.imu(noise=sigma))
    deviations(white, both, "white noise", worst)
    dense = motion.errors(motion.imu(seed=5, noise_density=sigma * math.sqrt(period)))
    deviations(dense, both, "density of noise", worst)
    another = replace(motion.log, scenario=numbered(motion.log, 1))
    for what, other in (
        ("other sensors", motion.read(motion.imu("imv", noise=sigma))),
        ("other seeds", motion.read(motion.imu(seed=4, noise=sigma))),
        ("other rollouts", motion.read(motion.imu(noise=sigma), another)),
    ):
        product = (white * (other.values - motion.truth)).mean(axis=0) / both**2
        note(worst, f"white noise: correlation with {what}", float(np.abs(product).max()) * math.sqrt(n), "")

    walk = motion.errors(motion.imu(seed=6, random_walk=sigma))
    deviations(np.diff(walk, axis=0), both * math.sqrt(period), "steps of the walking bias", worst)
    long = min(1000, n // 100)
    spans = walk[long::long] - walk[:-long:long]
    deviations(spans, both * math.sqrt(long * period), f"walk of the bias in {long} samples", worst)

    # A deviation of many steps makes the error of rounding uniform and independent.
    step = 0.1
    coarse = motion.errors(motion.imu(seed=7, noise=1.0, resolution=step))
    deviations(coarse, np.full(6, math.sqrt(1.0 + step**2 / 12.0)), "noise and resolution", worst)


def errors_in_closed_form(worst: Worst, samples: int = SAMPLES) -> None:
    """Compare errors that are not random with their closed forms, and random ones between engines."""
    motion, n, step = LongMotion(samples), samples, 0.1
    truth, sigma, period = motion.truth, motion.DEVIATIONS[:3], 1.0 / motion.RATE
    rounded = motion.read(motion.imu(resolution=step)).values
    off = float(np.abs(rounded - np.rint(rounded / step) * step).max())
    beyond = max(float(np.abs(rounded - truth).max()) - 0.5 * step, 0.0)
    note(worst, "resolution: multiples, within half a step", max(off, beyond), "")
    limited = motion.read(motion.imu(saturation=sigma)).values
    wanted = np.sign(truth) * np.minimum(np.abs(truth), np.tile(sigma, 2))
    note(worst, "saturation", float(np.abs(limited - wanted).max()), "")

    bias, scale = np.array([0.2, -0.1, 0.05]), np.array([0.01, -0.02, 0.0])
    cross = np.array([[0.0, 0.01, -0.02], [0.03, 0.0, 0.0], [0.0, -0.01, 0.0]])
    vectors = truth.reshape(n, 2, 3)
    for what, sensor, exact in (
        ("bias", motion.imu(bias=bias), np.broadcast_to(bias, vectors.shape)),
        ("scale", motion.imu(scale=scale), scale * vectors),
        ("cross-axis error", motion.imu(cross_axis=cross), vectors @ cross.T),
    ):
        note(worst, what, float(np.abs(motion.errors(sensor) - exact.reshape(n, 6)).max()), "")

    delay = 0.0137
    late, t = motion.read(motion.imu(delay=delay, noise=sigma)), motion.log.t
    held = late.held(t)
    ready = np.floor((t - delay) / period + 1e-6).astype(int)
    seen = motion.read(motion.imu(noise=sigma)).values[np.clip(ready, 0, n - 1)]
    error = float(np.abs(np.where((ready < 0)[:, None], 0.0, held - seen)).max())
    early = 0.0 if np.isnan(held[ready < 0]).all() else math.inf
    note(worst, "delay: the sample that can be read", max(error, early), "")

    for engine in WORLDS:
        free: dict[str, Any] = {"joint_limits": False, "dt": H, "q0": motion.q0}
        log = dynx.simulate(motion.arm, None, plant=engine, integrator="engine", duration=0.2, **free)
        noisy = motion.imu(noise=sigma, random_walk=sigma)
        found = motion.read(noisy, log).values - motion.read(motion.imu(), log).values
        note(
            worst, "noise of engines", float(np.abs(found - motion.errors(noisy)[: len(found)]).max()), engine
        )


def numbered(rollout: dynx.Rollout, number: int) -> dynx.Scenario:
    """Return the scenario of a rollout with another number."""
    assert isinstance(rollout.scenario, dynx.Scenario)
    return replace(rollout.scenario, noise=dynx.Noise(rollout=number))


def export(scene: Scene, name: str, seed: int, worst: Worst) -> None:
    """Compare the readings of a world in MuJoCo with those of its document in MuJoCo alone."""
    import mujoco

    rng = np.random.default_rng(seed)
    models = [each.model for each in scene.robots]
    damped = any(joint.dynamics.damping for model in models for joint in model.joints if joint.moves)
    exactly = not damped and all(model.mechanism.coupling is None for model in models)
    with World(scene, "mujoco") as world:
        try:
            document = world.to_mjcf()
        except UnsupportedFeatureError as error:
            print(f"{name}: {error}")
            return
        model = mujoco.MjModel.from_xml_string(document)
        data = mujoco.MjData(model)
        if model.nkey:
            mujoco.mj_resetDataKeyframe(model, data, model.key("start").id)
        engine: Any = world._motion.engine
        for _ in range(40):
            torques = {each.name: rng.normal(size=each.model.nv) for each in scene.robots if not each.motors}
            for each in scene.robots:
                if each.model.floating and each.name in torques:
                    torques[each.name][:6] = 0.0
            world.step(torques=torques)
            data.qfrc_applied[:] = engine.data.qfrc_applied
            data.xfrc_applied[:] = engine.data.xfrc_applied
            mujoco.mj_step(model, data)
            values = {
                each: raw_values(data, reading, world) for each, reading in world.read_sensors().items()
            }
            found = {
                each: world.read_sensors()[each].values for each, raw in values.items() if raw is not None
            }
            exact = {each: raw for each, raw in values.items() if raw is not None}
            if exact:
                what = "documents" if exactly else DIFFERENT
                note(worst, what, compare(found, exact), name)


def raw_values(data: Any, reading: Any, world: World) -> Floats | None:
    """Return what MuJoCo has for a reading, with the differences that the document states; None where it says
    that MuJoCo has no such sensor."""
    sensor = reading.sensor
    if isinstance(sensor, ForceTorqueSensor):
        robot = next(each for each in world.scene.robots if each.name == sensor.on.partition("/")[0])
        number, _ = sensor.mounting(robot.model, sensor.on.partition("/")[2])
        if number is None or not robot.model.joints[number].moves or not sensor.weight:
            return None
    values = [data.sensor(f"{sensor.name}/{channel.name}").data for channel in sensor.channels]
    if isinstance(sensor, JointTorqueSensor):
        return np.array([values[0][2]])
    if isinstance(sensor, ContactSensor):
        R = np.asarray(data.body(sensor.on).xmat).reshape(3, 3) @ sensor.pose.matrix[:3, :3]
        return np.asarray(R.T @ values[0])
    if isinstance(sensor, RaySensor) and values[0][0] == -1.0:
        return np.array([sensor.length])
    return np.concatenate(values)


def exported_scenes(robots: Sequence[str]) -> Iterator[tuple[str, Scene]]:
    """Yield each robot alone, and the scenes of dynx with contacts and rays on everything that moves."""
    for number, name in enumerate(robots):
        for base in BASES:
            rng, model = np.random.default_rng(number), skeleton(name, base, joint_dynamics=True)
            robot = SceneRobot("robot", model, q=tuple(model.random(rng)))
            sensors = random_sensors(model, rng, "robot/")
            yield f"{name}, {base} base", Scene("alone", robots=(robot,), sensors=sensors)
    for name in scene_names():
        scene = read_scene(name)
        moving = [body.name for body in scene.bodies if not body.fixed]
        below = Pose(rpy=(math.pi, 0.3, 0.0))
        sensors = [ContactSensor(f"contact {each}", each) for each in moving]
        sensors += [RaySensor(f"ray {each}", each, pose=below) for each in moving]
        for number, each in enumerate(scene.robots):
            found = random_sensors(each.model, np.random.default_rng(number), f"{each.name}/")
            sensors += [replace(one, name=f"{one.name} {each.name}") for one in found]
        yield f"scene {name}", replace(scene, sensors=(*scene.sensors, *sensors))


def observe(name: str, base: Base, seed: int, worst: Worst) -> None:
    """Find a step of 20 N on every link of a robot that moves."""
    rng, model = np.random.default_rng(seed), skeleton(name, base)
    unmoved = [each.name for each in model.joints if each.moves and not moved_mass(model, each.child)]
    if unmoved:
        print(f"{name}: nothing has mass beyond {unmoved[0]}, so no force has an acceleration there")
        return
    seen = 0
    with backend("pinocchio", model) as engine:
        for link in model.links:
            q, v = model.random(rng), 0.1 * rng.standard_normal(model.nv)
            direction = rng.standard_normal(3)
            wrench = np.concatenate([FORCE * direction / np.linalg.norm(direction), np.zeros(3)])
            torque = engine.jacobian(q, link.name).T @ wrench
            if not np.abs(torque).max() > 1e-9 * FORCE:
                continue  # nothing between the base and the link moves
            seen += 1
            duration = 5.0 * time_constant(engine, q, v, link.name, torque)
            t, Q, V, tau = moved(engine, q, v, link.name, wrench, duration)
            observer = MomentumObserver(model, time_constant=duration / 5.0, backend=engine)
            found = observer.residuals(t, Q, V, tau)[-1]
            J = engine.jacobian(Q[-1], link.name)
            # The smallest wrench with these torques, without directions that hardly have any.
            where = f"{name}, {base} base, {link.name}"
            error = float(np.linalg.norm(found - J.T @ wrench) / np.linalg.norm(J.T @ wrench))
            note(worst, "external torque", error, where)
            estimate = observer.wrench(Q[-1], found, link.name)
            shown = np.linalg.pinv(J.T, rcond=MIN_RATIO) @ (J.T @ wrench)
            note(worst, "wrench", float(np.linalg.norm(estimate.wrench - shown)) / FORCE, where)
    print(f"{name}, {base} base: 20 N on {seen} of {len(model.links)} links; the others are the base")


def time_constant(engine: Backend, q: Floats, v: Floats, frame: str, torque: Floats) -> float:
    """Return a time constant [s] of at most 1 ms, in five of which nothing moves by more than about 0.1 mm or
    0.1 mrad: what the force acts on turns and falls away, and its torques are no step."""
    a = np.linalg.solve(engine.mass_matrix(q), torque)
    fastest = max(float(np.abs(engine.jacobian(q, frame) @ a).max()), float(np.abs(a).max()))
    return min(1e-3, math.sqrt(2.0 * 1e-4 / fastest) / 5.0, 1e-4 / float(np.abs(v).max()) / 5.0)


def moved(
    engine: Backend, q: Floats, v: Floats, frame: str, wrench: Floats, duration: float, steps: int = 100
) -> tuple[Floats, Floats, Floats, Floats]:
    """Return a log of a robot that falls under constant torques and a wrench: the times (n + 1,), states and
    torques, by the midpoint rule and the forward dynamics of the engine."""
    model, h = engine.model, duration / steps
    tau = np.zeros(model.nv) if model.floating else engine.gravity_torque(q)
    states = [(q, v)]
    for _ in range(steps):
        a = engine.forward_dynamics(q, v, tau, external_forces={frame: wrench})
        middle, between = model.integrate(q, 0.5 * h * v), v + 0.5 * h * a
        a = engine.forward_dynamics(middle, between, tau, external_forces={frame: wrench})
        q, v = model.integrate(q, h * between), v + h * a
        states.append((q, v))
    Q, V = (np.array(rows) for rows in zip(*states, strict=True))
    return h * np.arange(steps + 1.0), Q, V, np.tile(tau, (steps, 1))


def hold_tool(name: str, base: Base, seed: int, worst: Worst) -> None:
    """Identify a tool on a link from readings of MuJoCo's sensors, and subtract it from others."""
    rng, bare = np.random.default_rng(seed), skeleton(name, base)
    link = max((each.name for each in bare.links), key=lambda name: turns(bare, name))
    if not bare.floating and turns(bare, link) < 2:
        print(f"{name}: no sensor is turned about two axes")
        return
    A = rng.standard_normal((3, 3))
    tensor = 0.01 * (A @ A.T + np.eye(3))
    tool = Payload(link, TOOL, tuple(rng.uniform(-0.1, 0.1, 3)), tensor)
    carries = with_tool(bare, tool)
    pose, weight = random_pose(rng), 9.81 * TOOL
    raw = RawSensors(carries, [ForceTorqueSensor("ft", "tool", pose=pose)])
    bias = rng.standard_normal(6)

    def states(n: int) -> tuple[Floats, SensorMotion]:
        q, v, a = bare.random(rng, n), *rng.uniform(-1.0, 1.0, (2, n, bare.nv))
        readings = np.array([raw.read(*each, {})["ft"] for each in zip(q, v, a, strict=True)])
        return readings, SensorMotion.of_robot(bare, link, q, v, a, pose=pose)

    exact, moving = states(400)
    others, elsewhere = states(100)
    for what, noisy in (
        ("without noise", exact + bias),
        ("noise of 0.3 % of the weight", exact + bias + 3e-3 * weight * rng.standard_normal(exact.shape)),
    ):
        found: Tool = identify_tool(noisy, moving)
        left = found.compensate(others + bias, elsewhere)
        size = float(np.sqrt(np.mean(np.sum(left[:, :3] ** 2, axis=1)))) / weight
        note(worst, f"{what}: left of the weight", size, f"{name}, {base} base")


def turns(model: Model, link: str) -> int:
    """Return the number of directions of the axes about which joints turn a link."""
    by_child = {joint.child: joint for joint in model.joints}
    axes, q = [np.zeros(3)], model.neutral()
    with backend("reference", model) as engine:
        while link in by_child:
            joint = by_child[link]
            if joint.moves and joint.type != "prismatic":
                axes.append(engine.forward_kinematics(q, link)[:3, :3] @ np.array(joint.axis))
            link = joint.parent
    return int(np.linalg.matrix_rank(np.array(axes), tol=1e-6))


def with_tool(model: Model, tool: Payload) -> Model:
    """Return the robot with the tool as a link that a joint called ``tool`` fixes to its frame."""
    joint = Joint("tool", "fixed", tool.frame, "the tool")
    links = [*model.links, Link("the tool", tool.inertial)]
    return Model.build(model.name, links, [*model.joints, joint], base=model.base, gravity=model.gravity)


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the figures of the parts and return 1 if one exceeds its bar."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("robots", nargs="*", default=ROBOTS, help="names of robots; default: 30")
    parser.add_argument("--part", action="append", choices=tuple(BARS), help="default: all parts")
    chosen = parser.parse_args(arguments)
    failed = False
    for part in chosen.part or tuple(BARS):
        worst: Worst = {}
        if part == "noise":
            noise(worst)
        elif part == "errors":
            errors_in_closed_form(worst)
        elif part == "export":
            for number, (name, scene) in enumerate(exported_scenes(chosen.robots)):
                export(scene, name, number, worst)
        else:
            measure = {"motion": motion, "observer": observe, "tool": hold_tool}[part]
            for number, name in enumerate(chosen.robots):
                for base in BASES:
                    print(f"{part}: {name}, {base} base", file=sys.stderr, flush=True)
                    measure(name, base, number, worst)
        print(f"\n{part}: largest figures, bar {BARS[part]:g}")
        for what, (figure, where) in worst.items():
            print(f"    {what:52}{figure:10.2e}  {where}")
        failed |= any(figure > BARS[part] for what, (figure, _) in worst.items() if what != DIFFERENT)
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
