"""`dynx train`, `dynx play` and `dynx env`: tables, documents, files, exit codes and errors."""

from __future__ import annotations

import json
import shutil
import zipfile
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner, Result

from dynx.cli.shell.main import cli
from tests.test_schemas import errors

pytest.importorskip("stable_baselines3", reason="needs the extra train")

from dynx.training.policy import DOCUMENT

FEW = ("--set", "n_steps=16", "--set", "batch_size=32", "--envs", "2", "--episodes", "2")


def run(*arguments: str) -> Result:
    return CliRunner().invoke(cli, list(arguments))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of a small run on the cart-pole of dynx."""
    place = tmp_path_factory.mktemp("train") / "run"
    result = run("train", "CartPole", "--engine", "reference", "--steps", "64", "--out", str(place), *FEW)
    assert result.exit_code == 0, result.output
    assert "dynx/CartPole-v0 on reference, ppo" in result.output
    assert f"dynx play {place}/final.zip --view" in result.output
    return place


def test_several_seeds_have_a_folder_each_a_mean_and_a_plot(tmp_path: Path) -> None:
    out, document, plot = tmp_path / "runs", tmp_path / "all.json", tmp_path / "curve.svg"
    command = ("train", "CartPole-v1", "--steps", "64", "--seed", "3,5", "--out", str(out), *FEW)
    result = run(*command, "--json", str(document), "--plot", str(plot))
    assert result.exit_code == 0, result.output
    found: dict[str, Any] = json.loads(document.read_text())
    assert [each["seed"] for each in found["runs"]] == [3, 5]
    assert found["mean"] == pytest.approx(sum(each["mean"] for each in found["runs"]) / 2)
    assert found["low"] < found["mean"] < found["high"]
    assert found["hyperparameters"]["gae_lambda"] == 0.8  # published
    assert found["hyperparameters"]["n_steps"] == 16  # given
    assert "seed 5" in plot.read_text()
    assert {each.name for each in out.iterdir()} == {"seed-3", "seed-5"}
    again = run(*command, "--resume", "--quiet")
    assert (again.exit_code, again.output) == (0, "")
    shutil.rmtree(out / "seed-5")
    alone = run("train", "--resume", "--out", str(out), "--steps", "96", "--episodes", "1", "--json")
    assert alone.exit_code == 0, alone.output
    (continued,) = json.loads(alone.stdout)["runs"]
    assert (continued["seed"], continued["resumed_at"], continued["steps"]) == (3, 64, 96)
    assert run(*command).exit_code == 2


def test_a_run_is_resumed_with_the_options_of_its_folder(tmp_path: Path) -> None:
    out = tmp_path / "run"
    options = [*("--engine", "reference", "--algo", "a2c", "--seed", "7", "--envs", "2", "--normalize")]
    options += ["--option", "pole_mass=0.2", "--set", "gamma=0.9", "--set", "n_steps=16"]
    begun = run("train", "CartPole", *options, "--steps", "64", "--episodes", "1", "--out", str(out))
    assert begun.exit_code == 0, begun.output
    resumed = ("train", "--resume", "--out", str(out), "--steps", "128", "--episodes", "1")
    result = run(*resumed, "--json")
    assert result.exit_code == 0, result.output
    found: dict[str, Any] = json.loads(result.stdout)
    assert (found["algorithm"], found["hyperparameters"]) == ("a2c", {"gamma": 0.9, "n_steps": 16})
    assert [(each["seed"], each["resumed_at"]) for each in found["runs"]] == [(7, 64)]
    spec = json.loads((out / "run.json").read_text())["spec"]
    assert (spec["steps"], spec["envs"], spec["normalize"]) == (128, 2, True)
    assert spec["task"]["options"] == {"pole_mass": 0.2}
    for wrong, message in (
        (("--set", "gamma=0.5"), "has another run: hyperparameters"),
        (("--seed", "8"), "has another run: seed is '8', there '7'"),
        (("--algo", "ppo"), "has another run: algorithm"),
    ):
        refused = run(*resumed, *wrong)
        assert (refused.exit_code, message in refused.stderr) == (2, True), refused.output


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"task": {"id": "evil:Env-v0", "options": {}}}, "name the task yourself: --task"),
        ({"task": {"id": "dynx/Stand-v0", "options": {"robot": "r.xacro"}}}, "robot"),
        ({"envs": 100_000_000}, "give so many yourself: --envs"),
    ],
)
def test_a_folder_names_no_module_no_file_and_few_environments(
    change: dict[str, Any], message: str, tmp_path: Path
) -> None:
    task = {"id": "dynx/CartPole-v0", "engine": "reference", "options": {}}
    spec = {"task": task, "algorithm": "ppo", "steps": 64, "envs": 1, "seed": 0} | change
    (tmp_path / "run.json").write_text(json.dumps({"schema": "dynx.training/3", "spec": spec}))
    result = run("train", "--resume", "--out", str(tmp_path))
    assert result.exit_code == 2, result.output
    assert message in result.stderr


def test_drawn_parameters_are_part_of_the_run(tmp_path: Path) -> None:
    command = (
        "train",
        "CartPole",
        "--engine",
        "compiled",
        "--steps",
        "64",
        "--out",
        str(tmp_path / "run"),
        *FEW,
    )
    result = run(*command, "--randomize", 'mass_scale={"pole": [0.5, 2]}', "--randomize", "delay=0.02")
    assert result.exit_code == 0, result.output
    spec = json.loads((tmp_path / "run" / "run.json").read_text())["spec"]
    assert spec["task"]["options"]["randomize"] == {"mass_scale": {"pole": [0.5, 2]}, "delay": 0.02}
    result = run("train", "CartPole", "--out", str(tmp_path / "other"), "--randomize", "mas_scale=2")
    assert result.exit_code == 2
    assert "did you mean 'mass_scale'" in result.output


def test_a_policy_is_judged_on_several_engines(folder: Path, tmp_path: Path) -> None:
    policy = str(folder / "final.zip")
    result = run("play", policy, "--engine", "reference,compiled", "--episodes", "3", "--seed", "7", "--json")
    assert result.exit_code == 0, result.output
    found: dict[str, Any] = json.loads(result.stdout)
    assert [each["engine"] for each in found["engines"]] == ["reference", "compiled"]
    # The engines agree to rounding, so that the same policy balances equally long.
    assert found["engines"][0]["returns"] == found["engines"][1]["returns"]
    assert (found["seed"], found["trained_on"], found["steps"]) == (7, "reference", 64)
    assert "on reference" in run("play", policy, "--episodes", "1").output


def test_a_film_is_written(folder: Path, tmp_path: Path) -> None:
    film = tmp_path / "film.gif"
    result = run("play", str(folder / "final.zip"), "--export", str(film))
    assert result.exit_code == 0, result.output
    assert film.read_bytes()[:6] == b"GIF89a"
    assert "wrote" in result.stdout
    assert "episode 1 of 1" in result.stderr  # progress, where no bar is shown
    result = run("play", str(folder / "final.zip"), "--export", str(film), "--quiet")
    assert (result.stdout, result.stderr) == ("", "")
    pytest.importorskip("imageio_ffmpeg", reason="needs the extra film")
    film = tmp_path / "film.MP4"
    result = run("play", str(folder / "final.zip"), "--export", str(film))
    assert result.exit_code == 0, result.output
    assert film.read_bytes()[4:8] == b"ftyp"


def test_distance_of_engines_and_transfer_of_a_policy(folder: Path) -> None:
    policy = str(folder / "final.zip")
    arguments = ("--engine", "reference,compiled", "--seed", "0,1", "--policy", policy, "--episodes", "2")
    result = run("env", "distance", "CartPole", *arguments, "--json")
    assert result.exit_code == 0, result.output
    found: dict[str, Any] = json.loads(result.stdout)
    (pair,) = found["pairs"]
    assert (pair["parted"], pair["first_step"]) == (0, None)
    assert pair["largest"] < 1e-9
    assert [each["engine"] for each in found["policies"][0]["engines"]] == ["reference", "compiled"]
    shown = run("env", "distance", "CartPole", *arguments)
    assert "0 of 2" in shown.output
    assert "trained on" in shown.output


SWING = """
from dynx.envs import register_task
from dynx.envs.tasks.pendulum import Pendulum

class Swing(Pendulum):
    \"\"\"Swing up a pendulum.\"\"\"

    max_episode_steps = 30

register_task("own/Swing-v0", Swing)
"""

ROLL = """
from functools import cached_property
import numpy as np
from gymnasium import spaces
from dynx import Pose
from dynx.envs import WorldTask, register_task
from dynx.world import ExternalForce, Scene, ground, sphere

class Roll(WorldTask):
    \"\"\"Bring a ball to rest at the origin.\"\"\"

    control_dt = 0.05
    max_episode_steps = 20
    action_space = spaces.Box(-1.0, 1.0, (2,), np.float32)
    observation_space = spaces.Box(-10.0, 10.0, (4,), np.float32)

    def scene(self):
        return Scene("roll", bodies=(ground(), sphere("ball", 0.1, mass=1.0, pose=Pose((0, 0, 0.1)))))

    def start(self, episode):
        x, y = episode.rng.uniform(-1.0, 1.0, 2)
        episode.world.set_state(bodies={"ball": (Pose((x, y, 0.1)), np.zeros(6))})

    def loads(self, episode, action):
        return {"forces": [ExternalForce("ball", (*action, 0.0, 0.0, 0.0, 0.0))]}

    def observation(self, episode):
        ball = episode.world.state.bodies["ball"]
        return np.array([*ball.position[:2], *ball.twist[:2]], dtype=np.float32)

    def reward(self, episode, action):
        return -float(np.linalg.norm(episode.world.state.bodies["ball"].position[:2]))

register_task("own/Roll-v0", Roll)
"""

LAMP = """
import gymnasium
import numpy as np
from gymnasium import spaces

class Lamp(gymnasium.Env):
    action_space = spaces.Discrete(2)
    observation_space = spaces.Box(0.0, 1.0, (1,), np.float32)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        return np.zeros(1, dtype=np.float32), {}

    def step(self, action):
        return np.full(1, action, dtype=np.float32), float(action), False, False, {}

gymnasium.register("own/Lamp-v0", Lamp, max_episode_steps=5)
"""


@pytest.mark.parametrize(
    ("name", "module", "engines"),
    [
        ("Swing", SWING, ("reference", "compiled")),
        ("Roll", ROLL, ("pybullet", "mujoco")),
        ("Lamp", LAMP, ()),
    ],
)
def test_a_task_of_a_module_is_trained_played_and_compared(
    name: str, module: str, engines: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / f"own_{name}.py").write_text(module)
    monkeypatch.syspath_prepend(tmp_path)
    task, policy = f"own_{name}:own/{name}-v0", str(tmp_path / "run" / "final.zip")
    assert (f"own/{name}-v0" in run("env", "list", f"own_{name}").output) == bool(engines)
    on = ("--engine", engines[0]) if engines else ()
    trained = run("train", "--task", task, *on, "--steps", "64", "--out", str(tmp_path / "run"), *FEW)
    assert trained.exit_code == 0, trained.output
    assert f"final.zip --view --task {task}" in trained.output.replace("\n", " ")
    resumed = run("train", task, *on, "--steps", "96", "--resume", "--out", str(tmp_path / "run"), *FEW)
    assert resumed.exit_code == 0, resumed.output
    again = ("train", "--steps", "128", "--resume", "--out", str(tmp_path / "run"), "--episodes", "1")
    assert "name the task yourself: --task" in run(*again).stderr  # a file imports nothing
    assert run(*again, "--task", task).exit_code == 0
    unnamed = run("play", policy)  # a file imports nothing
    assert unnamed.exit_code == 2
    assert "name the task yourself: --task" in unnamed.output
    last = ("--engine", engines[-1]) if engines else ()
    played = run("play", policy, "--task", task, *last, "--episodes", "1", "--json")
    assert played.exit_code == 0, played.output
    assert json.loads(played.stdout)["trained_on"] == (engines[0] if engines else None)
    apart = ("--engine", ",".join(engines), "--seed", "0", "--steps", "10") if engines else ()
    compared = run("env", "distance", "--task", task, *apart, "--policy", policy, "--episodes", "1", "--json")
    if not engines:
        assert "runs on one engine, its own" in compared.output
        return
    assert compared.exit_code == 0, compared.output
    found: dict[str, Any] = json.loads(compared.stdout)
    assert found["pairs"][0]["largest"] < (1e-9 if name == "Swing" else 1.0)
    alone = found["policies"][0]["engines"][1]["mean"]
    assert json.loads(played.stdout)["engines"][0]["mean"] == alone


def test_the_list_names_tasks_and_engines() -> None:
    result = run("env", "list")
    assert result.exit_code == 0, result.output
    assert "dynx/CartPole-v0" in result.output
    document = json.loads(run("env", "list", "--json").stdout)
    assert "reference" in document["tasks"][0]["engines"]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["train", "CartPol"], "no task 'CartPol'; did you mean 'CartPole'"),
        (["train", "--task", "CartPol"], "no task 'CartPol'; did you mean 'CartPole'"),
        (["train"], "TASK is missing; wanted a task such as CartPole"),
        (["train", "CartPole", "--task", "CartPole"], "TASK is 'CartPole' and --task 'CartPole'"),
        (["env", "distance"], "TASK is missing; wanted a task such as CartPole"),
        (["train", "CartPole", "--engine", "pinochio"], "does not run on engine 'pinochio'"),
        (["train", "CartPole-v1", "--engine", "mujoco"], "unexpected keyword argument 'engine'"),
        (["train", "CartPole", "--algo", "pqo"], "no algorithm 'pqo'; did you mean 'ppo'"),
        (["train", "CartPole", "--set", "gama=1"], "no hyperparameter 'gama'; did you mean 'gamma'"),
        (["train", "CartPole", "--set", "gamma"], "is not of the form name=value"),
        (["train", "CartPole", "--option", "pole_mas=1"], "no option 'pole_mas'; did you mean 'pole_mass'"),
        (["train", "CartPole", "--seed", "0,0"], "0 is given twice"),
        (["train", "CartPole", "--seed", "-1"], "'-1' is not a whole number"),
        (["train", "CartPole", "--steps", "0"], "0 is not in the range"),
        (["train", "CartPole", "--resume"], "no training run that could be resumed"),
        (["train", "CartPole", "--plot", "curve.txt"], "a plot is saved as .png, .pdf or .svg"),
        (["play", "none.zip"], "there is no such file"),
        (["play", "none.zip", "--view", "--export", "x.gif"], "--view and --export are given together"),
        (["env", "distance", "CartPole-v1"], "wanted a task of dynx"),
        (["env", "distance", "CartPole", "--engine", "reference"], "wanted two engines or more"),
        (["env", "distance", "CartPole", "--tolerance", "nan"], "nan"),
        (["env", "distance", "CartPole", "--policy", "none.zip"], "there is no such file"),
    ],
    ids=lambda value: " ".join(value)[:40] if isinstance(value, list) else "",
)
def test_wrong_input_is_one_line_and_exit_code_2(
    arguments: list[str], message: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    result = run(*arguments)
    assert result.exit_code == 2, result.output
    assert message in result.stderr
    assert len(result.stderr.strip().splitlines()) == 1, result.stderr
    assert not (tmp_path / "runs").exists(), "a run that cannot begin leaves a folder"


def test_the_lander_of_gymnasium_is_trained_judged_shown_and_filmed(tmp_path: Path) -> None:
    pytest.importorskip("Box2D", reason="needs the extra train, where Box2D has wheels")
    policy = str(tmp_path / "lander" / "final.zip")
    trained = run("train", "LunarLander-v3", "--steps", "64", "--out", str(tmp_path / "lander"), *FEW)
    assert trained.exit_code == 0, trained.output
    document = json.loads((tmp_path / "lander" / "run.json").read_text())
    assert document["spec"]["hyperparameters"]["gamma"] == 0.999  # published
    judged = run("play", policy, "--episodes", "2", "--json")
    assert judged.exit_code == 0, judged.output
    seen = run("play", policy, "--view", "--episodes", "1")
    assert seen.exit_code == 0, seen.output
    total = json.loads(judged.stdout)["engines"][0]["returns"][0]
    assert f"return {total:.5g} in" in seen.output
    film = tmp_path / "lander.gif"
    assert run("play", policy, "--export", str(film)).exit_code == 0
    assert film.read_bytes()[:6] == b"GIF89a"
    # A policy for the lander that dynx had acts on Gymnasium's, too.
    old = str(tmp_path / "old.zip")
    with zipfile.ZipFile(policy) as read, zipfile.ZipFile(old, "w") as written:
        for name in read.namelist():
            content = read.read(name)
            if name == DOCUMENT:
                parts = json.loads(content)
                parts["spec"]["task"] = {"id": "dynx/LunarLander-v0", "engine": "mujoco", "options": {}}
                content = json.dumps(parts).encode()
            written.writestr(name, content)
    refused = run("play", old, "--episodes", "2")
    assert (refused.exit_code, "by --task LunarLander-v3" in refused.output) == (2, True), refused.output
    again = run("play", old, "--task", "LunarLander-v3", "--episodes", "2", "--json")
    assert (
        json.loads(again.stdout)["engines"][0]["returns"]
        == json.loads(judged.stdout)["engines"][0]["returns"]
    )


def test_a_policy_of_an_engine_is_judged_on_the_task_of_gymnasium(tmp_path: Path) -> None:
    out = str(tmp_path / "run")
    trained = run("train", "CartPole", "--engine", "reference", "--steps", "64", "--out", out, *FEW)
    assert trained.exit_code == 0, trained.output
    arguments = ("play", f"{out}/final.zip", "--episodes", "2", "--json")
    own, gymnasiums = run(*arguments), run(*arguments, "--task", "CartPole-v1")
    assert gymnasiums.exit_code == 0, gymnasiums.output
    # Gymnasium's cart-pole state by state, so that the returns are equal.
    first, second = (json.loads(each.stdout)["engines"][0] for each in (own, gymnasiums))
    assert first["returns"] == second["returns"]
    assert second["engine"] is None


def test_other_films_are_refused(folder: Path, tmp_path: Path) -> None:
    result = run("play", str(folder / "final.zip"), "--export", str(tmp_path / "film.avi"))
    assert result.exit_code == 2
    assert "a film is written as .gif, .webp or .mp4" in result.stderr


def test_documents_keep_their_schemas(tmp_path: Path) -> None:
    out = str(tmp_path / "run")
    few = ["--set", "n_steps=16", "--set", "batch_size=32", "--envs", "2", "--episodes", "1"]
    policy = f"{out}/final.zip"
    engines = ["--engine", "reference,compiled"]
    for name, arguments in (
        ("train", ["train", "CartPole", "--engine", "reference", "--steps", "32", "--out", out, *few]),
        ("play", ["play", policy, "--episodes", "1"]),
        ("tasks", ["env", "list"]),
        (
            "env-distance",
            ["env", "distance", "CartPole", *engines, "--seed", "0", "--policy", policy, "--episodes", "1"],
        ),
    ):
        result = CliRunner().invoke(cli, [*arguments, "--json"])
        assert result.exit_code == 0, result.output
        assert errors(name, json.loads(result.stdout)) == []
