"""No call to PyBullet changes the result of a later one, and clients are disconnected."""

from __future__ import annotations

import gc
import pickle
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dynx.engines.pybullet.backend import PyBulletBackend
from dynx.errors import ClosedError, EngineError, NotFiniteError
from dynx.model import Inertial
from dynx.model.tree import Base
from dynx.reference.backend import ReferenceBackend
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
from tests.engines.pybullet.robots import clients

bullet = pytest.importorskip("pybullet")

NAN = float("nan")


# -- no call leaves a trace -----------------------------------------------------------------------------


def test_robots_of_equal_size_do_not_share_inertia() -> None:
    """Bullet's cache of inverse dynamics goes by the address of a body, and outlives it."""
    robots = [pair(replace(BOX, mass=1.0 + k), replace(BOX, mass=2.0 + k), "floating") for k in range(8)]
    sample = motion(robots[0])
    wanted = [ReferenceBackend(model).inverse_dynamics(*sample) for model in robots]
    for model, tau in zip(robots, wanted, strict=True):
        with PyBulletBackend(model) as engine:
            assert_close(engine.inverse_dynamics(*sample), tau)
    alive = [PyBulletBackend(model) for model in robots]
    for engine, tau in zip(reversed(alive), reversed(wanted), strict=True):
        assert_close(engine.inverse_dynamics(*sample), tau)


@pytest.mark.parametrize("base", BASES)
def test_no_order_of_calls_changes_a_result(base: Base) -> None:
    model = mixed_robot(base)
    engine = PyBulletBackend(model)
    q, v, x = motion(model)
    other = motion(model, seed=1)
    frame = model.frame_names[-1]
    T = engine.forward_kinematics(other[0], frame)
    calls: list[Callable[[], Any]] = [
        lambda: engine.forward_kinematics(q),
        lambda: engine.forward_kinematics(q, frame),
        lambda: engine.jacobian(q, frame, reference="local"),
        lambda: engine.inverse_dynamics(q, v, x),
        lambda: engine.gravity_torque(q),
        lambda: engine.mass_matrix(q),
        lambda: engine.forward_dynamics(q, v, x),
        lambda: engine.engine_inverse_kinematics(T, frame, q, iterations=5),
    ]
    alone = [call() for call in calls]
    rng = np.random.default_rng(0)
    for _ in range(300):
        before, tested = rng.integers(0, len(calls), 2)
        calls[before]()
        if rng.random() < 0.3:
            engine.forward_dynamics(*other)
        np.testing.assert_array_equal(calls[tested](), alone[tested])


@pytest.mark.parametrize("base", BASES)
def test_nan_does_not_poison_the_engine(base: Base) -> None:
    model = mixed_robot(base)
    engine = PyBulletBackend(model, validate=False)
    q, v, x = motion(model)
    before = all_quantities(engine, q, v, x)
    for bad in (NAN, np.inf):
        bad_q, bad_v = np.full_like(q, bad), np.full_like(v, bad)
        calls: tuple[tuple[Callable[..., Any], tuple[Any, ...]], ...] = (
            (engine.forward_kinematics, (bad_q,)),
            (engine.jacobian, (bad_q, model.frame_names[-1])),
            (engine.mass_matrix, (bad_q,)),
            (engine.inverse_dynamics, (q, bad_v, x)),
            (engine.forward_dynamics, (q, v, bad_v)),
        )
        for call, arguments in calls:
            with np.errstate(all="ignore"), pytest.raises(NotFiniteError):
                call(*arguments)
    assert_same(all_quantities(engine, q, v, x), before)


def test_overflow_does_not_poison_the_engine() -> None:
    model = pair(BOX, BOX, "floating")
    # Unchecked: arguments of this size are refused otherwise.
    engine = PyBulletBackend(model, validate=False)
    q, v, x = motion(model)
    before = all_quantities(engine, q, v, x)
    with pytest.raises(ArithmeticError):
        engine.forward_dynamics(q, np.full_like(v, 1e300), x)
    assert_same(all_quantities(engine, q, v, x), before)


# -- life cycle ----------------------------------------------------------------------------------------


def test_a_pickled_copy_has_a_client_of_its_own() -> None:
    engine = PyBulletBackend(mixed_robot("floating"), validate=False)
    copy = pickle.loads(pickle.dumps(engine))
    sample = motion(engine.model)
    assert_same(all_quantities(copy, *sample), all_quantities(engine, *sample))
    assert not set(clients(copy)) & set(clients(engine))


@pytest.mark.parametrize("validate", [True, False])
@pytest.mark.parametrize("tip", [BOX, Inertial(1.0, ixx=-0.05, iyy=0.1, izz=0.1)])
def test_a_closed_backend_refuses_and_holds_no_client(tip: Inertial, validate: bool) -> None:
    model = pair(BOX, tip, "fixed")
    q, v, x = motion(model)
    with PyBulletBackend(model, validate=validate) as engine:
        held = clients(engine)
        engine.inverse_dynamics(q, v, x)
    engine.close()
    assert not any(bullet.isConnected(client) for client in held)
    calls: tuple[Callable[[], Any], ...] = (
        lambda: engine.forward_kinematics(q, "end"),
        lambda: engine.inverse_dynamics(q, v, x),
        lambda: engine.mass_matrix(q),
        lambda: engine.forward_dynamics(q, v, x),
        lambda: engine.engine_inverse_kinematics(np.eye(4), "end", q),
    )
    for call in calls:
        with pytest.raises(ClosedError, match="pair"):
            call()


def test_a_forgotten_backend_gives_its_client_back() -> None:
    engine = PyBulletBackend(chain(2))
    (client,) = clients(engine)
    del engine
    gc.collect()
    assert not bullet.isConnected(client)


def test_a_backend_that_fails_to_open_holds_no_client(monkeypatch: pytest.MonkeyPatch) -> None:
    opened: list[int] = []
    connect = bullet.connect

    def noted(mode: int) -> int:
        opened.append(connect(mode))
        return opened[-1]

    monkeypatch.setattr(bullet, "connect", noted)
    monkeypatch.setattr(bullet, "changeDynamics", _failing)
    with pytest.raises(EngineError, match="changeDynamics"):
        PyBulletBackend(chain(2))
    assert opened
    assert not bullet.isConnected(opened[0])


def _failing(*args: Any, **options: Any) -> None:
    raise bullet.error("no")


_failing.__name__ = "changeDynamics"


def test_no_client_left_is_an_engine_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bullet, "connect", lambda mode: -1)
    with pytest.raises(EngineError, match="close backends"):
        PyBulletBackend(chain(2))


@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="reads the memory in use from /proc")
def test_opening_and_closing_leaks_no_client() -> None:
    model = chain(3)
    sample = motion(model)

    def cycles(n: int) -> int:
        for _ in range(n):
            with PyBulletBackend(model) as engine:
                engine.inverse_dynamics(*sample)
        return int(Path("/proc/self/statm").read_text().split()[1]) * 4096

    before = cycles(20)
    # An open client holds some 30 MB, so that one in a hundred would be noticed.
    assert cycles(100) - before < 30e6
