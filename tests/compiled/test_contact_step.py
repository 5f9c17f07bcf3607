"""The step with contacts: against floats, a dense computation, 50 digits, and laws of mechanics."""

from __future__ import annotations

import math
from functools import cache
from typing import Any

import numpy as np
import pytest

import dynx
from dynx.compiled.contact_step import contact_step_text
from dynx.compiled.step import compiled
from dynx.errors import UnsupportedFeatureError
from dynx.model import Model
from dynx.rbd.constraints import ConstraintSets, Disk, displacement_velocity, opening_velocity, solve
from dynx.rbd.contact_step import (
    LEVEL,
    Axes,
    ServoJoints,
    ShapesOnPlane,
    Sweeps,
    contact_step,
    spheres_on_plane,
)
from dynx.rbd.displacement import floating_displacement, floating_end_velocity
from dynx.spatial.scalar import Floats
from tests.rbd.exact import exact_mechanism, exactly, fifty_digits

H, KP, KD, FRICTION, RADIUS = 1e-3, 100.0, 2.0, 0.7, 0.02
FEET = ("FR_foot", "FL_foot", "RR_foot", "RL_foot")
STANCE = np.tile([0.0, 0.9, -1.8], 4)
TIGHT = Sweeps(tolerance=1e-12, most=400)
SLOPE = 0.5
SLOPING = (
    (-SLOPE / math.hypot(1.0, SLOPE), 0.0, 1.0 / math.hypot(1.0, SLOPE)),
    (1.0 / math.hypot(1.0, SLOPE), 0.0, SLOPE / math.hypot(1.0, SLOPE)),
    (0.0, 1.0, 0.0),
)


@cache
def a1() -> Model:
    return dynx.load("a1", base="floating")


def text_of(model: Model, **options: Any) -> Any:
    plane = options.pop("axes", LEVEL)
    return contact_step_text(model, feet(model, plane), **{"h": H, "kp": KP, "kd": KD, **options})


def feet(model: Model, axes: Axes = LEVEL) -> ShapesOnPlane:
    return spheres_on_plane({model.frame_index(foot): RADIUS for foot in FEET}, FRICTION, axes)


def states(n: int, seed: int = 0) -> tuple[Floats, Floats, Floats, Floats]:
    """Return random states near the ground: q, v, targets, impulses."""
    rng = np.random.default_rng(seed)
    q = np.tile(a1().neutral(), (n, 1))
    q[:, :3] = rng.uniform(-0.3, 0.3, (n, 3))
    q[:, 2] = rng.uniform(0.24, 0.30, n)
    q[:, 3:6] = rng.uniform(-0.15, 0.15, (n, 3))
    q[:, 3:7] /= np.linalg.norm(q[:, 3:7], axis=1, keepdims=True)
    q[:, 7:] = STANCE + rng.uniform(-0.3, 0.3, (n, 12))
    v = rng.uniform(-1.0, 1.0, (n, 18))
    return q, v, STANCE + rng.uniform(-0.3, 0.3, (n, 12)), rng.uniform(0.0, 0.05, (n, 12))


def steps(kernel: Any, *arrays: Floats) -> list[Floats]:
    """Return q, v, impulses and residual after a step of states (n, ...)."""
    found = [np.empty((len(arrays[0]), port.size)) for port in kernel.outputs]
    kernel(list(arrays), found)
    return found


def dense_step(q: Floats, v: Floats, target: Floats) -> tuple[Floats, Floats, Floats]:
    """Return q, v and impulses after a step, from mass matrix, bias and Jacobians of `reference` in the axes
    of the world, which do not rotate."""
    model, robot = a1(), dynx.backend("reference", a1())
    M = robot.mass_matrix(q) + np.diag([0.0] * 6 + [H * KD + H * H * KP] * 12)
    motors = np.concatenate([np.zeros(6), KP * (target - q[7:] - H * v[6:]) - KD * v[6:]])
    free = np.linalg.solve(M, motors - robot.bias_torque(q, v))
    rows, gaps = [], []
    for foot in FEET:
        T = robot.forward_kinematics(q, foot)
        gap = T[2, 3] - RADIUS
        point = T[:3, :3].T @ np.array([0.0, 0.0, -RADIUS - 0.5 * gap])
        J = robot.jacobian(q, foot, point=point)[:3]
        rows.append(J[[2, 0, 1]])
        gaps.append(gap)
    J = np.concatenate(rows)
    # The velocity of the base's origin in axes that do not rotate, from its components in the base's axes.
    center = model.mechanism.root_center
    u = floating_end_velocity(v, free, H, center)
    c = J @ u
    c[::3] += [opening_velocity(gap, H) for gap in gaps]
    disks = tuple(Disk((3 * k + 1, 3 * k + 2), 3 * k) for k in range(4))
    sets = ConstraintSets(12, unilateral=(0, 3, 6, 9), disks=disks)
    G = J @ np.linalg.solve(M, J.T)
    found = solve(sets, G, c, np.full(4, FRICTION))
    w = u + np.linalg.solve(M, J.T @ found.impulses)
    wanted = np.zeros(12)
    wanted[::3] = [displacement_velocity(gap, each, H) for gap, each in zip(gaps, (J @ w)[::3], strict=True)]
    back = solve(sets, G, wanted, np.zeros(4)).impulses
    q, v = floating_displacement(q, w + np.linalg.solve(M, J.T @ back), w, H, center)
    return q, v, found.impulses


def test_a_step_is_that_of_dense_matrices() -> None:
    kernel = compiled(text_of(a1(), sweeps=TIGHT))
    q, v, target, impulses = states(24)
    found = steps(kernel, q, v, target, impulses)
    assert 0 < np.count_nonzero(found[2][:, ::3]) < found[2][:, ::3].size
    for k in range(len(q)):
        for mine, wanted in zip(found, dense_step(q[k], v[k], target[k]), strict=False):
            np.testing.assert_allclose(mine[k], wanted, rtol=0.0, atol=1e-9)


def test_floats_and_fifty_digits_agree_with_the_kernel() -> None:
    model = a1()
    text = text_of(model, sweeps=TIGHT)
    kernel = compiled(text)
    given = [each[:1] for each in states(3, seed=2)]
    found = steps(kernel, *given)
    assert np.count_nonzero(found[2][0, ::3]) >= 2
    names = ("q", "v", "target", "impulses")
    on_floats = text.function(**dict(zip(names, (each[0] for each in given), strict=True)))
    for mine, wanted in zip(found, on_floats.values(), strict=True):
        np.testing.assert_allclose(mine[0], np.asarray(wanted, dtype=float), rtol=0.0, atol=1e-9)
    touching = feet(model)
    zero = np.zeros(12)
    joints = ServoJoints(np.full(12, KP), np.full(12, KD), zero, zero)
    with fifty_digits():
        q, v, target, impulses = (exactly(each[0]) for each in given)
        found_exactly = contact_step(
            exact_mechanism(model), joints, touching, TIGHT, H, q, v, target, impulses
        )
        for mine, wanted in zip(found, found_exactly.values(), strict=True):
            np.testing.assert_allclose(mine[0], np.asarray(wanted, dtype=float), rtol=0.0, atol=1e-9)


def test_a_robot_has_the_same_bits_alone_and_in_any_batch() -> None:
    kernel = compiled(text_of(a1()))
    given = states(45)
    whole = steps(kernel, *given)
    order = np.random.default_rng(1).permutation(45)
    for a, b in zip(whole, steps(kernel, *(each[order] for each in given)), strict=True):
        assert np.array_equal(a[order], b)
    for k in (0, 7, 21, 44):
        for a, b in zip(whole, steps(kernel, *(each[k : k + 1] for each in given)), strict=True):
            assert np.array_equal(a[k : k + 1], b)
    assert whole[3].max() <= 1e-6


def test_a_robot_that_diverges_changes_no_other() -> None:
    kernel = compiled(text_of(a1()))
    given = states(16)
    clean = steps(kernel, *given)
    given[1][5, 8] = np.nan
    found = steps(kernel, *given)
    others = np.arange(16) != 5
    for a, b in zip(found, clean, strict=True):
        assert np.array_equal(a[others], b[others])
    assert np.isnan(found[1][5]).any()


def rested(kernel: Any, seconds: float, height: float) -> list[Floats]:
    """Return the last state of two robots that settle from the stance."""
    q = np.tile(a1().neutral(), (2, 1))
    q[:, 2], q[:, 7:] = height, STANCE
    state = [q, np.zeros((2, 18)), np.zeros((2, 12))]
    target = np.tile(STANCE, (2, 1))
    for _ in range(round(seconds / H)):
        *state, _ = steps(kernel, state[0], state[1], target, state[2])
    return state


def test_motors_have_a_largest_torque() -> None:
    """Motors that exceed it by the law at the end of the step have the limit; others obey the law."""
    model, limit = a1(), 20.0
    q, v, target, _ = states(40, seed=5)
    q[:, 2], none = 1.0, np.zeros((40, 12))
    found = steps(compiled(text_of(model, max_torque=limit)), q, v, target, none)
    robot = dynx.backend("reference", model)
    K, slack = np.full(12, H * KD + H * H * KP), []
    for k in range(len(q)):
        M, bias = robot.mass_matrix(q[k]), robot.bias_torque(q[k], v[k])
        motors = KP * (target[k] - q[k, 7:] - H * v[k, 6:]) - KD * v[k, 6:]

        def solution(motors: Floats, K: Floats, M: Floats = M, bias: Floats = bias) -> Floats:
            rest = np.concatenate([np.zeros(6), motors]) - bias
            return np.asarray(np.linalg.solve(M + np.diag([0.0] * 6 + [*K]), rest))

        wanted = motors - K * solution(motors, K)[6:]
        over = np.abs(wanted) >= limit
        a = solution(np.where(over, np.clip(wanted, -limit, limit), motors), np.where(over, 0.0, K))
        np.testing.assert_allclose(found[1][k, 6:], v[k, 6:] + H * a[6:], rtol=0.0, atol=1e-9)
        slack.append(over)
    assert 0.1 < np.mean(slack) < 0.9
    free = steps(compiled(text_of(model)), q, v, target, none)
    loose = steps(compiled(text_of(model, max_torque=1e6)), q, v, target, none)
    for a, b in zip(free, loose, strict=True):
        np.testing.assert_allclose(a, b, rtol=0.0, atol=1e-12)


def test_standing_on_a_plane_and_on_a_slope() -> None:
    """The forces sum to the weight, and nothing creeps within the cone of friction (tan 0.5 < 0.7)."""
    weight = float(a1().total_mass) * 9.81
    stiff = {"kp": 400.0, "kd": 20.0}
    flat = rested(compiled(text_of(a1(), **stiff)), 6.0, 0.27)
    forces = flat[2][0].reshape(4, 3) / H
    assert abs(forces[:, 0].sum() / weight - 1.0) < 1e-6
    assert np.abs(flat[1]).max() < 1e-9
    slope = compiled(text_of(a1(), axes=SLOPING, **stiff))
    state = rested(slope, 6.0, 0.30)
    total = np.einsum("k,ki->i", np.ones(4), state[2][0].reshape(4, 3)) @ np.array(SLOPING) / H
    np.testing.assert_allclose(total, [0.0, 0.0, weight], atol=1e-6 * weight)
    assert np.abs(state[1]).max() < 1e-9


def test_a_box_slides_in_any_direction_and_stops() -> None:
    """Coulomb's law: the deceleration is mu g, the way v^2 / (2 mu g) - v h / 2; then the box rests."""
    mu, directions = 0.5, np.arange(8) * np.pi / 4.0
    inertia = "<inertia ixx='0.04' iyy='0.05' izz='0.08' ixy='0.001' ixz='0' iyz='0'/>"
    parts = [f"<link name='box'><inertial><mass value='3'/>{inertia}</inertial></link>"]
    for number, (x, y) in enumerate(((0.2, 0.2), (0.2, -0.2), (-0.2, 0.2), (-0.2, -0.2))):
        ends = f"<parent link='box'/><child link='c{number}'/><origin xyz='{x} {y} -0.05'/>"
        parts.append(f"<link name='c{number}'/><joint name='j{number}' type='fixed'>{ends}</joint>")
    model = dynx.load(f"<robot name='box'>{''.join(parts)}</robot>", base="floating")
    corners = spheres_on_plane({model.frame_index(f"c{number}"): 0.01 for number in range(4)}, mu)
    kernel = compiled(contact_step_text(model, corners, h=H, kp=0.0, kd=0.0))
    start = np.tile(model.neutral(), (8, 1))
    start[:, 2] = 0.06
    v = np.zeros((8, 6))
    v[:, 0], v[:, 1] = np.cos(directions), np.sin(directions)
    state = [start, v, np.zeros((8, 12))]
    for step in range(300):
        *state, residual = steps(kernel, state[0], state[1], np.zeros((8, 0)), state[2])
        assert residual.max() <= 1e-6
        if step == 99:
            slower = 1.0 - np.linalg.norm(state[1][:, :2], axis=1)
            np.testing.assert_allclose(slower / (100 * H), mu * 9.81, rtol=1e-12)
    way = np.linalg.norm(state[0][:, :2] - start[:, :2], axis=1)
    np.testing.assert_allclose(way, 1.0 / (2.0 * mu * 9.81) - 0.5 * H, rtol=1e-5)
    assert np.abs(state[1]).max() < 1e-12


def walker_on_soles() -> tuple[Model, ShapesOnPlane]:
    """Return a body on two legs, of two joints each with dry friction, and four points under each foot."""

    def link(name: str, mass: float, size: float) -> str:
        moments = " ".join(f"{axis}='{mass * size * size}'" for axis in ("ixx", "iyy", "izz"))
        inertia = f"<inertia {moments} ixy='0' ixz='0' iyz='0'/>"
        return f"<link name='{name}'><inertial><mass value='{mass}'/>{inertia}</inertial></link>"

    def joint(parent: str, child: str, xyz: str, law: str) -> str:
        ends = f"<parent link='{parent}'/><child link='{child}'/><origin xyz='{xyz}'/>"
        return f"<joint name='{child}_joint' {law.replace('>', f'>{ends}', 1)}</joint>"

    loose = "<limit effort='99' velocity='99'/><dynamics friction='0.05'/>"
    pitch, roll = (f"type='continuous'><axis xyz='{axis}'/>{loose}" for axis in ("0 1 0", "1 0 0"))
    parts, points = [link("body", 20.0, 0.2)], []
    for side, y in (("left", 0.1), ("right", -0.1)):
        leg, foot = f"{side}_leg", f"{side}_foot"
        parts += [link(leg, 3.0, 0.1), joint("body", leg, f"0 {y} -0.1", pitch)]
        parts += [link(foot, 1.0, 0.05), joint(leg, foot, "0 0 -0.4", roll)]
        for number, (dx, dy) in enumerate(((0.1, 0.04), (0.1, -0.04), (-0.06, 0.04), (-0.06, -0.04))):
            point = f"{foot}_{number}"
            parts += [f"<link name='{point}'/>", joint(foot, point, f"{dx} {dy} -0.04", "type='fixed'>")]
            points.append(point)
    model = dynx.load(f"<robot name='walker'>{''.join(parts)}</robot>", base="floating")
    return model, spheres_on_plane({model.frame_index(point): 0.01 for point in points}, FRICTION)


def test_redundant_points_of_soles_and_dry_friction_of_joints_obey_the_laws() -> None:
    """The default sweeps end with residuals of at most 1e-6 m/s: in every step of robots that stand, and in
    all but a few of ten thousand of robots that slide, turn and fall, which the residual tells."""
    model, soles = walker_on_soles()
    kernel = compiled(contact_step_text(model, soles, h=H, kp=400.0, kd=8.0))
    n, rng = 64, np.random.default_rng(0)
    q = np.tile(model.neutral(), (n, 1))
    q[:, 2] = 0.55
    v = np.zeros((n, 10))
    v[16:, :2] = rng.uniform(-1.0, 1.0, (n - 16, 2))
    v[32:, 5] = rng.uniform(-2.0, 2.0, n - 32)
    state = [q, v, np.zeros((n, 8 * 3 + 4))]
    target = 0.1 * rng.uniform(-1.0, 1.0, (n, 4))
    target[:16] = 0.0
    missed = 0
    for _ in range(400):
        *state, residual = steps(kernel, state[0], state[1], target, state[2])
        assert residual[:16].max() <= 1e-6
        missed += int((residual[16:] > 1e-6).sum())
    assert missed <= 5e-4 * 400 * (n - 16)
    weight = 28.0 * 9.81
    np.testing.assert_allclose(state[2][:16, :24:3].sum(axis=1) / H, weight, rtol=1e-6)


def test_a_fixed_base_and_prismatic_joints() -> None:
    """A ball on a vertical slide without a motor falls, lands, and bears its weight."""
    inertia = "<inertia ixx='1' iyy='1' izz='1' ixy='0' ixz='0' iyz='0'/>"
    ball = f"<link name='ball'><inertial><mass value='2'/>{inertia}</inertial></link>"
    slide = (
        "<joint name='slide' type='prismatic'><parent link='base'/><child link='ball'/><axis xyz='0 0 1'/>"
        "<limit lower='-9' upper='9' effort='9' velocity='9'/></joint>"
    )
    model = dynx.load(f"<robot name='slider'><link name='base'/>{ball}{slide}</robot>")
    touching = spheres_on_plane({model.frame_index("ball"): 0.1}, 0.5)
    kernel = compiled(contact_step_text(model, touching, h=H, kp=0.0, kd=0.0))
    state = [np.array([[0.15]]), np.zeros((1, 1)), np.zeros((1, 3))]
    for step in range(200):
        *state, residual = steps(kernel, state[0], state[1], np.zeros((1, 1)), state[2])
        if step == 50:
            np.testing.assert_allclose(state[1], -9.81 * 51 * H, rtol=1e-12)
        assert residual.max() <= 1e-6
    np.testing.assert_allclose(state[0], 0.1, atol=1e-12)
    np.testing.assert_allclose(state[2][0] / H, [2.0 * 9.81, 0.0, 0.0], atol=1e-9)


def test_robots_that_the_step_lacks_are_refused_by_name() -> None:
    with pytest.raises(UnsupportedFeatureError, match="mimic joints"):
        contact_step_text(dynx.load("panda"), ShapesOnPlane(()), h=H, kp=1.0, kd=1.0)
