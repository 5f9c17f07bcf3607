"""Parameters as arguments: the results are those of a model with the same parameters."""

from __future__ import annotations

import pickle
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dynx.compiled.parametric import ParametricDynamics, parametric
from dynx.errors import (
    ArgumentError,
    NotFiniteError,
    ShapeError,
    SingularMassMatrixError,
    UnknownNameError,
)
from dynx.model import Inertial, Joint, JointDynamics, Link, Model, Pose
from dynx.rbd.regressor import inertial_parameters
from dynx.reference.backend import ReferenceBackend
from dynx.spatial.scalar import Floats
from dynx.testing.strategies import models, samples
from tests.backends.robots import BASES, BOX, assert_close, chain, mixed_robot, motion

MODELS = [
    mixed_robot(base, mimic=mimic).with_frame("hand", "link6", Pose((0.1, -0.2, 0.3), (0.5, 0.1, -0.4)))
    for base in BASES
    for mimic in (False, True)
]
each_model = pytest.mark.parametrize("model", MODELS, ids=["fixed", "mimic", "floating", "floating-mimic"])


def check_same(
    dynamics: ParametricDynamics,
    parameters: Floats | None,
    plain: ReferenceBackend,
    state: tuple[Floats, Floats, Floats],
    joint_dynamics: bool,
) -> None:
    q, v, x = state
    tau = plain.inverse_dynamics(q, v, x, joint_dynamics=joint_dynamics)
    assert_close(dynamics.inverse_dynamics(q, v, x, parameters), tau, what="inverse dynamics")
    M = plain.mass_matrix(q, joint_dynamics=joint_dynamics)
    assert_close(dynamics.mass_matrix(q, parameters), M, what="mass matrix")
    a = plain.forward_dynamics(q, v, x, joint_dynamics=joint_dynamics)
    condition = float(np.max(np.linalg.cond(M)))
    assert_close(dynamics.forward_dynamics(q, v, x, parameters), a, condition * float(np.max(np.abs(a))))


@pytest.mark.long_cases
@each_model
@pytest.mark.parametrize("joint_dynamics", [False, True])
def test_the_parameters_of_the_model_give_its_results(model: Model, joint_dynamics: bool) -> None:
    dynamics = parametric(
        model,
        links=["link6", "link0", "link8"],
        payload="hand",
        point_payload="tip",
        joint_dynamics=joint_dynamics,
        threads=1,
    )
    plain = ReferenceBackend(model)
    for size in ((), (5,), (2, 3)):
        check_same(dynamics, None, plain, motion(model, size=size), joint_dynamics)
        check_same(dynamics, dynamics.parameters.defaults, plain, motion(model, size=size), joint_dynamics)


@given(st.data())
@settings(max_examples=12)
def test_random_robots_with_random_parameters(data: st.DataObject) -> None:
    model = data.draw(models(max_links=4, base="either", solvable=True))
    links = data.draw(st.lists(st.sampled_from([link.name for link in model.links]), unique=True))
    q, v, a = data.draw(samples(model))
    dynamics = parametric(model, links=links, joint_dynamics=True, threads=1)
    tau = ReferenceBackend(model).inverse_dynamics(q, v, a, joint_dynamics=True)
    scale = float(np.max(np.abs(inertial_parameters(model)))) * (1.0 + float(np.max(np.abs(v), initial=0)))
    assert_close(dynamics.inverse_dynamics(q, v, a), tau, max(1.0, scale**2))


@each_model
def test_changed_links_are_those_of_a_changed_model(model: Model) -> None:
    changed = changed_model(model, "link6", BOX)
    dynamics = parametric(model, links=["link6"], threads=1)
    start = 10 * [link.name for link in model.links].index("link6")
    parameters = inertial_parameters(changed)[start : start + 10]
    check_same(dynamics, parameters, ReferenceBackend(changed), motion(model, size=(4,)), False)


@each_model
def test_payloads_are_rigidly_connected_links(model: Model) -> None:
    carrier = next(frame for frame in model.frames if frame.name == "hand")
    for kind in ("payload", "point_payload"):
        point = kind == "point_payload"
        body = Inertial(0.7, Pose((0.1, 0.2, -0.3))) if point else BOX
        weld = Joint("weld", "fixed", carrier.link, "load", carrier.placement)
        loaded = Model.build(
            "loaded", [*model.links, Link("load", body)], [*model.joints, weld], gravity=model.gravity
        ).with_base(model.base)
        dynamics = (
            parametric(model, point_payload="hand", threads=1)
            if point
            else parametric(model, payload="hand", threads=1)
        )
        of_load = [link.name for link in loaded.links].index("load")
        parameters = inertial_parameters(loaded)[10 * of_load : 10 * of_load + 10]
        if point:
            parameters = np.array([0.7, 0.1, 0.2, -0.3])
        q, v, a = motion(model, size=(4,))
        tau = ReferenceBackend(loaded).inverse_dynamics(q, v, a)
        assert_close(dynamics.inverse_dynamics(q, v, a, parameters), tau)
        M = ReferenceBackend(loaded).mass_matrix(q)
        assert_close(dynamics.mass_matrix(q, parameters), M)


@each_model
def test_every_sample_has_its_own_parameters(model: Model) -> None:
    dynamics = parametric(model, links=["link6"], joint_dynamics=True, threads=2)
    q, v, a = motion(model, size=(9,))
    rng = np.random.default_rng(1)
    parameters = dynamics.parameters.defaults * rng.uniform(0.5, 2.0, (9, len(dynamics.parameters.names)))
    together = dynamics.inverse_dynamics(q, v, a, parameters)
    for k in range(9):
        assert_close(dynamics.inverse_dynamics(q[k], v[k], a[k], parameters[k]), together[k])
    spread = dynamics.mass_matrix(q[:, None], parameters)
    assert spread.shape == (9, 9, model.nv, model.nv)
    assert_close(spread[2, 5], dynamics.mass_matrix(q[2], parameters[5]))


def test_joint_parameters_change_the_joint_dynamics() -> None:
    model = chain(2)
    dynamics = parametric(model, joint_dynamics=True, threads=1)
    assert dynamics.parameters.names == tuple(
        f"joint{k}.{name}" for k in range(2) for name in ("damping", "friction", "armature")
    )
    own = [JointDynamics(0.5, 0.25, 0.125), JointDynamics(2.0, 4.0, 8.0)]
    joints = [replace(joint, dynamics=d) for joint, d in zip(model.joints, own, strict=True)]
    changed = Model.build("chain", model.links, joints)
    parameters = np.array([0.5, 0.25, 0.125, 2.0, 4.0, 8.0])
    check_same(dynamics, parameters, ReferenceBackend(changed), motion(model, size=(6,)), True)


@pytest.mark.parametrize("speed", [0.0, -0.0, 5e-324, -5e-324, 1e-300, -1e-160, 1.0, -9e59])
def test_dry_friction_has_the_sign_of_the_speed(speed: float) -> None:
    model = chain(1)
    dynamics = parametric(model, joint_dynamics=True, threads=1)
    q, v, still = np.array([0.3]), np.array([speed]), np.zeros(1)
    with_friction = dynamics.inverse_dynamics(q, v, still, [0.0, 0.75, 0.0])
    without = dynamics.inverse_dynamics(q, v, still, [0.0, 0.0, 0.0])
    assert (with_friction - without)[0] == pytest.approx(0.75 * np.sign(speed), abs=1e-15)
    if speed == 0.0:
        assert with_friction[0] == without[0]


def test_names_and_defaults() -> None:
    model = MODELS[0]
    dynamics = parametric(model, links=["link6"], payload="hand", point_payload="tip")
    names = dynamics.parameters.names
    assert names[0] == "link6.m"
    assert names[10] == "hand.payload.m"
    assert names[-4:] == ("tip.point.mass", "tip.point.cx", "tip.point.cy", "tip.point.cz")
    assert dynamics.parameters.index("link6.Izz") == 9
    assert len(names) == 24
    np.testing.assert_array_equal(dynamics.parameters.defaults[10:], 0.0)
    with pytest.raises(UnknownNameError, match=r"did you mean 'link6\.Izz'"):
        dynamics.parameters.index("link6.Izzz")
    with pytest.raises(ValueError, match="read-only"):
        dynamics.parameters.defaults[0] = 1.0


def test_without_parameters_it_is_the_robot() -> None:
    model = MODELS[0]
    check_same(parametric(model), None, ReferenceBackend(model), motion(model), False)


def test_invalid_arguments_are_refused() -> None:
    model = MODELS[0]
    with pytest.raises(UnknownNameError, match="no link 'link66'"):
        parametric(model, links=["link66"])
    with pytest.raises(ArgumentError, match="twice"):
        parametric(model, links=["link1", "link1"])
    with pytest.raises(UnknownNameError, match="no frame 'hnd'"):
        parametric(model, payload="hnd")
    with pytest.raises(ArgumentError, match="threads"):
        parametric(model, threads=0)
    dynamics = parametric(model, payload="hand")
    q, v, a = motion(model)
    with pytest.raises(ShapeError, match=r"parameters has shape \(3,\); wanted \(\.\.\., 10\)"):
        dynamics.inverse_dynamics(q, v, a, np.zeros(3))
    with pytest.raises(NotFiniteError, match="parameters"):
        dynamics.inverse_dynamics(q, v, a, np.full(10, np.nan))
    with pytest.raises(ShapeError, match="do not broadcast"):
        dynamics.inverse_dynamics(np.stack([q] * 2), v, a, np.zeros((3, 10)))


def test_a_robot_without_inertia_has_no_acceleration() -> None:
    model = chain(2)
    dynamics = parametric(model, links=["link2"], threads=1)
    massless = changed_model(changed_model(model, "link2", None), "link1", None)
    bare = parametric(massless, links=["link2"], threads=1)
    q, v, tau = motion(model)
    assert np.isfinite(dynamics.forward_dynamics(q, v, tau)).all()
    with pytest.raises(SingularMassMatrixError):
        bare.forward_dynamics(q, v, tau)
    heavy = dynamics.parameters.defaults
    assert np.isfinite(bare.forward_dynamics(q, v, tau, heavy)).all()


def test_it_pickles() -> None:
    dynamics = parametric(MODELS[3], links=["link6"], threads=1)
    copy = pickle.loads(pickle.dumps(dynamics))
    state = motion(MODELS[3])
    np.testing.assert_array_equal(copy.inverse_dynamics(*state), dynamics.inverse_dynamics(*state))


def changed_model(model: Model, link: str, inertial: Inertial | None) -> Model:
    """Return the model with another inertial for one link."""
    links = [replace(own, inertial=inertial) if own.name == link else own for own in model.links]
    return replace(model, links=tuple(links))
