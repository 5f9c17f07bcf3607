"""Invalid arguments of `track` raise errors that name them; results print readably."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from dynx import trajectory
from dynx.backends import Backend, backend
from dynx.errors import ArgumentError, ClosedError, NotFiniteError, ShapeError, UnknownNameError
from dynx.model.loading import load
from dynx.spatial.so3 import rotation_from_rpy
from tests.oracles.closed_form import MODELS

PATH = np.tile(np.eye(4), (3, 1, 1))
MOTION = trajectory.cubic(np.zeros(2), np.ones(2), 1.0)


@pytest.fixture(params=["pinocchio", "compiled"])
def engine(request: pytest.FixtureRequest) -> Iterator[Backend]:
    with backend(request.param, load(MODELS / "six_axis_arm.urdf")) as engine:
        yield engine


@pytest.mark.parametrize(
    ("targets", "options", "error", "message"),
    [
        (np.eye(4), {}, ShapeError, r"\(4, 4\); wanted a path"),
        (np.zeros((0, 4, 4)), {}, ShapeError, "n at least 1"),
        (np.full((2, 3), np.nan), {}, NotFiniteError, "finite"),
        (MOTION, {}, ArgumentError, "give dt"),
        (MOTION, {"dt": 0.1}, ShapeError, "2 coordinates; wanted 6"),
        (PATH, {"dt": 0.0}, ArgumentError, "dt is '0.0'; wanted a positive number"),
        (PATH, {"velocity_limit": 1.0}, ArgumentError, "without dt"),
        (PATH, {"dt": 0.1, "velocity_limit": [1.0]}, ShapeError, r"\(1,\); wanted one number, or \(6,\)"),
        (PATH, {"dt": 0.1, "velocity_limit": -1.0}, ArgumentError, "least entry -1"),
        (PATH, {"dt": 0.1, "jumps": True}, ArgumentError, "a jump would violate"),
        (PATH, {"jumps": 1}, ArgumentError, "jumps is '1'"),
        (PATH, {"max_step": 0.0}, ArgumentError, "max_step is '0.0'"),
        (PATH, {"max_starts": 0}, ArgumentError, "max_starts is '0'"),
        (PATH, {"limit_margin": -0.1}, ArgumentError, "margin is '-0.1'"),
        (
            PATH,
            {"limit_margin": 100.0},
            ArgumentError,
            "'joint1' no range.*; wanted at most half",
        ),
        (PATH, {"position_tolerance": 0}, ArgumentError, "position_tolerance is '0'"),
        (PATH, {"q0": np.zeros((2, 6))}, None, ""),
        (
            np.tile(PATH, (3, 1, 1, 1)),
            {"q0": np.zeros((2, 6))},
            ShapeError,
            r"targets have \(3,\), q0 has \(2,\)",
        ),
        (PATH, {"q0": np.zeros(5)}, ShapeError, "q0"),
        (PATH, {"free": "turn"}, ArgumentError, "free is 'turn'"),
        (PATH, {"free": "position", "point": np.ones(3)}, ArgumentError, "no effect"),
        (PATH, {"rng": "seed"}, ArgumentError, "rng is 'seed'"),
        (PATH, {"max_stp": 0.1}, UnknownNameError, "track has no option 'max_stp'; did you mean 'max_step'"),
    ],
)
def test_arguments(
    engine: Backend, targets: Any, options: dict[str, Any], error: type[Exception] | None, message: str
) -> None:
    if error is None:
        assert engine.track(targets, "flange", **options).q.shape == (2, 3, 6)
        return
    with pytest.raises(error, match=message):
        engine.track(targets, "flange", **options)


def test_an_unknown_frame_and_a_closed_backend_raise(engine: Backend) -> None:
    with pytest.raises(UnknownNameError, match="flange"):
        engine.track(PATH, "flang")
    engine.close()
    with pytest.raises(ClosedError):
        engine.track(PATH, "flange")


def test_results_print_their_statuses(engine: Backend) -> None:
    T = engine.forward_kinematics(np.linspace(0.2, 0.4, 5)[:, None] * np.ones(6), "flange")
    T[3:, 0, 3] += 10.0
    result = engine.track(T, "flange", np.full(6, 0.2), jumps=False)
    assert result.message.startswith("5 samples (3 OK, 2 ")
    assert "the first that is not OK is number 3" in repr(result)
    assert "tracking" in result._repr_html_()


def test_the_first_sample_that_is_not_reached_has_a_reason(engine: Backend) -> None:
    """A proof, a joint at a limit, or a jump; nothing where all samples are OK."""
    q0, model = np.full(6, 0.2), engine.model
    T = engine.forward_kinematics(np.linspace(0.2, 0.4, 5)[:, None] * np.ones(6), "flange")
    assert engine.track(T, "flange", q0).reason == ""
    far = T.copy()
    far[3:, 0, 3] += 10.0
    proof = str(engine.inverse_kinematics(far[3], "flange").proof)
    result = engine.track(far, "flange", q0, jumps=False)
    assert proof.split("the chain reaches")[-1] in result.reason
    assert result.message.endswith(result.reason)
    near = T.copy()
    near[:, 0, 3] += np.linspace(0.0, 5.0, 5)
    held = engine.track(near, "flange", q0, jumps=False)
    assert "out of reach: " in held.reason
    slow = engine.track(T, "flange", q0, dt=0.1, velocity_limit=[1.0, 1.0, 1e-3, 1.0, 1.0, 1.0])
    assert "joint3" in slow.reason
    assert slow.reason.endswith("at the velocity limit")
    sweep = np.full((60, 6), 0.2)
    sweep[:, 0] += np.linspace(0.0, model.upper[0] - 0.2 + 0.3, 60)
    limited = engine.track(engine.forward_kinematics(sweep, "flange"), "flange", q0, jumps=False)
    assert limited.reason.endswith("at the position limit")
    assert "joint1" in limited.reason
    jumped = engine.track(engine.forward_kinematics(sweep, "flange"), "flange", q0)
    change = jumped.jump[np.flatnonzero(~jumped.ok)[0]]
    assert jumped.reason.endswith(f"was found; a joint changes by {change:.3g}")


def test_a_rotation_about_the_tool_axis_may_be_free(engine: Backend) -> None:
    """A path whose targets are turned about their z axes at random is followed as if they were not."""
    q0, count = np.full(6, 0.2), 8
    plain = engine.forward_kinematics(np.linspace(0.2, 0.4, count)[:, None] * np.ones(6), "flange")
    turned = plain.copy()
    for T, angle in zip(turned, np.random.default_rng(5).uniform(-np.pi, np.pi, count), strict=True):
        T[:3, :3] = T[:3, :3] @ rotation_from_rpy(np.array([0.0, 0.0, angle]))
    found = engine.track(turned, "flange", q0, free="rotation_z")
    assert found
    reached = engine.forward_kinematics(found.q, "flange")
    np.testing.assert_allclose(reached[:, :3, 3], plain[:, :3, 3], atol=2e-6)
    np.testing.assert_allclose(reached[:, :3, 2], plain[:, :3, 2], atol=2e-6)
    assert np.abs(np.diff(found.q, axis=0)).max() <= 0.2
    coarse = engine.track(turned[[0, -1]], "flange", q0, free="rotation_z", max_step=0.02)
    assert coarse, coarse.message
    assert not engine.track(turned, "flange", q0, jumps=False)
    with pytest.raises(ArgumentError, match="an axis of poses"):
        engine.track(plain[:, :3, 3], "flange", q0, free="rotation_z")


def test_a_start_outside_the_limits_is_noted(engine: Backend) -> None:
    q0 = engine.model.neutral()
    q0[2] = 99.0
    found = engine.track(PATH, "flange", q0, jumps=False)
    assert f"joint3 from 99 to {engine.model.upper[2]:.6g}" in found.note
    assert found.note in repr(found)
    assert engine.track(PATH, "flange", jumps=False).note == ""
