"""The recipe for a world engine: one module and an entry point, in a package of somebody else."""

from __future__ import annotations

import json
from collections.abc import Iterator
from importlib.metadata import entry_points
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from numpy.testing import assert_allclose

import dynx
from dynx import Pose
from dynx.cli.shell.main import cli
from dynx.errors import (
    ArgumentError,
    BackendError,
    UnknownBackendError,
    UnknownNameError,
    UnsupportedFeatureError,
)
from dynx.world import ExternalForce, Scene, World, box, sphere, world_names, write_scene
from tests.architecture.packages import installed_package

MODULE = '''"""Balls that fly through each other, on the exact solution of their equations of motion."""

import numpy as np

from dynx.errors import UnsupportedFeatureError
from dynx.spatial.branchless import quat_exp
from dynx.spatial.so3 import rotation_from_quat
from dynx.steppers.stepper import Stepper
from dynx.steppers.settings import Setting
from dynx.steppers.state import BodyState


class ExactFlight(Stepper):
    name = "exact_flight"
    settings = {"drag": Setting(0.0, "linear drag of the air [1/s]")}

    @classmethod
    def provides(cls, layout):
        return frozenset()

    def __init__(self, layout, dt, settings):
        super().__init__(layout, dt, settings)
        if layout.robots or layout.constraints:
            raise UnsupportedFeatureError("'exact_flight' has no robots and no constraints")
        for body in layout.bodies:
            if body.fixed or np.ptp(np.linalg.eigvalsh(body.inertia)) > 1e-9 or body.center.any():
                raise UnsupportedFeatureError(f"{body.name!r} is no ball, which 'exact_flight' requires")
        self._drag = settings["drag"]
        self._T = np.array([body.T for body in layout.bodies])
        self._twist = np.array([body.twist for body in layout.bodies])
        self._mass = np.array([[body.mass] * 3 + [body.inertia[0, 0]] * 3 for body in layout.bodies])

    def step(self, n, forces):
        wrenches = np.zeros_like(self._mass) if forces.wrenches is None else forces.wrenches
        for _ in range(n):
            a = wrenches / self._mass + np.concatenate([self.layout.gravity, np.zeros(3)])
            h, c = self.dt, self._drag
            if c:
                # v' = a - c v
                self._twist[:, :3] -= a[:, :3] / c
                moved = (1 - np.exp(-c * h)) / c * self._twist[:, :3] + a[:, :3] / c * h
                self._twist[:, :3] = np.exp(-c * h) * self._twist[:, :3] + a[:, :3] / c
            else:
                moved = h * self._twist[:, :3] + 0.5 * h**2 * a[:, :3]
                self._twist[:, :3] += h * a[:, :3]
            self._T[:, :3, 3] += moved
            for T, omega in zip(self._T, h * (self._twist[:, 3:] + 0.5 * h * a[:, 3:])):
                T[:3, :3] = rotation_from_quat(quat_exp(omega)) @ T[:3, :3]
            self._twist[:, 3:] += h * a[:, 3:]

    def robot_state(self, robot):
        raise AssertionError("a scene without robots")

    set_robot_state = robot_state

    def body_state(self, body):
        return BodyState(self._T[body].copy(), self._twist[body].copy())

    def set_body_state(self, body, T, twist):
        self._T[body], self._twist[body] = T, twist

    def dump(self):
        return np.concatenate([self._T.ravel(), self._twist.ravel()]).tobytes()

    def load(self, data):
        T, twist = np.split(np.frombuffer(data).copy(), [self._T.size])
        self._T, self._twist = T.reshape(self._T.shape), twist.reshape(self._twist.shape)

    def contacts(self):
        return []

    @property
    def version(self):
        return "exact_flight 1.0"

    def close(self):
        pass
'''
NAME = "exact_flight"
ENTRY_POINTS = f"[dynx.steppers]\n{NAME} = acme_flight:ExactFlight\n"
DT = 1e-2


@pytest.fixture
def package(tmp_path: Path) -> Iterator[Path]:
    """Yield the folder of the package, which is on the import path."""
    with installed_package(tmp_path, "acme_flight", MODULE, ENTRY_POINTS) as folder:
        yield folder


def balls() -> Scene:
    bodies = (
        sphere("low", 0.1, mass=2.0, twist=(3.0, -1.0, 4.0, 0.0, 0.0, 2.0)),
        sphere("high", 0.2, mass=1.0, pose=Pose((0.0, 0.0, 2.0)), twist=(0, 0, 0, 1.0, 2.0, 3.0)),
    )
    return Scene("balls", bodies=bodies, ignored=[("low", "high")])


@pytest.mark.usefixtures("package")
def test_a_world_finds_it_by_name() -> None:
    assert NAME in world_names()
    with World(balls(), NAME, DT) as world:
        world.run(0.5)
        T, twist = world.state.bodies["low"]
        hits = world.cast_rays([[0.0, 0.0, 5.0]], [[0.0, 0.0, -1.0]])
        top = world.aabb("high")[1][2]
        assert world.contacts() == ()
    assert_allclose(T[:3, 3], [1.5, -0.5, 2.0 - 0.5 * 9.81 * 0.25], atol=1e-12)
    assert_allclose(twist, [3.0, -1.0, 4.0 - 9.81 * 0.5, 0, 0, 2.0], atol=1e-12)
    assert_allclose(T[:2, 0], [np.cos(1.0), np.sin(1.0)], atol=1e-12)
    assert hits.names == ("high",)
    assert hits.points[0, 2] == pytest.approx(top)


@pytest.mark.usefixtures("package")
def test_wrenches_settings_and_saved_states_are_those_of_any_world(tmp_path: Path) -> None:
    with World(balls(), NAME, DT, drag=0.5) as world:
        assert world.settings["drag"] == 0.5
        world.step(10, forces=[ExternalForce("low", (2.0, 0, 0, 0, 0, 0))])
        # v' = a - c v with a = 1, c = 1/2, v(0) = 3 has the limit 2.
        assert world.state.bodies["low"].twist[0] == pytest.approx(2.0 + np.exp(-0.05), abs=1e-12)
        world.write(tmp_path / "world")
        world.step(20)
        expected = world.state.bodies["high"].T_world_body
    with World.read(tmp_path / "world") as again:
        again.step(20)
        assert (again.state.bodies["high"].T_world_body == expected).all()
    with pytest.raises(UnknownNameError, match="did you mean 'drag'"):
        World(balls(), NAME, DT, drga=0.5)
    with pytest.raises(ArgumentError, match="drag"):
        World(balls(), NAME, DT, drag=-1.0)


@pytest.mark.usefixtures("package")
def test_it_is_compared_with_the_engines_of_dynx(tmp_path: Path) -> None:
    comparison = dynx.compare(balls(), [NAME, "pybullet"], duration=0.5, dt=1e-3)
    # Semi-implicit Euler is g t h / 2 below the parabola.
    (apart,) = comparison.separations
    assert apart.distance[-1] == pytest.approx(0.5 * 9.81 * 0.5 * 1e-3, rel=1e-3)
    write_scene(balls(), tmp_path / "balls.json")
    run = CliRunner().invoke(
        cli, ["world", str(tmp_path / "balls.json"), "--engine", f"{NAME},pybullet", "--json"]
    )
    assert run.exit_code == 0, run.output
    assert NAME in json.dumps(json.loads(run.stdout))


@pytest.mark.usefixtures("package")
def test_what_it_cannot_represent_is_refused_by_its_name() -> None:
    brick = box("brick", (0.1, 0.2, 0.3), mass=1.0)
    with pytest.raises(UnsupportedFeatureError, match="'brick' is no ball"):
        World(Scene("s", bodies=(brick,)), NAME)


def test_a_name_that_nobody_provides_is_refused() -> None:
    with pytest.raises(UnknownBackendError, match="pybullet"):
        World(balls(), NAME)


def test_one_of_the_former_group_is_refused_with_the_name_of_the_new_one(tmp_path: Path) -> None:
    former = ENTRY_POINTS.replace("dynx.steppers", "dynx.worlds")
    with installed_package(tmp_path, "acme_flight", MODULE, former):
        assert NAME not in world_names()
        with pytest.raises(BackendError, match=r"dynx\.steppers"):
            World(balls(), NAME)


def test_it_takes_one_module(package: Path) -> None:
    assert [path.name for path in package.glob("*.py")] == ["acme_flight.py"]
    assert NAME in {found.name for found in entry_points(group="dynx.steppers")}
