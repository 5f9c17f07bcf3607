"""A batch of rollouts, held against rollouts one by one."""

from __future__ import annotations

from typing import Any

import numpy as np

from dynx.control.base import Controller
from dynx.model import Model
from dynx.sim import BatchRollouts, Rollout, simulate, simulate_batch
from dynx.sim.compiled_loop import ONE_KERNEL
from tests.sim.bars import EXACT_ON_DYNX, apart


def assert_same(many: BatchRollouts, row: int, one: Rollout) -> None:
    """Assert that a row of a batch recorded at every step equals this rollout up to rounding."""
    assert apart(many.q_record[row], one.q[1:]) < EXACT_ON_DYNX
    assert apart(many.v_record[row], one.v[1:]) < EXACT_ON_DYNX
    assert apart(many.tau_record[row], one.tau) < EXACT_ON_DYNX
    assert apart(many.q[row], one.q[-1]) < EXACT_ON_DYNX
    error = one.error[1:]
    assert apart(many.max_error[row], np.max(np.abs(error), axis=0)) < EXACT_ON_DYNX
    assert apart(many.rms_error[row], np.sqrt(np.mean(error**2, axis=0))) < EXACT_ON_DYNX
    assert apart(many.saturated[row], np.mean(one.saturated, axis=0)) < EXACT_ON_DYNX


def batch_and_one(
    model: Model, law: Controller[Any], reference: Any, **options: Any
) -> tuple[BatchRollouts, Rollout]:
    """Simulate a scenario as a batch of 3 and alone, and assert that they agree: to the last bit where the
    rollout alone is one lane of the same kernel."""
    one = simulate(model, law, reference, plant="compiled", **options)
    many = simulate_batch(model, law, reference, rollouts=3, record_every=1, **options)
    assert many.done.all()
    assert np.isnan(many.diverged).all()
    for row in range(3):
        assert_same(many, row, one)
        if one.executor == ONE_KERNEL:
            np.testing.assert_array_equal(many.q_record[row], one.q[1:])
            np.testing.assert_array_equal(many.v_record[row], one.v[1:])
            np.testing.assert_array_equal(many.tau_record[row], one.tau)
    return many, one


def batch_and_each(
    model: Model, law: Controller[Any], reference: Any, each: dict[str, Any], **options: Any
) -> BatchRollouts:
    """Simulate a batch whose rollouts differ in `each`, and assert that every one is that of `simulate`."""
    many = simulate_batch(model, law, reference, record_every=1, **each, **options)
    for row in range(len(many.q)):
        own = {name: values[row] for name, values in each.items()}
        assert_same(many, row, simulate(model, law, reference, plant="compiled", **own, **options))
    return many
