"""Files of stable-baselines3: they act as there, run code only where the caller asks for it, and are then
policies as any other."""

from __future__ import annotations

import json
import pickle
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from click.testing import CliRunner
from stable_baselines3.common.env_util import make_vec_env
from stable_baselines3.common.vec_env import VecNormalize

import dynx.envs  # noqa: F401  (registers the tasks)
from dynx.cli.shell.main import cli
from dynx.errors import ArgumentError
from dynx.training import TaskSpec, judge, load_policy, load_stable_baselines
from dynx.training.algorithms import ALGORITHMS

OFF: dict[str, Any] = {"learning_starts": 8, "buffer_size": 100, "batch_size": 4}
CASES: dict[str, tuple[str, str, dict[str, Any]]] = {
    "ppo": ("ppo", "CartPole-v1", {"n_steps": 16, "batch_size": 16}),
    "ppo of numbers": (
        "ppo",
        "Pendulum-v1",
        {
            "n_steps": 16,
            "batch_size": 16,
            "use_sde": True,
            "policy_kwargs": {"net_arch": {"pi": [8], "vf": [16, 4]}, "activation_fn": torch.nn.ReLU},
        },
    ),
    "a2c": ("a2c", "CartPole-v1", {"n_steps": 8, "use_rms_prop": False}),
    "dqn": ("dqn", "CartPole-v1", OFF | {"policy_kwargs": {"net_arch": [12, 7]}}),
    "sac": ("sac", "Pendulum-v1", OFF | {"ent_coef": 0.1}),
    "td3": ("td3", "Pendulum-v1", OFF),
}


def saved(folder: Path, case: str, **changes: Any) -> tuple[str, Any, VecNormalize]:
    """Write files of stable-baselines3; return its algorithm with them."""
    name, task, options = CASES[case]
    vector = VecNormalize(make_vec_env(task, n_envs=1, seed=3), **changes)
    algorithm = ALGORITHMS[name]("MlpPolicy", vector, seed=3, device="cpu", **options).learn(32)
    algorithm.save(folder / "a.zip")
    vector.save(str(folder / "vec_normalize.pkl"))
    vector.training = False
    return task, algorithm, vector


@pytest.mark.parametrize("case", CASES)
def test_a_policy_acts_as_in_stable_baselines_and_is_saved_as_one_of_dynx(case: str, tmp_path: Path) -> None:
    task, algorithm, vector = saved(tmp_path, case)
    policy = load_stable_baselines(
        tmp_path / "a.zip", TaskSpec(task), statistics=tmp_path / "vec_normalize.pkl"
    )
    assert policy.spec.algorithm == CASES[case][0]
    assert policy.steps_done == 32
    shape = vector.observation_space.shape
    seen = 3.0 * np.random.default_rng(0).normal(size=(50, *shape)).astype(np.float32)
    expected, _ = algorithm.predict(vector.normalize_obs(seen), deterministic=True)
    np.testing.assert_array_equal(policy(seen), expected)
    plain = load_stable_baselines(tmp_path / "a.zip", TaskSpec(task))
    np.testing.assert_array_equal(plain(seen), algorithm.predict(seen, deterministic=True)[0])
    policy.save(tmp_path / "own.zip")
    np.testing.assert_array_equal(load_policy(tmp_path / "own.zip")(seen), expected)


def test_a_policy_of_gymnasiums_task_is_judged_on_engines_of_dynx(tmp_path: Path) -> None:
    saved(tmp_path, "ppo")
    files = [str(tmp_path / "a.zip"), "--unpickle", "--statistics", str(tmp_path / "vec_normalize.pkl")]
    options = ["--task", "CartPole", "--engine", "reference,compiled", "--episodes", "2", "--json"]
    result = CliRunner().invoke(cli, ["play", *files, *options])
    assert result.exit_code == 0, result.output
    found = json.loads(result.stdout)
    task = TaskSpec("dynx/CartPole-v0", "reference")
    policy = load_stable_baselines(files[0], task, statistics=files[3])
    assert [each["mean"] for each in found["engines"]] == [judge(policy, task, 2).mean] * 2
    assert found["trained_on"] is None


class Evil:
    """What runs code when it is unpickled."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self) -> Any:
        return Path.write_text, (self.path, "code ran")


def test_no_code_runs_unless_it_is_asked_for(tmp_path: Path) -> None:
    saved(tmp_path, "ppo")
    trace, statistics = tmp_path / "trace", tmp_path / "evil.pkl"
    statistics.write_bytes(pickle.dumps(Evil(trace)))
    result = CliRunner().invoke(cli, ["play", str(tmp_path / "a.zip"), "--task", "CartPole"])
    assert result.exit_code == 2
    assert "--unpickle" in result.output
    given = ["play", str(tmp_path / "a.zip"), "--task", "CartPole", "--statistics", str(statistics)]
    result = CliRunner().invoke(cli, given)
    assert "wanted --unpickle" in result.output
    assert not trace.exists()
    result = CliRunner().invoke(cli, [*given, "--unpickle"])
    assert (result.exit_code, trace.exists()) == (2, True), "it runs the code, as its help says"
    assert "cannot be loaded as statistics of VecNormalize" in result.output
    assert len(result.output.strip().splitlines()) == 1


def test_files_that_do_not_fit_are_refused(tmp_path: Path) -> None:
    task, _, _ = saved(tmp_path, "ppo", clip_obs=5.0)
    spec, path, statistics = TaskSpec(task), tmp_path / "a.zip", tmp_path / "vec_normalize.pkl"
    with pytest.raises(ArgumentError, match="clips scaled observations at 5"):
        load_stable_baselines(path, spec, statistics=statistics)
    with pytest.raises(ArgumentError, match="observation space"):
        load_stable_baselines(path, TaskSpec("Pendulum-v1"))
    with pytest.raises(ArgumentError, match="did you mean 'ppo'"):
        load_stable_baselines(path, spec, "pqo")
    with pytest.raises(ArgumentError, match=r"cannot be loaded as sac|learns actions"):
        load_stable_baselines(path, spec, "sac")
    with pytest.raises(ArgumentError, match="is no file of stable-baselines3"):
        load_stable_baselines(statistics, spec)
    with pytest.raises(ArgumentError, match="cannot be read"):
        load_stable_baselines(tmp_path / "none.zip", spec)
    load_stable_baselines(path, spec).save(tmp_path / "own.zip")
    with pytest.raises(ArgumentError, match="written by dynx, which reads it without unpickling"):
        load_stable_baselines(tmp_path / "own.zip", spec)
    with zipfile.ZipFile(tmp_path / "empty.zip", "w") as archive:
        archive.writestr("data", "{}")
    with pytest.raises(ArgumentError, match="is of none of ppo"):
        load_stable_baselines(tmp_path / "empty.zip", spec)


def test_command_names_what_is_missing(tmp_path: Path) -> None:
    result = CliRunner().invoke(cli, ["play", str(tmp_path / "a.zip"), "--unpickle"])
    assert result.exit_code == 2
    assert "names no task; wanted --task" in result.output
    result = CliRunner().invoke(cli, ["play", str(tmp_path / "a.zip"), "--algo", "ppo"])
    assert "--algo has an effect on a file of stable-baselines3 alone" in result.output
