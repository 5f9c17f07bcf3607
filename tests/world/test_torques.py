"""Torques of motors in the state of a world, on every engine, in snapshots and in files."""

from __future__ import annotations

import hashlib
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import dynx
from dynx.engines.pybullet.motors import BulletMotorCommand
from dynx.errors import DynxError
from dynx.spatial.scalar import Floats
from dynx.world import PDMotor, PositionMotor, Scene, SceneRobot, World
from dynx.world.snapshot import MAGIC
from tests.world.engines import WORLDS

Q0 = (0.3, -1.2, 1.5, -0.3, 0.2, 0.0)
TAU = np.array([1.0, -30.0, -12.0, 0.5, 0.0, 0.1])


def scene() -> Scene:
    """Return a scene of two arms, the second of which hangs on a floating base."""
    arms = (
        SceneRobot("arm", dynx.load("ur5"), q=Q0),
        SceneRobot("free", dynx.load("ur5", base="floating"), q=(0.0, 3.0, 2.0, 0.0, 0.0, 0.0, 1.0, *Q0)),
    )
    return Scene("two", robots=arms)


def torques(world: World) -> Floats:
    """Return the torques of both arms."""
    return np.concatenate([world.state.torques[name] for name in ("arm", "free")])


@pytest.mark.parametrize("engine", WORLDS)
def test_given_torques_and_motors_add(engine: str, tmp_path: Path) -> None:
    motor = PDMotor(np.zeros(6), kp=50.0, kd=2.0)
    with World(scene(), engine, keep_last_step=True) as world:
        assert not torques(world).any()
        world.step(5, torques={"arm": TAU})
        assert_array_equal(torques(world), np.concatenate([TAU, np.zeros(12)]))
        world.step(5)
        q, v = world.state.robots["free"]
        world.step(torques={"arm": TAU}, motors={"free": motor})
        assert_allclose(torques(world)[12:], -50.0 * q[7:] - 2.0 * v[6:], rtol=1e-12)
        assert_array_equal(world.torque("free"), world.state.torques["free"])
        world.step(torques={"arm": TAU}, motors={"arm": motor})
        both, before = torques(world), world.save()
        assert np.abs(both[:6] - TAU).min() > 0.01
        world.write(tmp_path / "w.world")
        world.step(3, torques={"arm": 2.0 * TAU})
        assert_array_equal(torques(world), np.concatenate([2.0 * TAU, np.zeros(12)]))
        world.restore(before)
        assert_array_equal(torques(world), both)
        state = world.state
        world.set_state(state)
        assert not torques(world).any()
        assert replace(state, torques={}) == state
    with World.read(tmp_path / "w.world") as again:
        assert_array_equal(torques(again), both)
        again.step()
        assert not torques(again).any()


@pytest.mark.parametrize("engine", WORLDS)
def test_a_call_that_is_refused_leaves_the_torques(engine: str) -> None:
    motor, stiff = PDMotor(np.zeros(6), kp=50.0, kd=2.0), PDMotor(np.zeros(6), kp=-1.0, kd=2.0)
    refused: list[dict[str, Any]] = [
        {"torques": {"arm": TAU}, "motors": {"arm": PDMotor(np.ones(6), kp=1.0, kd=1.0), "free": stiff}},
        {"torques": {"arm": TAU}, "motors": {"arm": [motor, motor]}},
        {"torques": {"arm": TAU}, "forces": [dynx.ExternalForce("arm/tool", np.ones(6))]},
    ]
    with World(scene(), engine) as first, World(scene(), engine) as world:
        for each in (first, world):
            each.step(3, torques={"arm": 0.5 * TAU}, motors={"free": motor})
        for arguments in refused:
            with pytest.raises(DynxError):
                world.step(**arguments)
        assert_array_equal(torques(world), torques(first))
        assert np.abs(torques(world)).max() > 10.0


@pytest.mark.parametrize("engine", WORLDS)
def test_files_of_earlier_versions_have_no_torques(engine: str, tmp_path: Path) -> None:
    path = tmp_path / "w.world"
    with World(scene(), engine) as world:
        world.step(2, motors={"arm": PositionMotor(Q0, kp=100.0, kd=10.0)})
        world.write(path)
        data = path.read_bytes()[len(MAGIC) + 32 :]
        length = int.from_bytes(data[:8], "little")
        header = json.loads(data[8 : 8 + length])
        del header["torques"]
        text = json.dumps(header).encode()
        content = len(text).to_bytes(8, "little") + text + data[8 + length :]
        path.write_bytes(MAGIC + hashlib.sha256(content).digest() + content)
        with World.read(path) as again:
            assert not torques(again).any()
            motor = PositionMotor(Q0, kp=100.0, kd=10.0)
            for each in (world, again):
                each.step(20, motors={"arm": motor})
            assert again.state == world.state
            assert_array_equal(torques(again), torques(world))


def test_motors_inside_bullet_report_their_torque() -> None:
    arm = dynx.load("ur5")
    alone = Scene("alone", robots=(SceneRobot("arm", arm, q=Q0),))
    with World(alone, "pybullet", keep_last_step=True) as world:
        command = BulletMotorCommand("POSITION_CONTROL", [0.0] * 6, [0.0] * 6, [100.0] * 6)
        world.step(10, torques={"arm": 0.1 * TAU}, motors={"arm": command})
        axes = [(k, np.array(joint.axis)) for k, joint in enumerate(arm.joints) if joint.moves]
        needed = [world.joint_wrenches()[k, 3:] @ axis for k, axis in axes]
        assert np.abs(needed).max() > 10.0
        assert_allclose(world.state.torques["arm"], needed, rtol=0, atol=1e-8)
        command = BulletMotorCommand("TORQUE_CONTROL", forces=TAU.tolist())
        world.step(2, motors={"arm": command})
        assert_array_equal(world.state.torques["arm"], TAU)
        gains = {"position_gains": [10.0] * 6, "velocity_gains": [1.0] * 6}
        command = BulletMotorCommand("PD_CONTROL", [0.0] * 6, [0.0] * 6, [100.0] * 6, **gains)
        world.step(2, motors={"arm": command})
        assert np.isnan(world.state.torques["arm"]).all()
