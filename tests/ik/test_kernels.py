"""Inverse kinematics in kernels: the same results alone, in batches, on threads and for repeated calls."""

from __future__ import annotations

import copy
import pickle
from dataclasses import replace
from itertools import permutations
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from dynx.backends import Backend, backend
from dynx.errors import ArgumentError, ClosedError
from dynx.files.cache import keep
from dynx.ik import IKResult
from dynx.ik.coordinates import FrameCoordinates
from dynx.ik.starts import BOXES, ROTATIONS, STARTS_OF_CELL, Cells, StartTable
from dynx.model import Model
from dynx.model.loading import load
from dynx.spatial.scalar import Floats
from dynx.spatial.se3 import pose_error
from dynx.spatial.so3 import rotation_from_rpy
from dynx.testing.strategies import configurations, models
from tests.oracles.closed_form import MODELS

ARM = load(MODELS / "seven_axis_arm.urdf")
FRAME = ARM.frame_names[-1]
TOLERANCE = 1e-6
FIELDS = ("q", "success", "position_error", "rotation_error", "iterations", "restarts")


def reachable(engine: Backend, count: int, seed: int = 5) -> Floats:
    return engine.forward_kinematics(engine.model.random(seed, count), FRAME)


def assert_equal(found: IKResult, expected: IKResult, index: int | slice | tuple[()] = ()) -> None:
    for field in FIELDS:
        np.testing.assert_array_equal(getattr(found, field), getattr(expected, field)[index], field)


def test_a_pose_of_a_batch_has_the_result_that_it_has_alone() -> None:
    with backend("compiled", ARM, threads=1) as engine:
        targets = reachable(engine, 40)
        # Some targets out of reach.
        targets[::7, :3, 3] += 10.0
        together = engine.inverse_kinematics(targets, FRAME, max_restarts=20)
        assert together.success.any()
        assert not together.success[::7].any()
        for _ in range(2):
            for k in range(len(targets)):
                alone = engine.inverse_kinematics(targets[k], FRAME, max_restarts=20)
                assert_equal(alone, together, k)
        part = engine.inverse_kinematics(targets[5:9], FRAME, max_restarts=20)
        assert_equal(part, together, slice(5, 9))


def test_the_table_of_starts_is_kept_in_the_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It is made once for all processes, and again where its file is damaged; results are the same bits."""
    monkeypatch.delenv("DYNX_CACHE", raising=False)
    monkeypatch.setenv("DYNX_CACHE_DIR", str(tmp_path))
    made, make = [], StartTable.of

    def counted(coordinates: FrameCoordinates, engine: Backend, frame: str) -> StartTable:
        made.append(frame)
        return make(coordinates, engine, frame)

    monkeypatch.setattr(StartTable, "of", counted)
    results = []
    for turn in range(4):
        with backend("compiled", ARM, threads=1) as engine:
            targets = reachable(engine, 50)
            results.append(engine.inverse_kinematics(targets, FRAME))
            assert_equal(engine.inverse_kinematics(targets[7], FRAME), results[0], 7)
        assert made == [FRAME] * (1 if turn < 2 else turn)
        (file,) = tmp_path.rglob("*.starts")
        content = file.read_bytes()
        if turn == 1:
            file.write_bytes(content[:-9])
        elif turn == 2:
            # A whole file, but of an arm with fewer joints.
            keep(file.name, bytes(8 * (6 + BOXES**3 * ROTATIONS * STARTS_OF_CELL)))
    for found in results[1:]:
        assert_equal(found, results[0])


def test_the_result_of_one_target_is_copied_pickled_and_changed_like_others() -> None:
    with backend("compiled", ARM, threads=1) as engine:
        target = reachable(engine, 1)[0]
        first, again = (engine.inverse_kinematics(target, FRAME) for _ in range(2))
    for same in (again, pickle.loads(pickle.dumps(again)), copy.deepcopy(again), replace(again, proof=None)):
        assert_equal(same, first)
        assert (same.status, same.message, repr(same)) == (first.status, first.message, repr(first))
        assert (same.proof, dict(same.by_frame)) == (None, {})
    assert not replace(again, success=np.array(False))


def test_results_do_not_depend_on_threads() -> None:
    with backend("compiled", ARM, threads=1) as one, backend("compiled", ARM, threads=3) as three:
        targets = reachable(one, 700)
        assert_equal(three.inverse_kinematics(targets, FRAME), one.inverse_kinematics(targets, FRAME))


def test_seeds_and_generators() -> None:
    with backend("compiled", ARM) as engine:
        target = reachable(engine, 1)[0]
        by_seed = [engine.inverse_kinematics(target, FRAME, rng=3) for _ in range(3)]
        for found in by_seed[1:]:
            assert_equal(found, by_seed[0])
        generator = np.random.default_rng(3)
        assert_equal(engine.inverse_kinematics(target, FRAME, rng=generator), by_seed[0])
        assert engine.inverse_kinematics(target, FRAME, rng=None).success
        seeds = {engine.inverse_kinematics(target, FRAME, rng=seed).q.tobytes() for seed in range(30)}
    assert len(seeds) > 1


def test_options_of_an_earlier_call_do_not_count() -> None:
    with backend("compiled", ARM) as engine:
        target = reachable(engine, 1)[0]
        for _ in range(2):
            assert engine.inverse_kinematics(target, FRAME).success
            assert engine.inverse_kinematics(target[:3, 3], FRAME).rotation_error == 0.0
            coarse = engine.inverse_kinematics(target, FRAME, position_tolerance=0.1, rotation_tolerance=0.1)
            assert coarse.position_error > TOLERANCE
            for option in ({"rng": True}, {"max_restarts": True}, {"position_tolerance": [1.0]}):
                with pytest.raises(ArgumentError):
                    engine.inverse_kinematics(target, FRAME, **option)
            with pytest.raises(ArgumentError):
                engine.inverse_kinematics(np.diag([1.0, 1.0, -1.0, 1.0]), FRAME)
    with pytest.raises(ClosedError):
        engine.inverse_kinematics(target, FRAME)


@settings(max_examples=15)
@given(st.data())
def test_random_robots_are_solved_within_limits(data: st.DataObject) -> None:
    """A pose that a random configuration takes is reached, unless the generic solver fails as well."""
    model = data.draw(models(max_links=7, base="fixed"))
    frame = data.draw(st.sampled_from(model.frame_names))
    q = np.stack([data.draw(configurations(model, within_limits=True)) for _ in range(3)])
    with backend("compiled", model) as engine, backend("pinocchio", model) as other:
        targets = other.forward_kinematics(q, frame)
        found = engine.inverse_kinematics(targets, frame)
        expected = other.inverse_kinematics(targets, frame)
        assert (found.success | ~expected.success).all()
        check(model, other.forward_kinematics(found.q, frame), targets, found)


def check(model: Model, reached: Floats, targets: Floats, found: IKResult) -> None:
    """Check errors and limits by the poses of another engine."""
    rounding = 1e-9 * (1.0 + np.abs(targets[:, :3, 3]).max())
    position, rotation = (np.linalg.norm(error, axis=-1) for error in pose_error(targets, reached))
    assert (position[found.success] <= TOLERANCE + rounding).all()
    # The cosine of a small angle is insensitive to it.
    assert (rotation[found.success] <= TOLERANCE + np.sqrt(np.finfo(float).eps)).all()
    assert (found.q >= model.lower).all()
    assert (found.q <= model.upper).all()


@given(st.integers(0, 2**32 - 1))
def test_the_cell_of_one_pose_is_that_of_a_batch(seed: int) -> None:
    rng = np.random.default_rng(seed)
    positions = rng.uniform(-1.5, 1.5, (30, 3))
    cells = Cells.around(positions[:20])
    quarter_turns = np.array([np.eye(3)[list(p)] * s for p in permutations(range(3)) for s in (1, -1)])
    random = rotation_from_rpy(rng.uniform(-3.0, 3.0, (18, 3)))
    rotations = np.concatenate([random, quarter_turns])
    together = cells.number(positions, rotations)
    poses = np.concatenate([rotations, positions[:, :, None]], axis=2)
    np.testing.assert_array_equal(together, [cells.number_of_one(rows.tolist()) for rows in poses])
    assert (together >= 0).all()
    assert (together < BOXES**3 * ROTATIONS).all()
