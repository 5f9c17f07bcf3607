"""Bounds on the reach: exact where a chain is simple, and never against a pose that a configuration takes."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynx.backends import backend
from dynx.ik.reach.bounds import AngleBound, DistanceBound, HeightBound
from dynx.ik.reach.intervals import Interval, rotated_product
from dynx.ik.reach.proof import frame_bounds
from dynx.model import Joint, Limits, Link, Model, Pose
from dynx.model.loading import load
from dynx.spatial.scalar import Floats
from dynx.spatial.so3 import rotation_from_rpy
from dynx.testing.strategies import configurations, models
from tests.oracles.closed_form import MODELS

ROUNDING = 1e-9
"""Rounding of a bound, relative and [m]."""
ANGLE_ROUNDING = 1e-7
"""Rounding of an angle near 0 [rad], where its cosine is insensitive."""


def two_links(first: float, second: float, limits: Limits, *, prismatic: bool = False) -> Model:
    """Build a planar arm whose second joint has the limits; its links have these lengths [m]."""
    return Model.build(
        "planar",
        [Link("base"), Link("upper"), Link("lower"), Link("tip")],
        [
            Joint("shoulder", "continuous", "base", "upper", axis=(0.0, 0.0, 1.0)),
            Joint(
                "elbow", "prismatic" if prismatic else "revolute", "upper", "lower", Pose((first, 0.0, 0.0)),
                axis=(1.0, 0.0, 0.0) if prismatic else (0.0, 0.0, 1.0), limits=limits,
            ),
            Joint("tool", "fixed", "lower", "tip", Pose((second, 0.0, 0.0))),
        ],
    )  # fmt: skip


@given(st.floats(0.1, 2.0), st.floats(0.1, 2.0), st.floats(-3.0, 3.0), st.floats(0.0, 3.0), st.booleans())
def test_the_bounds_of_two_links_are_exact(a: float, b: float, low: float, span: float, slides: bool) -> None:
    """Distances of the tip that the second joint allows, by the cosine rule or by the travel."""
    model = two_links(a, b, Limits(low, low + span), prismatic=slides)
    values = np.linspace(low, low + span, 2001)
    reached = np.abs(a + b + values) if slides else np.sqrt(a * a + b * b + 2.0 * a * b * np.cos(values))
    distances, _, _ = frame_bounds(model, "tip", (0.0, 0.0, 0.0))
    allowed = [bound.allowed for bound in distances if not bound.needs_rotation]
    low_bound, high_bound = max(each.low for each in allowed), min(each.high for each in allowed)
    assert low_bound <= reached.min() + ROUNDING
    assert high_bound >= reached.max() - ROUNDING
    # The grid misses an extreme inside the range by half a step.
    step = span / 2000.0
    assert reached.min() - low_bound <= step * (a + b) + ROUNDING
    assert high_bound - reached.max() <= step * (a + b) + ROUNDING


@given(st.data())
def test_no_pose_of_a_configuration_is_proved_out_of_reach(data: st.DataObject) -> None:
    model = data.draw(models(max_links=7, base="fixed"))
    frame = data.draw(st.sampled_from(model.frame_names))
    q = np.stack([data.draw(configurations(model, within_limits=True)) for _ in range(3)])
    point = tuple(data.draw(st.floats(-0.5, 0.5)) for _ in range(3))
    with backend("reference", model) as engine:
        T = engine.forward_kinematics(q, frame)
    distances, heights, angles = frame_bounds(model, frame, point)
    positions, rotations = T[:, :3, 3] + T[:, :3, :3] @ np.array(point), T[:, :3, :3]
    for distance in distances:
        placed = positions + rotations @ distance.offset
        assert_within(np.linalg.norm(placed - distance.start, axis=-1), distance, ROUNDING)
    for height in heights:
        assert_within(positions @ height.direction, height, ROUNDING)
    for angle in angles:
        assert_within(angle.measured(rotations), angle, ANGLE_ROUNDING)


def assert_within(values: Floats, bound: DistanceBound | HeightBound | AngleBound, rounding: float) -> None:
    slack = rounding * (1.0 + np.abs(values).max())
    assert (values >= bound.allowed.low - slack).all(), bound.sentence(float(values.min()))
    assert (values <= bound.allowed.high + slack).all(), bound.sentence(float(values.max()))


@given(st.integers(0, 2**32 - 1), st.floats(-4.0, 4.0), st.floats(0.0, 7.0))
def test_products_of_rotated_vectors(seed: int, low: float, span: float) -> None:
    rng = np.random.default_rng(seed)
    v, w, axis = rng.normal(size=(3, 3))
    axis /= np.linalg.norm(axis)
    found = rotated_product(v, w, axis, Interval(low, low + span))
    turns = np.linspace(low, low + span, 400)
    along = (w @ axis) * axis
    across = np.cross(axis, w)
    values = (along + np.cos(turns)[:, None] * (w - along) + np.sin(turns)[:, None] * across) @ v
    rounding = 1e-12 * (1.0 + np.abs(values).max())
    assert found.low <= values.min() + rounding
    assert found.high >= values.max() - rounding
    coarse = float(np.linalg.norm(v) * np.linalg.norm(w)) * (span / 399.0) ** 2
    assert values.min() - found.low <= coarse + rounding
    assert found.high - values.max() <= coarse + rounding


@pytest.mark.parametrize("name", ["pinocchio", "compiled"])
def test_status_and_proof_of_results(name: str) -> None:
    model = load(MODELS / "six_axis_arm.urdf")
    with backend(name, model) as engine:
        targets = engine.forward_kinematics(model.random(3, 4), "flange")
        targets[1, :3, 3] *= 10.0
        targets[2, :3, 3] += (0.0, 0.0, 20.0)
        found = engine.inverse_kinematics(targets, "flange", max_restarts=20)
        assert found.status.tolist() == ["REACHED", "UNREACHABLE", "UNREACHABLE", "REACHED"]
        assert found.proof is not None
        assert [bool(text) for text in found.proof] == [False, True, True, False]
        assert "2 proved out of reach" in found.message
        alone = engine.inverse_kinematics(targets[1], "flange", max_restarts=20)
        assert alone.status == "UNREACHABLE"
        assert str(found.proof[1]) in repr(alone)
        assert "the chain reaches at most" in alone.message
        assert engine.inverse_kinematics(targets[0], "flange").status == "REACHED"


def test_planes_and_tilts_of_a_planar_arm_are_proved() -> None:
    with backend("reference", two_links(1.0, 0.7, Limits(-2.0, 2.0))) as engine:
        above = engine.inverse_kinematics([1.0, 0.3, 0.5], "tip", max_restarts=2)
        assert above.status == "UNREACHABLE"
        assert "along the axis of shoulder" in above.message
        tilted = np.eye(4)
        tilted[:3, :3] = rotation_from_rpy(np.array([0.4, 0.0, 0.2]))
        tilted[:3, 3] = 1.2, 0.3, 0.0
        found = engine.inverse_kinematics(tilted[:3, :3], "tip", free="position", max_restarts=2)
        assert found.status == "UNREACHABLE"
        assert "0.4 rad between the axes of shoulder and elbow" in found.message
        # Within a tolerance on its tilt the target is not proved out of reach, and is found.
        near = engine.inverse_kinematics(
            tilted, "tip", free="rotation_z", rotation_tolerance=(0.5, 1e-6, 1e-6)
        )
        assert near.status == "REACHED"
        # Where nothing was proved, a search that is too short has found nothing.
        target = engine.forward_kinematics(np.array([0.3, 0.5]), "tip")
        assert (
            engine.inverse_kinematics(target, "tip", max_restarts=0, max_iterations=0).status == "NOT_FOUND"
        )


def test_a_floating_base_reaches_everywhere() -> None:
    model = load(MODELS / "six_axis_arm.urdf").with_base("floating")
    with backend("reference", model) as engine:
        assert engine.inverse_kinematics([10.0, 0.0, 3.0], "flange").status == "REACHED"
