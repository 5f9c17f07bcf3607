"""Pages for those who come from another library: the tables are current, and calls give the same numbers."""

from __future__ import annotations

import runpy
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import dynx
from dynx.engine_names import TABLES, call_of_dynx
from dynx.world import Scene, World, box, sphere

ROOT = Path(__file__).parents[1]
WRITER = runpy.run_path(str(ROOT / "docs/write_coming_from.py"))
VECTORS = st.tuples(st.floats(-1.5, 1.5), st.floats(-1.5, 1.5), st.floats(-1.5, 1.5))
SINGLE_PRECISION = 1e-6
"""Rounding of Bullet's collision shapes and transforms, relative to lengths of about 1 m."""


@pytest.mark.parametrize("library", TABLES)
def test_the_table_is_current(library: str) -> None:
    current = (ROOT / WRITER["page_of"](library)).read_text(encoding="utf-8")
    assert current == WRITER["page"](library), "run: python docs/write_coming_from.py"


@pytest.mark.parametrize("library", TABLES)
def test_mistaken_names_point_to_the_page(library: str) -> None:
    title = f"Coming from {library}"
    assert (ROOT / WRITER["page_of"](library)).read_text(encoding="utf-8").startswith(f"# {title}\n")
    for name in TABLES[library]:
        assert f"(see '{title}' in the documentation)" in str(call_of_dynx(name))


@pytest.fixture(scope="module")
def bullet() -> Iterator[Any]:
    """Return PyBullet with a client of its own."""
    p = pytest.importorskip("pybullet")
    client = p.connect(p.DIRECT)
    yield p
    p.disconnect(client)


@given(VECTORS)
def test_rotations_are_those_of_pybullet(bullet: Any, rpy: tuple[float, float, float]) -> None:
    quat = bullet.getQuaternionFromEuler(rpy)
    assert dynx.quat_from_rpy(rpy) @ quat == pytest.approx(1.0)  # of one sign, too
    np.testing.assert_allclose(dynx.rpy_from_quat(quat), bullet.getEulerFromQuaternion(quat), atol=1e-7)
    matrix = np.reshape(bullet.getMatrixFromQuaternion(quat), (3, 3))
    np.testing.assert_allclose(dynx.rotation_from_quat(quat), matrix, atol=1e-12)


@given(VECTORS, VECTORS)
def test_products_and_inverses_of_poses_are_those_of_pybullet(
    bullet: Any, xyz: tuple[float, float, float], rpy: tuple[float, float, float]
) -> None:
    T = dynx.Pose(xyz, rpy).matrix
    raw = (xyz, bullet.getQuaternionFromEuler(rpy))
    for (position, quat), pose in (
        (bullet.multiplyTransforms(*raw, *raw), T @ T),
        (bullet.invertTransform(*raw), np.linalg.inv(T)),
    ):
        np.testing.assert_allclose(pose[:3, 3], position, atol=SINGLE_PRECISION)
        np.testing.assert_allclose(pose[:3, :3], dynx.rotation_from_quat(quat), atol=SINGLE_PRECISION)


@pytest.fixture(scope="module")
def both(bullet: Any) -> Iterator[tuple[Any, dict[str, int], World]]:
    """Return PyBullet, its bodies by name, and a world of dynx with the same ball above the same block."""
    block = bullet.createCollisionShape(bullet.GEOM_BOX, halfExtents=[0.5, 0.5, 0.1])
    ball = bullet.createCollisionShape(bullet.GEOM_SPHERE, radius=0.2)
    bodies = {
        "block": bullet.createMultiBody(0, block, basePosition=[0, 0, 0.1]),
        "ball": bullet.createMultiBody(1.5, ball, basePosition=[0, 0, 1.0]),
    }
    bullet.setGravity(0, 0, -9.81)
    bullet.setTimeStep(1e-3)
    bullet.changeDynamics(bodies["ball"], -1, linearDamping=0, angularDamping=0)
    bullet.performCollisionDetection()
    scene = Scene(
        "both",
        bodies=(
            box("block", (1.0, 1.0, 0.2), pose=dynx.Pose((0, 0, 0.1))),
            sphere("ball", 0.2, mass=1.5, pose=dynx.Pose((0, 0, 1.0))),
        ),
    )
    with World(scene, engine="pybullet") as world:
        yield bullet, bodies, world


def test_queries_are_those_of_pybullet(both: tuple[Any, dict[str, int], World]) -> None:
    p, bodies, world = both
    (raw,) = p.getClosestPoints(bodies["ball"], bodies["block"], 2.0)
    (found,) = world.closest_points("ball", "block", within=2.0)
    assert found.distance == pytest.approx(raw[8], rel=SINGLE_PRECISION)
    (ray,) = p.rayTestBatch([[0.1, 0.1, 3.0]], [[0.1, 0.1, -3.0]])
    hits = world.cast_rays([[0.1, 0.1, 3.0]], [[0.0, 0.0, -1.0]])
    assert hits.names == ("ball",)
    assert ray[0] == bodies["ball"]
    np.testing.assert_allclose(hits.points[0], ray[3], rtol=1e-4)
    # Bullet enlarges its boxes by a margin.
    np.testing.assert_allclose(world.aabb("block"), p.getAABB(bodies["block"]), atol=0.05)


def test_steps_and_saved_states_are_those_of_pybullet(both: tuple[Any, dict[str, int], World]) -> None:
    p, bodies, world = both
    snapshot, state = world.save(), p.saveState()
    for _ in range(2):
        for _ in range(100):
            p.stepSimulation()
        world.step(100)
        position, _ = p.getBasePositionAndOrientation(bodies["ball"])
        velocity, _ = p.getBaseVelocity(bodies["ball"])
        present = world.state.bodies["ball"]
        np.testing.assert_allclose(present.T_world_body[:3, 3], position, rtol=1e-9)
        np.testing.assert_allclose(present.twist[:3], velocity, rtol=1e-9)
        world.restore(snapshot)
        p.restoreState(state)


def test_names_of_the_chain_of_gymnasium_make_its_environments() -> None:
    gymnasium = pytest.importorskip("gymnasium")
    import dynx.envs

    assert dynx.envs
    assert "dynx/CartPole-v0" in gymnasium.registry


def test_numbers_are_those_of_roboticstoolbox() -> None:
    """Kinematics and dynamics of one description, read by both."""
    rtb = pytest.importorskip("roboticstoolbox")
    robot = rtb.ERobot.URDF(str(ROOT / "models/planar_2r.urdf"))
    model = dynx.load("planar_2r")
    with dynx.backend("reference", model) as engine:
        q = np.array([0.3, 0.4])
        tip = robot.ee_links[0].name
        np.testing.assert_allclose(engine.forward_kinematics(q, tip), robot.fkine(q).A, atol=1e-12)
        np.testing.assert_allclose(engine.jacobian(q, tip), robot.jacob0(q), atol=1e-12)
