"""Tasks by their names: ids, bare names, classes and modules, at the doors of Python."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest

from dynx.envs import make_environment
from dynx.envs.registration import NAMESPACE, TASKS, is_of_dynx, make_vector_environment, task_class, task_id
from dynx.envs.task import RobotTask
from dynx.envs.tasks.cart_pole import CartPole
from dynx.errors import ArgumentError, UnknownNameError

OWN = """
from dynx.envs import register_task
from dynx.envs.tasks.cart_pole import CartPole

class Short(CartPole):
    \"\"\"Balance for a short time.\"\"\"

    max_episode_steps = 20

class Unregistered(CartPole):
    pass

register_task("own/Short-v0", Short)
"""


@pytest.fixture
def own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """Return the name of a module that registers a task."""
    (tmp_path / "own_tasks_of_a_test.py").write_text(OWN)
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "own_tasks_of_a_test", raising=False)
    return "own_tasks_of_a_test"


@pytest.mark.parametrize("name", TASKS)
def test_every_registered_name_gives_the_class_of_its_task(name: str) -> None:
    by_class = task_class(TASKS[name])
    assert task_class(f"{NAMESPACE}/{name}") is by_class
    assert task_class(name.rpartition("-v")[0]) is by_class


def test_an_id_makes_the_environment_of_the_class() -> None:
    with_id = make_environment("dynx/CartPole-v0", "reference", cart_mass=2.0)
    with_class = make_environment(CartPole, "reference", cart_mass=2.0)
    assert np.array_equal(with_id.reset(seed=4)[0], with_class.reset(seed=4)[0])
    assert np.array_equal(with_id.step(1)[0], with_class.step(1)[0])


def test_a_task_of_a_module_is_one_of_dynx(own: str) -> None:
    assert task_id(f"{own}:own/Short-v0") == f"{own}:own/Short-v0"
    assert is_of_dynx(f"{own}:own/Short-v0")
    assert is_of_dynx("own/Short-v0")
    assert not is_of_dynx("CartPole-v1")
    assert make_environment(f"{own}:own/Short-v0").task.max_episode_steps == 20
    assert make_environment(f"{own}:Unregistered").task.max_episode_steps == CartPole.max_episode_steps


@pytest.mark.parametrize(
    ("name", "error", "message"),
    [
        ("dynx/Pendulm-v0", UnknownNameError, "did you mean 'Pendulum'"),
        ("Pendulm", UnknownNameError, "did you mean 'Pendulum'"),
        ("CartPole-v1", ArgumentError, r"no task of dynx: gymnasium.make\('CartPole-v1'\)"),
        ("no_such_module:Env", UnknownNameError, "'no_such_module' cannot be imported"),
        ("dynx.envs:TaskEnvironmnt", UnknownNameError, "registers no task 'TaskEnvironmnt'"),
        ("dynx.envs:TaskEnvironment", ArgumentError, "wanted a subclass of dynx.envs.Task"),
    ],
)
def test_another_name_is_an_error_of_dynx(name: str, error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        make_environment(name)


def test_an_id_that_is_a_class_says_how_it_is_registered(own: str) -> None:
    with pytest.raises(UnknownNameError, match=r"register_task\('own/Unregistered-v0', Unregistered\)"):
        task_id(f"{own}:Unregistered")


def test_a_module_of_the_current_folder_says_how_it_is_found(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [each for each in sys.path if each not in ("", str(tmp_path))])
    (tmp_path / "only_in_this_folder.py").write_text(OWN)
    with pytest.raises(UnknownNameError, match=r"PYTHONPATH=\. adds"):
        task_id("only_in_this_folder:own/Short-v0")


def test_the_lander_that_dynx_had_names_gymnasiums() -> None:
    words = r"Gymnasium's LunarLander-v3 \(extra train\)"
    for call in (
        lambda: task_id("LunarLander"),
        lambda: task_id("dynx/LunarLander-v0"),
        lambda: make_environment("LunarLander"),
        lambda: gymnasium.make("dynx/LunarLander-v0", engine="mujoco"),
        lambda: gymnasium.make("dynx/LunarLander-v0"),
        lambda: gymnasium.make_vec("dynx/LunarLander-v0", num_envs=2, vectorization_mode="sync"),
    ):
        with pytest.raises(UnknownNameError, match=words):
            call()
    assert not is_of_dynx("dynx/LunarLander-v0")
    assert task_id("LunarLander-v3") == "LunarLander-v3"


@pytest.mark.parametrize(
    ("name", "value", "hook"),
    [
        ("terminate", lambda self, robot, state: False, "terminated"),
        ("substep", 4, "substeps"),
        ("integrater", "rk4", "integrator"),
    ],
)
def test_a_misspelt_hook_of_a_task_is_refused(name: str, value: Any, hook: str) -> None:
    class Bare(RobotTask):
        pass

    with pytest.raises(UnknownNameError, match=f"has '{name}'; did you mean '{hook}'"):
        task_class(type("Own", (Bare,), {name: value}))
    # A class that also has the hook means what it says, as does a short name or one of its own.
    task_class(type("Own", (Bare,), {name: value, hook: getattr(RobotTask, hook)}))
    task_class(type("Own", (Bare,), {"settled": True, "_" + name: value, "bonus": 1.0}))


@pytest.mark.parametrize(
    ("name", "engine"), [("Stand", "compiled"), ("Push", "compiled"), ("CartPole", "dynx")]
)
def test_a_vector_on_an_engine_that_does_not_run_the_task_names_those_that_do(name: str, engine: str) -> None:
    with pytest.raises(ArgumentError, match=f"^{name} does not run on engine '{engine}'; known: "):
        make_vector_environment(name, 2, engine)
    with pytest.raises(ArgumentError, match="'mujoco' does not step in a compiled kernel; wanted vector"):
        make_vector_environment("Stand", 2, "mujoco")
