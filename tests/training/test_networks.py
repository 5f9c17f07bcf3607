"""Policies whose network NumPy computes: they act as by PyTorch, and their files run no code."""

from __future__ import annotations

import io
import pickle
import subprocess
import sys
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from dynx.errors import ArgumentError
from dynx.training import Schedule, TaskSpec, judge, load_policy, train
from dynx.training.networks import PolicyNetwork, read_network
from tests.training.runs import members, small_run, written

ONCE = Schedule(checkpoint_every=1000, evaluate_every=1000)
OFF_POLICY: dict[str, Any] = {"learning_starts": 8, "buffer_size": 100, "batch_size": 4}
ON_POLICY: dict[str, Any] = {"n_steps": 16, "batch_size": 16}
CASES: dict[str, tuple[str, str, dict[str, Any]]] = {
    "ppo": ("ppo", "CartPole-v1", {**ON_POLICY, "policy_kwargs": {"activation_fn": "gelu"}}),
    "ppo of numbers": ("ppo", "Pendulum-v1", {**ON_POLICY, "use_sde": True}),
    "a2c": ("a2c", "CartPole-v1", {"n_steps": 16, "policy_kwargs": {"net_arch": {"pi": [8, 5], "vf": []}}}),
    "dqn": ("dqn", "CartPole-v1", {**OFF_POLICY, "policy_kwargs": {"activation_fn": "silu"}}),
    "sac": ("sac", "Pendulum-v1", {**OFF_POLICY, "policy_kwargs": {"activation_fn": "elu"}}),
    "sac, exploring by state": ("sac", "Pendulum-v1", {**OFF_POLICY, "use_sde": True}),
    "td3": ("td3", "dynx/Reach-v0", OFF_POLICY),
}


def policy_file(folder: Path, case: str) -> Path:
    """Train a policy a little, with scaled observations."""
    algorithm, task, options = CASES[case]
    spec = small_run(
        32,
        task=TaskSpec(task, "compiled" if task.startswith("dynx") else None),
        algorithm=algorithm,
        envs=1,
        hyperparameters=options,
        normalize=True,
    )
    train(spec, folder, schedule=ONCE, final_episodes=1)
    return folder / "final.zip"


@pytest.fixture(scope="module")
def cart_pole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return policy_file(tmp_path_factory.mktemp("run"), "ppo")


@pytest.mark.parametrize("case", CASES)
def test_numpy_computes_what_pytorch_computes(case: str, tmp_path: Path) -> None:
    path = policy_file(tmp_path, case)
    by_torch, by_numpy = load_policy(path, network="torch"), load_policy(path, network="numpy")
    assert isinstance(by_numpy.algorithm, PolicyNetwork)
    assert by_numpy.scaling is not None
    rows = np.random.default_rng(0).normal(size=(60, *by_numpy.scaling.mean.shape)).astype(np.float32)
    rows[30:] *= 10.0
    expected, found = by_torch(rows), by_numpy(rows)
    assert found.dtype == expected.dtype
    if expected.dtype.kind == "i":
        np.testing.assert_array_equal(found, expected)
    else:
        # Sums of up to 400 numbers in single precision, added in another order in each of three layers.
        np.testing.assert_allclose(found, expected, rtol=0.0, atol=3 * 400 * np.finfo(np.float32).eps)
    one, alone = by_torch(rows[0]), by_numpy(rows[0])
    assert np.shape(alone) == np.shape(one)


def test_a_policy_is_judged_without_pytorch_and_stable_baselines(cart_pole: Path) -> None:
    """In a process in which neither can be imported."""
    code = (
        "import sys\n"
        "sys.modules |= {'torch': None, 'stable_baselines3': None}\n"
        "from dynx.training import judge, load_policy\n"
        "policy = load_policy(sys.argv[1], network='numpy')\n"
        "print(judge(policy, policy.spec.task, episodes=3).returns.tolist())\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, str(cart_pole)], capture_output=True, text=True, check=True
    )
    by_torch = load_policy(cart_pole, network="torch")
    assert done.stdout.strip() == str(judge(by_torch, by_torch.spec.task, episodes=3).returns.tolist())


def test_what_numpy_lacks_is_named(cart_pole: Path, tmp_path: Path) -> None:
    policy = load_policy(cart_pole, network="numpy")
    with pytest.raises(ArgumentError, match="network='torch'"):
        policy(np.zeros(4), deterministic=False)
    with pytest.raises(ArgumentError, match="network='torch'"):
        policy.save(tmp_path / "copy.zip")
    with pytest.raises(ArgumentError, match="4"):
        policy(np.zeros(5))
    with pytest.raises(ArgumentError, match=r"network is 'jax'.*torch"):
        load_policy(cart_pole, network="jax")  # type: ignore[arg-type]
    with pytest.raises(ArgumentError, match="a policy for CartPole-v1"):
        load_policy(cart_pole, TaskSpec("Pendulum-v1"), network="numpy")


def weights_file(cart_pole: Path, folder: Path, weights: bytes) -> Path:
    return written(folder / "other.zip", {**members(cart_pole), "policy.pth": weights})


def torch_file(recipe: bytes, numbers: bytes = bytes(64)) -> bytes:
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w") as archive:
        archive.writestr("a/data.pkl", recipe)
        archive.writestr("a/data/0", numbers)
    return content.getvalue()


class Harmful:
    """An object whose pickle makes a file."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self) -> tuple[object, ...]:
        return Path.touch, (self.path,)


@pytest.mark.parametrize("protocol", range(5))
def test_no_code_of_the_weights_runs(protocol: int, cart_pole: Path, tmp_path: Path) -> None:
    recipe = pickle.dumps({"x": Harmful(tmp_path / "executed")}, protocol)
    with pytest.raises(ArgumentError, match="no weights that fit"):
        load_policy(weights_file(cart_pole, tmp_path, torch_file(recipe)), network="numpy")
    assert not (tmp_path / "executed").exists()


@pytest.mark.parametrize(
    ("name", "tensor"),
    [
        ("action_net.weight", torch.zeros(2, 63)),
        ("action_net.weight", torch.zeros(3, 64)),
        ("action_net.bias", torch.full((2,), torch.nan)),
        ("action_net.weight", torch.zeros(1, 64).expand(2, 64)),
        ("action_net.weight", torch.zeros(64, 2).T),
        ("mlp_extractor.policy_net.x.weight", torch.zeros(64, 64)),
    ],
    ids=["inputs", "outputs", "not finite", "repeated numbers", "other layout", "name"],
)
def test_other_weights_are_refused(name: str, tensor: Any, cart_pole: Path, tmp_path: Path) -> None:
    weights = torch.load(io.BytesIO(members(cart_pole)["policy.pth"]), weights_only=True)
    content = io.BytesIO()
    torch.save({**weights, name: tensor}, content)
    with pytest.raises(ArgumentError, match="no weights that fit"):
        load_policy(weights_file(cart_pole, tmp_path, content.getvalue()), network="numpy")


@given(st.data())
def test_damaged_recipes_are_refused(cart_pole: Path, data: st.DataObject) -> None:
    """Change bytes of the pickle that says which numbers are which tensor."""
    spec = small_run()
    parts = members(cart_pole)
    with zipfile.ZipFile(io.BytesIO(parts["policy.pth"])) as archive:
        inner = {name: archive.read(name) for name in archive.namelist()}
    recipe = next(name for name in inner if name.endswith("data.pkl"))
    damaged = bytearray(inner[recipe])
    for _ in range(data.draw(st.integers(1, 4))):
        damaged[data.draw(st.integers(0, len(damaged) - 1))] = data.draw(st.integers(0, 255))
    content, outer = io.BytesIO(), io.BytesIO()
    for target, these in ((content, {**inner, recipe: bytes(damaged)}), (outer, parts)):
        with zipfile.ZipFile(target, "w") as archive:
            for name, each in these.items():
                archive.writestr(name, content.getvalue() if name == "policy.pth" else each)
    from gymnasium import spaces

    observations = spaces.Box(-np.inf, np.inf, (4,), np.float32)
    try:
        network = read_network(outer, spec, observations, spaces.Discrete(2), "it")
    except ArgumentError:
        return
    assert network(np.zeros(4)) in (0, 1)
