"""Kernels of robots with ball joints: equal to `reference`, in batches, derivatives and with parameters."""

from __future__ import annotations

from typing import Literal

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import dynx
from dynx.backends.quantities import QUANTITIES
from dynx.compiled.kernels import compiles, routines_evaluate
from dynx.errors import ArgumentError
from dynx.model import Inertial, Joint, JointDynamics, Link, Model, Pose
from dynx.rbd.base_parameters import align_frames, regroup_inertias
from dynx.rbd.jacobians import REFERENCES
from dynx.rbd.rnea import inverse_dynamics
from dynx.testing.strategies import models
from tests.error_bounds import ErrorBounds, samples_at
from tests.examples import PROFILE

BODY = Inertial(1.5, Pose((0.1, -0.2, 0.3), (0.3, -0.2, 0.5)), 0.04, 0.004, -0.003, 0.05, 0.002, 0.03)
Base = Literal["fixed", "floating"]
each_base = pytest.mark.parametrize("base", ["fixed", "floating"])


def branching(base: Base) -> Model:
    """Return a robot with two ball joints in a row, a slide beside them and a hinge after them."""
    links = [Link(name, BODY) for name in ("base", "a", "b", "c", "d")]
    laws = JointDynamics(0.5, 0.25, 2.0)
    joints = [
        Joint("shoulder", "ball", "base", "a", Pose((0.1, 0.2, 0.3), (0.1, 0.2, 0.3)), dynamics=laws),
        Joint("neck", "ball", "a", "b", Pose((0.1, -0.2, 0.3), (0.4, 0.2, 0.3))),
        Joint("elbow", "revolute", "b", "c", Pose((0.1, 0.2, 0.3), (0.4, 0.2, 0.3)), (0.0, 0.6, 0.8)),
        Joint("slide", "prismatic", "a", "d", Pose((0.1, 0.2, -0.3), (0.1, 0.2, 0.3)), (0.0, 0.6, 0.8)),
    ]
    return Model.build("branching", links, joints, base=base)


def states(model: Model, n: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(0)
    v, a = rng.uniform(-2.0, 2.0, (2, n, model.nv))
    return model.random(rng, n), v, a


@each_base
def test_kernels_equal_the_reference(base: Base) -> None:
    """Every quantity, frame and reference, in a batch and in one sample, bit for bit the same."""
    model = branching(base)
    q, v, a = states(model, 5)
    arguments = {"q": q, "v": v, "a": a, "tau": a}
    bounds = ErrorBounds(samples_at(model, q, v, a, a))
    with dynx.backend("reference", model) as reference, dynx.backend("compiled", model) as compiled:
        for quantity in QUANTITIES.values():
            own = [arguments[name] for name in quantity.arguments]
            for frame in ("base", "a", "c", "d") if quantity.of_frame else (None,):
                for axes in REFERENCES if quantity.name in ("jacobian", "jacobian_derivative") else (None,):
                    details = [] if frame is None else [frame]
                    options = {} if axes is None else {"reference": axes}
                    got = getattr(compiled, quantity.name)(*own, *details, **options)
                    one = getattr(compiled, quantity.name)(*(x[2] for x in own), *details, **options)
                    np.testing.assert_array_equal(got[2], one)
                    if quantity.solves:
                        bounds.check("inverse_dynamics", reference.inverse_dynamics(q, v, got), a)
                    else:
                        wanted = getattr(reference, quantity.name)(*own, *details, **options)
                        bounds.check(quantity.name, got, wanted)


@given(data=st.data())
@settings(max_examples=max(3, PROFILE // 16))
def test_random_robots(data: st.DataObject) -> None:
    model = data.draw(models(joint_types=("ball", "revolute", "prismatic"), mimics=False, solvable=True))
    q, v, a = states(model, 3)
    bounds = ErrorBounds(samples_at(model, q, v, a))
    with dynx.backend("reference", model) as reference, dynx.backend("compiled", model) as compiled:
        for name in ("inverse_dynamics", "coriolis_matrix", "mass_matrix"):
            own = {"inverse_dynamics": (q, v, a), "coriolis_matrix": (q, v), "mass_matrix": (q,)}[name]
            bounds.check(name, getattr(compiled, name)(*own), getattr(reference, name)(*own))


@each_base
def test_regrouped_inertias_give_the_same_torque(base: Base) -> None:
    """A mass at the centre of a ball joint belongs to either of its links."""
    model = branching(base)
    q, v, a = states(model, 3)
    regrouped = regroup_inertias(align_frames(model.mechanism))
    shoulder = model.mechanism.balls[0]
    assert regrouped.bodies[shoulder + 2].inertia.mass == 0.0
    bounds = ErrorBounds(samples_at(model, q, v, a))
    wanted = inverse_dynamics(model.mechanism, q, v, a)
    bounds.check("inverse_dynamics", inverse_dynamics(regrouped, q, v, a), wanted)


def test_invalid_quaternions_are_named() -> None:
    model = branching("fixed")
    with dynx.backend("compiled", model) as engine:
        for n in (1, 300):
            q = model.random(0, n)
            q[-1, 4:8] *= 1.1
            with pytest.raises(ArgumentError, match=r"4:8\] is a quaternion"):
                engine.mass_matrix(q)
        # Rounding of a quaternion is no fault.
        q = model.neutral()
        q[3] = 1.0 + 1e-8
        np.testing.assert_allclose(engine.mass_matrix(q), engine.mass_matrix(model.neutral()), atol=1e-12)


@each_base
def test_derivatives_equal_differences(base: Base) -> None:
    """Central differences along `model.integrate`, whose error is of order h^2."""
    model = branching(base)
    q, v, a = states(model, 2)
    h, found = 1e-5, dynx.Derivatives(model)
    of_torque, of_motion = (
        found.inverse_dynamics_derivatives(q, v, a),
        found.forward_dynamics_derivatives(q, v, a),
    )
    of_pose = found.forward_kinematics_derivative(q, "c")
    with dynx.backend("reference", model) as engine:

        def near(got: np.ndarray, plus: np.ndarray, minus: np.ndarray, size: np.ndarray) -> None:
            # Truncation and rounding of the difference, relative to the largest derivative.
            assert np.max(np.abs(got - (plus - minus) / (2 * h))) <= 1e-7 * (1.0 + np.max(np.abs(size)))

        for k, step in enumerate(h * np.eye(model.nv)):
            ahead, back = model.integrate(q, step), model.integrate(q, -step)
            tau = engine.inverse_dynamics
            near(of_torque.dtau_dq[..., k], tau(ahead, v, a), tau(back, v, a), of_torque.dtau_dq)
            near(of_torque.dtau_dv[..., k], tau(q, v + step, a), tau(q, v - step, a), of_torque.dtau_dv)
            near(of_torque.dtau_da[..., k], tau(q, v, a + step), tau(q, v, a - step), of_torque.dtau_da)
            moved = engine.forward_dynamics
            near(of_motion.da_dq[..., k], moved(ahead, v, a), moved(back, v, a), of_motion.da_dq)
            near(of_motion.da_dv[..., k], moved(q, v + step, a), moved(q, v - step, a), of_motion.da_dv)
            pose = engine.forward_kinematics
            near(of_pose[..., k], pose(ahead, "c"), pose(back, "c"), of_pose)


@each_base
def test_parameters_are_arguments(base: Base) -> None:
    model = branching(base)
    q, v, a = states(model, 3)
    own = dynx.parametric(model, links=["b"], payload="c", joint_dynamics=True)
    names = own.parameters.names
    assert "shoulder.damping" in names
    stiff = replaced(model, "shoulder", JointDynamics(1.5, 0.0, 3.0))
    values = own.parameters.defaults.copy()
    for name, value in (("damping", 1.5), ("friction", 0.0), ("armature", 3.0)):
        values[names.index(f"shoulder.{name}")] = value
    bounds = ErrorBounds(samples_at(model, q, v, a))
    for robot, parameters in ((model, None), (stiff, values)):
        with dynx.backend("reference", robot) as engine:
            wanted = engine.inverse_dynamics(q, v, a, joint_dynamics=True)
            bounds.check("inverse_dynamics", own.inverse_dynamics(q, v, a, parameters), wanted)
            M = engine.mass_matrix(q, joint_dynamics=True)
            bounds.check("mass_matrix", own.mass_matrix(q, parameters), M)


def replaced(model: Model, name: str, laws: JointDynamics) -> Model:
    """Return the robot with other dynamics of one joint."""
    from dataclasses import replace

    joints = [replace(each, dynamics=laws) if each.name == name else each for each in model.joints]
    return Model.build(model.name, model.links, joints, base=model.base)


def chain(n: int) -> Model:
    links = [Link("link 0"), *(Link(f"link {k}", BODY) for k in range(1, n + 1))]
    origin = Pose((0.1, 0.2, 0.3), (0.1, 0.2, 0.3))
    joints = [
        Joint(f"joint {k}", "ball" if k % 2 else "revolute", f"link {k - 1}", f"link {k}", origin)
        for k in range(1, n + 1)
    ]
    return Model.build("chain", links, joints)


def test_long_code_is_evaluated_by_numpy() -> None:
    """Routines for robots of any size have no ball joints."""
    model = chain(40)
    assert not routines_evaluate(model.mechanism, "coriolis_matrix")
    assert not compiles(model.mechanism, "coriolis_matrix")
    q, v, a = states(model, 2)
    bounds = ErrorBounds(samples_at(model, q, v, a))
    with dynx.backend("reference", model) as reference, dynx.backend("compiled", model) as compiled:
        bounds.check("coriolis_matrix", compiled.coriolis_matrix(q, v), reference.coriolis_matrix(q, v))
    found = dynx.Derivatives(model).inverse_dynamics_derivatives(q, v[0], a)
    step = 1e-6 * np.eye(model.nv)[-1]
    with dynx.backend("reference", model) as reference:
        bounds.check("mass_matrix", found.dtau_da, reference.mass_matrix(q))
        ahead, back = (
            reference.inverse_dynamics(model.integrate(q, sign * step), v[0], a) for sign in (1, -1)
        )
    apart = np.abs(found.dtau_dq[..., -1] - (ahead - back) / 2e-6)
    assert np.max(apart) <= 1e-6 * np.max(np.abs(found.dtau_dq))
