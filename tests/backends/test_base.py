from __future__ import annotations

import pickle
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynx.backends import Backend
from dynx.backends.hooks import solve_mass_matrix
from dynx.engines.pinocchio.backend import PinocchioBackend
from dynx.errors import ClosedError, NotFiniteError, SingularMassMatrixError
from dynx.model import Joint, JointDynamics, Link, Model
from dynx.model.elements import Inertial, Pose
from dynx.reference.backend import ReferenceBackend
from dynx.spatial.scalar import Floats
from dynx.testing.strategies import models
from tests.backends.robots import (
    REFERENCES,
    all_quantities,
    assert_close,
    assert_same,
    chain,
    mixed_robot,
    motion,
)

BASES = ("fixed", "floating")
KINDS: tuple[type[Backend], ...] = (PinocchioBackend, ReferenceBackend)
each_kind = pytest.mark.parametrize("kind", KINDS)
each_base = pytest.mark.parametrize("base", BASES)


# -- batches ----------------------------------------------------------------------------------


@given(st.data())
def test_a_batch_is_its_samples_one_by_one(data: st.DataObject) -> None:
    # Without mimic joints: their matrix product may round differently for a batch.
    model = data.draw(models(mimics=False, solvable=True))
    shape = data.draw(st.sampled_from([(1,), (3,), (2, 2), (1, 3)]))
    engine = PinocchioBackend(model)
    q, v, x = motion(model, size=shape)
    together = all_quantities(engine, q, v, x)
    for index in np.ndindex(*shape):
        alone = all_quantities(engine, q[index], v[index], x[index])
        assert_same({quantity: result[index] for quantity, result in together.items()}, alone)


@each_kind
@each_base
def test_leading_axes_broadcast(kind: type[Backend], base: str) -> None:
    model = mixed_robot(base)
    engine = kind(model)
    q, v, x = motion(model, size=(2, 1, 3))
    v, x = v[:, :, 0][:, :, None], x[0, 0, 0]
    batch = (2, 1, 3)
    full = [np.array(np.broadcast_to(array, (*batch, array.shape[-1]))) for array in (q, v, x)]
    results, expected = all_quantities(engine, q, v, x), all_quantities(engine, *full)
    assert_same(results, expected)
    for quantity, result in results.items():
        assert result.shape[:3] == batch, quantity
    # The batch may come from the velocity alone.
    assert engine.bias_torque(q[0, 0, 0], v).shape == (2, 1, 1, model.nv)


@each_kind
@each_base
@pytest.mark.parametrize("mimic", [False, True])
@pytest.mark.parametrize("shape", [(0,), (2, 0), (0, 3)])
def test_a_batch_may_be_empty(kind: type[Backend], base: str, mimic: bool, shape: tuple[int, ...]) -> None:
    model = mixed_robot(base, mimic=mimic)
    engine = kind(model)
    one = all_quantities(engine, *motion(model))
    for quantity, result in all_quantities(engine, *motion(model, size=shape)).items():
        assert result.shape == (*shape, *one[quantity].shape), quantity
        assert result.dtype == np.float64


@each_kind
def test_frames_are_selected_by_one_name_several_or_all(kind: type[Backend]) -> None:
    model = mixed_robot("floating", mimic=True)
    engine = kind(model)
    q = motion(model, size=(2,))[0]
    all_frames = engine.forward_kinematics(q)
    assert all_frames.shape == (2, len(model.frame_names), 4, 4)
    np.testing.assert_array_equal(
        engine.forward_kinematics(q, ["tip", "link3"]),
        all_frames[:, [model.frame_index("tip"), model.frame_index("link3")]],
    )
    for number, frame in enumerate(model.frame_names):
        assert_close(engine.forward_kinematics(q, frame), all_frames[:, number])
    assert engine.forward_kinematics(q, []).shape == (2, 0, 4, 4)


# -- validation off ---------------------------------------------------------------------------


@each_kind
@each_base
def test_without_validation_the_results_are_the_same(kind: type[Backend], base: str) -> None:
    model = mixed_robot(base, mimic=True)
    for size in ((), (2,)):
        sample = motion(model, size=size)
        unchecked = all_quantities(kind(model, validate=False), *sample)
        assert_same(unchecked, all_quantities(kind(model), *sample))


# -- mimic joints -----------------------------------------------------------------------------


def _free(model: Model) -> tuple[Model, Floats]:
    """Free the mimic joints of a robot; return it, and S with v of the free robot = S v."""
    joints = [replace(joint, mimic=None) for joint in model.joints]
    free = Model.build("free", model.links, joints, base=model.base, gravity=model.gravity)
    for frame in model.extra_frames:
        free = free.with_frame(frame.name, frame.link, frame.placement)
    coupling = model.mechanism.coupling
    assert coupling is not None
    return free, coupling.matrix()


@each_kind
@each_base
def test_a_mimic_joint_reduces_the_dynamics_of_the_free_robot(kind: type[Backend], base: str) -> None:
    model = mixed_robot(base, mimic=True)
    free_model, S = _free(model)
    reduced, free = kind(model), kind(free_model)
    q, v, x = motion(model)
    coupling = model.mechanism.coupling
    assert coupling is not None
    q_free, v_free, a_free = coupling.expand_q(q), S @ v, S @ x
    assert (reduced.model.nv, free.model.nv) == (S.shape[1], S.shape[0])

    M = reduced.mass_matrix(q)
    assert_close(M, S.T @ free.mass_matrix(q_free) @ S)
    for joint_dynamics in (False, True):
        option: dict[str, Any] = {"joint_dynamics": joint_dynamics}
        assert_close(
            reduced.inverse_dynamics(q, v, x, **option),
            S.T @ free.inverse_dynamics(q_free, v_free, a_free, **option),
        )
        assert_close(reduced.bias_torque(q, v, **option), S.T @ free.bias_torque(q_free, v_free, **option))
        assert_close(reduced.mass_matrix(q, **option), S.T @ free.mass_matrix(q_free, **option) @ S)
        a = reduced.forward_dynamics(q, v, x, **option)
        size = float(np.linalg.cond(M))
        assert_close(reduced.inverse_dynamics(q, v, a, **option), x, size)
    assert_close(reduced.gravity_torque(q), S.T @ free.gravity_torque(q_free))
    assert_close(reduced.coriolis_matrix(q, v), S.T @ free.coriolis_matrix(q_free, v_free) @ S)
    assert_close(reduced.center_of_mass_jacobian(q), free.center_of_mass_jacobian(q_free) @ S)
    assert_close(reduced.centroidal_momentum(q, v), free.centroidal_momentum(q_free, v_free))
    assert_close(reduced.kinetic_energy(q, v), free.kinetic_energy(q_free, v_free))
    assert_close(reduced.potential_energy(q), free.potential_energy(q_free))
    for frame in model.frame_names:
        assert_close(reduced.forward_kinematics(q, frame), free.forward_kinematics(q_free, frame))
        for reference in REFERENCES:
            at: dict[str, Any] = {"reference": reference}
            assert_close(reduced.jacobian(q, frame, **at), free.jacobian(q_free, frame, **at) @ S)
            assert_close(
                reduced.jacobian_derivative(q, v, frame, **at),
                free.jacobian_derivative(q_free, v_free, frame, **at) @ S,
            )
            assert_close(
                reduced.frame_acceleration(q, v, x, frame, **at),
                free.frame_acceleration(q_free, v_free, a_free, frame, **at),
            )


# -- a point beside the frame -----------------------------------------------------------------


@each_kind
@each_base
@pytest.mark.parametrize("mimic", [False, True])
def test_a_point_is_a_frame_of_its_own(kind: type[Backend], base: str, mimic: bool) -> None:
    point = (0.3, -0.2, 0.5)
    model = mixed_robot(base, mimic=mimic).with_frame("point", "link6", Pose(point))
    engine = kind(model)
    for size in ((), (3,)):
        q, v, x = motion(model, size=size)
        for reference in REFERENCES:
            at: dict[str, Any] = {"reference": reference}
            for beside, own in (
                (
                    engine.jacobian(q, "link6", point=point, **at),
                    engine.jacobian(q, "point", **at),
                ),
                (
                    engine.jacobian_derivative(q, v, "link6", point=point, **at),
                    engine.jacobian_derivative(q, v, "point", **at),
                ),
                (
                    engine.frame_velocity(q, v, "link6", point=point, **at),
                    engine.frame_velocity(q, v, "point", **at),
                ),
                (
                    engine.frame_acceleration(q, v, x, "link6", point=point, **at),
                    engine.frame_acceleration(q, v, x, "point", **at),
                ),
            ):
                assert_close(beside, own, what=reference)


# -- external forces and joint dynamics -------------------------------------------------------


@each_kind
@each_base
@pytest.mark.parametrize("reference", REFERENCES)
def test_external_forces_enter_every_quantity_alike(kind: type[Backend], base: str, reference: str) -> None:
    model = mixed_robot(base, mimic=True)
    engine = kind(model)
    q, v, x = motion(model, size=(4,))
    rng = np.random.default_rng(1)
    forces = {"tip": rng.standard_normal((4, 6)), "link5": rng.standard_normal(6)}
    acting: dict[str, Any] = {"external_forces": forces, "force_reference": reference}
    push = sum(
        np.einsum("kij,ki->kj", engine.jacobian(q, frame, reference=reference), np.broadcast_to(w, (4, 6)))
        for frame, w in forces.items()
    )
    assert_close(engine.inverse_dynamics(q, v, x, **acting), engine.inverse_dynamics(q, v, x) - push)
    assert_close(engine.bias_torque(q, v, **acting), engine.bias_torque(q, v) - push)
    a = engine.forward_dynamics(q, v, x, **acting)
    size = float(np.linalg.cond(engine.mass_matrix(q)).max())
    assert_close(engine.inverse_dynamics(q, v, a, **acting), x, size)


@each_kind
@each_base
@pytest.mark.parametrize("mimic", [False, True])
def test_joint_dynamics_has_one_meaning_in_every_quantity(
    kind: type[Backend], base: str, mimic: bool
) -> None:
    model = mixed_robot(base, mimic=mimic)
    engine = kind(model)
    q, v, x = motion(model, size=(4,))
    M, bias = engine.mass_matrix(q, joint_dynamics=True), engine.bias_torque(q, v, joint_dynamics=True)
    tau = engine.inverse_dynamics(q, v, x, joint_dynamics=True)
    assert_close(tau, np.einsum("kij,kj->ki", M, x) + bias)
    assert_close(engine.forward_dynamics(q, v, tau, joint_dynamics=True), x, float(np.linalg.cond(M).max()))
    assert_close(engine.kinetic_energy(q, v, joint_dynamics=True), 0.5 * np.einsum("ki,kij,kj->k", v, M, v))
    # The terms themselves, joint by joint.
    free, S = _free(model) if mimic else (model, np.eye(model.nv))
    offset = 6 if base == "floating" else 0
    numbers = {joint.name: joint.dynamics for joint in free.coordinate_joints}
    terms = [numbers[name] for name in free.joint_names]
    armature = np.diag([0.0] * offset + [term.armature for term in terms])
    speed = v @ S.T
    loss = np.zeros_like(speed)
    for k, term in enumerate(terms, start=offset):
        loss[:, k] = term.damping * speed[:, k] + term.friction * np.sign(speed[:, k])
    assert_close(M - engine.mass_matrix(q), np.broadcast_to(S.T @ armature @ S, M.shape))
    assert_close(bias - engine.bias_torque(q, v), loss @ S)


@each_kind
def test_one_joint_with_damping_and_friction(kind: type[Backend]) -> None:
    bob = Link("bob", Inertial(1.0, Pose((0.1, 0.0, 0.0)), 0.01, 0.0, 0.0, 0.01, 0.0, 0.01))
    joint = Joint("hinge", "revolute", "root", "bob", axis=(0.0, 1.0, 0.0), dynamics=JointDynamics(0.5, 0.2))
    engine = kind(Model.build("pendulum", [Link("root"), bob], [joint]))
    q, v, a = np.zeros(1), np.ones(1), np.zeros(1)
    assert_close(engine.inverse_dynamics(q, v, a), np.array([-0.981]))
    assert_close(engine.inverse_dynamics(q, v, a, joint_dynamics=True), np.array([-0.281]))


# -- no unique acceleration -------------------------------------------------------------------


@each_kind
def test_a_joint_that_moves_no_inertia_is_named(kind: type[Backend]) -> None:
    arm = chain(2)
    links = [*arm.links, Link("feather")]
    spinner = Joint("spinner", "continuous", "link2", "feather")
    engine = kind(Model.build("feathered", links, [*arm.joints, spinner]))
    with pytest.raises(SingularMassMatrixError, match="nothing that 'spinner' moves has inertia"):
        engine.forward_dynamics(np.zeros(3), np.zeros(3), np.zeros(3))
    assert np.isfinite(engine.inverse_dynamics(np.zeros(3), np.ones(3), np.ones(3))).all()


@each_kind
def test_coordinates_that_cancel_each_other_are_named_as_such(kind: type[Backend]) -> None:
    """The massless base moves the arm, which has inertia; it and the first joint can move without the arm."""
    arm = chain(2)
    links = [Link("mount"), *arm.links[1:], Link("feather")]
    joints = [replace(arm.joints[0], parent="mount"), *arm.joints[1:]]
    floating = kind(Model.build("light base", links[:-1], joints, base="floating"))
    with pytest.raises(SingularMassMatrixError, match=r": 'base', '\w+' can move together so"):
        floating.forward_dynamics(floating.model.neutral(), np.zeros(8), np.zeros(8))
    spinner = Joint("spinner", "continuous", "link2", "feather")
    both = kind(Model.build("both", links, [*joints, spinner], base="floating"))
    with pytest.raises(SingularMassMatrixError, match=r"that 'spinner' moves .*, and 'base', '\w+' can"):
        both.forward_dynamics(both.model.neutral(), np.zeros(9), np.zeros(9))


def test_solving_with_a_singular_mass_matrix_raises() -> None:
    with pytest.raises(SingularMassMatrixError, match="is singular"):
        solve_mass_matrix(np.zeros((2, 2)), np.ones(2))


# -- life cycle -------------------------------------------------------------------------------


@each_kind
def test_life_cycle(kind: type[Backend]) -> None:
    model = mixed_robot("floating", mimic=True)
    q, v, x = motion(model)
    with kind(model) as engine:
        expected = all_quantities(engine, q, v, x)
        assert repr(engine) == f"<{kind.name} backend of mixed>"
        assert engine.engine_version
    with pytest.raises(ClosedError, match="this backend of mixed was closed"):
        engine.mass_matrix(q)
    # A recipe, not a state: what was closed comes back open.
    copy = pickle.loads(pickle.dumps(engine))
    assert_same(all_quantities(copy, q, v, x), expected)


def test_an_acceleration_that_is_not_finite_is_named() -> None:
    model = mixed_robot()
    backend = ReferenceBackend(model)
    q, v = model.neutral(), np.zeros(model.nv)
    with pytest.raises(NotFiniteError, match=r"^a\b"):
        backend.frame_acceleration(q, v, np.full(model.nv, np.nan), model.root, point=[0.1, 0.0, 0.0])
