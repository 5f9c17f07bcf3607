"""Files of policies: what they hold, that stable-baselines3 reads them, and that they run no code."""

from __future__ import annotations

import base64
import io
import json
import zipfile
from pathlib import Path
from typing import Any

import cloudpickle
import numpy as np
import pytest
import torch
from stable_baselines3 import PPO

from dynx.errors import ArgumentError
from dynx.training import Schedule, TaskSpec, load_policy, make, train
from dynx.training.algorithms import ALGORITHMS
from dynx.training.policy import DOCUMENT, read_policy_document
from tests.training.runs import members, small_run, written

ONCE = Schedule(checkpoint_every=1000, evaluate_every=1000)


@pytest.fixture(scope="module")
def trained(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the file of a policy with scaled observations."""
    folder = tmp_path_factory.mktemp("run")
    train(small_run(64, normalize=True), folder, schedule=ONCE, final_episodes=1)
    return folder / "final.zip"


def test_a_loaded_policy_acts_as_stable_baselines_does(trained: Path) -> None:
    policy = load_policy(trained)
    assert policy.scaling is not None
    algorithm = PPO.load(trained, device="cpu")
    seen = 3.0 * np.random.default_rng(0).normal(size=(50, 4)).astype(np.float32)
    expected, _ = algorithm.predict(seen, deterministic=True)
    np.testing.assert_array_equal(policy(seen), expected)
    assert repr(policy) == "<Policy by ppo of CartPole-v1, 64 steps, seed 0>"


OFF_POLICY: dict[str, Any] = {"learning_starts": 8, "buffer_size": 100, "batch_size": 4}
ON_POLICY: dict[str, Any] = {"n_steps": 16}


@pytest.mark.parametrize(
    ("algorithm", "task", "options"),
    [
        ("ppo", "dynx/Pendulum-v0", {**ON_POLICY, "batch_size": 16, "use_sde": True}),
        ("a2c", "dynx/Acrobot-v0", {**ON_POLICY, "policy_kwargs": {"net_arch": [8, 8]}}),
        ("dqn", "CartPole-v1", OFF_POLICY),
        ("sac", "Pendulum-v1", OFF_POLICY),
        ("td3", "dynx/Pendulum-v0", OFF_POLICY),
        ("sac", "dynx/Reach-v0", OFF_POLICY),
    ],
    ids=lambda each: each if isinstance(each, str) else "",
)
def test_what_stable_baselines_loads_scales_as_in_training(
    algorithm: str, task: str, options: dict[str, Any], tmp_path: Path
) -> None:
    engine = "compiled" if task.startswith("dynx") else None
    spec = small_run(
        48,
        task=TaskSpec(task, engine),
        algorithm=algorithm,
        envs=1,
        hyperparameters=options,
        normalize=True,
    )
    final = train(spec, tmp_path / "run", schedule=ONCE, final_episodes=1).policy
    loaded = ALGORITHMS[algorithm].load(tmp_path / "run" / "final.zip", device="cpu")
    assert final.scaling is not None
    # Some beyond the bound of scaled observations.
    rows = np.random.default_rng(0).normal(size=(40, *final.scaling.mean.shape)).astype(np.float32)
    rows[20:] *= 1e3
    expected = final(rows)
    np.testing.assert_array_equal(loaded.predict(rows, deterministic=True)[0], expected)
    np.testing.assert_array_equal(load_policy(tmp_path / "run" / "final.zip")(rows), expected)
    scaled = final.scaling(rows)
    unscaled, _ = final.algorithm.predict(rows, deterministic=True)
    again, _ = final.algorithm.predict(scaled, deterministic=True)
    # Saving leaves the policy that goes on learning as it is.
    np.testing.assert_array_equal(again, expected)
    assert algorithm in ("a2c", "dqn") or not np.array_equal(unscaled, expected)


def test_files_of_earlier_versions_are_read(trained: Path, tmp_path: Path) -> None:
    """Files whose weights had no scaling beside it in the document."""
    policy = load_policy(trained)
    content = io.BytesIO()
    policy.algorithm.save(content)
    earlier = written(tmp_path / "earlier.zip", {**members(content), DOCUMENT: members(trained)[DOCUMENT]})
    seen = np.random.default_rng(1).normal(size=(20, 4)).astype(np.float32)
    np.testing.assert_array_equal(load_policy(earlier)(seen), policy(seen))


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
    inside = io.BytesIO()
    with zipfile.ZipFile(inside, "w") as archive:
        for name, data in (("data.pkl", cloudpickle.dumps(Harmful(), 2)), ("version", b"3\n")):
            archive.writestr(f"archive/{name}", data)
    with pytest.raises(ArgumentError, match="no weights that fit: it has other objects than tensors"):
        load_policy(written(tmp_path / "worst.zip", {**parts, "policy.pth": inside.getvalue()}))
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


@pytest.mark.filterwarnings("ignore:.*parse.* invariant")
@pytest.mark.parametrize("member", ["policy.pth", "pytorch_variables.pth"])
def test_tensors_and_lists_that_grow_in_memory_are_refused(
    member: str, trained: Path, tmp_path: Path
) -> None:
    """A tensor whose stride is 0, and lists that share their parts, take no space in a file."""
    nested: Any = torch.zeros(1)
    for _ in range(100):
        nested = [nested, nested]
    for number, (content, message) in enumerate(
        (
            ({"log_std": torch.zeros(1).expand(10**12)}, "larger than its numbers"),
            ({"log_std": torch.sparse_coo_tensor(size=(10**9, 10**9))}, "another layout"),
            ({"log_std": nested}, "no weights that fit"),
        )
    ):
        data = io.BytesIO()
        torch.save(content, data)
        path = written(tmp_path / f"{number}.zip", {**members(trained), member: data.getvalue()})
        with pytest.raises(ArgumentError, match=message):
            load_policy(path)


@pytest.mark.parametrize("method", [zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA])
def test_members_that_grow_without_bound_are_refused(method: int, trained: Path, tmp_path: Path) -> None:
    """`zipfile` expands them in one piece, whatever size they state."""
    for name in ("dynx.json", "policy.pth"):
        path = tmp_path / f"{name}.zip"
        with zipfile.ZipFile(path, "w") as archive:
            for each, data in members(trained).items():
                archive.writestr(each, data, method if each == name else zipfile.ZIP_STORED)
        with pytest.raises(ArgumentError, match="is compressed in another way than by deflate"):
            load_policy(path)


def test_networks_of_very_many_layers_are_refused(trained: Path, tmp_path: Path) -> None:
    parts = members(trained)
    document = json.loads(parts["dynx.json"])
    document["spec"]["hyperparameters"]["policy_kwargs"] = {"net_arch": [1] * 10_000}
    path = written(tmp_path / "deep.zip", {**parts, "dynx.json": json.dumps(document).encode()})
    with pytest.raises(ArgumentError, match="net_arch has more than 1000 layers"):
        load_policy(path)


def test_an_environment_that_cannot_be_made_is_an_error_of_the_task(trained: Path, tmp_path: Path) -> None:
    pytest.importorskip("mujoco")
    with pytest.raises(ArgumentError, match=r"HalfCheetah-v5.* cannot be made: .*nothing"):
        make(TaskSpec("HalfCheetah-v5", options={"xml_file": "nothing"}))


def test_an_observation_of_another_kind_is_refused(trained: Path) -> None:
    observation: Any = {}
    with pytest.raises(ArgumentError, match="observation has dtype object; wanted real numbers"):
        load_policy(trained)(observation)


@pytest.mark.parametrize("name", ["x" * 5000, f"{'x' * 5000}.zip"])
def test_a_name_longer_than_a_system_allows_is_an_error_of_dynx(name: str, tmp_path: Path) -> None:
    with pytest.raises(ArgumentError, match=r"\.{3}"):
        load_policy(tmp_path / name)


def test_policies_of_earlier_versions_keep_their_robots(trained: Path, tmp_path: Path) -> None:
    """As trained: robots had no limits, and at first no joint dynamics; those of worlds had both."""
    parts = members(trained)
    document = json.loads(parts[DOCUMENT])
    assert document["schema"] == "dynx.policy/3"

    def task(schema: str, env_id: str, **options: Any) -> Any:
        told = {**document["spec"]["task"], "id": env_id, "options": options}
        changed = {**document, "schema": schema, "spec": {**document["spec"], "task": told}}
        path = written(tmp_path / "told.zip", {**parts, DOCUMENT: json.dumps(changed).encode()})
        return read_policy_document(path).spec.task

    terms = ("damping", "friction", "armature", "springs", "limits")
    off = dict.fromkeys((f"joint_{each}" for each in terms), False)
    assert task("dynx.policy/1", "dynx/Reach-v0", robot="panda").options == {**off, "robot": "panda"}
    assert task("dynx.policy/1", "dynx/Reach-v0", **off, robot="panda").options == {**off, "robot": "panda"}
    limitless = {"joint_limits": False, "robot": "panda"}
    assert task("dynx.policy/2", "dynx/Reach-v0", robot="panda").options == limitless
    assert task("dynx.policy/3", "dynx/Reach-v0", robot="panda").options == {"robot": "panda"}
    for env_id in ("dynx/Push-v0", "CartPole-v1", "own/Unknown-v0"):
        for version in (1, 2, 3):
            assert task(f"dynx.policy/{version}", env_id).options == {}
