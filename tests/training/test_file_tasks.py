"""A file of a policy or a run executes nothing, imports nothing and opens no other file."""

from __future__ import annotations

import io
import json
import os
import shutil
import sys
import zipfile
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from click.testing import CliRunner

from dynx.cli.shell.main import cli
from dynx.errors import ArgumentError, DynxError, UnknownNameError
from dynx.training import Schedule, TaskSpec, judge, load_policy, train
from tests.training.runs import members, small_run, written
from tests.training.test_policy import ONCE

URDF = '<robot name="r"><link name="base"/></robot>'
MESH = (
    '<robot name="r"><link name="a"><visual><geometry>'
    '<mesh filename\n="%s"/></geometry></visual></link></robot>'
)

MODULE = "planted_by_nobody"
"""Name of a module that registers an environment, and tells that it was imported."""


HEARD = ("open", "import", "exec", "compile", "subprocess.Popen", "os.system")
"""Events of Python's audit hook that tell what is opened and executed."""


class Watch:
    """What Python opened, imported and executed while a watch was on."""

    def __init__(self) -> None:
        self.seen: list[str] | None = None

    def hear(self, event: str, arguments: tuple[Any, ...]) -> None:
        """Hear an event of Python's audit hook."""
        if self.seen is not None and event in HEARD:
            self.seen.append(f"{event} {arguments[0]!s:.300}")

    def during(self, action: Callable[[], object]) -> list[str]:
        """Return what was opened, imported and executed by an action that raises an error of dynx."""
        self.seen = []
        try:
            with pytest.raises(DynxError) as caught:
                action()
        finally:
            seen, self.seen = self.seen, None
        assert isinstance(caught.value, ArgumentError | UnknownNameError)
        return seen


DQN = small_run(64, algorithm="dqn", hyperparameters={"buffer_size": 100, "learning_starts": 8})
LONGER = replace(DQN, steps=96)
OFTEN = Schedule(checkpoint_every=32, evaluate_every=1000)

WATCH = Watch()
sys.addaudithook(WATCH.hear)


@pytest.fixture(scope="module")
def trained(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the file of a policy with scaled observations."""
    folder = tmp_path_factory.mktemp("run")
    train(small_run(64, normalize=True), folder, schedule=ONCE, final_episodes=1)
    return folder / "final.zip"


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of a run with a replay buffer and checkpoints after 32 and 64 steps."""
    folder = tmp_path_factory.mktemp("resumed") / "run"
    train(DQN, folder, schedule=OFTEN, final_episodes=1)
    return folder


@pytest.fixture
def planted(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Return a folder on the path of modules, with a module, a xacro file and a robot; the folder is the
    current one."""
    (tmp_path / f"{MODULE}.py").write_text(
        "import gymnasium\n"
        "gymnasium.register('Own-v0', entry_point='gymnasium.envs.classic_control:CartPoleEnv', "
        "max_episode_steps=20)\n"
    )
    code = f"open({str(tmp_path / 'executed')!r}, 'w')"
    xacro = '<robot xmlns:xacro="http://ros.org/wiki/xacro" name="r"><link name="${%s}"/></robot>'
    (tmp_path / "r.xacro").write_text(xacro % code)
    (tmp_path / "r.urdf").write_text(URDF)
    (tmp_path / "bare").write_text(URDF)
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    yield tmp_path
    sys.modules.pop(MODULE, None)
    from gymnasium.envs.registration import registry

    registry.pop("Own-v0", None)


def changed(trained: Path, path: Path, task: dict[str, Any] | None = None, **fields: Any) -> Path:
    """Write a policy whose document says something else."""
    parts = members(trained)
    document = json.loads(parts["dynx.json"])
    document["spec"]["task"] = {**document["spec"]["task"], **(task or {})}
    document["spec"].update(fields.pop("spec", {}))
    return written(path, {**parts, "dynx.json": json.dumps({**document, **fields}).encode()})


def touched(seen: list[str]) -> list[str]:
    """Return what was seen of files and modules that attacks name."""
    return [
        each for each in seen if any(name in each for name in (MODULE, "r.xacro", "r.urdf", "passwd", "bare"))
    ]


ATTACKS: list[dict[str, Any]] = [
    {"id": f"{MODULE}:Own-v0"},
    {"id": f"{MODULE}:CartPole-v1"},
    {"id": f"{MODULE}:dynx/CartPole-v0"},
    {"id": "Own-v0"},
    {"id": "dynx/CartPole-v0", "options": {"task": f"{MODULE}:Task"}},
    {"id": "dynx/CartPole-v0", "options": {"task": MODULE}},
    {"id": "dynx/CartPole-v0", "engine": f"{MODULE}:Engine"},
    {"id": "dynx/CartPole-v0", "engine": MODULE},
    {"id": "GymV26Environment-v0", "options": {"env_id": f"{MODULE}:Own-v0"}},
    {"id": "CartPole-v1", "options": {"entry_point": f"{MODULE}:Own"}},
    {"id": "CartPole-v1", "options": {"deep": [{"er": {f"{MODULE}.py": 1}}]}},
    {"id": "Ant-v5", "options": {"xml_file": "/etc/passwd"}},
    {"id": "Ant-v5", "options": {"xml_file": "../../r.urdf"}},
    {"id": "dynx/Reach-v0", "options": {"robot": "r.xacro"}},
    {"id": "dynx/Reach-v0", "options": {"robot": "r.xacro a:=1"}},
    {"id": "dynx/Reach-v0", "options": {"robot": "./r.urdf"}},
    {"id": "dynx/Reach-v0", "options": {"robot": "bare"}},
    {"id": "dynx/Reach-v0", "options": {"robot": "package://r/r.urdf"}},
    {"id": "dynx/Reach-v0", "options": {"robot": "~/r.urdf"}},
    {"id": "dynx/Reach-v0", "options": {"robot": ["ur5"]}},
    {"id": "dynx/Reach-v0", "options": {"robot": MESH % "/etc/passwd"}},
    {"id": "dynx/Reach-v0", "options": {"frame": "/etc/passwd"}},
]
"""Tasks in a file that would import a module, run code or open a file."""


@pytest.mark.parametrize("task", ATTACKS, ids=lambda task: json.dumps(task)[:60])
def test_a_policy_opens_and_imports_nothing(task: dict[str, Any], trained: Path, planted: Path) -> None:
    policy = changed(trained, planted / "policy.zip", {"options": {}, "engine": None, **task})
    for call in (
        lambda: load_policy(policy),
        lambda: load_policy(str(policy), None),
    ):
        seen = WATCH.during(call)
        assert [each for each in seen if str(planted) in each and not each.endswith(str(policy))] == []
        assert not touched(seen)
    assert MODULE not in sys.modules
    result = CliRunner().invoke(cli, ["play", str(policy), "--episodes", "1"])
    assert result.exit_code == 2, result.output
    assert MODULE not in sys.modules
    assert not (planted / "executed").exists()


@pytest.mark.parametrize("task", ATTACKS[:5], ids=lambda task: json.dumps(task)[:60])
def test_a_task_of_the_caller_is_that_of_the_policy(
    task: dict[str, Any], trained: Path, planted: Path
) -> None:
    own = TaskSpec("CartPole-v1")
    policy = load_policy(changed(trained, planted / "policy.zip", task), own)
    assert policy.spec.task == own
    judge(policy, policy.spec.task, 1)
    assert MODULE not in sys.modules


def test_the_caller_names_a_task_of_their_own(trained: Path, planted: Path) -> None:
    own = f"{MODULE}:Own-v0"
    policy = changed(trained, planted / "policy.zip", {"id": own})
    assert judge(load_policy(policy, TaskSpec(own)), TaskSpec(own), 1).lengths[0] <= 20
    result = CliRunner().invoke(cli, ["play", str(policy), "--task", own, "--episodes", "1", "--json"])
    assert result.exit_code == 0, result.output
    result = CliRunner().invoke(cli, ["play", str(policy), "--task", f"{MODULE}:Other-v0"])
    assert (result.exit_code, "registers no task 'Other-v0'" in result.output) == (2, True)
    result = CliRunner().invoke(cli, ["play", str(policy), "--task", "no_such_module:Other-v0"])
    assert (result.exit_code, "cannot be imported" in result.output) == (2, True)


def test_a_run_on_a_task_of_the_caller_is_resumed(planted: Path) -> None:
    spec = replace(small_run(64), task=TaskSpec(f"{MODULE}:Own-v0"))
    train(spec, "run", schedule=OFTEN, final_episodes=1)
    assert (
        train(replace(spec, steps=96), "run", resume=True, schedule=OFTEN, final_episodes=1).resumed_at == 64
    )
    with pytest.raises(ArgumentError, match="which is not registered here"):
        load_policy("run/final.zip")


def test_options_that_are_words_numbers_and_robots_are_taken(trained: Path, tmp_path: Path) -> None:
    for task in (
        {"id": "dynx/Reach-v0", "options": {"robot": "ur5", "actions": "torque"}},
        {
            "id": "dynx/Pendulum-v0",
            "options": {"actions": "relative", "randomize": {"mass_scale": [0.5, 2.0]}},
        },
    ):
        with pytest.raises(ArgumentError, match="no weights that fit"):
            load_policy(changed(trained, tmp_path / "policy.zip", task))


@pytest.mark.parametrize("task", ATTACKS, ids=lambda task: json.dumps(task)[:60])
def test_a_resumed_run_and_its_checkpoints_are_only_compared(
    task: dict[str, Any], run: Path, planted: Path
) -> None:
    shutil.copytree(run, planted / "run")
    document = json.loads((planted / "run" / "run.json").read_text())
    for path in (planted / "run" / "checkpoints").glob("*.zip"):
        changed(path, path, task)
    seen = WATCH.during(lambda: train(LONGER, planted / "run", resume=True))
    document["spec"]["task"].update(task)
    (planted / "run" / "run.json").write_text(json.dumps(document))
    seen += WATCH.during(lambda: train(LONGER, planted / "run", resume=True))
    assert not touched(seen)
    assert MODULE not in sys.modules


BAD_HYPERPARAMETERS: list[dict[str, Any]] = [
    {"n_steps": 10**15},
    {"n_steps": 0},
    {"batch_size": 10**15},
    {"policy_kwargs": {"net_arch": [10**6, 10**6]}},
    {"policy_kwargs": {"net_arch": {"pi": [64], "vf": [10**9, 64]}}},
    {"policy_kwargs": {"net_arch": [64, "x"]}},
    {"policy_kwargs": {"net_arch": [-1]}},
    {"policy_kwargs": {"net_arch": 3}},
    {"policy_kwargs": {"n_critics": 10**9}},
    {"policy_kwargs": {"features_extractor_class": f"{MODULE}:Own"}},
    {"policy_kwargs": {"optimizer_class": f"{MODULE}:Own"}},
    {"rollout_buffer_class": f"{MODULE}:Own"},
    {"clip_range": {}},
    {"tensorboard_log": "/tmp/logs"},
    {"_init_setup_model": False},
]
"""Hyperparameters in a file with which no policy can be made."""

BAD_NUMBERS: list[dict[str, Any]] = [
    {"observation_mean": [0.0]},
    {"observation_mean": None},
    {"observation_variance": [1.0] * 5},
    {"observation_variance": []},
    {"observation_variance": [1.0, 1.0, 1.0, -1.0]},
    {"observation_variance": [1.0, 1.0, 1.0, float("nan")]},
    {"observation_mean": [1.0, 1.0, 1.0, float("inf")]},
    {"return_variance": -1.0},
    {"return_variance": float("nan")},
    {"samples": 0.0},
    {"steps_done": -1},
    *({"spec": {"hyperparameters": each}} for each in BAD_HYPERPARAMETERS),
    {"spec": {"algorithm": "dqn", "hyperparameters": {"buffer_size": 10**15}}},
    {"spec": {"algorithm": "os.system"}},
]
"""Numbers and hyperparameters in a file that no run has."""


@pytest.mark.parametrize("fields", BAD_NUMBERS, ids=lambda fields: json.dumps(fields)[:60])
def test_numbers_that_no_run_has_are_one_error(fields: dict[str, Any], trained: Path, tmp_path: Path) -> None:
    policy = changed(trained, tmp_path / "policy.zip", **fields)
    with pytest.raises((ArgumentError, UnknownNameError)) as caught:
        load_policy(policy)
    assert "\n" not in str(caught.value)
    assert CliRunner().invoke(cli, ["play", str(policy), "--episodes", "1"]).exit_code == 2


def edited(content: bytes, edit: Callable[[Any], object]) -> bytes:
    """Return a file of tensors after an edit."""
    found = torch.load(io.BytesIO(content), weights_only=True)
    edit(found)
    buffer = io.BytesIO()
    torch.save(found, buffer)
    return buffer.getvalue()


def compressed(content: bytes) -> bytes:
    """Return an archive whose members are compressed."""
    buffer = io.BytesIO()
    with (
        zipfile.ZipFile(io.BytesIO(content)) as archive,
        zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as new,
    ):
        for name in archive.namelist():
            new.writestr(name, archive.read(name))
    return buffer.getvalue()


def test_weights_that_no_policy_has_are_one_error(run: Path, trained: Path, tmp_path: Path) -> None:
    parts = members(trained)
    nan, moments = float("nan"), "policy.optimizer.pth"

    def first_moment(found: Any) -> None:
        found["state"][0]["exp_avg"] = torch.zeros(3)

    for name, content, message in (
        (
            "policy.pth",
            edited(parts["policy.pth"], lambda found: found["action_net.bias"].fill_(nan)),
            "finite",
        ),
        ("policy.pth", compressed(parts["policy.pth"]), "compressed"),
        ("policy.pth", parts["policy.pth"][:-100], "no weights that fit"),
        (moments, edited(parts[moments], first_moment), "another shape"),
        (moments, edited(parts[moments], lambda found: found["param_groups"][0].update(lr="x")), "lr of the"),
        (
            moments,
            edited(parts[moments], lambda found: found["param_groups"][0].pop("betas")),
            "other options",
        ),
        ("pytorch_variables.pth", edited(parts[moments], lambda found: None), "its variables are"),
    ):
        with pytest.raises(ArgumentError, match=message):
            load_policy(written(tmp_path / "policy.zip", {**parts, name: content}))
    bomb = tmp_path / "bomb.zip"
    with zipfile.ZipFile(bomb, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in {**parts, "more.pth": bytes(10**8)}.items():
            archive.writestr(name, content)
    with pytest.raises(ArgumentError, match="larger than the file"):
        load_policy(bomb)


def test_replay_buffers_of_others_are_one_error(run: Path, tmp_path: Path) -> None:
    newest = f"{DQN.steps:012d}.npz"
    with np.load(run / "checkpoints" / newest) as file:
        arrays = dict(file)
    infinite = arrays["observations"].copy()
    infinite[0] = np.inf
    for change in (
        {"rewards": arrays["rewards"][:-1]},
        {"observations": arrays["observations"][..., :2]},
        {"observations": infinite},
        {"actions": arrays["actions"].astype(np.float64)},
        {"pos": np.array(10**9)},
        {"pos": np.array(-1)},
        {"full": np.array(1)},
        {"full": np.array(True)},
        {"dones": np.array([{}], dtype=object)},
    ):
        folder = tmp_path / "run"
        shutil.copytree(run, folder)
        np.savez(folder / "checkpoints" / newest, **{**arrays, **change})
        with pytest.raises(ArgumentError, match="replay buffer"):
            train(LONGER, folder, resume=True)
        shutil.rmtree(folder)


@pytest.mark.skipif(sys.platform == "win32", reason="no links, no FIFOs")
def test_a_run_is_not_resumed_through_links_and_devices(run: Path, tmp_path: Path) -> None:
    outside = tmp_path / "outside"
    for name in ("final.zip", "run.json", "checkpoints/000000000064.npz", "curve.jsonl"):
        folder = tmp_path / "run"
        shutil.copytree(run, folder)
        outside.write_text("kept")
        (folder / name).unlink()
        (folder / name).symlink_to(outside)
        with pytest.raises(ArgumentError, match="is a link"):
            train(LONGER, folder, resume=True)
        assert outside.read_text() == "kept"
        (folder / name).unlink()
        os.mkfifo(folder / name)
        if name != "final.zip":
            with pytest.raises(DynxError, match="FIFO"):
                train(LONGER, folder, resume=True)
        shutil.rmtree(folder)


def test_lines_of_evaluations_may_be_anything(run: Path, tmp_path: Path) -> None:
    folder = tmp_path / "run"
    shutil.copytree(run, folder)
    lines = [
        "[" * 10**5,
        '{"steps": 1}',
        '{"steps": 1, "mean": "x"}',
        '{"steps": true}',
        '{"steps": 1, "mean": []}',
    ]
    (folder / "evaluations.jsonl").write_text("\n".join(lines))
    assert train(LONGER, folder, resume=True, schedule=OFTEN, final_episodes=1).resumed_at == 64


@pytest.mark.skipif(sys.platform == "win32", reason="no links")
@pytest.mark.parametrize("name", ["run.json", "final.zip", "curve.jsonl", "checkpoints", "tensorboard"])
def test_a_run_does_not_begin_through_links(name: str, tmp_path: Path) -> None:
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / name).symlink_to(tmp_path / "outside")
    with pytest.raises(ArgumentError, match=f"{name}' is a link"):
        train(LONGER, tmp_path / "run")
    assert not (tmp_path / "outside").exists()
