"""`timeout` ends every search in time, with the best found so far. A clock counts operations: a pose, a
Jacobian and the distances of a configuration take a millisecond each, a step of a kernel a tenth of it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

import dynx
from dynx import time_limit
from dynx.distance import avoidance
from dynx.distance.avoidance import Avoidance
from dynx.errors import ArgumentError, TrajectoryError
from dynx.ik.tracking import TrackStatus
from dynx.ik.velocity import VelocityTask
from dynx.simd.iteration import IterationKernel
from dynx.spatial.scalar import Floats
from dynx.trajectory import line
from dynx.world import Scene, SceneRobot, box
from tests.test_time_limit import Clock, own_clock

OPERATION = 1e-3
"""Time that an operation takes [s]."""

KERNEL_STEP = 1e-4
"""Time that a step of a kernel takes [s], which evaluates the pose as well."""


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Iterator[Clock]:
    """Return a clock that moves by `OPERATION` for each operation."""
    with own_clock() as clock:

        def slowed(owner: Any, name: str) -> None:
            original = getattr(owner, name)

            def call(*args: Any, **options: Any) -> Any:
                clock.now += OPERATION
                return original(*args, **options)

            monkeypatch.setattr(owner, name, call)

        for name in ("forward_kinematics", "jacobian"):
            slowed(dynx.Backend, name)
        slowed(Avoidance, "near")
        call, bind = IterationKernel.__call__, IterationKernel.bind_race

        # The number of steps stands after the coordinates, two errors and the success.
        def counted(kernel: IterationKernel, tasks: Any, result: Any, *args: Any, **options: Any) -> None:
            call(kernel, tasks, result, *args, **options)
            clock.now += KERNEL_STEP * float(result[:, tasks[0].shape[1] + 3].sum())

        def bound(kernel: IterationKernel, tasks: Any, result: Any, *args: Any) -> Any:
            race = bind(kernel, tasks, result, *args)

            def run() -> int:
                completed = race()
                clock.now += KERNEL_STEP * float(result[:completed, tasks[0].shape[1] + 3].sum())
                return completed

            return run

        monkeypatch.setattr(IterationKernel, "__call__", counted)
        monkeypatch.setattr(IterationKernel, "bind_race", bound)
        yield clock


def unreachable(engine: dynx.Backend, frame: str) -> Floats:
    """Return a pose that no configuration reaches, within the bounds that could prove it."""
    T: Floats = engine.forward_kinematics(np.full(engine.model.nq, 0.3), frame).copy()
    T[:3, 3] = [0.0, 0.0, 0.09]
    return T


@pytest.mark.parametrize(
    ("name", "robot", "frame"),
    [
        ("pinocchio", "ur5", "tool0"),
        ("compiled", "ur5", "tool0"),
        ("mujoco", "kinova", "j2s6s200_end_effector"),
    ],
)
@pytest.mark.parametrize("timeout", [0.5, 3.0])
def test_a_search_of_a_target_out_of_reach_ends_in_time(
    clock: Clock, name: str, robot: str, frame: str, timeout: float
) -> None:
    with dynx.backend(name, dynx.load(robot)) as engine:
        T = unreachable(engine, frame)
        start = clock.now
        found = engine.inverse_kinematics(T, frame, max_restarts=9000, timeout=timeout)
        assert 0.5 * timeout <= clock.now - start <= 1.1 * timeout
        assert not found
        assert found.status == "TIMED_OUT"
        assert found.timed_out
        assert "stopped by timeout" in found.message
        model = engine.model
        assert ((found.q >= model.lower) & (found.q <= model.upper)).all()
        reached = engine.forward_kinematics(found.q, frame)
        assert np.linalg.norm(reached[:3, 3] - T[:3, 3]) == pytest.approx(float(found.position_error))


@pytest.mark.parametrize("name", ["pinocchio", "compiled"])
def test_targets_of_a_batch_that_are_reached_in_time_have_the_result_that_they_have_without_it(
    clock: Clock, name: str
) -> None:
    model = dynx.load("ur5")
    rng = np.random.default_rng(1)
    with dynx.backend(name, model) as engine:
        T = engine.forward_kinematics(rng.uniform(-3.0, 3.0, (400, 6)), "tool0")
        start = clock.now
        whole = engine.inverse_kinematics(T, "tool0")
        took, start = clock.now - start, clock.now
        found = engine.inverse_kinematics(T, "tool0", timeout=0.5 * took)
        assert clock.now - start <= 1.1 * 0.5 * took
        done = found.success
        assert 0.2 < done.mean() < 0.8
        assert np.array_equal(found.q[done], whole.q[done])
        assert (found.status[~done] == "TIMED_OUT").all()
        assert found.timed_out is not None
        assert np.array_equal(found.timed_out, ~done)
        ample = engine.inverse_kinematics(T, "tool0", timeout=10.0 * took)
        assert np.array_equal(ample.q, whole.q)
        assert ample.timed_out is None


def blocked(frame: str, size: float = 0.3) -> tuple[Scene, dynx.Model]:
    """Return a scene in which a box of a size [m] stands where a frame is to go."""
    model = dynx.load("panda")
    T = dynx.backend("reference", model).forward_kinematics(model.clip(model.neutral()), frame)
    obstacle = box("obstacle", (size, size, size), pose=dynx.model.Pose(tuple(T[:3, 3])))
    return Scene("blocked", robots=[SceneRobot("arm", model)], bodies=[obstacle]), model


@pytest.mark.parametrize("name", ["pinocchio", "compiled"])
@pytest.mark.parametrize("several", [False, True])
def test_a_blocked_search_of_one_frame_or_several_ends_in_time(
    clock: Clock, name: str, several: bool
) -> None:
    scene, model = blocked("panda_hand")
    q = model.clip(model.neutral())
    with dynx.backend(name, model) as engine:
        T = {frame: engine.forward_kinematics(q, frame)[:3, 3] for frame in ("panda_hand", "panda_link5")}
        target: Any = T if several else T["panda_hand"]
        frame = None if several else "panda_hand"
        start = clock.now
        found = engine.inverse_kinematics(target, frame, q, avoid=scene, timeout=0.4)
        assert clock.now - start <= 1.1 * 0.4
        assert not found
        assert found.status == "TIMED_OUT"
        assert "stopped by timeout" in found.message
        assert "obstacle" in found.message
        if several:
            assert set(found.by_frame) == set(T)


@pytest.mark.long_cases
@pytest.mark.parametrize("name", ["pinocchio", "compiled"])
@pytest.mark.parametrize("pairs", [1, 4, 30, 200])
@pytest.mark.parametrize("call", ["inverse_kinematics", "track"])
def test_a_search_that_avoids_begins_no_pair_of_bodies_after_its_time(
    clock: Clock, monkeypatch: pytest.MonkeyPatch, name: str, pairs: int, call: str
) -> None:
    """A pair takes a second, all of one configuration 20 or more, and other operations a thousandth."""
    scene, model = blocked("panda_hand")
    q, timeout = model.clip(model.neutral()), pairs - 0.5
    begun: list[bool] = []
    distance = avoidance.separation_of

    def slow(*args: Any) -> Any:
        begun.append(clock.now < end)
        clock.now += 1.0
        return distance(*args)

    with dynx.backend(name, model) as engine:
        T = engine.forward_kinematics(q, "panda_hand")
        assert len(scene.avoidance_for(model).pairs) >= 20
        monkeypatch.setattr(avoidance, "separation_of", slow)
        end = clock.now + timeout
        if call == "track":
            path = engine.track(np.stack([T] * 3), "panda_hand", q, avoid=scene, timeout=timeout)
            assert (path.status != TrackStatus.OK).any()
        else:
            found = engine.inverse_kinematics(T[:3, 3], "panda_hand", q, avoid=scene, timeout=timeout)
            assert found.timed_out
            assert found.message.startswith("stopped by timeout")
    assert all(begun)
    assert 0 < len(begun) <= pairs


@pytest.mark.parametrize("name", ["pinocchio", "compiled"])
def test_preparing_a_scene_takes_no_time_from_a_search(
    clock: Clock, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    scene, model = blocked("panda_hand", 0.1)
    prepare = Scene.avoidance_for

    def slow(*args: Any, **options: Any) -> Any:
        clock.now += 100.0
        return prepare(*args, **options)

    monkeypatch.setattr(Scene, "avoidance_for", slow)
    q = model.clip(model.neutral())
    with dynx.backend(name, model) as engine:
        T = engine.forward_kinematics(q, "panda_hand")
        found = engine.inverse_kinematics(
            T[:3, 3], "panda_hand", q, avoid=scene, max_restarts=5, timeout=50.0
        )
        assert not found.timed_out
        path = engine.track(np.stack([T] * 3), "panda_hand", q, avoid=scene, timeout=50.0)
        assert (path.status != TrackStatus.TIMED_OUT).all()
        task = VelocityTask("panda_hand", target=T[:3, 3])
        assert not engine.velocity_ik(q, task, dt=0.1, avoid=scene, timeout=50.0).timed_out


@pytest.mark.parametrize("name", ["pinocchio", "compiled"])
@pytest.mark.parametrize("option", [{"maximize": "manipulability"}, {"nearest": np.full(8, 0.01)}])
def test_a_choice_among_solutions_that_is_cut_short_still_reaches_the_target(
    clock: Clock, name: str, option: dict[str, Any]
) -> None:
    model = dynx.load("panda")
    with dynx.backend(name, model) as engine:
        T = engine.forward_kinematics(model.random(3), "panda_hand")
        start = clock.now
        plain = engine.inverse_kinematics(T, "panda_hand")
        timeout = 1.01 * (clock.now - start)
        start = clock.now
        found = engine.inverse_kinematics(T, "panda_hand", timeout=timeout, **option)
        assert found
        assert plain
        assert found.timed_out is not None
        assert found.timed_out
        assert "choice among solutions stopped by timeout" in found.message


@pytest.mark.parametrize("name", ["pinocchio", "compiled"])
@pytest.mark.parametrize("start_given", [True, False])
def test_the_samples_of_a_path_that_are_tracked_in_time_are_kept(
    clock: Clock, name: str, start_given: bool
) -> None:
    model = dynx.load("ur5")
    q0 = np.array([0.0, -1.2, 1.5, 0.3, 0.6, 0.0])
    with dynx.backend(name, model) as engine:
        angles = np.linspace(0.0, 2.0 * np.pi, 300)
        path = np.tile(engine.forward_kinematics(q0, "tool0"), (300, 1, 1))
        path[:, 0, 3] += 0.1 * (np.cos(angles) - 1.0)
        path[:, 1, 3] += 0.1 * np.sin(angles)
        at = q0 if start_given else None
        start = clock.now
        whole = engine.track(path, "tool0", at)
        took, start = clock.now - start, clock.now
        found = engine.track(path, "tool0", at, timeout=0.6 * took)
        assert clock.now - start <= 1.1 * 0.6 * took
        done = found.status == TrackStatus.OK
        assert whole
        assert 0.0 < found.fraction < 1.0
        assert np.array_equal(found.q[done], whole.q[done])
        assert (found.status[~done] == TrackStatus.TIMED_OUT).all()
        assert found.reason == f"stopped by timeout after {0.6 * took:g} s"
        assert "TIMED_OUT" in found.message
        assert "nan" not in found.message
        ample = engine.track(path, "tool0", at, timeout=10.0 * took)
        assert np.array_equal(ample.q, whole.q)


def test_a_straight_line_that_is_not_found_in_time_is_an_error_that_says_so(clock: Clock) -> None:
    model = dynx.load("ur5")
    q0 = np.array([0.0, -1.2, 1.5, 0.3, 0.6, 0.0])
    with dynx.backend("pinocchio", model) as engine:
        T = engine.forward_kinematics(q0, "tool0").copy()
        T[:3, 3] += [0.05, 0.1, 0.05]
        start = clock.now
        with pytest.raises(TrajectoryError, match=r"stopped by timeout after 0\.05 s, at 0\.\d+ of the way"):
            line(model, "tool0", q0, T, 1.0, backend=engine, timeout=0.05)
        assert clock.now - start <= 0.055 + 3 * OPERATION
        assert line(model, "tool0", q0, T, 1.0, backend=engine, timeout=1e3).intervals > 0


def test_a_velocity_that_is_not_found_in_time_stands_still_and_says_so(clock: Clock) -> None:
    pytest.importorskip("daqp")
    scene, model = blocked("panda_hand")
    avoidance = scene.avoidance_for(model, margin=0.02)
    with dynx.backend("pinocchio", model) as engine:
        q = next(q for q in model.random(0, 200) if not avoidance.violated(engine, q))
        for _ in range(200):
            T = engine.forward_kinematics(model.clip(model.neutral()), "panda_hand")
            task = VelocityTask("panda_hand", target=T[:3, 3], gain=20.0)
            options: dict[str, Any] = {"dt": 0.1, "avoid": avoidance, "avoid_gain": 10.0}
            start = clock.now
            best = engine.velocity_ik(q, task, **options)
            took, start = clock.now - start, clock.now
            found = engine.velocity_ik(q, task, **options, timeout=2 * OPERATION)
            if found.timed_out:
                break
            q = model.integrate(q, 0.1 * best.v)
        assert clock.now - start < took
        assert found.timed_out
        assert found.note.startswith("stopped by timeout after 0.002 s")
        assert not avoidance.violated(engine, model.integrate(q, 0.1 * found.v))


@pytest.mark.parametrize("timeout", [0.0, -1.0, "1", True, np.ones(2)])
def test_each_search_refuses_a_timeout_that_is_no_time(timeout: Any) -> None:
    model = dynx.load("ur5")
    q = model.neutral()
    with dynx.backend("pinocchio", model) as engine:
        T = engine.forward_kinematics(q, "tool0")
        for search in (
            lambda: engine.inverse_kinematics(T, "tool0", timeout=timeout),
            lambda: engine.track(T[None], "tool0", q, timeout=timeout),
            lambda: engine.velocity_ik(q, VelocityTask("tool0"), dt=0.1, timeout=timeout),
            lambda: line(model, "tool0", q, T, 1.0, timeout=timeout),
        ):
            with pytest.raises(ArgumentError, match="timeout is"):
                search()


def test_the_clock_of_searches_is_the_monotonic_one() -> None:
    import time

    assert time_limit.clock is time.monotonic
