"""The compiled step with contacts and a step of a world on the engine dynx: the same laws, the same state."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from hypothesis import HealthCheck, Phase, assume, given, settings
from hypothesis import strategies as st

import dynx
from dynx.compiled.contact_step import contact_step_text, shapes_on_plane
from dynx.compiled.step import compiled
from dynx.engines.own.impulses import MAX_RESIDUAL
from dynx.model import Model
from dynx.model.elements import Joint, JointDynamics, Limits, Link
from dynx.model.geometry import Box, Capsule, Collision, Geometry, Shape, Sphere
from dynx.model.geometry.links import LinkGeometry
from dynx.rbd.contact_step import Sweeps, contact_rows
from dynx.spatial.scalar import Floats
from dynx.spatial.se3 import homogeneous
from dynx.world import Material, Motor, PositionMotor, Scene, SceneRobot, World, ground
from dynx.world.preparation import prepare
from tests.same.rewrites import random_rotation
from tests.same.test_named_elements import random_inertial

H, FRICTION = 1e-3, 0.6
TIGHT = Sweeps(tolerance=1e-11, most=2000)
AGREEMENT = 1e-8
"""Largest difference of velocities [m/s, rad/s] where the residual is below a hundredth of it."""


def random_pose(rng: np.random.Generator, reach: float) -> dynx.Pose:
    return dynx.Pose.from_matrix(homogeneous(random_rotation(rng), rng.uniform(-reach, reach, 3)))


def random_robot(rng: np.random.Generator, floating: bool) -> Model:
    """Return a tree of links with a sphere, capsule or box each, whose joints have limits, damping and
    armature, and some of them friction and springs."""
    shapes: list[Shape] = [Sphere(0.05), Capsule(0.04, 0.15), Box((0.1, 0.2, 0.15))]
    links, joints, collisions = [], [], {}
    for k in range(int(rng.integers(2, 5))):
        name = f"link_{k}"
        links.append(Link(name, random_inertial(rng)))
        shape = Collision(shapes[int(rng.integers(3))], random_pose(rng, 0.1))
        collisions[name] = LinkGeometry(collisions=(shape,))
        if k == 0:
            continue
        axis = rng.standard_normal(3)
        x, y, z = (axis / np.linalg.norm(axis)).tolist()
        friction, spring = float(rng.choice([0.0, 0.5])), float(rng.choice([0.0, 20.0]))
        joints.append(
            Joint(
                f"joint_{k}",
                "revolute" if rng.random() < 0.7 else "prismatic",
                f"link_{rng.integers(max(0, k - 2), k)}",
                name,
                random_pose(rng, 0.3),
                (x, y, z),
                Limits(-0.3, 0.3, 5.0, 9.0),
                dynamics=JointDynamics(0.1, friction, 0.02, spring, 0.1 if spring else 0.0),
            )
        )
    return Model.build(
        "tree", links, joints, base="floating" if floating else "fixed", geometry=Geometry(collisions)
    )


def scene_of(model: Model, height: float = 0.0) -> Scene:
    rough = Material(friction=FRICTION)
    below = ground(pose=dynx.Pose((0.0, 0.0, height)), material=rough)
    return Scene("ground", robots=(SceneRobot("robot", model, material=rough),), bodies=(below,))


def world_step(scene: Scene, q: Floats, v: Floats, *motors: Motor) -> tuple[Floats, Floats]:
    """Return q and v after a step of a world with motors."""
    with World(scene, "dynx", H) as world:
        world.set_state(robots={"robot": (q, v)})
        world.step(motors={"robot": motors})
        assert not any("missed" in str(note) for note in world.notes)
        state = world.state.robots["robot"]
        return np.asarray(state.q), np.asarray(state.v)


NO_SHRINKING = (Phase.explicit, Phase.reuse, Phase.generate)

OPTIONS = dict.fromkeys(
    ("collisions", "joint_limits", "joint_damping", "joint_friction", "joint_armature", "joint_springs"), True
)


@settings(max_examples=12, deadline=None, phases=NO_SHRINKING, suppress_health_check=list(HealthCheck))
@given(
    st.integers(0, 10_000),
    st.booleans(),
    st.sampled_from([-1e-3, 0.0, 2e-4]),
    st.sampled_from([(0.0, 0.0), (50.0, 1.0), (1e4, 100.0)]),
)
def test_a_random_tree_moves_as_in_a_world(
    seed: int, floating: bool, gap: float, gains: tuple[float, float]
) -> None:
    """Shapes overlap by 1 mm, touch, or close a gap; joints begin inside, at and beyond their limits."""
    rng = np.random.default_rng(seed)
    model = random_robot(rng, floating)
    n = len(model.mechanism.bodies)
    q = model.neutral()
    if floating:
        q[3:7] = rng.standard_normal(4)
        q[3:7] /= np.linalg.norm(q[3:7])
    q[len(q) - n :] = rng.choice([-0.301, -0.3, -0.2, 0.1, 0.2999, 0.3], n)
    v = rng.uniform(-0.5, 0.5, model.nv)
    touching = shapes_on_plane(prepare(scene_of(model), **OPTIONS))
    assume(touching.shapes)
    rows, gaps = contact_rows(model.mechanism, touching, q)
    lowest = int(np.argmin(gaps))
    height = float(gaps[lowest]) - gap
    # The lowest point goes down.
    v = v if sum(each * v[model.nv - 1 - k] for k, each in rows[3 * lowest].items()) < 0.0 else -v
    scene = scene_of(model, height)
    touching = shapes_on_plane(prepare(scene, **OPTIONS))
    (kp, kd), target = gains, rng.uniform(-0.3, 0.3, n)
    text = contact_step_text(model, touching, h=H, kp=kp, kd=kd, joint_limits=True, sweeps=TIGHT)
    impulses = np.zeros(text.inputs["impulses"])
    results = text.function(q=q, v=v, target=target, impulses=impulses)
    found = {name: np.asarray(values, dtype=float) for name, values in results.items()}
    # Sweeps converge slowly where a heavy part rests on a light one.
    assume(found["residual"][0] < 0.01 * AGREEMENT)
    motor = PositionMotor(target, kp, kd)
    wanted_q, wanted_v = world_step(scene, q, v, motor)
    np.testing.assert_allclose(found["v"], wanted_v, rtol=0.0, atol=AGREEMENT)
    np.testing.assert_allclose(found["q"], wanted_q, rtol=0.0, atol=H * MAX_RESIDUAL)


def test_a1_moves_as_in_a_world() -> None:
    model, (kp, kd), n = dynx.load("a1", base="floating"), (100.0, 2.0), 3
    scene = scene_of(model)
    # The other shapes are above the ground.
    touching = shapes_on_plane(prepare(scene, **OPTIONS), deepest=True)
    lower = [each for each in touching.shapes if model.mechanism.frames[each.frame].name.endswith("_calf")]
    touching = replace(touching, shapes=tuple(lower))
    assert len(lower) == 8
    text = contact_step_text(model, touching, h=H, kp=kp, kd=kd, joint_limits=True, sweeps=TIGHT)
    rng = np.random.default_rng(3)
    q, v = np.tile(model.neutral(), (n, 1)), rng.uniform(-1.0, 1.0, (n, model.nv))
    v[:, 2] = -0.5
    q[:, 3:6] = rng.uniform(-0.1, 0.1, (n, 3))
    q[:, 3:7] /= np.linalg.norm(q[:, 3:7], axis=1, keepdims=True)
    q[:, 7:] = np.tile([0.0, 0.9, -1.8], 4) + rng.uniform(-0.2, 0.2, (n, 12))
    target = q[:, 7:] + rng.uniform(-0.3, 0.3, (n, 12))
    kernel = compiled(text)
    given = {"q": q, "v": v, "target": target, "impulses": np.zeros((n, text.inputs["impulses"]))}
    for k in range(n):
        gaps = [float(gap) for gap in contact_rows(model.mechanism, touching, q[k])[1]]
        q[k, 2] += (1e-3, 0.0, -1e-3)[k] - sorted(gaps)[1]
    results = [np.empty((n, port.size)) for port in kernel.outputs]
    kernel([given[port.name] for port in kernel.inputs], results)
    found = dict(zip([port.name for port in kernel.outputs], results, strict=True))
    assert found["residual"].max() < 0.01 * AGREEMENT
    for k in range(n):
        wanted_q, wanted_v = world_step(scene, q[k], v[k], PositionMotor(target[k], kp, kd))
        np.testing.assert_allclose(found["v"][k], wanted_v, rtol=0.0, atol=AGREEMENT)
        np.testing.assert_allclose(found["q"][k], wanted_q, rtol=0.0, atol=H * MAX_RESIDUAL)
    assert np.count_nonzero(found["impulses"][:, : 3 * len(touching.shapes) : 3], axis=1).min() >= 1
