"""Shapes of a link: primitives are held by their extent, and tightly."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from dynx.model.elements import Pose
from dynx.rules.geometry import group_extents, link_extent
from dynx.spatial.scalar import Floats
from tests.rules.documents import case_of, joint, link, visual

sizes = st.floats(0.01, 2.0)
angles = st.floats(-3.0, 3.0)
places = st.tuples(*[st.floats(-1.0, 1.0)] * 3)
turns = st.tuples(angles, angles, angles)

ROUNDING = 256.0 * float(np.finfo(float).eps)
"""Points are at most 6 m from the origin, after a dozen operations."""


def words(values: tuple[float, ...]) -> str:
    """Numbers as an attribute has them."""
    return " ".join(map(repr, values))


def placed(points: Floats, xyz: tuple[float, ...], rpy: tuple[float, ...]) -> Floats:
    """Points (n, 3) of a shape in the link frame."""
    T = Pose((xyz[0], xyz[1], xyz[2]), (rpy[0], rpy[1], rpy[2])).matrix
    return np.asarray(points @ T[:3, :3].T + T[:3, 3])


def box_of(shape: str, xyz: tuple[float, ...], rpy: tuple[float, ...]) -> tuple[Floats, Floats]:
    """Return the box about one visual."""
    case = case_of(link("base", visual(shape, words(xyz), words(rpy))))
    extent = link_extent(case.links["base"], "<string>")
    assert extent is not None
    return extent.box()


@given(st.tuples(sizes, sizes, sizes), places, turns)
def test_a_box_has_its_corners(
    size: tuple[float, ...], xyz: tuple[float, ...], rpy: tuple[float, ...]
) -> None:
    low, high = box_of(f'<box size="{words(size)}"/>', xyz, rpy)
    signs = np.array([[i, j, k] for i in (-0.5, 0.5) for j in (-0.5, 0.5) for k in (-0.5, 0.5)])
    corners = placed(signs * np.array(size), xyz, rpy)
    assert np.max(np.abs(low - corners.min(axis=0))) <= ROUNDING
    assert np.max(np.abs(high - corners.max(axis=0))) <= ROUNDING


@given(sizes, places, turns)
def test_a_sphere_has_its_poles(radius: float, xyz: tuple[float, ...], rpy: tuple[float, ...]) -> None:
    low, high = box_of(f'<sphere radius="{radius!r}"/>', xyz, rpy)
    assert np.max(np.abs(low - (np.array(xyz) - radius))) <= ROUNDING
    assert np.max(np.abs(high - (np.array(xyz) + radius))) <= ROUNDING


@given(sizes, sizes, places, turns, st.booleans())
def test_a_cylinder_and_a_capsule_are_held_and_not_by_much_more(
    radius: float, length: float, xyz: tuple[float, ...], rpy: tuple[float, ...], capsule: bool
) -> None:
    shape = "capsule" if capsule else "cylinder"
    low, high = box_of(f'<{shape} radius="{radius!r}" length="{length!r}"/>', xyz, rpy)
    T = Pose((xyz[0], xyz[1], xyz[2]), (rpy[0], rpy[1], rpy[2])).matrix
    # Support of the segment along z, and of the disc or ball about each of its ends.
    along = np.abs(T[:3, 2])
    across = np.ones(3) if capsule else np.sqrt(np.maximum(1.0 - along**2, 0.0))
    half = 0.5 * length * along + radius * across
    slack = 0.0 if capsule else radius * (1.0 / math.cos(math.pi / 32) - 1.0)
    # The square root loses half of the digits where the axis is all but along a coordinate.
    rounding = ROUNDING + radius * math.sqrt(ROUNDING)
    for side, reach in ((T[:3, 3] - low, half), (high - T[:3, 3], half)):
        assert np.all(side >= reach - rounding)
        assert np.all(side <= reach + slack + rounding)


@pytest.mark.parametrize(
    "shape",
    [
        '<box size="1 2"/>',
        "<box/>",
        '<sphere radius="big"/>',
        '<cylinder radius="1"/>',
        '<mesh filename="a.stl"/>',
        '<plane normal="0 0 1"/>',
    ],
)
def test_a_shape_that_cannot_be_known_leaves_the_link_unknown(shape: str) -> None:
    case = case_of(link("base", visual('<box size="1 1 1"/>'), visual(shape)))
    assert link_extent(case.links["base"], "<string>") is None


def test_a_mesh_is_scaled(tmp_path: Path) -> None:
    (tmp_path / "part.obj").write_text("v 0 0 0\nv 1 2 3\n")
    robot = tmp_path / "robot.urdf"
    robot.write_text("<robot/>")
    case = case_of(link("base", visual('<mesh filename="part.obj" scale="2 -1 0.5"/>')))
    extent = link_extent(case.links["base"], str(robot))
    assert extent is not None
    low, high = extent.box()
    assert low.tolist() == [0.0, -2.0, 0.0]
    assert high.tolist() == [2.0, 0.0, 1.5]


SHELL = '<link name="shell">{}</link>'


def test_the_shape_of_a_welded_link_counts_in_the_frame_of_the_link_with_the_mass() -> None:
    case = case_of(
        link("base"),
        link("arm"),
        SHELL.format(visual('<box size="1 1 1"/>')),
        joint("turn", "base", "arm"),
        joint("weld", "arm", "shell", '<origin xyz="0 0 2"/>', type="fixed"),
    )
    ((found, extent),) = group_extents(case)
    assert found.name == "arm"
    low, high = extent.box()
    assert (low.tolist(), high.tolist()) == ([-0.5, -0.5, 1.5], [0.5, 0.5, 2.5])


def test_a_group_with_a_shape_that_cannot_be_known_is_left_out() -> None:
    case = case_of(
        link("base", visual('<box size="1 1 1"/>')),
        SHELL.format(visual('<mesh filename="shell.stl"/>')),
        joint("weld", "base", "shell", type="fixed"),
    )
    assert list(group_extents(case)) == []
