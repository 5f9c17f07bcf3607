"""A saved world continues bit for bit, in memory and from a file in another process."""

from __future__ import annotations

import pickle
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import dynx
from dynx.errors import ArgumentError
from dynx.model import JointDynamics
from dynx.spatial.scalar import Floats
from dynx.world import PositionMotor, Scene, SceneRobot, VelocityMotor, World, box, ground
from tests.world.engines import WORLDS
from tests.world.scenes import crowd

pytestmark = pytest.mark.parametrize("engine", WORLDS)


def final(world: World, steps: int) -> Floats:
    """Return all coordinates of a world after some steps under motors."""
    motors = {"dog": PositionMotor([0.0, 0.8, -1.6] * 4, 100.0, 2.0), "arm": VelocityMotor(0.3, 20.0)}
    world.step(steps, motors=motors)
    state = world.state
    parts = [part.ravel() for each in (*state.robots.values(), *state.bodies.values()) for part in each]
    return np.concatenate(parts)


IN_ANOTHER_PROCESS = """
import sys
from dynx.world import World
from tests.world.test_saving import final
with World.read(sys.argv[1]) as world:
    print(world.time.hex(), final(world, 300).tobytes().hex())
"""


@pytest.mark.long_cases
def test_a_saved_world_continues_bit_for_bit(engine: str, tmp_path: Path) -> None:
    with World(crowd(), engine) as world:
        final(world, 100)
        assert world.contacts()
        world.write(tmp_path / "world")
        snapshot = world.save()
        time = world.time
        expected = final(world, 300)
        assert len(world.contacts()) > 8
        world.restore(snapshot)
        assert world.time == time
        assert (final(world, 300) == expected).all()
    run = subprocess.run(
        [sys.executable, "-c", IN_ANOTHER_PROCESS, str(tmp_path / "world")],
        capture_output=True,
        text=True,
        check=True,
    )
    began, found = run.stdout.split()
    assert float.fromhex(began) == time
    assert (np.frombuffer(bytes.fromhex(found)) == expected).all()


def small(mass: float = 1.0) -> Scene:
    return Scene("s", bodies=(ground(), box("b", (0.1, 0.1, 0.1), mass=mass)))


def test_snapshots_are_compared_by_content(engine: str) -> None:
    with World(crowd(), engine) as world:
        final(world, 10)
        one, other = world.save(), world.save()
        world.step()
        later = world.save()
    assert one == other == pickle.loads(pickle.dumps(one))
    assert len({one, other, later}) == 2
    with pytest.raises(ArgumentError, match="another version"):
        one.__setstate__({"memory": {}})


def test_a_snapshot_of_another_scene_or_step_is_refused(engine: str) -> None:
    with World(small(), engine) as world, World(small(2.0), engine) as other:
        before = world.state.bodies["b"].T_world_body
        with pytest.raises(ArgumentError, match="another scene"):
            world.restore(other.save())
        with World(small(), engine, dt=2e-3) as slow, pytest.raises(ArgumentError, match="another scene"):
            world.restore(slow.save())
        assert (world.state.bodies["b"].T_world_body == before).all()


def test_a_snapshot_of_other_settings_is_refused(engine: str) -> None:
    changed: dict[str, dict[str, Any]] = {
        "pybullet": {"erp": 0.1},
        "mujoco": {"margin": 0.001},
        "drake": {"modulus": 1e7},
    }
    with World(small(), engine, **changed[engine]) as other:
        snapshot = other.save()
    with World(small(), engine) as world, pytest.raises(ArgumentError, match="another scene"):
        world.restore(snapshot)


def test_a_damaged_file_is_refused_before_the_engine_sees_it(engine: str, tmp_path: Path) -> None:
    path = tmp_path / "world"
    with World(small(), engine) as world:
        world.write(path)
    data = path.read_bytes()
    for damaged in (
        data[:-1],
        data[: len(data) // 2],
        data[:-9] + b"?" + data[-8:],
        b"",
        b"text",
        data + b"0",
    ):
        path.write_bytes(damaged)
        with pytest.raises(ArgumentError):
            World.read(path)
    with pytest.raises(ArgumentError):
        World.read(tmp_path / "missing")


def test_reset_returns_to_the_start(engine: str) -> None:
    with World(small(), engine) as world:
        start = world.state
        world.step(50)
        first = world.state
        world.reset()
        assert world.time == 0.0
        assert (world.state.bodies["b"].T_world_body == start.bodies["b"].T_world_body).all()
        world.step(50)
        assert (world.state.bodies["b"].T_world_body == first.bodies["b"].T_world_body).all()


def test_files_of_another_kind_name_the_function_that_reads_them(engine: str, tmp_path: Path) -> None:
    world_file, npz, toml = (str(tmp_path / name) for name in ("a.world", "b.npz", "c.toml"))
    with World(Scene("s", bodies=(box("a", (1, 1, 1), mass=1.0),)), engine) as world:
        world.write(world_file)
    np.savez(npz, x=np.zeros(3))
    Path(toml).write_text("schema = 'dynx.scene/1'")
    with pytest.raises(ArgumentError, match=r"a file of World.write, which dynx.world.World.read reads"):
        dynx.Rollout.load(world_file)
    with pytest.raises(ArgumentError, match=r"read by dynx.Rollout.load"):
        World.read(npz)
    with pytest.raises(ArgumentError, match=r"a scene is read by dynx.world.read_scene"):
        World.read(toml)


def test_a_suffix_is_checked_before_a_file_is_written(engine: str, tmp_path: Path) -> None:
    with World(small(), engine) as world, pytest.raises(ArgumentError, match="a file without a suffix"):
        world.write(tmp_path / "a.txt")
    assert not (tmp_path / "a.txt").exists()


def test_a_robot_whose_fixed_joints_were_given_friction_is_read_back(engine: str, tmp_path: Path) -> None:
    robot = dynx.load("panda")
    rough = JointDynamics(damping=0.1, friction=0.2, armature=0.01)
    robot = replace(robot, joints=tuple(replace(joint, dynamics=rough) for joint in robot.joints))
    scene = Scene("rough", robots=[SceneRobot("arm", robot)])
    with World(scene, engine) as world:
        world.step(3)
        world.write(tmp_path / "rough.world")
        with World.read(tmp_path / "rough.world") as again:
            world.step(2)
            again.step(2)
            (q, _), (wanted, _) = (each.state.robots["arm"] for each in (again, world))
            np.testing.assert_array_equal(q, wanted)
