"""Origins: orientations as quaternions, in robots of URDF 1.1 and later."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynx.errors import DescriptionError
from dynx.model import Model, Pose
from dynx.model.loading import load
from dynx.model.urdf.reader import reads_quaternions
from dynx.spatial.so3 import rotation_from_quat
from dynx.testing.strategies import unit_vectors
from tests.model.descriptions import INERTIAL, joint, link

EPS = np.finfo(float).eps
HALF = math.sqrt(0.5)

numbers = st.floats(-1.0, 1.0)
quaternions = st.tuples(numbers, numbers, numbers, numbers).filter(lambda q: math.hypot(*q) > 1e-3)


def with_origin(attributes: str, version: str = ' version="1.2"') -> Model:
    text = joint(f'<origin {attributes}/><axis xyz="0 0 1"/>')
    return load(text.replace("<robot ", f"<robot{version} "))


def messages(model: Model) -> str:
    return "\n".join(str(note) for note in model.notes)


@given(quaternions, st.sampled_from([1.0, 1e-6, 3.0, 1e6]))
def test_a_quaternion_of_any_length_is_its_rotation(quaternion: tuple[float, ...], scale: float) -> None:
    words = " ".join(repr(scale * part) for part in quaternion)
    pose = with_origin(f'xyz="1 2 3" quat_xyzw="{words}"').joints[0].origin
    R = rotation_from_quat(np.array(quaternion) / math.hypot(*quaternion))
    assert pose.xyz == (1.0, 2.0, 3.0)
    assert np.max(np.abs(pose.matrix[:3, :3] - R)) <= 16 * EPS


@given(unit_vectors(), st.sampled_from([-HALF, HALF]), st.floats(-1e-7, 1e-7))
def test_a_pitch_near_a_right_angle_loses_no_digits(
    axis: np.ndarray[tuple[int, ...], np.dtype[np.float64]], sine: float, off: float
) -> None:
    pitch = np.array([0.0, sine + off, 0.0, HALF])
    quaternion = pitch + 1e-9 * np.append(axis, 0.0)
    quaternion /= np.linalg.norm(quaternion)
    pose = with_origin(f'quat_xyzw="{" ".join(map(repr, quaternion.tolist()))}"').joints[0].origin
    assert np.max(np.abs(pose.matrix[:3, :3] - rotation_from_quat(quaternion))) <= 16 * EPS


def test_the_origin_of_an_inertial_has_a_quaternion_too() -> None:
    text = link(INERTIAL.replace('rpy="0.4 0.5 0.6"', f'quat_xyzw="0 0 {HALF!r} {HALF!r}"'))
    model = load(text.replace("<robot ", '<robot version="1.1" '))
    assert model.inertial("a").origin.rpy == pytest.approx((0.0, 0.0, math.pi / 2.0), abs=4 * EPS)
    assert load(model.to_urdf()) == model


def test_a_length_that_is_not_1_is_noted() -> None:
    assert "the quaternion in <origin> of joint 'j' has length 2; it was scaled to 1" in messages(
        with_origin('quat_xyzw="0 0 0 2"')
    )
    assert "length" not in messages(with_origin('quat_xyzw="0 0 0 1"'))


@pytest.mark.parametrize("version", ["", ' version="1.0"', ' version="one"'])
def test_without_a_version_of_urdf_that_has_quaternions_they_are_ignored(version: str) -> None:
    model = with_origin('xyz="1 0 0" rpy="0.1 0 0" quat_xyzw="x"', version)
    assert model.joints[0].origin == Pose((1.0, 0.0, 0.0), (0.1, 0.0, 0.0))
    assert "line 5: quat_xyzw in <origin> of joint 'j' is ignored: it is part of URDF 1.1" in messages(model)


@pytest.mark.parametrize("version", ["1.1", "1.2", " 1.2", "2.0", "3", "1.2.0"])
def test_versions_of_urdf_with_quaternions(version: str) -> None:
    assert reads_quaternions(version)


@pytest.mark.parametrize("version", ["1.0", "1", "0.9", "", "new", None])
def test_versions_of_urdf_without_quaternions(version: str | None) -> None:
    assert not reads_quaternions(version)


@pytest.mark.parametrize(
    ("attributes", "message"),
    [
        ('rpy="0 0 0" quat_xyzw="0 0 0 1"', "has both rpy and quat_xyzw; wanted one of them"),
        ('quat_xyzw="0 0 0 0"', "is '0 0 0 0', which is no rotation; wanted x y z w of length 1"),
        ('quat_xyzw="1e200 0 0 0"', "which is no rotation"),
        ('quat_xyzw="0 0 1"', "is '0 0 1'; wanted four numbers separated by white space"),
        ('quat_xyzw="0 0 0 0 1"', "wanted four numbers"),
        ('quat_xyzw="0,0,0,1"', "wanted four numbers"),
        ('quat_xyzw=""', "is ''; wanted four numbers"),
        ('quat_xyzw="nan 0 0 1"', "wanted four numbers"),
        ('quat_xyzw="${q}"', "xacro"),
    ],
)
def test_a_bad_quaternion_is_refused_with_its_line(attributes: str, message: str) -> None:
    with pytest.raises(DescriptionError) as caught:
        with_origin(attributes)
    assert caught.value.line == 5
    assert message in str(caught.value)
