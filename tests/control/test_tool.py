"""Tools behind a force-torque sensor are identified and taken out of its readings."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import dynx
from dynx.control import PD, SensorMotion, Tool, identify_tool
from dynx.errors import ArgumentError, DTypeError, ShapeError, UnknownNameError
from dynx.rbd.parameters import Payload, plant_model
from dynx.spatial.scalar import Floats
from dynx.spatial.so3 import rotation_from_quat

G = 9.81
BAR = 1e-3
"""Largest part of the weight that compensation leaves."""


def orientations(rng: np.random.Generator, n: int) -> Floats:
    """Return n random poses (n, 4, 4)."""
    T = np.tile(np.eye(4), (n, 1, 1))
    quats = rng.standard_normal((n, 4))
    T[:, :3, :3] = rotation_from_quat(quats / np.linalg.norm(quats, axis=1, keepdims=True))
    return T


@given(st.integers(0, 10_000), st.floats(0.05, 20.0), st.lists(st.floats(-0.3, 0.3), min_size=3, max_size=3))
def test_weights_in_closed_form(seed: int, mass: float, center: list[float]) -> None:
    """Readings of a weight, written out: R' (0, 0, m g) and c x R' (0, 0, m g), and a bias."""
    rng = np.random.default_rng(seed)
    T, bias = orientations(rng, 12), rng.standard_normal(6)
    up = mass * G * T[:, 2, :3]
    exact = np.hstack([up, np.cross(center, up)]) + bias
    motion = SensorMotion.at_rest(T)
    tool = identify_tool(exact, motion)
    weight = mass * G
    np.testing.assert_allclose(tool.mass, mass, rtol=1e-9)
    np.testing.assert_allclose(tool.center, center, rtol=0, atol=1e-9)
    np.testing.assert_allclose(tool.bias, bias, rtol=0, atol=1e-9 * (1.0 + weight))
    assert tool.inertia is None
    # Noise of 0.5 % of the weight in 200 readings, as that of a sensor.
    T = orientations(rng, 200)
    up = weight * T[:, 2, :3]
    exact = np.hstack([up, np.cross(center, up)]) + bias
    noisy = exact + 5e-3 * weight * rng.standard_normal(exact.shape)
    motion = SensorMotion.at_rest(T)
    tool = identify_tool(noisy, motion)
    left = tool.compensate(exact, motion)
    np.testing.assert_allclose(tool.residual, 5e-3 * weight, rtol=0.15)
    assert np.sqrt(np.mean(np.sum(left**2, axis=1))) < 2.0 * BAR * weight


@pytest.mark.parametrize(("name", "frame"), [("ur5", "tool0"), ("panda", "panda_hand")])
def test_a_tool_on_a_moving_arm(name: str, frame: str) -> None:
    """What the wrist of an arm transmits, read in the frame of the tool, with a tensor and in contact."""
    bare = dynx.load(name)
    tensor = np.array([[0.02, 0.003, -0.001], [0.003, 0.03, 0.002], [-0.001, 0.002, 0.015]])
    held = Payload(frame, 1.3, (0.03, -0.02, 0.11), tensor)
    arm = plant_model(bare, held)
    joint = next(k for k, each in enumerate(arm.joints) if each.name.startswith("payload"))
    rng = np.random.default_rng(1)
    q0, goal = bare.random(rng), bare.random(rng)
    law = PD(bare, kp=40.0, kd=3.0)
    options: dict[str, Any] = {
        "duration": 0.6,
        "plant": "compiled",
        "payload": held,
        "check_reference": False,
    }
    rollout = dynx.simulate(bare, law, goal, q0=q0, **options)
    bias = rng.standard_normal(6)

    def motion_of(log: dynx.Rollout) -> SensorMotion:
        return SensorMotion.of_robot(bare, frame, log.q[:-1], log.v[:-1], log.a)

    readings = rollout.joint_wrenches(frame=frame)[:, joint] + bias
    motion = motion_of(rollout)
    tool = identify_tool(readings, motion)
    assert tool.inertia is not None
    np.testing.assert_allclose(tool.mass, 1.3, rtol=1e-6)
    np.testing.assert_allclose(tool.center, held.center, rtol=0, atol=1e-6)  # type: ignore[arg-type]
    np.testing.assert_allclose(tool.inertia, tensor, rtol=0, atol=1e-6)
    np.testing.assert_allclose(tool.bias, bias, rtol=0, atol=1e-5)
    assert np.abs(tool.compensate(readings, motion)).max() < BAR * 1.3 * G
    again = plant_model(bare, tool.payload(frame))
    assert abs(again.total_mass - arm.total_mass) < 1e-6

    # A sensor on the joint that carries the frame bears the link of the frame too, and feels a push on it.
    link = bare.frames[bare.frame_index(frame)].link
    mount = next(k for k, each in enumerate(arm.joints) if each.child == link)
    carried = identify_tool(rollout.joint_wrenches(frame=frame)[:, mount], motion, bias=False)
    assert carried.mass >= tool.mass - 1e-6
    push = dynx.ExternalForce(frame, (3.0, -4.0, 5.0, 0.1, 0.2, 0.3), reference="local")
    touched = dynx.simulate(bare, law, goal, q0=q0, pushes=push, **options)
    # The fingers of the hand move a little.
    left = BAR * carried.mass * G
    felt = carried.compensate(touched.joint_wrenches(frame=frame)[:, mount], motion_of(touched))
    np.testing.assert_allclose(-felt, np.broadcast_to(np.asarray(push.wrench), felt.shape), rtol=0, atol=left)


def test_readings_that_do_not_determine_a_tool() -> None:
    rng = np.random.default_rng(2)
    T = orientations(rng, 5)
    wrench = np.zeros((5, 6))
    same = np.tile(T[:1], (5, 1, 1))
    with pytest.raises(
        ArgumentError, match=r"5 readings do not determine .*m, mcx.*gravity in its axes are one"
    ):
        identify_tool(wrench, SensorMotion.at_rest(same))
    # Turned about the vertical axis, gravity keeps its direction.
    spun = same.copy()
    for k, angle in enumerate((0.0, 0.5, 1.0, 2.0, 3.0)):
        c, s = np.cos(angle), np.sin(angle)
        spun[k, :3, :3] = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) @ T[0, :3, :3]
    with pytest.raises(ArgumentError, match="are one; turn it about a horizontal axis"):
        identify_tool(wrench, SensorMotion.at_rest(spun))
    with pytest.raises(ArgumentError, match=r"bias of torque.*lie on a line"):
        identify_tool(wrench[:2], SensorMotion.at_rest(T[:2]))
    with pytest.raises(ArgumentError, match=r"mcx.*are parallel"):
        identify_tool(wrench, SensorMotion.at_rest(spun), bias=False)
    slow = SensorMotion(
        SensorMotion.at_rest(T).acceleration, 1e-6 * rng.standard_normal((5, 3)), np.zeros((5, 3))
    )
    with pytest.raises(ArgumentError, match=r"Ixx.*hardly turns.*inertia=False"):
        identify_tool(wrench, slow)
    up = 2.0 * G * T[:, 2, :3]
    weight = np.hstack([up, np.cross([0.0, 0.0, 0.1], up)])
    assert abs(identify_tool(weight, slow, inertia=False).mass - 2.0) < 1e-5
    assert abs(identify_tool(weight[:3], SensorMotion.at_rest(T[:3])).mass - 2.0) < 1e-9
    with pytest.raises(ArgumentError, match="mass of -2 kg"):
        identify_tool(-weight, SensorMotion.at_rest(T))
    with pytest.raises(ShapeError, match=r"\(5, 6\)"):
        identify_tool(weight[:4], SensorMotion.at_rest(T))
    with pytest.raises(ShapeError, match=r"\(n, 4, 4\)"):
        SensorMotion.at_rest(T[0, 0])
    with pytest.raises(UnknownNameError, match="tool0"):
        SensorMotion.of_robot(dynx.load("ur5"), "tool", np.zeros((3, 6)))


def test_a_known_tool_needs_no_readings() -> None:
    center = (0.01, 0.0, 0.05)
    tool = Tool(0.9, center, np.eye(3) * 1e-3)  # type: ignore[arg-type]
    rest = SensorMotion.at_rest(np.eye(4)[None])
    up = np.array([0.0, 0.0, 0.9 * G])
    np.testing.assert_allclose(tool.wrench(rest), [[*up, *np.cross(center, up)]], rtol=1e-12)
    np.testing.assert_allclose(tool.compensate(tool.wrench(rest), rest), np.zeros((1, 6)), atol=1e-12)
    with pytest.raises(ShapeError, match=r"center of a tool has shape \(2,\)"):
        Tool(0.9, np.zeros(2))
    with pytest.raises(DTypeError, match="mass"):
        Tool("heavy", np.zeros(3))  # type: ignore[arg-type]
