"""The results of PyBullet are those of the reference, at every attitude, gravity, speed and size."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from dynx.engines.pybullet.backend import PyBulletBackend
from dynx.engines.pybullet.client import MAX_JOINTS
from dynx.errors import EngineLimitError
from dynx.model import JointDynamics, Limits
from dynx.model.loading import load
from dynx.model.tree import Base
from dynx.reference.backend import ReferenceBackend
from dynx.spatial.so3 import quat_from_rotation, rotation_from_rpy
from tests.backends.robots import BASES, BOX, assert_close, chain, mixed_robot, motion, pair
from tests.engines.pybullet.robots import assert_agrees, assert_solves
from tests.error_bounds import ErrorBounds, samples_at

pytest.importorskip("pybullet")


# -- the same results ------------------------------------------------------------------------------


@pytest.mark.long_cases
@pytest.mark.parametrize("base", BASES)
@pytest.mark.parametrize(
    "name", ["romeo_laas_small", "allegro_right_hand", "hyq", "icub", "pr2", "quadrotor_base", "iris_simple"]
)
def test_robots_that_bullet_reads_otherwise(name: str, base: Base) -> None:
    assert_agrees(load(name, base=base), samples=1)


# -- attitudes, gravity, the stepper -----------------------------------------------------------------


@pytest.mark.parametrize("pitch", [0.3, np.pi / 2 - 1e-9, np.pi / 2, -np.pi / 2])
def test_attitudes_about_several_axes_and_at_the_poles(pitch: float) -> None:
    model = mixed_robot("floating")
    q, v, a = motion(model)
    q[3:7] = quat_from_rotation(rotation_from_rpy(np.array([0.7, pitch, -1.1])))
    with PyBulletBackend(model) as engine:
        expected = ReferenceBackend(model).inverse_dynamics(q, v, a)
        assert_close(engine.inverse_dynamics(q, v, a), expected)
    near = ErrorBounds(samples_at(model, q, v, tau=a))
    with PyBulletBackend(model) as engine:
        found = engine.forward_dynamics(q, v, a)
    near.check_solves(found, ReferenceBackend(model).inverse_dynamics(q, v, found), a)


@pytest.mark.parametrize("base", BASES)
def test_the_stepper_has_no_clamp_limits_motors_or_damping(base: Base) -> None:
    model = pair(BOX, BOX, base)
    joints = [
        replace(joint, limits=Limits(-0.1, 0.1, 1.0, 1.0), dynamics=JointDynamics(3.0, 2.0, 0.0))
        for joint in model.joints
    ]
    # Speeds beyond Bullet's clamp of 100.
    assert_solves(replace(model, joints=tuple(joints)), faster=1e3)
    assert_solves(model, faster=1e3)


# -- size --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("base", BASES)
def test_as_many_joints_as_bullet_answers_for(base: Base) -> None:
    model = chain(MAX_JOINTS).with_base(base)
    q, v, a = motion(model)
    reference = ReferenceBackend(model)
    with PyBulletBackend(model) as engine:
        assert_close(engine.forward_kinematics(q), reference.forward_kinematics(q), size=MAX_JOINTS)
        tau = engine.inverse_dynamics(q, v, a)
        near = ErrorBounds(samples_at(model, q, v, a, tau))
        near.check("inverse_dynamics", tau, reference.inverse_dynamics(q, v, a))
        near.check("mass_matrix", engine.mass_matrix(q), reference.mass_matrix(q))
        found = engine.forward_dynamics(q, v, tau)
        near.check_solves(found, reference.inverse_dynamics(q, v, found), tau)


@pytest.mark.parametrize("n", [MAX_JOINTS + 1, 129, 200])
def test_more_joints_are_refused(n: int) -> None:
    with pytest.raises(EngineLimitError, match=f"chain has {n} moving joints"):
        PyBulletBackend(chain(n))
