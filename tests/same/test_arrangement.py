"""Floating robots of which no body determines its frame alone: all joints and masses together do."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dynx.model import Model
from dynx.model.elements import Inertial, Joint, JointType, Link, Pose
from dynx.same import same_robot
from tests.same.planted import other_mass, with_inertial
from tests.same.rewrites import with_moved_frames, with_other_names, with_other_order
from tests.same.test_same_robot import random_body

POINT = Inertial(1.0, Pose((0.25, 0.2, 0.3)))
BODY = Inertial(1.0, Pose((0.25, 0.25, 0.25), (2.4, 0.1, 2.8)), 0.125, 0.0, 0.0, 0.0625, 0.0, 0.0625)
Part = tuple[int, JointType, Inertial | None]
"""Number of the parent link, type of the joint, and inertia of the child."""

CASES: dict[str, list[Part]] = {
    "point mass on its axis": [(0, "revolute", Inertial(1.0))],
    "two slides in a row": [(0, "prismatic", None), (1, "prismatic", None)],
    "hinge on a slide": [(0, "prismatic", None), (1, "continuous", None)],
    "two hinges on a slide": [(0, "prismatic", None), (1, "continuous", None), (1, "revolute", None)],
    "point mass on a slide": [(0, "prismatic", POINT)],
    "point mass on two slides": [(0, "prismatic", None), (1, "prismatic", POINT)],
    "body on a slide": [(0, "prismatic", BODY)],
    "body on two slides": [(0, "prismatic", None), (1, "prismatic", BODY)],
    "hinge beside two slides": [(0, "continuous", None), (0, "prismatic", None), (2, "prismatic", None)],
    "slides and a far hinge": [
        (0, "prismatic", None),
        (1, "prismatic", None),
        (2, "prismatic", None),
        (3, "continuous", None),
        (4, "prismatic", POINT),
    ],
}


def robot(parts: list[Part], rng: np.random.Generator) -> Model:
    """Return a floating robot whose root has no mass, with joints at random places."""
    links = [Link("l0"), *(Link(f"l{k}", inertial) for k, (_, _, inertial) in enumerate(parts, 1))]
    joints = []
    for k, (parent, kind, _) in enumerate(parts, 1):
        axis = rng.standard_normal(3)
        x, y, z = (axis / np.linalg.norm(axis)).tolist()
        place = Pose.from_matrix(Pose(tuple(rng.uniform(-0.5, 0.5, 3)), tuple(rng.uniform(-1, 1, 3))).matrix)
        joints.append(Joint(f"j{k}", kind, f"l{parent}", f"l{k}", place, (x, y, z)))
    return Model.build("light", links, joints, base="floating")


@pytest.mark.parametrize("case", CASES)
def test_frames_of_a_robot_without_a_heavy_base_may_be_moved(case: str) -> None:
    for seed in range(5):
        rng = np.random.default_rng(seed)
        model = robot(CASES[case], rng)
        for other in (with_moved_frames(model, rng), with_moved_frames(with_other_names(model), rng)):
            report = same_robot(model, other)
            assert report.same, (seed, report.differences)
            assert all(each.sign == 1 for each in report.coordinates)


HINGE: Part = (1, "revolute", POINT)
LIKE: dict[str, list[Part]] = {
    "hinges": [(0, "revolute", None)] * 3,
    "slides": [(0, "prismatic", POINT)] * 3,
    "hinges of bodies": [(0, "continuous", BODY)] * 4,
    "hinges on a slide": [(0, "prismatic", None), *[HINGE] * 3],
}


@pytest.mark.parametrize("case", LIKE)
def test_several_like_joints_of_one_body_may_have_other_names_and_another_order(case: str) -> None:
    for seed in range(4):
        rng = np.random.default_rng(seed)
        model = robot(LIKE[case], rng)
        other = with_moved_frames(with_other_order(with_other_names(model), rng), rng)
        assert same_robot(model, other).same, seed


def test_axes_that_are_nearly_parallel_determine_the_frame() -> None:
    z, tilted = (0.0, 0.0, 1.0), (1e-7, 0.0, 1.0)
    joints = [
        Joint(f"j{k}", "revolute", f"l{k}", f"l{k + 1}", axis=axis) for k, axis in enumerate((z, z, tilted))
    ]
    model = Model.build("light", [Link(f"l{k}") for k in range(4)], joints, base="floating")
    for seed in range(5):
        assert same_robot(model, with_moved_frames(model, np.random.default_rng(seed))).same


@pytest.mark.parametrize("tilt", [1e-5, 1e-8, 1e-10])
@pytest.mark.parametrize("kind", ["prismatic", "revolute"])
def test_axes_side_by_side_that_are_nearly_parallel_determine_the_frame(kind: JointType, tilt: float) -> None:
    """Their directions leave a turn about them open but for few digits, which their places give."""
    axes = (0.0, 0.0, 1.0), (tilt, 0.0, 1.0), (0.0, tilt, 1.0)
    types: tuple[JointType, ...] = ("revolute", kind, "revolute")
    for seed in range(6):
        rng = np.random.default_rng(seed)
        places = [Pose(tuple(rng.uniform(-1.0, 1.0, 3))) for _ in axes]
        joints = [
            Joint(f"j{k}", types[k], f"l{k}", f"l{k + 1}", places[k], axis) for k, axis in enumerate(axes)
        ]
        model = Model.build("light", [Link(f"l{k}") for k in range(4)], joints, base="floating")
        assert same_robot(model, with_moved_frames(model, rng)).same


def test_a_point_mass_on_the_axis_of_a_light_base_at_no_distance_is_the_same() -> None:
    joint = Joint("j", "revolute", "a", "b", axis=(0.0, 0.0, 1.0))
    model = Model.build("light", [Link("a"), Link("b", Inertial(1.0))], [joint], base="floating")
    for seed in range(5):
        assert same_robot(model, with_moved_frames(model, np.random.default_rng(seed))).same


@pytest.mark.parametrize("case", ["point mass on a slide", "body on two slides", "slides and a far hinge"])
def test_another_mass_on_a_robot_without_a_heavy_base_is_found(case: str) -> None:
    rng = np.random.default_rng(0)
    model = robot(CASES[case], rng)
    last = model.links[-1].name
    report = same_robot(model, other_mass(with_moved_frames(model, rng), last, 1e-3).model)
    assert [(each.part, each.theirs) for each in report.differences] == [("inertial", last)]


@pytest.mark.parametrize("seed", range(6))
def test_frames_nearer_than_a_billionth_are_told_apart_where_the_tolerance_is_finer(seed: int) -> None:
    """The frame that follows from a misplaced centre of mass is near to the right one, from the joints."""
    rng = np.random.default_rng(seed)
    model = robot([(0, "continuous", random_body(rng)), (0, "continuous", random_body(rng))], rng)
    model = with_inertial(model, "l0", random_body(rng))
    moved = with_moved_frames(model, rng)
    base = moved.inertial("l0")
    x, y, z = base.origin.xyz
    planted = with_inertial(moved, "l0", replace(base, origin=replace(base.origin, xyz=(x, y, z + 4e-10))))
    report = same_robot(model, planted, tolerance=1e-10)
    assert [(each.part, each.theirs) for each in report.differences] == [("inertial", "l0")]
