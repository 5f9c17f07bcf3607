"""The backend `drake` where it differs from other backends; `tests.contract` checks what all must return."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from dynx.backends import backend_class, installed_backends
from dynx.errors import EngineError, NotInstalledError, SingularMassMatrixError
from dynx.model import Inertial, Joint, Link, Model, Pose
from dynx.model.elements import JointType
from dynx.reference.backend import ReferenceBackend
from tests.backends.robots import all_quantities, assert_close, chain, mixed_robot, motion
from tests.error_bounds import ErrorBounds, samples_at

pytest.importorskip("pydrake")
from dynx.engines.drake.backend import DrakeBackend

BASES = ("fixed", "floating")
BODY = Inertial(1.5, Pose((0.1, 0.2, 0.3)), 0.5, 0.1, 0.0, 0.6, 0.1, 0.7)
STRANGE = {
    "negative moment": replace(BODY, iyy=-3.0, izz=-3.0),
    "negative mass": replace(BODY, mass=-0.25),
    "tiny mass": Inertial(1e-20, Pose((0.4, 0.5, 0.1)), 1e-20, 0.0, 0.0, 1e-20, 0.0, 1e-20),
    "vanishing mass": Inertial(5e-324, Pose((0.4, 0.5, 0.1)), 0.5, 0.0, 0.0, 0.6, 0.2, 0.7),
    "moment without mass": Inertial(0.0, Pose((0.4, 0.5, 0.1)), 0.5, 0.0, 0.0, 0.6, 0.2, 0.7),
    "nothing": Inertial(),
}


def pair(first: Inertial, second: Inertial, base: str, kind: JointType = "revolute") -> Model:
    """Return two links, each on a joint, on a base of 2 kg."""
    root = Inertial(2.0, Pose((0.3, 0.2, 0.1)), 1.0, 0.0, 0.0, 1.0, 0.0, 1.0)
    links = [Link("root", root), Link("first", first), Link("second", second)]
    joints = [
        Joint("turn", "revolute", "root", "first", Pose((0.1, 0.2, 0.3), (0.4, 0.5, 0.6))),
        Joint("next", kind, "first", "second", Pose((0.3, -0.2, 0.1), (0.1, 0.2, 0.3)), (0.0, 0.6, 0.8)),
    ]
    model = Model.build("pair", links, joints, gravity=(0.3, -0.7, -9.81))
    return model.with_base("floating" if base == "floating" else "fixed")


@pytest.mark.parametrize("base", BASES)
@pytest.mark.parametrize("kind", ["revolute", "prismatic", "fixed"])
@pytest.mark.parametrize("strange", STRANGE)
def test_inertias_that_no_body_can_have_are_used_as_they_stand(
    strange: str, kind: JointType, base: str
) -> None:
    for model in (pair(BODY, STRANGE[strange], base, kind), pair(STRANGE[strange], BODY, base, kind)):
        sample = motion(model)
        expected = all_quantities(ReferenceBackend(model), *sample, forward_dynamics=False)
        for quantity, result in all_quantities(DrakeBackend(model), *sample, forward_dynamics=False).items():
            assert_close(result, expected[quantity], 10.0, what=quantity)


def indefinite() -> Model:
    """Return a robot whose mass matrix is regular and neither positive nor negative."""
    return pair(replace(BODY, ixx=-0.9), BODY, "floating")


@pytest.mark.parametrize(
    "model",
    [
        indefinite(),
        *(pair(BODY, STRANGE["negative mass"], base) for base in BASES),
        *(pair(BODY, STRANGE["moment without mass"], base) for base in BASES),
    ],
    ids=["indefinite", "negative-fixed", "negative-floating", "massless-fixed", "massless-floating"],
)
def test_forward_dynamics_is_found_whatever_the_inertia(model: Model) -> None:
    q, v, tau = motion(model)
    a = DrakeBackend(model).forward_dynamics(q, v, tau)
    near = ErrorBounds(samples_at(model, q, v, a, tau))
    near.check_solves(a, ReferenceBackend(model).inverse_dynamics(q, v, a), tau)


def test_drake_itself_refuses_an_indefinite_mass_matrix() -> None:
    model = indefinite()
    q, v, tau = motion(model)
    ours = DrakeBackend(model)
    context, R = ours._set_state(q, v)
    ours._torque.FixValue(context, ours._coordinates.forces(R, tau))
    with pytest.raises(RuntimeError, match="not positive-definite"):
        ours._acceleration.Eval(context)


def test_no_acceleration_where_nothing_has_inertia() -> None:
    model = pair(BODY, Inertial(), "fixed")
    with pytest.raises(SingularMassMatrixError, match="'next'"):
        DrakeBackend(model).forward_dynamics(*motion(model))


def test_each_thread_has_a_context_of_its_own() -> None:
    model = mixed_robot("floating")
    engine = DrakeBackend(model)
    with ThreadPoolExecutor(1) as pool:
        other = pool.submit(lambda: engine._workspace.context).result()
    assert other is not engine._workspace.context


@pytest.mark.parametrize("raised", [ValueError, RuntimeError, SystemExit])
def test_what_the_engine_raises_becomes_an_engine_error(raised: type[BaseException]) -> None:
    class Broken:
        def __getattr__(self, name: str) -> Callable[..., Any]:
            def fail(*_: object) -> None:
                raise raised("Failure at some.cc:7\nsecond line")

            return fail

    engine = DrakeBackend(chain(2))
    engine._plant = Broken()
    with pytest.raises(EngineError, match=r"chain: \w+: Failure at some.cc:7 second line$") as caught:
        engine.mass_matrix(np.zeros(2))
    assert type(caught.value.__cause__) is raised


def test_a_missing_engine_is_named_with_what_brings_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pydrake.math", None)
    for module in [name for name in sys.modules if name.startswith("dynx.") and "drake" in name]:
        monkeypatch.delitem(sys.modules, module)
    with pytest.raises(NotInstalledError, match=r"the engine 'drake' needs .*pip install '\S*\[drake\]'"):
        backend_class("drake")
    assert "drake" not in installed_backends()


def test_importing_says_nothing_and_leaves_the_log_as_it_was() -> None:
    program = (
        "import logging; root = logging.getLogger(); before = (root.level, root.handlers[:])\n"
        "import dynx.engines.drake.backend\n"
        "assert (root.level, root.handlers) == before\n"
        "assert not logging.getLogger('drake').handlers"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert (done.stdout, done.stderr) == ("", "")


@pytest.mark.parametrize("kind", ["revolute", "prismatic"])
@pytest.mark.parametrize("deviation", [1e-6, 1.9e-8, 1e-8, 1e-10, 1e-13])
def test_an_axis_near_a_coordinate_axis_keeps_its_direction(deviation: float, kind: JointType) -> None:
    """Drake alone takes the coordinate axis (DX226)."""
    root = Inertial(2.0, Pose((0.3, 0.2, 0.1)), 1.0, 0.0, 0.0, 1.0, 0.0, 1.0)
    links = [Link(name, root) for name in ("root", "first", "second", "third")]
    axes = ((deviation, -deviation, 1.0), (0.3 * deviation, 1.0, 0.0), (-1.0, deviation, 0.0))
    joints = [
        Joint(
            f"joint {k}", kind, links[k].name, links[k + 1].name, Pose((0.1, 0.2, 0.3), (0.4, 0.5, 0.6)), axis
        )
        for k, axis in enumerate(axes)
    ]
    model = Model.build("near axes", links, joints, gravity=(0.3, -0.7, -9.81))
    sample = motion(model)
    expected = all_quantities(ReferenceBackend(model), *sample)
    for quantity, result in all_quantities(DrakeBackend(model), *sample).items():
        assert_close(result, expected[quantity], 10.0, what=quantity)
