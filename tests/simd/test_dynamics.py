"""The algorithms of `dynx.rbd`, traced on random robots: interpreted and compiled, as on floats.

Each is compared with its own float64 evaluation, from which both differ by rounding only: by at most
`rounding.bounds`, for the program as written and for the simplified one.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings

import dynx
from dynx.model import Model
from dynx.model.mechanism import Mechanism
from dynx.rbd.aba import forward_dynamics
from dynx.rbd.centroidal import (
    center_of_mass,
    center_of_mass_jacobian,
    centroidal_momentum,
    kinetic_energy,
    potential_energy,
)
from dynx.rbd.coriolis import coriolis_matrix
from dynx.rbd.crba import mass_matrix
from dynx.rbd.jacobians import REFERENCES, Reference, frame_jacobian, frame_jacobian_derivative
from dynx.rbd.kinematics import body_poses, frame_placements
from dynx.rbd.rnea import inverse_dynamics
from dynx.simd.emit import Settings
from dynx.simd.simplify import FAST
from dynx.simd.target import host
from dynx.simd.trace import trace
from dynx.spatial.scalar import Array, Floats
from dynx.testing.strategies import models
from tests.simd.interp import interpret
from tests.simd.machine import Machine
from tests.simd.programs import RANDOM
from tests.simd.rounding import agree, bounds

Algorithm = Callable[[Mechanism, Array, Array, Array], Array]


def _jacobians(reference: Reference) -> Algorithm:
    """Return J and dJ/dt of the last frame."""

    def both(m: Mechanism, q: Array, v: Array, a: Array) -> Array:
        poses, frame = body_poses(m, q), len(m.frames) - 1
        J = frame_jacobian(m, poses, frame, reference)
        return np.stack([J, frame_jacobian_derivative(m, poses, v, frame, reference)], axis=-3)

    return both


ALGORITHMS: dict[str, Algorithm] = {
    "inverse_dynamics": inverse_dynamics,
    "forward_dynamics": forward_dynamics,
    "mass_matrix": lambda m, q, v, a: mass_matrix(m, q),
    "frame_placements": lambda m, q, v, a: frame_placements(m, q),
    **{f"jacobians, {name}": _jacobians(reference) for name, reference in REFERENCES.items()},
    "coriolis_matrix": lambda m, q, v, a: coriolis_matrix(m, body_poses(m, q), v),
    "center_of_mass": lambda m, q, v, a: center_of_mass(m, body_poses(m, q)),
    "center_of_mass_jacobian": lambda m, q, v, a: center_of_mass_jacobian(m, body_poses(m, q)),
    "centroidal_momentum": lambda m, q, v, a: centroidal_momentum(m, body_poses(m, q), v),
    "kinetic_energy": lambda m, q, v, a: kinetic_energy(m, body_poses(m, q), v),
    "potential_energy": lambda m, q, v, a: potential_energy(m, body_poses(m, q)),
}
SAMPLES = 6
"""Number of samples; small, because unsimplified programs have tens of thousands of nodes."""


def check(name: str, model: Model, rng: np.random.Generator) -> Floats:
    """Compare all three and return the bound for the program as written."""
    m = model.mechanism
    algorithm = ALGORITHMS[name]
    ports = {"q": (m.nq,), "v": (m.nv,), "a": (m.nv,)}

    def function(q: Array, v: Array, a: Array) -> Array:
        return algorithm(m, q, v, a)

    inputs = [np.asarray(rng.uniform(-1.0, 1.0, (SAMPLES, width))) for (width,) in ports.values()]
    if m.floating:
        inputs[0][:, 3:7] /= np.linalg.norm(inputs[0][:, 3:7], axis=1, keepdims=True)
    # Sample by sample: a result that no coordinate affects has no batch axis.
    wanted = np.stack([np.ravel(function(*sample)) for sample in zip(*inputs, strict=True)])
    written, simplified = trace(function, ports, simplify=None), trace(function, ports, simplify=FAST)
    (one,), (other,) = bounds(written, inputs, any_order=True), bounds(simplified, inputs)
    assert agree(interpret(written, inputs)[0], wanted, one, one)
    # The bound of the unsimplified program covers the rounding of folded constants.
    assert agree(interpret(simplified, inputs)[0], wanted, one, one, other)
    compiled = Machine(simplified, host(), Settings(4, segment=300))
    assert agree(compiled(inputs)[0], wanted, one, one, other)
    return one


@pytest.mark.parametrize("name", ALGORITHMS)
@settings(max_examples=5)
@given(models(min_links=2, max_links=3, solvable=True), RANDOM)
def test_interpreted_and_compiled_equal_evaluation_on_floats(
    name: str, model: Model, rng: np.random.Generator
) -> None:
    bound = check(name, model, rng)
    # The factors of a floating base's inertia can have pivots that the bound can't tell from zero.
    assert name == "forward_dynamics" or np.all(np.isfinite(bound))


@pytest.mark.parametrize("name", ["inverse_dynamics", "forward_dynamics", "mass_matrix"])
def test_a_six_axis_arm(name: str) -> None:
    assert np.all(np.isfinite(check(name, dynx.load("ur5"), np.random.default_rng(6))))
