"""Faults in lanes of the compiled step with contacts: they show, and no bit of the other lanes changes."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st

from dynx.compiled.contact_step import contact_step_text, shapes_on_plane
from dynx.compiled.step import compiled
from dynx.errors import SingularMassMatrixError
from dynx.model.elements import Inertial, Pose
from dynx.model.numbers import DIVERGENCE_SPEED
from dynx.world.preparation import prepare
from tests.compiled.test_contact_step import H, a1, states, steps, text_of
from tests.compiled.test_contact_step_and_worlds import OPTIONS, random_robot, scene_of
from tests.engines.own.test_faults import is_singular

COUNT = 19

NUMBERS = st.sampled_from([math.nan, math.inf, -math.inf, 1e300, -1e200, 1e80, -1e30, 1e9])

FAULTS = st.one_of(
    st.tuples(st.sampled_from(["q", "v", "target", "impulses"]), st.integers(0, 11), NUMBERS),
    # Feet that begin in the ground.
    st.tuples(st.just("q"), st.just(2), st.floats(-1.0, 0.2)),
)


@settings(max_examples=25, deadline=None)
@given(st.dictionaries(st.integers(0, COUNT - 1), FAULTS, min_size=1, max_size=6), st.integers(0, 5))
def test_lanes_with_faults_show_them_and_change_no_other(
    faults: dict[int, tuple[str, int, float]], seed: int
) -> None:
    kernel = compiled(text_of(a1()))
    given_states = states(COUNT, seed)
    clean = steps(kernel, *given_states)
    names = ("q", "v", "target", "impulses")
    for lane, (name, place, value) in faults.items():
        given_states[names.index(name)][lane, place] = value
    found = steps(kernel, *given_states)
    others = [k for k in range(COUNT) if k not in faults]
    for mine, wanted in zip(found, clean, strict=True):
        assert np.array_equal(mine[others], wanted[others])
    q, v, impulses, residual = found
    for lane, (_, _, value) in faults.items():
        diverged = not np.isfinite([*q[lane], *v[lane]]).all() or np.abs(v[lane]).max() > DIVERGENCE_SPEED
        if math.isfinite(value) and abs(value) <= 1.0:
            assert not diverged
        if not diverged:
            assert np.isfinite([*impulses[lane], *residual[lane]]).all()


@settings(max_examples=20, deadline=None, suppress_health_check=list(HealthCheck))
@given(st.integers(0, 10_000), st.booleans(), st.sets(st.integers(0, 3), min_size=1), st.booleans())
def test_links_without_mass_have_a_step_where_the_mass_matrix_is_regular(
    seed: int, floating: bool, massless: set[int], armature: bool
) -> None:
    """The text on floats; other robots are refused by name, as in worlds."""
    rng = np.random.default_rng(seed)
    model = random_robot(rng, floating)
    nothing = Inertial(0.0, Pose(), 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    links = [
        replace(link, inertial=nothing if k in massless else link.inertial)
        for k, link in enumerate(model.links)
    ]
    joints = [
        replace(each, dynamics=replace(each.dynamics, armature=armature * each.dynamics.armature))
        for each in model.joints
    ]
    light = type(model).build("light", links, joints, base=model.base, geometry=model.geometry)
    touching = shapes_on_plane(prepare(scene_of(light, -0.3), **OPTIONS))
    assume(touching.shapes)
    options: dict[str, Any] = {"h": H, "kp": 0.0, "kd": 0.0, "joint_limits": True}
    if is_singular(light):
        with pytest.raises(SingularMassMatrixError, match=r"'(base|link_\d|joint_\d)'"):
            contact_step_text(light, touching, **options)
        return
    text = contact_step_text(light, touching, **options)
    n, v = len(light.mechanism.bodies), rng.uniform(-0.5, 0.5, light.nv)
    q = light.neutral()
    given_numbers = {"q": q, "v": v, "target": np.zeros(n), "impulses": np.zeros(text.inputs["impulses"])}
    for name, values in text.function(**given_numbers).items():
        assert np.isfinite(np.asarray(values, dtype=float)).all(), name
