"""DX517 to DX519: masses against the size of the body, and no alarm on real robots."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynx.doctor.mending import readable
from dynx.model.library import find, robots
from dynx.model.xml.source import XmlSource
from dynx.rules import Case, find_rule
from tests.rules.documents import case_of, joint, link, visual

REAL = sorted(
    entry.name for entry in robots() if entry.source == "example-robot-data" and entry.name[0] in "abgps"
)
masses = st.floats(-6.0, 6.0).map(lambda power: 10.0**power)
sides = st.floats(0.01, 1.0)


def found(rule: str, case: Case) -> list[str | None]:
    """Name the links that a rule finds."""
    return [each.link for each in find_rule(rule).detect(case)]


@given(mass=masses, x=sides, y=sides, z=sides)
def test_density_is_mass_over_the_box_of_the_shape(mass: float, x: float, y: float, z: float) -> None:
    case = case_of(link("part", visual(f'<box size="{x!r} {y!r} {z!r}"/>', "1 2 3", "0 0 0"), mass=mass))
    density, diagonal = mass / (x * y * z), (x * x + y * y + z * z) ** 0.5
    thin = min(x, y, z) < 0.011 * diagonal
    if not thin and not 0.99 < density < 1.01 and not 24_999.0 < density < 25_001.0:
        assert found("DX517", case) == ["part"] * (not 1.0 < density < 25_000.0)


def test_a_thin_plate_is_as_thick_as_a_hundredth_of_its_diagonal() -> None:
    plate = visual('<box size="1 1 0.00001"/>')
    assert found("DX517", case_of(link("plate", plate, mass=10.0))) == []
    assert found("DX517", case_of(link("plate", plate, mass=1000.0))) == ["plate"]


ROUND = {
    "sphere": (lambda radius, length: 4.0 / 3.0 * math.pi * radius**3),
    "cylinder": (lambda radius, length: math.pi * radius**2 * length),
    "capsule": (lambda radius, length: math.pi * radius**2 * (length + 4.0 / 3.0 * radius)),
}
"""Volumes of round shapes of a radius and a length [m]."""


@pytest.mark.parametrize("tag", ROUND)
@pytest.mark.parametrize(("density", "count"), [(1.001, 0), (0.999, 1), (0.1, 1)])
@given(radius=sides, length=sides)
def test_round_shapes_are_lighter_than_air_for_their_own_volume(
    tag: str, density: float, count: int, radius: float, length: float
) -> None:
    volume = ROUND[tag](radius, length)
    sizes = f'radius="{radius!r}"' + (f' length="{length!r}"' if tag != "sphere" else "")
    case = case_of(link("part", visual(f"<{tag} {sizes}/>"), mass=repr(density * volume)))
    messages = [each.message for each in find_rule("DX517").detect(case)]
    assert len(messages) == count
    assert all(f"of {volume:.3g} m^3 is {density:.3g} kg/m^3" in each for each in messages)


def test_a_mesh_is_lighter_than_air_for_its_hull(tmp_path: Path) -> None:
    corners = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)]
    text = [*(f"v {x} {y} {z}" for x, y, z in corners), "f 1 3 2", "f 1 2 4", "f 2 3 4", "f 1 4 3"]
    (tmp_path / "corner.obj").write_text("\n".join(text))
    for mass, count in (("0.17", 0), ("0.16", 1)):  # A sixth of a cubic metre.
        path = tmp_path / "robot.urdf"
        case = case_of(link("part", visual('<mesh filename="corner.obj"/>'), mass=mass), source=path)
        path.write_bytes(case.source.data)
        assert len(found("DX517", case)) == count


def test_the_message_multiplies_out() -> None:
    case = case_of(link("part", visual('<cylinder radius="0.01" length="0.1"/>'), mass=2.0))
    (detection,) = find_rule("DX517").detect(case)
    assert detection.message == "2 kg in a box of 0.02 x 0.02 x 0.1 m is 5e+04 kg/m^3"


def test_rigidly_connected_shapes_count_together() -> None:
    parts = (
        link("cover", visual('<box size="0.5 0.5 0.5"/>'), mass=0.1),
        link("core", mass=60.0),
        joint("bolt", "cover", "core", type="fixed"),
    )
    assert found("DX517", case_of(*parts)) == []


def test_a_missing_mesh_and_a_shape_of_size_zero_tell_nothing() -> None:
    for shape in ('<mesh filename="gone.stl"/>', '<box size="0 0 0"/>'):
        assert found("DX517", case_of(link("part", visual(shape), mass=1e9))) == []


@given(mass=masses.map(lambda mass: mass * 1e-6))
def test_a_mass_below_a_microgram(mass: float) -> None:
    assert found("DX518", case_of(link("frame", mass=repr(mass)))) == ["frame"] * (mass < 1e-9)


@pytest.mark.parametrize("mass", ["0", "2e-15", "1e-9"])
def test_masses_that_are_meant(mass: str) -> None:
    assert found("DX518", case_of(link("frame", mass=mass))) == []


def hand(finger: float, scale: float = 1.0, shape: str = "") -> Case:
    """Make a hand of links some centimetres long, with a finger of this mass [kg]."""
    parts = [link(name, mass=0.1, center=(0.0, 0.0, 0.02 * scale)) for name in ("palm", "knuckle")]
    parts.append(link("finger", *([shape] if shape else []), mass=finger, center=(0.0, 0.0, 0.02 * scale)))
    for name, parent, child in (("spread", "palm", "knuckle"), ("bend", "knuckle", "finger")):
        parts.append(joint(name, parent, child, f'<origin xyz="0 0 {0.05 * scale}"/>'))
    return case_of(*parts)


@pytest.mark.parametrize(
    ("mass", "scale", "expected"),
    [(0.056, 1.0, []), (56.0, 1.0, []), (56e3, 1.0, ["finger"]), (56e3, 100.0, []), (56.0, 1e-4, [])],
)
def test_the_joints_tell_the_size_where_no_shape_does(mass: float, scale: float, expected: list[str]) -> None:
    assert found("DX519", hand(mass, scale)) == expected


def test_a_shape_tells_more_than_the_joints() -> None:
    case = hand(56e3, shape=visual('<box size="0.02 0.02 0.05"/>'))
    assert found("DX519", case) == []
    assert found("DX517", case) == ["finger"]


def test_concentric_joints_have_the_size_of_the_robot() -> None:
    parts = [link(name, mass=2.0) for name in ("x", "y", "z")]
    parts += [link("arm", mass=1.0, center=(0.3, 0.0, 0.0))]
    ends = (("a", "x", "y"), ("b", "y", "z"), ("c", "z", "arm"))
    assert found("DX519", case_of(*parts, *(joint(*each) for each in ends))) == []


@pytest.mark.long_cases
@pytest.mark.parametrize("name", REAL)
def test_real_robots_are_plausible(name: str) -> None:
    path = find(name)
    case = readable(Case(XmlSource(path.read_bytes(), str(path)))).case
    for rule in ("DX517", "DX518", "DX519"):
        assert case.readable
        assert found(rule, case) == []
