"""The Coriolis matrix against its definition, and its cost against that of the mass matrix."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import dynx
from dynx.model import Mechanism, Model
from dynx.model.mechanism import ROOT
from dynx.rbd.aba import inertia_matrix
from dynx.rbd.coriolis import coriolis_matrix, coriolis_matrix_at
from dynx.rbd.crba import mass_matrix
from dynx.rbd.jacobians import frame_jacobian, frame_jacobian_derivative
from dynx.rbd.kinematics import Poses, body_poses
from dynx.simd.trace import trace
from dynx.spatial.scalar import Array
from dynx.spatial.so3 import skew
from dynx.testing.strategies import models, samples
from tests.backends.robots import chain, mixed_robot, motion
from tests.rbd.exact import IDENTITY_TOLERANCE, distance, exact_mechanism, exactly, fifty_digits, tree_q


def sum_over_bodies(mechanism: Mechanism, poses: Poses, v: Array) -> Array:
    """Return C as the sum over bodies of J' (I dJ/dt + B J), each term in body-fixed coordinates.

    Compared with the paper, whose axes are inertial, dJ/dt lacks v x J and B has I v x in addition, which
    makes B skew-symmetric.
    """
    C = exactly(np.zeros((mechanism.nv, mechanism.nv)))
    for index, frame in enumerate(mechanism.body_frames):
        body = index - 1
        inertia = inertia_matrix(mechanism.root if body == ROOT else mechanism.bodies[body].inertia)
        J = frame_jacobian(mechanism, poses, frame, "local")
        dJ = frame_jacobian_derivative(mechanism, poses, v, frame, "local")
        linear, angular = np.split(J @ v, 2)
        momentum, angular_momentum = np.split(inertia @ (J @ v), 2)
        V, W, P, L = skew(linear), skew(angular), skew(momentum), skew(angular_momentum)
        motion_cross, force_cross = np.block([[W, V], [0 * W, W]]), np.block([[W, 0 * W], [V, W]])
        B = (force_cross @ inertia + inertia @ motion_cross - np.block([[0 * P, P], [P, L]])) / 2
        C = C + J.T @ (inertia @ dJ + B @ J)
    return np.asarray(C)


@given(
    models(max_links=6, base="either").flatmap(lambda m: samples(m).map(lambda s: (m, s))),
    st.lists(st.integers(-8, 8), min_size=11, max_size=11),
)
def test_equals_its_definition_summed_over_bodies_in_50_digits(
    case: tuple[Model, tuple[Array, Array, Array]], speeds: list[int]
) -> None:
    model, (q, _, _) = case
    with fifty_digits():
        mechanism = exact_mechanism(model)
        q, v = tree_q(model, q), exactly(speeds[: mechanism.nv]) / 4
        poses = body_poses(mechanism, q)
        wanted = sum_over_bodies(mechanism, poses, v)
        assert distance(coriolis_matrix(mechanism, poses, v), wanted) < IDENTITY_TOLERANCE
        assert distance(coriolis_matrix_at(mechanism, q, v), wanted) < IDENTITY_TOLERANCE


def test_position_and_velocity_of_the_base_cause_no_rounding_error() -> None:
    mechanism = mixed_robot("floating").mechanism
    q, v, _ = motion(mixed_robot("floating"))
    far, fast = q.copy(), v.copy()
    far[:3], fast[:3] = 1e12, 1e12
    assert np.array_equal(coriolis_matrix_at(mechanism, far, fast), coriolis_matrix_at(mechanism, q, v))


@pytest.mark.parametrize("base", ["fixed", "floating"])
def test_a_batch_equals_its_samples(base: str) -> None:
    model = mixed_robot(base)
    mechanism = model.mechanism
    q, v, _ = motion(model, size=(2, 3))
    for single, batch in (
        (coriolis_matrix_at, coriolis_matrix_at(mechanism, q, v)),
        (coriolis_matrix_of_poses, coriolis_matrix_of_poses(mechanism, q, v)),
        (lambda m, x, y: coriolis_matrix_at(m, x, v[0, 0]), coriolis_matrix_at(mechanism, q, v[0, 0])),
        (lambda m, x, y: coriolis_matrix_at(m, q[0, 0], y), coriolis_matrix_at(mechanism, q[0, 0], v)),
    ):
        assert batch.shape == (2, 3, model.nv, model.nv)
        for k in np.ndindex(2, 3):
            assert np.allclose(batch[k], single(mechanism, q[k], v[k]), rtol=1e-13, atol=1e-13)


def test_a_robot_without_joints_has_an_empty_matrix() -> None:
    mechanism = dynx.load('<robot name="stone"><link name="stone"/></robot>').mechanism
    assert coriolis_matrix_at(mechanism, np.zeros((5, 0)), np.zeros((5, 0))).shape == (5, 0, 0)


@pytest.mark.parametrize(
    "model",
    [chain(6), chain(24), mixed_robot("floating"), dynx.load("ur5"), dynx.load("talos", base="floating")],
    ids=["chain of 6", "chain of 24", "mixed", "ur5", "talos"],
)
def test_takes_at_most_four_times_the_operations_of_the_mass_matrix(model: Model) -> None:
    m = model.mechanism
    ports = {"q": (m.nq,), "v": (m.nv,)}
    mass_matrix_trace = trace(lambda q, v: mass_matrix(m, q), ports)
    coriolis_trace = trace(lambda q, v: coriolis_matrix_at(m, q, v), ports)
    assert len(coriolis_trace.nodes) < 4 * len(mass_matrix_trace.nodes)


def coriolis_matrix_of_poses(mechanism: Mechanism, q: Array, v: Array) -> Array:
    return coriolis_matrix(mechanism, body_poses(mechanism, q), v)
