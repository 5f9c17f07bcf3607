"""Kernels: their size, their constants, and when one is compiled again."""

from __future__ import annotations

import os
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dynx.backends.quantities import QUANTITIES
from dynx.compiled import kernels as compiled_kernels
from dynx.compiled.kernels import ON_CHAINS, _fingerprint, code_size, compiles, evaluate_quantity
from dynx.compiled.simplification import _zero_rounding_residue, simplify_mechanism
from dynx.model import Inertial, Joint, Link, Mechanism, Model, Pose
from dynx.model.loading import load
from dynx.model.mechanism import build_mechanism
from dynx.testing.strategies import models
from tests.backends.robots import chain, mixed_robot
from tests.compiled.robots import ROBOTS, made, state
from tests.conftest import needs_examples


def test_long_code_is_not_compiled() -> None:
    assert compiles(chain(30).mechanism, "mass_matrix")
    assert not compiles(chain(60).mechanism, "mass_matrix")
    assert compiles(chain(60).mechanism, "inverse_dynamics")
    assert compiles(chain(9).mechanism, "inertial_regressor")
    assert not compiles(chain(20).mechanism, "inertial_regressor")
    assert not compiles(_star(101).mechanism, "mass_matrix")
    assert not compiles(_star(1000).mechanism, "frame_placements")
    # Nothing but NumPy could evaluate it, and without optimisation it compiles in four seconds.
    assert compiles(_star(300).mechanism, "kinetic_energy")
    assert not compiles(_star(500).mechanism, "kinetic_energy")
    for robot in (mixed_robot(), mixed_robot("floating", mimic=True)):
        small = [quantity for quantity in QUANTITIES if quantity != "inertial_regressor"]
        assert all(compiles(robot.mechanism, quantity) for quantity in small)


@needs_examples
@pytest.mark.parametrize("name", ["talos_full", "tiago_pro"])
def test_forward_dynamics_of_robots_with_many_mimic_joints_is_compiled(name: str) -> None:
    """It compiles in a second, and no routine evaluates it: NumPy took milliseconds."""
    assert compiles(load(name, base="floating").mechanism, "forward_dynamics")


def test_forward_dynamics_too_long_to_compile_is_solved_by_compiled_matrices(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("dynx.compiled.kernels.MAX_COMPILE_SECONDS", -1.0)
    monkeypatch.setattr("dynx.compiled.call.evaluate_quantity", _refuse)
    model = mixed_robot("floating", mimic=True)
    q, v, tau = state(model, (3,))
    engine = made(model)
    a = engine.forward_dynamics(q, v, tau)
    np.testing.assert_allclose(engine.forward_dynamics(q[0], v[0], tau[0]), a[0], rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(engine.inverse_dynamics(q, v, a), tau, rtol=1e-9, atol=1e-9)


def _refuse(*_: object) -> None:
    raise AssertionError("evaluated by NumPy")


def _star(n: int) -> Model:
    """Return `n` joints on one body: few pairs of joints on one path, and a mass matrix of n^2 numbers."""
    links = [Link("root"), *(Link(f"link{k}", Inertial(1.0)) for k in range(n))]
    joints = [Joint(f"joint{k}", "revolute", "root", f"link{k}") for k in range(n)]
    return Model.build("star", links, joints)


FEW = 1000
"""Operations that compile at once, whatever is predicted: robots without moving joints have no more."""


@given(
    models(max_links=9, solvable=True),
    st.sampled_from(sorted({*QUANTITIES} - {"forward_kinematics"} - ON_CHAINS)),
)
@settings(max_examples=15)
def test_the_size_of_code_is_predicted(model: Model, quantity: str) -> None:
    """Neither far too small, which would compile for minutes, nor so large that code is never compiled."""
    mechanism = simplify_mechanism(model.mechanism)
    details = QUANTITIES[quantity].implied_details(model)
    program = compiled_kernels._program(
        mechanism, quantity, lambda *state: evaluate_quantity(mechanism, quantity, details, *state)
    )
    predicted, results = code_size(mechanism, quantity)
    operations = sum(node.op not in ("input", "constant") for node in program.nodes)
    assert operations <= FEW + 1.5 * predicted
    assert len(program.results) - 1 <= results
    # Angles that are multiples of a right angle leave little.
    assert predicted < FEW + 600 * max(1, operations)


def test_rounding_residue_is_removed_from_rotations() -> None:
    """Right angles become exact, and nothing else changes."""
    pose = Pose((0.1, 0.2, 0.3), (np.pi / 2, 0.0, -np.pi / 2))
    links = [Link("a"), Link("b", Inertial(1.0, Pose((0.1, 0.0, 0.0)), 0.1, 0.0, 0.0, 0.1, 0.0, 0.1))]
    model = Model.build("square", links, [Joint("j", "revolute", "a", "b", pose)]).with_frame("f", "b", pose)
    before, after = model.mechanism, simplify_mechanism(model.mechanism)
    assert np.count_nonzero(before.bodies[0].R) > 3
    for R in (after.bodies[0].R, after.frames[-1].R):
        assert np.count_nonzero(R) == 3
        np.testing.assert_array_equal(np.abs(R[R != 0.0]), 1.0)
    np.testing.assert_array_equal(simplify_mechanism(after).bodies[0].R, after.bodies[0].R)
    oblique = mixed_robot().mechanism
    for old, new in zip(oblique.bodies, _zero_rounding_residue(oblique).bodies, strict=True):
        np.testing.assert_array_equal(old.R, new.R)


def _variants(mechanism: Mechanism) -> list[Mechanism]:
    """Mechanisms that each differ from the given one in the last bit of one number."""
    found = [
        replace(mechanism, gravity=np.nextafter(mechanism.gravity, 99.0)),
        replace(mechanism, floating=not mechanism.floating),
        replace(mechanism, coupling=None),
        replace(mechanism, bodies=mechanism.bodies[:-1]),
        replace(mechanism, frames=mechanism.frames[:-1]),
        replace(mechanism, root=replace(mechanism.root, mass=mechanism.root.mass + 1.0)),
    ]
    body, frame = mechanism.bodies[1], mechanism.frames[1]
    inertia = body.inertia
    changed_bodies = [replace(body, revolute=not body.revolute), replace(body, parent=-1)]
    changed_bodies += [
        replace(body, **{name: np.nextafter(getattr(body, name), 99.0)}) for name in ("R", "p", "axis")
    ]
    for name in (field.name for field in fields(inertia)):
        changed = replace(inertia, **{name: np.nextafter(getattr(inertia, name), 99.0)})
        changed_bodies.append(replace(body, inertia=changed))
    first, *rest = mechanism.bodies
    found += [replace(mechanism, bodies=(first, changed, *rest[1:])) for changed in changed_bodies]
    for name in ("R", "p"):
        moved = replace(frame, **{name: np.nextafter(getattr(frame, name), 99.0)})
        found.append(replace(mechanism, frames=(mechanism.frames[0], moved, *mechanism.frames[2:])))
    coupling = mechanism.coupling
    assert coupling is not None
    found.append(replace(mechanism, coupling=replace(coupling, offset=tuple(x + 1 for x in coupling.offset))))
    found.append(replace(mechanism, coupling=replace(coupling, scale=tuple(2 * x for x in coupling.scale))))
    return found


def test_every_number_of_the_robot_is_in_the_key() -> None:
    model = ROBOTS["mimic"]
    variants = [model.mechanism, *_variants(model.mechanism)]
    assert len({_fingerprint(variant) for variant in variants}) == len(variants)
    assert _fingerprint(build_mechanism(model)) == _fingerprint(build_mechanism(model))


def test_a_cached_kernel_is_loaded_without_tracing(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setitem(os.environ, "DYNX_CACHE_DIR", str(tmp_path))
    monkeypatch.delenv("DYNX_CACHE", raising=False)
    model = ROBOTS["floating"]
    q, v, a = state(model)
    cold = made(model).inverse_dynamics(q, v, a)

    def traced(*_: object) -> None:
        raise AssertionError("traced again")

    monkeypatch.setattr(compiled_kernels, "trace", traced)
    np.testing.assert_array_equal(made(model).inverse_dynamics(q, v, a), cold)
