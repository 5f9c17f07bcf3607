"""The engines that load files, by name."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

from dynx.errors import BackendError, NotInstalledError, RobotNotFoundError, UnknownBackendError
from dynx.loaded import (
    COMMON_VARIANTS,
    ENGINES,
    VARIANTS,
    LoadedRobot,
    engine_of,
    installed_engines,
    load_as,
    loader_class,
    registry,
)
from dynx.model import Inertial
from dynx.model.loading import load
from tests.backends.robots import chain

PACKAGES = {"drake": "pydrake"}
"""Module names of engines where they differ from the engine's name."""


def test_every_installed_engine_has_a_class_of_its_name() -> None:
    assert "pinocchio" in installed_engines()
    for name in installed_engines():
        kind = loader_class(name)
        assert issubclass(kind, LoadedRobot)
        assert kind.name == name
        assert kind.engine_version()[0].isdigit()
        assert kind.load_call(True) != kind.load_call(False)
        assert all(call.startswith(f"{name}.") for call in kind.CALLS)
    assert set(installed_engines()) <= set(ENGINES)


def test_every_variant_is_another_call_of_its_engine() -> None:
    for name in VARIANTS:
        if engine_of(name) not in installed_engines():
            continue
        kind, engine = loader_class(name), loader_class(engine_of(name))
        assert issubclass(kind, engine)
        assert kind.name == name != engine_of(name)
        assert kind.engine_version() == engine.engine_version()
        assert len({each.load_call(floating) for each in (kind, engine) for floating in (True, False)}) == 4
        assert all(call.startswith(f"{engine_of(name)}.") for call in kind.CALLS)
    assert set(COMMON_VARIANTS) <= set(VARIANTS)
    assert engine_of("pinocchio") == "pinocchio"


LOADERS = [name for name in (*ENGINES, *VARIANTS) if engine_of(name) in installed_engines()]


@pytest.mark.parametrize("name", LOADERS)
def test_a_robot_is_loaded_by_the_engine_of_that_name(name: str, tmp_path: Path) -> None:
    path = tmp_path / "robot.urdf"
    path.write_text(chain(2).to_urdf())
    with load_as(name, path, chain(2)) as robot:
        assert robot.name == robot.describe().engine == name
        assert robot.mass_matrix(chain(2).neutral()).shape == (2, 2)


@pytest.mark.parametrize("name", LOADERS)
def test_a_path_is_text_too(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    model = chain(2)
    (tmp_path / "robot.urdf").write_text(model.to_urdf())
    monkeypatch.chdir(tmp_path)
    q = model.random(0)
    with load_as(name, "robot.urdf", model) as one, load_as(name, tmp_path / "robot.urdf", model) as other:
        assert np.array_equal(one.mass_matrix(q), other.mass_matrix(q))
    for missing in ("robott.urdf", ".", "a\0b"):
        with pytest.raises(RobotNotFoundError, match="wanted the path of a file in URDF"):
            load_as(name, missing, model)


def test_every_installed_engine_can_be_used() -> None:
    """Tests of all installed engines would otherwise leave out one that dynx itself breaks."""
    assert installed_engines() == tuple(name for name in ENGINES if find_spec(PACKAGES.get(name, name)))


# MuJoCo loads no joint that moves nothing.
@pytest.mark.parametrize("name", [name for name in installed_engines() if name != "mujoco"])
def test_a_joint_that_is_held_and_one_that_moves_nothing_have_no_acceleration(
    name: str, tmp_path: Path
) -> None:
    whole = chain(3)
    links = (*whole.links[:-1], replace(whole.links[-1], inertial=Inertial()))
    path = tmp_path / "robot.urdf"
    path.write_text(replace(whole, links=links).to_urdf())
    model = load(str(path), lock={"joint0": 0.0})
    with load_as(name, path, model) as robot:
        assert np.isnan(robot.forward_dynamics(model.neutral(), np.zeros(2), np.ones(2))).all()


def test_an_unknown_engine_is_named_with_the_nearest() -> None:
    with pytest.raises(UnknownBackendError, match=r"no engine 'pinochio'.*did you mean 'pinocchio'"):
        loader_class("pinochio")


def test_a_missing_engine_is_refused_with_its_installation(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pybullet", None)
    with pytest.raises(NotInstalledError, match=r"pip install '\S*\[pybullet\]'"):
        loader_class("pybullet")
    assert "pybullet" not in installed_engines()
    assert "pinocchio" in installed_engines()


def test_an_engine_that_cannot_be_used_is_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(engine: str) -> type[LoadedRobot]:
        raise BackendError(engine)

    monkeypatch.setattr(registry, "loader_class", broken)
    assert installed_engines() == ()


PROGRAM = """
import sys
import dynx.loaded, dynx.loaded.difference
assert not {"pinocchio", "pybullet", "mujoco", "pydrake"} & set(sys.modules), sorted(sys.modules)
"""


def test_importing_the_package_imports_no_engine() -> None:
    run = subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, text=True, timeout=120)
    assert (run.returncode, run.stderr) == (0, "")


def test_an_engine_that_cannot_be_imported_leaves_the_others_usable() -> None:
    program = "from dynx.loaded import installed_engines; print(*installed_engines())"
    environment = {**os.environ, "MUJOCO_GL": "nonsense"}
    done = subprocess.run(
        [sys.executable, "-c", program], env=environment, capture_output=True, check=True, text=True
    )
    assert done.stdout.split() == [name for name in installed_engines() if name != "mujoco"]
