"""Changes that loading a file makes to a robot in PyBullet, and the calls at run time that undo them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from dynx.agreement.tolerances import BAR
from dynx.engines.pybullet.as_loaded import LoadedPyBullet
from dynx.errors import EngineError
from dynx.loaded.difference import model_difference
from dynx.model import Inertial, Joint, JointDynamics, Limits, Link, Model, Pose
from dynx.model.tree import Base
from dynx.reference.backend import ReferenceBackend
from dynx.spatial.scalar import Floats
from dynx.spatial.so3 import rotation_from_rpy
from tests.backends.robots import assert_close, motion
from tests.loaded.files import TILTED, assert_alike, error, loaded

bullet = pytest.importorskip("pybullet")

BASES: tuple[Base, ...] = ("fixed", "floating")
BOX = Inertial(1.5, Pose((0.1, 0.2, 0.3)), ixx=0.3, iyy=0.4, izz=0.5)
NOTHING = Inertial()


def arm(
    tip: Inertial | None = BOX, root: Inertial | None = BOX, base: Base = "floating", **changes: Any
) -> Model:
    """A root and two links behind it; `tip` is the inertial of the last, `changes` are for its joint."""
    last = Joint(
        "last",
        "revolute",
        "upper",
        "tip",
        Pose((0.1, 0.0, 0.4)),
        (0.0, 1.0, 0.0),
        Limits(-1.0, 1.0, 9.0, 9.0),
    )
    joints = [
        Joint("first", "continuous", "root", "upper", Pose((0.2, 0.1, 0.3)), (0.0, 0.0, 1.0)),
        replace(last, **changes),
    ]
    links = [Link("root", root), Link("upper", BOX), Link("tip", tip)]
    return Model.build("arm", links, joints, base=base, gravity=TILTED)


def properties(robot: LoadedPyBullet, model: Model) -> list[tuple[str, str]]:
    """Return the rows of the model difference except gravity, as (name, property)."""
    rows = model_difference(model, [robot.describe()])
    return [(row.name, row.property) for row in rows if row.part != "gravity"]


@pytest.mark.parametrize("base", BASES)
def test_a_link_without_inertial_gets_a_kilogram(base: Base) -> None:
    model = arm(tip=None, base=base, root=BOX if base == "floating" else NOTHING)
    kilogram = arm(tip=Inertial(1.0, ixx=1.0, iyy=1.0, izz=1.0), base=base, root=model.links[0].inertial)
    with loaded(LoadedPyBullet, model) as robot:
        assert isinstance(robot, LoadedPyBullet)
        assert_alike(robot, kilogram)
        assert properties(robot, model) == [("tip", "mass"), ("tip", "inertia")]


def test_impossible_moments_become_zero_until_they_are_set() -> None:
    # 0.5 > 0.1 + 0.3: no body has these, and Bullet's own test of a body refuses none of them.
    model = arm(tip=replace(BOX, ixx=0.1, iyy=0.5, izz=0.3))
    zero = arm(tip=replace(BOX, ixx=0.0, iyy=0.0, izz=0.0))
    with loaded(LoadedPyBullet, model) as robot:
        assert isinstance(robot, LoadedPyBullet)
        assert_alike(robot, zero)
        assert properties(robot, model) == [("tip", "inertia")]
    with loaded(LoadedPyBullet, model, calls=["pybullet.set_inertias"]) as robot:
        assert isinstance(robot, LoadedPyBullet)
        assert_alike(robot, model)
        assert properties(robot, model) == []


@pytest.mark.parametrize("base", BASES)
def test_extrapolation_allows_negative_moments(base: Base) -> None:
    # At the joint, where no parallel-axis term makes it positive.
    tip = replace(BOX, origin=Pose(), ixx=-0.1)
    model = arm(tip=tip, base=base, root=BOX if base == "floating" else NOTHING)
    q, v, a = motion(model)
    with loaded(LoadedPyBullet, model, calls=["pybullet.set_inertias"]) as robot:
        engine_calls: tuple[Callable[[], object], ...] = (
            lambda: robot.mass_matrix(q),
            lambda: robot.inverse_dynamics(q, v, a),
            lambda: robot.jacobian(q, "tip"),
        )
        for call in engine_calls:
            with pytest.raises(EngineError, match="calculateInverseDynamics for arm"):
                call()
        assert_close(robot.link_poses(q), ReferenceBackend(model).forward_kinematics(q))
    calls = ["pybullet.set_inertias", "pybullet.extrapolate_inertias"]
    with loaded(LoadedPyBullet, model, calls=calls) as robot:
        assert_alike(robot, model)


def test_a_full_tensor_is_diagonalised_to_a_millionth() -> None:
    off = []
    for ixy, ixz in ((0.03, -0.02), (0.1, -0.06), (0.05, 0.1)):
        model = arm(tip=replace(BOX, ixy=ixy, ixz=ixz, iyz=0.01))
        q = model.random(0)
        with loaded(LoadedPyBullet, model) as robot:
            assert isinstance(robot, LoadedPyBullet)
            off.append(error(robot.mass_matrix(q), ReferenceBackend(model).mass_matrix(q)))
            assert properties(robot, model) == [("tip", "inertia")]
    # Jacobi's method stops where the largest product of inertia is 1e-6 of the trace.
    assert BAR < max(off) < 1e-6


def test_a_root_without_mass_is_nailed_to_the_world() -> None:
    with (
        pytest.raises(EngineError, match="fixes arm to the world: there its root 'root' has no mass"),
        loaded(LoadedPyBullet, arm(root=NOTHING)),
    ):
        pass
    with loaded(LoadedPyBullet, arm(root=NOTHING, base="fixed")) as robot:
        assert_alike(robot, arm(root=NOTHING, base="fixed"))


def test_a_fixed_root_turns_gravity_and_jacobian() -> None:
    rpy = (0.4, -0.2, 0.7)
    model = arm(root=replace(BOX, origin=Pose((0.1, 0.2, 0.3), rpy)), base="fixed")
    R = rotation_from_rpy(np.array(rpy))
    # Gravity is taken for one given along the root's inertial frame.
    turned = ReferenceBackend(model.with_gravity(R @ np.array(TILTED)))
    reference = ReferenceBackend(model)
    q, v, a = motion(model)
    with loaded(LoadedPyBullet, model) as robot:
        assert_close(robot.inverse_dynamics(q, v, a), turned.inverse_dynamics(q, v, a))
        J = reference.jacobian(q, "tip")
        assert_close(robot.jacobian(q, "tip"), np.concatenate([R.T @ J[:3], R.T @ J[3:]]))
        assert_close(robot.link_poses(q), reference.forward_kinematics(q))
        assert_close(robot.mass_matrix(q), reference.mass_matrix(q))
        # The step takes gravity as it is.
        tau = reference.inverse_dynamics(q, v, a)
        assert_close(reference.inverse_dynamics(q, v, robot.forward_dynamics(q, v, tau)), tau)


def test_an_axis_that_is_not_unit_shows_where_bullet_moves() -> None:
    model = arm(type="prismatic", axis=(0.0, 1.0, 0.0))
    text = model.to_urdf().replace('xyz="0.0 1.0 0.0"', 'xyz="0.0 2.0 0.0"')
    q, v, a = motion(model)
    reference = ReferenceBackend(model)
    with loaded(LoadedPyBullet, model, text) as robot:
        assert isinstance(robot, LoadedPyBullet)
        assert_close(robot.inverse_dynamics(q, v, a), reference.inverse_dynamics(q, v, a))
        assert_close(robot.mass_matrix(q), reference.mass_matrix(q))
        doubled = q.copy()
        doubled[-1] *= 2.0
        assert_close(robot.link_poses(q), reference.forward_kinematics(doubled))
        assert properties(robot, model) == [("last", "axis")]


def test_damping_acts_in_a_step_until_it_is_taken_away() -> None:
    model = arm(dynamics=JointDynamics(damping=0.5))
    calm = arm()
    q, v, tau = motion(model)
    # What a damper takes from the torque, it takes from the acceleration.
    damped = tau.copy()
    damped[-1] -= 0.5 * v[-1]
    with loaded(LoadedPyBullet, model) as robot:
        near = ReferenceBackend(calm)
        found = robot.forward_dynamics(q, v, tau)
        assert error(near.inverse_dynamics(q, v, found), damped) < error(
            near.inverse_dynamics(q, v, found), tau
        )
        assert error(near.inverse_dynamics(q, v, found), tau) > BAR
    with loaded(LoadedPyBullet, model, calls=["pybullet.no_damping"]) as robot:
        assert isinstance(robot, LoadedPyBullet)
        assert_alike(robot, calm)
        assert properties(robot, model) == []


def test_a_limit_acts_in_a_step_beyond_it_until_it_is_taken_away() -> None:
    model = arm()
    q, v, a = motion(model)
    # Beyond the limit, and going further.
    q[-1], v[-1], a[-1] = 1.5, 0.5, 1.0
    reference = ReferenceBackend(model)

    def missed(q: Floats, *calls: str) -> float:
        tau = reference.inverse_dynamics(q, v, a)
        with loaded(LoadedPyBullet, model, calls=calls) as robot:
            return error(reference.inverse_dynamics(q, v, robot.forward_dynamics(q, v, tau)), tau)

    assert missed(q) > BAR
    assert missed(q, "pybullet.no_limits") <= BAR
    q[-1] = 0.9
    assert missed(q) <= BAR
