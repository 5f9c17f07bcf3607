"""Robots: their families, named branches, singular poses, and the options of `inverse_kinematics`."""

from __future__ import annotations

import numpy as np
import pytest

from dynx.backends import Backend, backend
from dynx.errors import ArgumentError
from dynx.ik import IKResult, IKSolutions, closed_form
from dynx.model import Model
from dynx.model.loading import load
from dynx.spatial.scalar import Floats
from dynx.spatial.so3 import cross
from tests.ik.closed_forms.arms import angle_difference, pose_difference
from tests.oracles.closed_form import MODELS

UR5 = load("ur5")
SIX_AXIS_ARM = load(MODELS / "six_axis_arm.urdf")
SEVEN_AXIS_ARM = load(MODELS / "seven_axis_arm.urdf")
PANDA = load("panda")

ARMS: list[tuple[Model, str, dict[str, float]]] = [
    (UR5, "tool0", {}),
    (load("ur3"), "tool0", {}),
    (load("ur10_limited"), "tool0", {}),
    (SIX_AXIS_ARM, "flange", {}),
    (SEVEN_AXIS_ARM, SEVEN_AXIS_ARM.links[-1].name, {SEVEN_AXIS_ARM.joint_names[2]: 0.4}),
    (PANDA, "panda_hand_tcp", {"panda_joint7": 0.3}),
    (PANDA, "panda_hand_tcp", {"panda_joint5": -0.6}),
    (load("talos_arm"), "arm_left_7_link", {}),
    (load(MODELS / "scara.urdf"), "tip", {}),
    (load(MODELS / "planar_3r.urdf"), "tip", {}),
    (load("tiago"), "arm_7_link", {"torso_lift_joint": 0.2, "arm_1_joint": 0.4}),
    (load("tiago"), "arm_7_link", {"arm_1_joint": 0.4, "arm_2_joint": -0.3}),
]


def solutions(result: IKResult) -> IKSolutions:
    assert isinstance(result, IKSolutions)
    return result


@pytest.mark.parametrize(("model", "frame", "given"), ARMS, ids=lambda each: getattr(each, "name", None))
def test_the_configuration_that_made_a_pose_is_among_the_solutions(
    model: Model, frame: str, given: dict[str, float]
) -> None:
    rng = np.random.default_rng(0)
    q = np.array([model.random(rng) for _ in range(50)])
    for joint, value in given.items():
        q[:, model.coordinate_index(joint)] = value
    with backend("reference", model) as engine:
        T = engine.forward_kinematics(q, frame)
        found = solutions(engine.inverse_kinematics(T, frame, q, all_solutions=True, given=given))
    with backend("pinocchio", model) as engine:
        reached = engine.forward_kinematics(found.q, frame)
    assert (pose_difference(reached, T[:, None])[found.success] < 1e-10).all()
    # Coordinates of other branches stay at q0, and angles are the ones nearest to it.
    distance = np.abs(found.q - q[:, None]).max(axis=-1)
    assert (distance.min(axis=1, where=found.success, initial=9.0) < 1e-5).all()


def axes_at(engine: Backend, q: Floats) -> tuple[Floats, Floats]:
    """Return the axes (6, 3) of an arm at q, and the origins (6, 3) of their joints' frames."""
    model = engine.model
    poses = [engine.forward_kinematics(q, joint.child) for joint in model.coordinate_joints]
    axes = [T[:3, :3] @ joint.axis for T, joint in zip(poses, model.coordinate_joints, strict=True)]
    return np.array(axes), np.array([T[:3, 3] for T in poses])


@pytest.mark.parametrize(
    ("model", "frame", "tips"),
    [(UR5, "tool0", (5, 3)), (SIX_AXIS_ARM, "flange", (4, 4))],
    ids=["ur5", "six_axis_arm"],
)
def test_branches_have_the_geometry_that_their_names_say(
    model: Model, frame: str, tips: tuple[int, int]
) -> None:
    rng = np.random.default_rng(2)
    form = closed_form(model, frame)
    with backend("reference", model) as engine:
        for _ in range(20):
            for q, branch in zip(
                *(lambda s: (s.q, s.branches))(
                    form.solve(engine.forward_kinematics(model.random(rng), frame))
                ),
                strict=True,
            ):
                h, p = axes_at(engine, q)
                right = cross(h[0], h[1])
                side = 1.0 if (p[tips[0]] - p[0]) @ right > 0.0 else -1.0
                plane = np.eye(3) - np.outer(h[1], h[1])
                above = h[1] @ cross(plane @ (p[tips[1]] - p[1]), plane @ (p[2] - p[1])) * side > 0.0
                flip = h[4] @ cross(h[3], h[5]) > 0.0
                assert branch == (
                    f"shoulder {'right' if side > 0.0 else 'left'}, elbow {'up' if above else 'down'}, "
                    f"wrist {'unflipped' if flip else 'flipped'}"
                )


def test_the_elbow_of_a_scara_arm_is_on_the_side_that_the_branch_names() -> None:
    scara = load(MODELS / "scara.urdf")
    with backend("compiled", scara) as engine:
        T = engine.forward_kinematics(np.array([0.4, -0.9, 0.05, 0.3]), "tip")
        found = solutions(engine.inverse_kinematics(T, "tip", all_solutions=True))
        assert sorted(found.branches) == ["elbow left", "elbow right"]
        for q, branch in found:
            _, points = axes_at(engine, q)
            forearm, tip = points[1] - points[0], T[:3, 3] - points[0]
            assert branch == ("elbow right" if cross(forearm, tip)[2] > 0.0 else "elbow left")
        # The arm reaches no pose that is tilted.
        tilt = np.array([[1.0, 0.0, 0.0], [0.0, 0.8, -0.6], [0.0, 0.6, 0.8]])
        T[:3, :3] = T[:3, :3] @ tilt
        assert not engine.inverse_kinematics(T, "tip", all_solutions=True)


def test_a_batch_has_one_row_for_each_branch() -> None:
    rng = np.random.default_rng(4)
    form = closed_form(UR5, "tool0")
    with backend("reference", UR5) as engine:
        T = engine.forward_kinematics(
            np.array([[UR5.random(rng) for _ in range(3)] for _ in range(2)]), "tool0"
        )
    T[1, 2, :3, 3] += 10.0
    found = form.solve(T)
    assert found.q.shape == (2, 3, 8, 6)
    assert found.branches == form.branches
    assert found.counts[1, 2] == 0
    assert (found.q[~found.success] == UR5.neutral()).all()
    for i, k in np.ndindex(2, 3):
        alone = form.solve(T[i, k])
        assert alone.branches == tuple(np.array(form.branches)[found.success[i, k]])
        assert angle_difference(alone.q, found.q[i, k][found.success[i, k]]).max(initial=0.0) < 1e-12


SINGULAR: list[tuple[Model, str, list[float], str]] = [
    (SIX_AXIS_ARM, "flange", [0.3, 0.5, -0.7, 0.4, 0.0, 0.2], "wrist"),
    (SIX_AXIS_ARM, "flange", [0.0, 0.0, 0.0, 0.0, 0.0, 0.0], "wrist"),
    (UR5, "tool0", [0.3, -0.5, 0.9, 0.4, 0.0, 0.2], "wrist"),
    (UR5, "tool0", [0.3, -2.0, 2.9, 0.4, 0.0, 1.9], "wrist"),
    (UR5, "tool0", [0.3, -0.5, 0.0, 0.4, 0.6, 0.2], "elbow"),
    (UR5, "tool0", [0.0, 0.0, 0.0, 0.0, 0.0, 0.0], "elbow and wrist"),
]


@pytest.mark.parametrize(("model", "frame", "q", "which"), SINGULAR)
def test_singular_poses_have_a_representative(model: Model, frame: str, q: list[float], which: str) -> None:
    with backend("reference", model) as engine:
        T = engine.forward_kinematics(q, frame)
        found = solutions(engine.inverse_kinematics(T, frame, all_solutions=True))
        reached = engine.forward_kinematics(found.q, frame)
    assert found
    assert (pose_difference(reached, T) < 1e-10).all()
    assert found.arbitrary.any() == ("wrist" in which)
    assert (found.arbitrary.sum(axis=-1) <= 1).all()
    if "wrist" not in which:
        assert angle_difference(found.q, np.array(q)).min() < 1e-5
    distances = angle_difference(found.q[:, None], found.q[None])
    assert (distances[~np.eye(len(found.q), dtype=bool)] > 1e-6).all()


def test_the_wrist_centre_on_the_first_axis() -> None:
    """The first angle is arbitrary: the wrist turns the other way."""
    arm = SIX_AXIS_ARM
    with backend("reference", arm) as engine:
        # Fold the arm until the wrist centre is above the base: bisection in joint 2.
        low, high = -2.5, 0.5
        for _ in range(200):
            middle = 0.5 * (low + high)
            q = np.array([0.7, middle, 0.4, 0.3, 0.8, -0.5])
            axes, points = axes_at(engine, q)
            outside = (points[4] - points[0]) @ cross(axes[1], axes[0]) > 0.0
            low, high = (low, middle) if outside else (middle, high)
        assert abs((points[4] - points[0]) @ cross(axes[1], axes[0])) < 1e-14
        T = engine.forward_kinematics(q, "flange")
        found = closed_form(arm, "flange").solve(T, ignore_limits=True)
        assert found
        assert (pose_difference(engine.forward_kinematics(found.q, "flange"), T) < 1e-10).all()


def test_a_position_at_its_limit_is_kept_within_it() -> None:
    q = np.array([0.3, -0.5, 0.9, 0.4, 0.8, 0.2])
    model = load("ur5_limited")
    with backend("reference", model) as engine:
        # Joint 5 is singular at its limits.
        for k in (0, 1, 2, 3, 5):
            for limit in (model.lower[k], model.upper[k]):
                at_limit = q.copy()
                at_limit[k] = limit
                T = engine.forward_kinematics(at_limit, "tool0")
                found = solutions(engine.inverse_kinematics(T, "tool0", at_limit, all_solutions=True))
                assert (found.q >= model.lower).all()
                assert (found.q <= model.upper).all()
                assert np.abs(found.q - at_limit).max(axis=-1).min() < 1e-6


@pytest.mark.parametrize("name", ["reference", "compiled"])
def test_full_turns_within_the_limits_are_counted_and_listed(name: str) -> None:
    q = np.array([0.3, -0.5, 0.9, 0.4, 0.8, 0.2])
    with backend(name, UR5) as engine:
        T = engine.forward_kinematics(q, "tool0")
        for _ in range(2):
            found = solutions(engine.inverse_kinematics(T, "tool0", all_solutions=True))
            assert (found.multiplicity == 2**5).all()  # the elbow has one turn
            assert "8 solutions, 256 with full turns" in found.message
        every = found.with_full_turns()
        reached = engine.forward_kinematics(every, "tool0")
        batch = solutions(engine.inverse_kinematics(T[None], "tool0", all_solutions=True))
    assert every.shape == (256, 6)
    assert (pose_difference(reached, T) < 1e-10).all()
    assert ((every >= UR5.lower) & (every <= UR5.upper)).all()
    assert len(np.unique(every.round(6), axis=0)) == 256
    assert batch.multiplicity.sum() == 256
    with pytest.raises(ArgumentError, match="several poses"):
        batch.with_full_turns()


def test_an_angle_at_zero_is_also_at_both_limits_of_two_turns() -> None:
    with backend("reference", UR5) as engine:
        T = engine.forward_kinematics([0.0, -0.5, 0.9, 0.4, 0.8, 0.2], "tool0")
        found = solutions(engine.inverse_kinematics(T, "tool0", all_solutions=True))
    at_zero = np.abs(found.q[:, 0]) < 1e-9
    assert at_zero.any()
    assert (found.multiplicity == np.where(at_zero, 3, 2) * 2**4).all()
    pan = found.with_full_turns()[:, 0]
    assert (np.abs(pan).max(), np.abs(pan).min()) == pytest.approx((2.0 * np.pi, 0.0), abs=1e-9)


def test_the_result_prints_its_branches() -> None:
    with backend("reference", UR5) as engine:
        T = engine.forward_kinematics([0.3, -0.5, 0.9, 0.4, 0.8, 0.2], "tool0")
        found = engine.inverse_kinematics(T, "tool0", all_solutions=True)
        batch = engine.inverse_kinematics(T[None], "tool0", all_solutions=True)
        T[:3, 3] = 9.0
        none = engine.inverse_kinematics(T, "tool0", all_solutions=True)
    assert "8 solutions" in repr(found)
    assert "shoulder left, elbow up, wrist flipped" in repr(found)
    assert "8 solutions; 1 of 1 poses have one" in repr(batch)
    assert "no solution" in repr(none)
    assert "shoulder" in found._repr_html_()
    assert "poses" in batch._repr_html_()
