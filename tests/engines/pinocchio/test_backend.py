from __future__ import annotations

import sys
import threading
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynx.agreement.tolerances import BAR
from dynx.backends import backend_class, installed_backends, native_quantities
from dynx.backends.quantities import QUANTITIES
from dynx.engines.pinocchio.backend import PinocchioBackend
from dynx.engines.pinocchio.engine_model import MAX_NV, engine_model
from dynx.errors import EngineError, EngineLimitError, NotInstalledError
from dynx.model import Joint, Link, Model
from dynx.model.elements import Inertial, Pose
from dynx.model.loading import load
from dynx.reference.backend import ReferenceBackend
from dynx.testing.strategies import models
from tests.backends.robots import (
    all_quantities,
    assert_close,
    chain,
    motion,
)

BASES = ("fixed", "floating")


def test_every_quantity_is_computed_by_the_engine() -> None:
    assert native_quantities(PinocchioBackend) == set(QUANTITIES)


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


def test_each_thread_has_a_workspace_of_its_own() -> None:
    engine = PinocchioBackend(chain(2))
    with ThreadPoolExecutor(1) as pool:
        other = pool.submit(lambda: engine._workspace.data).result()
    assert other is not engine._workspace.data
    assert engine._workspace.data is engine._workspace.data


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
