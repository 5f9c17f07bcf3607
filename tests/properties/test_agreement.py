"""All installed backends agree on every quantity, on random robots and on real ones."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from itertools import combinations
from typing import Literal

import numpy as np
import pytest
from hypothesis import given, note, settings
from hypothesis import strategies as st

from dynx.agreement.compared_quantities import compared_quantities
from dynx.agreement.comparison import BackendResults, Comparison, compare, compare_forward_dynamics
from dynx.agreement.magnitudes import Magnitudes
from dynx.agreement.sampling import Samples, draw_samples
from dynx.backends import Backend, backend, installed_backends
from dynx.backends.derived import DerivedBackend, native_quantities
from dynx.backends.registry import backend_class
from dynx.model import Model
from dynx.model.loading import load
from dynx.testing.strategies import models, samples, wrenches
from tests.error_bounds import samples_at
from tests.examples import PROFILE

REAL = ("ur5", "panda", "solo12", "hyq", "xarm7", "z1", "six_axis_arm", "seven_axis_arm", "scara")
REAL_COMPILED = [
    ("ur5", "floating"),
    ("panda", "fixed"),
    ("solo12", "fixed"),
    ("scara", "fixed"),
]
"""Real robots for the compiled backend, which takes seconds per robot: chains and trees, revolute, prismatic
and mimic joints, each on one base."""

STATES = 2
"""Number of states in one example, evaluated as a batch."""

KINDS: dict[str, dict[str, bool]] = {
    "any": {},
    "solvable": {"solvable": True},
    "impossible": {"physical": False},
}
"""Robots with thin bodies, massless links, mimic and locked joints; those that forward dynamics can solve;
and robots with inertias of no body."""

Base = Literal["fixed", "floating"]
each_base = pytest.mark.parametrize("base", ["fixed", "floating"])


@contextmanager
def backends_of(model: Model, names: Sequence[str] | None = None) -> Iterator[list[Backend]]:
    """Open all installed backends of a model, or those named, and close them at the end."""
    with ExitStack() as stack:
        yield [stack.enter_context(backend(name, model)) for name in names or installed_backends()]


INTERPRETED = [name for name in installed_backends() if name != "compiled"]
"""Backends that load a new robot at once. The compiled one makes some thirty kernels for each robot, which
takes half a second, so it is tested on fewer robots (`test_compiled_random_robots`)."""


TAKING_BALL_JOINTS = [name for name in INTERPRETED if backend_class(name).takes_ball_joints]


def assert_agree(engines: list[Backend], states: Samples) -> None:
    """Compare every quantity of every pair of backends, for every frame in every reference."""
    sizes = Magnitudes(states)
    results = [BackendResults(engine.name, engine, states) for engine in engines]
    for pair in combinations(results, 2):
        for quantity in compared_quantities():
            assert_agreement(compare(quantity, *pair, sizes))
        assert_agreement(compare_forward_dynamics(*pair, sizes))


def assert_agreement(comparison: Comparison) -> None:
    assert comparison.agree, (
        f"{comparison.quantity} of {comparison.pair}: error {comparison.max_rel_error:.3g} of its size, "
        f"more than {comparison.tolerance:.3g}; {comparison.note or ''}\n{comparison.worst_sample}"
    )


@st.composite
def robots_in_states(
    draw: st.DrawFn,
    base: Literal["fixed", "floating", "either"],
    physical: bool = True,
    solvable: bool = False,
) -> tuple[Model, Samples]:
    """Draw a robot and some states, with a wrench on one of its frames."""
    model = draw(models(base=base, physical=physical, solvable=solvable))
    q, v, a = (np.stack(each) for each in zip(*(draw(samples(model)) for _ in range(STATES)), strict=True))
    frame = draw(st.sampled_from(model.frame_names))
    # The magnitude of such torques is that of accelerations, as in `Samples`.
    tau = draw(samples(model)).a
    return model, samples_at(model, q, v, a, tau, wrench=draw(wrenches()), frame=frame, references=1)


@pytest.mark.long_cases
@each_base
@pytest.mark.parametrize("kind", KINDS)
@given(data=st.data())
def test_random_robots(kind: str, base: Base, data: st.DataObject) -> None:
    model, states = data.draw(robots_in_states(base, **KINDS[kind]))
    note(model.to_urdf())
    with backends_of(model, INTERPRETED) as engines:
        if kind == "solvable":
            for engine in engines:
                assert np.isfinite(engine.forward_dynamics(states.q, states.v, states.tau)).all()
        assert_agree(engines, states)


@each_base
@given(data=st.data())
@settings(max_examples=min(PROFILE, max(15, PROFILE // 4)))
def test_random_robots_with_ball_joints(base: Base, data: st.DataObject) -> None:
    kinds = ("ball", "revolute", "prismatic", "continuous", "fixed")
    model = data.draw(models(base=base, joint_types=kinds, locks=False))
    states = draw_samples(model, 3, seed=data.draw(st.integers(0, 9)))
    with backends_of(model, TAKING_BALL_JOINTS) as engines:
        assert_agree(engines, states)


@given(data=st.data())
@settings(max_examples=min(PROFILE, max(15, PROFILE // 4)))
def test_compiled_random_robots(data: st.DataObject) -> None:
    kind = data.draw(st.sampled_from(sorted(KINDS)))
    model, states = data.draw(robots_in_states("either", **KINDS[kind]))
    note(model.to_urdf())
    with backends_of(model, ["reference", "compiled"]) as engines:
        assert_agree(engines, states)


@each_base
@given(data=st.data())
def test_derived_results_equal_native_ones(base: Base, data: st.DataObject) -> None:
    """Compare quantities that an engine computes with those derived from its poses and torques."""
    model, states = data.draw(robots_in_states(base))
    note(model.to_urdf())
    sizes = Magnitudes(states)
    with backends_of(model, INTERPRETED) as engines:
        for engine in engines:
            native = BackendResults(engine.name, engine, states)
            derived = BackendResults("derived", DerivedBackend(engine), states)
            for quantity in compared_quantities():
                if quantity.native in native_quantities(engine):
                    assert_agreement(compare(quantity, native, derived, sizes))


@pytest.mark.long_cases
@each_base
@pytest.mark.parametrize("robot", REAL)
def test_real_robots(robot: str, base: Base) -> None:
    model = load(robot, base=base)
    with backends_of(model, INTERPRETED) as engines:
        assert_agree(engines, draw_samples(model, 8, seed=0))


@pytest.mark.long_cases
@pytest.mark.parametrize(("robot", "base"), REAL_COMPILED)
def test_compiled_real_robots(robot: str, base: Base) -> None:
    model = load(robot, base=base)
    with backends_of(model, ["reference", "compiled"]) as engines:
        assert_agree(engines, draw_samples(model, 8, seed=0))
