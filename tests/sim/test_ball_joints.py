"""Motion of robots with ball joints: closed forms, conservation laws, MuJoCo, controllers, stops, files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import dynx
from dynx import control, trajectory
from dynx.errors import ArgumentError, LimitError, UnsupportedFeatureError
from dynx.model import Inertial, Joint, JointDynamics, Limits, Link, Model, Pose
from dynx.model.limited_positions import limited_positions
from dynx.spatial.so3 import quat_from_rotation, quat_product, rotation_from_quat, rotation_from_rpy
from dynx.testing.strategies import configurations, models
from tests.examples import PROFILE

BODY = Inertial(1.5, Pose((0.1, -0.2, 0.3), (0.3, -0.2, 0.5)), 0.04, 0.004, -0.003, 0.05, 0.002, 0.03)
EPS = np.finfo(np.float64).eps
NONE, UNLIMITED = JointDynamics(), Limits()
each_base = pytest.mark.parametrize("base", ["fixed", "floating"])


def arm(
    base: Any = "fixed",
    dynamics: JointDynamics = NONE,
    limits: Limits = UNLIMITED,
    gravity: tuple[float, float, float] = (0.0, 0.0, -9.81),
) -> Model:
    """Return a robot whose shoulder and wrist are ball joints, with an elbow and a tail that are hinges."""
    links = [Link(name, BODY) for name in ("trunk", "upper", "fore", "hand", "tail")]
    joints = [
        Joint("shoulder", "ball", "trunk", "upper", Pose((0.1, 0.2, 0.3), (0.1, 0.2, 0.3)), limits=limits),
        Joint(
            "elbow", "continuous", "upper", "fore", Pose((0.1, 0.2, 0.3), (0.4, 0.2, 0.3)), (0.0, 0.6, 0.8)
        ),
        Joint("wrist", "ball", "fore", "hand", Pose((0.1, 0.2, 0.3), (0.1, -0.2, 0.3)), dynamics=dynamics),
        Joint(
            "tail", "continuous", "upper", "tail", Pose((0.1, 0.2, -0.3), (0.1, 0.2, 0.3)), (0.0, 0.6, 0.8)
        ),
    ]
    return Model.build("arm", links, joints, base=base, gravity=gravity)


def start(model: Model, speed: float = 1.0) -> dict[str, Any]:
    return {"q0": model.random(0), "v0": np.random.default_rng(1).uniform(-speed, speed, model.nv)}


# -- free motion ----------------------------------------------------------------------------------


def test_conical_pendulum_in_closed_form() -> None:
    """A body at the distance L from the pivot, with the moment of inertia c about the line to it, circles at
    the tilt x with W^2 cos x (m L^2 - c) = m g L, and the child turns about the vertical of the world."""
    m, length, c, tilt = 2.0, 0.7, 1e-3, 0.6
    bob = Link("bob", Inertial(m, Pose((0.0, 0.0, -length)), izz=c))
    model = Model.build("pendulum", [Link("base"), bob], [Joint("pivot", "ball", "base", "bob")])
    rate = np.sqrt(9.81 * m * length / (np.cos(tilt) * (m * length**2 - c)))
    R = rotation_from_rpy(np.array([tilt, 0.0, 0.0]))
    start, spin = quat_from_rotation(R), R.T @ [0.0, 0.0, rate]
    run = dynx.simulate(model, duration=1.0, dt=1e-3, plant="pinocchio", integrator="rk4", q0=start, v0=spin)
    half = 0.5 * rate * run.t
    about = np.stack([0 * half, 0 * half, np.sin(half), np.cos(half)], axis=-1)
    # The error of fourth order in a step of 1 ms at 4 rad/s.
    assert np.max(np.abs(model.difference(run.q, quat_product(about, start)))) < 1e-9
    assert np.max(np.abs(run.v - spin)) < 1e-8


@each_base
def test_energy_and_momentum_are_kept(base: str) -> None:
    model = arm(base, gravity=(0.0, 0.0, 0.0))
    run = dynx.simulate(
        model, duration=0.1, dt=0.02, plant="compiled", integrator="adaptive", **start(model, 2.0)
    )
    size = np.max(np.abs(run.energy))
    assert np.max(np.abs(run.energy - run.energy[0])) < 1e-10 * size
    if base == "floating":
        with dynx.backend("reference", model) as engine:
            momentum = engine.centroidal_momentum(run.q, run.v)
        assert np.max(np.abs(momentum - momentum[0])) < 1e-10 * np.max(np.abs(momentum))


@each_base
@pytest.mark.parametrize("integrator", ["semi_implicit", "rk4"])
def test_steps_are_those_of_mujoco(base: str, integrator: str) -> None:
    """MuJoCo's Euler solves for damping at the end of a step, as semi-implicit Euler in dynx; a floating base
    has another velocity there, so that its steps agree to first order only."""
    mujoco = pytest.importorskip("mujoco")
    damped = JointDynamics(0.0, 0.0, 0.05) if integrator == "rk4" else JointDynamics(0.4, 0.0, 0.05)
    model = arm(base, damped)
    engine = mujoco.MjModel.from_xml_string(model.to_mjcf())
    engine.opt.timestep = 1e-3
    rk4 = integrator == "rk4"
    engine.opt.integrator = mujoco.mjtIntegrator.mjINT_RK4 if rk4 else mujoco.mjtIntegrator.mjINT_EULER
    given = start(model)
    data = mujoco.MjData(engine)
    q0, v0 = given["q0"].copy(), given["v0"].copy()
    for first in model.quaternions:
        q0[first : first + 4] = np.roll(q0[first : first + 4], 1)
    if base == "floating":
        # MuJoCo has the linear velocity of the base in world axes.
        v0[:3] = rotation_from_quat(given["q0"][3:7]) @ v0[:3]
    data.qpos[:], data.qvel[:] = q0, v0
    n = 20
    run = dynx.simulate(model, duration=1e-3 * n, dt=1e-3, plant="reference", integrator=integrator, **given)
    for _ in range(n):
        mujoco.mj_step(engine, data)
    q, v = data.qpos.copy(), data.qvel.copy()
    for first in model.quaternions:
        q[first : first + 4] = np.roll(q[first : first + 4], -1)
    if base == "floating":
        v[:3] = rotation_from_quat(q[3:7]).T @ v[:3]
    bound = 1e-12 if base == "fixed" and not rk4 else 1e-9 if rk4 else 1e-4
    assert np.max(np.abs(model.difference(run.q[-1], q))) < bound
    assert np.max(np.abs(run.v[-1] - v)) < 100 * bound


def test_three_hinges_move_as_a_ball_joint() -> None:
    """Away from gimbal lock the hand of both robots has the same pose at all times."""
    ball = Model.build("ball", [Link("base"), Link("hand", BODY)], [Joint("b", "ball", "base", "hand")])
    hinges = Model.build(
        "hinges",
        [Link("base"), Link("x"), Link("y"), Link("hand", BODY)],
        [
            Joint("rx", "continuous", "base", "x", axis=(1.0, 0.0, 0.0)),
            Joint("ry", "continuous", "x", "y", axis=(0.0, 1.0, 0.0)),
            Joint("rz", "continuous", "y", "hand", axis=(0.0, 0.0, 1.0)),
        ],
    )
    q, v = np.array([0.3, 0.4, -0.5]), np.array([0.7, -0.6, 0.8])
    with dynx.backend("reference", ball) as one, dynx.backend("reference", hinges) as other:
        J = other.jacobian(q, "hand", reference="local")[3:]
        T = other.forward_kinematics(q, "hand")
        options: Any = {"duration": 0.2, "dt": 1e-3, "plant": "reference", "integrator": "rk4"}
        turned = dynx.simulate(ball, q0=quat_from_rotation(T[:3, :3]), v0=J @ v, **options)
        apart = dynx.simulate(hinges, q0=q, v0=v, **options)
        poses = one.forward_kinematics(turned.q, "hand"), other.forward_kinematics(apart.q, "hand")
    assert np.max(np.abs(poses[0] - poses[1])) < 1e-10


def test_explicit_euler_turns_by_the_velocity_at_the_start() -> None:
    from dynx.rbd.integration import ExplicitEuler

    model = arm()
    given = start(model)
    q, v, _ = ExplicitEuler(model, 0.01)(lambda q, v: 2.0 * v, given["q0"], given["v0"])
    np.testing.assert_allclose(q, model.integrate(given["q0"], 0.01 * given["v0"]), atol=8 * EPS)
    np.testing.assert_allclose(v, 1.02 * given["v0"], atol=8 * EPS)


# -- joint dynamics and stops ---------------------------------------------------------------------


def test_friction_takes_energy_until_the_joint_sticks() -> None:
    model = Model.build(
        "top",
        [Link("base"), Link("top", Inertial(1.0, ixx=0.1, iyy=0.2, izz=0.25))],
        [Joint("pivot", "ball", "base", "top", dynamics=JointDynamics(0.02, 0.8, 0.01))],
    )
    run = dynx.simulate(model, duration=1.0, dt=1e-3, plant="compiled", **start(model, 2.0))
    assert run.executor == "compiled"
    plain = dynx.simulate(model, duration=1.0, dt=1e-3, plant="reference", **start(model, 2.0))
    np.testing.assert_allclose(plain.q, run.q, atol=1e-9)
    assert np.max(np.diff(run.energy)) <= 1e-12
    assert not run.v[-1].any()


@pytest.mark.parametrize("seed", range(4))
def test_a_ball_joint_stops_at_its_largest_angle(seed: int) -> None:
    """The impact is inelastic: it ends the outward velocity, and makes no energy."""
    model = arm(limits=Limits(upper=0.8))
    q0 = model.random(seed)
    v0 = np.random.default_rng(seed).uniform(-4.0, 4.0, model.nv)
    run = dynx.simulate(model, duration=0.5, dt=1e-3, plant="reference", q0=q0, v0=v0)
    angle = limited_positions(model, run.q)[:, 0]
    assert np.max(angle) <= 0.8 + 1e-12
    struck = np.flatnonzero(np.abs(angle - 0.8) <= 1e-12)
    assert struck.size
    axis = run.q[struck, :3] * np.sign(run.q[struck, 3:4])
    assert np.max(np.einsum("ki,ki->k", axis, run.v[struck, :3])) <= 1e-9
    # The integrator of first order changes the energy by a share of the work in a step; a rebound would by
    # much more.
    assert np.max(np.diff(run.energy)) <= 0.01 * np.max(run.kinetic_energy)


def test_a_start_beyond_the_largest_angle_is_noted() -> None:
    model = arm(limits=Limits(upper=0.2))
    run = dynx.simulate(model, duration=0.01, dt=1e-3, plant="reference", q0=arm().random(0))
    assert any("'shoulder' is at" in note and "beyond its limits up to 0.2, at" in note for note in run.notes)


# -- trajectories and controllers -----------------------------------------------------------------


@given(data=st.data())
@settings(max_examples=max(6, PROFILE // 8))
def test_velocities_of_trajectories_are_derivatives(data: st.DataObject) -> None:
    model = data.draw(models(joint_types=("ball", "revolute", "prismatic"), mimics=False, locks=False))
    if not model.nv:
        return
    q0, q1 = data.draw(configurations(model)), data.draw(configurations(model))
    motion = trajectory.quintic(q0, q1, 2.0, model=model)
    t = data.draw(st.floats(0.1, 1.9))
    h = 1e-5
    before, at, after = (motion(np.array([each])) for each in (t - h, t, t + h))
    size = 1.0 + np.max(np.abs(model.difference(q0, q1)))
    v = model.difference(before.q[0], after.q[0]) / (2 * h)
    assert np.max(np.abs(v - at.v[0])) <= 1e-7 * size
    assert np.max(np.abs((after.v - before.v) / (2 * h) - at.a)) <= 1e-6 * size
    assert np.max(np.abs(model.difference(motion.end.q, q1))) <= 16 * EPS * size


@pytest.mark.parametrize("model", [arm(), dynx.load("anymal", base="floating")], ids=["balls", "floating"])
def test_a_trajectory_without_the_model_is_refused_with_advice(model: dynx.Model) -> None:
    q0, q1 = model.random(0), model.random(1)
    flat = trajectory.cycloidal(q0, q1, 1.5)
    with pytest.raises(ArgumentError, match=r"nq \d+ and nv \d+; give the trajectory model=\.\.\."):
        dynx.simulate(model, reference=flat, duration=0.01)
    other = trajectory.cycloidal(np.zeros(3), np.ones(3), 1.5)
    with pytest.raises(ArgumentError, match=r"the reference has nq 3 and nv 3; .* nv \d+$"):
        dynx.simulate(model, reference=other, duration=0.01)


def test_a_ball_joint_turns_about_one_axis() -> None:
    """The path is the shorter great circle of the quaternions: attitudes are multiples of one rotation."""
    model = arm()
    q0, q1 = model.random(0), model.random(1)
    for motion in (
        trajectory.cubic(q0, q1, 1.0, model=model),
        trajectory.cycloidal(q0, q1, 1.0, model=model),
        trajectory.trapezoidal(q0, q1, velocity=1.0, acceleration=2.0, model=model),
        trajectory.s_curve(q0, q1, velocity=1.0, acceleration=2.0, jerk=10.0, model=model),
    ):
        q = motion(np.linspace(0.0, motion.duration, 9)).q
        turned, whole = model.difference(q0, q)[:, :3], model.difference(q0, q1)[:3]
        assert np.linalg.norm(np.cross(turned, whole), axis=-1).max() <= 64 * EPS
    with pytest.raises(ArgumentError, match="the ball joint 'shoulder' can only go from rest to rest"):
        trajectory.cubic(q0, q1, 1.0, v0=np.ones(model.nv), model=model)


def test_a_formula_of_quaternions_gives_its_velocity() -> None:
    model = Model.build("b", [Link("base"), Link("hand", BODY)], [Joint("b", "ball", "base", "hand")])
    tilted = quat_from_rotation(rotation_from_rpy(np.array([0.5, 0.3, 0.0])))

    def attitude(t: float) -> np.ndarray:
        angle = 0.5 * (1.0 + t) ** 2
        return quat_product(tilted, np.array([np.sin(angle), 0.0, 0.0, np.cos(angle)]))

    motion = trajectory.from_function(attitude, 1.0, model=model)
    found = motion(np.array([0.2, 0.9]))
    np.testing.assert_allclose(found.v, [[2.4, 0.0, 0.0], [3.8, 0.0, 0.0]], atol=1e-9)
    np.testing.assert_allclose(found.a, [[2.0, 0.0, 0.0], [2.0, 0.0, 0.0]], atol=1e-7)


def test_limits_of_a_ball_joint_are_checked() -> None:
    model = arm(limits=Limits(upper=0.5, velocity=0.1, effort=0.2))
    q1 = arm().random(0)
    motion = trajectory.quintic(model.neutral(), q1, 1.0, model=model)
    found = trajectory.violations(model, motion, backend="reference")
    assert {(each.joint, each.quantity) for each in found} == {
        ("shoulder", "position"),
        ("shoulder", "velocity"),
        ("shoulder", "effort"),
    }
    (position,) = {each.value for each in found if each.quantity == "position"}
    assert position == pytest.approx(limited_positions(model, q1)[0], rel=1e-9)
    with pytest.raises(LimitError, match="shoulder"):
        dynx.simulate(model, control.PD(model, kp=1.0, kd=1.0), q1, duration=0.01)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_controllers_track_a_motion(sign: float) -> None:
    """A quaternion and its negative are one attitude. The compiled step is the plain one."""
    model = arm()
    q0, q1 = model.random(0), model.random(1)
    for first in model.ball_places:
        q1[first : first + 4] *= sign
    motion = trajectory.quintic(q0, q1, 1.0, model=model)
    laws: list[tuple[control.Controller[Any], float]] = [
        # The error is rounding alone; about dt a* kd / (2 kp); the spring's deflection under gravity.
        (control.DiscreteComputedTorque(model, control_dt=1e-3, backend="compiled"), 1e-14),
        (control.ComputedTorque(model, natural_frequency=20.0, backend="compiled"), 3e-3),
        (control.FeedForward(model, kp=200.0, kd=20.0, backend="compiled"), 3e-3),
        (control.PD(model, kp=200.0, kd=20.0), 0.5),
        (control.PID(model, kp=200.0, ki=10.0, kd=20.0, control_dt=1e-3), 0.5),
        (control.GravityCompensatedPD(model, kp=200.0, kd=20.0, backend="compiled"), 0.5),
    ]
    for law, most in laws:
        run = dynx.simulate(model, law, motion, dt=1e-3, plant="compiled")
        assert run.executor == "compiled"
        assert np.max(np.abs(run.error)) <= most, law
        plain = dynx.simulate(model, law, motion, dt=1e-3, duration=0.05, plant="reference")
        assert np.max(np.abs(plain.q - run.q[: len(plain.q)])) <= 1e-10, law


def test_feedback_of_the_rotation_vector_settles() -> None:
    """With q* and w* of a rotation about a moving axis, exact feed-forward keeps a zero error at zero."""
    from dynx.control.ball_setpoints import in_present_axes, position_error

    model = arm()
    balls = model.ball_places
    rng = np.random.default_rng(3)
    q_wanted, v_wanted, a_wanted = model.random(rng), *rng.uniform(-1.0, 1.0, (2, model.nv))
    q, v = model.random(rng), rng.uniform(-1.0, 1.0, model.nv)
    h = 1e-6

    def wanted(t: float) -> tuple[np.ndarray, np.ndarray]:
        # To second order in t.
        turned = model.integrate(q_wanted, t * v_wanted + 0.5 * t * t * a_wanted)
        return turned, v_wanted + t * a_wanted

    rates = []
    for t in (-h, h):
        at = model.integrate(q, t * v)
        turned, rate = wanted(t)
        rates.append(in_present_axes(at, v, turned, rate, a_wanted, balls)[0])
    _, acceleration = in_present_axes(q, v, q_wanted, v_wanted, a_wanted, balls)
    np.testing.assert_allclose((rates[1] - rates[0]) / (2 * h), acceleration, atol=1e-8)
    error = position_error(q, q_wanted, balls)
    np.testing.assert_allclose(error, model.difference(q, q_wanted), atol=16 * EPS)


def test_batches_equal_single_runs() -> None:
    model = arm(dynamics=JointDynamics(0.1, 0.0, 0.01))
    law = control.ComputedTorque(model, natural_frequency=20.0, backend="compiled")
    motion = trajectory.quintic(model.random(0), model.random(1), 0.5, model=model)
    batch = dynx.simulate_batch(
        model, law, motion, rollouts=3, dt=1e-3, noise=dynx.Noise(q=1e-4, v=1e-3, seed=5), record_every=100
    )
    run = dynx.simulate(
        model, law, motion, dt=1e-3, plant="compiled", noise=dynx.Noise(q=1e-4, v=1e-3, seed=5)
    )
    np.testing.assert_array_equal(batch.q[0], run.q[-1])
    np.testing.assert_allclose(batch.max_error[0], np.max(np.abs(run.error[1:]), axis=0), atol=8 * EPS)
    assert "q:shoulder.qw" in batch.columns()
    assert "max_error:wrist.z" in batch.columns()


def test_limits_stop_the_lanes_of_a_batch() -> None:
    """Each rollout is that of `simulate`, compiled or plain, with its own armature."""
    model = arm(limits=Limits(upper=1.4))
    q0 = model.random(1)
    law = control.PD(model, kp=0.0, kd=0.0)
    v0 = np.random.default_rng(1).uniform(-3.0, 3.0, model.nv)
    armature = np.array([0.0, 0.05])[:, None] * np.ones(model.nv)
    options: Any = {"dt": 1e-3, "duration": 0.4, "q0": q0, "v0": v0}
    batch = dynx.simulate_batch(
        model, law, q0, rollouts=2, joint_armature=armature, record_every=1, **options
    )
    for k in range(2):
        for plant in ("compiled", "reference"):
            run = dynx.simulate(model, law, q0, plant=plant, joint_armature=armature[k], **options)
            angle = limited_positions(model, run.q)[:, 0]
            assert np.any(np.abs(angle - 1.4) <= 1e-9)
            assert np.max(angle) <= 1.4 + 1e-12
            assert np.max(np.abs(batch.q[k] - run.q[-1])) <= 1e-9
            assert np.max(np.abs(batch.max_error[k] - np.max(np.abs(run.error[1:]), axis=0))) <= 1e-9
        assert dynx.simulate(model, law, q0, plant="compiled", **options).executor == "compiled"


# -- files ----------------------------------------------------------------------------------------


def test_files_keep_every_bit(tmp_path: Path) -> None:
    model = arm("floating", JointDynamics(0.1, 0.2, 0.3), Limits(upper=2.0, velocity=5.0))
    run = dynx.simulate(model, duration=0.05, dt=1e-3, plant="reference", **start(model))
    for suffix in (".npz", ".csv"):
        path = tmp_path / f"run{suffix}"
        run.save(path)
        again = dynx.Rollout.load(path, None if suffix == ".npz" else model)
        assert again.model == model
        np.testing.assert_array_equal(again.q, run.q)
        np.testing.assert_array_equal(again.tau, run.tau)
    assert dynx.Rollout.load(tmp_path / "run.npz").scenario == run.scenario
    assert "q:shoulder.qx" in (tmp_path / "run.csv").read_text().partition("\n")[0].split(",")
    compared = dynx.compare(run, dynx.Rollout.load(tmp_path / "run.npz"), rerun=False)
    assert compared.separation.names[6] == "shoulder.x"
    run.plot(tmp_path / "run.png")


def test_a_log_of_positions_gives_velocities(tmp_path: Path) -> None:
    """Central differences along the rotation of each ball joint."""
    model = arm()
    motion = trajectory.quintic(model.random(0), model.random(1), 1.0, model=model)
    t = np.linspace(0.0, 1.0, 201)
    wanted = motion(t)
    header = ",".join(["t", *(f"q:{name}" for name in model.position_names)])
    np.savetxt(
        tmp_path / "log.csv", np.column_stack([t, wanted.q]), delimiter=",", header=header, comments=""
    )
    log = dynx.Rollout.load(tmp_path / "log.csv", model)
    # The error of a central difference is h^2 / 6 times the jerk, 60 times the displacement at most.
    most = 0.005**2 * 10.0 * np.abs(model.difference(wanted.q[0], wanted.q[-1])).max()
    assert np.max(np.abs(log.v - wanted.v)[1:-1]) < most


# -- engines' own steppers ------------------------------------------------------------------------


@each_base
def test_the_stepper_of_mujoco_is_a_plant(base: str) -> None:
    """MuJoCo's Euler is semi-implicit Euler of dynx, also with dry friction, which dynx solves for."""
    pytest.importorskip("mujoco")
    model = arm(base, JointDynamics(0.1, 0.05, 0.02), Limits(upper=2.0))
    options: Any = {"duration": 0.1, "dt": 1e-3, **start(model)}
    own = dynx.simulate(model, plant="mujoco", integrator="engine", **options)
    wanted = dynx.simulate(model, plant="reference", **options)
    assert np.max(np.abs(model.difference(own.q, wanted.q))) < 1e-11
    assert np.max(np.abs(own.v - wanted.v)) < 1e-9


def test_coefficients_of_each_axis_are_refused_by_an_engine() -> None:
    pytest.importorskip("mujoco")
    model = arm()
    with pytest.raises(UnsupportedFeatureError, match="'shoulder' of arm is a ball joint, of which an"):
        dynx.simulate(
            model,
            duration=0.01,
            plant="mujoco",
            integrator="engine",
            joint_damping=np.arange(model.nv, dtype=float),
            **start(model),
        )


def test_a_robot_in_a_scene_is_a_plant() -> None:
    pytest.importorskip("mujoco")
    from dynx.world import Scene, SceneRobot

    model = arm()
    scene = Scene("arm", robots=(SceneRobot("arm", model, q=model.random(0)),))
    law = control.PD(model, kp=100.0, kd=10.0)
    plant = dynx.sim.ScenePlant(scene, "arm", "mujoco")
    run = dynx.simulate(model, law, model.random(0), duration=0.2, dt=1e-3, plant=plant)
    alone = dynx.simulate(model, law, model.random(0), duration=0.2, dt=1e-3, plant="reference")
    assert np.max(np.abs(model.difference(run.q, alone.q))) < 1e-10
