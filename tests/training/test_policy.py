"""Files of policies: what they hold, that stable-baselines3 reads them, and that they run no code."""

from __future__ import annotations

import base64
import io
import json
import zipfile
from pathlib import Path

import cloudpickle
import numpy as np
import pytest
from stable_baselines3 import PPO

from dynx.errors import ArgumentError
from dynx.training import Schedule, TaskSpec, load_policy, make, train
from dynx.training.policy import read_policy_document
from tests.training.runs import small_run

ONCE = Schedule(checkpoint_every=1000, evaluate_every=1000)


@pytest.fixture(scope="module")
def trained(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the file of a policy with scaled observations."""
    folder = tmp_path_factory.mktemp("run")
    train(small_run(64, normalize=True), folder, schedule=ONCE, final_episodes=1)
    return folder / "final.zip"


def members(path: Path) -> dict[str, bytes]:
    with zipfile.ZipFile(path) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def written(path: Path, parts: dict[str, bytes]) -> Path:
    with zipfile.ZipFile(path, "w") as archive:
        for name, content in parts.items():
            archive.writestr(name, content)
    return path


def test_a_loaded_policy_acts_as_stable_baselines_does(trained: Path) -> None:
    policy = load_policy(trained)
    assert policy.scaling is not None
    algorithm = PPO.load(trained, device="cpu")
    seen = np.random.default_rng(0).normal(size=(50, 4)).astype(np.float32)
    expected, _ = algorithm.predict(policy.scaling(seen), deterministic=True)
    np.testing.assert_array_equal(policy(seen), expected)
    assert repr(policy) == "<Policy by ppo of CartPole-v1, 64 steps, seed 0>"


def test_scaling_is_that_of_the_observations_seen(trained: Path) -> None:
    policy = load_policy(trained)
    assert policy.scaling is not None
    scaled = policy.scaling(policy.scaling.mean + 2.0 * np.sqrt(policy.scaling.variance))
    np.testing.assert_allclose(scaled, 2.0, rtol=1e-4)
    assert np.all(policy.scaling(np.full(4, 1e9)) == 10.0)


def test_loading_runs_no_code_of_the_file(trained: Path, tmp_path: Path) -> None:
    class Harmful:
        def __reduce__(self) -> tuple[object, ...]:
            return Path.touch, (tmp_path / "executed",)

    parts = members(trained)
    data = json.loads(parts["data"])
    data["policy_class"] = {
        ":type:": "x",
        ":serialized:": base64.b64encode(cloudpickle.dumps(Harmful())).decode(),
    }
    load_policy(written(tmp_path / "harmful.zip", {**parts, "data": json.dumps(data).encode()}))
    assert not (tmp_path / "executed").exists()
    buffer = io.BytesIO()
    buffer.write(cloudpickle.dumps(Harmful()))
    with pytest.raises(ArgumentError, match="no weights that fit"):
        load_policy(written(tmp_path / "worse.zip", {**parts, "policy.pth": buffer.getvalue()}))
    assert not (tmp_path / "executed").exists()


def test_files_that_are_no_policy_are_refused(trained: Path, tmp_path: Path) -> None:
    parts = members(trained)
    document = json.loads(parts["dynx.json"])
    for name, content, message in (
        ("empty", b"", "damaged, or no policy"),
        ("cut", trained.read_bytes()[:3000], "damaged, or no policy"),
        ("text", b"hello", "damaged, or no policy"),
    ):
        path = tmp_path / f"{name}.zip"
        path.write_bytes(content)
        with pytest.raises(ArgumentError, match=message):
            load_policy(path)
    with pytest.raises(ArgumentError, match="there is no such file"):
        load_policy(tmp_path / "none.zip")
    with pytest.raises(ArgumentError, match="is a directory; wanted a file"):
        load_policy(tmp_path)
    without = {name: each for name, each in parts.items() if name != "dynx.json"}
    with pytest.raises(ArgumentError, match="was not written by dynx train"):
        load_policy(written(tmp_path / "plain.zip", without))
    for key, value, message in (
        ("schema", "dynx.policy/9", "schema is 'dynx.policy/9'"),
        ("steps_done", "many", "steps_done is 'many'; wanted a whole number"),
        ("colour", 1, "no key 'colour'"),
    ):
        changed = {**parts, "dynx.json": json.dumps({**document, key: value}).encode()}
        with pytest.raises(ArgumentError, match=message):
            read_policy_document(written(tmp_path / "changed.zip", changed))


def test_the_folder_of_a_run_names_its_policy(trained: Path) -> None:
    with pytest.raises(ArgumentError, match=r"the folder of a run; its policy is .*final\.zip"):
        load_policy(trained.parent)


def test_a_policy_for_other_observations_is_refused(trained: Path) -> None:
    with pytest.raises(
        ArgumentError, match=r"no weights that fit.*a policy for .*not be those of Acrobot-v1"
    ):
        load_policy(trained, TaskSpec("Acrobot-v1"))
    make(TaskSpec("Acrobot-v1")).close()
