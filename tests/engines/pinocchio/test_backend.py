from __future__ import annotations

import sys
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynx.agreement.tolerances import BAR
from dynx.backends import DerivedBackend, backend, backend_class, installed_backends, native_quantities
from dynx.backends.quantities import QUANTITIES
from dynx.engines.pinocchio.backend import PinocchioBackend
from dynx.engines.pinocchio.engine_model import MAX_NV, engine_model
from dynx.errors import ClosedError, EngineError, EngineLimitError, NotInstalledError
from dynx.model import Joint, Link, Model
from dynx.model.elements import Inertial, Pose
from dynx.model.loading import load
from dynx.reference.backend import ReferenceBackend
from dynx.spatial.scalar import Floats
from dynx.testing.strategies import models
from tests.backends.independence import (
    check_pickle_round_trip,
    check_results_belong_to_the_caller,
    check_threads_get_equal_results,
)
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


def test_every_quantity_is_computed_by_the_engine() -> None:
    assert native_quantities(PinocchioBackend) == set(QUANTITIES)


@pytest.mark.parametrize("mimic", [False, True])
@pytest.mark.parametrize("base", BASES)
def test_native_answers_are_those_derived_and_those_of_the_reference(base: str, mimic: bool) -> None:
    model = mixed_robot(base, mimic=mimic)
    native = PinocchioBackend(model)
    sample = motion(model, size=(5,))
    results = all_quantities(native, *sample)
    for other in (DerivedBackend(native), ReferenceBackend(model)):
        for quantity, expected in all_quantities(other, *sample).items():
            # An acceleration amplifies rounding by the condition number of the mass matrix.
            size = float(np.linalg.cond(native.mass_matrix(sample[0])).max())
            assert_close(
                results[quantity], expected, size if quantity == "forward_dynamics" else 1.0, quantity
            )


def test_the_robot_is_the_one_that_pinocchio_reads_from_the_file() -> None:
    model = load("ur5")
    engine = pin.buildModelFromUrdf(model.source)
    data = engine.createData()
    ours = PinocchioBackend(model)
    assert list(engine.names)[1:] == list(model.joint_names)
    q, v, a = motion(model)
    assert_close(ours.inverse_dynamics(q, v, a), pin.rnea(engine, data, q, v, a))
    assert_close(ours.mass_matrix(q), pin.crba(engine, data, q))
    pin.framesForwardKinematics(engine, data, q)
    for frame in model.frame_names:
        assert_close(
            ours.forward_kinematics(q, frame), data.oMf[engine.getFrameId(frame)].homogeneous, what=frame
        )


@given(st.data())
def test_mass_matrix_is_symmetric_to_the_last_bit(data: st.DataObject) -> None:
    model = data.draw(models(mimics=False))
    M = PinocchioBackend(model).mass_matrix(motion(model)[0])
    np.testing.assert_array_equal(M, M.T)


@pytest.mark.parametrize("base", BASES)
def test_answers_belong_to_the_caller(base: str) -> None:
    check_results_belong_to_the_caller(PinocchioBackend(mixed_robot(base)))


def _reversed_view(x: Floats) -> Floats:
    backwards: Floats = x[::-1].copy()[::-1]
    return backwards


def _every_other(x: Floats) -> Floats:
    strided: Floats = np.repeat(x, 2)[::2]
    return strided


def _unaligned(x: Floats) -> Floats:
    moved: Floats = np.zeros(x.nbytes + 1, np.uint8)[1:].view(np.float64)
    moved[:] = x
    return moved


def _read_only(x: Floats) -> Floats:
    copy: Floats = np.array(x)
    copy.flags.writeable = False
    return copy


@pytest.mark.parametrize("laid_out", [_reversed_view, _every_other, _unaligned, _read_only])
def test_memory_layout_of_the_arguments_does_not_matter(laid_out: Any) -> None:
    model = mixed_robot("floating")
    engine = PinocchioBackend(model)
    q, v, a = motion(model)
    assert_same(
        all_quantities(engine, laid_out(q), laid_out(v), laid_out(a)), all_quantities(engine, q, v, a)
    )


def test_eight_threads_get_what_one_gets() -> None:
    check_threads_get_equal_results(PinocchioBackend(mixed_robot("floating")), samples=64)


def test_each_thread_has_a_workspace_of_its_own() -> None:
    engine = PinocchioBackend(chain(2))
    with ThreadPoolExecutor(1) as pool:
        other = pool.submit(lambda: engine._workspace.data).result()
    assert other is not engine._workspace.data
    assert engine._workspace.data is engine._workspace.data


def test_pickle_makes_the_same_backend() -> None:
    check_pickle_round_trip(PinocchioBackend(mixed_robot("floating"), validate=False))


@pytest.mark.parametrize("validate", [True, False])
def test_a_closed_backend_refuses(validate: bool) -> None:
    model = chain(2)
    q, v, a = motion(model)
    with PinocchioBackend(model, validate=validate) as engine:
        engine.inverse_dynamics(q, v, a)
    engine.close()
    calls: tuple[Callable[[], Floats], ...] = (
        lambda: engine.forward_kinematics(q, "link1"),
        lambda: engine.jacobian(q, "link1"),
        lambda: engine.inverse_dynamics(q, v, a),
        lambda: engine.mass_matrix(q),
        lambda: engine.potential_energy(q),
    )
    for call in calls:
        with pytest.raises(ClosedError, match="chain"):
            call()
    assert not hasattr(engine, "_engine")


def test_a_call_that_close_overtakes_says_so() -> None:
    engine = PinocchioBackend(chain(2))
    engine.close()
    with pytest.raises(ClosedError, match="during a call"):
        engine._mass_matrix(np.zeros(2))


@pytest.mark.parametrize("raised", [ValueError, RuntimeError, MemoryError, TypeError])
def test_what_the_engine_raises_becomes_an_engine_error(
    raised: type[Exception], monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object) -> None:
        raise raised("the engine is out of order\nsecond line")

    engine = PinocchioBackend(chain(2))
    monkeypatch.setattr(pin, "rnea", fail)
    with pytest.raises(EngineError, match=r"chain: \w+: the engine is out of order$") as caught:
        engine.inverse_dynamics(np.zeros(2), np.zeros(2), np.zeros(2))
    assert type(caught.value.__cause__) is raised


def test_without_validation_a_wrong_shape_that_the_engine_notices_is_still_an_engine_error() -> None:
    engine = PinocchioBackend(chain(2), validate=False)
    with pytest.raises(
        EngineError, match=r"pinocchio failed on chain: ValueError: wrong argument size: expected 2, got 3$"
    ):
        engine.inverse_dynamics(np.zeros(3), np.zeros(2), np.zeros(2))


def test_a_failure_to_build_is_an_engine_error(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail(*_: object) -> None:
        raise RuntimeError

    engine_model.cache_clear()
    monkeypatch.setattr(pin, "Model", fail)
    with pytest.raises(EngineError, match="pinocchio cannot represent chain: RuntimeError: no message"):
        PinocchioBackend(chain(2))


def test_a_missing_engine_is_named_with_what_brings_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pinocchio", None)
    monkeypatch.delitem(sys.modules, "dynx.engines.pinocchio.backend")
    monkeypatch.delitem(sys.modules, "dynx.engines.pinocchio.library")
    with pytest.raises(NotInstalledError, match="pip install"):
        backend_class("pinocchio")
    assert "pinocchio" not in installed_backends()


def test_more_degrees_of_freedom_than_memory_allows_are_refused() -> None:
    with pytest.raises(EngineLimitError, match=f"has {MAX_NV + 1} degrees of freedom.*at most {MAX_NV}"):
        PinocchioBackend(chain(MAX_NV + 1))


def test_a_long_chain_of_fixed_links_is_no_danger_in_a_small_stack() -> None:
    links = chain(3000, "fixed")
    model = Model.build("deep", links.links, [*links.joints[:-1], replace(links.joints[-1], type="revolute")])
    before = threading.stack_size(256 * 1024)
    try:
        with ThreadPoolExecutor(1) as pool:
            engine = pool.submit(PinocchioBackend, model).result()
            T = pool.submit(engine.forward_kinematics, np.zeros(1), "link3000").result()
    finally:
        threading.stack_size(before)
    assert_close(T[2, 3], np.asarray(300.0))


@pytest.mark.parametrize("n", [0, 1])
@pytest.mark.parametrize("base", BASES)
def test_a_robot_with_one_joint_or_none_has_arrays_of_the_usual_shapes(base: str, n: int) -> None:
    model = chain(n).with_base("floating" if base == "floating" else "fixed")
    sample = motion(model)
    results = all_quantities(PinocchioBackend(model), *sample)
    for quantity, expected in all_quantities(ReferenceBackend(model), *sample).items():
        assert_close(results[quantity], expected, what=quantity)


def _pair(first: Inertial, second: Inertial, base: str = "fixed") -> Model:
    """Return a moving body of two welded links, on a base of 2 kg."""
    root = Inertial(2.0, Pose((0.3, 0.2, 0.1)), 1.0, 0.0, 0.0, 1.0, 0.0, 1.0)
    links = [Link("root", root), Link("first", first), Link("second", second)]
    joints = [
        Joint("turn", "revolute", "root", "first", Pose((0.1, 0.2, 0.3), (0.4, 0.5, 0.6))),
        Joint("weld", "fixed", "first", "second", Pose((0.3, -0.2, 0.1), (0.1, 0.2, 0.3))),
    ]
    return Model.build("pair", links, joints).with_base("floating" if base == "floating" else "fixed")


BODY = Inertial(1.5, Pose((0.1, 0.2, 0.3)), 0.5, 0.1, 0.0, 0.6, 0.1, 0.7)
STRANGE = {
    "negative moment": Inertial(1.0, Pose((0.4, 0.0, 0.1)), -0.5, 0.0, 0.0, 0.6, 0.2, 0.7),
    "tiny mass": Inertial(1e-20, Pose((0.4, 0.5, 0.1)), 1e-20, 0.0, 0.0, 1e-20, 0.0, 1e-20),
    "moment without mass": Inertial(0.0, Pose((0.4, 0.5, 0.1)), 0.5, 0.0, 0.0, 0.6, 0.2, 0.7),
    "nothing": Inertial(),
}


@pytest.mark.parametrize("base", BASES)
@pytest.mark.parametrize("strange", STRANGE)
@pytest.mark.parametrize("alone", [True, False])
def test_inertias_that_no_body_can_have_are_used_as_they_stand(strange: str, alone: bool, base: str) -> None:
    body = STRANGE[strange]
    model = _pair(body, Inertial() if alone else BODY, base)
    sample = motion(model)
    results = all_quantities(PinocchioBackend(model), *sample, forward_dynamics=False)
    expected = all_quantities(ReferenceBackend(model), *sample, forward_dynamics=False)
    for quantity, value in expected.items():
        assert_close(results[quantity], value, what=quantity)


def test_a_tiny_mass_alone_keeps_its_relative_accuracy() -> None:
    model = _pair(STRANGE["tiny mass"], Inertial())
    q, v, a = motion(model)
    ours, reference = PinocchioBackend(model), ReferenceBackend(model)
    expected = reference.inverse_dynamics(q, v, a)
    np.testing.assert_allclose(ours.inverse_dynamics(q, v, a), expected, rtol=BAR)
    np.testing.assert_allclose(ours.mass_matrix(q), reference.mass_matrix(q), rtol=BAR)


@pytest.mark.parametrize("moving", [True, False])
@pytest.mark.parametrize("first", ["tiny mass", "moment without mass", "nothing"])
def test_several_bodies_too_light_to_be_added_are_refused(first: str, moving: bool) -> None:
    model = _pair(STRANGE[first], STRANGE["tiny mass"])
    if moving:
        joints = [replace(joint, type="revolute") for joint in model.joints]
        model = Model.build("pair", model.links, joints)
    elif first == "nothing":
        PinocchioBackend(model)
        return
    with pytest.raises(EngineLimitError, match=r"merged at '(second|turn)' have [12]e-20 kg together"):
        PinocchioBackend(model)


def test_a_negative_mass_is_refused() -> None:
    with pytest.raises(EngineLimitError, match=r"link 'second' has mass -1\.5"):
        PinocchioBackend(_pair(BODY, replace(BODY, mass=-BODY.mass)))


@pytest.mark.parametrize("reference", REFERENCES)
@pytest.mark.parametrize("base", BASES)
def test_external_forces_are_those_of_the_engine(base: str, reference: str) -> None:
    model = mixed_robot(base)
    ours = PinocchioBackend(model)
    q, v, a = motion(model)
    rng = np.random.default_rng(3)
    forces = {frame: rng.standard_normal(6) for frame in ("tip", "link4", "link9", "link0")}

    engine = ours._engine
    data = engine.createData()
    pin.framesForwardKinematics(engine, data, q)
    on_joints = pin.StdVec_Force(engine.njoints, pin.Force.Zero())
    for frame, wrench in forces.items():
        number = ours._frame_ids[model.frame_index(frame)]
        joint, T_world_frame = engine.frames[number].parentJoint, data.oMf[number]
        in_world = {
            "local": T_world_frame.act(pin.Force(wrench)),
            "local_world_aligned": pin.SE3(np.eye(3), T_world_frame.translation).act(pin.Force(wrench)),
            "world": pin.Force(wrench),
        }[reference]
        on_joints[joint] += data.oMi[joint].actInv(in_world)

    options: dict[str, Any] = {"external_forces": forces, "force_reference": reference}
    assert_close(ours.inverse_dynamics(q, v, a, **options), pin.rnea(engine, data, q, v, a, on_joints), 10.0)
    condition = float(np.linalg.cond(ours.mass_matrix(q)))
    assert_close(
        ours.forward_dynamics(q, v, a, **options), pin.aba(engine, data, q, v, a, on_joints), condition
    )


def test_engine_version_names_the_library() -> None:
    assert PinocchioBackend(chain(1)).engine_version == f"pinocchio {pin.__version__}"


def test_names_of_the_engine_are_free_for_robots() -> None:
    model = Model.build(
        "names",
        [Link("universe", BODY), Link("root_joint", BODY), Link("base", BODY)],
        [
            Joint("universe", "revolute", "universe", "root_joint"),
            Joint("base", "revolute", "root_joint", "base"),
        ],
        base="floating",
    )
    sample = motion(model)
    results = all_quantities(backend("pinocchio", model), *sample)
    for quantity, expected in all_quantities(ReferenceBackend(model), *sample).items():
        assert_close(results[quantity], expected, what=quantity)
