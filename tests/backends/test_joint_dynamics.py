"""Springs of joints in the quantities of backends: closed forms, and torque against elastic energy."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import dynx
from dynx.backends import installed_backends
from dynx.backends.joint_dynamics import JointDynamicsTerms
from dynx.model import Inertial, Joint, JointDynamics, Limits, Link, Mimic, Model
from dynx.testing.strategies import models

TOLERANCE = 1e-12


def sliding_mass(**dynamics: float) -> Model:
    """Return a mass of 2 kg that slides along x without gravity, with these joint dynamics."""
    links = [Link("base"), Link("mass", Inertial(2.0, ixx=0.01, iyy=0.01, izz=0.01))]
    slide = Joint(
        "slide", "prismatic", "base", "mass", limits=Limits(-9.0, 9.0), dynamics=JointDynamics(**dynamics)
    )
    return Model.build("slider", links, [slide], gravity=(0.0, 0.0, 0.0))


@pytest.mark.parametrize("name", installed_backends())
def test_a_spring_pulls_to_its_reference(name: str) -> None:
    """50 N/m, stretched by -0.2 m, pull 2 kg with 10 N: 5 m/s^2, and 1 J are in the spring."""
    model = sliding_mass(stiffness=50.0, spring_reference=0.3)
    with dynx.backend(name, model) as engine:
        at_rest = ([0.1], [0.0], [0.0])
        assert engine.inverse_dynamics(*at_rest) == pytest.approx([0.0], abs=TOLERANCE)
        assert engine.inverse_dynamics(*at_rest, joint_dynamics=True) == pytest.approx([-10.0])
        assert engine.bias_torque([0.1], [0.0], joint_dynamics=True) == pytest.approx([-10.0])
        assert engine.forward_dynamics(*at_rest, joint_dynamics=True) == pytest.approx([5.0])
        assert engine.forward_dynamics(*at_rest) == pytest.approx([0.0], abs=TOLERANCE)
        assert engine.potential_energy([0.1], joint_dynamics=True) == pytest.approx(1.0)
        assert engine.potential_energy([0.1]) == pytest.approx(0.0, abs=TOLERANCE)


def test_a_reference_without_a_spring_means_nothing() -> None:
    assert JointDynamics(spring_reference=0.3) == JointDynamics()


def test_the_spring_of_a_mimic_joint_pulls_its_driver_through_the_multiplier() -> None:
    """At q = 0.1 the follower is at -2 q + 0.5 = 0.3, where 4 N/m pull it with -4 (0.3 - 0.2) = -0.4 N."""
    one = sliding_mass(stiffness=3.0, spring_reference=0.05)
    follower = Joint(
        "follower",
        "prismatic",
        "base",
        "other",
        limits=Limits(-9.0, 9.0),
        dynamics=JointDynamics(stiffness=4.0, spring_reference=0.2),
        mimic=Mimic("slide", -2.0, 0.5),
    )
    links, joints = [*one.links, Link("other", Inertial(1.0))], [*one.joints, follower]
    model = Model.build("two", links, joints, gravity=(0.0, 0.0, 0.0))
    with dynx.backend("reference", model) as engine:
        tau = engine.inverse_dynamics([0.1], [0.0], [0.0], joint_dynamics=True)
        assert tau == pytest.approx([3.0 * 0.05 - 2.0 * 0.4])
        energy = engine.potential_energy([0.1], joint_dynamics=True)
        assert energy == pytest.approx(0.5 * (3.0 * 0.05**2 + 4.0 * 0.1**2))


@given(models(), st.integers(0, 2**31))
def test_the_torque_of_springs_is_the_gradient_of_their_energy(model: Model, seed: int) -> None:
    """A quadratic function: differences of energy over any distance are exact."""
    terms, rng = JointDynamicsTerms(model), np.random.default_rng(seed)
    q = model.random(rng, size=3)
    base, size = 6 if model.floating else 0, 1.0 + float(np.abs(q).max(initial=0.0)) ** 2
    torque = np.zeros((3, model.nv)) if terms.springs is None else terms.springs.torque(q)
    assert not torque[:, :base].any()
    for k in range(base, model.nv):
        ahead, back = (model.integrate(q, sign * 0.5 * np.eye(model.nv)[k]) for sign in (1.0, -1.0))
        slope = terms.elastic_energy(ahead) - terms.elastic_energy(back)
        scale = size * (1.0 + terms.stiffness.sum()) * (1.0 + sum(_ratios(model)) ** 2)
        np.testing.assert_allclose(torque[:, k], -slope, rtol=0.0, atol=100.0 * TOLERANCE * scale)


def _ratios(model: Model) -> list[float]:
    coupling = model.mechanism.coupling
    return [] if coupling is None else [abs(x) for x in (*coupling.scale, *coupling.offset)]


@given(models(max_links=4), st.integers(0, 2**31))
def test_backends_and_parametric_dynamics_add_the_same(model: Model, seed: int) -> None:
    rng = np.random.default_rng(seed)
    q, (v, a) = model.random(rng), rng.standard_normal((2, model.nv))
    found = [
        dynx.backend(name, model).inverse_dynamics(q, v, a, joint_dynamics=True)
        for name in ("reference", "compiled")
    ]
    if not model.nv:
        return
    parametric = dynx.parametric(model, joint_dynamics=True)
    found.append(parametric.inverse_dynamics(q, v, a))
    scale = 1.0 + np.abs(found[0]).max(initial=0.0)
    for each in found[1:]:
        np.testing.assert_allclose(each, found[0], rtol=0.0, atol=1e3 * TOLERANCE * scale)


def test_springs_are_parameters_of_a_robot_that_has_any() -> None:
    model = sliding_mass(stiffness=50.0, spring_reference=0.3, damping=0.5)
    dynamics = dynx.parametric(model, joint_dynamics=True)
    names = [f"slide.{name}" for name in ("damping", "friction", "armature", "stiffness", "spring_reference")]
    assert list(dynamics.parameters.names) == names
    changed = np.array([0.0, 0.0, 0.0, 20.0, -0.1])
    assert dynamics.inverse_dynamics([0.1], [0.0], [0.0], changed) == pytest.approx([4.0])
    assert dynamics.forward_dynamics([0.1], [0.0], [0.0], changed) == pytest.approx([-2.0])
    assert dynamics.parameters.model_of(changed).joint("slide").dynamics == JointDynamics(0, 0, 0, 20.0, -0.1)
    plain = replace(model, joints=tuple(replace(j, dynamics=JointDynamics(0.5)) for j in model.joints))
    assert len(dynx.parametric(plain, joint_dynamics=True).parameters.names) == 3
