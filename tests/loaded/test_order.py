"""The order of an engine's coordinates: each engine, called by itself, is where dynx says that it is."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import dynx
from dynx.errors import ArgumentError, ShapeError, UnknownBackendError, UnsupportedFeatureError
from dynx.loaded import EngineOrder, LoadedRobot
from dynx.model import Model
from dynx.spatial.scalar import Floats
from dynx.spatial.se3 import inverse
from dynx.spatial.so3 import rotation_from_quat
from dynx.testing.strategies import models

ROUNDING = 1e-12
"""Largest difference of poses and velocities, relative to the largest entry: URDF holds angles as text, and
PyBullet multiplies quaternions."""

# The children of a link are not in the order of their names, and one joint follows, one has no limits.
TREE = """<robot name="tree">
  <link name="base"><inertial><origin xyz="0.1 0 0.05" rpy="0.2 0.1 0"/><mass value="2"/>
    <inertia ixx="0.1" iyy="0.2" izz="0.15" ixy="0" ixz="0" iyz="0"/></inertial></link>
  LINKS
  <joint name="zeta" type="revolute"><parent link="base"/><child link="z"/><origin xyz="0 0.2 0"/>
    <axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
  <joint name="alpha" type="continuous"><parent link="base"/><child link="a"/><origin xyz="0 -0.2 0"/>
    <axis xyz="1 0 0"/></joint>
  <joint name="mid" type="prismatic"><parent link="z"/><child link="m"/><origin xyz="0.3 0 0"/>
    <axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
  <joint name="beta" type="revolute"><parent link="a"/><child link="b"/><origin xyz="0 0 0.4" rpy="0.3 0 0"/>
    <axis xyz="0 1 0"/><limit lower="-3" upper="3" effort="1" velocity="1"/>MIMIC</joint>
</robot>"""

LINK = """<link name="NAME"><inertial><mass value="1"/>
    <inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>"""


def tree(mimic: bool) -> str:
    links = "".join(LINK.replace("NAME", name) for name in "zmab")
    coupling = '<mimic joint="zeta" multiplier="-0.5" offset="0.25"/>' if mimic else ""
    return TREE.replace("LINKS", links).replace("MIMIC", coupling)


Motion = Callable[[Path, EngineOrder, Floats, Floats], dict[str, tuple[Floats, Floats]]]
"""Function of a file, the order, and q and v of dynx, to the pose (4, 4) and twist (6,) of each link in the
world, linear before angular, by calls of an engine alone."""


def by_mujoco(path: Path, order: EngineOrder, q: Floats, v: Floats) -> dict[str, tuple[Floats, Floats]]:
    mujoco = pytest.importorskip("mujoco")
    spec = mujoco.MjSpec.from_file(str(path))
    spec.compiler.fusestatic = False
    if order.model.floating and path.suffix == ".urdf":
        spec.worldbody.first_body().add_freejoint()
    loaded = spec.compile()
    data = mujoco.MjData(loaded)
    data.qpos[:], data.qvel[:] = order.from_dynx(q), order.velocity_from_dynx(q, v)
    mujoco.mj_forward(loaded, data)
    found = {}
    for body in range(1, loaded.nbody):
        twist = np.zeros(6)
        mujoco.mj_objectVelocity(loaded, data, mujoco.mjtObj.mjOBJ_XBODY, body, twist, 0)
        T = pose(data.xmat[body].reshape(3, 3), data.xpos[body])
        found[loaded.body(body).name] = T, np.concatenate([twist[3:], twist[:3]])
    return found


def by_pinocchio(path: Path, order: EngineOrder, q: Floats, v: Floats) -> dict[str, tuple[Floats, Floats]]:
    pin = pytest.importorskip("pinocchio")
    root = [pin.JointModelFreeFlyer()] if order.model.floating else []
    loaded = pin.buildModelFromUrdf(str(path), *root)
    data = loaded.createData()
    pin.forwardKinematics(loaded, data, order.from_dynx(q), order.velocity_from_dynx(q, v))
    pin.updateFramePlacements(loaded, data)
    found = {}
    for number, frame in enumerate(loaded.frames):
        if frame.type == pin.FrameType.BODY:
            twist = pin.getFrameVelocity(loaded, data, number, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)
            found[frame.name] = np.array(data.oMf[number].homogeneous), np.array(twist.vector)
    return found


def by_drake(path: Path, order: EngineOrder, q: Floats, v: Floats) -> dict[str, tuple[Floats, Floats]]:
    pytest.importorskip("pydrake")
    from pydrake.multibody.parsing import Parser
    from pydrake.multibody.plant import MultibodyPlant

    plant: Any = MultibodyPlant(time_step=0.0)
    Parser(plant).AddModels(path)
    if not order.model.floating and path.suffix == ".urdf":
        plant.WeldFrames(plant.world_frame(), plant.GetFrameByName(order.model.root))
    plant.Finalize()
    context = plant.CreateDefaultContext()
    plant.SetPositions(context, order.from_dynx(q))
    plant.SetVelocities(context, order.velocity_from_dynx(q, v))
    found: dict[str, tuple[Floats, Floats]] = {}
    for link in order.model.links:
        body = plant.GetBodyByName(link.name)
        twist = plant.EvalBodySpatialVelocityInWorld(context, body)
        T = plant.EvalBodyPoseInWorld(context, body).GetAsMatrix4()
        found[link.name] = T, np.concatenate([twist.translational(), twist.rotational()])
    return found


def by_pybullet(path: Path, order: EngineOrder, q: Floats, v: Floats) -> dict[str, tuple[Floats, Floats]]:
    bullet = pytest.importorskip("pybullet")
    client = bullet.connect(bullet.DIRECT)
    try:
        flags = bullet.URDF_USE_INERTIA_FROM_FILE
        body = bullet.loadURDF(
            str(path), useFixedBase=not order.model.floating, flags=flags, physicsClientId=client
        )
        x, u = order.from_dynx(q).tolist(), order.velocity_from_dynx(q, v).tolist()
        if order.model.floating:
            bullet.resetBasePositionAndOrientation(body, x[:3], x[3:7], physicsClientId=client)
            bullet.resetBaseVelocity(body, u[:3], u[3:6], physicsClientId=client)
            x, u = x[7:], u[6:]
        infos = [
            bullet.getJointInfo(body, k, physicsClientId=client)
            for k in range(bullet.getNumJoints(body, physicsClientId=client))
        ]
        moving = [info[0] for info in infos if info[2] != bullet.JOINT_FIXED]
        for number, position, speed in zip(moving, x, u, strict=True):
            bullet.resetJointState(body, number, position, speed, physicsClientId=client)
        found = {}
        for info in infos:
            state = bullet.getLinkState(
                body, info[0], computeLinkVelocity=1, computeForwardKinematics=1, physicsClientId=client
            )
            # Bullet has the frame of the link, entries 4 and 5, in single precision.
            T_world_com, T_link_com = (
                pose(rotation_from_quat(np.array(state[k + 1])), state[k]) for k in (0, 2)
            )
            T = T_world_com @ inverse(T_link_com)
            linear, angular = np.array(state[6]), np.array(state[7])
            # Bullet has the velocity of the centre of mass.
            arm = T[:3, 3] - np.array(state[0])
            found[info[12].decode()] = T, np.concatenate([linear + np.cross(angular, arm), angular])
        return found
    finally:
        bullet.disconnect(client)


MOTIONS: dict[str, Motion] = {
    "mujoco": by_mujoco,
    "pinocchio": by_pinocchio,
    "drake": by_drake,
    "pybullet": by_pybullet,
}


def pose(R: Any, p: Any) -> Floats:
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = R, p
    return T


def require_alike(
    engine: str, path: Path, model: Model, seed: int, rounding: float = ROUNDING
) -> EngineOrder:
    """Compare poses and twists of all links with those of an engine that knows nothing of dynx."""
    order: EngineOrder = model.order_of(engine)
    rng = np.random.default_rng(seed)
    q, v = model.random(rng), rng.normal(size=model.nv)
    own = dynx.backend("reference", model)
    poses = dict(zip(model.frame_names, own.forward_kinematics(q), strict=True))
    found = MOTIONS[engine](path, order, q, v)
    compared = 0
    for name, (T, twist) in found.items():
        if name in poses and name != "world":
            assert np.abs(poses[name] - T).max() <= rounding * max(1.0, np.abs(T).max())
            expected = own.jacobian(q, name) @ v
            assert np.abs(expected - twist).max() <= rounding * max(1.0, np.abs(twist).max())
            compared += 1
    assert compared >= min(len(model.joints), 1)
    x, u = order.from_dynx(q), order.velocity_from_dynx(q, v)
    back = order.to_dynx(x)
    missed = model.difference(q, back)
    for name, is_circle in zip(order.joint_names, order.coordinates.circles, strict=True):
        if is_circle and name in model.joint_names:
            k = model.coordinate_index(name)
            missed[k] -= 2.0 * np.pi * np.round(missed[k] / (2.0 * np.pi))
    assert np.abs(missed).max(initial=0.0) <= rounding * 10.0
    assert np.abs(order.velocity_to_dynx(x, u) - v).max(initial=0.0) <= rounding * 10.0
    return order


@pytest.mark.parametrize("engine", MOTIONS)
@pytest.mark.parametrize("base", ["fixed", "floating"])
@pytest.mark.parametrize("mimic", [False, True])
@pytest.mark.parametrize("lock", [{}, {"mid": 0.2}, {"zeta": -0.3, "alpha": 0.1}])
def test_an_engine_is_where_dynx_says(
    tmp_path: Path, engine: str, base: Any, mimic: bool, lock: dict[str, float]
) -> None:
    path = tmp_path / "tree.urdf"
    path.write_text(tree(mimic))
    model = dynx.load(path, base=base, lock=lock)
    order = require_alike(engine, path, model, 3)
    assert len(order.positions) == model.nq
    assert len(order.velocities) == model.nv


@pytest.mark.parametrize("engine", MOTIONS)
def test_arrays_have_leading_axes(tmp_path: Path, engine: str) -> None:
    path = tmp_path / "tree.urdf"
    path.write_text(tree(True))
    model = dynx.load(path, base="floating", lock={"mid": 0.2})
    order, rng = model.order_of(engine), np.random.default_rng(1)
    q, v = model.random(rng, (2, 1)), rng.normal(size=(3, model.nv))
    x, u = order.from_dynx(q), order.velocity_from_dynx(q, v)
    assert x.shape == (2, 1, len(order.coordinates.neutral))
    assert u.shape == (2, 3, order.coordinates.n_velocities)
    for i in range(2):
        assert np.array_equal(x[i, 0], order.from_dynx(q[i, 0]))
        for k in range(3):
            alone = order.velocity_from_dynx(q[i, 0], v[k])
            assert np.abs(u[i, k] - alone).max() <= ROUNDING
    assert order.to_dynx(x).shape == q.shape
    assert np.abs(order.velocity_to_dynx(x, u) - v).max() <= ROUNDING
    with pytest.raises(ShapeError):
        order.from_dynx(np.zeros(3))
    with pytest.raises(ShapeError):
        order.to_dynx(np.zeros(3))


@pytest.mark.parametrize("engine", MOTIONS)
@given(model=models(locks=False, solvable=True, from_urdf=True), seed=st.integers(0, 2**32 - 1))
@settings(max_examples=20)
def test_random_robots_are_where_dynx_says(
    tmp_path_factory: pytest.TempPathFactory, engine: str, model: Model, seed: int
) -> None:
    if model.root == "world" or model.nv == 0:
        return
    path = tmp_path_factory.mktemp("robot") / "robot.urdf"
    path.write_text(model.to_urdf())
    require_alike(engine, path, dynx.load(path, base=model.base), seed)


def test_the_file_of_mujoco_itself(tmp_path: Path) -> None:
    path = tmp_path / "free.xml"
    path.write_text(
        """<mujoco><worldbody><geom type="plane" size="1 1 1"/>
        <body name="a" pos="0 0 1"><freejoint/><geom size="0.1" pos="0.1 0 0"/>
          <body name="b"><joint name="k" ref="20"/><joint name="l" type="slide"/><geom size="0.1"/></body>
        </body></worldbody></mujoco>"""
    )
    model = dynx.load(path)
    order = require_alike("mujoco", path, model, 0)
    assert order.positions.tolist() == [0, 1, 2, 4, 5, 6, 3, 7, 8]
    assert order.velocities.tolist() == list(range(8))
    with pytest.raises(ArgumentError, match=r"the base of .* is fixed, and that of its file floating"):
        model.with_base("fixed").order_of("mujoco")


def test_meshes_that_an_engine_does_not_find_do_not_matter(tmp_path: Path) -> None:
    path = tmp_path / "tree.urdf"
    path.write_text(tree(True))
    want = dynx.load(path).order_of("mujoco").positions.tolist()
    mesh = '<collision><geometry><mesh filename="package://nowhere/part.stl"/></geometry></collision></link>'
    path.write_text(tree(True).replace("</link>", mesh))
    assert "nowhere" in path.read_text()
    assert dynx.load(path).order_of("mujoco").positions.tolist() == want


def test_what_has_no_order_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ArgumentError, match=r"wanted a model that dynx\.load read from a file"):
        dynx.load(tree(False)).order_of("mujoco")
    path = tmp_path / "tree.urdf"
    path.write_text(tree(True).replace('name="zeta" type="revolute"', 'name="zeta" type="fixed"'))
    with pytest.raises(UnsupportedFeatureError, match="'beta' of tree follows a joint that does not move"):
        dynx.load(path).order_of("pinocchio")
    path.write_text(tree(True))
    with pytest.raises(UnknownBackendError, match="did you mean 'mujoco'"):
        dynx.load(path).order_of("mujoc")


def test_an_engine_that_does_not_say_is_named() -> None:
    with pytest.raises(dynx.errors.BackendError, match="does not say in which order"):
        LoadedRobot.coordinates(type("Other", (), {"name": "other"})())


def test_a_refusal_of_ball_joints_says_what_takes_them(tmp_path: Path) -> None:
    path = tmp_path / "ball.xml"
    body = '<body name="b"><joint name="ball" type="ball"/><geom size="0.1" pos="1 0 0"/></body>'
    path.write_text(f"<mujoco><worldbody>{body}</worldbody></mujoco>")
    pytest.importorskip("pinocchio")
    with pytest.raises(UnsupportedFeatureError, match="'mujoco' and 'drake' as they load the file do"):
        dynx.load(path).order_of("pinocchio")
