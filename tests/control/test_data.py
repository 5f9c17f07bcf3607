"""Controllers are data: they compare, print and are copied by what they declare."""

from __future__ import annotations

import pickle
import re
from dataclasses import FrozenInstanceError, dataclass, fields, is_dataclass, replace
from typing import Any

import numpy as np
import pytest

import dynx.control
from dynx.control import (
    PD,
    BulletPositionMotor,
    BulletTorqueMotor,
    ComputedTorque,
    Controller,
    DiscreteComputedTorque,
    Encoders,
    Impedance,
    Measurement,
    MotorLag,
    OperationalSpace,
    Saturated,
)
from dynx.control.base import chain_of, gain, gains_of
from dynx.control.open_loop import OpenLoop
from dynx.model import Model
from dynx.model.loading import load
from dynx.sim import Scenario, simulate, simulate_batch
from dynx.spatial.scalar import Floats
from dynx.trajectory.base import Setpoint
from tests.control.test_controllers import LAWS

ARM = load("ur5")


@dataclass(frozen=True)
class Damper(Controller[None], pure=True):
    """A user's controller, which declares its gain."""

    model: Model
    kd: Floats = gain("N m s/rad")

    def torque(self, measurement: Measurement, setpoint: Setpoint, state: None) -> tuple[Floats, None]:
        return -self.kd * measurement.v, None


class Plain(Controller[None]):
    """A user's controller with attributes of its own."""

    def __init__(self, kd: Any) -> None:
        self.model, self.kd = ARM, kd

    def torque(self, measurement: Measurement, setpoint: Setpoint, state: None) -> tuple[Floats, None]:
        return -self.kd * measurement.v, None


@pytest.mark.parametrize("name", LAWS)
def test_equal_after_a_copy_and_different_in_any_gain(name: str) -> None:
    law: Any = LAWS[name]
    again = pickle.loads(pickle.dumps(law))
    assert again == law
    assert hash(again) == hash(law)
    for changed, values in gains_of(law).items():
        assert replace(law, **{changed: values + 1.0}) != law
    assert law not in [other for key, other in LAWS.items() if key != name]


@pytest.mark.parametrize("name", LAWS)
def test_made_again_from_its_fields(name: str) -> None:
    law: Any = LAWS[name]
    if not isinstance(law, OpenLoop):
        assert replace(law) == law
    with pytest.raises(FrozenInstanceError):
        law.model = ARM


@pytest.mark.parametrize(
    "law",
    [
        *LAWS.values(),
        Encoders(MotorLag(LAWS["pd"], control_dt=1e-3, initial=np.ones(6)), resolution=1e-3, control_dt=1e-3),
        BulletPositionMotor(ARM, force=np.ones(6)),
        OpenLoop(ARM, np.ones((2, 6)), control_dt=1e-3),
    ],
    ids=lambda law: law.name,
)
def test_numbers_of_a_controller_cannot_be_written(law: Controller[Any]) -> None:
    owners = [*chain_of(law), *(each.losses for each in chain_of(law) if hasattr(each, "losses"))]
    arrays = [x for each in owners for x in vars(each).values() if isinstance(x, np.ndarray)]
    assert not any(each.flags.writeable for each in arrays)


@pytest.mark.parametrize("base", ["fixed", "floating"])
def test_a_saturated_controller_is_made_again_on_any_base(base: Any) -> None:
    robot = ARM.with_base(base)
    law = Saturated(PD(robot, kp=1.0, kd=1.0), limit=4.0)
    assert replace(law) == law


def test_the_engine_counts_in_a_comparison() -> None:
    law = ComputedTorque(ARM, kp=400, kd=40)
    assert law != law.on("reference")
    assert law.on("reference") == ComputedTorque(ARM, kp=400, kd=40, backend="reference")
    assert Saturated(law) != Saturated(law.on("reference"))


def test_another_engine_is_passed_on_to_the_inner_controller() -> None:
    law = ComputedTorque(ARM, kp=400, kd=40)
    assert Saturated(law).on("reference") == Saturated(law.on("reference"))
    plain = Saturated(PD(ARM, kp=1.0, kd=1.0))
    assert plain.on("reference") == plain


def test_controllers_of_a_frame_use_the_engine_that_they_are_given() -> None:
    for law in (
        Impedance(ARM, "tool0", stiffness=1.0, damping=1.0, backend="reference"),
        OperationalSpace(ARM, "tool0", kp=1.0, kd=1.0, backend="reference"),
    ):
        assert "backend reference" in repr(law)


def test_a_controller_prints_its_gains_with_units() -> None:
    law = ComputedTorque(ARM, kp=400, kd=[1, 2, 3, 4, 5, 6])
    said = "<ComputedTorque of ur5, backend pinocchio, kp 400 1/s^2, kd [1, 2, 3, 4, 5, 6] 1/s>"
    assert repr(law) == said
    assert repr(Saturated(law, limit=4.0)) == f"<Saturated of ur5, inner {said}, limit 4 N m or N>"
    assert repr(BulletTorqueMotor(law)) == f"<BulletTorqueMotor of ur5, inner {said}>"
    assert "position_gain 0.1" in repr(BulletPositionMotor(ARM))
    assert "control_dt 0.002 s" in repr(DiscreteComputedTorque(ARM, control_dt=0.002))
    assert repr(Plain(2.0)) == "<Plain of ur5>"


FACTOR = r"(?:1|kg|[Nms]|rad)(?:\^2)?"
UNIT = rf"{FACTOR}(?:[ /]{FACTOR}|/\({FACTOR} {FACTOR}\))*"


KINDS = [getattr(dynx.control, name) for name in dynx.control.__all__]


@pytest.mark.parametrize("kind", [kind for kind in KINDS if is_dataclass(kind)])
def test_units_of_parameters_are_products_of_si_units(kind: Any) -> None:
    for each in fields(kind):
        unit = each.metadata.get("unit", "")
        assert unit == "" or re.fullmatch(rf"{UNIT}(?:(?: or |, ){UNIT})*", unit), each.name


def test_a_user_s_dataclass_is_a_controller_like_any_other() -> None:
    law, same, other = (Damper(ARM, np.full(6, kd)) for kd in (5.0, 5.0, 6.0))
    assert law == same
    assert hash(law) == hash(same)
    assert law != other
    assert repr(law) == "<Damper of ur5, kd 5 N m s/rad>"
    assert [each.name for each in fields(law)] == ["model", "kd"]
    rest = ARM.neutral()
    one = simulate(ARM, law, rest, duration=0.3, q0=rest + 0.1)
    plain = simulate(ARM, Plain(5.0), rest, duration=0.3, q0=rest + 0.1)
    np.testing.assert_array_equal(one.q, plain.q)
    many = simulate_batch(ARM, law, rest, gains={"kd": [5.0, 6.0]}, duration=0.05, q0=rest + 0.1)
    same_gains = simulate_batch(ARM, other, rest, rollouts=2, duration=0.05, q0=rest + 0.1)
    np.testing.assert_array_equal(many.q[1], same_gains.q[1])


def test_controllers_with_attributes_of_their_own_compare_by_them() -> None:
    assert Plain(np.ones(6)) == Plain(np.ones(6))
    assert Plain(1.0) != Plain(2.0)
    # Attributes that cannot be compared make it equal to itself alone.
    law = Plain(lambda: 1.0)
    assert law == law
    assert law != Plain(law.kd)
    assert not Plain(1.0).is_pure


class Looped(Plain):
    """A user's controller whose attributes refer to it."""

    def __init__(self, kd: Any) -> None:
        super().__init__(kd)
        self.owner, self.members = self, [self]


def test_a_controller_that_refers_to_itself_is_compared() -> None:
    one, same, other = Looped(1.0), Looped(1.0), Looped(2.0)
    assert one == same
    assert one != other
    scenarios = [Scenario(ARM, each, ARM.neutral(), duration=1e-3) for each in (one, same, other)]
    assert scenarios[0] == scenarios[1]
    assert scenarios[0] != scenarios[2]
    assert simulate(scenarios[0]).scenario == scenarios[0]
