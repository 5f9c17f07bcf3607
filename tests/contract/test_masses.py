"""Links without mass, and inertias that no body can have: the numbers of the file as they stand."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dynx.backends import Backend
from dynx.errors import SingularMassMatrixError
from dynx.model import Inertial, Joint, Link, Model, Pose
from dynx.spatial.scalar import Floats
from tests.contract.conftest import Make
from tests.contract.engine_calls import EngineCall, each_call, random_state
from tests.contract.robots import JOINTS, LINKS, body, branched, each_model, hinge
from tests.error_bounds import ErrorBounds, samples_at

MASSLESS = {"no inertial": None, "zero inertial": Inertial()}
each_massless = pytest.mark.parametrize("inertial", MASSLESS.values(), ids=MASSLESS.keys())


@pytest.mark.long_cases
@each_massless
@pytest.mark.parametrize("base", ["fixed", "floating"])
@each_call
def test_a_link_without_inertial_has_no_mass(
    make: Make, base: str, engine_call: EngineCall, inertial: Inertial | None
) -> None:
    """Massless links on fixed joints change no result."""
    extra_links = [Link("flag", inertial), Link("pole", inertial)]
    extra_joints = [
        Joint("pole_weld", "fixed", "trunk", "pole", Pose((0.5, 0.0, 1.0))),
        Joint("flag_weld", "fixed", "pole", "flag", Pose((0.0, 0.3, 0.2), (0.1, 0.2, 0.3))),
    ]
    plain = branched() if base == "fixed" else branched().with_base("floating")
    decked = Model.build(
        "decked", [*extra_links, *LINKS], [*extra_joints, *JOINTS], base=plain.base, gravity=plain.gravity
    )
    assert plain.frame_names[-1] == decked.frame_names[-1]
    state = random_state(plain, 51, (3,))
    result = engine_call.of_shared_parts(engine_call.evaluate(make(decked), state), decked, plain)
    engine_call.check(make(plain), state, result, engine_call.evaluate(make(plain), state))


@each_massless
def test_a_massless_link_on_a_joint(make: Make, inertial: Inertial | None) -> None:
    """Forward dynamics has no solution; the error names the joint."""
    engine = make(hinge(inertial))
    np.testing.assert_array_equal(engine.mass_matrix([0.4]), [[0.0]])
    np.testing.assert_array_equal(engine.inverse_dynamics([0.4], [1.0], [2.0]), [0.0])
    np.testing.assert_array_equal(engine.gravity_torque([0.4]), [0.0])
    np.testing.assert_array_equal(engine.kinetic_energy([0.4], [1.0]), 0.0)
    with pytest.raises(SingularMassMatrixError, match="hinge"):
        engine.forward_dynamics([0.4], [1.0], [0.0])


def test_a_massless_link_between_two_bodies(make: Make) -> None:
    """As in a wrist of two crossed axes: solvable, though the link between has no mass."""
    links = [Link("ground"), Link("cross"), Link("end", body(1.0, 0.1, 0.05, 0.3))]
    joints = [
        Joint("first", "continuous", "ground", "cross", axis=(1.0, 0.0, 0.0)),
        Joint("second", "continuous", "cross", "end", axis=(0.0, 1.0, 0.0)),
    ]
    model = Model.build("wrist", links, joints)
    engine, state = make(model), random_state(model, 52, (4,))
    a = engine.forward_dynamics(state.q, state.v, state.tau)
    close = ErrorBounds(samples_at(model, state.q, state.v, tau=state.tau))
    close.check_solves(a, engine.inverse_dynamics(state.q, state.v, a), state.tau)


def test_a_massless_root_floats(make: Make) -> None:
    """The base frame moves freely although its own link weighs nothing."""
    links = [Link("root"), Link("block", body(2.0, 0.1, 0.0, 0.2))]
    weld = Joint("weld", "fixed", "root", "block", Pose((0.1, 0.2, 0.3), (0.4, 0.5, 0.6)))
    model = Model.build("hull", links, [weld], base="floating")
    engine, state = make(model), random_state(model, 53)
    a = engine.forward_dynamics(state.q, state.v, state.tau)
    close = ErrorBounds(samples_at(model, state.q, state.v, tau=state.tau))
    close.check_solves(a, engine.inverse_dynamics(state.q, state.v, a), state.tau)
    fall = engine.forward_dynamics(model.neutral(), np.zeros(6), np.zeros(6))
    close = ErrorBounds(samples_at(model, model.neutral()))
    close.check_solves(fall, np.zeros(6), np.zeros(6))
    weight = engine.mass_matrix(model.neutral()) @ np.array([0, 0, -9.81, 0, 0, 0])
    close.check("gravity_torque", engine.gravity_torque(model.neutral()), -weight)


IMPOSSIBLE = {
    "triangle inequality broken": (0.01, 0.5, 0.02),
    "broken by rounding": (0.1, 0.2, 0.3000000000000001),
    "one negative moment": (0.2, -0.3, 0.4),
    "all negative": (-0.1, -0.2, -0.3),
    "zero but for one": (0.0, 0.7, 0.0),
}


@pytest.mark.parametrize("moments", IMPOSSIBLE.values(), ids=IMPOSSIBLE.keys())
@pytest.mark.parametrize("axis", range(3))
def test_an_inertia_that_no_body_can_have_is_used_as_it_stands(
    make: Make, axis: int, moments: tuple[float, float, float]
) -> None:
    """On a hinge, M = I_axis + m d^2 whatever the other moments are."""
    unit = np.eye(3)[axis]
    center = np.roll([0.0, 0.3, 0.4], axis)
    ixx, iyy, izz = moments
    inertial = Inertial(2.0, Pose(tuple(center.tolist())), ixx=ixx, iyy=iyy, izz=izz)
    model = hinge(inertial, tuple(unit.tolist())).with_gravity((0.0, 0.0, 0.0))
    distance2 = float(center @ center - (center @ unit) ** 2)
    wanted = moments[axis] + 2.0 * distance2
    engine = make(model)
    close = ErrorBounds(samples_at(model, [0.6], [0.5], [1.5]))
    close.check("mass_matrix", engine.mass_matrix([0.6]), np.array([[wanted]]))
    tau = engine.inverse_dynamics([0.6], [0.5], [1.5])
    close.check("inverse_dynamics", tau, np.array([1.5 * wanted]))


def test_impossible_products_of_inertia(make: Make) -> None:
    """A tensor with a negative principal moment, on a floating base, where each of its entries shows."""
    tensor = np.array([[0.4, 0.3, -0.2], [0.3, -0.5, 0.25], [-0.2, 0.25, 0.6]])
    inertial = Inertial(
        1.5,
        ixx=tensor[0, 0],
        iyy=tensor[1, 1],
        izz=tensor[2, 2],
        ixy=tensor[0, 1],
        ixz=tensor[0, 2],
        iyz=tensor[1, 2],
    )
    model = Model.build("odd", [Link("odd", inertial)], [], base="floating", gravity=(0.0, 0.0, 0.0))
    engine, state = make(model), random_state(model, 54)
    wanted = np.zeros((6, 6))
    wanted[:3, :3], wanted[3:, 3:] = 1.5 * np.eye(3), tensor
    close = ErrorBounds(samples_at(model, state.q, state.v, state.a))
    close.check("mass_matrix", engine.mass_matrix(state.q), wanted)
    v, a = state.v, state.a
    force = 1.5 * (a[:3] + np.cross(v[3:], v[:3]))
    moment = tensor @ a[3:] + np.cross(v[3:], tensor @ v[3:])
    tau = engine.inverse_dynamics(state.q, v, a)
    close.check("inverse_dynamics", tau, np.concatenate([force, moment]))


FREE_LINK = Model.build(
    "free link",
    [Link("base", Inertial(1.0, Pose((0.0, 0.0, 0.125)), ixx=0.0, iyy=0.0, izz=0.125, ixy=0.0625))],
    [],
    base="floating",
)
"""A link whose mass matrix has a negative eigenvalue of -0.06, and a condition number of 17."""

CROSSED = Model.build(
    "crossed",
    [Link("base"), Link("middle"), Link("tip", Inertial(0.0, ixy=0.5))],
    [
        Joint("first", "revolute", "base", "middle", axis=(1.0, 0.0, 0.0)),
        Joint("second", "revolute", "middle", "tip", axis=(0.0, 1.0, 0.0)),
    ],
)
"""Two joints with the mass matrix [[0, 1/2], [1/2, 0]] at rest."""


def test_an_indefinite_mass_matrix_of_a_floating_base_is_solved(make: Make) -> None:
    engine, q, v = make(FREE_LINK), FREE_LINK.neutral(), np.zeros(6)
    tau = np.arange(1.0, 7.0)
    expected = [-7.5, 11.75, -6.81, 78.0, 68.0, 48.0]
    np.testing.assert_allclose(engine.forward_dynamics(q, v, tau), expected, rtol=1e-13)
    # The next call takes the fast path.
    np.testing.assert_allclose(engine.forward_dynamics(q, v, tau), expected, rtol=1e-13)
    batch = engine.forward_dynamics(np.stack([q, q]), v, np.stack([0 * tau, tau]))
    np.testing.assert_allclose(batch, [[0.0, 0.0, -9.81, 0.0, 0.0, 0.0], expected], rtol=1e-13, atol=1e-13)


def test_a_mass_matrix_with_a_diagonal_of_zeros_is_solved(make: Make) -> None:
    a = make(CROSSED).forward_dynamics(np.zeros(2), np.zeros(2), np.array([1.0, 2.0]))
    np.testing.assert_allclose(a, [4.0, 2.0], rtol=1e-13)


def test_what_is_singular_at_one_configuration_is_refused_in_the_same_words(make: Make) -> None:
    """A point mass at the end of two links in one line moves neither along the line nor about itself."""
    links = [Link("base"), Link("upper"), Link("lower", Inertial(1.0, Pose((1.0, 0.0, 0.0))))]
    joints = [
        Joint("shoulder", "revolute", "base", "upper", axis=(0.0, 0.0, 1.0)),
        Joint("elbow", "revolute", "upper", "lower", Pose((1.0, 0.0, 0.0)), axis=(0.0, 0.0, 1.0)),
    ]
    engine = make(Model.build("line", links, joints))
    regular = engine.forward_dynamics(np.array([0.0, 1.0]), np.zeros(2), np.ones(2))
    assert np.isfinite(regular).all()
    words = "^the mass matrix of line is singular at this configuration: no unique acceleration exists$"
    with pytest.raises(SingularMassMatrixError, match=words):
        engine.forward_dynamics(np.zeros(2), np.zeros(2), np.ones(2))
    with pytest.raises(SingularMassMatrixError, match=r"is singular at sample \[1\]: "):
        engine.forward_dynamics(np.array([[0.0, 1.0], [0.0, 0.0]]), np.zeros(2), np.ones(2))


def center_jacobians(model: Model, engine: Backend, q: Floats) -> list[tuple[float, Floats, Floats, Floats]]:
    """For each body: mass, centre of mass, its Jacobian, and inertia tensor, in the world."""
    found = []
    for link in model.links:
        if link.inertial is None:
            continue
        T = engine.forward_kinematics(q, link.name)
        R = T[:3, :3] @ Rotation.from_euler("xyz", link.inertial.origin.rpy).as_matrix()
        center = np.array(link.inertial.origin.xyz)
        J = engine.jacobian(q, link.name, point=center)
        found.append((link.inertial.mass, T[:3, :3] @ center + T[:3, 3], J, R @ link.inertial.tensor @ R.T))
    return found


@each_model
def test_mass_matrix_is_the_sum_over_the_links(make: Make, model: Model) -> None:
    """M = sum of m J_v' J_v + J_w' I J_w (Siciliano et al., Robotics, eq. 7.32)."""
    engine = make(model)
    for seed in range(3):
        state = random_state(model, 90 + seed)
        close = ErrorBounds(samples_at(model, state.q, state.v))
        M = np.zeros((model.nv, model.nv))
        for mass, _, J, tensor in center_jacobians(model, engine, state.q):
            M += mass * J[:3].T @ J[:3] + J[3:].T @ tensor @ J[3:]
        close.check("mass_matrix", engine.mass_matrix(state.q), M)
        energy = 0.5 * state.v @ M @ state.v
        close.check("kinetic_energy", engine.kinetic_energy(state.q, state.v), energy)


@each_model
def test_centre_of_mass_and_gravity_are_those_of_the_links(make: Make, model: Model) -> None:
    engine = make(model)
    for seed in range(3):
        q = random_state(model, 95 + seed).q
        close = ErrorBounds(samples_at(model, q))
        gravity, moment, torque = np.array(model.gravity), np.zeros(3), np.zeros(model.nv)
        for mass, center, J, _ in center_jacobians(model, engine, q):
            moment += mass * center
            torque -= mass * J[:3].T @ gravity
        close.check("center_of_mass", engine.center_of_mass(q), moment / model.total_mass)
        close.check("potential_energy", engine.potential_energy(q), -gravity @ moment)
        close.check("gravity_torque", engine.gravity_torque(q), torque)
