"""One meaning of friction: the geometric mean of two surfaces, measured by sliding, on every engine."""

from __future__ import annotations

from dataclasses import FrozenInstanceError
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynx import Pose
from dynx.errors import UnsupportedFeatureError
from dynx.steppers.mean_coefficients import contact_priorities, pair_terms
from dynx.world import Material, Scene, World, box, contact_material, ground, sphere
from tests.world.engines import WORLDS
from tests.world.materials import (
    SLIDERS,
    G,
    four_materials,
    mean_rebound,
    rebound,
    sliding_friction,
    speed_on_slope,
)

TOLERANCE = {"pybullet": 0.02, "mujoco": 0.05, "drake": 0.001}
"""Relative error of the mean deceleration; sliding bodies rattle in Bullet and hop a little in MuJoCo."""

RATTLES = {("drake", "mesh")}
"""Bodies that do not slide flat in an engine."""

KINDS = [(engine, kind) for engine in WORLDS for kind in SLIDERS if (engine, kind) not in RATTLES]


@pytest.mark.parametrize(("engine", "kind"), KINDS)
@pytest.mark.parametrize(("a", "b"), [(0.1, 1.5), (1.5, 0.5), (0.5, 0.1)])
def test_two_materials_slide_by_the_mean_of_their_friction(
    engine: str, kind: str, a: float, b: float, tmp_path: Path
) -> None:
    found = sliding_friction(kind, engine, Material(friction=a), Material(friction=b), tmp_path)
    assert found == pytest.approx(np.sqrt(a * b), rel=TOLERANCE[engine])


@pytest.mark.parametrize(("engine", "kind"), KINDS)
def test_the_angle_of_slip_is_that_of_the_mean(engine: str, kind: str, tmp_path: Path) -> None:
    a, b = Material(friction=0.3), Material(friction=0.8)
    mean = np.sqrt(0.24)
    assert abs(speed_on_slope(kind, engine, a, b, 0.95 * mean, tmp_path)) < 1e-3
    slides = speed_on_slope(kind, engine, a, b, 1.05 * mean, tmp_path)
    assert slides == pytest.approx(1.0 - 1.0 / 1.05, abs=0.006)


@pytest.mark.parametrize("engine", WORLDS)
def test_a_surface_without_friction_has_none_with_any_other(engine: str, tmp_path: Path) -> None:
    rough, smooth = Material(friction=1.5), Material(friction=0.0)
    assert abs(sliding_friction("box", engine, rough, smooth, tmp_path)) < 1e-9
    assert abs(sliding_friction("box", engine, smooth, rough, tmp_path)) < 1e-9


@pytest.mark.parametrize("engine", [*WORLDS, "mujoco without pairs"])
def test_every_pair_of_a_scene_of_many_materials_has_its_mean(
    engine: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    name, _, without = engine.partition(" ")
    if without:
        monkeypatch.setattr("dynx.engines.mujoco.materials.MAX_PAIRS", 0)
    with World(four_materials(), name) as world:
        assert [each for each in world.inexact_materials() if each.quantity == "friction"] == []
        world.run(0.1)
        before = {slab: state.twist[0] for slab, state in world.state.bodies.items()}
        world.run(0.4)
        after = {slab: state.twist[0] for slab, state in world.state.bodies.items()}
        contacts = world.contacts()
    for k, friction in enumerate((0.1, 0.4, 0.9)):
        found = (before[f"slab{k}"] - after[f"slab{k}"]) / 0.4 / G
        assert found == pytest.approx(0.5 * np.sqrt(friction), rel=0.05)
    if engine == "drake":
        # One contact for each slab, although its shapes are registered more than once.
        assert sorted(contact.b for contact in contacts) == ["slab0", "slab1", "slab2"]
        assert all(contact.normal_force == pytest.approx(2.0 * G, rel=0.01) for contact in contacts)


@pytest.mark.parametrize("kind", ["ball", "box", "mesh", "link", "capsule"])
@pytest.mark.parametrize(("a", "b"), [(0.0, 1.0), (0.2, 0.2), (0.25, 1.0), (1.0, 0.64), (1.0, 1.0)])
def test_bodies_rebound_in_pybullet_with_the_mean_of_two_materials(
    kind: str, a: float, b: float, tmp_path: Path
) -> None:
    found = rebound(kind, "pybullet", Material(restitution=a), Material(restitution=b), tmp_path)
    assert found == pytest.approx(a * b, abs=0.02)


@pytest.mark.parametrize("restitution", [0.2, 0.5, 0.8, 1.0])
def test_the_error_of_a_rebound_in_pybullet_falls_with_the_step(restitution: float, tmp_path: Path) -> None:
    material = Material(restitution=restitution)
    for dt in (4e-3, 1e-3, 2.5e-4):
        for height in (1.0, 0.987, 0.4):
            found = rebound("ball", "pybullet", material, material, tmp_path, dt, height)
            # Of the way in a step, and of the penetration that is removed in it (0.2 s is the time constant).
            way = np.sqrt(2.0 * G * height) * dt / height
            assert abs(found - restitution**2) < way + 2.0 * dt / 0.2


@pytest.mark.parametrize("kind", ["ball", "box", "mesh", "link"])
@pytest.mark.parametrize(("a", "b"), [(0.0, 1.0), (0.2, 0.2), (0.25, 1.0), (1.0, 0.64), (1.0, 1.0)])
def test_bodies_rebound_in_mujoco_with_the_mean_of_two_materials(
    kind: str, a: float, b: float, tmp_path: Path
) -> None:
    mean, _ = mean_rebound(kind, "mujoco", Material(restitution=a), Material(restitution=b), tmp_path)
    assert mean == pytest.approx(a * b, abs=0.025)


def test_bouncy_boxes_rest_in_a_stack_and_continue_bit_for_bit() -> None:
    bouncy = Material(restitution=0.8)
    boxes = tuple(
        box(f"b{k}", (0.2, 0.2, 0.1), mass=1.0, pose=Pose((0, 0, 0.051 + 0.101 * k)), material=bouncy)
        for k in range(5)
    )
    scene = Scene("stack", bodies=(ground(material=bouncy), *boxes))
    with World(scene, "pybullet") as world:
        world.run(0.4)
        saved = world.save()
        world.run(1.0)
        ends = [world.state.bodies[each.name].T_world_body for each in boxes]
        force = sum(contact.normal_force for contact in world.contacts() if contact.a == "ground")
        world.restore(saved)
        world.run(1.0)
        again = [world.state.bodies[each.name].T_world_body for each in boxes]
    assert np.array_equal(ends, again)
    assert force == pytest.approx(5.0 * G, rel=1e-3)
    for k, T in enumerate(ends):
        assert T[2, 3] == pytest.approx(0.05 + 0.1 * k, abs=5e-4)


@pytest.mark.parametrize("engine", ["pybullet", "mujoco"])
@pytest.mark.parametrize(("a", "b"), [((0.5, 0.001), (0.5, 0.001)), ((0.2, 0.001), (0.9, 0.004))])
def test_torsional_and_rolling_friction_are_means_too(
    engine: str, a: tuple[float, float], b: tuple[float, float]
) -> None:
    mean, inertia = float(np.sqrt(a[1] * b[1])), 0.4 * 0.1**2
    materials = [Material(friction, turning, turning) for friction, turning in (a, b)]
    surface = ground(material=materials[1])
    for axis, twist in ((5, (0, 0, 0, 0, 0, 6.0)), (4, (0.6, 0, 0, 0, 6.0, 0))):
        ball = sphere("ball", 0.1, mass=1.0, pose=Pose((0, 0, 0.1)), twist=twist, material=materials[0])
        with World(Scene("s", bodies=(surface, ball)), engine) as world:
            world.run(0.1)
            before = world.state.bodies["ball"].twist[axis]
            world.run(0.2)
            slowed = (before - world.state.bodies["ball"].twist[axis]) / 0.2
        # A rolling ball turns about its point of contact.
        about = inertia + (0.1**2 if axis == 4 else 0.0)
        assert slowed * about / G == pytest.approx(mean, rel=0.05 if engine == "mujoco" else 0.01)


def test_what_an_engine_lacks_is_named_and_refused_where_asked() -> None:
    sticky, other = Material(20.0, 0.02, 0.02), Material(5.0, 0.02, 0.3)
    balls = (
        sphere("one", 0.1, mass=1.0, material=sticky),
        sphere("two", 0.1, mass=1.0, pose=Pose((1, 0, 0)), material=sticky),
        sphere("three", 0.1, mass=1.0, pose=Pose((2, 0, 0)), material=other),
        sphere("four", 0.1, mass=1.0, pose=Pose((3, 0, 0)), material=other),
    )
    scene = Scene("s", bodies=balls)
    lacks = {
        "pybullet": {"friction", "rolling_friction"},
        "mujoco": set(),
        "drake": {"torsional_friction", "rolling_friction"},
    }
    for engine, quantities in lacks.items():
        with World(scene, engine, dt=2e-4) as world:
            found = world.inexact_materials()
            assert {*map(str, found)} <= {*world.notes}
        assert {each.quantity for each in found} >= quantities
        assert {each.quantity for each in found} <= quantities | {"torsional_friction"}
        for each in found:
            wanted = contact_material(scene.material(each.pairs[0][0]), scene.material(each.pairs[0][1]))
            assert each.wanted == pytest.approx(getattr(wanted, each.quantity))
            assert each.quantity in str(each)
        if quantities:
            with pytest.raises(UnsupportedFeatureError, match=found[0].quantity):
                World(scene, engine, dt=2e-4, strict_materials=True)
        else:
            World(scene, engine, dt=2e-4, strict_materials=True).close()


@st.composite
def surfaces(draw: st.DrawFn) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Draw the materials of surfaces, a number for each two of the materials, and which surfaces touch."""
    n, m = draw(st.integers(1, 9)), draw(st.integers(1, 4))
    materials = np.array(draw(st.lists(st.integers(0, m - 1), min_size=n, max_size=n)))
    values = draw(st.lists(st.integers(0, 3), min_size=m * m, max_size=m * m))
    of_two = np.array(values).reshape(m, m)
    bits = np.array(draw(st.lists(st.booleans(), min_size=n * n, max_size=n * n))).reshape(n, n)
    touch = np.triu(bits, 1)
    return materials, np.triu(of_two) + np.triu(of_two, 1).T, touch | touch.T


@given(surfaces())
def test_priorities_and_pairs_give_every_contact_its_combination(
    drawn: tuple[np.ndarray, np.ndarray, np.ndarray],
) -> None:
    materials, combination, touch = drawn
    found = contact_priorities(materials, combination, touch)
    pairs = {frozenset(pair) for pair in found.pairs}
    assert len(pairs) == len(found.pairs)
    assert all(touch[pair] for pair in found.pairs)
    for i, j in np.argwhere(touch).tolist():
        wanted = combination[materials[i], materials[j]]
        high = i if found.priority[i] >= found.priority[j] else j
        if frozenset([i, j]) in pairs:
            # Only a contact that the priorities would give another combination is one by itself.
            assert found.combination[high] != wanted
            continue
        assert found.combination[high] == wanted
        if found.priority[i] == found.priority[j]:
            # Of equal priorities MuJoCo mixes both.
            assert found.combination[i] == found.combination[j]


@given(surfaces())
def test_terms_are_exact_on_a_star_and_never_negative(
    drawn: tuple[np.ndarray, np.ndarray, np.ndarray],
) -> None:
    materials, sums, touch = drawn
    sums = sums + 1.0
    assert (pair_terms(materials, sums, touch) >= 0.0).all()
    star = np.zeros_like(touch)
    star[0, 1:] = star[1:, 0] = True
    terms = pair_terms(materials, sums, star)
    np.testing.assert_allclose(terms[0] + terms[1:], sums[materials[0], materials[1:]], rtol=1e-12)


def test_the_default_surface_has_friction_alone() -> None:
    default = Material()
    assert (default.friction, default.torsional_friction, default.rolling_friction) == (0.5, 0.0, 0.0)
    assert default.restitution == 0.0
    with pytest.raises(FrozenInstanceError):
        default.friction = 1.0  # type: ignore[misc]
