"""Generalised forces of the actuators of a description: those of MuJoCo, and of its steps in worlds."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import dynx
from dynx import control
from dynx.agreement.tolerances import BAR
from dynx.errors import ArgumentError, NotFiniteError, ShapeError
from dynx.model import Joint, Link, Model
from dynx.model.actuation import Actuation, actuation_of
from dynx.model.stated_parts import Actuator
from dynx.spatial.scalar import Floats
from dynx.world import Scene, SceneRobot, World, read_scene
from tests.model.mjcf.test_actuators import actuator_elements, compiled, document, numbers, positive

BASE = '<joint name="j" ref="20" LIMIT/>'
SCENE = """<mujoco>
  <worldbody>
    <body name="a"><joint name="j"/><geom size="0.1"/></body>
    <body name="b" pos="0 0 1"><joint name="k"/><geom size="0.1"/></body>
  </worldbody>
  <tendon>
    <fixed name="one"><joint joint="j" coef="2"/></fixed>
    <fixed name="two"><joint joint="j" coef="1"/><joint joint="k" coef="1"/></fixed>
  </tendon>
  <actuator>
    <motor name="m" joint="k"/><position name="p" tendon="one" kp="3"/><motor name="w" tendon="two"/>
  </actuator>
</mujoco>"""
SERVOS = """<mujoco>
  <option timestep="0.002" integrator="INTEGRATOR"/>
  <worldbody>
    <body name="a" pos="0 0 1"><joint name="j" axis="0 1 0" damping="0.2" armature="0.01"/>
      <geom type="capsule" fromto="0 0 0 0.4 0 0" size="0.04"/>
      <body name="b" pos="0.4 0 0"><joint name="k" axis="0 1 0" damping="0.1"/>
        <geom type="capsule" fromto="0 0 0 0.3 0 0" size="0.03"/>
      </body>
    </body>
  </worldbody>
  <actuator><position joint="j" kp="200" kv="20"/><position joint="k" kp="100" kv="5"/></actuator>
</mujoco>"""
KV = (20.0, 5.0)


@st.composite
def texts(draw: st.DrawFn) -> str:
    """Draw a robot with actuators on its joints and on a tendon, all of which may be limited."""
    limit = f'actuatorfrcrange="-{(most := draw(positive))} {most}"' if draw(st.booleans()) else ""
    ends = f'actuatorfrcrange="-{draw(positive)} {draw(positive)}"' if draw(st.booleans()) else ""
    terms = "".join(f'<joint joint="{each}" coef="{draw(numbers)}"/>' for each in ("j", "l"))
    elements = [draw(actuator_elements(name)) for name in ("p", "q", "r", "s")]
    pulled = [each for each in range(4) if draw(st.booleans()) and "inheritrange" not in elements[each]]
    for each in pulled:
        elements[each] = elements[each].replace("joint=", "NOT=")
    actuators = "".join(elements)
    for joint in "jkl":
        actuators = actuators.replace(f'NOT="{joint}"', 'tendon="t"')
    sections = f'<tendon><fixed name="t" {ends}>{terms}</fixed></tendon><actuator>{actuators}</actuator>'
    return document(sections, base=BASE.replace("LIMIT", limit))


def state(seed: int) -> tuple[Floats, Floats, Floats]:
    rng = np.random.default_rng(seed)
    return rng.uniform(-20.0, 20.0, 4), rng.uniform(-2.0, 2.0, 3), rng.uniform(-2.0, 2.0, 3)


def of_mujoco(engine: Any, ctrl: Floats, q: Floats, v: Floats) -> Floats:
    mujoco = pytest.importorskip("mujoco")
    data = mujoco.MjData(engine)
    data.ctrl[:], data.qpos[:], data.qvel[:] = ctrl, q, v
    mujoco.mj_fwdPosition(engine, data)
    mujoco.mj_fwdVelocity(engine, data)
    mujoco.mj_fwdActuation(engine, data)
    return np.array(data.qfrc_actuator)


def magnitude(arrays: Actuation, ctrl: Floats, q: Floats, v: Floats) -> float:
    """Return the sum of all terms of the forces, times that by which limited tendons enlarge rounding."""
    lengths = (abs(q) @ abs(arrays.positions.T) + abs(arrays.offsets)) @ abs(arrays.moments)
    rates = abs(v) @ abs(arrays.velocities.T) @ abs(arrays.moments)
    constant, by_length, by_rate = abs(arrays.bias)
    terms = abs(arrays.gain * ctrl) + constant + by_length * lengths + by_rate * rates
    shares = [1.0 + terms.sum() / min(-low, high) for _, (low, high) in arrays.tendons]
    return 1.0 + float(terms @ abs(arrays.moments).sum(axis=0)) * float(np.prod(shares))


@given(texts(), st.integers(0, 2**32))
def test_forces_are_those_of_mujoco(text: str, seed: int) -> None:
    model, (ctrl, q, v) = dynx.load(text), state(seed)
    own = model.actuator_forces(ctrl, q, v)
    bound = BAR * magnitude(actuation_of(model), ctrl, q, v)
    np.testing.assert_allclose(own, of_mujoco(compiled(text), ctrl, q, v), rtol=0.0, atol=bound)
    floating = model.with_base("floating").actuator_forces(
        ctrl, np.r_[np.zeros(6), 1.0, q], np.r_[np.ones(6), v]
    )
    np.testing.assert_array_equal(floating, np.r_[np.zeros(6), own])


GYMNASIUM = ["ant", "half_cheetah", "hopper", "humanoid", "inverted_pendulum", "pusher_v5", "reacher"]
GYMNASIUM += ["swimmer", "walker2d_v5"]


@pytest.mark.parametrize("name", GYMNASIUM)
def test_forces_of_robots_of_gymnasium_are_those_of_mujoco(name: str) -> None:
    folder = Path(str(pytest.importorskip("gymnasium").__file__)).parent / "envs/mujoco/assets"
    text = (folder / f"{name}.xml").read_text()
    model, engine, rng = dynx.load(text), compiled(text), np.random.default_rng(0)
    for _ in range(5):
        q, v, ctrl = model.random(rng), rng.normal(size=model.nv), rng.normal(size=engine.nu)
        qpos = np.r_[q[:3], q[6], q[3:6], q[7:]] if model.floating else q
        wanted = of_mujoco(engine, ctrl, qpos, v)
        np.testing.assert_allclose(model.actuator_forces(ctrl, q, v), wanted, rtol=BAR)


@given(texts(), st.integers(0, 2**32), st.floats(-1.0, 1.0))
def test_a_locked_joint_keeps_the_lengths_of_tendons(text: str, seed: int, locked: float) -> None:
    ctrl, q, v = state(seed)
    q[2], v[2] = locked, 0.0
    whole = dynx.load(text).actuator_forces(ctrl, q, v)
    part = dynx.load(text, lock={"l": locked}).actuator_forces(ctrl, q[:2], v[:2])
    bound = BAR * magnitude(actuation_of(dynx.load(text)), ctrl, q, v)
    np.testing.assert_allclose(part, whole[:2], rtol=0.0, atol=bound)


def test_a_joint_that_follows_another_passes_its_force_on() -> None:
    equality = (
        '<equality><joint name="dynx:mimic:k" joint1="k" joint2="j" polycoef="0.1 2 0 0 0"/></equality>'
        '<actuator><position joint="k" kp="5" kv="2"/><motor joint="j"/></actuator>'
    )
    text = document(equality)
    model = dynx.load(text)
    q, v = np.array([0.3, 0.2]), np.array([0.5, -0.4])
    forces = of_mujoco(compiled(text), np.ones(2), np.array([0.3, 0.7, 0.2]), np.array([0.5, 1.0, -0.4]))
    S = np.array([[1.0, 0.0], [2.0, 0.0], [0.0, 1.0]])
    np.testing.assert_allclose(model.actuator_forces(np.ones(2), q, v), forces @ S, rtol=BAR)


def test_leading_axes_broadcast_and_a_name_stands_for_its_configuration() -> None:
    model = dynx.load(SERVOS).with_configuration("bent", [0.3, -0.2])
    rng = np.random.default_rng(0)
    ctrl, q, v = rng.normal(size=(5, 1, 2)), rng.normal(size=(3, 2)), rng.normal(size=2)
    found = model.actuator_forces(ctrl, q, v)
    assert found.shape == (5, 3, 2)
    for i, j in np.ndindex(5, 3):
        np.testing.assert_allclose(found[i, j], model.actuator_forces(ctrl[i, 0], q[j], v), rtol=BAR)
    bent = model.actuator_forces([0.0, 0.0], "bent", v)
    np.testing.assert_array_equal(bent, model.actuator_forces([0.0, 0.0], [0.3, -0.2], v))


def test_mistakes_are_named() -> None:
    model = dynx.load(
        document('<actuator><motor name="left" joint="j"/><muscle name="calf" joint="k"/></actuator>')
    )
    with pytest.raises(
        ShapeError, match=r"wanted \(\.\.\., 1\): .*\('left'\); the file has others.*'calf'.*muscle"
    ):
        model.actuator_forces(np.zeros(2), np.zeros(3), np.zeros(3))
    with pytest.raises(NotFiniteError, match=r"ctrl\[0\] is nan"):
        model.actuator_forces([np.nan], np.zeros(3), np.zeros(3))
    with pytest.raises(ShapeError, match="q has shape"):
        model.actuator_forces([0.0], np.zeros(2), np.zeros(3))
    with pytest.raises(ArgumentError, match="has no actuators, since its description is not in MJCF"):
        dynx.load("planar_2r").actuator_forces([0.0], np.zeros(2), np.zeros(2))
    lone = Model.build(
        "lone",
        [Link("a"), Link("b")],
        [Joint("j", "revolute", "a", "b")],
        actuators=[Actuator("pull", "", tendon="rope")],
    )
    with pytest.raises(ArgumentError, match="'pull' of lone acts on the tendon 'rope'"):
        lone.actuator_forces([0.0], [0.0], [0.0])


@pytest.mark.parametrize(("flag", "effect"), [("actuation", "none is read"), ("clampctrl", "not limited")])
def test_flags_of_actuators_have_their_effect(flag: str, effect: str) -> None:
    text = document('<actuator><motor joint="j" ctrlrange="-1 1"/></actuator>').replace(
        "<worldbody>", f'<option><flag {flag}="disable"/></option><worldbody>', 1
    )
    model, engine = dynx.load(text), compiled(text)
    assert any(flag in each.message or effect in each.message for each in model.notes)
    ctrl = np.full(len(model.actuators or ()), 5.0)
    own = model.actuator_forces(ctrl, np.zeros(3), np.zeros(3))
    np.testing.assert_array_equal(own, of_mujoco(engine, np.full(1, 5.0), np.zeros(3), np.zeros(3)))


def test_each_robot_of_a_scene_has_its_actuators(tmp_path: Any) -> None:
    (tmp_path / "two.xml").write_text(SCENE)
    scene = read_scene(tmp_path / "two.xml")
    names = {each.name: [drive.name for drive in each.model.actuators or ()] for each in scene.robots}
    assert names == {"a": ["p"], "b": ["m"]}
    notes = " ".join(each.message for each in scene.notes)
    assert "tendon 'two', which has joints of several robots" in notes
    assert "1 element of <actuator> ('w')" in notes
    model = scene.robots[0].model
    np.testing.assert_allclose(model.actuator_forces([1.0], [0.25], [0.0]), [2.0 * 3.0 * 0.5])


@dataclass(frozen=True)
class Servos(control.Controller[None], pure=True):
    """Command the actuators of a robot, as a user's program does."""

    model: Model
    needs_setpoint = False

    def torque(self, measurement: Any, setpoint: Any, state: None) -> tuple[Floats, None]:
        t, q, v = measurement
        return self.model.actuator_forces(np.array([0.5 * np.sin(3.0 * t), -0.7]), q, v), state


def test_a_controller_may_call_it_in_compiled_code() -> None:
    arm = dynx.load(SERVOS.replace('kv="20"', 'kv="20" ctrlrange="-0.3 0.3" forcerange="-9 40"'))
    options: dict[str, Any] = {"q0": np.zeros(2), "duration": 0.3, "dt": 0.002}
    runs = [
        dynx.simulate(arm, Servos(arm), None, plant=name, **options) for name in ("reference", "compiled")
    ]
    assert runs[1].executor == "compiled"
    np.testing.assert_allclose(runs[0].q, runs[1].q, rtol=0.0, atol=BAR)


@pytest.mark.parametrize("integrator", ["Euler", "implicitfast"])
def test_a_world_moves_as_mujoco_does(integrator: str) -> None:
    """Euler takes the forces of actuators from the beginning of the step, implicitfast their damping from its
    end, as a `VelocityMotor`."""
    mujoco = pytest.importorskip("mujoco")
    text = SERVOS.replace("INTEGRATOR", integrator)
    model, arm, ctrl = compiled(text), dynx.load(text), np.array([0.5, -0.7])
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONTACT
    data = mujoco.MjData(model)
    data.ctrl[:] = ctrl
    with World(Scene("s", robots=(SceneRobot("arm", arm),)), "dynx", dt=0.002, collisions=False) as world:
        for _ in range(50):
            q, v = world.state.robots["arm"].q, world.state.robots["arm"].v
            explicit = integrator == "Euler"
            tau = arm.actuator_forces(ctrl, q, v if explicit else np.zeros(2))
            world.step(
                torques={"arm": tau},
                motors=None if explicit else {"arm": dynx.VelocityMotor(0.0, kd=KV)},
            )
            mujoco.mj_step(model, data)
        np.testing.assert_allclose(world.state.robots["arm"].q, data.qpos, rtol=0.0, atol=BAR)
