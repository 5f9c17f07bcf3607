"""Controllers go to JSON and back, and programs register their own."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

import dynx
from dynx.control import (
    PD,
    PID,
    BulletPDMotor,
    BulletPositionMotor,
    BulletTorqueMotor,
    BulletVelocityMotor,
    ComputedTorque,
    Controller,
    Encoders,
    FrictionCompensation,
    Measurement,
    MotorLag,
    OpenLoop,
    Saturated,
    controller_from_document,
    controller_to_document,
    register_controller,
    unregister_controller,
)
from dynx.control.base import gain
from dynx.control.registry import BUILT_IN, controller_class, controller_names, from_document, to_document
from dynx.errors import ArgumentError, GainError, UnknownNameError
from dynx.model import Model
from dynx.model.loading import load
from dynx.sim import simulate
from dynx.sim.named_controllers import CONTROLLERS, ControllerRequest, Gains, named_controller
from dynx.spatial.scalar import Floats
from dynx.trajectory.base import Setpoint
from tests.control.test_controllers import LAWS

ARM = load("ur5")
FLOATING = ARM.with_base("floating")
OTHERS: dict[str, Controller[Any]] = {
    "position motor": BulletPositionMotor(ARM, force=5.0),
    "velocity motor": BulletVelocityMotor(ARM),
    "pd motor": BulletPDMotor(ARM, kp=3.0, kd=1.0),
    "torque motor": BulletTorqueMotor(ComputedTorque(ARM, kp=4.0, kd=1.0, backend="reference")),
    "of the description": FrictionCompensation(PD(ARM, kp=1.0, kd=1.0), speed="setpoint"),
    "motor lag": MotorLag(
        PID(ARM, kp=1.0, ki=1.0, kd=1.0, control_dt=1e-3),
        control_dt=1e-3,
        time_constant=2e-3,
        delay=3e-3,
        initial=np.arange(6.0),
    ),
    "encoders": Encoders(PD(ARM, kp=1.0, kd=1.0), resolution=1 / 3, control_dt=1e-3),
    "table": OpenLoop(ARM, np.arange(12.0).reshape(2, 6) / 3, control_dt=1e-3),
    "floating": Saturated(PD(FLOATING, kp=1.0, kd=1.0), limit=4.0),
    "floating pid": PID(FLOATING, kp=1 / 3, ki=1.0, kd=1.0, control_dt=1e-3, limit=np.inf),
}


@dataclass(frozen=True)
class Damper(Controller[None], pure=True):
    """A damper on every joint.

    It has one gain.
    """

    model: Model
    kd: Floats = gain("N m s/rad")

    def torque(self, measurement: Measurement, setpoint: Setpoint, state: None) -> tuple[Floats, None]:
        return -self.kd * measurement.v, None


@pytest.fixture
def damper() -> Iterator[str]:
    register_controller("damper", lambda: Damper)
    yield "damper"
    unregister_controller("damper")


@pytest.mark.parametrize("name", [*LAWS, *OTHERS])
def test_to_json_and_back(name: str) -> None:
    law = {**LAWS, **OTHERS}[name]
    document = json.dumps(controller_to_document(law), allow_nan=False)
    assert controller_from_document(law.model, json.loads(document)) == law


def test_every_controller_of_dynx_is_in_the_table() -> None:
    assert {type(law).__name__ for law in [*LAWS.values(), *OTHERS.values()]} == set(BUILT_IN)
    assert controller_class("PD") is PD
    assert controller_names()[: len(BUILT_IN)] == tuple(BUILT_IN)


def test_a_registered_controller_has_a_document_and_a_name(damper: str) -> None:
    law = Damper(ARM, np.full(6, 5.0))
    document = controller_to_document(Saturated(law, limit=3.0))
    assert document == {
        "controller": "Saturated",
        "inner": {"controller": "damper", "kd": [5.0] * 6},
        "limit": [3.0] * 6,
    }
    assert controller_from_document(ARM, document) == Saturated(law, limit=3.0)
    assert CONTROLLERS[damper].what == "A damper on every joint"
    request = ControllerRequest(ARM, ARM.neutral(), 1e-3, Gains(kd=np.full(6, 5.0)))
    made = named_controller(damper, request)
    assert made == law
    assert len(simulate(ARM, made, ARM.neutral(), duration=0.01)) == 10
    with pytest.raises(GainError, match="takes no kp; it takes kd"):
        named_controller(damper, ControllerRequest(ARM, ARM.neutral(), 1e-3, Gains(kp=1.0)))
    with pytest.raises(GainError, match=r"Damper cannot be made: .*'kd'"):
        named_controller(damper, ControllerRequest(ARM, ARM.neutral(), 1e-3))


def test_what_has_no_document() -> None:
    with pytest.raises(ArgumentError, match="Damper cannot be written: wanted a frozen dataclass"):
        controller_to_document(Damper(ARM, np.ones(6)))
    documents: list[tuple[dict[str, Any], str]] = [
        ({"controller": "PD", "kp": 1.0}, "PD needs kd="),
        ({"controller": "pd", "kp": 1.0}, "no controller 'pd'; did you mean"),
        ({"kp": 1.0}, "lacks the name of its controller"),
    ]
    for document, says in documents:
        with pytest.raises(ArgumentError, match=says):
            controller_from_document(ARM, document)
    with pytest.raises(UnknownNameError, match="damper"):
        unregister_controller("damper")
    with pytest.raises(ArgumentError, match="is taken"):
        register_controller("PD", lambda: Damper)


def test_an_engine_is_written_by_its_name() -> None:
    with dynx.backend("pinocchio", ARM) as engine:
        law = ComputedTorque(ARM, kp=400, kd=40, backend=engine)
        named = ComputedTorque(ARM, kp=400, kd=40, backend="pinocchio")
        assert controller_to_document(law) == controller_to_document(named)


def test_a_table_of_torques_is_written_with_the_arguments_of_its_constructor() -> None:
    model = load("pendulum")
    table = OpenLoop(model, [[1.0], [2.0]], control_dt=0.01)
    document = to_document(table)
    assert document.keys() == {"controller", "torques", "control_dt"}
    assert to_document(from_document(model, document)) == document
