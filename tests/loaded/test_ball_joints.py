"""Ball joints of robots as MuJoCo and Drake load them: the order of coordinates, results in those of dynx."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import dynx
from dynx.errors import UnsupportedFeatureError
from dynx.loaded import installed_engines, load_as
from dynx.model import JointDynamics, Limits, Model
from tests.error_bounds import ErrorBounds, samples_at
from tests.sim.test_ball_joints import arm, each_base

mujoco = pytest.importorskip("mujoco")


def in_file(model: Model, folder: Path) -> Model:
    path = folder / "arm.xml"
    path.write_text(model.to_mjcf())
    return dynx.load(path)


@each_base
def test_the_order_of_mujoco(base: Any, tmp_path: Path) -> None:
    """The converted state has the same poses and velocities in MuJoCo, and converts back."""
    model = in_file(arm(base, JointDynamics(0.0, 0.0, 0.1), Limits(upper=2.0)), tmp_path)
    order = model.order_of("mujoco")
    rng = np.random.default_rng(0)
    q, v = model.random(rng, 3), rng.uniform(-1.0, 1.0, (3, model.nv))
    qpos, qvel = order.from_dynx(q), order.velocity_from_dynx(q, v)
    np.testing.assert_allclose(order.to_dynx(qpos), q, atol=1e-15)
    np.testing.assert_allclose(order.velocity_to_dynx(qpos, qvel), v, atol=1e-14)
    shoulder = model.position_index("shoulder")
    np.testing.assert_array_equal(order.positions[shoulder : shoulder + 4], shoulder + np.array([1, 2, 3, 0]))
    engine = mujoco.MjModel.from_xml_path(model.source)
    data = mujoco.MjData(engine)
    with dynx.backend("reference", model) as bodies:
        for k in range(3):
            data.qpos[:], data.qvel[:] = qpos[k], qvel[k]
            mujoco.mj_forward(engine, data)
            T = bodies.forward_kinematics(q[k], "hand")
            np.testing.assert_allclose(data.body("hand").xpos, T[:3, 3], atol=1e-12)
            np.testing.assert_allclose(data.body("hand").xmat.reshape(3, 3), T[:3, :3], atol=1e-12)
            twist = np.zeros(6)
            number, kind = engine.body("hand").id, mujoco.mjtObj.mjOBJ_XBODY
            mujoco.mj_objectVelocity(engine, data, kind, number, twist, 0)
            found = bodies.frame_velocity(q[k], v[k], "hand")
            np.testing.assert_allclose(twist, [*found[3:], *found[:3]], atol=1e-12)


def test_locked_joints_keep_their_place(tmp_path: Path) -> None:
    in_file(arm(), tmp_path)
    model = dynx.load(tmp_path / "arm.xml", lock={"elbow": 0.4})
    order = model.order_of("mujoco")
    q = model.random(0)
    assert order.from_dynx(q).tolist() == [
        *(q[k] for k in (3, 0, 1, 2)),
        0.4,
        *(q[k] for k in (7, 4, 5, 6)),
        q[8],
    ]
    v = np.arange(1.0, 8.0)
    assert order.velocity_from_dynx(q, v).tolist() == [1.0, 2.0, 3.0, 0.0, 4.0, 5.0, 6.0, 7.0]


@pytest.mark.parametrize("taker", ["mujoco", "drake"])
@each_base
def test_results_are_in_the_coordinates_of_dynx(base: Any, taker: str, tmp_path: Path) -> None:
    if taker not in installed_engines():
        pytest.skip(f"needs {taker}")
    model = in_file(arm(base), tmp_path)
    rng = np.random.default_rng(0)
    q, (v, a) = model.random(rng), rng.uniform(-1.0, 1.0, (2, model.nv))
    bounds = ErrorBounds(samples_at(model, q, v, a))
    with load_as(taker, model.source, model) as engine, dynx.backend("reference", model) as bodies:
        bounds.check("mass_matrix", engine.mass_matrix(q), bodies.mass_matrix(q))
        bounds.check("inverse_dynamics", engine.inverse_dynamics(q, v, a), bodies.inverse_dynamics(q, v, a))
        hand = engine.link_poses(q)[model.frame_index("hand")]
        bounds.check("forward_kinematics", hand, bodies.forward_kinematics(q, "hand"))
        J = bodies.jacobian(q, "hand")
        bounds.check("jacobian", engine.jacobian(q, "hand"), J)


def test_other_engines_refuse_by_name(tmp_path: Path) -> None:
    model = in_file(arm(), tmp_path)
    for engine, module in (("pybullet", "pybullet"), ("pinocchio", "pinocchio")):
        pytest.importorskip(module)
        with pytest.raises(UnsupportedFeatureError, match=f"'shoulder' .* the comparison with '{engine}', "):
            load_as(engine, model.source, model)


def test_drake_has_no_order_of_ball_joints(tmp_path: Path) -> None:
    pytest.importorskip("pydrake")
    model = in_file(arm(), tmp_path)
    refusal = r"'shoulder' .* the order of the coordinates of 'drake'"
    with pytest.raises(UnsupportedFeatureError, match=refusal):
        model.order_of("drake")
