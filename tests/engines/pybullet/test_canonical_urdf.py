from __future__ import annotations

import xml.etree.ElementTree as ET

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from dynx.engines.pybullet.canonical_urdf import ballast_for, bullet_tree, locale_free, write_bullet_urdf
from dynx.model import Model
from dynx.model.mechanism import build_mechanism
from dynx.spatial.scalar import longdouble
from dynx.spatial.so3 import rotation_from_quat, rotation_from_rpy, rpy_from_rotation
from dynx.testing.strategies import models
from tests.backends.robots import mixed_robot

EPS = float(np.finfo(np.float64).eps)


@given(st.floats(allow_nan=False, allow_infinity=False))
@example(-0.0)
@example(5e-324)
@example(1.7976931348623157e308)
def test_numbers_read_back_whatever_the_decimal_mark(number: float) -> None:
    text = locale_free(number)
    assert float(text) == number
    assert not set(text) & set(".,")


@given(
    st.floats(-np.pi, np.pi),
    st.sampled_from((np.pi / 2, -np.pi / 2, 0.0)),
    st.floats(-17.0, 0.0),
    st.floats(-np.pi, np.pi),
)
def test_roll_pitch_yaw_are_exact_near_and_at_the_poles(
    roll: float, pole: float, exponent: float, yaw: float
) -> None:
    R = rotation_from_rpy(longdouble([roll, pole + 10.0**exponent, yaw]))
    again = rotation_from_rpy(longdouble(rpy_from_rotation(R).astype(np.float64)))
    # Each angle, up to pi, is rounded to float64 once.
    assert float(np.max(np.abs(again - R))) <= 3 * np.pi * EPS


def test_roll_pitch_yaw_of_rounded_matrices() -> None:
    quats = np.random.default_rng(0).standard_normal((500, 4))
    for quat in quats / np.linalg.norm(quats, axis=1, keepdims=True):
        R = rotation_from_quat(quat)
        assert np.max(np.abs(rotation_from_rpy(rpy_from_rotation(R)) - R)) <= 12 * EPS


@given(models(physical=False))
def test_the_file_is_plain_whatever_the_names(model: Model) -> None:
    mechanism = build_mechanism(model, longdouble)
    text = write_bullet_urdf(bullet_tree(mechanism, ballast_for(mechanism), 1))
    assert text.isascii()
    assert max(map(len, text.splitlines())) < 256
    assert "%" not in text
    robot = ET.fromstring(text)
    assert [link.get("name") for link in robot.iter("link")] == [
        "b",
        *(f"l{k}" for k in range(len(mechanism.bodies))),
    ]
    assert all(joint.get("type") in ("continuous", "prismatic") for joint in robot.iter("joint"))
    assert all(link.find("inertial/mass") is not None for link in robot.iter("link"))


@pytest.mark.parametrize("base", ["fixed", "floating"])
def test_only_a_floating_root_has_inertia(base: str) -> None:
    mechanism = build_mechanism(mixed_robot(base), longdouble)
    tree = bullet_tree(mechanism, ballast_for(mechanism), 1)
    assert (tree.root.mass > 0.0) is (base == "floating")
    robot = ET.fromstring(write_bullet_urdf(tree))
    # The root's frame is its inertial frame.
    origin = robot.find("link/inertial/origin")
    assert origin is not None
    assert [float(x) for x in f"{origin.get('xyz')} {origin.get('rpy')}".split()] == [0.0] * 6
