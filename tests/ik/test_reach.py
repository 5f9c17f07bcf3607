"""The reach: exact where a chain is straight, and never against a pose that a configuration takes."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynx.backends import backend
from dynx.ik.reach import frame_reach
from dynx.model import Joint, Limits, Link, Model, Pose
from dynx.model.loading import load
from dynx.testing.strategies import configurations, models
from tests.oracles.closed_form import MODELS

ROUNDING = 1e-9
"""Rounding of a bound, relative and [m]."""


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


@given(st.floats(0.1, 2.0), st.floats(0.1, 2.0), st.floats(0.0, 3.0), st.booleans())
def test_the_reach_of_two_links_is_exact(a: float, b: float, high: float, slides: bool) -> None:
    """Stretched out, or at the end of the travel."""
    model = two_links(a, b, Limits(0.0, high), prismatic=slides)
    reach = frame_reach(model, "tip", (0.0, 0.0, 0.0))
    longest = a + b + high if slides else a + b
    assert abs(reach.most - longest) <= ROUNDING * longest
    np.testing.assert_allclose(reach.start, 0.0, atol=ROUNDING)


@given(st.data())
def test_no_pose_of_a_configuration_is_out_of_reach(data: st.DataObject) -> None:
    model = data.draw(models(max_links=7, base="fixed"))
    frame = data.draw(st.sampled_from(model.frame_names))
    q = np.stack([data.draw(configurations(model, within_limits=True)) for _ in range(3)])
    point = (data.draw(st.floats(-0.5, 0.5)), data.draw(st.floats(-0.5, 0.5)), 0.1)
    with backend("reference", model) as engine:
        T = engine.forward_kinematics(q, frame)
    reach = frame_reach(model, frame, point)
    distances = np.linalg.norm(T[:, :3, 3] + T[:, :3, :3] @ np.array(point) - reach.start, axis=-1)
    assert (distances <= reach.most + ROUNDING * (1.0 + distances)).all()


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


def test_where_nothing_is_proved_a_search_has_found_nothing() -> None:
    with backend("reference", two_links(1.0, 0.7, Limits(-2.0, 2.0))) as engine:
        # In another plane than that of the arm, but not too far.
        assert engine.inverse_kinematics([1.0, 0.3, 0.5], "tip", max_restarts=2).status == "NOT_FOUND"
        target = engine.forward_kinematics(np.array([0.3, 0.5]), "tip")
        short = engine.inverse_kinematics(target, "tip", max_restarts=0, max_iterations=0)
        assert short.status == "NOT_FOUND"


def test_a_floating_base_reaches_everywhere() -> None:
    model = load(MODELS / "six_axis_arm.urdf").with_base("floating")
    with backend("reference", model) as engine:
        found = engine.inverse_kinematics([10.0, 0.0, 3.0], "flange", q0=model.clip(model.neutral()))
        assert found.status == "REACHED"
        assert found.restarts == 0
        assert found.iterations <= 30
