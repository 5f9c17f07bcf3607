"""Training runs: what a folder holds, resuming, and what a sudden end leaves."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dynx.errors import ArgumentError, UnknownNameError
from dynx.training import Schedule, TaskSpec, TrainingSpec, load_policy, train
from dynx.training.policy import DOCUMENT, read_policy_document
from dynx.training.records import read_lines
from tests.training.runs import SMALL, members, small_run, written

OFTEN = Schedule(checkpoint_every=64, evaluate_every=128, episodes=2)


def weights(path: Path) -> dict[str, Any]:
    found: dict[str, Any] = load_policy(path).algorithm.policy.state_dict()
    return found


def test_a_run_leaves_policies_checkpoints_and_curves(tmp_path: Path) -> None:
    done = train(small_run(), tmp_path / "run", schedule=OFTEN, final_episodes=3)
    assert done.policy.steps_done == 256
    assert done.resumed_at == 0
    assert len(done.evaluation.returns) == 3
    assert np.all(done.evaluation.returns == done.evaluation.lengths)  # one point for each step
    names = {each.name for each in (tmp_path / "run").iterdir()}
    assert names == {"run.json", "checkpoints", "evaluations.jsonl", "curve.jsonl", "best.zip", "final.zip"}
    assert [each["steps"] for each in read_lines(tmp_path / "run" / "evaluations.jsonl")] == [128]
    kept = sorted(each.name for each in (tmp_path / "run" / "checkpoints").iterdir())
    assert kept == ["000000000192.zip", "000000000256.zip"]


@pytest.mark.parametrize("wrong", [None, 0, -3, 2.5, "a", True, float("nan"), 10**12, np.zeros(2)])
def test_wrong_numbers_are_refused_before_the_training(wrong: Any, tmp_path: Path) -> None:
    with pytest.raises(ArgumentError, match=r"^final_episodes is .*; wanted a whole number"):
        train(small_run(), tmp_path, final_episodes=wrong)
    for name in ("checkpoint_every", "evaluate_every", "episodes", "threads"):
        if wrong is not None or not name.endswith("_every"):
            with pytest.raises(ArgumentError, match=f"^{name} is .*; wanted a whole number"):
                Schedule(**{name: wrong})
    assert not list(tmp_path.iterdir())


def test_the_same_seed_gives_the_same_weights_and_another_seed_others(tmp_path: Path) -> None:
    for name, seed in (("a", 0), ("b", 0), ("c", 1)):
        train(small_run(64, seed=seed), tmp_path / name, schedule=OFTEN, final_episodes=1)
    a, b, c = (weights(tmp_path / name / "final.zip") for name in "abc")
    assert all(bool((a[key] == b[key]).all()) for key in a)
    assert not all(bool((a[key] == c[key]).all()) for key in a)


def test_a_finished_run_is_only_judged_when_it_is_resumed(tmp_path: Path) -> None:
    train(small_run(), tmp_path, schedule=OFTEN, final_episodes=2)
    before = weights(tmp_path / "final.zip")
    again = train(small_run(), tmp_path, resume=True, schedule=OFTEN, final_episodes=2)
    assert again.resumed_at == again.policy.steps_done == 256
    after = weights(tmp_path / "final.zip")
    assert all(bool((before[key] == after[key]).all()) for key in before)


@pytest.mark.parametrize("algorithm", ["ppo", "dqn"])
def test_a_run_ends_at_the_first_evaluation_with_the_target_return(algorithm: str, tmp_path: Path) -> None:
    given = SMALL if algorithm == "ppo" else {"learning_starts": 16, "buffer_size": 500}
    spec = small_run(algorithm=algorithm, hyperparameters=given)
    often: dict[str, Any] = {"checkpoint_every": 1000, "evaluate_every": 64, "episodes": 2}
    # Each step of the task has a reward of 1.
    done = train(spec, tmp_path / "run", schedule=Schedule(**often, target_return=2.0), final_episodes=1)
    judged = read_lines(tmp_path / "run" / "evaluations.jsonl")
    assert len(judged) == 1
    assert 64 <= judged[0]["steps"] <= done.policy.steps_done < 128
    final, best = (weights(tmp_path / "run" / name) for name in ("final.zip", "best.zip"))
    assert all(bool((final[key] == best[key]).all()) for key in final)
    again = train(spec, tmp_path / "run", resume=True, schedule=Schedule(**often), final_episodes=1)
    assert again.resumed_at == done.policy.steps_done
    assert 256 <= again.policy.steps_done < 256 + 32  # whole rollouts from there


@pytest.mark.parametrize("wrong", ["a", True, float("nan"), float("inf"), [1.0]])
def test_a_wrong_target_return_is_refused(wrong: Any) -> None:
    with pytest.raises(ArgumentError, match="target_return"):
        Schedule(target_return=wrong)


def test_a_finished_run_goes_on_with_more_steps(tmp_path: Path) -> None:
    linear = {**SMALL, "learning_rate": "lin_0.001"}
    train(small_run(128, hyperparameters=linear), tmp_path, schedule=OFTEN, final_episodes=1)
    before = weights(tmp_path / "final.zip")
    done = train(
        small_run(256, hyperparameters=linear), tmp_path, resume=True, schedule=OFTEN, final_episodes=1
    )
    assert (done.resumed_at, done.policy.steps_done) == (128, 256)
    after = weights(tmp_path / "final.zip")
    assert not all(bool((before[key] == after[key]).all()) for key in before)
    assert json.loads((tmp_path / "run.json").read_text())["spec"]["steps"] == 256
    # The rate falls to zero at the new end: after 192 of 256 steps a quarter of it is left.
    between = load_policy(tmp_path / "checkpoints" / "000000000192.zip").algorithm
    assert [group["lr"] for group in between.policy.optimizer.param_groups] == pytest.approx([0.00025])
    with pytest.raises(ArgumentError, match="steps is 128, there 256; a run goes on"):
        train(small_run(128, hyperparameters=linear), tmp_path, resume=True)


def test_a_resumed_run_starts_from_the_weights_and_schedules_of_its_checkpoint(tmp_path: Path) -> None:
    spec = small_run(hyperparameters={**SMALL, "learning_rate": "lin_0.001"}, normalize=True)

    class Stopped(Exception):
        pass

    def stop(progress: Any) -> None:
        if progress.steps >= 128:
            raise Stopped

    with pytest.raises(Stopped):
        train(spec, tmp_path, schedule=OFTEN, progress=stop)
    saved = read_policy_document(tmp_path / "checkpoints" / "000000000128.zip")
    assert saved.steps_done == 128
    assert saved.samples == pytest.approx(128, abs=3.0)  # observations that the scaling has seen
    done = train(spec, tmp_path, resume=True, schedule=OFTEN, final_episodes=1)
    assert done.resumed_at == 128
    assert done.policy.scaling is not None
    assert done.policy.scaling.samples == pytest.approx(256, abs=6.0)
    # The rate falls linearly over all 256 steps, not over the 128 that remained.
    between = load_policy(tmp_path / "checkpoints" / "000000000192.zip").algorithm
    rates = [group["lr"] for group in between.policy.optimizer.param_groups]
    assert rates == pytest.approx([0.001 * 64 / 256])


def test_replay_buffers_survive(tmp_path: Path) -> None:
    spec = TrainingSpec(
        TaskSpec("CartPole-v1"),
        "dqn",
        200,
        1,
        0,
        hyperparameters={"learning_starts": 20, "buffer_size": 500, "train_freq": 4},
    )

    def stop(progress: Any) -> None:
        if progress.steps >= 100:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        train(spec, tmp_path, schedule=OFTEN, progress=stop)
    done = train(spec, tmp_path, resume=True, schedule=OFTEN, final_episodes=1)
    assert 0 < done.resumed_at <= 100
    buffer = done.policy.algorithm.replay_buffer
    assert buffer.pos == done.policy.steps_done


@pytest.mark.parametrize(
    "change",
    [
        {"steps": 31},
        {"envs": 3},
        {"seed": 1},
        {"normalize": True},
        {"processes": True},
        {"algorithm": "a2c"},
        {"hyperparameters": {**SMALL, "gamma": 0.9}},
        {"task": TaskSpec("CartPole-v1", None, {"sutton_barto_reward": True})},
    ],
    ids=lambda change: next(iter(change)),
)
def test_resuming_refuses_each_changed_field(change: dict[str, Any], tmp_path: Path) -> None:
    train(small_run(32), tmp_path, schedule=OFTEN, final_episodes=1)
    with pytest.raises(ArgumentError, match=f"has another run: {next(iter(change))}"):
        train(replace(small_run(32), **change), tmp_path, resume=True)


def test_folders_with_another_or_no_run_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ArgumentError, match="no training run that could be resumed"):
        train(small_run(), tmp_path / "none", resume=True)
    train(small_run(32), tmp_path / "run", schedule=OFTEN, final_episodes=1)
    with pytest.raises(ArgumentError, match="has a training run already"):
        train(small_run(32), tmp_path / "run")
    (tmp_path / "run" / "run.json").write_text("{}")
    with pytest.raises(ArgumentError, match=r"run.json' cannot be read"):
        train(small_run(32), tmp_path / "run", resume=True)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"algorithm": "pqo"}, "no algorithm 'pqo'; did you mean 'ppo'"),
        ({"hyperparameters": {"gama": 0.9}}, "ppo has no hyperparameter 'gama'; did you mean 'gamma'"),
        ({"hyperparameters": {"learning_rate": "fast"}}, "learning_rate is a number, or lin_NUMBER"),
        ({"hyperparameters": {"policy_kwargs": {"activation_fn": "rleu"}}}, "did you mean 'relu'"),
        (
            {"algorithm": "sac", "hyperparameters": {}},
            "sac learns .* are numbers.* wanted ppo, a2c, dqn",
        ),
        ({"hyperparameters": {"batch_size": "abc"}}, "batch_size is 'abc'; wanted a whole number"),
        ({"hyperparameters": {"n_epochs": 2.5}}, "n_epochs is 2.5; wanted a whole number"),
        ({"hyperparameters": {"ent_coef": "auto"}}, "ent_coef is 'auto'; wanted a number"),
        ({"hyperparameters": {"normalize_advantage": 1}}, "normalize_advantage is 1; wanted true or false"),
        ({"hyperparameters": {"gamma": 1.9}}, "gamma is 1.9; wanted a number between 0 and 1"),
        ({"hyperparameters": {"gae_lambda": "all"}}, "gae_lambda is 'all'; wanted a number"),
        ({"task": TaskSpec("CartPole-v1", None, {"no_such": 1})}, "cannot be made"),
    ],
)
def test_wrong_specifications_are_refused(changes: dict[str, Any], message: str, tmp_path: Path) -> None:
    with pytest.raises((ArgumentError, UnknownNameError), match=message):
        train(small_run(**changes), tmp_path)


@pytest.mark.skipif(sys.platform == "win32", reason="no SIGKILL")
def test_a_killed_run_loses_at_most_one_distance_between_checkpoints(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    command = [sys.executable, "-m", "dynx", "train", "CartPole-v1", "--steps", "1000000", "--envs", "2"]
    command += ["--out", str(folder), "--checkpoint-every", "64", "--evaluate-every", "900000"]
    for name, value in SMALL.items():
        command += ["--set", f"{name}={value}"]
    process = subprocess.Popen(command, stderr=subprocess.DEVNULL, stdout=subprocess.DEVNULL)
    try:
        checkpoints = folder / "checkpoints"
        for _ in range(1200):
            if checkpoints.is_dir() and len(list(checkpoints.glob("0*.zip"))) > 1:
                break
            assert process.poll() is None
            time.sleep(0.1)
        os.kill(process.pid, signal.SIGKILL)
    finally:
        process.kill()
        process.wait()
    newest = max(int(each.stem) for each in checkpoints.glob("0*.zip"))
    assert newest % 64 == 0
    document = json.loads((folder / "run.json").read_text())
    assert document["spec"]["steps"] == 1_000_000

    class Resumed(Exception):
        pass

    def first(progress: Any) -> None:
        # The first report after resuming comes one distance of reports behind the checkpoint.
        assert progress.steps >= newest
        raise Resumed

    spec = small_run(
        1_000_000, hyperparameters={**document["spec"]["hyperparameters"]}, normalize=False, envs=2
    )
    with warnings.catch_warnings(), pytest.raises(Resumed):
        train(spec, folder, resume=True, progress=first)


def test_a_checkpoint_that_was_cut_off_is_passed_over(tmp_path: Path) -> None:
    train(small_run(), tmp_path, schedule=OFTEN, final_episodes=1)
    newest = tmp_path / "checkpoints" / "000000000256.zip"
    newest.write_bytes(newest.read_bytes()[:1000])
    assert train(small_run(), tmp_path, resume=True, schedule=OFTEN, final_episodes=1).resumed_at == 192
    for each in (tmp_path / "checkpoints").glob("*.zip"):
        each.write_bytes(b"PK")
    with pytest.raises(ArgumentError, match="no checkpoint can be used"):
        train(small_run(), tmp_path, resume=True)


@pytest.mark.parametrize("version", [1, 2])
def test_a_run_of_an_earlier_version_goes_on_with_its_robots(tmp_path: Path, version: int) -> None:
    """Twice: the folder keeps its version, and the caller names the task as before."""
    task = TaskSpec("dynx/Pendulum-v0", "compiled")
    spec = small_run(128, task=task)
    train(spec, tmp_path, schedule=OFTEN, final_episodes=1)
    document = json.loads((tmp_path / "run.json").read_text())
    assert document["schema"] == "dynx.training/3"
    (tmp_path / "run.json").write_text(json.dumps({**document, "schema": f"dynx.training/{version}"}))
    for path in (tmp_path / "checkpoints").glob("*.zip"):
        parts = members(path)
        told = {**json.loads(parts[DOCUMENT]), "schema": f"dynx.policy/{version}"}
        written(path, {**parts, DOCUMENT: json.dumps(told).encode()})
    for steps in (192, 256):
        found = train(replace(spec, steps=steps), tmp_path, resume=True, schedule=OFTEN, final_episodes=1)
        assert found.resumed_at > 0
        options = found.policy.spec.task.options
        assert options["joint_limits"] is False
        assert options.get("joint_friction", True) is (version > 1)
        document = json.loads((tmp_path / "run.json").read_text())
        kept = document["schema"], document["spec"]["task"]["options"]
        assert kept == (f"dynx.training/{version}", {})
