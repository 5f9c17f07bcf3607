"""DX501 to DX505: inertias against shapes, placeholders and ratios of mass."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynx.model.xml.source import XmlSource
from dynx.rules import Case, Rule, find_rule
from dynx.spatial.so3 import rotation_from_rpy
from tests.rules.documents import case_of, joint, link, visual

BEYOND, BELOW, OUTSIDE = find_rule("DX501"), find_rule("DX502"), find_rule("DX503")
PLACEHOLDER, RATIO = find_rule("DX504"), find_rule("DX505")

BOX = visual('<box size="0.2 0.4 0.6"/>')

# Corners of the boxes below, and how many points of mass lie within one.
masses_within = st.lists(st.tuples(st.floats(0.01, 5.0), *[st.floats(-1.0, 1.0)] * 3), min_size=1, max_size=6)
halves = st.tuples(*[st.floats(0.05, 0.5)] * 3).map(np.array)
angles = st.floats(-3.0, 3.0)


def body(points: np.ndarray, half: np.ndarray, rpy: tuple[float, float, float]) -> Case:
    """Return a link that is the points of mass (n, 4), each a mass and a place in units of the half box."""
    mass, places = points[:, 0], points[:, 1:] * half
    center = mass @ places / mass.sum()
    arms = places - center
    second = np.einsum("n,ni,nj->ij", mass, arms, arms)
    R = rotation_from_rpy(np.array(rpy))
    tensor = R.T @ (np.trace(second) * np.eye(3) - second) @ R
    numbers = {"ixx": tensor[0, 0], "ixy": tensor[0, 1], "ixz": tensor[0, 2]}
    numbers |= {"iyy": tensor[1, 1], "iyz": tensor[1, 2], "izz": tensor[2, 2]}
    inertia = " ".join(f'{name}="{float(value)!r}"' for name, value in numbers.items())
    xyz = " ".join(repr(float(value)) for value in center)
    turned = " ".join(repr(float(value)) for value in rpy)
    size = " ".join(repr(float(value)) for value in 2.0 * half)
    return case_of(
        f'<link name="base"><inertial><origin xyz="{xyz}" rpy="{turned}"/>'
        f'<mass value="{float(mass.sum())!r}"/>'
        f"<inertia {inertia}/></inertial>{visual(f'<box size={size!r}/>')}</link>"
    )


@given(masses_within.map(np.array), halves, st.tuples(angles, angles, angles))
def test_no_body_within_its_shape_is_called_impossible(
    points: np.ndarray, half: np.ndarray, rpy: tuple[float, float, float]
) -> None:
    case = body(points, half, rpy)
    assert BEYOND.detect(case) == []
    assert OUTSIDE.detect(case) == []


# 2 kg at the ends of an edge of the box: 0.1 m and 0.2 m from the axis along z.
EDGE = 2.0 * (0.1**2 + 0.2**2)


@pytest.mark.parametrize(("factor", "found"), [(0.99, 0), (1.01, 1)])
def test_the_bound_on_a_moment_is_that_of_mass_in_the_corners(factor: float, found: int) -> None:
    # All in the plane z = 0, so that the mass is spread along x and y as in the corners.
    moments = (0.8 * factor * EDGE, 0.2 * factor * EDGE, factor * EDGE)
    detections = BEYOND.detect(case_of(link("base", BOX, mass=2.0, moments=moments)))
    assert len(detections) == found
    if found:
        assert detections[0].link == "base"
        assert "1.01 times the 0.1 " in detections[0].message


@pytest.mark.parametrize(
    ("z", "spread", "found"),
    [(0.1, 0.31, 0), (0.1, 0.33, 1), (0.25, 0.19, 0), (0.25, 0.21, 1), (-0.29, 0.11, 0), (-0.29, 0.13, 1)],
)
def test_the_spread_along_a_line_is_bounded_by_its_ends(z: float, spread: float, found: int) -> None:
    # The box reaches 0.3 - z up and 0.3 + z down, widened by 0.0075 m; bounds are 0.29, 0.18 and 0.1 m.
    square, across = spread**2, 1e-4
    moments = (across + square, across + square, 2.0 * across)
    case = case_of(link("base", BOX, mass=1.0, moments=moments, center=(0.0, 0.0, z)))
    detections = BEYOND.detect(case)
    assert len(detections) == found
    if found:
        assert f"the mass is spread by {spread:.3g} m (root mean square) along 0 0 1" in detections[0].message


def test_a_mesh_counts_as_its_hull(tmp_path: Path) -> None:
    # A pyramid, seen from half its height along a line that ends in the empty corner of its box.
    corners = [(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0), (0, 0, 1)]
    lines = [f"v {x} {y} {z}" for x, y, z in corners]
    faces = ["f 1 3 2", "f 1 4 3", "f 1 2 5", "f 2 3 5", "f 3 4 5", "f 4 1 5"]
    (tmp_path / "pyramid.obj").write_text("\n".join((*lines, *faces)))
    shape = visual('<mesh filename="pyramid.obj"/>')
    for square, found in ((0.4, 0), (0.6, 1)):
        half = square / 2.0
        part = link("base", shape, moments=(half, square, half), center=(0.0, 0.0, 0.5))
        path = tmp_path / "robot.urdf"
        case = case_of(part.replace('ixz="0"', f'ixz="{-half}"'), source=path)
        path.write_bytes(case.source.data)
        detections = BEYOND.detect(case)
        assert len(detections) == found
        assert all("along 0.71 0 0.71" in each.message for each in detections)


@pytest.mark.parametrize("attached", [False, True])
def test_messages_name_the_shapes_of_links_on_fixed_joints(attached: bool) -> None:
    parts = [
        link("base", visual('<box size="0.2 0.2 0.2"/>'), center=(0.0, 0.0, 3.0), moments=(9.0, 9.0, 9.0))
    ]
    if attached:
        parts += [link("cover", BOX), joint("bolt", "base", "cover", type="fixed")]
    words = "the shapes of the link and those fixed to it" if attached else "the link's shape"
    for rule in (BEYOND, OUTSIDE):
        (message,) = (each.message for each in rule.detect(case_of(*parts)) if each.link == "base")
        assert message.endswith(words)


def test_a_sphere_of_a_shell_has_the_bound_itself() -> None:
    moments = (0.5, 0.5, 0.5)
    sphere = visual('<sphere radius="0.5"/>')
    assert BEYOND.detect(case_of(link("base", sphere, mass=2.0, moments=moments))) == []


def test_a_shape_without_extent_is_a_placeholder_and_no_bound() -> None:
    assert BEYOND.detect(case_of(link("base", visual('<sphere radius="0"/>')))) == []
    both = visual('<sphere radius="0"/>'), visual('<sphere radius="0.01"/>')
    assert len(BEYOND.detect(case_of(link("base", *both)))) == 1


@given(st.floats(1e-9, 1e9))
def test_below_does_not_depend_on_the_unit_of_mass(unit: float) -> None:
    size = 0.2**2 + 0.4**2 + 0.6**2  # the diagonal, squared
    for share, found in ((1.1e-4, 0), (0.9e-4, 1)):
        moment = share * size * unit
        case = case_of(link("base", BOX, mass=unit, moments=(moment, moment, moment)))
        assert len(BELOW.detect(case)) == found


def test_no_inertia_at_all_is_below() -> None:
    (found,) = BELOW.detect(case_of(link("base", BOX, moments=(0.0, 0.0, 0.0))))
    assert found.link == "base"


def test_the_shape_of_a_welded_link_makes_no_inertia_too_small() -> None:
    wall = visual('<box size="90 90 90"/>')
    frame = f'<link name="wall">{wall}</link>'
    case = case_of(link("base", BOX), frame, joint("weld", "base", "wall", type="fixed"))
    assert BELOW.detect(case) == []


@pytest.mark.parametrize(
    ("center", "found"),
    [((0.1, 0.2, 0.3), 0), ((0.0, 0.0, 0.305), 0), ((0.0, 0.0, 0.31), 1), ((-0.2, 0.0, 0.0), 1)],
)
def test_a_center_of_mass_beside_the_box(center: tuple[float, float, float], found: int) -> None:
    assert len(OUTSIDE.detect(case_of(link("base", BOX, center=center)))) == found


@pytest.mark.parametrize("rule", [BEYOND, BELOW, OUTSIDE])
def test_without_a_known_shape_nothing_is_said(rule: Rule) -> None:
    lost = visual('<mesh filename="gone.stl"/>')
    for shapes in ((), (BOX, lost)):
        case = case_of(link("base", *shapes, moments=(1e9, 1e9, 1e-9), center=(9.0, 9.0, 9.0)))
        assert rule.detect(case) == []


def test_the_unit_matrix_is_a_placeholder() -> None:
    ones = (1.0, 1.0, 1.0)
    case = case_of(link("base", moments=ones, mass=0.3), link("arm"), joint("j", "base", "arm"))
    (found,) = PLACEHOLDER.detect(case)
    assert found.link == "base"


@pytest.mark.parametrize(
    ("masses", "moments", "found"),
    [
        ((1.0, 2.0, 3.0), (0.01, 0.01, 0.01), 3),
        ((1.0, 1.0, 1.0), (0.01, 0.01, 0.01), 0),
        ((1.0, 2.0, 3.0), (0.01, 0.01, 0.02), 0),
        ((1.0, 2.0), (0.01, 0.01, 0.01), 0),
        ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0),
    ],
)
def test_one_tensor_for_links_of_different_mass(
    masses: tuple[float, ...], moments: tuple[float, float, float], found: int
) -> None:
    links = [link(f"link{k}", mass=mass, moments=moments) for k, mass in enumerate(masses)]
    joints = [joint(f"j{k}", f"link{k}", f"link{k + 1}") for k in range(len(masses) - 1)]
    assert len(PLACEHOLDER.detect(case_of(*links, *joints))) == found


@given(st.floats(1e-3, 1e3), st.floats(-8.0, 8.0).filter(lambda x: abs(abs(x) - 6.0) > 1e-3))
def test_masses_a_million_apart(mass: float, exponent: float) -> None:
    case = case_of(
        link("base", mass=mass),
        link("half", mass=0.5 * mass * 10.0**exponent),
        link("other_half", mass=0.5 * mass * 10.0**exponent),
        joint("turn", "base", "half"),
        joint("weld", "half", "other_half", type="fixed"),
    )
    found = RATIO.detect(case)
    assert len(found) == (abs(exponent) > 6.0)
    for each in found:
        assert (each.link, each.joint) == ("half" if exponent < 0.0 else "base", "turn")


def test_a_body_without_mass_is_another_matter() -> None:
    case = case_of(link("base"), link("arm", mass=0.0), joint("turn", "base", "arm"))
    assert RATIO.detect(case) == []


def test_lines_are_those_of_the_file() -> None:
    text = '<robot name="r">\n\n  <link name="base">\n<inertial><mass value="1"/>\n'
    text += '<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link></robot>'
    (found,) = PLACEHOLDER.detect(Case(XmlSource(text)))
    assert found.line == 4
