"""Overhead of one call through dynx over the same call of Pinocchio's own binding, on UR5.

``pytest benchmarks/test_call_overhead.py`` times raw, checked and unchecked calls in one run and
prints what dynx adds. The engine's model is read by Pinocchio's own parser.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
import pinocchio as pin
import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from benchmarks.conftest import Record
from dynx.agreement.tolerances import BAR
from dynx.backends import backend
from dynx.model.loading import load
from dynx.spatial.scalar import Floats

Call = Callable[[], Floats]
IMPLEMENTATIONS = ("raw", "checked", "unchecked")
QUANTITIES = ("forward_kinematics", "jacobian", "inverse_dynamics", "mass_matrix")
FRAME = "tool0"


@cache
def calls() -> dict[tuple[str, str], Call]:
    """Calls to time, by (quantity, implementation), all at one sample."""
    model = load("ur5")
    rng = np.random.default_rng(0)
    q, v, a = model.random(rng), rng.standard_normal(model.nv), rng.standard_normal(model.nv)

    engine = pin.buildModelFromUrdf(model.source)
    data, tool = engine.createData(), engine.getFrameId(FRAME)

    def raw_forward_kinematics() -> Floats:
        pin.forwardKinematics(engine, data, q)
        T: Floats = pin.updateFramePlacement(engine, data, tool).homogeneous
        return T

    def raw_jacobian() -> Floats:
        J: Floats = pin.computeFrameJacobian(engine, data, q, tool, pin.LOCAL_WORLD_ALIGNED)
        return J

    def raw_inverse_dynamics() -> Floats:
        tau: Floats = pin.rnea(engine, data, q, v, a)
        return tau

    def raw_mass_matrix() -> Floats:
        M: Floats = pin.crba(engine, data, q)
        return M

    raw = (raw_forward_kinematics, raw_jacobian, raw_inverse_dynamics, raw_mass_matrix)
    timed: dict[tuple[str, str], Call] = {
        (quantity, "raw"): call for quantity, call in zip(QUANTITIES, raw, strict=True)
    }
    for implementation in IMPLEMENTATIONS[1:]:
        ours = backend("pinocchio", model, validate=implementation == "checked")
        through_dynx = (
            lambda ours=ours: ours.forward_kinematics(q, FRAME),
            lambda ours=ours: ours.jacobian(q, FRAME),
            lambda ours=ours: ours.inverse_dynamics(q, v, a),
            lambda ours=ours: ours.mass_matrix(q),
        )
        timed |= {
            (quantity, implementation): call for quantity, call in zip(QUANTITIES, through_dynx, strict=True)
        }
    return timed


@pytest.mark.parametrize("quantity", QUANTITIES)
@pytest.mark.parametrize("implementation", IMPLEMENTATIONS)
@pytest.mark.benchmark(max_time=0.5, warmup=True)
def test_call_overhead(
    benchmark: BenchmarkFixture, record: Record, quantity: str, implementation: str
) -> None:
    benchmark.group = f"{quantity}, UR5, one call"
    call, raw = calls()[quantity, implementation], calls()[quantity, "raw"]
    expected = raw()
    np.testing.assert_allclose(call(), expected, rtol=0.0, atol=BAR * np.max(np.abs(expected)))
    benchmark(call)
    record(quantity, implementation, benchmark)
