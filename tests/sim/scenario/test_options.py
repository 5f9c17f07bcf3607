"""Options of a simulation: one declaration, from which signatures, checks and defaults follow."""

from __future__ import annotations

import inspect
import math
from dataclasses import dataclass, fields, replace
from functools import partial
from typing import Any

import numpy as np
import pytest

import dynx
from dynx import control
from dynx.errors import ArgumentError, LimitError, UnknownNameError
from dynx.model import JointDynamics
from dynx.rbd.parameters import Payload
from dynx.sim import Scenario, Simulation, simulate, simulate_batch
from dynx.sim.scenario.options import OPTIONS, SimulationOptions, option, options_of, takes
from dynx.world import Imu
from tests.sim.rigid_bodies import RIGID_BODIES

ARM = dynx.load("pendulum")


@pytest.mark.parametrize("function", [simulate, simulate_batch, Scenario])
def test_signatures_have_every_option_with_its_default(function: Any) -> None:
    parameters = inspect.signature(function).parameters
    assert list(parameters)[:3] == ["model", "controller", "reference"]
    for name, declared in OPTIONS.items():
        assert parameters[name].kind is inspect.Parameter.KEYWORD_ONLY
        if (function, name) != (simulate_batch, "plant"):
            assert parameters[name].default == declared.default
    assert {each.name for each in fields(Scenario)} == {"model", "controller", "reference", *OPTIONS}


def test_docstrings_list_every_option() -> None:
    for function in (simulate, simulate_batch):
        text = inspect.getdoc(function) or ""
        for each in options_of(SimulationOptions):
            assert f"- `{each.name}`: " in text
            assert each.unit in text


def test_type_checkers_refuse_what_the_functions_refuse() -> None:
    """Each comment below is an error of mypy if the call has none."""
    with pytest.raises(TypeError, match="simulate: missing a required argument: 'model'"):
        simulate()  # type: ignore[call-arg]
    with pytest.raises(
        UnknownNameError, match="simulate has no option 'joint_damqing'; did you mean 'joint_damping'"
    ):
        simulate(ARM, joint_damqing=1.0)  # type: ignore[call-arg]
    with pytest.raises(ArgumentError, match=r"dt is '0\.001'"):
        simulate(ARM, duration=0.01, dt="0.001")  # type: ignore[arg-type]
    with pytest.raises(UnknownNameError, match="simulate_batch has no option 'rolouts'"):
        simulate_batch(ARM, rolouts=2)  # type: ignore[call-arg]
    with pytest.raises(ArgumentError, match=r"noise is '0\.1'"):
        Scenario(ARM, noise=0.1)  # type: ignore[arg-type]
    with pytest.raises(TypeError):
        simulate(ARM, None, None, "pinocchio")  # type: ignore[call-arg]


def test_an_option_beside_a_scenario_is_refused_by_name() -> None:
    scenario = Scenario(ARM, duration=0.01)
    with pytest.raises(ArgumentError, match="substeps is given in addition to a scenario"):
        simulate(scenario, substeps=2)
    with pytest.raises(ArgumentError, match="controller_backend is given in addition to a scenario"):
        simulate(scenario, controller_backend="reference")
    assert len(simulate(scenario, dt=1e-3, pushes=())) == 10


def test_a_scenario_keeps_values_in_one_form() -> None:
    scenario = Scenario(
        ARM, dt=np.float64(2e-3), atol=1, joint_damping=[1], payload=None, mass_scale={"b": 2.0, "a": 1.0}
    )
    assert (type(scenario.dt), type(scenario.atol)) == (float, float)
    assert isinstance(scenario.joint_damping, np.ndarray)
    assert not scenario.joint_damping.flags.writeable
    assert scenario.payload == ()
    assert list(scenario.mass_scale) == ["a", "b"]  # type: ignore[arg-type]
    with pytest.raises(ArgumentError, match="joint_limits is '1'; wanted True or False"):
        Scenario(ARM, joint_limits=1)  # type: ignore[arg-type]
    with pytest.raises(ArgumentError, match="joint_friction is None"):
        Scenario(ARM, joint_friction=None)  # type: ignore[arg-type]


def test_takes_gives_a_function_the_signature_of_a_dataclass() -> None:
    @dataclass(frozen=True)
    class Arguments:
        size: int
        rate: float = option(2.0, "Rate, as measured", unit="1/s", group="")

    @takes(Arguments)
    def product(given: Arguments) -> float:
        """Multiply."""
        return given.size * given.rate

    assert product(3) == 6.0
    assert product(size=3, rate=1.0) == 3.0
    assert str(inspect.signature(product)) == "(size: 'int', rate: 'float' = 2.0) -> 'float'"
    item = "- `rate`: Rate [1/s], as measured (default: 2)"
    assert inspect.getdoc(product) == f"Multiply.\n\nOptions:\n\n{item}"


@pytest.mark.parametrize("slip", ["much", None, [1.0], -1.0, 1e-30, math.inf, 10**5000, True], ids=type)
def test_an_invalid_slip_speed_says_what_is_wanted(slip: Any) -> None:
    with pytest.raises(ArgumentError, match=r"friction_slip is .*wanted a speed: 0, or 1e-09 or more"):
        simulate(ARM, joint_friction=0.1, friction_slip=slip, duration=0.01)


@pytest.mark.parametrize("name", [name for name, each in OPTIONS.items() if each.needs[0]])
def test_an_option_without_effect_is_refused_by_name_where_it_would_be_simulated(name: str) -> None:
    other, wanted = OPTIONS[name].needs
    given = {"method": "RK45"}.get(name, 1e-3)
    law = control.PD(ARM, kp=1.0, kd=1.0)
    options: dict[str, Any] = RIGID_BODIES | {name: given}
    scenario = Scenario(ARM, law, ARM.neutral(), duration=0.01, plant="compiled", **options)
    # A file of an earlier version may have it.
    assert getattr(Scenario.from_json(scenario.to_json()), name) == given
    needed = f"{other}={wanted!r}" if wanted else other
    runs: tuple[Any, ...] = (simulate, Simulation, partial(simulate_batch, q0=np.zeros((2, ARM.nq))))
    for run in runs:
        with pytest.raises(ArgumentError, match=f"{name} is given, and has no effect without {needed}"):
            run(scenario)
    effect: dict[str, Any] = {other: wanted or [1e-3] * ARM.nv}
    assert len(simulate(replace(scenario, **effect))) == 10


def test_a_friction_of_each_rollout_makes_its_slip_effective() -> None:
    law = control.PD(ARM, kp=1.0, kd=1.0)
    scenario = Scenario(ARM, law, ARM.neutral(), duration=0.01, plant="compiled", friction_slip=0.1)
    assert simulate_batch(scenario, joint_friction=np.full((2, ARM.nv), 1e-3)).done.all()


SPRING = JointDynamics(stiffness=2.0, spring_reference=0.4)
TWO_LINKS = dynx.load("planar_2r")
TWO_LINKS = replace(TWO_LINKS, joints=tuple(replace(each, dynamics=SPRING) for each in TWO_LINKS.joints))
TIP = TWO_LINKS.frame_names[-1]
OTHERS: dict[str, Any] = {
    "plant": "mujoco",
    "integrator": "rk4",
    "substeps": 3,
    "method": "RK23",
    "rtol": 1e-3,
    "atol": 1e-2,
    "dt": 2e-3,
    "duration": 0.02,
    "control_dt": 5e-3,
    "delay": 3e-3,
    "q0": [0.1, 0.2],
    "v0": [1.0, 0.0],
    "noise": dynx.Noise(q=0.1),
    "joint_damping": 0.3,
    "joint_friction": 0.3,
    "friction_slip": 0.1,
    "joint_armature": 0.3,
    "joint_springs": False,
    "effort_limits": 0.1,
    "joint_limits": False,
    "payload": Payload(TIP, 1.0),
    "mass_scale": 2.0,
    "pushes": dynx.ExternalForce(TIP, [5.0, 0.0, 5.0, 0.0, 0.0, 0.0]),
    "sensors": Imu("imu", TIP),
    "check_reference": False,
}
"""Another value of each option."""


@pytest.mark.parametrize("plant", ["reference", "compiled"])
@pytest.mark.parametrize("name", OPTIONS)
def test_every_option_changes_what_is_recorded(name: str, plant: str) -> None:
    law = control.PD(TWO_LINKS, kp=20.0, kd=1.0)
    # The second joint soon reaches its limit, from where the others start.
    start = [0.3, float(TWO_LINKS.upper[1]) - 1e-3]
    options: dict[str, Any] = {"plant": plant, "duration": 0.05, "q0": start, "v0": [0.5, 2.0]}
    needed, wanted = OPTIONS[name].needs
    if needed:
        options[needed] = wanted or 0.2
    reference = np.array([4.0, 0.0]) if name == "check_reference" else TWO_LINKS.neutral()

    def record(**given: Any) -> Any:
        try:
            found = simulate(TWO_LINKS, law, reference, **{**options, **given})
        except LimitError:
            return "refused"
        return [x.tobytes() for x in (found.t, found.q, found.v, found.tau)], len(found.sensors)

    assert record(**{name: OTHERS[name]}) != record()
