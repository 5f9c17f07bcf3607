"""The Coriolis matrix is the one that its page defines, and takes no more than it says."""

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
from tests.rbd.exact import CLOSE, distance, exact_mechanism, exactly, fifty_digits, tree_q


def summed_over_bodies(mechanism: Mechanism, poses: Poses, v: Array) -> Array:
    """C body by body: J' (I dJ/dt + B J) in the coordinates of each, which move with it.

    So dJ/dt is less by v x J than where the paper has it, B is more by I v x, and skew-symmetric.
    """
    C = exactly(np.zeros((mechanism.nv, mechanism.nv)))
    for index, frame in enumerate(mechanism.body_frames):
        body = index - 1
        inertia = inertia_matrix(mechanism.root if body == ROOT else mechanism.bodies[body].inertia)
        J = frame_jacobian(mechanism, poses, frame, "local")
        dJ = frame_jacobian_derivative(mechanism, poses, v, frame, "local")
        linear, angular = np.split(J @ v, 2)
        momentum, spin = np.split(inertia @ (J @ v), 2)
        V, W, P, L = skew(linear), skew(angular), skew(momentum), skew(spin)
        on_motion, on_force = np.block([[W, V], [0 * W, W]]), np.block([[W, 0 * W], [V, W]])
        B = (on_force @ inertia + inertia @ on_motion - np.block([[0 * P, P], [P, L]])) / 2
        C = C + J.T @ (inertia @ dJ + B @ J)
    return np.asarray(C)


@given(
    models(max_links=6, base="either").flatmap(lambda m: samples(m).map(lambda s: (m, s))),
    st.lists(st.integers(-8, 8), min_size=11, max_size=11),
)
def test_it_is_the_sum_over_bodies_of_its_definition_in_50_digits(
    case: tuple[Model, tuple[Array, Array, Array]], speeds: list[int]
) -> None:
    model, (q, _, _) = case
    with fifty_digits():
        mechanism = exact_mechanism(model)
        q, v = tree_q(model, q), exactly(speeds[: mechanism.nv]) / 4
        poses = body_poses(mechanism, q)
        wanted = summed_over_bodies(mechanism, poses, v)
        assert distance(coriolis_matrix(mechanism, poses, v), wanted) < CLOSE
        assert distance(coriolis_matrix_at(mechanism, q, v), wanted) < CLOSE


def test_neither_the_place_nor_the_speed_of_the_whole_robot_costs_a_digit() -> None:
    mechanism = mixed_robot("floating").mechanism
    q, v, _ = motion(mixed_robot("floating"))
    far, fast = q.copy(), v.copy()
    far[:3], fast[:3] = 1e12, 1e12
    assert np.array_equal(coriolis_matrix_at(mechanism, far, fast), coriolis_matrix_at(mechanism, q, v))


@pytest.mark.parametrize("base", ["fixed", "floating"])
def test_samples_of_a_batch_are_answered_alike(base: str) -> None:
    model = mixed_robot(base)
    mechanism = model.mechanism
    q, v, _ = motion(model, size=(2, 3))
    for one_by_one, at_once in (
        (coriolis_matrix_at, coriolis_matrix_at(mechanism, q, v)),
        (of_poses, of_poses(mechanism, q, v)),
        (lambda m, x, y: coriolis_matrix_at(m, x, v[0, 0]), coriolis_matrix_at(mechanism, q, v[0, 0])),
        (lambda m, x, y: coriolis_matrix_at(m, q[0, 0], y), coriolis_matrix_at(mechanism, q[0, 0], v)),
    ):
        assert at_once.shape == (2, 3, model.nv, model.nv)
        for k in np.ndindex(2, 3):
            assert np.allclose(at_once[k], one_by_one(mechanism, q[k], v[k]), rtol=1e-13, atol=1e-13)


def test_a_robot_without_joints_has_an_empty_matrix() -> None:
    mechanism = dynx.load('<robot name="stone"><link name="stone"/></robot>').mechanism
    assert coriolis_matrix_at(mechanism, np.zeros((5, 0)), np.zeros((5, 0))).shape == (5, 0, 0)


@pytest.mark.parametrize(
    "model",
    [chain(6), chain(24), mixed_robot("floating"), dynx.load("ur5"), dynx.load("talos", base="floating")],
    ids=["chain of 6", "chain of 24", "mixed", "ur5", "talos"],
)
def test_it_takes_no_more_than_four_times_the_operations_of_the_mass_matrix(model: Model) -> None:
    m = model.mechanism
    ports = {"q": (m.nq,), "v": (m.nv,)}
    of_matrix = trace(lambda q, v: mass_matrix(m, q), ports)
    assert len(trace(lambda q, v: coriolis_matrix_at(m, q, v), ports).nodes) < 4 * len(of_matrix.nodes)


def of_poses(mechanism: Mechanism, q: Array, v: Array) -> Array:
    return coriolis_matrix(mechanism, body_poses(mechanism, q), v)
