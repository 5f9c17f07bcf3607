"""Numbers of a description have the bound of q, v and a; masked arrays are refused wherever arrays enter."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import suppress
from typing import Any

import numpy as np
import pytest

from dynx import ExternalForce, trajectory
from dynx.backends import backend
from dynx.control import PD, OpenLoop, Saturated
from dynx.errors import ArgumentError, DescriptionError, DTypeError, DynxError, SingularMassMatrixError
from dynx.model import Inertial, Joint, JointDynamics, Limits, Link, Mimic, Model, Pose
from dynx.model.loading import load
from dynx.model.numbers import MAX_MAGNITUDE
from dynx.sim import Noise, Payload, Scenario, simulate, simulate_batch

LARGE = 0.9 * MAX_MAGNITUDE
PLACES = ("origin", "angle", "mass", "moment", "center", "damping", "friction", "multiplier", "offset")


def robot(**numbers: float) -> str:
    """Return three links on two joints, the second of which follows the first, with other numbers."""
    at = {**dict.fromkeys(PLACES, 0.1), **numbers}
    moments = " ".join(f'{name}="{at["moment"]}"' for name in ("ixx", "iyy", "izz"))
    inertial = (
        f'<inertial><origin xyz="{at["center"]} 0 0"/><mass value="{at["mass"]}"/>'
        f'<inertia {moments} ixy="0" ixz="0" iyz="0"/></inertial>'
    )
    mimic = f'<mimic joint="j1" multiplier="{at["multiplier"]}" offset="{at["offset"]}"/>'
    links = "".join(f'<link name="l{k}">{inertial}</link>' for k in range(3))
    joints = "".join(
        f'<joint name="j{k}" type="continuous"><origin xyz="{at["origin"]} 0 0" rpy="{at["angle"]} 0 0"/>'
        f'<parent link="l{k - 1}"/><child link="l{k}"/><axis xyz="0 1 0"/>'
        f'<dynamics damping="{at["damping"]}" friction="{at["friction"]}"/>{more}</joint>'
        for k, more in ((1, ""), (2, mimic))
    )
    return f'<robot name="r">\n{links}{joints}</robot>'


@pytest.mark.parametrize("place", PLACES)
@pytest.mark.parametrize("value", [MAX_MAGNITUDE, -1e300, 1e300])
def test_a_number_of_a_file_beyond_the_bound_is_refused_with_its_line(place: str, value: float) -> None:
    if place == "mass":
        value = abs(value)
    with pytest.raises(DescriptionError, match=r"<string>:2: .*wanted less than 1e\+60 in magnitude"):
        load(robot(**{place: value}))


@pytest.mark.parametrize("name", ["reference", "compiled", "pinocchio", "pybullet", "mujoco", "drake"])
@pytest.mark.parametrize(
    "places", [*((place,) for place in PLACES), ("origin", "mass"), ("origin", "mass", "moment", "center")]
)
def test_numbers_within_the_bound_overflow_in_no_engine(name: str, places: tuple[str, ...]) -> None:
    model = load(robot(**dict.fromkeys(places, LARGE)))
    q, v, a = np.array([[0.3], [-0.7], [1.1]])
    try:
        engine = backend(name, model)
    except DynxError:
        return
    with engine:
        results = [engine.inverse_dynamics(q, v, a), engine.mass_matrix(q), engine.forward_kinematics(q)]
        with suppress(SingularMassMatrixError):
            results.append(engine.forward_dynamics(q, v, a))
    assert all(np.isfinite(each).all() for each in results)


@pytest.mark.parametrize(
    "parts",
    [
        {"inertial": Inertial(mass=math.nan)},
        {"inertial": Inertial(mass=1.0, izz=math.inf)},
        {"inertial": Inertial(mass=1.0, origin=Pose((1e300, 0.0, 0.0)))},
        {"origin": Pose((0.0, 0.0, 0.0), (math.nan, 0.0, 0.0))},
        {"axis": (math.nan, 0.0, 0.0)},
        {"dynamics": JointDynamics(armature=1e61)},
        {"mimic": Mimic("i", 1e61)},
    ],
)
def test_a_model_that_a_program_builds_has_the_same_bound(parts: dict[str, Any]) -> None:
    links = [Link("a"), Link("b"), Link("c", parts.pop("inertial", None))]
    joints = [Joint("i", "continuous", "a", "b"), Joint("j", "continuous", "b", "c", **parts)]
    with pytest.raises(DescriptionError, match=r"wanted a number below 1e\+60 in magnitude"):
        Model.build("r", links, joints)


def test_products_of_numbers_have_the_bound_too() -> None:
    text = robot(multiplier=1e40).replace(
        "</robot>",
        '<link name="l3"/><joint name="j3" type="continuous"><parent link="l2"/><child link="l3"/>'
        '<mimic joint="j2" multiplier="1e40"/></joint></robot>',
    )
    with pytest.raises(DescriptionError, match="multiplier"):
        load(text)
    with pytest.raises(DescriptionError, match="locked position"):
        load("ur5", lock={"elbow_joint": 1e300})


def test_limits_beyond_the_bound_are_unlimited() -> None:
    def limits(text: str) -> tuple[Limits, list[str]]:
        model = load(
            '<robot name="r"><link name="a"/><link name="b"/><joint name="j" type="revolute">'
            f'<parent link="a"/><child link="b"/><limit {text}/></joint></robot>'
        )
        return model.joints[0].limits, [str(note) for note in model.notes if "unlimited" in str(note)]

    found, notes = limits('lower="-1e300" upper="1e60" velocity="1e100" effort="1.7976931348623157e308"')
    assert found == Limits()
    assert len(notes) == 3
    for both in ('lower="1e300" upper="1e308"', 'lower="-1e300" upper="-1e300"'):
        with pytest.raises(DescriptionError, match="both limits"):
            limits(f'{both} velocity="1" effort="1"')


UR5 = load("ur5")
MASKED = np.ma.array(np.zeros(6), mask=[False, True, *[False] * 4])
MOTION = trajectory.cycloidal(np.zeros(6), np.full(6, 0.01), duration=0.01)


@pytest.mark.parametrize("name", ["reference", "compiled", "pinocchio", "pybullet", "mujoco", "drake"])
@pytest.mark.parametrize("batch", [(), (1,), (64,)])
def test_no_backend_drops_a_mask(name: str, batch: tuple[int, ...]) -> None:
    try:
        engine = backend(name, UR5)
    except DynxError:
        pytest.skip(f"{name} is not installed")
    plain = np.zeros((*batch, 6))
    masked = np.ma.array(plain, mask=np.eye(6, dtype=bool)[0] | np.zeros((*batch, 6), dtype=bool))
    with engine:
        for arguments in ((masked, plain, plain), (plain, masked, plain), (plain, plain, masked)):
            for evaluate in (engine.inverse_dynamics, engine.forward_dynamics):
                with pytest.raises(DTypeError, match="is a masked array"):
                    evaluate(*arguments)
        for call in (engine.mass_matrix, engine.forward_kinematics, engine.center_of_mass):
            with pytest.raises(DTypeError, match="q is a masked array"):
                call(masked)


@pytest.mark.parametrize(
    "call",
    [
        lambda: backend("reference", UR5).inverse_dynamics(MASKED, np.zeros(6), np.zeros(6)),
        lambda: backend("reference", UR5).mass_matrix([MASKED, MASKED]),
        lambda: backend("compiled", UR5).inverse_dynamics(MASKED[None], np.zeros((1, 6)), np.zeros((1, 6))),
        lambda: backend("reference", UR5).inverse_kinematics(MASKED[:3], "tool0"),
        lambda: UR5.integrate(np.zeros(6), MASKED),
        lambda: load("ur5", gravity=MASKED[:3]),
        lambda: UR5.with_frame("f", "tool0", np.ma.array(np.eye(4))),
        lambda: trajectory.cycloidal(np.zeros(6), MASKED, duration=1.0),
        lambda: MOTION(MASKED),
        lambda: OpenLoop(UR5, MASKED[None], control_dt=1e-3),
        lambda: PD(UR5, kp=MASKED, kd=1.0),
        lambda: Saturated(PD(UR5, kp=1.0, kd=1.0), limit=MASKED),
        lambda: Noise(q=MASKED).deviations(6),
        lambda: Payload("tool0", 1.0, MASKED[:3]),
        lambda: Payload("tool0", 1.0, inertia=np.ma.array(np.eye(3))),
        lambda: ExternalForce("tool0", MASKED).checked(UR5),
        lambda: Scenario(UR5, q0=MASKED),
        lambda: simulate(UR5, PD(UR5, kp=1.0, kd=1.0), MASKED, duration=0.01),
        lambda: simulate(UR5, PD(UR5, kp=1.0, kd=1.0), MOTION, joint_friction=MASKED),
        lambda: simulate_batch(UR5, PD(UR5, kp=1.0, kd=1.0), MOTION, gains={"kp": MASKED}),
        lambda: simulate_batch(UR5, PD(UR5, kp=1.0, kd=1.0), MOTION, joint_friction=MASKED),
        lambda: simulate_batch(UR5, PD(UR5, kp=1.0, kd=1.0), MOTION, q0=MASKED),
    ],
)
def test_masked_arrays_are_refused(call: Callable[[], object]) -> None:
    with pytest.raises(ArgumentError, match="is a masked array; wanted an array without a mask") as caught:
        call()
    assert isinstance(caught.value, DTypeError) or "Gain" in type(caught.value).__name__
