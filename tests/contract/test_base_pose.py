"""A fixed base at a pose of its own: the same robot on a mount, which every backend reads as a joint."""

from __future__ import annotations

import numpy as np

from dynx.agreement import agree
from dynx.model import Joint, Link, Model, Pose
from tests.contract.conftest import Make
from tests.contract.engine_calls import EngineCall, each_call, random_state
from tests.contract.robots import mimicking
from tests.error_bounds import ErrorBounds, samples_at

MOUNT = Pose((0.4, -1.2, 0.7), (1.1, -0.6, 2.3))
ROBOT = mimicking().with_base_pose(MOUNT)
MOUNTED = Model.build(
    "mounted",
    [Link("ground"), *ROBOT.links],
    [Joint("mount", "fixed", "ground", ROBOT.root, MOUNT), *ROBOT.joints],
    gravity=ROBOT.gravity,
)


@each_call
def test_every_quantity_is_that_of_the_mounted_robot(make: Make, engine_call: EngineCall) -> None:
    assert ROBOT.frame_names[-1] == MOUNTED.frame_names[-1]
    state = random_state(ROBOT, 61, (3,))
    result, wanted = (engine_call.evaluate(make(model), state) for model in (ROBOT, MOUNTED))
    if engine_call.method == "inertial_regressor":
        wanted = wanted[..., 10:]  # without the columns of the ground
    engine_call.check(make(ROBOT), state, result, wanted)


def test_every_frame_is_where_the_mount_puts_it(make: Make) -> None:
    """Against the same robot at the world frame, also for frames on the base itself."""
    plain, engine = make(mimicking()), make(ROBOT)
    q = ROBOT.random(62)
    T = engine.forward_kinematics(q)
    ErrorBounds(samples_at(ROBOT, q)).check(
        "forward_kinematics", T, MOUNT.matrix @ plain.forward_kinematics(q)
    )
    np.testing.assert_allclose(engine.forward_kinematics(q, ROBOT.root), MOUNT.matrix, rtol=0, atol=1e-14)


def test_inverse_kinematics_reaches_a_target_in_the_world(make: Make) -> None:
    engine = make(ROBOT)
    T = engine.forward_kinematics(ROBOT.random(63), "beta")
    found = engine.inverse_kinematics(T, "beta", rng=0)
    assert found.success
    np.testing.assert_allclose(engine.forward_kinematics(found.q, "beta"), T, rtol=0, atol=1e-5)


def test_the_referee_and_the_laws_of_mechanics_agree() -> None:
    report = agree(ROBOT, ["reference"], samples=2, referee_samples=1)
    assert report.agree, report
