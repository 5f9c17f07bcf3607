"""Paths whose continuous configurations are known: the planar arm and a single joint with limits."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from dynx.backends import Backend, backend, installed_backends
from dynx.ik.tracking import TrackStatus
from dynx.model import Joint, Link, Model, Pose
from dynx.model.elements import Limits
from dynx.spatial.scalar import Floats
from tests.ik.test_planar_arm import L1, L2, arm, elbow

OK, LIMITED, HELD, JUMPED, TIMED_OUT = TrackStatus
TOLERANCE = 1e-6
"""Default tolerances of `track` [m, rad]."""
RANGE = 3.0
"""Range of the single joint to both sides [rad]."""
SPEED = 2.0
"""Its velocity limit [rad/s]."""


def one_joint() -> Model:
    joint = Joint("joint", "revolute", "base", "tip", limits=Limits(-RANGE, RANGE, velocity=SPEED))
    return Model.build("one", [Link("base"), Link("tip")], [joint])


def rotations(angles: Floats) -> Floats:
    """Return rotations (n, 3, 3) about the axis x of the joint."""
    c, s, zero, one = np.cos(angles), np.sin(angles), np.zeros(len(angles)), np.ones(len(angles))
    rows = [one, zero, zero, zero, c, -s, zero, s, c]
    return np.stack(rows, axis=-1).reshape(-1, 3, 3)


@pytest.fixture(params=["pinocchio", "compiled"])
def joint(request: pytest.FixtureRequest) -> Iterator[Backend]:
    with backend(request.param, one_joint()) as engine:
        yield engine


def radial_path(distances: Floats) -> Floats:
    """Return positions (n, 3) [m] at these distances from the shoulder of the planar arm."""
    return np.stack([distances, np.zeros(len(distances)), np.zeros(len(distances))], axis=-1)


@pytest.mark.parametrize("name", ["pinocchio", "compiled"])
def test_a_path_that_leaves_the_workspace_is_held_stretched_and_continues_where_it_returns(name: str) -> None:
    most = L1 + L2
    distances = np.concatenate([np.linspace(0.9, most + 0.2, 30), np.linspace(most + 0.2, 0.9, 30)])
    bend = elbow(0.9)
    start = np.array([-np.arctan2(L2 * np.sin(bend), L1 + L2 * np.cos(bend)), bend])
    with backend(name, arm()) as engine:
        result = engine.track(radial_path(distances), "tip", start)
    inside = distances < most - 1e-3
    assert (result.status[inside] == OK).all()
    assert (result.position_error[inside] <= TOLERANCE).all()
    outside = distances > most + 1e-3
    assert (result.status[outside] == HELD).all()
    # In the first sample outside the elbow stretches no further than `max_step`.
    error, beyond = result.position_error[outside][1:], distances[outside][1:] - most
    np.testing.assert_allclose(error, beyond, rtol=1e-3)
    np.testing.assert_allclose(np.abs(result.q[inside, 1]), [elbow(d) for d in distances[inside]], atol=1e-4)
    assert not result
    assert result.fraction == pytest.approx((result.status != OK).argmax() / len(distances))


@pytest.mark.parametrize("name", installed_backends())
def test_a_path_through_a_singular_configuration_stays_on_it(name: str) -> None:
    """The tip moves through the shoulder of an arm with equal links, where all its positions are singular."""
    with backend(name, arm()) as engine:
        bends = np.linspace(0.4, -0.4, 81)
        q = np.stack([-0.5 * bends, bends], axis=-1)
        T = engine.forward_kinematics(q, "tip")
        result = engine.track(T, "tip", q[0])
    assert (result.status == OK).all()
    np.testing.assert_allclose(result.q, q, atol=1e-4)


def test_a_limit_holds_the_joint_until_the_target_is_beyond_the_gap(joint: Backend) -> None:
    """Between RANGE and 2 pi - RANGE no angle reaches the target; afterwards only the other end does."""
    angles = np.linspace(RANGE - 0.2, RANGE + 0.6, 41)
    gap = 2.0 * np.pi - 2.0 * RANGE
    result = joint.track(rotations(angles), "tip", [angles[0]], free="position")
    before, between = angles <= RANGE, (angles > RANGE + 1e-5) & (angles < RANGE + gap - 1e-5)
    after = angles > RANGE + gap + 1e-5
    assert (result.status[before] == OK).all()
    assert (result.status[between] == LIMITED).all()
    first = int(after.argmax())
    assert result.status[first] == JUMPED
    assert result.jump[first] == pytest.approx(2.0 * np.pi - (angles[first] - RANGE), abs=1e-5)
    assert (result.status[first + 1 :] == OK).all()
    np.testing.assert_allclose(result.q[after, 0], angles[after] - 2.0 * np.pi, atol=1e-5)
    np.testing.assert_allclose(result.q[between, 0], RANGE, atol=1e-12)
    held = joint.track(rotations(angles), "tip", [angles[0]], free="position", jumps=False)
    assert (held.status[~before] == LIMITED).all()
    np.testing.assert_allclose(held.q[~before, 0], RANGE, atol=1e-12)
    assert not held.jump.any()


def test_a_margin_is_a_limit(joint: Backend) -> None:
    angles = np.linspace(2.0, 2.9, 31)
    result = joint.track(rotations(angles), "tip", [2.0], free="position", limit_margin=0.5, jumps=False)
    assert ((result.status == LIMITED) == (angles > RANGE - 0.5)).all()
    assert result.q.max() <= RANGE - 0.5


def test_a_velocity_limit_is_kept_and_the_path_caught_up(joint: Backend) -> None:
    dt = 0.01
    # Three times too fast for a while, then slow.
    angles = np.concatenate([np.arange(20) * 3.0 * SPEED * dt, np.full(50, 19 * 3.0 * SPEED * dt)])
    result = joint.track(rotations(angles), "tip", [0.0], free="position", dt=dt)
    expected = np.minimum(np.arange(70) * SPEED * dt, angles)
    np.testing.assert_allclose(result.q[:, 0], expected, atol=1e-6)
    assert ((result.status == LIMITED) == (np.abs(result.q[:, 0] - angles) > TOLERANCE)).all()
    assert (np.abs(np.diff(result.q[:, 0])) <= SPEED * dt * (1.0 + 1e-12)).all()
    assert result.status[0] == OK
    assert result.status[-1] == OK
    fast = joint.track(rotations(angles), "tip", [0.0], free="position", dt=dt, velocity_limit=np.inf)
    assert fast
    assert "LIMITED" in result.message
    assert fast.message.startswith("70 samples OK")


def test_steps_longer_than_a_descent_are_divided(joint: Backend) -> None:
    """Two samples are 5 rad apart: between them the joint turns the way that the pose turns."""
    result = joint.track(rotations(np.array([-2.5, 0.0, 2.5])), "tip", [-2.5], free="position")
    assert result
    np.testing.assert_allclose(result.q[:, 0], [-2.5, 0.0, 2.5], atol=1e-6)


@pytest.mark.parametrize("name", ["pinocchio", "compiled"])
def test_the_start_is_chosen_from_which_the_whole_path_is_ok(name: str) -> None:
    """The elbow may bend by 2 rad one way and by 1 rad the other; the path needs 1.8 rad at its end."""
    z = (0.0, 0.0, 1.0)
    model = Model.build(
        "planar",
        [Link("base"), Link("upper"), Link("tip")],
        [
            Joint("shoulder", "revolute", "base", "upper", axis=z, limits=Limits(-3.0, 3.0)),
            Joint(
                "elbow", "revolute", "upper", "tip", Pose((L1, 0.0, 0.0)), axis=z, limits=Limits(-1.0, 2.0)
            ),
        ],
    )
    bends = np.linspace(0.5, 1.8, 40)
    distances = np.sqrt(L1**2 + L2**2 + 2.0 * L1 * L2 * np.cos(bends))
    targets = radial_path(distances)
    with backend(name, model) as engine:
        chosen = engine.track(targets, "tip", point=[L2, 0.0, 0.0])
        q0 = chosen.q[0] * [-1.0, -1.0]
        other = engine.track(targets, "tip", q0, point=[L2, 0.0, 0.0], jumps=False)
        jumping = engine.track(targets, "tip", q0, point=[L2, 0.0, 0.0])
    assert chosen
    np.testing.assert_allclose(chosen.q[:, 1], bends, atol=1e-4)
    limited = bends > 1.0 + 1e-3
    assert (other.status[limited] == LIMITED).all()
    assert (other.status[~limited] == OK)[:-1].all()
    assert int((jumping.status == JUMPED).sum()) == 1
    assert jumping.jump.max() == pytest.approx(2.0, abs=0.1)
    assert (jumping.q[limited, 1] > 0.0).all()
