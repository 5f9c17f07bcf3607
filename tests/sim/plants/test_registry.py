"""A plant of somebody else's runs under its name like those of dynx."""

from __future__ import annotations

from collections.abc import Iterator
from importlib.metadata import EntryPoint, EntryPoints

import numpy as np
import pytest
from click.testing import CliRunner

import dynx.registry as shared_registry
from dynx.cli.shell.main import cli
from dynx.control import BulletPositionMotor
from dynx.errors import (
    ArgumentError,
    BackendError,
    DivergedError,
    EngineError,
    SimulationError,
    UnknownBackendError,
    UnsupportedFeatureError,
)
from dynx.model import Model
from dynx.model.loading import load
from dynx.sim import Plant, StepResult, register_plant, simulate
from dynx.sim.plants import registry
from dynx.sim.plants.disturbances import Disturbances
from dynx.spatial.scalar import Floats

PENDULUM = load("pendulum")


class Drifting(Plant):
    """Moves at a constant velocity, whatever the torque."""

    def __init__(self, model: Model, disturbances: Disturbances, dt: float, *, substeps: int = 1) -> None:
        super().__init__(model, disturbances, dt, substeps=substeps)
        self.closed = False

    def reset(self, q: Floats, v: Floats) -> None:
        self._q, self._v = q, v

    def step(self, t: float, tau: Floats) -> StepResult:
        self._q = self._q + self.dt * self._v
        return StepResult(self._q, self._v, 0.0 * self._v, tau)

    def close(self) -> None:
        self.closed = True


@pytest.fixture
def drifting() -> Iterator[str]:
    register_plant("drifting", lambda: Drifting)
    yield "drifting"
    registry.unregister("drifting")


def _assert_drifts(plant: str) -> None:
    found = simulate(PENDULUM, v0=[2.0], plant=plant, duration=0.1, dt=1e-2)
    assert np.allclose(found.q[:, 0], 2.0 * found.t)
    assert found.settings["integrator"] == "engine"


def test_a_registered_plant_is_simulated_by_its_name(drifting: str) -> None:
    assert drifting in registry.plant_names()
    _assert_drifts(drifting)


def test_an_entry_point_adds_a_plant(monkeypatch: pytest.MonkeyPatch) -> None:
    points = EntryPoints([EntryPoint("theirs", f"{__name__}:Drifting", registry.GROUP)])
    monkeypatch.setattr(shared_registry, "installed_entry_points", lambda group: points.select(group=group))
    assert registry.plant_names() == ("theirs",)
    _assert_drifts("theirs")


@pytest.mark.parametrize("taken", ["pybullet", "pinocchio", "drifting"])
def test_a_plant_is_never_replaced(drifting: str, taken: str) -> None:
    with pytest.raises(ArgumentError, match=f"'{taken}' is taken"):
        register_plant(taken, lambda: Drifting)


def test_only_a_plant_that_takes_a_motor_command_gets_it(drifting: str) -> None:
    with pytest.raises(UnsupportedFeatureError, match="own stepper"):
        simulate(PENDULUM, BulletPositionMotor(PENDULUM), [0.1], plant=drifting, duration=0.1)


def test_a_class_that_is_no_plant_is_refused() -> None:
    register_plant("odd", lambda: dict)  # type: ignore[arg-type, return-value]
    try:
        with pytest.raises(BackendError, match=r"the plant 'odd'.*no subclass of dynx\.Plant"):
            simulate(PENDULUM, plant="odd", duration=0.1)
    finally:
        registry.unregister("odd")


def test_a_name_that_nobody_provides_is_an_error() -> None:
    with pytest.raises(UnknownBackendError, match="pinochio"):
        simulate(PENDULUM, plant="pinochio", duration=0.1)
    with pytest.raises(ArgumentError, match="no stepper here; those that have one: pybullet"):
        simulate(PENDULUM, plant="pinocchio", integrator="engine", duration=0.1)


def test_an_error_of_a_plant_is_not_called_a_divergence() -> None:
    class Broken(Drifting):
        def step(self, t: float, tau: Floats) -> StepResult:
            if t > 0.045:
                raise ZeroDivisionError("no wind")
            return super().step(t, tau)

    register_plant("broken", lambda: Broken)
    try:
        with pytest.raises(SimulationError, match=r"plant Broken failed in step 5.*ZeroDiv.*wind") as caught:
            simulate(PENDULUM, plant="broken", duration=0.1, dt=1e-2)
        assert not isinstance(caught.value, DivergedError)
        assert len(caught.value.rollout) == 5
    finally:
        registry.unregister("broken")


@pytest.mark.parametrize(("method", "verb"), [("__init__", "made"), ("reset", "reset"), ("close", "closed")])
def test_an_error_outside_a_step_names_the_class_of_the_plant(method: str, verb: str) -> None:
    def broken(*_: object, **__: object) -> None:
        raise ZeroDivisionError("no wind")

    register_plant("broken", lambda: type("Broken", (Drifting,), {method: broken}))
    try:
        with pytest.raises(EngineError, match=rf"plant Broken cannot be {verb}: ZeroDiv.*wind") as caught:
            simulate(PENDULUM, plant="broken", duration=0.1, dt=1e-2)
        assert isinstance(caught.value.__cause__, ZeroDivisionError)
    finally:
        registry.unregister("broken")


def test_the_command_line_simulates_a_plant_by_its_name(drifting: str) -> None:
    passive = ["sim", "pendulum", "--v0", "2", "--controller", "none", "--json", "--plant"]
    found = CliRunner().invoke(cli, [*passive, drifting])
    assert found.exit_code == 0, found.output
    found = CliRunner().invoke(cli, [*passive, "drift"])
    assert found.exit_code != 0
    assert "no plant 'drift'; did you mean 'drifting'" in found.output


def test_a_plant_with_a_stepper_takes_no_integrator_of_dynx(drifting: str) -> None:
    with pytest.raises(ArgumentError, match="has a stepper of its own, which is integrator='engine'"):
        simulate(PENDULUM, plant=drifting, integrator="rk4", duration=0.1)


def test_a_plant_that_does_not_exist_is_refused_as_a_plant() -> None:
    with pytest.raises(UnknownBackendError, match="no plant 'pinochio'; did you mean 'pinocchio'"):
        registry.require_plant("pinochio")
