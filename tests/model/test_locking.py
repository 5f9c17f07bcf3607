"""A locked joint is removed from q; poses and inertia equal those with the joint at that position."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynx.errors import UnknownNameError
from dynx.model import Model
from dynx.model.loading import load
from dynx.testing.strategies import configurations, models
from tests.model.placement import frame_poses, total_inertia
from tests.spatial.rounding import assert_same_to_rounding


@given(st.data())
def test_locking_equals_holding_the_joint(data: st.DataObject) -> None:
    model = data.draw(models(max_links=6, locks=False))
    q = data.draw(configurations(model))
    base = model.nq - len(model.joint_names)
    held = data.draw(st.sets(st.sampled_from(model.joint_names))) if model.joint_names else set()
    values = dict(zip(model.joint_names, q[base:].tolist(), strict=True))
    locked = load(model, lock={name: values[name] for name in held})

    assert locked.joint_names == tuple(name for name in model.joint_names if name not in held)
    assert locked.frame_names == model.frame_names
    q_locked = np.concatenate([q[:base], [values[name] for name in locked.joint_names]])
    size = 4.0 * (1.0 + float(np.max(np.abs(q), initial=0.0)))
    for now, before in zip(frame_poses(locked, q_locked), frame_poses(model, q), strict=True):
        assert_same_to_rounding(now, before, 64 * len(model.links), size=size)
    now_inertia, before_inertia = total_inertia(locked, q_locked), total_inertia(model, q)
    weight = max(1.0, sum(abs(link.inertial.mass) for link in model.links if link.inertial))
    reach = size * len(model.links)
    for field in ("mass", "first_moment", "rotational_inertia"):
        assert_same_to_rounding(
            getattr(now_inertia, field),
            getattr(before_inertia, field),
            128 * len(model.links),
            size=weight * reach**2,
        )


@given(st.data())
def test_locking_in_two_steps_equals_locking_at_once(data: st.DataObject) -> None:
    model = data.draw(models(max_links=5, locks=False))
    lock = dict.fromkeys(model.joint_names, 0.5)
    one_by_one = model
    for name in model.joint_names:
        one_by_one = load(one_by_one, lock={name: 0.5})
    at_once = load(model, lock=lock)
    assert one_by_one == at_once
    assert at_once.joint_names == ()
    assert all(not joint.moves for joint in at_once.joints)


def test_followers_of_a_locked_joint_are_fixed() -> None:
    model = load("romeo")
    followers = [joint for joint in model.joints if joint.mimic is not None]
    assert followers
    for follower in followers:
        mimic = follower.mimic
        assert mimic is not None
        locked = load("romeo", lock={mimic.joint: 0.25})
        assert locked.joint(follower.name).locked_at == mimic.multiplier * 0.25 + mimic.offset
        assert len(locked.notes) == len(model.notes)


def test_a_follower_may_be_locked_alone() -> None:
    model = load("romeo")
    follower = next(joint for joint in model.joints if joint.mimic is not None)
    locked = load(model, lock={follower.name: 0.125})
    assert locked.joint_names == model.joint_names
    assert (locked.joint(follower.name).locked_at, locked.joint(follower.name).mimic) == (0.125, None)


@pytest.mark.parametrize("name", ["no_such_joint", "ee_fixed_joint", "tool0"])
def test_the_error_names_a_joint_that_cannot_be_locked(name: str) -> None:
    with pytest.raises(UnknownNameError, match=f"cannot lock '{name}'"):
        load("ur5", lock={name: 0.0})


def test_the_error_for_the_coordinate_of_a_locked_joint() -> None:
    model: Model = load("ur5", lock={"elbow_joint": 0.0})
    with pytest.raises(UnknownNameError, match="'elbow_joint' of ur5 has no coordinate: it is locked"):
        model.coordinate_index("elbow_joint")
