"""A reducible state fits the robot it was made of, and any robot that is left of it."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from dynx.doctor.counterexample import ReducibleState
from dynx.testing.strategies import models, samples


@given(st.data())
def test_there_and_back(data: st.DataObject) -> None:
    model = data.draw(models())
    sample = data.draw(samples(model))
    state = ReducibleState.of(model, *sample)
    for given_row, row in zip(sample, state.on(model), strict=True):
        np.testing.assert_array_equal(given_row, row)
    assert state.within(model) == state


@given(st.data())
def test_on_another_robot(data: st.DataObject) -> None:
    """Joints that both robots have keep their values; the others are at rest."""
    model = data.draw(models(base="floating", mimics=False))
    other = data.draw(models(mimics=False))
    q, v, a = data.draw(samples(model))
    q_other, v_other, a_other = ReducibleState.of(model, q, v, a).on(other)
    assert (len(q_other), len(v_other), len(a_other)) == (other.nq, other.nv, other.nv)
    for name in other.joint_names:
        shift = 1 if other.floating else 0
        k = other.coordinate_index(name)
        values = (q_other[k + shift], v_other[k], a_other[k])
        if name in model.joint_names:
            j = model.coordinate_index(name)
            assert values == (q[j + 1], v[j], a[j])
        else:
            assert values == (0.0, 0.0, 0.0)
    if other.floating:
        np.testing.assert_array_equal(q_other[:7], q[:7])
        np.testing.assert_array_equal(v_other[:6], v[:6])
