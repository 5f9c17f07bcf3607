"""One external force for simulations, batches and worlds: its point, its axes, its impulse on each engine."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest

import dynx
from dynx.errors import ArgumentError, UnknownNameError
from dynx.sim import ScenePlant, simulate, simulate_batch
from dynx.sim.scenario.documents import decode, encode
from dynx.spatial.scalar import Floats
from dynx.steppers.forces import ExternalForce
from dynx.world import Scene, SceneRobot, World, body_to_urdf, box
from tests.backends.robots import chain
from tests.world.engines import WORLDS

SLIDER = chain(1, "prismatic").with_gravity(np.zeros(3))
"""One kilogram on a straight line, so that the final speed is the impulse."""
AXIS = np.asarray(SLIDER.joints[0].axis)
ARM = dynx.load("six_axis_arm")
TIP = ARM.frame_names[-1]
POINT = (0.05, -0.1, 0.2)
WEIGHTLESS = (0.0, 0.0, 0.0)


@pytest.fixture(params=WORLDS)
def engine(request: pytest.FixtureRequest) -> str:
    pytest.importorskip({"drake": "pydrake"}.get(request.param, request.param))
    return str(request.param)


@pytest.mark.parametrize(("start", "duration"), [(0.0, 5e-3), (5e-3, 5e-3), (3.1e-3, 1.7e-3), (8e-3, 9e-3)])
def test_a_push_within_a_step_gives_its_impulse(engine: str, start: float, duration: float) -> None:
    push = ExternalForce("link1", np.concatenate([AXIS, np.zeros(3)]), start, duration)
    plant = ScenePlant(Scene("s", robots=(SceneRobot("r", SLIDER),), gravity=WEIGHTLESS), engine=engine)
    rollout = simulate(SLIDER, plant=plant, pushes=[push], dt=0.01, substeps=4, duration=0.02)
    assert rollout.v[-1, 0] == pytest.approx(duration, rel=1e-6)
    scene = Scene("s", bodies=(box("brick", (0.1, 0.1, 0.1), mass=1.0),), gravity=WEIGHTLESS)
    with World(scene, engine, 0.01, substeps=4) as world:
        world.step(2, forces=[ExternalForce("brick", (1.0, 0, 0, 0, 0, 0), start, duration)])
        assert world.state.bodies["brick"].twist[0] == pytest.approx(duration, rel=1e-6)


@pytest.mark.parametrize("reference", ["local_world_aligned", "local", "world"])
def test_a_force_means_the_same_on_a_body_and_on_a_link(engine: str, reference: str) -> None:
    R = dynx.rotation_from_rpy((0.4, -0.7, 1.1))
    T = np.eye(4)
    T[:3, :3], T[:3, 3] = R, (0.3, -0.2, 0.4)
    brick = box("brick", (0.1, 0.2, 0.3), mass=1.0, center_of_mass=(0.02, 0.01, -0.03), pose=T)
    alone = dynx.load(body_to_urdf(brick), base="floating")
    point = WEIGHTLESS if reference == "world" else POINT
    wrench = (1.0, 2.0, -0.5, 0.02, 0.01, -0.03)
    with World(Scene("b", bodies=(brick,), gravity=WEIGHTLESS), engine, 1e-3) as body:
        body.step(20, forces=[ExternalForce("brick", wrench, reference=reference, point=point)])
        moved = body.state.bodies["brick"].T_world_body
    q = np.concatenate([T[:3, 3], dynx.quat_from_rotation(R)])
    with World(Scene("r", robots=(SceneRobot("r", alone, q=q),), gravity=WEIGHTLESS), engine, 1e-3) as robot:
        robot.step(20, forces=[ExternalForce(alone.root, wrench, reference=reference, point=point)])
        found = robot.state.robots["r"].q
    np.testing.assert_allclose(found[:3], moved[:3, 3], rtol=0.0, atol=1e-7)
    np.testing.assert_allclose(dynx.rotation_from_quat(found[3:7]), moved[:3, :3], rtol=0.0, atol=1e-6)
    assert np.abs(moved - T).max() > 1e-4


@pytest.mark.parametrize("reference", ["local_world_aligned", "local"])
def test_a_force_at_a_point_does_the_work_of_its_point(reference: str) -> None:
    q, force = ARM.random(np.random.default_rng(3)), np.array([3.0, -1.0, 2.0])
    acting = ExternalForce(TIP, (*force, 0, 0, 0), reference=reference, point=POINT)
    with dynx.backend("reference", ARM) as engine:
        J, wrench = acting.at_frame(engine, TIP, q, 0.5)
        along = (
            force if reference == "local_world_aligned" else engine.forward_kinematics(q, TIP)[:3, :3] @ force
        )

        def work(q: Floats) -> float:
            T = engine.forward_kinematics(q, TIP)
            return float(0.5 * along @ (T[:3, :3] @ POINT + T[:3, 3]))

        h = 1e-6
        slopes = [(work(q + h * e) - work(q - h * e)) / (2.0 * h) for e in np.eye(ARM.nv)]
    np.testing.assert_allclose(J.T @ wrench, slopes, rtol=0.0, atol=1e-8)


@pytest.mark.parametrize("reference", ["local_world_aligned", "local"])
def test_a_batch_and_every_plant_have_the_force_at_its_point(reference: str) -> None:
    law, rest = dynx.control.PD(ARM, kp=1.0, kd=0.0), ARM.neutral()

    def moved(*pushes: ExternalForce) -> Floats:
        many = simulate_batch(ARM, law, rest, rollouts=2, duration=0.02, q0=rest, pushes=pushes)
        return np.asarray(many.q[1])

    wrench = (3.0, -1.0, 2.0, 0.1, 0, 0)
    push = ExternalForce(TIP, wrench, 2e-3, 7e-3, reference, POINT)
    many = moved(push)
    for plant in ("compiled", "reference"):
        one = simulate(ARM, law, rest, plant=plant, duration=0.02, q0=rest, pushes=[push])
        np.testing.assert_allclose(many, one.q[-1], rtol=0.0, atol=1e-12)
    assert np.abs(many - moved()).max() > 1e-6
    # The lever counts: without the point the motion is another one.
    assert np.abs(many - moved(ExternalForce(TIP, wrench, 2e-3, 7e-3, reference))).max() > 1e-7


def test_a_push_of_an_earlier_file_is_read() -> None:
    fields = {"frame": "tool0", "wrench": [1.0, 0, 0, 0, 0, 0.0], "start": 0.1, "duration": {"float": "inf"}}
    old = {"class": "dynx.sim.plants.disturbances:Push", "fields": {**fields, "reference": "local"}}
    read = decode(old)
    assert read == ExternalForce("tool0", (1.0, 0, 0, 0, 0, 0), 0.1, reference="local")
    assert decode(json.loads(json.dumps(encode(read)))) == read


def test_old_names_of_the_force_name_the_new_one() -> None:
    for package, name in ((dynx, "Push"), (dynx.sim, "Push"), (dynx.world, "Wrench")):
        with pytest.raises(ImportError, match=r"is now dynx\.ExternalForce"):
            getattr(package, name)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"wrench": (1.0, 2.0)}, "shape"),
        ({"reference": "body"}, "local_world_aligned"),
        ({"reference": "world", "point": POINT}, "point"),
        ({"point": (1.0, 2.0)}, "point"),
        ({"duration": 0.0}, "duration of"),
        ({"on": 3}, "acts on"),
    ],
)
def test_an_invalid_force_is_refused(given: dict[str, Any], words: str) -> None:
    arguments: dict[str, Any] = {"on": "tool0", "wrench": (1.0, 0, 0, 0, 0, 0), **given}
    with pytest.raises(ArgumentError, match=words):
        ExternalForce(**arguments)


FOREIGN: tuple[Any, ...] = (
    ["local"],
    {"local": 1},
    None,
    "local ",
    10**5000,
    [10**5000],
    float("nan"),
    object(),
)
"""Values that no field of a force takes."""


@pytest.mark.parametrize("field", ["on", "wrench", "start", "duration", "reference", "point"])
@pytest.mark.parametrize("value", FOREIGN, ids=lambda value: type(value).__name__)
def test_a_value_of_any_kind_in_any_field_is_refused_by_an_error_of_dynx(field: str, value: Any) -> None:
    if field == "on" and isinstance(value, str):
        pytest.skip("a name")
    with pytest.raises(ArgumentError, match="external force"):
        ExternalForce(**{"on": "tip", "wrench": [0.0] * 6, field: value})


@pytest.mark.parametrize(
    ("robots", "target", "suggested"),
    [
        (("arm",), "tool", "'tool0'"),
        (("arm",), "brik", "'brick'"),
        (("arm", "other"), "tool0", "'arm/tool0' or 'other/tool0'"),
        (("arm", "other"), "arm/tool", "'tool0'"),
        (("arm", "other"), "arn/tool0", "'arm/tool0'"),
    ],
)
def test_an_unknown_target_names_the_parts_that_may_be_meant(
    robots: tuple[str, ...], target: str, suggested: str
) -> None:
    arm = dynx.load("ur5")
    scene = Scene(
        "s",
        robots=tuple(SceneRobot(name, arm).at(dynx.Pose((k, 0, 0))) for k, name in enumerate(robots)),
        bodies=(box("brick", (0.1, 0.1, 0.1), mass=1.0, pose=dynx.Pose((0, 5, 0))),),
    )
    with World(scene, dt=1e-3) as world, pytest.raises(UnknownNameError, match=f"did you mean .*{suggested}"):
        world.step(forces=[ExternalForce(target, [0.0] * 6)])
