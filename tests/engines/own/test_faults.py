"""Faults in a scene on the engine dynx: refused or named by the part that has them, and the others go on."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import dynx
from dynx.errors import ArgumentError, DivergedError, NotFiniteError, SingularMassMatrixError
from dynx.model.elements import Inertial
from dynx.spatial.scalar import Floats
from dynx.world import (
    ExternalForce,
    Material,
    Scene,
    SceneBody,
    SceneRobot,
    World,
    box,
    cylinder,
    ground,
    sphere,
)
from tests.compiled.test_contact_step_and_worlds import random_robot, scene_of

COUNT, H = 5, 1e-3


def copies() -> Scene:
    """Return bodies and robots that are far from one another and touch the ground."""
    bodies = [
        box(
            f"cube {k}",
            (0.2, 0.2, 0.2),
            mass=1.0,
            pose=dynx.Pose((3.0 * k, 0, 0.1)),
            twist=(1, 0, 0, 0, 0, 0),
        )
        for k in range(COUNT)
    ]
    legged = random_robot(np.random.default_rng(1), True)
    robots = [SceneRobot(f"robot {k}", legged).at(dynx.Pose((3.0 * k, 3.0, 0.3))) for k in range(2)]
    return Scene("copies", robots=tuple(robots), bodies=(ground(), *bodies))


def everything(world: World) -> list[list[Floats]]:
    state = world.state
    return [[np.array(x) for x in each] for each in (*state.robots.values(), *state.bodies.values())]


@settings(max_examples=10, deadline=None)
@given(
    st.sets(st.integers(0, COUNT - 1), min_size=1, max_size=3),
    st.floats(12.0, 59.0),
    st.integers(0, 5),
    st.booleans(),
)
def test_copies_that_diverge_are_named_and_the_world_goes_on(
    faulty: set[int], exponent: float, axis: int, of_state: bool
) -> None:
    """By a velocity beyond all bounds, or a force that makes one."""
    with World(copies(), "dynx", H) as world, World(copies(), "dynx", H) as other:
        for each in (world, other):
            each.step(3)
        kept = world.save()
        size = np.zeros(6)
        size[axis] = 10.0**exponent
        poses = world.state.bodies
        twists = {f"cube {k}": (poses[f"cube {k}"].T_world_body, size) for k in faulty}

        def diverge() -> None:
            if of_state:
                world.set_state(bodies=twists)
            else:
                world.step(3, forces=[ExternalForce(name, size) for name in twists])
                _ = world.state

        with pytest.raises(DivergedError) as raised:
            diverge()
        message = str(raised.value)
        named = {k for k in range(COUNT) if f"cube {k}" in message.partition(";")[0]}
        assert named == faulty
        assert "robot" not in message.partition(";")[0]
        world.restore(kept)
        for each in (world, other):
            each.step(5)
        for mine, wanted in zip(everything(world), everything(other), strict=True):
            assert all(map(np.array_equal, mine, wanted))


@settings(max_examples=10, deadline=None)
@given(
    st.integers(0, COUNT - 1),
    st.integers(0, 5),
    st.sampled_from([math.nan, math.inf, -math.inf]),
    st.booleans(),
)
def test_numbers_that_are_not_finite_are_refused_by_name(
    k: int, place: int, value: float, robot: bool
) -> None:
    with World(copies(), "dynx", H) as world:
        world.step(2)
        before = everything(world)
        if robot:
            name = f"robot {k % 2}"
            q, v = (x.copy() for x in world.state.robots[name])
            v[place] = value
            with pytest.raises(NotFiniteError, match=f"v of {name}"):
                world.set_state(robots={name: (q, v)})
        else:
            name = f"cube {k}"
            T, twist = (x.copy() for x in world.state.bodies[name])
            twist[place] = value
            with pytest.raises(NotFiniteError, match=f"twist of {name}"):
                world.set_state(bodies={name: (T, twist)})
        for mine, wanted in zip(everything(world), before, strict=True):
            assert all(map(np.array_equal, mine, wanted))
        world.step()


def bodies_in_one_place() -> st.SearchStrategy[list[SceneBody]]:
    """Draw bodies of which all overlap, some at one pose."""
    offsets = st.one_of(st.just(0.0), st.floats(-0.05, 0.05))
    angles = st.one_of(st.just(0.0), st.floats(-3.0, 3.0))
    places = st.tuples(offsets, offsets, offsets, angles, angles)

    def made(k: int, kind: int, place: tuple[float, ...], mass: float) -> SceneBody:
        x, y, z, roll, pitch = place
        pose = dynx.Pose((x, y, z), (roll, pitch, 0.0))
        if kind == 0:
            return box(f"body {k}", (0.2, 0.3, 0.2), mass=mass, pose=pose)
        if kind == 1:
            return sphere(f"body {k}", 0.15, mass=mass, pose=pose)
        return cylinder(f"body {k}", 0.1, 0.3, mass=mass, pose=pose)

    one = st.tuples(st.integers(0, 2), places, st.floats(0.01, 100.0))
    return st.lists(one, min_size=2, max_size=4).map(
        lambda drawn: [made(k, *each) for k, each in enumerate(drawn)]
    )


@settings(max_examples=15, deadline=None)
@given(bodies_in_one_place(), st.floats(0.0, 1.0))
def test_bodies_that_overlap_at_the_start_are_named_and_gain_no_energy(
    bodies: list[SceneBody], restitution: float
) -> None:
    material = Material(0.5, restitution=restitution)
    overlapping = tuple(replace(each, material=material) for each in bodies)
    apart = box("apart", (0.2, 0.2, 0.2), mass=1.0, pose=dynx.Pose((5.0, 0, 0)), twist=(0.5, 0, 0, 1, 2, 3))
    scene = Scene("overlap", bodies=(*overlapping, apart), gravity=(0.0, 0.0, 0.0))
    with World(scene, "dynx", H) as world, World(replace(scene, bodies=(apart,)), "dynx", H) as alone:
        first = world.overlaps()
        assert first
        notes = " ".join(map(str, world.notes))
        assert all(name in notes for name in (first[0].a, first[0].b))
        for _ in range(5):
            world.step(10)
            alone.step(10)
            for each in overlapping:
                T, twist = world.state.bodies[each.name]
                assert np.isfinite(T).all()
                assert np.abs(twist).max() <= 1e-9
            for mine, wanted in zip(world.state.bodies["apart"], alone.state.bodies["apart"], strict=True):
                assert np.array_equal(mine, wanted)


def is_singular(model: dynx.Model) -> bool:
    """Check whether a force on the model moves nothing with inertia."""
    M = dynx.backend("reference", model).mass_matrix(model.random(np.random.default_rng(0)))
    joints = model.nv - 6 * model.floating
    M[-joints:, -joints:] += np.diag([each.dynamics.armature for each in model.coordinate_joints])
    values = np.linalg.eigvalsh(M)
    return bool(values[0] <= 1e-12 * values[-1])


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10_000), st.booleans(), st.sets(st.integers(0, 3), min_size=1))
def test_links_without_mass_are_refused_by_name_or_move(
    seed: int, floating: bool, massless: set[int]
) -> None:
    model = random_robot(np.random.default_rng(seed), floating)
    nothing = Inertial(0.0, dynx.Pose(), 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    links = [
        replace(link, inertial=nothing if k in massless else link.inertial)
        for k, link in enumerate(model.links)
    ]
    joints = [replace(each, dynamics=replace(each.dynamics, armature=0.0)) for each in model.joints]
    light = type(model).build("light", links, joints, base=model.base, geometry=model.geometry)
    scene = scene_of(light, -0.3)
    if is_singular(light):
        with pytest.raises(SingularMassMatrixError) as raised:
            World(scene, "dynx", H)
        names = [each.name for each in links] + [each.name for each in joints]
        assert any(repr(name) in str(raised.value) for name in names)
        return
    with World(scene, "dynx", H) as world:
        for _ in range(20):
            world.step(5)
            assert np.isfinite([*world.state.robots["robot"].q, *world.state.robots["robot"].v]).all()


@pytest.mark.parametrize("mass", [0.0, -1.0, math.nan, math.inf])
def test_bodies_without_mass_are_refused_by_name(mass: float) -> None:
    with pytest.raises(ArgumentError, match=r"mass.*'weightless'|'weightless'.*mass"):
        Scene("s", bodies=(box("weightless", (1.0, 1.0, 1.0), mass=mass),))
