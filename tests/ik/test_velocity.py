"""Velocity inverse kinematics against closed forms, SciPy's solvers, and the conditions of an optimum; and
velocities that keep bodies apart: distances along a motion, by another engine as well."""

from __future__ import annotations

import sys
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import LinearConstraint, lsq_linear, minimize

from dynx.backends import backend
from dynx.distance.avoidance import Avoidance
from dynx.errors import ArgumentError, NotInstalledError, ShapeError, UnknownNameError
from dynx.ik.velocity import AT_BOUND, VelocityResult, VelocityTask, velocity_bounds
from dynx.model import Model
from dynx.model.elements import Pose
from dynx.model.loading import load
from dynx.spatial.scalar import Floats
from dynx.testing.strategies import configurations, models
from dynx.world import Scene, SceneRobot, World, box
from tests.ik.avoidance.scenes import ENGINE_ERROR, arm, engine, least_room, scene
from tests.oracles.closed_form import MODELS

pytest.importorskip("daqp")

ARM = load(MODELS / "seven_axis_arm.urdf")
FRAME = ARM.frame_names[-1]
ENGINE = backend("reference", ARM)
Q = 0.5 * (ARM.lower + ARM.upper) + 0.3
DT = 0.01
ROUNDING = 1e-7
"""Accuracy of v [rad/s]: rounding of H, whose condition is at most 1 / damping."""

velocities = st.lists(st.floats(-3.0, 3.0), min_size=6, max_size=6).map(np.array)


@given(velocities, st.sampled_from([1e-4, 1e-2, 1.0]))
def test_without_limits_it_is_damped_least_squares(velocity: Any, damping: float) -> None:
    """Wampler 1986; Siciliano et al., eq. 3.59."""
    found = ENGINE.velocity_ik(
        Q, VelocityTask(FRAME, velocity), dt=1e-4, damping=damping, velocity_limit=np.inf
    )
    J = ENGINE.jacobian(Q, FRAME)
    expected = J.T @ np.linalg.solve(J @ J.T + damping * np.eye(6), velocity)
    np.testing.assert_allclose(found.v, expected, atol=ROUNDING / damping**0.5)
    assert found
    assert not found.limited.any()


@given(velocities, st.floats(0.01, 1.0))
def test_within_bounds_it_is_the_bounded_least_squares_of_scipy(velocity: Any, limit: float) -> None:
    damping = 1e-3
    weights = np.array([1.0, 2.0, 1.0, 0.5, 1.0, 0.0])
    task = VelocityTask(FRAME, velocity, weights=weights)
    found = ENGINE.velocity_ik(Q, task, dt=DT, damping=damping, velocity_limit=limit)
    J = ENGINE.jacobian(Q, FRAME)
    A = np.concatenate([weights[:, None] * J, np.sqrt(damping) * np.eye(7)])
    expected = lsq_linear(A, np.concatenate([weights * velocity, np.zeros(7)]), (-limit, limit), tol=1e-14)
    np.testing.assert_allclose(found.v, expected.x, atol=1e-6)
    assert (np.abs(found.v) <= limit).all()


@settings(max_examples=15)
@given(velocities)
def test_hard_tasks_come_before_soft_ones(velocity: Any) -> None:
    """SciPy's SLSQP, a solver of another kind, finds the same optimum."""
    hard = VelocityTask(FRAME, 0.1 * velocity, weights=[1, 1, 1, 0, 0, 0], hard=True)
    soft = VelocityTask(ARM.frame_names[4], velocity[::-1].copy())
    found = ENGINE.velocity_ik(Q, [hard, soft], dt=DT, damping=1e-2, velocity_limit=2.0)
    J, J_soft = ENGINE.jacobian(Q, FRAME)[:3], ENGINE.jacobian(Q, ARM.frame_names[4])

    def cost(v: Any) -> float:
        return float(0.5 * np.sum((J_soft @ v - velocity[::-1]) ** 2) + 0.5 * 1e-2 * v @ v)

    def gradient(v: Any) -> Any:
        return J_soft.T @ (J_soft @ v - velocity[::-1]) + 1e-2 * v

    equal = LinearConstraint(J, 0.1 * velocity[:3], 0.1 * velocity[:3])
    start = np.linalg.pinv(J) @ (0.1 * velocity[:3])
    expected = minimize(
        cost, start, jac=gradient, method="SLSQP", bounds=[(-2.0, 2.0)] * 7, constraints=equal,
        options={"ftol": 1e-14, "maxiter": 500},
    )  # fmt: skip
    assert found.success == bool(expected.success)
    if found:
        np.testing.assert_allclose(J @ found.v, 0.1 * velocity[:3], atol=1e-8)
        assert cost(found.v) <= expected.fun + 1e-7


@settings(max_examples=25)
@given(st.data())
def test_every_robot_keeps_its_limits_and_is_at_an_optimum(data: st.DataObject) -> None:
    """Karush, Kuhn and Tucker: the gradient vanishes but at a bound, where it presses against it."""
    model = data.draw(models(max_links=5))
    q = model.clip(data.draw(configurations(model, within_limits=True)))
    frame = data.draw(st.sampled_from(model.frame_names))
    velocity = data.draw(velocities)
    damping = 1e-2
    with backend("reference", model) as engine:
        found = engine.velocity_ik(q, VelocityTask(frame, velocity), dt=DT, damping=damping)
        J = engine.jacobian(q, frame)
    v = found.v
    assert (np.abs(v) <= model.velocity_limit).all()
    after = model.integrate(q, DT * v)
    offset = 7 if model.floating else 0
    slack = 1e-12 * (1.0 + np.abs(q[offset:]))
    assert (after[offset:] >= model.lower[offset:] - slack).all()
    assert (after[offset:] <= model.upper[offset:] + slack).all()
    gradient = J.T @ (J @ v - velocity) + damping * v
    accuracy = 1e-8 * (1.0 + np.abs(J).max(initial=0.0)) ** 2
    assert (np.abs(gradient[~found.limited]) <= accuracy).all()
    unlimited = np.full(model.nv, np.inf)
    lower, upper = velocity_bounds(model, q, DT, model.velocity_limit, unlimited, None)
    assert (gradient[v > lower + AT_BOUND] <= accuracy).all()
    assert (gradient[v < upper - AT_BOUND] >= -accuracy).all()


def test_a_joint_brakes_before_its_limit_within_its_acceleration() -> None:
    q, v, acceleration = Q.copy(), np.zeros(7), 2.0
    task = VelocityTask(FRAME, [0.0, 0.0, 0.0, 0.0, 0.0, 50.0])
    for _ in range(400):
        found = ENGINE.velocity_ik(
            q, task, dt=DT, acceleration_limit=acceleration, v0=v, velocity_limit=3.0, damping=1e-2
        )
        assert (np.abs(found.v - v) <= acceleration * DT * (1.0 + 1e-9) + 1e-12).all()
        v = found.v
        q = q + DT * v
        assert (q >= ARM.lower - 1e-12).all()
        assert (q <= ARM.upper + 1e-12).all()


@pytest.mark.parametrize("acceleration", [None, 4.0])
def test_joints_outside_their_limits_are_brought_back(acceleration: float | None) -> None:
    """At the velocity limit, without overshoot, before a hard task that would keep them there."""
    outside = np.zeros(7)
    outside[[0, 3]] = 0.5, -0.2
    q = np.where(outside < 0.0, ARM.lower, np.where(outside > 0.0, ARM.upper, Q)) + outside
    still = VelocityTask(FRAME, hard=True)
    first = ENGINE.velocity_ik(q, still, dt=DT, velocity_limit=1.5)
    np.testing.assert_array_equal(first.v[[0, 3]], [-1.5, 1.5])
    assert first.limited[[0, 3]].all()
    joints = ARM.joint_names
    assert (
        first.note == f"q is outside the position limits [rad or m]: {joints[0]} by 0.5, {joints[3]} by 0.2"
    )
    v = np.zeros(7)
    options: dict[str, Any] = {} if acceleration is None else {"acceleration_limit": acceleration}
    for _ in range(150):
        if acceleration is not None:
            options["v0"] = v
        v = ENGINE.velocity_ik(q, still, dt=DT, velocity_limit=1.5, **options).v
        assert (np.abs(v) <= 1.5).all()
        q = q + DT * v
    assert (q >= ARM.lower - 1e-5).all()
    assert (q <= ARM.upper + 1e-5).all()
    assert ENGINE.velocity_ik(ARM.clip(q), still, dt=DT).note == ""


def test_a_task_without_a_velocity_holds_the_frame_still() -> None:
    found = ENGINE.velocity_ik(Q, VelocityTask(FRAME), dt=DT)
    np.testing.assert_allclose(found.v, 0.0, atol=ROUNDING)


def test_a_pose_object_is_a_target() -> None:
    pose = Pose((0.3, 0.1, 0.4), (0.1, 0.2, 0.3))
    found, expected = (
        ENGINE.velocity_ik(Q, VelocityTask(FRAME, target=target), dt=DT).v for target in (pose, pose.matrix)
    )
    np.testing.assert_array_equal(found, expected)


def test_the_time_of_a_step_is_needed() -> None:
    options: dict[str, Any] = {}
    with pytest.raises(ArgumentError, match="velocity_ik needs dt="):
        ENGINE.velocity_ik(Q, VelocityTask(FRAME), **options)


def test_a_pose_is_approached_at_the_rate_of_its_gain() -> None:
    q = Q.copy()
    T = ENGINE.forward_kinematics(Q + 0.05, FRAME)
    start = np.linalg.norm(T[:3, 3] - ENGINE.forward_kinematics(q, FRAME)[:3, 3])
    for _ in range(100):
        q = q + DT * ENGINE.velocity_ik(q, VelocityTask(FRAME, target=T, gain=2.0), dt=DT, damping=1e-9).v
    end = np.linalg.norm(T[:3, 3] - ENGINE.forward_kinematics(q, FRAME)[:3, 3])
    assert end / start == pytest.approx(np.exp(-2.0), rel=0.1)


def test_a_posture_moves_what_the_task_leaves_free() -> None:
    task = VelocityTask(FRAME, np.zeros(6), hard=True)
    found = ENGINE.velocity_ik(Q, task, dt=DT, posture=Q + 0.2, posture_weight=1.0)
    J = ENGINE.jacobian(Q, FRAME)
    N = np.eye(7) - np.linalg.pinv(J) @ J
    np.testing.assert_allclose(found.v, N @ np.full(7, 0.2), atol=1e-5)


def test_hard_tasks_that_contradict_each_other_are_met_as_well_as_possible() -> None:
    up = [VelocityTask(FRAME, [0, 0, s, 0, 0, 0], weights=[0, 0, 1, 0, 0, 0], hard=True) for s in (0.1, -0.3)]
    found = ENGINE.velocity_ik(Q, up, dt=DT)
    assert not found
    assert (ENGINE.jacobian(Q, FRAME) @ found.v)[2] == pytest.approx(-0.1, abs=1e-6)
    assert [error.shape for error in found.errors] == [(1,), (1,)]


@pytest.mark.parametrize(
    ("task", "options", "error", "message"),
    [
        (VelocityTask("flang"), {}, UnknownNameError, "flang"),
        (VelocityTask(FRAME, np.zeros(5)), {}, ShapeError, "velocity"),
        (VelocityTask(FRAME, weights=-1.0), {}, ArgumentError, "weights"),
        (VelocityTask(FRAME, target=np.eye(4), gain=-1.0), {}, ArgumentError, "gain"),
        (VelocityTask(FRAME, target=np.zeros((2, 3))), {}, ShapeError, "target"),
        (None, {}, ArgumentError, "tasks is 'None'; wanted dynx.ik.velocity.VelocityTask"),
        ([None], {}, ArgumentError, "tasks has 'None'"),
        ("flange", {}, ArgumentError, "wanted dynx.ik.velocity.VelocityTask"),
        (VelocityTask(FRAME), {"damping": 0.0}, ArgumentError, "damping"),
        (VelocityTask(FRAME), {"v0": np.zeros(7)}, ArgumentError, "acceleration_limit"),
        (VelocityTask(FRAME), {"velocity_limit": [1.0]}, ShapeError, "velocity_limit"),
        (VelocityTask(FRAME), {"posture": np.zeros(3)}, ShapeError, "posture"),
        (VelocityTask(FRAME), {"dt": -1.0}, ArgumentError, "dt"),
        (
            VelocityTask(FRAME),
            {"dampin": 1.0},
            UnknownNameError,
            "velocity_ik has .*; did you mean 'damping'",
        ),
    ],
)
def test_invalid_arguments_raise(
    task: Any, options: dict[str, Any], error: type[Exception], message: str
) -> None:
    with pytest.raises(error, match=message):
        ENGINE.velocity_ik(Q, task, **{"dt": DT, **options})


def test_a_misspelt_field_of_a_task_has_the_nearest_name() -> None:
    misspelt: dict[str, Any] = {"weight": 2.0}
    with pytest.raises(UnknownNameError, match="VelocityTask has no option 'weight'; did you mean 'weights'"):
        VelocityTask(FRAME, **misspelt)


def test_without_the_solver_the_error_names_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "daqp", None)
    with pytest.raises(NotInstalledError, match=r"needs daqp: pip install '\S*\[qp\]'"):
        ENGINE.velocity_ik(Q, VelocityTask(FRAME), dt=DT)


CURVATURE = 0.5 * DT**2 * 1.5**2
"""What a step neglects of a distance [m]: half of the square of dt times that of the speed (1.5 rad/s) times
the reach (1 m)."""
FRAMES = {"ur5": "ee_link", "panda": "panda_hand"}
STARTS = {
    "ur5": np.array([0.0, -1.3, 1.6, -1.9, -np.pi / 2, 0.0]),
    "panda": np.array([0.0, 0.3, 0.0, -1.8, 0.0, 2.1, 0.8, 0.02]),
}


def cell(name: str, y: float = -0.325) -> Scene:
    """Return an arm on a table beside a wall, whose face is at y [m]."""
    return scene(name, box("wall", (0.6, 0.05, 0.8), pose=Pose((0.5, y - 0.025, 0.4))))


def to_wall(described: Scene, q: Floats) -> float:
    """Return the distance of the Panda from the wall [m]."""
    avoidance = described.avoidance(margin=0.0)
    near = avoidance.near(engine("panda"), q, 1.0)
    return min(each.separation.lower for each in near if "wall" in avoidance.names(each.pair))


def run(
    name: str, avoidance: Avoidance | None, target: Floats, steps: int, **options: Any
) -> tuple[Floats, list[VelocityResult]]:
    """Return the configurations of a motion towards a target, and the results of its steps."""
    q, configurations, results = STARTS[name], [STARTS[name]], []
    task = VelocityTask(FRAMES[name], target=target, gain=4.0)
    for _ in range(steps):
        found = engine(name).velocity_ik(q, task, dt=DT, avoid=avoidance, **options)
        q = q + DT * found.v
        configurations.append(q)
        results.append(found)
    return np.array(configurations), results


@pytest.mark.parametrize("name", FRAMES)
def test_the_margin_is_kept_on_the_way_into_an_obstacle(name: str) -> None:
    """The target is in the wall: the arm stops before it, where it otherwise runs into it."""
    described, kinematics = cell(name), engine(name)
    avoidance = described.avoidance(margin=0.02)
    target = kinematics.forward_kinematics(STARTS[name], FRAMES[name])
    target[:3, 3] = 0.5, -0.35, 0.3
    plain, _ = run(name, None, target, 80)
    safe, results = run(name, avoidance, target, 80)
    with World(described, "mujoco") as world:
        assert min(least_room(world, avoidance, q) for q in plain[::4]) < -0.02
        rooms = [least_room(world, avoidance, q) for q in safe]
    assert min(rooms) >= -ENGINE_ERROR
    assert rooms[-1] <= 5e-3
    assert any("wall" in pair for pair in results[-1].held_back)
    assert not any(found.too_fast for found in results)
    assert all(found.success for found in results)


HANDS = {
    "plate": ('<box size="0.1 0.2 0.1"/>', "0 0 0"),
    "cube": ('<box size="0.2 0.2 0.1"/>', "0 0 0"),
    "disc": ('<cylinder radius="0.1" length="0.1"/>', "0 0 0"),
    "upright disc": ('<cylinder radius="0.1" length="0.1"/>', "0 1.5707963 0"),
    "rod": ('<cylinder radius="0.03" length="0.3"/>', "1.5707963 0 0"),
}
"""Shapes and their axes, of which faces, edges or rims meet a wall."""


def slide(hand: str) -> Model:
    """Return a hand that moves along x and turns about z at up to 2 rad/s."""
    (shape, rpy), limit = HANDS[hand], '<limit lower="-2" upper="2" velocity="{}" effort="10"/>'
    return load(f"""<robot name="slide"><link name="rail"/><link name="carriage"/>
      <link name="hand"><collision><origin rpy="{rpy}"/><geometry>{shape}</geometry></collision></link>
      <joint name="x" type="prismatic"><parent link="rail"/><child link="carriage"/><axis xyz="1 0 0"/>
      {limit.format(1)}</joint>
      <joint name="yaw" type="revolute"><parent link="carriage"/><child link="hand"/><axis xyz="0 0 1"/>
      {limit.format(2)}</joint></robot>""")


@pytest.mark.parametrize("dt", [0.001, 0.01, 0.2])
@pytest.mark.parametrize("yaw", [0.0, 0.3])
@pytest.mark.parametrize("hand", HANDS)
def test_a_face_that_meets_a_face_keeps_the_margin(hand: str, yaw: float, dt: float) -> None:
    """Several points of a face are nearest at once, or change from step to step."""
    model = slide(hand)
    wall = box("wall", (0.2, 2.0, 1.0), pose=Pose((0.6, 0.0, 0.0)))
    avoidance = Scene("wall", robots=[SceneRobot("arm", model)], bodies=[wall]).avoidance(margin=0.02)
    kinematics = backend("reference", model)
    q, gaps = np.array([0.3, yaw]), list[float]()
    (start,) = avoidance.near(kinematics, q, 0.5)
    q[0] += start.separation.lower - 0.025
    task, held_back = VelocityTask("hand", target=[0.8, 0.0, 0.0], gain=4.0), set[frozenset[str]]()
    for _ in range(60):
        found = kinematics.velocity_ik(q, task, dt=dt, avoid=avoidance)
        assert not found.too_fast
        held_back |= {frozenset(pair) for pair in found.held_back}
        q = model.integrate(q, dt * found.v)
        gaps += [each.separation.lower for each in avoidance.near(kinematics, q, 0.5)]
    assert min(gaps) >= 0.02
    assert gaps[-1] < 0.025
    assert held_back == {frozenset({"wall", "arm/hand"})}


def test_bodies_that_are_too_close_part() -> None:
    """From within the margin the distance grows back at the rate of the gain."""
    described, panda = cell("panda", -0.13), engine("panda")
    task = VelocityTask("panda_hand")
    q = STARTS["panda"]
    avoidance = described.avoidance(margin=to_wall(described, q) + 0.03, self_margin=0.0)
    lacks = []
    for _ in range(40):
        violated = avoidance.violated(panda, q)
        lacks.append(max([0.0, *(each.pair.margin - each.separation.lower for each in violated)]))
        found = panda.velocity_ik(q, task, dt=DT, avoid=avoidance, avoid_gain=10.0)
        assert not found.too_fast
        q = q + DT * found.v
    assert lacks[0] == pytest.approx(0.03)
    assert lacks[-1] <= 0.05 * lacks[0]
    for before, after in pairwise(lacks):
        assert after <= (1.0 - 10.0 * DT) * before + CURVATURE


def test_dampers_come_before_hard_tasks() -> None:
    described, panda = cell("panda"), engine("panda")
    avoidance = described.avoidance(margin=0.02)
    down = VelocityTask("panda_hand", velocity=[0.0, -2.0, 0.0, 0.0, 0.0, 0.0], hard=True)
    q = STARTS["panda"]
    outcomes = []
    for _ in range(40):
        found = panda.velocity_ik(q, down, dt=DT, velocity_limit=10.0, avoid=avoidance)
        outcomes.append(found.success)
        q = q + DT * found.v
    assert outcomes[0]
    assert not outcomes[-1]
    assert min(each.separation.lower - each.pair.margin for each in avoidance.near(panda, q, 0.1)) > -2e-3


def test_pairs_that_cannot_part_are_named() -> None:
    """With acceleration limits a robot that flies towards the wall cannot stop at once."""
    described, panda = cell("panda", -0.13), engine("panda")
    q = STARTS["panda"]
    toward = panda.velocity_ik(
        q, VelocityTask("panda_hand", velocity=[0.0, -2.0, 0.0, 0.0, 0.0, 0.0]), dt=DT, velocity_limit=10.0
    )
    found = panda.velocity_ik(
        q,
        VelocityTask("panda_hand"),
        dt=DT,
        velocity_limit=10.0,
        acceleration_limit=1.0,
        v0=toward.v,
        avoid=described.avoidance(margin=to_wall(described, q), self_margin=0.0),
    )
    assert found.too_fast
    assert all("wall" in pair for pair in found.too_fast)
    # The last joints brake before their limits.
    assert (np.abs(found.v - toward.v)[:6] <= 0.01 + 1e-12).all()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"avoid": "wall"}, "wanted a dynx.world.Scene or World"),
        ({"avoid_gain": 200.0}, "at most 1 / dt = 100"),
    ],
    ids=["avoid", "gain"],
)
def test_invalid_arguments(options: dict[str, Any], message: str) -> None:
    arguments: dict[str, Any] = {"avoid": cell("panda"), **options}
    with pytest.raises(ArgumentError, match=message):
        engine("panda").velocity_ik(STARTS["panda"], VelocityTask("panda_hand"), dt=DT, **arguments)
    assert arm("panda").nq == 8
