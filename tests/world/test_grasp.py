"""A gripper that picks up a cube by friction, lifts it and holds it, on every engine."""

from __future__ import annotations

import numpy as np
import pytest

import dynx
from dynx.backends import backend
from dynx.spatial.scalar import Floats
from dynx.world import Material, PositionMotor, Scene, SceneRobot, World, box, ground, read_scene
from tests.world.engines import WORLDS

DT = 2e-3
CLOSING, LIFTING, HOLDING = 0.4, 1.0, 2.0
"""Times [s] of the parts of the motion."""
LIFT = 0.1
"""Height [m] by which the cube is lifted."""


def reaching(model: dynx.Model, height: float) -> Floats:
    """Return the configuration (nq,) at which the fingers, open and pointing down, are around a point."""
    T = np.diag([1.0, -1.0, -1.0, 1.0])
    T[:3, 3] = 0.5, 0.0, height
    near = np.array([0.0, 0.4, 0.0, -2.3, 0.0, 2.7, 0.785, 0.04])
    with backend("reference", model) as engine:
        solution = engine.inverse_kinematics(T, "panda_hand_tcp", q0=near)
    assert solution.success
    q: Floats = solution.q
    q[-1] = 0.04
    return q


@pytest.mark.parametrize("engine", WORLDS)
def test_panda_picks_up_a_cube_lifts_it_by_ten_centimetres_and_holds_it(engine: str) -> None:
    model = dynx.load("panda")
    low, high = (reaching(model, height) for height in (0.02, 0.02 + LIFT))
    cube = box("cube", (0.04, 0.04, 0.04), mass=0.1, pose=dynx.Pose((0.5, 0.0, 0.02)), material=Material(0.8))
    arm, finger = model.joint_names[:7], model.joint_names[7:]
    grip = PositionMotor([0.0], 1000.0, 50.0, joints=finger, max_force=20.0)
    scene = Scene("pick", robots=(SceneRobot("arm", model, q=low),), bodies=(ground(), cube))
    with World(scene, engine, DT) as world:
        for k in range(round((CLOSING + LIFTING) / DT)):
            s = min(max((k * DT - CLOSING) / LIFTING, 0.0), 1.0)
            s = s**3 * (10.0 - 15.0 * s + 6.0 * s * s)
            target = (1.0 - s) * low[:7] + s * high[:7]
            world.step(motors={"arm": [PositionMotor(target, 3000.0, 200.0, joints=arm), grip]})
        held = PositionMotor(high[:7], 3000.0, 200.0, joints=arm)
        for _ in range(4):
            world.run(HOLDING / 4, motors={"arm": [held, grip]})
            pose = world.state.bodies["cube"].T_world_body
            assert pose[2, 3] == pytest.approx(0.02 + LIFT, abs=3e-3)
            assert pose[2, 2] > 0.999
            fingers = {name for each in world.contacts("cube") for name in (each.a, each.b)} - {"cube"}
            assert fingers == {"arm/panda_leftfinger", "arm/panda_rightfinger"}


@pytest.mark.parametrize("engine", WORLDS)
def test_the_gripper_of_the_scene_lifting_picks_up_its_cube(engine: str) -> None:
    with World(read_scene("lifting"), engine, DT) as world:
        world.run(2.5)
        pose = world.state.bodies["cube"].T_world_body
        assert 0.09 < pose[2, 3] < 0.13
        assert pose[2, 2] > 0.999
        fingers = {name for each in world.contacts("cube") for name in (each.a, each.b)} - {"cube"}
        assert fingers == {"arm/panda_leftfinger", "arm/panda_rightfinger"}
