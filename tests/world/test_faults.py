"""Bad calls, scenes and meshes: one clear error each, the state kept, the process alive."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import dynx
from dynx import Pose
from dynx.control.bullet import BulletMotorCommand
from dynx.errors import (
    ArgumentError,
    ClosedError,
    DescriptionError,
    DivergedError,
    DynxError,
    EngineError,
    EngineLimitError,
    SingularMassMatrixError,
    UnknownNameError,
)
from dynx.model.geometry import Box, Collision, Mesh, Plane
from dynx.world import (
    ExternalForce,
    Material,
    PDMotor,
    PositionMotor,
    Scene,
    SceneBody,
    SceneRobot,
    VelocityMotor,
    Weld,
    World,
    box,
    ground,
)
from tests.world.engines import WORLDS

NAN, INF = math.nan, math.inf
ONE = (1.0, 0.0, 0.0, 0.0, 0.0, 0.0)
NO_PAIR: Any = [0.0, 0.0]


@pytest.fixture(params=WORLDS)
def world(request: pytest.FixtureRequest) -> Iterator[World]:
    robot = SceneRobot("arm", dynx.load("planar_2r"))
    bodies = (ground(pose=Pose((0, 0, -3))), box("brick", (0.1, 0.1, 0.1), mass=1.0))
    with World(Scene("s", robots=(robot,), bodies=bodies), request.param) as made:
        made.step(3)
        yield made


def everything(world: World) -> list[Any]:
    state = world.state
    return [
        world.time,
        *(x.tolist() for each in (*state.robots.values(), *state.bodies.values()) for x in each),
    ]


CALLS: dict[str, tuple[Callable[[World], object], type[DynxError], str]] = {
    "NaN torque": (
        lambda w: w.step(torques={"arm": [NAN, 0.0]}),
        ArgumentError,
        r"torque of arm\[0\] is nan",
    ),
    "infinite torque": (lambda w: w.step(torques={"arm": [0.0, INF]}), ArgumentError, r"arm\[1\] is inf"),
    "torque of wrong length": (lambda w: w.step(torques={"arm": [1.0]}), ArgumentError, r"wanted \(2,\)"),
    "torque of text": (lambda w: w.step(torques={"arm": "ab"}), ArgumentError, "dtype"),
    "torque of an unknown robot": (lambda w: w.step(torques={"arn": [0, 0]}), UnknownNameError, "'arm'"),
    "torques in a list": (lambda w: w.step(torques=[1.0]), ArgumentError, "dict by robot"),  # type: ignore[arg-type]
    "no steps": (lambda w: w.step(0), ArgumentError, "number of steps"),
    "half a step": (lambda w: w.step(0.5), ArgumentError, "number of steps"),  # type: ignore[arg-type]
    "negative duration": (lambda w: w.run(-1.0), ArgumentError, "duration"),
    "endless duration": (lambda w: w.run(INF), ArgumentError, "duration"),
    "motor of an unknown robot": (
        lambda w: w.step(motors={"leg": PDMotor(0, 1, 1)}),
        UnknownNameError,
        "leg",
    ),
    "motor that is none": (lambda w: w.step(motors={"arm": 3.0}), DynxError, "motor"),  # type: ignore[dict-item]
    "motor with NaN": (
        lambda w: w.step(motors={"arm": PDMotor(NAN, 1, 1)}),
        ArgumentError,
        "target of a PDMotor",
    ),
    "motor with negative gain": (
        lambda w: w.step(motors={"arm": PDMotor(0, -1, 1)}),
        ArgumentError,
        "at least 0",
    ),
    "motor of an unknown joint": (
        lambda w: w.step(motors={"arm": VelocityMotor(1.0, 1.0, joints=["wing"])}),
        UnknownNameError,
        "no joint 'wing'",
    ),
    "two motors of a joint": (
        lambda w: w.step(motors={"arm": [PDMotor(0, 1, 1), PositionMotor(0, 1, 1)]}),
        ArgumentError,
        "two motors",
    ),
    "engine motor of no mode": (
        lambda w: w.step(motors={"arm": BulletMotorCommand("WISH")}),
        DynxError,
        "mo(de|tors)",
    ),
    "engine motor with NaN": (
        lambda w: w.step(motors={"arm": BulletMotorCommand("VELOCITY_CONTROL", velocities=[NAN, 0.0])}),
        ArgumentError,
        "velocities",
    ),
    "wrench on nothing": (lambda w: w.step(forces=[ExternalForce("brik", ONE)]), UnknownNameError, "'brick'"),
    "wrench on a fixed body": (
        lambda w: w.step(forces=[ExternalForce("ground", ONE)]),
        ArgumentError,
        "fixed",
    ),
    "wrench on an unknown link": (
        lambda w: w.step(forces=[ExternalForce("arm/hand", ONE)]),
        UnknownNameError,
        "hand",
    ),
    "wrench with NaN": (
        lambda w: w.step(forces=[ExternalForce("brick", (NAN, 0, 0, 0, 0, 0))]),
        ArgumentError,
        "the wrench of",
    ),
    "force in no reference": (
        lambda w: w.step(forces=[ExternalForce("brick", ONE, reference="x")]),
        ArgumentError,
        "local_world_aligned",
    ),
    "forces in a set": (lambda w: w.step(forces={1}), ArgumentError, "list of ExternalForce"),  # type: ignore[arg-type]
    "state with NaN": (lambda w: w.set_state(robots={"arm": ([NAN, 0], [0, 0])}), ArgumentError, "q of arm"),
    "no pair": (lambda w: w.set_state(robots={"arm": NO_PAIR}), ArgumentError, r"wanted a tuple \(q, v\)"),
    "no state": (lambda w: w.set_state(), ArgumentError, "robots= or bodies="),
    "state of a removed body": (
        lambda w: w.set_state(bodies={"gone": (np.eye(4), [0] * 6)}),
        UnknownNameError,
        "gone",
    ),
    "pose that is not rigid": (
        lambda w: w.set_state(bodies={"brick": (2 * np.eye(4), [0] * 6)}),
        ArgumentError,
        "rigid",
    ),
    "half of a state": (
        lambda w: w.set_state(robots={"arm": ([1.0, 1.0], [0, 0])}, bodies={"brick": (np.eye(4), [NAN] * 6)}),
        ArgumentError,
        "twist of brick",
    ),
    "moving a fixed body": (
        lambda w: w.set_state(bodies={"ground": (np.eye(4), [0] * 6)}),
        ArgumentError,
        "fixed",
    ),
    "snapshot of no world": (lambda w: w.restore(b"state"), ArgumentError, "World.save"),  # type: ignore[arg-type]
    "distance of nothing": (lambda w: w.closest_points("brick", "stone"), UnknownNameError, "stone"),
    "distance from itself": (lambda w: w.closest_points("brick", "brick"), ArgumentError, "one shape"),
    "distance within NaN": (lambda w: w.closest_points("brick", "ground", NAN), ArgumentError, "within"),
    "box of nothing": (lambda w: w.aabb("stone"), UnknownNameError, "stone"),
    "overlap of an inverted box": (lambda w: w.overlapping([1, 0, 0], [0, 1, 1]), ArgumentError, "above"),
    "rays along zero": (lambda w: w.cast_rays([[0, 0, 0]], [[0, 0, 0]]), ArgumentError, "direction"),
    "rays from NaN": (lambda w: w.cast_rays([[NAN, 0, 0]], [[0, 0, 1]]), ArgumentError, "origins"),
    "rays of two numbers": (lambda w: w.cast_rays([[0, 0]], [[0, 0, 1]]), ArgumentError, "origins"),
}


@pytest.mark.parametrize("fault", CALLS)
def test_a_bad_call_is_refused_and_changes_nothing(world: World, fault: str) -> None:
    call, error, message = CALLS[fault]
    before = everything(world)
    with pytest.raises(error, match=message):
        call(world)
    assert everything(world) == before
    world.step()


@pytest.mark.parametrize(
    ("loads", "message"),
    [
        (lambda world: None, "loads returned 'None'; wanted a dict of torques, motors, forces"),
        (lambda world: {"torque": {}}, "loads returned 'torque'; did you mean 'torques'"),
        (lambda world: np.zeros(6), "wanted a dict"),
    ],
)
def test_loads_of_another_form_are_refused(world: World, loads: Any, message: str) -> None:
    with pytest.raises(ArgumentError, match=message):
        world.run(0.01, loads=loads)
    wrong: Any = np.zeros(6)
    for call in (world.step, lambda **given: world.run(0.01, **given)):
        with pytest.raises(ArgumentError, match="torques is of type ndarray; wanted a dict by robot"):
            call(torques=wrong)


def test_a_closed_world_refuses_every_call(world: World) -> None:
    snapshot = world.save()
    world.close()
    world.close()
    calls: list[Callable[[], object]] = [
        world.step,
        world.contacts,
        world.save,
        world.reset,
        lambda: world.state,
        lambda: world.run(1.0),
        lambda: world.restore(snapshot),
        lambda: world.set_state(world.state),
        lambda: world.aabb("brick"),
        lambda: world.cast_rays([0, 0, 1], [0, 0, -1]),
    ]
    for call in calls:
        with pytest.raises(ClosedError, match="closed"):
            call()


def test_a_world_that_diverges_returns_to_its_last_state(world: World) -> None:
    before = everything(world)
    with pytest.raises((DivergedError, EngineError), match=r"diverged|failed"):
        world.run(2.0, torques={"arm": [1e59, -1e59]})
    assert everything(world) == before
    world.step()
    assert np.isfinite(world.state.robots["arm"].q).all()


def plain(**options: Any) -> Scene:
    return Scene("s", bodies=(box("a", (1.0, 1.0, 1.0), mass=1.0),), **options)


def mesh(path: Path, content: bytes, suffix: str = ".obj") -> Scene:
    file = path / f"mesh{suffix}"
    file.write_bytes(content)
    return Scene("s", bodies=(SceneBody("m", (Collision(Mesh(str(file))),)),))


SCENES: dict[str, tuple[Callable[[Path], Scene], type[DynxError], str]] = {
    "duplicate names": (lambda p: Scene(bodies=(ground(), ground())), ArgumentError, "two parts"),
    "a body in place of bodies": (lambda p: Scene(bodies=ground()), ArgumentError, r"such as \[SceneBody"),  # type: ignore[arg-type]
    "shape of text": (lambda p: Scene(bodies=(SceneBody("a", "box"),)), ArgumentError, "wanted a shape"),  # type: ignore[arg-type]
    "too many bodies": (
        lambda p: Scene(bodies=[box(f"b{k}", (1, 1, 1)) for k in range(10_001)]),
        EngineLimitError,
        "at most 10000",
    ),
    "zero-size box": (lambda p: Scene(bodies=(box("a", (1.0, 0.0, 1.0)),)), ArgumentError, "positive"),
    "negative mass": (lambda p: Scene(bodies=(box("a", (1.0, 1.0, 1.0), mass=-1.0),)), ArgumentError, "mass"),
    "NaN pose": (
        lambda p: Scene(bodies=(box("a", (1, 1, 1), pose=Pose((NAN, 0, 0))),)),
        ArgumentError,
        "pose",
    ),
    "a plane with a mass": (
        lambda p: Scene(bodies=(SceneBody("a", (Collision(Plane()),), mass=1.0),)),
        ArgumentError,
        "Plane",
    ),
    "impossible inertia": (
        lambda p: Scene(
            bodies=(
                SceneBody(
                    "a", (Collision(Box((1, 1, 1))),), mass=1.0, inertia=((9, 0, 0), (0, 1, 0), (0, 0, 1))
                ),
            )
        ),
        ArgumentError,
        "inertia",
    ),
    "weld of nothing": (lambda p: plain(constraints=(Weld("a", "b"),)), UnknownNameError, "b"),
    "weld to itself": (lambda p: plain(constraints=(Weld("a", "a"),)), ArgumentError, "itself"),
    "unknown ignored pair": (lambda p: plain(ignored=(("a", "c"),)), UnknownNameError, "c"),
    "negative friction": (lambda p: plain(bodies2=Material(friction=-1.0)), ArgumentError, "friction"),
    "truncated STL": (
        lambda p: mesh(p, b"\0" * 80 + (9).to_bytes(4, "little") + b"\0" * 50, ".stl"),
        DescriptionError,
        "mesh.stl",
    ),
    "index out of range": (
        lambda p: mesh(p, b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n"),
        DescriptionError,
        "mesh.obj",
    ),
    "empty mesh": (lambda p: mesh(p, b""), DescriptionError, "mesh.obj"),
    "NaN vertex": (
        lambda p: mesh(p, b"v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"),
        DescriptionError,
        "mesh.obj",
    ),
    "missing mesh": (
        lambda p: Scene(bodies=(SceneBody("m", (Collision(Mesh(str(p / "no.stl"))),)),)),
        DynxError,
        "no.stl",
    ),
}


@pytest.mark.parametrize("engine", WORLDS)
@pytest.mark.parametrize("fault", SCENES)
def test_a_bad_scene_is_refused(engine: str, fault: str, tmp_path: Path) -> None:
    scene, error, message = SCENES[fault]
    with pytest.raises(error, match=message):
        World(scene(tmp_path), engine)


OPTIONS: dict[str, tuple[dict[str, Any], type[DynxError], str]] = {
    "zero step": ({"dt": 0.0}, ArgumentError, "dt"),
    "step of no length": ({"dt": 1e-300}, ArgumentError, "at least 1e-09 s"),
    "substeps of no length": ({"substeps": 10**9}, ArgumentError, "at least 1e-09 s"),
    "no substeps": ({"substeps": 0}, ArgumentError, "substeps"),
    "unknown engine": ({"engine": "bulet"}, DynxError, "pybullet"),
    "collisions by number": ({"collisions": 1}, ArgumentError, "True or False"),
    "unknown setting": ({"iteratons": 3}, UnknownNameError, "no setting 'iteratons'"),
}


@pytest.mark.parametrize("engine", WORLDS)
@pytest.mark.parametrize("fault", OPTIONS)
def test_bad_options_are_refused(engine: str, fault: str) -> None:
    options, error, message = OPTIONS[fault]
    with pytest.raises(error, match=message):
        World(plain(), **{"engine": engine, **options})


@pytest.mark.parametrize("engine", WORLDS)
def test_an_interpenetrating_start_is_allowed_and_reported(engine: str) -> None:
    bodies = (
        box("a", (0.2, 0.2, 0.2), mass=1.0),
        box("b", (0.2, 0.2, 0.2), mass=1.0, pose=Pose((0.15, 0, 0))),
    )
    with World(Scene("s", bodies=bodies), engine) as world:
        assert min(contact.distance for contact in world.contacts()) < -0.04
        world.step(100)
        assert np.isfinite(world.state.bodies["a"].T_world_body).all()


@pytest.mark.parametrize("engine", WORLDS)
def test_a_floating_base_without_mass_is_refused_alike(engine: str) -> None:
    arm = dynx.load("planar_2r", base="floating")
    light = replace(arm, links=tuple(replace(link, inertial=None) for link in arm.links))
    with pytest.raises(SingularMassMatrixError, match=r"nothing that 'base', .* moves has inertia"):
        World(Scene("s", robots=(SceneRobot("arm", light),)), engine)
