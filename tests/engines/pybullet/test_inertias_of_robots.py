"""Inertias that PyBullet 3.2 refuses or changes, used as they stand: one test for each trap."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dynx.engines.pybullet.backend import PyBulletBackend
from dynx.errors import EngineError
from dynx.model import Inertial, Joint, Link, Model, Pose
from dynx.model.tree import Base
from dynx.reference.backend import ReferenceBackend
from tests.backends.robots import BASES, BOX, assert_close, motion, pair
from tests.engines.pybullet.robots import assert_agrees, assert_solves

pytest.importorskip("pybullet")


@pytest.mark.parametrize("prismatic", [False, True])
@pytest.mark.parametrize("base", BASES)
@pytest.mark.parametrize(
    ("tip", "ballast"),
    [
        (None, False),
        (Inertial(), False),
        (Inertial(0.7, Pose((0.1, 0.2, 0.3))), False),
        (Inertial(0.0, Pose((0.1, 0.2, 0.3)), ixx=0.1, iyy=0.2, izz=0.3), False),
        (Inertial(1.0, Pose((0.1, 0.0, 0.0), (1.0, 0.5, 0.2)), ixx=0.5, iyy=0.1, izz=0.1), False),
        (Inertial(1.0, ixx=0.1 + 2e-17, iyy=0.05, izz=0.05), False),
        (Inertial(1.0, Pose((0.1, 0.0, 0.0), (1.0, 0.5, 0.2)), ixx=-0.05, iyy=0.1, izz=0.1), True),
    ],
    ids=["none", "zero", "point", "massless rotor", "triangle", "triangle by rounding", "negative moment"],
)
def test_inertias_are_used_as_they_stand(
    tip: Inertial | None, ballast: bool, base: Base, prismatic: bool
) -> None:
    model = pair(BOX, tip, base, prismatic)
    assert_agrees(model)
    with PyBulletBackend(model) as engine:
        assert engine.ballast is ballast


@pytest.mark.parametrize("mass", [1e-6, 10.0, 1e4])
@pytest.mark.parametrize("base", BASES)
def test_bodies_heavier_or_lighter_than_bullet_s_checks_foresee(base: Base, mass: float) -> None:
    """Its checks compare with about 1e-15 whatever the size: 10 kg at a metre are refused."""
    body = Inertial(
        mass, Pose((0.7, 1.02, 0.93), (0.3, 0.2, 0.1)), ixx=0.02 * mass, iyy=0.03 * mass, izz=0.04 * mass
    )
    for tip in (body, Inertial(mass, Pose((0.7, 1.02, 0.93)))):
        model = pair(body, tip, base)
        assert_agrees(model)
        assert_solves(model)


@pytest.mark.parametrize("base", BASES)
def test_bodies_that_meet_a_triangle_inequality_with_equality(base: Base) -> None:
    """Rods, plates and points: whether Bullet takes them hangs on how it rounds."""
    rng = np.random.default_rng(0)
    for kind in range(30):
        x, y, z = (float(r) if r > -0.3 else 0.0 for r in rng.uniform(-1.0, 1.0, 3))
        moment = float(rng.uniform(0.01, 0.2))
        moments = [(0.0, moment, moment), (moment, moment / 3, moment + moment / 3), (0.0, 0.0, 0.0)][
            kind % 3
        ]
        ixx, iyy, izz = np.roll(moments, kind // 3)
        assert_agrees(pair(BOX, Inertial(1.1, Pose((x, y, z)), ixx=ixx, iyy=iyy, izz=izz), base), samples=1)


@pytest.mark.parametrize("root", [None, Inertial(0.0, ixx=0.1, iyy=0.2, izz=0.3)])
def test_a_floating_root_without_mass_floats(root: Inertial | None) -> None:
    model = pair(root, BOX, "floating")
    assert_agrees(model)
    with PyBulletBackend(model) as engine:
        assert engine.ballast
    if root is not None:
        assert_solves(model)


def test_negative_mass_is_no_harder_than_any_other() -> None:
    assert_agrees(pair(BOX, replace(BOX, mass=-0.2), "floating"))


def test_forward_dynamics_where_bullet_is_given_ballast() -> None:
    model = pair(BOX, Inertial(1.0, Pose((0.3, 0.2, 0.0)), ixx=-0.01, iyy=0.1, izz=0.1), "fixed")
    assert_solves(model)


@pytest.mark.parametrize("size", [1e-3, 3e-4])
def test_a_joint_too_light_for_the_stepper_still_moves(size: float) -> None:
    crumb = Inertial(size**3, Pose((size, 0.0, 0.0)), ixx=size**5, iyy=size**5, izz=size**5)
    links = [Link("root", BOX), Link("arm", BOX), Link("crumb", crumb)]
    joints = [
        Joint("shoulder", "revolute", "root", "arm", axis=(0.0, 1.0, 0.0)),
        Joint("tip", "revolute", "arm", "crumb", Pose((0.2, 0.0, 0.0)), (0.0, 1.0, 0.0)),
    ]
    model = Model.build("crumb", links, joints)
    reference = ReferenceBackend(model)
    q, v, a = motion(model)
    tau = reference.inverse_dynamics(q, v, a)
    with PyBulletBackend(model) as engine:
        found = engine.forward_dynamics(q, v, tau)
    # Joint by joint: the crumb's torque is 1e-20 of the arm's.
    again = reference.inverse_dynamics(q, v, found)
    M, bias = reference.mass_matrix(q), reference.bias_torque(q, v)
    size_of_terms = np.abs(M) @ (np.abs(a) + np.abs(found)) + np.abs(bias) + np.abs(tau)
    assert_close((again - tau) / size_of_terms, np.zeros(2))


def test_a_tip_a_million_times_as_heavy_as_its_floating_root_is_refused_not_wrong() -> None:
    heavy = Inertial(1e8, Pose((0.1, 0.0, 0.2)), ixx=4e7, iyy=3e7, izz=2e7)
    links = [Link("root", BOX), Link("arm", BOX), Link("tip", heavy)]
    joints = [
        Joint("shoulder", "revolute", "root", "arm", Pose((0.1, 0.2, 0.3)), (0.0, 0.6, 0.8)),
        Joint("wrist", "revolute", "arm", "tip", Pose((0.4, 0.2, 0.3)), (0.6, 0.0, 0.8)),
    ]
    model = Model.build("mallet", links, joints, base="floating")
    q, v, a = motion(model)
    tau = ReferenceBackend(model).inverse_dynamics(q, v, a)
    with PyBulletBackend(model) as engine, pytest.raises(EngineError, match="loses too many digits"):
        engine.forward_dynamics(q, v, tau)
