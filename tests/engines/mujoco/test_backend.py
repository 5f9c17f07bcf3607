from __future__ import annotations

import os
import threading
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from dynx.backends import native_quantities
from dynx.backends.quantities import QUANTITIES
from dynx.errors import EngineError, EngineLimitError, SingularMassMatrixError
from dynx.model import Inertial, Joint, Link, Model, Pose
from dynx.model.loading import load
from dynx.model.tree import Base
from dynx.reference.backend import ReferenceBackend
from dynx.spatial.scalar import Floats
from tests.backends.robots import (
    BASES,
    BOX,
    all_quantities,
    assert_close,
    assert_same,
    chain,
    mixed_robot,
    motion,
    pair,
)
from tests.error_bounds import ErrorBounds, samples_at

pytest.importorskip("mujoco")
import mujoco

from dynx.engines.mujoco.backend import MujocoBackend
from dynx.engines.mujoco.build import MAX_NV
from dynx.engines.mujoco.library import MAX_DEPTH


def test_what_the_engine_computes() -> None:
    derived = {"bias_torque", "coriolis_matrix", "inertial_regressor"}
    assert native_quantities(MujocoBackend) == set(QUANTITIES) - derived


# -- inertias as they stand ------------------------------------------------------------------------

STRANGE = {
    "none": None,
    "zero": Inertial(),
    "point": Inertial(0.7, Pose((0.1, 0.2, 0.3))),
    "rotor": Inertial(0.0, Pose((0.1, 0.2, 0.3)), ixx=0.1, iyy=0.2, izz=0.3),
    "triangle": Inertial(1.0, Pose((0.1, 0.0, 0.0), (1.0, 0.5, 0.2)), ixx=0.5, iyy=0.1, izz=0.1),
    "negative moment": Inertial(1.0, Pose((0.1, 0.0, 0.0), (1.0, 0.5, 0.2)), ixx=-0.05, iyy=0.1, izz=0.1),
    "negative mass": replace(BOX, mass=-0.2),
    "most weight taken away": replace(BOX, mass=-1.5),
    "below mjMINVAL": Inertial(1e-20, Pose((0.1, 0.2, 0.3)), ixx=1e-22, iyy=1e-22, izz=1e-22),
}


@pytest.mark.parametrize("prismatic", [False, True])
@pytest.mark.parametrize("base", BASES)
@pytest.mark.parametrize("kind", STRANGE)
def test_inertias_are_used_as_they_stand(kind: str, base: Base, prismatic: bool) -> None:
    for model in (pair(BOX, STRANGE[kind], base, prismatic), pair(STRANGE[kind], BOX, base, prismatic)):
        q, v, a = motion(model, size=(2,))
        reference, near = ReferenceBackend(model), ErrorBounds(samples_at(model, q, v, a))
        with MujocoBackend(model) as engine:
            tau = reference.inverse_dynamics(q, v, a)
            near.check("inverse_dynamics", engine.inverse_dynamics(q, v, a), tau)
            near.check("mass_matrix", engine.mass_matrix(q), reference.mass_matrix(q))
            near.check("kinetic_energy", engine.kinetic_energy(q, v), reference.kinetic_energy(q, v))
            near.check("potential_energy", engine.potential_energy(q), reference.potential_energy(q))
            if model.total_mass > 0.0:
                near.check("center_of_mass", engine.center_of_mass(q), reference.center_of_mass(q))


@pytest.mark.parametrize("kind", ["triangle", "negative moment", "negative mass", "point", "rotor"])
@pytest.mark.parametrize("base", BASES)
def test_forward_dynamics_of_strange_inertias(kind: str, base: Base) -> None:
    model = pair(BOX, STRANGE[kind], base)
    q, v, tau = motion(model, size=(2,))
    with MujocoBackend(model) as engine:
        a = engine.forward_dynamics(q, v, tau)
    near = ErrorBounds(samples_at(model, q, v, tau=tau))
    near.check_solves(a, ReferenceBackend(model).inverse_dynamics(q, v, a), tau)


def test_a_joint_below_the_least_pivot_of_mujoco_still_moves(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    """And MuJoCo neither warns of it nor begins a log file."""
    monkeypatch.chdir(tmp_path)
    crumb = Inertial(1e-12, Pose((1e-4, 0.0, 0.0)), ixx=1e-20, iyy=1e-20, izz=1e-20)
    joints = [
        Joint("shoulder", "revolute", "root", "arm", axis=(0.0, 1.0, 0.0)),
        Joint("tip", "revolute", "arm", "crumb", Pose((0.2, 0.0, 0.0)), (0.0, 1.0, 0.0)),
    ]
    links = [Link("root", BOX), Link("arm", BOX), Link("crumb", crumb)]
    model = Model.build("crumb", links, joints)
    reference = ReferenceBackend(model)
    q, v, a = motion(model)
    tau = reference.inverse_dynamics(q, v, a)
    with MujocoBackend(model) as engine:
        found = engine.forward_dynamics(q, v, tau)
    again = reference.inverse_dynamics(q, v, found)
    M, bias = reference.mass_matrix(q), reference.bias_torque(q, v)
    # Joint by joint: the crumb's torque is a trillionth of the arm's.
    size_of_terms = np.abs(M) @ (np.abs(a) + np.abs(found)) + np.abs(bias) + np.abs(tau)
    assert_close((again - tau) / size_of_terms, np.zeros(2))
    assert os.listdir(tmp_path) == []
    assert capfd.readouterr() == ("", "")


def test_a_mass_matrix_that_is_singular_somewhere_is_refused_there() -> None:
    """Two points on one line: at 0 and pi the second joint's own motion is the first one's."""
    point = Inertial(1.0, Pose((0.0, 0.0, 0.0)))
    joints = [
        Joint("a", "revolute", "root", "first", axis=(0.0, 0.0, 1.0)),
        Joint("b", "prismatic", "first", "second", axis=(1.0, 0.0, 0.0)),
    ]
    model = Model.build("slot", [Link("root"), Link("first"), Link("second", point)], joints)
    engine = MujocoBackend(model)
    assert_close(engine.forward_dynamics([0.3, 0.5], [0.0, 0.0], [1.0, 2.0]), np.array([4.0, 2.0]))
    with pytest.raises(SingularMassMatrixError):
        engine.forward_dynamics([0.3, 0.0], [0.0, 0.0], [1.0, 2.0])


def test_light_fingers_keep_their_digits() -> None:
    """MuJoCo's own mass matrix loses them, since its inertias are about the common centre of mass."""
    finger = Inertial(1e-3, Pose((0.0, 0.01, 0.0)), ixx=1e-8, iyy=1e-8, izz=1e-8)
    joints = [
        Joint("arm", "revolute", "root", "arm", axis=(0.0, 1.0, 0.0)),
        Joint("finger", "revolute", "arm", "finger", Pose((1.7, 0.3, 0.2), (0.3, 0.2, 0.1))),
    ]
    model = Model.build("hand", [Link("root", BOX), Link("arm", BOX), Link("finger", finger)], joints)
    q = motion(model, size=(20,))[0]
    near, wanted = ErrorBounds(samples_at(model, q)), ReferenceBackend(model).mass_matrix(q)
    with MujocoBackend(model) as engine:
        near.check("mass_matrix", engine.mass_matrix(q), wanted)
        own = np.array([_own_mass_matrix(engine, each) for each in q])
    with pytest.raises(AssertionError, match="mass_matrix: relative error"):
        near.check("mass_matrix", own, wanted)


def _own_mass_matrix(engine: MujocoBackend, q: Floats) -> Floats:
    data = mujoco.MjData(engine._engine)
    data.qpos[:] = q
    mujoco.mj_kinematics(engine._engine, data)
    mujoco.mj_comPos(engine._engine, data)
    mujoco.mj_crb(engine._engine, data)
    M = np.zeros((len(q), len(q)))
    mujoco.mj_fullM(engine._engine, *((M, data.qM) if hasattr(data, "qM") else (data, M)))
    return M


# -- the robot is the one that MuJoCo reads ------------------------------------------------------------


def test_answers_are_those_of_mujoco_on_the_file(tmp_path: Path) -> None:
    model = load("ur5")
    path = tmp_path / "ur5.urdf"
    path.write_text(model.to_urdf())
    theirs = mujoco.MjModel.from_xml_path(str(path))
    theirs.jnt_limited[:] = 0
    data = mujoco.MjData(theirs)
    q, v, a = motion(model)
    data.qpos[:], data.qvel[:], data.qacc[:] = q, v, a
    mujoco.mj_inverse(theirs, data)
    with MujocoBackend(model) as ours:
        assert_close(ours.inverse_dynamics(q, v, a), np.array(data.qfrc_inverse))


# -- limits --------------------------------------------------------------------------------------------


def test_more_joints_than_it_has_room_for() -> None:
    with pytest.raises(EngineLimitError, match=f"takes at most {MAX_NV}"):
        MujocoBackend(chain(MAX_NV + 1))


def test_the_longest_chain_that_it_takes_in_a_small_stack() -> None:
    deep = chain(MAX_DEPTH, "fixed")
    # The least that threads have by default where dynx runs: 512 kB, on macOS.
    with pytest.raises(EngineLimitError, match=f"{MAX_DEPTH + 1} links in a row"):
        MujocoBackend(deep)
    links, joints = deep.links[:-1], deep.joints[:-1]
    model = Model.build("deep", links, [*joints[:-1], replace(joints[-1], type="revolute")])
    before = threading.stack_size(512 * 1024)
    try:
        with ThreadPoolExecutor(1) as pool:
            engine = pool.submit(MujocoBackend, model).result()
            T = pool.submit(engine.forward_kinematics, np.zeros(1), model.frame_names[-1]).result()
    finally:
        threading.stack_size(before)
    assert_close(T[2, 3], np.asarray(0.1 * len(joints)))


# -- state, threads, life ------------------------------------------------------------------------------


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_what_is_not_finite_leaves_nothing_behind(bad: float) -> None:
    model = mixed_robot("floating")
    engine = MujocoBackend(model, validate=False)
    q, v, x = motion(model)
    before = all_quantities(engine, q, v, x)
    with np.errstate(all="ignore"):
        engine.mass_matrix(np.full_like(q, bad))
        engine.inverse_dynamics(q, np.full_like(v, bad), x)
        with pytest.raises(ArithmeticError):
            engine.forward_dynamics(np.full_like(q, bad), v, x)
    assert_same(all_quantities(engine, q, v, x), before)


@pytest.mark.parametrize("raised", [ValueError, RuntimeError, MemoryError, mujoco.FatalError])
def test_what_the_engine_raises_becomes_an_engine_error(
    raised: type[Exception], monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_: object) -> None:
        raise raised("the engine is out of order\nsecond line")

    engine = MujocoBackend(chain(2))
    monkeypatch.setattr(mujoco, "mj_rnePostConstraint", fail)
    with pytest.raises(EngineError, match=r"chain: \w+: the engine is out of order$") as caught:
        engine.inverse_dynamics(np.zeros(2), np.zeros(2), np.zeros(2))
    assert type(caught.value.__cause__) is raised
    monkeypatch.setattr(mujoco, "MjData", fail)
    with pytest.raises(EngineError, match="mujoco cannot represent chain"):
        MujocoBackend(chain(2))
