"""Every difference that acts is listed and taken over: models of controllers, shapes, clocks, many links."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import dynx
from dynx import control
from dynx.model import Model
from dynx.model.geometry import Collision, Geometry, LinkGeometry
from dynx.model.geometry.shapes import Sphere
from dynx.sim import Payload, Rollout, Scenario, ScenePlant, compare, simulate
from dynx.sim.comparison import RolloutComparison
from dynx.world import Scene, SceneRobot, box, ground

ARM = dynx.load("ur5")
START = Scenario(
    ARM,
    control.ComputedTorque(ARM, kp=100.0, kd=20.0),
    np.full(6, 0.2),
    q0=np.zeros(6),
    duration=0.06,
    plant="compiled",
)


def heavier(model: Model, *links: str) -> Model:
    """Return the robot with 1.3 times the mass of these links, by default of all."""
    return replace(
        model,
        links=tuple(
            replace(each, inertial=replace(each.inertial, mass=1.3 * each.inertial.mass))
            if each.inertial and (each.name in links or not links)
            else each
            for each in model.links
        ),
    )


def compared(ours: Scenario, theirs: Scenario) -> RolloutComparison:
    return compare(simulate(ours), simulate(theirs))


def names(found: RolloutComparison) -> set[str]:
    return {cause.factor.name for cause in found.causes}


def test_the_model_of_a_controller_is_a_difference_of_its_own() -> None:
    wrong = control.ComputedTorque(heavier(ARM, "forearm_link"), kp=90.0, kd=20.0)
    found = compared(START, replace(START, controller=wrong))
    assert found.proved
    assert names(found) == {"controller.model", "controller.kp"}
    assert all(cause.acts(found.tolerance) for cause in found.causes)
    model = next(cause for cause in found.causes if cause.factor.name == "controller.model")
    direct = simulate(
        replace(START, controller=control.ComputedTorque(heavier(ARM, "forearm_link"), kp=100.0, kd=20.0))
    )
    assert model.alone == pytest.approx(np.abs(direct.q - found.ours.q).max(), rel=1e-9)


CONTROLLERS: dict[str, Callable[[Model], control.Controller[Any]]] = {
    "computed torque": lambda robot: control.ComputedTorque(robot, kp=100.0, kd=20.0),
    "PD with gravity": lambda robot: control.GravityCompensatedPD(robot, kp=500.0, kd=20.0),
    "limited": lambda robot: control.Saturated(
        control.GravityCompensatedPD(robot, kp=500.0, kd=20.0), limit=50.0
    ),
    "not registered": lambda robot: Own(robot, 1.0),
}


@pytest.mark.parametrize("make", CONTROLLERS.values(), ids=CONTROLLERS)
@pytest.mark.parametrize("change", ["mass", "gravity"])
def test_a_change_of_the_robot_that_its_controller_does_not_know_is_one_cause(
    make: Callable[[Model], control.Controller[Any]], change: str
) -> None:
    other = heavier(ARM, "forearm_link") if change == "mass" else ARM.with_gravity([0.0, 0.0, -1.6])
    ours = replace(START, controller=make(ARM))
    found = compared(ours, replace(ours, model=other))
    assert found.proved
    (cause,) = found.causes
    assert cause.factor.name == ("link forearm_link, inertial" if change == "mass" else "gravity")
    assert cause.alone == cause.without == found.separation.largest > found.tolerance


def test_a_controller_with_a_third_robot_is_a_cause_beside_the_robot() -> None:
    known = control.ComputedTorque(heavier(ARM, "wrist_1_link"), kp=90.0, kd=20.0)
    theirs = replace(START, model=heavier(ARM, "forearm_link"), controller=known)
    found = compared(START, theirs)
    assert found.proved
    assert names(found) == {"link forearm_link, inertial", "controller.model", "controller.kp"}
    direct = {
        "link forearm_link, inertial": replace(START, model=theirs.model),
        "controller.model": replace(START, controller=control.ComputedTorque(known.model, kp=100.0, kd=20.0)),
    }
    for cause in found.causes:
        assert cause.acts(found.tolerance)
        if cause.factor.name in direct:
            alone = simulate(direct[cause.factor.name])
            assert cause.alone == pytest.approx(np.abs(alone.q - found.ours.q).max(), rel=1e-9)


def test_gains_of_a_controller_inside_another() -> None:
    def saturated(kp: float, limit: float) -> Scenario:
        return replace(
            START, controller=control.Saturated(control.PD(ARM, kp=kp, kd=2.0), limit=limit), duration=0.02
        )

    found = compared(saturated(10.0, 5.0), saturated(20.0, 2.0))
    assert found.proved
    assert {(each.factor.name, each.factor.ours, each.factor.theirs) for each in found.causes} == {
        ("controller.inner.kp", "10", "20"),
        ("controller.limit", "5", "2"),
    }


class Own(control.Controller[None], pure=True):
    """A controller that cannot be rebuilt from its document."""

    def __init__(self, model: Model, kp: float) -> None:
        self.model, self.kp = model, kp

    def torque(self, measurement: Any, setpoint: Any, state: None) -> Any:
        return -self.kp * measurement.q - measurement.v, None


def test_a_controller_that_cannot_be_rebuilt_is_taken_over_as_an_object() -> None:
    ours = replace(START, controller=Own(ARM, 1.0), q0=np.full(6, 0.1))
    gains = compared(ours, replace(ours, controller=Own(ARM, 2.0)))
    assert gains.proved
    (cause,) = gains.causes
    assert cause.factor.name == "controller"
    assert cause.factor.ours != cause.factor.theirs
    heavy = heavier(ARM, "forearm_link")
    robot = compared(ours, replace(ours, model=heavy, controller=Own(heavy, 1.0)))
    assert robot.proved
    assert names(robot) == {"link forearm_link, inertial"}


def test_times_that_fit_to_one_another_alone_are_one_difference() -> None:
    found = compared(replace(START, dt=3e-3), replace(START, dt=2e-3))
    assert found.proved
    (cause,) = found.causes
    assert cause.acts(found.tolerance)
    assert (cause.factor.name, cause.factor.ours) == ("dt", "dt 0.003, control_dt 0.003")
    assert names(compared(replace(START, dt=4e-3), replace(START, dt=2e-3))) == {"dt", "control_dt"}


def test_numbers_that_differ_in_the_last_digits_are_shown_apart() -> None:
    found = compared(START, replace(START, q0=np.full(6, 1e-13), reference=np.full(6, 0.2 + 1e-12)))
    factors = {cause.factor.name: cause.factor for cause in found.causes}
    reference = factors["reference"]
    assert (float(reference.ours), float(reference.theirs)) == (0.2, 0.2 + 1e-12)
    assert factors["q0"].ours == "0"


def test_many_links_are_one_difference() -> None:
    robot = dynx.load("talos")
    ours = Scenario(robot, None, q0=robot.neutral(), duration=5e-3, plant="compiled")
    found = compared(ours, replace(ours, model=heavier(robot), payload=Payload("torso_2_link", 1.0)))
    assert found.proved
    assert names(found) == {"links, inertial", "payload"}
    links = next(cause for cause in found.causes if cause.factor.name == "links, inertial")
    assert links.factor.ours.startswith("56: base_link mass 13.5381; torso_1_link mass 3.02433; ")
    alone = np.abs(simulate(replace(ours, model=heavier(robot))).q - found.ours.q).max()
    assert links.alone == pytest.approx(alone, rel=1e-9)


def test_shapes_that_collide_are_a_difference_in_a_scene() -> None:
    small = dynx.load("double_pendulum_continuous")
    geometry = {each.name: LinkGeometry() for each in small.links}

    def run(radius: float, model: Model = small, **options: Any) -> Rollout:
        tip = LinkGeometry(collisions=(Collision(Sphere(radius), dynx.Pose((0.0, 0.0, 0.2))),))
        shaped = replace(model, geometry=Geometry({**geometry, "link2": tip}))
        wall = box("wall", (0.5, 0.1, 0.5), pose=dynx.Pose((0.0, 0.25, 0.25)))
        scene = Scene("s", robots=(SceneRobot("arm", shaped),), bodies=(ground(), wall))
        plant = ScenePlant(scene, engine="mujoco")
        return simulate(shaped, None, q0=[0.3, 0.5], plant=plant, duration=0.3, **options)

    found = compare(run(0.02), run(0.08, heavier(small, "link1")))
    assert found.proved
    assert names(found) == {"robot arm, shapes", "link link1, inertial"}
    shapes = next(cause for cause in found.causes if cause.factor.name == "robot arm, shapes")
    assert "radius 0.02" in shapes.factor.ours
    alone = np.abs(run(0.08).q - found.ours.q).max()
    assert alone > 1e-3
    assert shapes.alone == pytest.approx(alone, rel=1e-9)


def test_effects_swap_with_the_rollouts() -> None:
    theirs = replace(
        START,
        model=heavier(ARM, "forearm_link"),
        controller=control.ComputedTorque(heavier(ARM, "forearm_link"), kp=90.0, kd=15.0),
        payload=Payload("tool0", 0.5),
        joint_damping=0.2,
    )
    there, back = compared(START, theirs), compared(theirs, START)
    np.testing.assert_array_equal(there.separation.distances, back.separation.distances)
    effects = {cause.factor.name: (cause.alone, cause.without) for cause in there.causes}
    assert len(effects) == 5
    assert effects == {cause.factor.name: (cause.without, cause.alone) for cause in back.causes}


def test_differences_that_cancel_are_causes_both() -> None:
    # The damping of the joints and that of the controller add up, but for the order of a step.
    ours = replace(START, controller=control.PD(ARM, kp=0.0, kd=2.0), v0=np.full(6, 0.5))
    theirs = replace(ours, controller=control.PD(ARM, kp=0.0, kd=1.5), joint_damping=0.5)
    found = compared(ours, theirs)
    assert found.proved
    assert names(found) == {"controller.kd", "joint_damping"}
    for cause in found.causes:
        for effect in (cause.alone, cause.without):
            assert effect is not None
            assert effect > 10.0 * found.separation.largest
