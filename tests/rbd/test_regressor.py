"""The inertial regressor against inverse dynamics with changed inertial parameters."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given

from dynx.backends import DerivedBackend
from dynx.engines.pinocchio.backend import PinocchioBackend
from dynx.model import Inertial, Joint, Link, Model
from dynx.rbd import rnea
from dynx.rbd.kinematics import body_poses
from dynx.rbd.regressor import (
    PARAMETERS,
    inertial_parameters,
    inertial_regressor,
    link_inertia,
)
from dynx.reference.backend import ReferenceBackend
from dynx.spatial.inertia import inertia_from_parameters, parameters_from_inertia
from dynx.spatial.scalar import Array
from dynx.testing.strategies import models, samples
from tests.backends.robots import BASES, assert_close, chain, mixed_robot, motion
from tests.error_bounds import ErrorBounds, samples_at
from tests.rbd.exact import IDENTITY_TOLERANCE, distance, exact_mechanism, exactly, fifty_digits, tree_q

MODELS = [mixed_robot(base, mimic=mimic) for base in BASES for mimic in (False, True)]
each_model = pytest.mark.parametrize("model", MODELS, ids=["fixed", "mimic", "floating", "floating-mimic"])


def link_number(model: Model, name: str) -> int:
    return [link.name for link in model.links].index(name)


@given(models(max_links=5, base="either").flatmap(lambda m: samples(m).map(lambda s: (m, s))))
def test_torque_is_regressor_times_parameters_in_50_digits(case: tuple[Model, tuple[Array, ...]]) -> None:
    model, (q, v, a) = case
    with fifty_digits():
        mechanism = exact_mechanism(model)
        S = np.eye(mechanism.nv) if mechanism.coupling is None else mechanism.coupling.matrix()
        q, v, a = tree_q(model, q), exactly(S) @ exactly(v), exactly(S) @ exactly(a)
        poses = body_poses(mechanism, q)
        Y = inertial_regressor(mechanism, poses, v, a, range(len(model.links)))
        assert Y.shape == (mechanism.nv, 10 * len(model.links))
        tau = rnea.inverse_dynamics(mechanism, q, v, a)
        assert distance(Y @ inertial_parameters(model, exactly), tau) < IDENTITY_TOLERANCE


@given(models(max_links=5, base="either").flatmap(lambda m: samples(m).map(lambda s: (m, s))))
def test_native_and_derived_regressors_agree(case: tuple[Model, tuple[Array, ...]]) -> None:
    model, (q, v, a) = case
    close = ErrorBounds(samples_at(model, q, v, a))
    reference = ReferenceBackend(model).inertial_regressor(q, v, a)
    # Pinocchio cannot represent every inertia, but its regressor uses no inertia.
    bare = replace(model, links=tuple(replace(link, inertial=None) for link in model.links))
    engine = PinocchioBackend(bare)
    close.check("inertial_regressor", engine.inertial_regressor(q, v, a), reference)
    close.check("inertial_regressor", DerivedBackend(engine).inertial_regressor(q, v, a), reference)


@each_model
@pytest.mark.parametrize("size", [(), (3,), (2, 2)])
def test_torque_of_every_backend(model: Model, size: tuple[int, ...]) -> None:
    q, v, a = motion(model, size=size)
    for engine in (ReferenceBackend(model), PinocchioBackend(model)):
        Y = engine.inertial_regressor(q, v, a)
        assert Y.shape == (*size, model.nv, 10 * len(model.links))
        assert_close(Y @ inertial_parameters(model), engine.inverse_dynamics(q, v, a))


@each_model
@pytest.mark.parametrize("link", ["link0", "link3", "link6", "link8"])
def test_a_column_is_the_torque_of_one_parameter(model: Model, link: str) -> None:
    q, v, a = motion(model)
    start = 10 * link_number(model, link)
    Y = ReferenceBackend(model).inertial_regressor(q, v, a)
    before = ReferenceBackend(model).inverse_dynamics(q, v, a)
    # A point mass at the origin of the link frame, then an inertia tensor: the torque is linear in both.
    changes = {
        0: Inertial(2.0),
        4: Inertial(ixx=2.0),
        5: Inertial(ixy=2.0),
        6: Inertial(ixz=2.0),
        7: Inertial(iyy=2.0),
        8: Inertial(iyz=2.0),
        9: Inertial(izz=2.0),
    }
    for column, added in changes.items():
        changed = with_body(model, link, added)
        after = ReferenceBackend(changed).inverse_dynamics(q, v, a)
        size = float(np.max(np.abs(before)))
        assert_close((after - before) / 2.0, Y[:, start + column], size, PARAMETERS[column])


@pytest.mark.parametrize("axis", range(3))
def test_column_of_a_first_moment(axis: int) -> None:
    model = MODELS[2]
    q, v, a = motion(model)
    Y = ReferenceBackend(model).inertial_regressor(q, v, a)
    own = link_inertia(model, "link6")
    parameters = parameters_from_inertia(own)
    parameters[1 + axis] += 0.5
    mechanism = model.mechanism
    frame = mechanism.frames[link_number(model, "link6")]
    change = inertia_from_parameters(parameters - parameters_from_inertia(own)).transform(frame.R, frame.p)
    bodies = list(mechanism.bodies)
    bodies[frame.body] = replace(bodies[frame.body], inertia=bodies[frame.body].inertia + change)
    after = rnea.inverse_dynamics(replace(mechanism, bodies=tuple(bodies)), q, v, a)
    before = rnea.inverse_dynamics(mechanism, q, v, a)
    column = Y[:, 10 * link_number(model, "link6") + 1 + axis]
    assert_close((after - before) / 0.5, column, float(np.max(np.abs(before))))


def test_links_fixed_to_the_world_have_zero_columns() -> None:
    model = mixed_robot()
    Y = ReferenceBackend(model).inertial_regressor(*motion(model))
    np.testing.assert_array_equal(Y[:, :10], 0.0)
    np.testing.assert_array_equal(PinocchioBackend(model).inertial_regressor(*motion(model))[:, :10], 0.0)
    floating = mixed_robot("floating")
    Y = ReferenceBackend(floating).inertial_regressor(*motion(floating))
    assert np.all(np.any(Y[:, :10] != 0.0, axis=0))


@pytest.mark.parametrize("joints", [0, 1])
def test_robots_with_no_joint_and_with_one(joints: int) -> None:
    model = chain(joints)
    for engine in (ReferenceBackend(model), PinocchioBackend(model)):
        for size in ((), (4,), (0,)):
            q, v, a = motion(model, size=size)
            Y = engine.inertial_regressor(q, v, a)
            assert Y.shape == (*size, joints, 10 * len(model.links))
            assert_close(Y @ inertial_parameters(model), engine.inverse_dynamics(q, v, a))


def test_parameters_of_a_link() -> None:
    model = mixed_robot()
    parameters = inertial_parameters(model).reshape(-1, 10)
    assert len(parameters) == len(model.links)
    np.testing.assert_array_equal(parameters[link_number(model, "link3")], 0.0)
    inertial = model.inertial("link6")
    own = parameters[link_number(model, "link6")]
    assert own[0] == inertial.mass
    np.testing.assert_allclose(own[1:4], inertial.mass * np.array(inertial.origin.xyz), rtol=1e-15)
    inertia = inertia_from_parameters(own)
    np.testing.assert_array_equal(parameters_from_inertia(inertia), own)
    np.testing.assert_array_equal(inertia.rotational_inertia, inertia.rotational_inertia.T)


def with_body(model: Model, link: str, added: Inertial) -> Model:
    """Return the model with a body rigidly connected to `link`, its inertial given in the link frame."""
    joint = Joint("added_joint", "fixed", link, "added")
    changed = Model.build(
        "changed", [*model.links, Link("added", added)], [*model.joints, joint], gravity=model.gravity
    )
    return changed.with_base(model.base)
